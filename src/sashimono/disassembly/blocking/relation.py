"""Which parts stop a part that moves to infinity along a direction (Wilson's blocking relation).

There are three looks. Each looks only at what the one before left open. First come coarse depth maps of all parts
at once, then a fine map of two parts' common window. Sphere tracing of surface points has the last word: a motion
that it passes goes nowhere deeper than the pair overlaps as assembled, plus the tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sashimono.disassembly.blocking import depth_maps
from sashimono.disassembly.free_travel import passes
from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.geometry.features.directions import frame_along, perpendicular_directions


@dataclass(frozen=True, kw_only=True)
class BlockingConfig:
    """Resolution of the depth maps; lengths are relative to the smaller part's smallest extent unless said otherwise.

    The last look, sphere tracing, holds to `Tolerances.translation`.
    """

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


class Blocking:
    """The blocking relation of placed parts over their lines, worked out as it is asked for.

    A pure function of the parts and the configuration: what was asked before changes how fast an
    answer comes, never what it is. Direction ``2 k`` is ``+lines[k]``, ``2 k + 1`` the
    opposite. Part sets are bit masks: bit i is ``assembly.parts[i]``.
    """

    def __init__(self, parts: PlacedParts, *, config: BlockingConfig) -> None:
        self.parts = parts
        self.config = config
        self.lines = parts.lines
        """The lines along which parts leave, both ways."""
        self._frames = [frame_along(line) for line in self.lines]
        self._coarse = self._classify()
        """By line: what the coarse maps say of each pair; never changed."""
        self._fine: dict[tuple[int, int, int], bool] = {}
        """By line and pair: whether the second look calls it blocked."""
        self._rotated: dict[tuple[int, int], np.ndarray] = {}
        self._slabs: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._passes: dict[tuple[int, int, int], bool] = {}
        """By line and pair: whether the first passes the second."""
        self._passes_one: dict[tuple[int, int, int], bool] = {}
        """By part, direction and other, where it matters which of the two moves."""
        self._masks: dict[tuple[int, int], tuple[int, int]] = {}
        self._stopped: dict[tuple[int, int], int] = {}
        """By part and direction: the parts that some look has found to stop it so far. It makes a no come faster."""
        self._passed: dict[tuple[int, int], int] = {}
        """By part and direction: the parts that it was found to pass so far. It makes a yes come faster."""

    def __len__(self) -> int:
        return len(self.parts)

    @property
    def count_directions(self) -> int:
        """How many directions there are."""
        return 2 * len(self.lines)

    def direction(self, direction_index: int) -> Float[np.ndarray, "3"]:
        """Return the unit vector of a direction."""
        line = self.lines[direction_index // 2]
        return line if direction_index % 2 == 0 else -line

    def masks(self, part: int, direction_index: int) -> tuple[int, int]:
        """Return the parts that by the coarse maps block this part along a direction, and those left open."""
        key = (part, direction_index)
        if key not in self._masks:
            classes = self._coarse[direction_index // 2]
            row = classes[part] if direction_index % 2 == 0 else classes[:, part]
            self._masks[key] = (_mask(row == depth_maps.BLOCKED), _mask(row == depth_maps.OPEN))
        return self._masks[key]

    def blockers(self, part: int, direction_index: int, among: int | None = None) -> int:
        """Return the mask of the parts, among those given, that by the maps stop this part along a direction.

        It asks the coarse maps, and the fine ones where those leave it open. Tracing (`passes`) may find more.
        """
        blocked, unclear = self.masks(part, direction_index)
        if among is not None:
            blocked, unclear = blocked & among, unclear & among
        while unclear:
            other = (unclear & -unclear).bit_length() - 1
            unclear &= unclear - 1
            if self.is_blocked_by(part, direction_index, other):
                blocked |= 1 << other
        return blocked

    def is_free(self, part: int, direction_index: int, among: int) -> bool:
        """Return whether this part can go to infinity along a direction past all of ``among``."""
        known = self.known(part, direction_index, among)
        if known is not None:
            return known
        passed = self._passed.get((part, direction_index), 0)
        among &= ~(1 << part | passed)
        for other in bits(self.masks(part, direction_index)[1] & among):
            if self.is_blocked_by(part, direction_index, other):
                return False
        if not all(self.passes(part, direction_index, other) for other in bits(among)):
            return False
        self._passed[part, direction_index] = passed | among
        return True

    def known(self, part: int, direction_index: int, among: int) -> bool | None:
        """Return what `is_free` would, as far as it is known without a further look; None if it is not."""
        if self.known_blockers(part, direction_index) & among & ~(1 << part):
            return False
        return None if among & ~(1 << part | self._passed.get((part, direction_index), 0)) else True

    def mapped_blockers(self, part: int, direction_index: int) -> int:
        """Return the mask of the parts that by the coarse maps stop this part."""
        return self.masks(part, direction_index)[0]

    def known_blockers(self, part: int, direction_index: int) -> int:
        """Return the mask of the parts that by the coarse maps, or any closer look so far, stop this part."""
        return self.mapped_blockers(part, direction_index) | self._stopped.get((part, direction_index), 0)

    def is_blocked_by(self, part: int, direction_index: int, other: int) -> bool:
        """Return whether ``other`` stops this part, by the maps (second look where the first left it open)."""
        line = direction_index // 2
        a, b = (part, other) if direction_index % 2 == 0 else (other, part)
        classes = self._coarse[line]
        if classes[a, b] != depth_maps.OPEN:
            return bool(classes[a, b] == depth_maps.BLOCKED)
        if (line, a, b) not in self._fine:
            size, overlap, faces = self.parts.smaller_size(a, b), self.parts.allowances[a, b], self.parts.faces
            stopped = depth_maps.pass_finely(
                self._along(line, a), faces[a], self._along(line, b), faces[b],
                max(self.config.pixel * size, 0.75 * overlap), self.config.window_cap,
                max(self.config.axial * size, overlap), self.config.margin,
            )  # fmt: skip
            for (x, y), blocked in zip(((a, b), (b, a)), stopped, strict=True):
                self._fine[line, x, y] = bool(blocked)
                # of the other way round, the coarse maps may have said more already
                if blocked and classes[x, y] == depth_maps.OPEN:
                    self._note_stop(line, x, y)
        return self._fine[line, a, b]

    def passes(self, part: int, direction_index: int, other: int) -> bool:
        """Return whether sphere tracing lets this part pass ``other``."""
        if self.parts.overlap_places(part, other):
            return self._passes_near_overlap(part, direction_index, other)
        line = direction_index // 2
        a, b = (part, other) if direction_index % 2 == 0 else (other, part)
        key = (line, a, b)
        if key not in self._passes:
            self._passes[key] = self._slides_past(line, a, b) or passes(self.parts, a, np.zeros(3), self.lines[line], b)
            if not self._passes[key]:
                self._note_stop(line, a, b)
        return self._passes[key]

    def _passes_near_overlap(self, part: int, direction_index: int, other: int) -> bool:
        """The same where a deep overlap is an excuse only near to where it is: that stays with the one that stays."""
        key = (part, direction_index, other)
        if key not in self._passes_one:
            direction = self.direction(direction_index)
            self._passes_one[key] = passes(self.parts, part, np.zeros(3), direction, other)
            if not self._passes_one[key]:
                self._stopped[part, direction_index] = self._stopped.get((part, direction_index), 0) | 1 << other
        return self._passes_one[key]

    def _classify(self) -> list[np.ndarray]:
        """Return, by line, what the coarse maps say of each pair."""
        config, parts = self.config, self.parts
        options = np.array([config.axial, config.pixel, config.coarse_margin])
        all_faces = np.concatenate(parts.faces)
        face_start = np.cumsum([0] + [len(f) for f in parts.faces])
        found = []
        for frame in self._frames:
            classes = np.zeros((len(self), len(self)), np.uint8)
            depth_maps.classify(
                parts.all_vertices @ frame.T, parts.vertex_start, all_faces, face_start, config.coarse_resolution,
                parts.sizes, parts.allowances, options, classes,
            )  # fmt: skip
            found.append(classes)
        return found

    def _slides_past(self, line: int, a: int, b: int) -> bool:
        """Return whether a slab along the direction keeps the two apart all the way: then no point gets too deep.

        A point is no deeper in a part than it is past any plane that has the part on one side.
        """
        if line not in self._slabs:
            normals = perpendicular_directions(self.lines[line], self.lines)
            along = self.parts.all_vertices @ normals.T
            starts = self.parts.vertex_start[:-1]
            self._slabs[line] = (np.minimum.reduceat(along, starts), np.maximum.reduceat(along, starts))
        low, high = self._slabs[line]
        overlap = np.minimum(high[a] - low[b], high[b] - low[a]).min()
        return bool(overlap <= self.parts.bare(a, b))

    def _along(self, line: int, part: int) -> Float[np.ndarray, "vertex 3"]:
        key = (line, part)
        if key not in self._rotated:
            self._rotated[key] = self.parts.vertices[part] @ self._frames[line].T
        return self._rotated[key]

    def _note_stop(self, line: int, a: int, b: int) -> None:
        """Take down that b stops a along a line; then a stops b the other way."""
        for part, direction_index, other in ((a, 2 * line, b), (b, 2 * line + 1, a)):
            self._stopped[part, direction_index] = self._stopped.get((part, direction_index), 0) | 1 << other


def _mask(row: Bool[np.ndarray, "part"]) -> int:
    return int.from_bytes(np.packbits(row, bitorder="little").tobytes(), "little")
