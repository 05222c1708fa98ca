"""Which parts stop a part that moves to infinity along a direction (Wilson's blocking relation).

Three looks, each only at what the one before left open: coarse depth maps of all parts at once, a
fine map of two parts' common window, and sphere tracing of surface points, which has the last word:
a motion that it passes goes nowhere deeper than the pair overlaps already, plus the tolerance.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from sashimono.assembly import Assembly, Part
from sashimono.disassembly.blocking import depth_maps
from sashimono.disassembly.blocking.parting import parting_travel
from sashimono.disassembly.masks import bits
from sashimono.geometry import se3
from sashimono.geometry.body import Body, mutual_depth
from sashimono.geometry.distance.march import march
from sashimono.geometry.features.directions import (
    DirectionConfig,
    frame_along,
    inertia_directions,
    merge_directions,
    part_directions,
    perpendicular_directions,
)
from sashimono.geometry.overlap import intersection_depth


@dataclass(frozen=True, kw_only=True)
class BlockingConfig:
    """Resolution and tolerances of the blocking relation; lengths are relative to the smaller part's
    smallest inertia-frame extent unless said otherwise."""

    directions: DirectionConfig = field(default_factory=DirectionConfig)
    coarse_resolution: int = 128
    """Pixels across the whole assembly in the first look."""
    coarse_margin: int = 2
    """A square of 2 margin + 1 coarse pixels must overlap to call a pair blocked at first look."""
    pixel: float = 1.0 / 40.0
    """Pixel of the second look."""
    window_cap: int = 512
    """Most pixels along a side of the second look's window; a wider one gets coarser pixels."""
    margin: int = 1
    """A square of 2 margin + 1 fine pixels must overlap: less is contact along a wall."""
    axial: float = 0.05
    """Overlap along the motion that counts as contact of end faces."""
    tolerance: float = 0.015
    """Depth beyond the assembled overlap that the last look allows, over the pair's scale (`Blocking.scale`); under
    the verification tolerance."""
    thin_walls: float = 20.0
    """A pair's scale is at most so many thicknesses of either part's thin walls: shells never slip through."""
    least_step: float = 1.0 / 64.0
    """Shortest step of the sphere tracing along a wall that the part slides on."""


