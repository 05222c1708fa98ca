"""The placed parts: the geometry of one assembly as all stages look at it, every part in its assembled pose."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar, cast

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part
from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.tolerances import Tolerances
from sashimono.geometry import se3
from sashimono.geometry.body import Body, DeepestProbe, mutual_depth
from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.features.directions import (
    DirectionConfig,
    frame_along,
    inertia_directions,
    merge_directions,
    part_directions,
)
from sashimono.geometry.overlap import intersection_depth

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class PlacedPartsConfig:
    """Tolerances, and which lines the parts' surfaces give."""

    tolerances: Tolerances = field(default_factory=Tolerances)
    directions: DirectionConfig = field(default_factory=DirectionConfig)


@dataclass(frozen=True, kw_only=True, eq=False)
class OverlapPlace:
    """A connected piece of the body that two parts share as assembled."""

    field: SignedDistance
    """Distance to its surface, in the world frame."""
    reach: float
    """How far from it the overlap is an excuse [m]."""


class PlacedParts:
    """The parts of one assembly, in place: surfaces, boxes, overlaps as assembled, sizes, and lines to try.

    Nothing that it answers changes. A set of parts is a bit mask: bit i is ``assembly.parts[i]``.
    """

    def __init__(self, assembly: Assembly, bodies: Mapping[str, Body], *, config: PlacedPartsConfig) -> None:
        """Take in the assembly and a body for each part's name."""
        self.assembly = assembly
        self.config = config
        self.tolerances = config.tolerances
        self.bodies = tuple(bodies[name] for name in assembly.names)
        self.poses = tuple(part.T_world_part for part in assembly.parts)
        self.vertices = tuple(part.vertices_world for part in assembly.parts)
        """By part: vertices in the world frame [m]."""
        self.faces = tuple(part.faces for part in assembly.parts)
        """By part: triangles."""
        self.all_vertices = np.concatenate(self.vertices)
        """The vertices of all parts, one part after another."""
        self.vertex_start = np.cumsum([0] + [len(v) for v in self.vertices])
        """By part: where its vertices begin among those of all; last, their number."""
        self.sizes = np.array([body.smallest_extent for body in self.bodies])
        """By part: the smallest extent along an inertia axis [m]."""
        self.overlaps = assembled_overlaps(assembly, self.bodies)
        """By pair: how deep the two overlap in the assembled pose [m]. A motion may go as deep, until they part."""
        self.fits = np.zeros_like(self.overlaps)
        """By pair: how deep the two may go into each other anywhere, where a fit is declared [m]; else 0."""
        self.boxes = np.array([[v.min(axis=0), v.max(axis=0)] for v in self.vertices])
        """By part: least and greatest corner of its box in the world frame [m]."""
        self._walls = np.array([body.wall for body in self.bodies])
        own = [_lines_of(part, body, config.directions) for part, body in zip(assembly.parts, self.bodies, strict=True)]
        self.part_lines = tuple(lines if len(lines) else np.eye(3) for lines, _ in own)
        """By part: the lines that its own surface and inertia give, in the world frame, heaviest first."""
        self.common_lines = merge_directions(own, config=config.directions)
        """The lines that all parts give, heaviest first; without the world's axes."""
        self.lines = merge_directions([(np.eye(3), np.full(3, 1e3)), *own], config=config.directions)
        """The world's axes, then the lines that all parts give."""
        self._known: dict[tuple[object, ...], object] = {}
        """What was worked out of the shapes alone; parts with other fits share it."""
        self.stoppers: dict[tuple[int, int], list[tuple[bool, int]]] = {}
        """By pair: probes, of the first part or the other one, that stopped the first on a straight way.
        They tell no answer; asked first, they make a no come faster (`free_travel`)."""

        self.strayed: dict[tuple[int, int], int] = {}
        """By pair: the probe of the first part that strayed last (`first_astray`); the same."""

    def __len__(self) -> int:
        return len(self.bodies)

    def with_fits(self, fits: Mapping[tuple[int, int], float]) -> PlacedParts:
        """Return the same parts, of which these pairs may go so deep into each other anywhere [m]."""
        other = copy.copy(self)
        other.fits = np.zeros_like(self.overlaps)
        for (a, b), depth in fits.items():
            other.fits[a, b] = other.fits[b, a] = depth
        return other

    @property
    def allowances(self) -> Float[np.ndarray, "part part"]:
        """By pair: how deep the two may go into each other beside any tolerance [m], to begin with."""
        return np.maximum(self.overlaps, self.fits)

    @property
    def all_parts(self) -> int:
        """The mask of all parts."""
        return (1 << len(self)) - 1

    def scale(self, a: int, b: int) -> float:
        """Return the length of a pair that depth tolerances are tied to [m]: the smaller part's smallest extent."""
        thin = self.tolerances.thin_walls * min(self._walls[a], self._walls[b])
        return float(min(self.sizes[a], self.sizes[b], thin))

    def smaller_size(self, a: int, b: int) -> float:
        """Return the smallest extent of the smaller of two parts [m]."""
        return float(min(self.sizes[a], self.sizes[b]))

    def limit(self, a: int, b: int, tolerance: float) -> float:
        """Return how deep a pair may overlap on its way [m], for a tolerance over its scale; or its fit, if deeper."""
        return float(max(self.overlaps[a, b] + tolerance * self.scale(a, b), self.fits[a, b]))

    def bare(self, a: int, b: int, tolerance: float | None = None) -> float:
        """Return how deep a pair may be where no overlap as assembled excuses it [m].

        For a tolerance over its scale, that of translations if None; or its fit, if deeper.
        """
        tolerance = self.tolerances.translation if tolerance is None else tolerance
        return float(max(tolerance * self.scale(a, b), self.fits[a, b]))

    def way_past(self, part: int, other: int, direction: Float[np.ndarray, "3"]) -> float:
        """Return how far a part goes along a direction until it is past another one [m]; 0 if it is."""
        return max(float(self.bounds_along(other, direction)[1] - self.bounds_along(part, direction)[0]), 0.0)

    def overlap_places(self, a: int, b: int) -> tuple[OverlapPlace, ...]:
        """Return the pieces of a pair's overlap as assembled, if it is an excuse only near to these; else nothing.

        An overlap that is shallow beside both parts and their walls is an excuse anywhere, and so is one of which no
        boolean can be taken, and one that is no deeper than a declared fit.
        """
        first, second = min(a, b), max(a, b)
        limits, depth = self.tolerances, float(self.overlaps[a, b])
        near = limits.shallow * self.smaller_size(a, b)
        shallow = max(self.fits[a, b], min(near, limits.shallow_wall * min(self._walls[a], self._walls[b])))
        if depth <= shallow:
            return ()
        return self.once(("places", first, second), lambda: self._overlap_places(first, second))

    def _overlap_places(self, a: int, b: int) -> tuple[OverlapPlace, ...]:
        limits, depth = self.tolerances, float(self.overlaps[a, b])
        near = limits.shallow * self.smaller_size(a, b)
        solids = [self.bodies[k].solid for k in (a, b)]
        if None in solids:
            return ()
        placed = [
            solid.transform(np.ascontiguousarray(self.poses[k][:3]))
            for solid, k in zip(solids, (a, b), strict=True)
            if solid is not None
        ]
        out = []
        for piece in (placed[0] ^ placed[1]).decompose():
            mesh = piece.to_mesh64()
            vertices = np.array(mesh.vert_properties)[:, :3]
            size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
            reach = max(limits.excuse_reach * max(size, 2.0 * depth), near)
            field = SignedDistance(vertices, np.array(mesh.tri_verts).astype(np.int64))
            out.append(OverlapPlace(field=field, reach=reach))
        return tuple(out)

    def deepest_assembled(self, a: int, b: int) -> DeepestProbe:
        """Return the deepest probe of a pair in each other as assembled."""
        T_b_a = se3.inverse(self.poses[b]) @ self.poses[a]
        return self.once(("deepest", a, b), lambda: DeepestProbe(self.bodies[a], self.bodies[b], T_b_a))

    def once(self, key: tuple[object, ...], make: Callable[[], T]) -> T:
        """Return what ``make`` returns; worked out once for each key, which says all that it depends on, fits apart."""
        if key not in self._known:
            self._known[key] = make()
        return cast(T, self._known[key])

    def parts_ahead(
        self, part: int, offset: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"], among: Sequence[int]
    ) -> list[tuple[float, int]]:
        """Return the parts whose boxes a part's box meets on its way along a direction, nearest first.

        Each with the travel [m] at which the boxes meet.

        Args:
            part: The part that moves.
            offset: Where it starts, from its assembled position [m].
            direction: A unit vector.
            among: The parts that are looked at.
        """
        others = np.asarray(among, dtype=int)
        low = self.boxes[others, 0] - self.boxes[part, 1] - offset
        high = self.boxes[others, 1] - self.boxes[part, 0] - offset
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
        apart = np.maximum(self.boxes[a, 0] - self.boxes[b, 1], self.boxes[b, 0] - self.boxes[a, 1])
        return bool((apart < gap).all())

    def boxes_in(self, rotation: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "part 2 3"]:
        """Return the parts' boxes, assembled, in a turned frame (rows of the rotation are its axes) [m]."""
        turned = self.all_vertices @ rotation.T
        starts = self.vertex_start[:-1]
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

    def bounds_along(self, part: int, direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "2"]:
        """Return the lowest and highest coordinate of a part along a unit direction, assembled [m]."""
        along = self.vertices[part] @ direction
        return np.array([along.min(), along.max()])

    def straight_removal(self, members: int, others: int, direction: Float[np.ndarray, "3"]) -> Removal:
        """Return the translation along a direction that takes the common box of some parts past those of the others.

        Nothing is checked on the way.
        """
        moving = bits(members)
        back = min(self.bounds_along(part, direction)[0] for part in moving)
        front = max((self.bounds_along(part, direction)[1] for part in bits(others)), default=back)
        clearance = 0.05 * min(self.sizes[part] for part in moving)
        return Removal.straight(direction, max(front - back, 0.0) + clearance)


def assembled_overlaps(assembly: Assembly, bodies: Sequence[Body]) -> Float[np.ndarray, "part part"]:
    """Return how deep each pair overlaps in the assembled pose [m]; 0 for pairs that do not."""
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
    """Return the lines that a part's faces, holes and inertia give, in the world frame, with weights."""
    lines, weights = part_directions(body.vertices, body.faces, config=config)
    axes = inertia_directions(body.mass_properties.inertia, config=config)
    lines = np.concatenate([lines, axes]) @ part.T_world_part[:3, :3].T
    return lines, np.concatenate([weights, np.full(len(axes), config.min_weight)])
