"""Which fits let parts come apart that hold one another: the shallowest straight ways out past what can give."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, millimetres
from sashimono.disassembly.free_travel import passes
from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.shared_bodies import SharedBodies, SharedConfig
from sashimono.fits.arms import find_arm
from sashimono.fits.config import FitConfig
from sashimono.fits.piercing import slips_through
from sashimono.fits.pressing import Pressed, is_squeezed, places, pressed
from sashimono.fits.shapes import ElasticShape, elastic_shape, sits_tight
from sashimono.geometry import se3
from sashimono.geometry.features.tube import TubeConfig
from sashimono.plan import DeclaredFit, FitKind


@dataclass(frozen=True, kw_only=True, eq=False)
class _Way:
    """A straight way out, and what has to give on it."""

    part: int
    direction: Float[np.ndarray, "3"]
    depths: dict[int, float]
    """By part that is in the way: how deep the two go into each other [m]."""
    strain: float
    """The greatest of these, over the most that the pair could give."""


@dataclass(frozen=True, kw_only=True)
class _Told:
    """What gives, of two parts."""

    part: int
    kind: FitKind
    words: str
    give: float
    """How far it could [m]."""


def find_fits(
    finder: FitFinder, assembly: Assembly, found: DisassemblyResult, unsolved: Collection[str]
) -> tuple[DeclaredFit, ...]:
    """Return the fits with which what is left over may come apart, on the top level and inside subassemblies.

    Args:
        finder: Finds those of each set of parts.
        assembly: All parts.
        found: How far they came apart.
        unsolved: Names of all parts that have no motion: of those that came apart, it was refuted.
    """
    held = [{level.base, *(part for part, _ in level.stuck)} for level in found.levels()]
    held[0] |= {assembly.index(name) for name in unsolved}.difference(*held)
    fits: dict[frozenset[str], DeclaredFit] = {}
    for group in held:
        for fit in finder.find(sum(1 << part for part in group)):
            fits.setdefault(frozenset(fit.parts), fit)
    return tuple(fits.values())


def planned_depths(
    assembly: Assembly, fits: Sequence[DeclaredFit], *, config: FitConfig
) -> dict[tuple[int, int], float]:
    """Return by pair, as positions of its parts, how deep level 1 may let the two go into each other [m]."""
    depths = {}
    for fit in fits:
        first, second = (assembly.index(name) for name in fit.parts)
        depths[first, second] = config.planned * fit.depth
    return depths


class FitFinder:
    """Finds the fits to declare among parts that hold one another. What was asked before is answered at once."""

    def __init__(self, parts: PlacedParts, *, config: FitConfig) -> None:
        self._parts, self.config = parts, config
        tube = TubeConfig(depth=(0.0, 2.0 * config.press_radius))
        self._shared = SharedBodies(parts, config=SharedConfig(tube=tube))
        self._shapes: dict[int, ElasticShape | None] = {}
        self._traced = 0
        """Points followed past another part."""
        self._found: dict[int, tuple[DeclaredFit, ...]] = {}

    def find(self, remaining: int) -> tuple[DeclaredFit, ...]:
        """Return fits with which some, or all, of the remaining parts (a mask) come apart; none if nothing can give.

        Parts that leave without are taken out first. Then, of all straight ways out on which all that is in the way
        can give, that with the least need is taken, and so on.
        """
        if remaining not in self._found:
            self._found[remaining] = self._find(remaining)
        return self._found[remaining]

    def _find(self, remaining: int) -> tuple[DeclaredFit, ...]:
        declared: dict[tuple[int, int], DeclaredFit] = {}
        self._traced = 0
        if remaining.bit_count() > self.config.max_parts:
            return ()
        while remaining.bit_count() > 1:
            ways = sorted(self._ways(remaining), key=lambda way: (round(way.strain, 9), way.part))
            for way in ways[: self.config.max_ways]:
                found = self._declared(way)
                if found is not None:
                    for fit in found:
                        key = self._key(fit)
                        if key not in declared or declared[key].depth < fit.depth:
                            declared[key] = fit
                    remaining &= ~(1 << way.part)
                    break
            else:
                break
        return tuple(declared[key] for key in sorted(declared))

    def _key(self, fit: DeclaredFit) -> tuple[int, int]:
        a, b = (self._parts.assembly.index(name) for name in fit.parts)
        return min(a, b), max(a, b)

    def _ways(self, remaining: int) -> list[_Way]:
        """The straight ways out of all parts; only one, if there is one on which nothing has to give."""
        ways = []
        moving = bits(remaining)
        if len(moving) == 2:  # what frees either of two parts frees both
            moving = [min(moving, key=lambda k: (self._parts.sizes[k], k))]
        for part in moving:
            others = bits(remaining & ~(1 << part))
            for direction in self._directions(part, others):
                way = self._way(part, others, direction)
                if way is not None:
                    ways.append(way)
                    if not way.depths:
                        return [way]
        return ways

    def _directions(self, part: int, others: list[int]) -> Float[np.ndarray, "direction 3"]:
        """The axes, the lines of a part, and those of the others, both ways."""
        parts, kept = self._parts, []
        for line in np.concatenate([np.eye(3), parts.part_lines[part], *(parts.part_lines[k] for k in others)]):
            if len(kept) < self.config.lines and all(abs(line @ other) < 0.9998 for other in kept):
                kept.append(line)
        return np.array([sign * line for line in kept for sign in (1.0, -1.0)])

    def _way(self, part: int, others: list[int], direction: Float[np.ndarray, "3"]) -> _Way | None:
        """The way out of a part along a direction; None if something is in the way that cannot give so much."""
        giving = []
        for _, other in self._parts.parts_ahead(part, np.zeros(3), direction, others):
            if self._traced >= self.config.max_traced:
                return None
            if self._passes(part, other, direction, 0.0):
                continue
            most = self._most(part, other) / self.config.margin
            if self._tolerated(part, other) >= most or not self._passes(part, other, direction, most):
                return None
            giving.append(other)
        depths = {other: self._depth(part, other, direction) for other in giving}
        strain = max((depth / self._most(part, other) for other, depth in depths.items()), default=0.0)
        return _Way(part=part, direction=direction, depths=depths, strain=strain)

    def _depth(self, part: int, other: int, direction: Float[np.ndarray, "3"]) -> float:
        """How deep a part goes into one that can give on its straight way [m], to the accuracy."""
        low, high = self._tolerated(part, other), self._most(part, other) / self.config.margin
        if self._passes(part, other, direction, low):
            return low  # no deeper than tolerated, but too far from where the two overlap, or after they have parted
        while high - low > self.config.accuracy * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if self._passes(part, other, direction, middle) else (middle, high)
        return high

    def _passes(self, part: int, other: int, direction: Float[np.ndarray, "3"], depth: float) -> bool:
        """Whether a part goes straight past another if the two may go so deep into each other."""
        self._traced += len(self._parts.bodies[part].probes) + len(self._parts.bodies[other].probes)
        pair = self._parts.with_fits({(part, other): depth}) if depth > 0.0 else self._parts
        return passes(pair, part, np.zeros(3), direction, other)

    def _tolerated(self, part: int, other: int) -> float:
        """The depth that needs no fit [m], near to where two parts overlap."""
        return float(self._parts.overlaps[part, other]) + self._parts.bare(part, other)

    def _most(self, a: int, b: int) -> float:
        """The most that a pair can give, by its sizes and shapes [m]."""
        parts, config = self._parts, self.config
        give = config.solid * parts.smaller_size(a, b)
        return max(give, *(0.0 if (shape := self._shape(k)) is None else shape.give for k in (a, b)))

    def _shape(self, part: int) -> ElasticShape | None:
        if part not in self._shapes:
            body = self._parts.bodies[part]
            self._shapes[part] = elastic_shape(body, self._axes(part), config=self.config)
        return self._shapes[part]

    def _axes(self, part: int) -> Float[np.ndarray, "axis 3"]:
        """Lines of a part's surface, and principal axes of its mass and of its normals, in its own frame."""
        body = self._parts.bodies[part]
        lines = self._parts.part_lines[part] @ self._parts.poses[part][:3, :3]
        normals = body.sample_normals
        # a short spring's inertia tells no axis, but its normals look along that more than across
        return np.concatenate([lines, body.mass_properties.axes.T, np.linalg.eigh(normals.T @ normals)[1].T])

    def _declared(self, way: _Way) -> list[DeclaredFit] | None:
        """The fits that a way needs; None if one of the pairs is not known to be able to give."""
        parts, fits = self._parts, []
        for other, depth in way.depths.items():
            found = self._told(way.part, other, way.direction, depth)
            if found is None or slips_through(parts, way.part, other, way.direction, depth, config=self.config):
                return None
            declared = max(self.config.margin * depth, parts.limit(way.part, other, 1.05 * parts.tolerances.plan))
            names = [parts.assembly.names[k] for k in (found.part, way.part + other - found.part)]
            give = f"{millimetres(depth)} has to give, of {millimetres(found.give)} that could"
            reason = f"elastic: {give}: {names[0]} is {found.words}"
            fit = DeclaredFit(parts=(names[0], names[1]), kind=found.kind, depth=round(declared, 9), reason=reason)
            fits.append(fit)
        return fits

    def _told(self, part: int, other: int, direction: Float[np.ndarray, "3"], depth: float) -> _Told | None:
        """What kind of fit two parts have, which of them gives, and what it is; None if none is told."""
        found = pressed(self._parts, part, other, direction, depth, config=self.config)
        sides = ((part, other, found[0]), (other, part, found[1]))
        for giving, rigid, where in sides:
            shape = self._shape(giving)
            if shape is not None and depth <= shape.give and self._in_place(shape, giving, rigid, depth, where):
                return _Told(part=giving, kind=shape.kind, words=shape.words, give=shape.give)
        if (press := self._press(part, other, direction, depth)) is not None:
            return press
        if depth > self.config.solid * self._parts.smaller_size(part, other):
            return None
        for giving, rigid, where in sides:
            if (snap := self._arms(giving, rigid, where)) is not None:
                return snap
        return None

    def _in_place(self, shape: ElasticShape, giving: int, rigid: int, depth: float, where: list[Pressed]) -> bool:
        """Whether what is elastic by its shape is where such a part is used, and is pressed as it can give."""
        parts = self._parts
        if shape.kind == "clip":
            return bool(parts.overlaps[giving, rigid] >= self.config.relaxed * depth)
        if shape.axis is None or any(abs(entry.push @ shape.axis) > self.config.across for entry in where):
            return False
        if shape.kind == "seal":
            T = se3.inverse(parts.poses[rigid]) @ parts.poses[giving]
            return sits_tight(parts.bodies[giving], parts.bodies[rigid], T, shape.axis, self.config)
        return True

    def _press(self, part: int, other: int, direction: Float[np.ndarray, "3"], depth: float) -> _Told | None:
        """A press fit: two round surfaces about one axis that overlap all around as assembled."""
        overlap, config = float(self._parts.overlaps[part, other]), self.config
        if overlap <= 0.0 or depth > config.press * overlap:
            return None
        tube = self._shared.tube(part, other, direction)
        if tube is None or depth > config.press_radius * tube.outer_radius:
            return None
        smaller = min(part, other, key=lambda k: (self._parts.sizes[k], k))
        words = (
            f"pressed in round, {millimetres(overlap)} as assembled, at a radius of {millimetres(tube.outer_radius)}"
        )
        give = min(config.press * overlap, config.press_radius * tube.outer_radius)
        return _Told(part=smaller, kind="press", words=words, give=give)

    def _arms(self, giving: int, rigid: int, where: list[Pressed]) -> _Told | None:
        """What bends, if a part gives by arms wherever it is pressed."""
        body, obstacle, arms = self._parts.bodies[giving], self._parts.bodies[rigid], []
        if not where:
            return None
        for entry in places(where, config=self.config):
            found = find_arm(body, entry.point, entry.push, entry.depth, config=self.config)
            if found is None or found[0].give < entry.depth:
                return None
            arm, back = found
            if not entry.room_behind(back, obstacle) or is_squeezed(entry, back, where, config=self.config):
                return None
            arms.append(arm)
        arm = min(arms, key=lambda arm: arm.give)
        words = f"bent, an arm {millimetres(arm.length)} long and {millimetres(arm.thickness)} thick"
        return _Told(part=giving, kind="snap", words=words, give=arm.give)
