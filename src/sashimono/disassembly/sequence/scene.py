"""What is asked of the parts to compare orders: who touches whom, who is like whom, what fasteners demand, how far a
part slides."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.fasteners.precedence import precedence
from sashimono.fasteners.recognise import Fastener
from sashimono.fasteners.tools import ToolWay, tool_ways
from sashimono.geometry.features.directions import part_directions
from sashimono.geometry.mesh.measures import inertia_extents
from sashimono.plan import CloseFit


class OrderScene:
    """One assembly, as orders are compared by. Sets of parts are bit masks."""

    def __init__(
        self,
        cascade: Cascade,
        fasteners: Sequence[Fastener],
        *,
        up: Float[np.ndarray, "3"] | None = None,
        close_fits: Sequence[CloseFit] = (),
    ) -> None:
        """Take in the parts, their fasteners and close fits; ``up`` is the file's own, +z if None."""
        assembly, parts = cascade.assembly, cascade.parts
        self.names = assembly.names
        self.index = {name: k for k, name in enumerate(self.names)}
        self.up = np.array([0.0, 0.0, 1.0]) if up is None else np.asarray(up, dtype=np.float64)
        self.parts = parts
        self.fasteners = {self.index[f.part]: f for f in fasteners}
        self.neighbours = [cascade.touching(part) for part in range(len(parts))]
        """By part: mask of those that it touches."""
        self.size = float(np.linalg.norm(np.ptp(parts.all_vertices, axis=0)))
        boxes = np.ptp(parts.boxes, axis=1)
        volumes = np.array([body.mass_properties.volume for body in parts.bodies])
        bulk = np.prod(boxes + 1e-9 * boxes.max(), axis=1) + volumes
        extents = np.array([inertia_extents(body.vertices, body.faces) for body in parts.bodies])
        footprints = np.prod(np.sort(extents, axis=1)[:, 1:], axis=1)
        scores = footprints * np.array([1 + mask.bit_count() for mask in self.neighbours])
        self._base_scores = scores / scores.max()
        self.bulk = bulk
        """By part: volume of its box and its own [m³]."""
        self._alike = self._find_alike()
        self.comes_before = [0] * len(parts)
        """By part: mask of those that fasteners demand to be placed after it."""
        before = [0] * len(parts)
        for first, later in sorted(precedence(assembly, fasteners)):
            self.comes_before[self.index[first]] |= 1 << self.index[later]
            before[self.index[later]] |= 1 << self.index[first]
        self._needs = {
            k: before[k]
            for k, f in self.fasteners.items()
            if f.kind in ("screw", "bolt", "nut", "circlip") and before[k]
        }
        self._close_fits = close_fits
        self._fastener_mask = sum(1 << k for k in self.fasteners)
        self._slides: dict[tuple[int, int, bytes], float] = {}
        self._strung_along: dict[tuple[int, bytes], int] = {}
        self._lines: dict[int, Float[np.ndarray, "line 3"]] = {}
        self._bounds: dict[bytes, Float[np.ndarray, "part 2"]] = {}
        self._tools: dict[int, tuple[ToolWay, ...]] = {}
        self._tool_masks: dict[int, tuple[int, ...]] = {}

    def tools(self, part: str) -> tuple[ToolWay, ...]:
        """Return the ways to drive a fastener, with what is in the way of each wherever it is in the order."""
        k = self.index[part]
        if k not in self._tools:
            self._tools[k] = tool_ways(self.parts.assembly, self.fasteners[k]) if k in self.fasteners else ()
        return self._tools[k]

    def is_tool_blocked(self, members: int, rest: int) -> bool:
        """Return whether a fastener's tool has no room past the parts that are placed before it."""
        k = members.bit_length() - 1
        if members & (members - 1) or k not in self.fasteners:
            return False
        if k not in self._tool_masks:
            self._tool_masks[k] = tuple(self.mask(way.blockers) for way in self.tools(self.names[k]))
        masks = self._tool_masks[k]
        return bool(masks) and all(mask & rest for mask in masks)

    def mask(self, names: Iterable[str]) -> int:
        """Return the mask of these parts."""
        out = 0
        for name in names:
            out |= 1 << self.index[name]
        return out

    def touched_by(self, members: int) -> int:
        """Return the mask of the parts that touch any of these."""
        out = 0
        for part in bits(members):
            out |= self.neighbours[part]
        return out & ~members

    def alike_to(self, members: int) -> int:
        """Return the mask of the other parts of the same shape, or fasteners of one kind and size; 0 for several."""
        return self._alike[members.bit_length() - 1] if members.bit_count() == 1 else 0

    def is_fastener(self, members: int) -> bool:
        """Return whether these are fasteners only."""
        return not members & ~self._fastener_mask

    def regardless_of_alike(self, parts: int) -> int:
        """Return the mask with, of alike parts, the first ones in place of as many others."""
        for group in self._groups:
            inside = parts & group
            if inside and inside != group:
                first = sum(1 << part for part in bits(group)[: inside.bit_count()])
                parts = parts & ~group | first
        return parts

    def base_score(self, base: int) -> float:
        """Return the largest side of a base's box times its neighbours (a mask of one part), over the most of any."""
        return float(self._base_scores[base.bit_length() - 1])

    def waiting(self, members: int, rest: int, gone: int) -> int:
        """Return how many fasteners, placed later, could be set before these members are placed."""
        if members & self._fastener_mask:
            return 0
        return sum(1 for k, needs in self._needs.items() if gone >> k & 1 and needs & ~rest == 0)

    def slide(self, members: int, rest: int, direction: Float[np.ndarray, "3"]) -> float:
        """Return how far members go along a direction until they are past what they touch, over the product's size."""
        touched = self.touched_by(members) & rest
        key = (members, touched, direction.tobytes())
        if key not in self._slides:
            bounds = self.bounds_along(direction)
            back = min(bounds[part, 0] for part in bits(members))
            front = max((bounds[part, 1] for part in bits(touched)), default=back)
            self._slides[key] = max(0.0, float(front - back)) / self.size
        return self._slides[key]

    def threaded(self, members: int, rest: int, direction: Float[np.ndarray, "3"]) -> float:
        """Return how far a part with a close fit goes over others on the line of that fit that it does not fit with at
        last, over the product's size: a flange that is put on over the end of the next shaft."""
        if members & (members - 1) or not (strung := self._strung(members.bit_length() - 1, direction) & rest):
            return 0.0
        bounds = self.bounds_along(direction)
        front = max(bounds[part, 1] for part in bits(strung))
        return max(0.0, float(front - bounds[members.bit_length() - 1, 0])) / self.size

    def _strung(self, part: int, direction: Float[np.ndarray, "3"]) -> int:
        """Mask of the parts that have a close fit with something on the line of a part's fit along a direction."""
        key = (part, direction.tobytes())
        if key not in self._strung_along:
            self._strung_along[key] = self._find_strung(part, direction)
        return self._strung_along[key]

    def _find_strung(self, part: int, direction: Float[np.ndarray, "3"]) -> int:
        own = [fit for fit in self._close_fits if self.names[part] in (fit.part, fit.other)]
        own = [fit for fit in own if abs(float(np.array(fit.axis) @ direction)) > 0.9999]
        found, partners = 0, 1 << part
        for fit in own:
            partners |= self.mask((fit.part, fit.other))
            for other in self._close_fits:
                apart = np.cross(np.array(other.point) - np.array(fit.point), np.array(fit.axis))
                along = abs(float(np.dot(other.axis, fit.axis)))
                if along > 0.9999 and float(np.linalg.norm(apart)) < 1e-3 * self.size:
                    found |= self.mask((other.part, other.other))
        return found & ~partners

    def bounds_along(self, direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "part 2"]:
        """Return the lowest and highest coordinate of every part along a direction [m]."""
        key = np.round(direction, 9).tobytes()
        if key not in self._bounds:
            along = self.parts.all_vertices @ direction
            starts = self.parts.vertex_start[:-1]
            found = [np.minimum.reduceat(along, starts), np.maximum.reduceat(along, starts)]
            self._bounds[key] = np.stack(found, axis=1)
        return self._bounds[key]

    def own_lines(self, part: int) -> Float[np.ndarray, "line 3"]:
        """Return the lines that a part's faces and holes give, in the world frame."""
        if part not in self._lines:
            body, pose = self.parts.bodies[part], self.parts.poses[part]
            lines, _ = part_directions(body.vertices, body.faces, config=self.parts.config.directions)
            self._lines[part] = lines @ pose[:3, :3].T
        return self._lines[part]

    def _find_alike(self) -> list[int]:
        """By part: mask of the others of its shape, or of its kind and size if both are fasteners."""
        groups: dict[object, int] = {}
        keys: list[object] = list(range(len(self.names)))
        for number, names in enumerate(self.parts.assembly.identical):
            for name in names:
                keys[self.index[name]] = ("shape", number)
        for k, f in self.fasteners.items():
            if f.size:
                keys[k] = (f.kind, f.size, f.tool)
        for k, key in enumerate(keys):
            groups[key] = groups.get(key, 0) | 1 << k
        self._groups = [mask for mask in groups.values() if mask.bit_count() > 1]
        return [groups[key] & ~(1 << k) for k, key in enumerate(keys)]