class Blocking:
    """The blocking relation of one assembly over a list of directions, worked out as it is asked for.

    A pure function of the assembly and the configuration: what was asked before changes how fast an
    answer comes, never what it is. Signed direction ``2 k`` is ``+directions[k]``, ``2 k + 1`` the
    opposite. Part sets are bit masks: bit i is ``assembly.parts[i]``.
    """

    def __init__(self, assembly: Assembly, bodies: Mapping[str, Body], *, config: BlockingConfig) -> None:
        self.assembly = assembly
        self.config = config
        self.bodies = [bodies[name] for name in assembly.names]
        self.poses = [part.T_world_part for part in assembly.parts]
        self._vertices = [part.vertices_world for part in assembly.parts]
        self._faces = [part.faces for part in assembly.parts]
        self._all_vertices = np.concatenate(self._vertices)
        self._all_faces = np.concatenate(self._faces)
        self._vertex_start = np.cumsum([0] + [len(v) for v in self._vertices])
        self._face_start = np.cumsum([0] + [len(f) for f in self._faces])
        self.sizes = np.array([body.smallest_extent for body in self.bodies])
        self._walls = np.array([body.wall for body in self.bodies])
        self.allowances = pair_allowances(assembly, self.bodies)
        self.directions = np.zeros((0, 3))
        self._boxes = np.array([[v.min(axis=0), v.max(axis=0)] for v in self._vertices])
        self._coarse: list[np.ndarray] = []
        """By line: what the coarse maps say of each pair; never changed."""
        self._fine: dict[tuple[int, int, int], bool] = {}
        """By line and pair: whether the second look calls it blocked."""
        self._frames: list[np.ndarray] = []
        self._rotated: dict[tuple[int, int], np.ndarray] = {}
        self._slabs: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._passes: dict[tuple[int, int, int], bool] = {}
        self._masks: dict[tuple[int, int], tuple[int, int]] = {}
        self._stopped: dict[tuple[int, int], int] = {}
        """By part and signed direction: parts that any look has found to stop it so far. Only a short cut to a no."""
        own = [_lines_of(part, body, config.directions) for part, body in zip(assembly.parts, self.bodies, strict=True)]
        self.part_lines = [lines if len(lines) else np.eye(3) for lines, _ in own]
        """The lines that each part's own surface and inertia give, in the world frame, heaviest first."""
        self.common_lines = merge_directions(own, config=config.directions)
        """The lines that all parts give, heaviest first; other than the directions, without the world's axes."""
        self.add_directions(merge_directions([(np.eye(3), np.full(3, 1e3)), *own], config=config.directions))

    def __len__(self) -> int:
        return len(self.bodies)

    @property
    def all_parts(self) -> int:
        """The mask of all parts."""
        return (1 << len(self)) - 1

    @property
    def count_signed(self) -> int:
        """How many signed directions there are."""
        return 2 * len(self.directions)

    def direction(self, signed: int) -> Float[np.ndarray, "3"]:
        """Return the unit vector of a signed direction."""
        line = self.directions[signed // 2]
        return line if signed % 2 == 0 else -line

    def add_directions(self, lines: Float[np.ndarray, "line 3"]) -> None:
        """Extend the relation by more directions, sorted out by the coarse maps at once."""
        config = self.config
        options = np.array([config.axial, config.pixel, config.coarse_margin])
        for line in lines:
            frame = frame_along(line)
            self._frames.append(frame)
            rotated = self._all_vertices @ frame.T
            relation = np.zeros((len(self), len(self)), np.uint8)
            depth_maps.classify(
                rotated, self._vertex_start, self._all_faces, self._face_start, config.coarse_resolution,
                self.sizes, self.allowances, options, relation,
            )  # fmt: skip
            self._coarse.append(relation)
        self.directions = np.concatenate([self.directions, lines])

    def masks(self, part: int, signed: int) -> tuple[int, int]:
        """Return the parts that by the coarse maps block this part along a signed direction, and those left open."""
        key = (part, signed)
        if key not in self._masks:
            relation = self._coarse[signed // 2]
            row = relation[part] if signed % 2 == 0 else relation[:, part]
            self._masks[key] = (_mask(row == depth_maps.BLOCKED), _mask(row == depth_maps.OPEN))
        return self._masks[key]

    def blockers(self, part: int, signed: int, among: int | None = None) -> int:
        """Return the mask of the parts, among those given, that by the maps stop this part along a signed direction.

        Coarse maps, and fine ones where those leave it open; tracing (`passes`) may find more.
        """
        blocked, unclear = self.masks(part, signed)
        if among is not None:
            blocked, unclear = blocked & among, unclear & among
        while unclear:
            other = (unclear & -unclear).bit_length() - 1
            unclear &= unclear - 1
            if self.is_blocked_by(part, signed, other):
                blocked |= 1 << other
        return blocked

    def is_free(self, part: int, signed: int, among: int) -> bool:
        """Return whether this part can go to infinity along a signed direction past all of ``among``."""
        among &= ~(1 << part)
        blocked, unclear = self.masks(part, signed)
        if (blocked | self._stopped.get((part, signed), 0)) & among:
            return False
        for other in bits(unclear & among):
            if self.is_blocked_by(part, signed, other):
                return False
        return all(self.passes(part, signed, other) for other in bits(among))

    def is_blocked_by(self, part: int, signed: int, other: int) -> bool:
        """Return whether ``other`` stops this part, by the maps (second look where the first left it open)."""
        line = signed // 2
        a, b = (part, other) if signed % 2 == 0 else (other, part)
        relation = self._coarse[line]
        if relation[a, b] != depth_maps.OPEN:
            return bool(relation[a, b] == depth_maps.BLOCKED)
        if (line, a, b) not in self._fine:
            size = min(self.sizes[a], self.sizes[b])
            allowance = self.allowances[a, b]
            stopped = depth_maps.pass_finely(
                self._along(line, a), self._faces[a], self._along(line, b), self._faces[b],
                max(self.config.pixel * size, 0.75 * allowance), self.config.window_cap,
                max(self.config.axial * size, allowance), self.config.margin,
            )  # fmt: skip
            for (x, y), blocked in zip(((a, b), (b, a)), stopped, strict=True):
                self._fine[line, x, y] = bool(blocked)
                # of the other way round, the coarse maps may have said more already
                if blocked and relation[x, y] == depth_maps.OPEN:
                    self._note_stop(line, x, y)
        return self._fine[line, a, b]

    def passes(self, part: int, signed: int, other: int) -> bool:
        """Return whether sphere tracing lets this part pass ``other``."""
        line = signed // 2
        a, b = (part, other) if signed % 2 == 0 else (other, part)
        key = (line, a, b)
        if key not in self._passes:
            self._passes[key] = self._slides_past(line, a, b) or bool(
                np.isinf(self.travel(a, np.zeros(3), self.directions[line], b))
            )
            if not self._passes[key]:
                self._note_stop(line, a, b)
        return self._passes[key]

    def travel(
        self,
        part: int,
        offset: Float[np.ndarray, "3"],
        direction: Float[np.ndarray, "3"],
        other: int,
        *,
        length: float = np.inf,
        tolerance: float | None = None,
    ) -> float:
        """Return how far a part, displaced by ``offset``, goes along a unit direction before it is too
        deep in ``other`` [m]; infinite if it passes, or goes as far as ``length``.

        Too deep is more than the pair overlaps as assembled plus the tolerance [m], that of the configuration
        unless given.
        """
        a, b = self.bodies[part], self.bodies[other]
        T_b_a = se3.inverse(self.poses[other]) @ se3.make(None, offset) @ self.poses[part]
        size = min(self.sizes[part], self.sizes[other])
        step = self.config.least_step * size
        along_b = self.poses[other][:3, :3].T @ direction
        length = min(length, _separation(a, b, T_b_a, along_b))
        if length <= 0.0:
            return np.inf
        bare = self.config.tolerance * self.scale(part, other) if tolerance is None else tolerance
        limit = bare + float(self.allowances[part, other])
        travel = _march_both(a, b, T_b_a, along_b, length=length, limit=limit, least_step=step)
        if travel == 0.0 or self.allowances[part, other] <= bare:
            return travel
        # once the two have parted, the bare tolerance holds
        length = min(length, travel)
        parted = parting_travel(a, b, T_b_a, along_b, length=length, tolerance=bare, least_step=step)
        T_b_a = se3.make(None, parted * along_b) @ T_b_a
        rest = _march_both(a, b, T_b_a, along_b, length=length - parted, limit=bare, least_step=step)
        return min(travel, parted + rest)

    def scale(self, a: int, b: int) -> float:
        """Return the length of a pair that depth tolerances are tied to [m]: the smaller part's smallest extent."""
        thin = self.config.thin_walls * min(self._walls[a], self._walls[b])
        return float(min(self.sizes[a], self.sizes[b], thin))

    def limit(self, part: int, other: int) -> float:
        """Return how deep a pair may overlap on its way [m]."""
        return float(self.allowances[part, other] + self.config.tolerance * self.scale(part, other))

    def met(
        self, part: int, offset: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"], among: Sequence[int]
    ) -> list[tuple[float, int]]:
        """Return the parts whose boxes a part's box meets on its way along a direction, nearest first.

        Each with the travel [m] at which the boxes meet.
        """
        others = np.asarray(among, dtype=int)
        low = self._boxes[others, 0] - self._boxes[part, 1] - offset
        high = self._boxes[others, 1] - self._boxes[part, 0] - offset
        with np.errstate(divide="ignore", invalid="ignore"):
            times = np.stack([low / direction, high / direction])
        still = np.abs(direction) < 1e-12
        beside = (still & ((low > 0.0) | (high < 0.0))).any(axis=1)
        enter = np.where(still, -np.inf, times.min(axis=0)).max(axis=1)
        leave = np.where(still, np.inf, times.max(axis=0)).min(axis=1)
        hit = ~beside & (leave >= 0.0) & (enter <= leave + 1e-12)
        found = zip(np.maximum(enter[hit], 0.0).tolist(), others[hit].tolist(), strict=True)
        return sorted((float(t), int(k)) for t, k in found)

    def boxes_meet(self, a: int, b: int, gap: float) -> bool:
        """Return whether two parts' boxes, assembled, are nearer than the gap [m]."""
        apart = np.maximum(self._boxes[a, 0] - self._boxes[b, 1], self._boxes[b, 0] - self._boxes[a, 1])
        return bool((apart < gap).all())

    def vertices(self, part: int) -> Float[np.ndarray, "vertex 3"]:
        """Return a part's vertices in the assembled pose, in the world frame [m]."""
        return self._vertices[part]

    def faces(self, part: int) -> Int[np.ndarray, "face 3"]:
        """Return a part's triangles."""
        return self._faces[part]

    def boxes_in(self, rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "part 2 3"]:
        """Return the parts' boxes, assembled, in a turned frame (rows of the rotation are its axes) [m]."""
        turned = self._all_vertices @ rotation.T
        starts = self._vertex_start[:-1]
        return np.stack([np.minimum.reduceat(turned, starts), np.maximum.reduceat(turned, starts)], axis=1)

    def frame(self, part: int) -> Float[np.ndarray, "3 3"]:
        """Return a frame, its axes as rows, along the lines that a part's own surface gives."""
        lines = self.part_lines[part]
        across = np.abs(lines @ lines[0])
        first, second = lines[0], lines[int(np.argmin(np.round(across, 6)))]
        if float(across.min()) > 0.99:
            return frame_along(first)
        second = second - (second @ first) * first
        second /= np.linalg.norm(second)
        return np.stack([second, np.cross(first, second), first])

    def world_bounds_along(self, part: int, direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2"]:
        """Return the lowest and highest coordinate of a part along a unit direction, assembled [m]."""
        along = self._vertices[part] @ direction
        return np.array([along.min(), along.max()])

    def _slides_past(self, line: int, a: int, b: int) -> bool:
        """Whether a slab along the direction keeps the two apart all the way: then no point gets too deep.

        A point is no deeper in a part than it is past any plane that has the part on one side.
        """
        if line not in self._slabs:
            normals = perpendicular_directions(self.directions[line], self.directions)
            along = self._all_vertices @ normals.T
            starts = self._vertex_start[:-1]
            self._slabs[line] = (np.minimum.reduceat(along, starts), np.maximum.reduceat(along, starts))
        low, high = self._slabs[line]
        overlap = np.minimum(high[a] - low[b], high[b] - low[a]).min()
        return bool(overlap <= self.config.tolerance * self.scale(a, b))

    def _along(self, line: int, part: int) -> Float[np.ndarray, "vertex 3"]:
        key = (line, part)
        if key not in self._rotated:
            self._rotated[key] = self._vertices[part] @ self._frames[line].T
        return self._rotated[key]

    def _note_stop(self, line: int, a: int, b: int) -> None:
        """Take down that b stops a along a line; then a stops b the other way."""
        for part, signed, other in ((a, 2 * line, b), (b, 2 * line + 1, a)):
            self._stopped[part, signed] = self._stopped.get((part, signed), 0) | 1 << other


def pair_allowances(assembly: Assembly, bodies: Sequence[Body]) -> Float[np.ndarray, "part part"]:
    """Return how deep each pair overlaps in the assembled pose [m]: as deep it may be on its way."""
    out = np.zeros((len(bodies), len(bodies)))
    boxes = [part.bounds_world for part in assembly.parts]
    for a in range(len(bodies)):
        for b in range(a + 1, len(bodies)):
            if (boxes[a][0] > boxes[b][1]).any() or (boxes[b][0] > boxes[a][1]).any():
                continue
            T_b_a = se3.inverse(assembly.parts[b].T_world_part) @ assembly.parts[a].T_world_part
            depth = mutual_depth(bodies[a], bodies[b], T_b_a)
            if depth > 0.0:
                # probes miss where a coarse mesh has none, and err on a surface that meets itself
                exact = intersection_depth(bodies[a], bodies[b], T_b_a)
                depth = depth if exact is None else exact
            out[a, b] = out[b, a] = depth
    return out


def _lines_of(
    part: Part, body: Body, config: DirectionConfig
) -> tuple[Float[np.ndarray, "line 3"], Float[np.ndarray, "line"]]:
    """What a part's faces, holes and inertia give to try, in the world frame, with weights."""
    lines, weights = part_directions(body.vertices, body.faces, config=config)
    axes = inertia_directions(body.mass_properties.inertia, config=config)
    lines = np.concatenate([lines, axes]) @ part.T_world_part[:3, :3].T
    return lines, np.concatenate([weights, np.full(len(axes), config.min_weight)])


def _separation(a: Body, b: Body, T_b_a: Float[np.ndarray, "4 4"], along_b: Float[np.ndarray, "3"]) -> float:
    """How far a must go along the direction until its box is past b's, as seen along the direction."""
    back = float((se3.apply(T_b_a, a.vertices) @ along_b).min())
    front = float((b.vertices @ along_b).max())
    return front - back


def _march_both(
    a: Body,
    b: Body,
    T_b_a: Float[np.ndarray, "4 4"],
    along_b: Float[np.ndarray, "3"],
    *,
    length: float,
    limit: float,
    least_step: float,
) -> float:
    """How far a goes in b's frame before a probe of either is too deep in the other; inf if it passes."""
    points = se3.apply(T_b_a, a.probes)
    first = march(b.signed_distance, points, along_b, length=length, limit=limit, least_step=least_step)
    if first == 0.0:
        return 0.0
    T_a_b = se3.inverse(T_b_a)
    points, back = se3.apply(T_a_b, b.probes), -(T_a_b[:3, :3] @ along_b)
    length = min(length, first)
    return min(first, march(a.signed_distance, points, back, length=length, limit=limit, least_step=least_step))


def _mask(row: Bool[np.ndarray, "part"]) -> int:
    return int.from_bytes(np.packbits(row, bitorder="little").tobytes(), "little")
