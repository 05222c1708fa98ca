"""What one part may run into while it moves: the table, the fixed parts, the parts still resting.

A motion between two poses is certified continuously by conservative advancement: from
a pose with gap g nothing is hit within a displacement of g, forwards and back. Cheap lower bounds of the
gap come from slabs along fixed directions (discrete oriented polytopes); exact
distances between meshes are asked for only where these are too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import Body, displacement_rate
from sashimono.plan import Table


@dataclass(frozen=True, kw_only=True, eq=False)
class Obstacle:
    """A body that stands still during a step: a fixed part, or one that still rests."""

    body: Body
    T_world_part: Float[np.ndarray, "4 4"]


@dataclass(frozen=True, kw_only=True)
class EdgeCheck:
    """Whether the motion from one pose to another is free."""

    free: bool
    min_gap: float
    """Certified lower bound of the gap on the way if free [m], else the gap where it was found too small."""
    blocked_by: str | None
    """What came too near: a part's name, or "table"; None if free, or if the checks ran out."""
    poses: int
    """Poses looked at."""
    distances: int
    """Exact mesh distances among them."""


def slab_directions(R_table: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "13 3"]:
    """Return the unit directions of a 26-sided polytope in the table's frame, its normal first."""
    grid = np.array([(x, y, z) for x in (0, 1, -1) for y in (0, 1, -1) for z in (0, 1, -1)], dtype=np.float64)
    half = [g for g in grid if tuple(g) > (0.0, 0.0, 0.0)]
    half.sort(key=lambda g: (abs(g).sum(), abs(g[0]) + abs(g[1]), tuple(-g)))
    directions = np.array(half) @ R_table.T
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


