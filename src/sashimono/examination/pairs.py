"""Pairs of parts: which touch, which are a hair apart, which overlap, how deep, and what that may be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Overlap
from sashimono.examination.config import DoctorConfig
from sashimono.examination.findings import Clearance, Guess, PairOverlap
from sashimono.fasteners.recognise import Fastener
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.geometry.features.tube import Tube, fit_tube, shared_body
from sashimono.geometry.overlap import intersection_depth


class Pairs:
    """The pairs of an assembly's parts, in their assembled poses."""

    def __init__(self, assembly: Assembly, bodies: Mapping[str, Body], config: DoctorConfig) -> None:
        """Take in the bodies by name."""
        self.assembly, self.bodies, self.config = assembly, bodies, config
        self.poses = {part.name: part.T_world_part for part in assembly.parts}
        self._overlapping = {frozenset((o.first, o.second)) for o in assembly.overlaps}

    def smaller(self, first: str, second: str) -> float:
        """Return the smaller part's smallest extent [m]."""
        return min(self.bodies[first].smallest_extent, self.bodies[second].smallest_extent)

    def _near(self) -> Iterator[tuple[str, str]]:
        """Pairs whose boxes come as near as touching parts do."""
        names = self.assembly.names
        boxes = np.array([part.bounds_world for part in self.assembly.parts]).reshape(-1, 2, 3)
        extents = np.array([self.bodies[name].smallest_extent for name in names])
        for i in range(len(names) - 1):
            gap = self.config.touching * np.minimum(extents[i], extents[i + 1 :])[:, None]
            low, high = boxes[i + 1 :, 0] - gap, boxes[i + 1 :, 1] + gap
            meet = ((low <= boxes[i, 1]) & (high >= boxes[i, 0])).all(axis=1)
            yield from ((names[i], names[i + 1 + int(k)]) for k in np.flatnonzero(meet))

    @cached_property
    def _looked_at(self) -> tuple[dict[str, list[str]], list[Clearance]]:
        touching: dict[str, list[str]] = {name: [] for name in self.assembly.names}
        clearances = []
        for first, second in self._near():
            smallest = self.smaller(first, second)
            sides = [self._gaps(first, second), self._gaps(second, first)]
            reach = self.config.touching * smallest
            met = any((np.abs(gaps) <= reach).any() for gaps, _, _ in sides)
            if met or frozenset((first, second)) in self._overlapping:
                touching[first].append(second)
                touching[second].append(first)
            limits = (self.config.least_clearance * smallest, self.config.tiny * smallest)
            best = max((_share_between(facing, count, limits) for _, facing, count in sides), key=lambda each: each[0])
            if best[0] >= self.config.clearance_share:
                clearances.append(Clearance(first=first, second=second, gap=best[1], relative=best[1] / smallest))
        return touching, sorted(clearances, key=lambda each: (each.gap, each.first, each.second))

    def _gaps(self, name: str, other: str) -> tuple[np.ndarray, np.ndarray, int]:
        """Distances of a part's probes from the other's surface, of its samples that face it, and how many it has."""
        a, b = self.bodies[name], self.bodies[other]
        T_b_a = se3.inverse(self.poses[other]) @ self.poses[name]
        reach = self.config.touching * self.smaller(name, other)
        probes = se3.apply(T_b_a, a.probes)
        probes = probes[((probes > b.bounds[0] - reach) & (probes < b.bounds[1] + reach)).all(axis=1)]
        distances = b.signed_distance.query(probes) if len(probes) else np.zeros(0)
        seen, outward = se3.apply(T_b_a, a.samples), a.sample_normals @ T_b_a[:3, :3].T
        d, n = b.signed_distance.normals(seen, 1.01 * reach)
        facing = (n * outward).sum(axis=1) < -self.config.facing
        return distances, d[facing], len(a.samples)

    @property
    def touching(self) -> dict[str, tuple[str, ...]]:
        """For each part, those that it touches."""
        return {name: tuple(others) for name, others in self._looked_at[0].items()}

    @property
    def clearances(self) -> tuple[Clearance, ...]:
        """Gaps of a hair between facing surfaces, smallest first."""
        return tuple(self._looked_at[1])

    def nearest(self, name: str) -> tuple[str, float] | None:
        """Return the part nearest to one and the gap between them [m]; None if it is the only one."""
        own = self.assembly.part(name).bounds_world
        body = self.bodies[name]
        body.move(self.poses[name])
        best: tuple[str, float] | None = None
        boxes = {
            part.name: float(np.linalg.norm(np.maximum(0.0, np.maximum(own[0] - high, low - own[1]))))
            for part in self.assembly.parts
            if part.name != name
            for low, high in [part.bounds_world]
        }
        for other in sorted(boxes, key=lambda each: boxes[each]):
            if best is not None and boxes[other] >= best[1]:
                break
            self.bodies[other].move(self.poses[other])
            gap = body.distance(self.bodies[other])
            if best is None or gap < best[1]:
                best = (other, gap)
        return best

    def overlaps(self, fasteners: Sequence[Fastener]) -> tuple[PairOverlap, ...]:
        """Return the pairs that share volume, worst first, with their depth and what each may be."""
        known = {fastener.part: fastener for fastener in fasteners}
        measured = self.config.measured_overlaps
        return tuple(self._overlap(pair, known, measure=k < measured) for k, pair in enumerate(self.assembly.overlaps))

    def _overlap(self, pair: Overlap, known: Mapping[str, Fastener], *, measure: bool) -> PairOverlap:
        first, second = self.bodies[pair.first], self.bodies[pair.second]
        T_second_first = se3.inverse(self.poses[pair.second]) @ self.poses[pair.first]
        depth = None
        if measure:
            depth = intersection_depth(
                first, second, T_second_first, accuracy=0.01, max_points=self.config.depth_points
            )
        guess = self._guess(pair, depth, known)
        return PairOverlap(
            first=pair.first,
            second=pair.second,
            volume=pair.volume,
            fraction=pair.fraction,
            depth=None if guess == "duplicate" else depth,  # their surfaces coincide
            guess=guess,
        )

    def _guess(self, pair: Overlap, depth: float | None, known: Mapping[str, Fastener]) -> Guess:
        volumes = [self.bodies[name].mass_properties.volume for name in (pair.first, pair.second)]
        if pair.fraction > self.config.same and min(volumes) > self.config.same * max(volumes):
            return "duplicate"
        fastener = next((known[name] for name in (pair.first, pair.second) if name in known), None)
        if pair.fraction > self.config.swallowed:
            return "inside" if fastener is None else "hole not drawn"
        tube = self._tube(pair, fastener)
        if tube is not None:
            thickness = 0.5 * (1.0 - tube.inner_radius / tube.outer_radius)
            if thickness >= self.config.thread:
                return "thread"
            return "rounding" if thickness < self.config.facets and fastener is None else "press fit"
        if depth is not None and depth <= self.config.rounding * self.smaller(pair.first, pair.second):
            return "rounding"
        if fastener is not None:
            return "thread" if fastener.thread_pitch is not None else "hole not drawn"
        return "drawing error"

    def _tube(self, pair: Overlap, fastener: Fastener | None) -> Tube | None:
        """The thin tube that the two share, about the fastener's axis or an inertia axis of either."""
        shared = shared_body(
            self.bodies[pair.first], self.bodies[pair.second], self.poses[pair.first], self.poses[pair.second]
        )
        if shared is None:
            return None
        axes = [] if fastener is None else [fastener.axis]
        for name in (pair.first, pair.second):
            axes += list((self.poses[name][:3, :3] @ self.bodies[name].mass_properties.axes).T)
        tubes = (fit_tube(shared, axis, config=self.config.round_fit) for axis in axes)
        return next((tube for tube in tubes if tube is not None), None)


def _share_between(distances: Float[np.ndarray, "n"], count: int, limits: tuple[float, float]) -> tuple[float, float]:
    """Share of ``count`` samples whose distance is between the limits, and the median of those [m]."""
    within = distances[(distances > limits[0]) & (distances <= limits[1])]
    return len(within) / count, float(np.median(within)) if len(within) else 0.0
