"""The exact check of a path: how far a part follows a geodesic before it is deeper in another part than tolerated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.free_travel import passes
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.straying import first_astray
from sashimono.geometry import se3
from sashimono.geometry.body import Body, DeepestProbe
from sashimono.geometry.distance.screw import Screw, adjoint, advance_along_screw, between, shared_stops

_STRIDES = (16, 1)
"""Every sixteenth probe is followed first: most blocked legs are blocked for these. All probes have the last word."""
_REFINE = 1.0 / 16.0
"""Where a leg stops is found to this share of the least step."""
_ARC = np.pi / 12.0
"""A turn is bounded arc by arc of at most this angle [rad]."""
_CELLS = (0.5, 0.25)
"""Of samples, and of vertices, over the depth that turns may reach: so near to one another, helices count as one."""


class Paths:
    """Paths of one part past some others, as displacements from the assembled pose in the world frame.

    Every answer is a pure function of its arguments. What the answers took is counted in ``touched`` and ``traced``.
    The probes of both parts are followed with the least step of `Tolerances`.
    """

    def __init__(
        self,
        parts: PlacedParts,
        part: int,
        others: Sequence[int],
        *,
        tolerance: float,
        parted: Mapping[int, float] | None = None,
        once_parted: float | None = None,
    ) -> None:
        """Take in the parts, and the depth allowed beyond the assembled overlap, over the pair's scale.

        The paths are of a time when the part has come apart from those that are ``parted``: their overlap as assembled
        is no excuse any more, and the depth given there is all that is allowed, over the pair's scale. To others it is
        to be no deeper than ``once_parted`` once it has parted from them; than translations may be, if None.
        """
        self.tolerance = tolerance
        self.parted = parted or {}
        self.once_parted = parts.tolerances.translation if once_parted is None else once_parted
        self.parts = parts
        self.part = part
        self.others = tuple(others)
        self.body = parts.bodies[part]
        self.T_assembled = parts.poses[part]
        self.size = float(parts.sizes[part])
        self.center = se3.apply(self.T_assembled, self.body.center[None])[0]
        """Centre of the part in the assembled pose [m], world frame."""
        self._low, self._high = parts.boxes[list(self.others)].reshape(-1, 2, 3).swapaxes(0, 1)
        self.touched: set[int] = set()
        """Parts that stopped it in any answer so far: without the others all answers but `out` are bitwise the same."""
        self.traced = 0
        """Points followed past another part so far, and their steps near it: what all answers cost."""

    def advance(self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"]) -> tuple[float, int | None]:
        """Return how far the part gets from D along ``exp(u twist) @ D``, and the part that stops it.

        The twist is spatial, in the world frame. u is 1 and the part None if nothing stops it.
        """
        scale, stopper = 1.0, None
        near = self.near(D, twist=twist)
        for stride in _STRIDES:
            for other in near:
                u = self._past(D, scale * twist, other, stride, self.parts.tolerances.least_step)
                if np.isfinite(u):
                    scale, stopper = scale * u, other
                    self.touched.add(other)
                if scale == 0.0:
                    return 0.0, stopper
        return scale, stopper

    def advance_to_contact(
        self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"]
    ) -> tuple[float, int | None]:
        """Return what `advance` does, but less by so much that the part just touches what stops it."""
        u, stopper = self.advance(D, twist)
        if stopper is None:
            return u, None
        rate = self.rate(D, twist)
        size = self.parts.smaller_size(self.part, stopper)
        start = max(0.0, u - self.parts.tolerances.least_step * size / rate)
        D_start = se3.exp(start * twist) @ D
        fine = self.parts.tolerances.least_step * _REFINE
        rest = (u - start) * twist
        past = {other: self._past(D_start, rest, other, 1, fine) for other in self.near(D_start, twist=rest)}
        self.touched.update(other for other, first in past.items() if np.isfinite(first))
        stop = start + (u - start) * min(1.0, *past.values())
        return max(0.0, stop - (fine * size + self.limit(stopper)) / rate), stopper

    def check(self, displacements: Float[np.ndarray, "waypoint 4 4"]) -> bool:
        """Return whether the part can follow the geodesics through all displacements."""
        return all(self.advance(a, twist)[1] is None for a, twist in _stretches(displacements))

    def limit(self, other: int) -> float:
        """Return how deep the part may go into one other [m]."""
        if other in self.parted:
            return self.parted[other] * self.parts.scale(self.part, other)
        return self.parts.limit(self.part, other, self.tolerance)

    def out(self, D: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
        """Return where the part is past the others' boxes when it goes straight from D along a unit direction."""
        return se3.make(None, self._way_past(self.others, D, direction) * direction) @ D

    def straight(self, D: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "6"]:
        """Return the translation from D along a unit direction past the whole assembly, not only past what remains."""
        return np.concatenate([self._way_past(range(len(self.parts)), D, direction) * direction, np.zeros(3)])

    def parts_once(self, displacements: Float[np.ndarray, "waypoint 4 4"]) -> bool:
        """Return whether a checked path holds to the bare tolerance from where an overlapping pair first parts.

        The overlap in the assembled pose excuses a pair only until the two have come apart; before that, a deep one
        only near to where it is (`first_astray`). Of those that it has ``parted`` from, `check` asks as much.
        """
        parts = self.parts
        for other in self.others:
            if other in self.parted:
                continue
            bare = parts.bare(self.part, other, self.once_parted)
            if parts.overlaps[self.part, other] > bare and not self._parts_once(displacements, other, bare):
                return False
        return True

    def _parts_once(self, displacements: Float[np.ndarray, "waypoint 4 4"], other: int, bare: float) -> bool:
        """Return whether the path stays within the bare depth of one other part from where it first is."""
        parts = self.parts
        least = parts.tolerances.least_step * parts.smaller_size(self.part, other)
        T_b_world = se3.inverse(parts.poses[other])
        apart = parts.tolerances.parted * parts.scale(self.part, other)
        parted = False
        for a, twist in _stretches(displacements):
            if not parted and np.isfinite(first_astray(parts, self.part, other, a, twist, enough=np.inf)):
                return False
            rate, T_start = self.rate(a, twist), a @ self.T_assembled
            start = 0.0
            while not parted and start < 1.0:
                deepest = DeepestProbe(self.body, parts.bodies[other], T_b_world @ se3.exp(start * twist) @ T_start)
                depth = deepest.depth
                parted = depth <= apart
                while depth > apart and start < 1.0:
                    start += max(depth - apart, least) / max(rate, least)
                    depth = deepest.depth_at(T_b_world @ se3.exp(start * twist) @ T_start)
            if parted and start < 1.0:
                D, rest = se3.exp(start * twist) @ a, (1.0 - start) * twist
                if np.isfinite(self._past(D, rest, other, 1, parts.tolerances.least_step, limit=bare)):
                    return False
        return True

    def exit(self, D: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"] | None:
        """Return where the part is past the others after a straight exit from D; None if something stops it."""
        if self.advance(D, self.straight(D, direction))[1] is not None:
            return None
        return self.out(D, direction)

    def _way_past(self, among: Sequence[int], D: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"]) -> float:
        back = self.body.lowest(D @ self.T_assembled, direction)
        fronts = [float(self.parts.bounds_along(k, direction)[1]) for k in among]
        return max(max(fronts, default=back) - back, 0.0) + 0.05 * self.size

    def distance(self, D_a: Float[np.ndarray, "4 4"], D_b: Float[np.ndarray, "4 4"]) -> float:
        """Return how far apart two displacements are [m], rotation weighed by the part's radius."""
        return self.rate(D_a, between(D_a, D_b))

    def rate(self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"]) -> float:
        """Return an upper bound of the way of any point [m] along the twist, u from 0 to 1."""
        center = se3.apply(D, self.center[None])[0]
        v, w = twist[:3], twist[3:]
        return float(np.linalg.norm(v + se3.cross(w, center)) + np.linalg.norm(w) * self.body.radius)

    def near(
        self, D: Float[np.ndarray, "4 4"], *, twist: Float[np.ndarray, "6"] | None = None, margin: float = 0.0
    ) -> list[int]:
        """Return the others whose boxes the part's box comes within the margin of [m], at D or along the twist."""
        low, high = self._swept_box(D, twist)
        meets = np.all((self._low <= high + margin) & (self._high >= low - margin), axis=1)
        return [self.others[k] for k in np.flatnonzero(meets)]

    def _swept_box(
        self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"] | None
    ) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Return bounds of the part on its way: its hull at some poses, widened by what an arc leaves its chord."""
        corners = se3.apply(D @ self.T_assembled, self.body.hull_points)
        if twist is None:
            return corners.min(axis=0), corners.max(axis=0)
        screw = Screw.of(twist)
        farthest = 0.0
        if screw.angle > 0.0:
            farthest = float(np.linalg.norm(np.cross(corners - screw.point, screw.axis), axis=1).max())
        if screw.angle > 2.0 * np.pi:
            along = np.concatenate([(corners - screw.point) @ screw.axis] * 2)
            along[len(corners) :] += float(screw.shift @ screw.axis)
            rim = farthest * np.sqrt(np.maximum(1.0 - screw.axis**2, 0.0))
            middles = screw.point + along[[along.argmin(), along.argmax()], None] * screw.axis
            return middles.min(axis=0) - rim, middles.max(axis=0) + rim
        count = max(1, int(np.ceil(screw.angle / _ARC)))
        sagitta = farthest * (1.0 - np.cos(0.5 * screw.angle / count))
        steps = [se3.exp(k / count * twist) for k in range(count + 1)]
        swept = np.concatenate([se3.apply(step, corners) for step in steps])
        return swept.min(axis=0) - sagitta, swept.max(axis=0) + sagitta

    def _past(
        self,
        D: Float[np.ndarray, "4 4"],
        twist: Float[np.ndarray, "6"],
        other: int,
        stride: int,
        least: float,
        *,
        limit: float | None = None,
    ) -> float:
        """The u at which the part is first too deep in one other; infinite if it passes.

        Too deep is more than ``limit`` [m], or than the assembled overlap and the tolerance if None.
        """
        parts = self.parts
        b = parts.bodies[other]
        size = parts.smaller_size(self.part, other)
        if limit is None:
            limit = self.limit(other)
        options = {"limit": limit, "least_step": least * size}
        T_b_world = se3.inverse(parts.poses[other])
        T_b_a = T_b_world @ D @ self.T_assembled
        T_a_b = se3.inverse(T_b_a)
        along_b = adjoint(T_b_world, twist)
        probes = se3.apply(T_b_a, self.body.probes[::stride])
        stops = shared_stops(probes, along_b, self._cells(self.body, other, stride))
        first, steps = advance_along_screw(b.signed_distance, probes, along_b, stops=stops, **options)
        self.traced += len(probes) + steps
        if first == 0.0:
            return 0.0
        scale = first if np.isfinite(first) else 1.0
        # seen from the part, the other moves the opposite way
        probes = se3.apply(T_a_b, b.probes[::stride])
        back = -scale * adjoint(T_a_b, along_b)
        stops = shared_stops(probes, back, self._cells(b, other, stride))
        second, steps = advance_along_screw(self.body.signed_distance, probes, back, stops=stops, **options)
        self.traced += len(probes) + steps
        return scale * second if np.isfinite(second) else first

    def _cells(self, body: Body, other: int, stride: int) -> Float[np.ndarray, "probe"]:
        """How near two helices are that count as one, for every so many of a body's probes [m]."""
        count = len(body.probes)
        cells = np.where(np.arange(count) < len(body.samples), *_CELLS)[::stride]
        return cells * self.parts.tolerances.turning * self.parts.scale(self.part, other)


def _stretches(
    displacements: Float[np.ndarray, "waypoint 4 4"],
) -> Iterator[tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "6"]]]:
    """Where each stretch of a path begins, and its twist; what goes on along the same screw is one stretch."""
    start, whole, last = displacements[0], np.zeros(6), np.zeros(6)
    for a, b in pairwise(displacements):
        twist = between(a, b)
        if np.linalg.norm(twist[3:]) > 0.1 and np.abs(twist - last).max() <= 1e-9 * np.abs(twist).max():
            whole = whole + twist
        else:
            if whole.any():
                yield start, whole
            start, whole = a, twist
        last = twist
    if whole.any():
        yield start, whole


def hit_by_removal(parts: PlacedParts, part: int, removal: Removal, among: Sequence[int]) -> int:
    """Return the mask of the parts that a removal runs into, to the tolerance of its kind: translations, or turns."""
    if np.abs(removal.displacements[:, :3, :3] - np.eye(3)).max() > 1e-12:
        return hit_by_path(parts, part, removal, among, tolerance=parts.tolerances.turning)
    mask = 0
    stops = removal.displacements[:, :3, 3]
    for other in among:
        for leg, (start, stop) in enumerate(pairwise(stops)):
            length = np.inf if leg == len(stops) - 2 else float(np.linalg.norm(stop - start))
            direction = (stop - start) / np.linalg.norm(stop - start)
            if not passes(parts, part, start, direction, other, length=length):
                mask |= 1 << other
                break
    return mask


def hit_by_path(parts: PlacedParts, part: int, removal: Removal, among: Sequence[int], *, tolerance: float) -> int:
    """Return the mask of the parts that a removal by any motion runs into; tolerance as for `Paths`."""
    mask = 0
    for other in among:
        paths = Paths(parts, part, [other], tolerance=tolerance)
        displacements = removal.displacements
        last = paths.exit(displacements[-1], removal.exit_direction) if paths.check(displacements) else None
        # a part that the motion parts from, and meets again, is hit too
        if last is None or not paths.parts_once(np.array([*displacements, last])):
            mask |= 1 << other
    return mask