class Scene:
    """The obstacles around one moving part; answers how far away they are."""

    def __init__(
        self,
        moving: Body,
        obstacles: Sequence[Obstacle],
        table: Table,
        directions: Float[np.ndarray, "direction 3"],
        *,
        clearance: float,
        max_checks: int,
    ) -> None:
        self.moving = moving
        self.obstacles = tuple(obstacles)
        self.table = table
        self.clearance = clearance
        self._directions = np.vstack([table.normal, directions])
        self._max_checks = max_checks
        supports = [o.body.support(o.T_world_part, self._directions) for o in self.obstacles]
        shape = (len(self.obstacles), len(self._directions))
        self._low = np.array([low for low, _ in supports]).reshape(shape)
        self._high = np.array([high for _, high in supports]).reshape(shape)

    def with_clearance(self, clearance: float) -> Scene:
        """Return the same scene with another clearance [m]."""
        other = copy(self)
        other.clearance = clearance
        return other

    def top(self) -> float:
        """Return the greatest coordinate of any obstacle along the table's normal [m]; the table's if there is none."""
        return float(self._high[:, 0].max()) if self.obstacles else self.table.offset

    def distance(self, T: Float[np.ndarray, "4 4"], k: int) -> float:
        """Return the gap between the surfaces of the moving part and obstacle k [m], 0 if they cross."""
        obstacle = self.obstacles[k]
        obstacle.body.move(obstacle.T_world_part)
        self.moving.move(T)
        return self.moving.distance(obstacle.body)

    def collides(self, T: Float[np.ndarray, "4 4"], k: int) -> bool:
        """Return whether the moving part at this pose and obstacle k share a point, containment included."""
        obstacle = self.obstacles[k]
        obstacle.body.move(obstacle.T_world_part)
        self.moving.move(T)
        return self.moving.collides(obstacle.body)

    def slab_gaps(self, T: Float[np.ndarray, "4 4"]) -> tuple[Float[np.ndarray, "obstacle"], float]:
        """Return lower bounds of the gap to each obstacle (negative: slabs overlap), and the gap to the table [m]."""
        return self._gaps(*self.moving.support(T, self._directions), np.zeros(3))

    def _gaps(
        self, low: Float[np.ndarray, "direction"], high: Float[np.ndarray, "direction"], shift: Float[np.ndarray, "3"]
    ) -> tuple[Float[np.ndarray, "obstacle"], float]:
        """The same for the part's extents along the directions, shifted."""
        along = self._directions @ shift
        low, high = low + along, high + along
        gaps = np.maximum(low - self._high, self._low - high).max(axis=1)
        return gaps, float(low[0] - self.table.offset)

    def exit_travel(self, T: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"], margin: float) -> float:
        """Return how far along a unit direction the part keeps the margin to every obstacle from there on [m].

        By slabs alone, so more than strictly needed; finite if the direction is one of the
        slabs', and within a factor of it otherwise.
        """
        if not self.obstacles:
            return 0.0
        low, high = self.moving.support(T, self._directions)
        rate = self._directions @ direction
        ahead, behind = self._high - low, high - self._low
        missing = np.where(rate > 0.0, ahead, behind) + margin
        parted = np.minimum(ahead, behind).min(axis=1, where=np.abs(rate) < 1e-12, initial=np.inf) <= -margin
        moving = np.abs(rate) >= 1e-12
        travel = (missing[:, moving] / np.abs(rate[moving])).min(axis=1)
        return float(np.where(parted, 0.0, np.maximum(travel, 0.0)).max())

    def blocker(self, T: Float[np.ndarray, "4 4"], *, table: bool = True) -> str | None:
        """Return the name of something nearer than the clearance to the part at this pose, or None."""
        gaps, table_gap = self.slab_gaps(T)
        if table and table_gap < self.clearance:
            return "table"
        for k in np.argsort(gaps, kind="stable").tolist():
            if gaps[k] >= self.clearance:
                break
            if self.collides(T, k) or self.distance(T, k) < self.clearance:
                return self.obstacles[k].body.name
        return None

    def hit(self, T: Float[np.ndarray, "4 4"]) -> str | None:
        """Return the name of something that the part meets at this pose, or None: quick, and no proof of freedom."""
        gaps, table_gap = self.slab_gaps(T)
        if table_gap < self.clearance:
            return "table"
        for k in np.flatnonzero(gaps <= 0.0).tolist():
            if self.collides(T, k):
                return self.obstacles[k].body.name
        return None

    def check_edge(
        self, T_a: Float[np.ndarray, "4 4"], T_b: Float[np.ndarray, "4 4"], *, table: bool = True
    ) -> EdgeCheck:
        """Return whether the geodesic from a to b keeps clear of everything, a disjoint start taken for granted.

        Every pose looked at has the full clearance, and between two of them at least
        half of it is certified. ``table=False`` leaves the table out.
        """
        twist = se3.log(se3.inverse(T_a) @ T_b)
        length = displacement_rate(self.moving, twist)
        if length == 0.0:
            return EdgeCheck(free=True, min_gap=np.inf, blocked_by=None, poses=0, distances=0)
        for u in (0.5, 1.0):
            if (name := self.hit(_along(T_a, twist, u))) is not None and (table or name != "table"):
                return EdgeCheck(free=False, min_gap=0.0, blocked_by=name, poses=1, distances=0)
        return self._advance(T_a, twist, length, table)

    def _advance(self, T_a: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"], length: float, table: bool):
        """Look at poses along the edge until the intervals that their gaps certify cover it.

        A gap g certifies the clearance's half as far as g less that half, to both sides. So the next pose is looked at
        beyond the end of what is certified, as far again as the last pose reached; if a hole is left, in its middle.
        """
        near = self.clearance + 0.1 * self.moving.size  # below this a slab bound is not worth a step
        known = np.full(len(self.obstacles), -np.inf)
        known_at = np.zeros(len(self.obstacles))
        distances = 0
        # on a straight way the extents only shift, and nothing is nearer to the table than at one of its ends
        spans = None if twist[3:].any() else self.moving.support(T_a, self._directions)
        table_limits = table and spans is None
        lowest = np.inf
        if table and spans is not None:
            lowest = self.slab_gaps(_along(T_a, twist, 1.0))[1]
            if lowest < self.clearance:
                return _blocked("table", lowest, 1, distances)
        looks: list[tuple[float, float]] = []
        beyond: list[tuple[float, float]] = []
        certified, at = 0.0, 0.0
        for poses in range(1, self._max_checks + 1):
            T = _along(T_a, twist, at / length)
            slabs, table_gap = self.slab_gaps(T) if spans is None else self._gaps(*spans, T[:3, 3] - T_a[:3, 3])
            gaps = np.maximum(slabs, known - np.abs(at - known_at))
            nearest = table_gap if table_limits else np.inf
            for k in np.argsort(gaps, kind="stable").tolist():
                if gaps[k] >= min(near, nearest):
                    break  # it is no nearer than what limits the step
                gaps[k] = known[k] = self.distance(T, k)
                known_at[k] = at
                distances += 1
                if gaps[k] < self.clearance:
                    return _blocked(self.obstacles[k].body.name, float(gaps[k]), poses, distances)
                nearest = min(nearest, gaps[k])
            if table and table_gap < self.clearance:
                return _blocked("table", table_gap, poses, distances)
            gap = min(float(gaps.min(initial=np.inf)), table_gap if table_limits else np.inf)
            lowest = min(lowest, table_gap if table else np.inf)
            looks.append((at, gap))
            place, reach = at, gap - self.clearance / 2.0
            beyond.append((place, reach))
            while beyond and beyond[-1][0] - beyond[-1][1] <= certified:
                place, reach = beyond.pop()
                certified = max(certified, place + reach)
            if beyond:
                at = (certified + beyond[-1][0] - beyond[-1][1]) / 2.0
            elif place == length:  # the last one taken off is the farthest
                return EdgeCheck(
                    free=True, min_gap=min(lowest, _lowest(looks)), blocked_by=None, poses=poses, distances=distances
                )
            else:
                at = min(certified + reach, length)  # lands on the end exactly
        return _blocked(None, 0.0, self._max_checks, distances)


def _lowest(looks: list[tuple[float, float]]) -> float:
    """A lower bound of the gap along a way, from gaps at some places: it changes by no more than the way between."""
    between = ((a + b - (v - u)) / 2.0 for (u, a), (v, b) in pairwise(sorted(looks)))
    return min([*(gap for _, gap in looks), *between])


def _blocked(name: str | None, gap: float, poses: int, distances: int) -> EdgeCheck:
    return EdgeCheck(free=False, min_gap=float(gap), blocked_by=name, poses=poses, distances=distances)


def _along(T_a: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"], u: float) -> Float[np.ndarray, "4 4"]:
    if not twist[3:].any():
        T = T_a.copy()
        T[:3, 3] += T_a[:3, :3] @ (u * twist[:3])
        return T
    return T_a @ se3.exp(u * twist)
