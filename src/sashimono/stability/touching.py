"""Where placed parts touch one another and the table, and which pairs are fastened."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import Body, mutual_depth
from sashimono.geometry.features.spread import spread
from sashimono.plan import Table
from sashimono.stability.config import StabilityConfig

_INSET = 1e-3
"""How far a face's corners are moved into it, over the way to its centre: so that a corner has one normal."""
_MOST_CORNERS = 6000
_STEADY = 0.95
"""Least cosine between gradients a gap apart that belong to one smooth stretch of surface."""
_INWARD = 0.05
"""How far behind the other's surface its matter is looked for, over the gap up to which the two count as touching."""
_FLAT = 0.9
"""Cosine between up and a normal from which on one part lies on the other."""
_LET_DOWN = 4
"""Ways by which a part is let down, to see what leans and carries it."""
_STOPPED = 0.1
"""How much deeper it must get, over the gap up to which the two count as touching."""


class Touch(NamedTuple):
    """Touching points of one body with another, in the world frame."""

    points: Float[np.ndarray, "point 3"]
    """[m]."""
    normals: Float[np.ndarray, "point 3"]
    """Unit, into the first body: the directions in which the second can push it."""


class Touching:
    """Touching points and fastened pairs of bodies at their assembled poses, each worked out once."""

    def __init__(
        self,
        bodies: Mapping[str, Body],
        poses: Mapping[str, Float[np.ndarray, "4 4"]],
        *,
        config: StabilityConfig,
        fastened: Iterable[tuple[str, str]] = (),
    ) -> None:
        """Take in bodies by name and their poses ``T_world_part``; ``fastened`` names pairs that are so anyway."""
        self.bodies = bodies
        self.poses = poses
        self.config = config
        self._fastened = {frozenset(pair): True for pair in fastened}
        self._depths: dict[frozenset[str], float] = {}
        self._touches: dict[tuple[str, str], Touch] = {}
        self._carrying: dict[tuple[str, str, bytes], Touch] = {}
        self._around: dict[str, frozenset[str]] = {}
        self._joined: dict[str, frozenset[str]] = {}
        corners = {name: _box_corners(body) for name, body in bodies.items()}
        self._boxes = {
            name: np.array([seen.min(axis=0), seen.max(axis=0)])
            for name, seen in ((name, se3.apply(poses[name], corners[name])) for name in bodies)
        }

    def with_fastened(self, pairs: Iterable[tuple[str, str]]) -> Touching:
        """Return the same with more pairs that are fastened anyway; what was worked out before is not asked again."""
        out = copy(self)
        # touching points are the same, and shared; what is fastened is its own
        out._joined = {}
        out._fastened = self._fastened | {frozenset(pair): True for pair in pairs}
        return out

    def between(self, first: str, second: str) -> Touch:
        """Return where the second body touches the first; its normals point into the first."""
        if (first, second) not in self._touches:
            low, high = sorted((first, second))
            touch = self._find(low, high)
            self._touches[low, high] = touch
            self._touches[high, low] = Touch(touch.points, -touch.normals)
        return self._touches[first, second]

    def carrying(self, first: str, second: str, up: Float[np.ndarray, "3"]) -> Touch:
        """Return the same, normals made level that lean but carry nothing, for gravity along ``-up``.

        A chamfer that faces a wall just above the wall's end seems to lie on it, and would slip past it. So where
        nothing lies flat on the other, the upper part is let down: to carry it, the two must get deeper into one
        another.
        """
        key = (first, second, up.tobytes())
        if key not in self._carrying:
            touch = self.between(first, second)
            lean, normals = touch.normals @ up, touch.normals
            for upper, lower, side in ((first, second, lean), (second, first, -lean)):
                leaning = (side > self.config.upright) & (side < _FLAT)
                if (
                    leaning.any()
                    and not (side >= _FLAT).any()
                    and not self._stops(upper, lower, up, float(side[leaning].min()))
                ):
                    level = normals - np.outer(lean, up)
                    level /= np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
                    normals = np.where(leaning[:, None], level, normals)
            self._carrying[key] = Touch(touch.points, normals)
            self._carrying[second, first, key[2]] = Touch(touch.points, -normals)
        return self._carrying[key]

    def _stops(self, upper: str, lower: str, up: Float[np.ndarray, "3"], lean: float) -> bool:
        """Whether the upper part gets deeper into the lower one before all that leans as much would have met."""
        a, b, gap = self.bodies[upper], self.bodies[lower], self._gap(upper, lower)
        deeper = self.depth(upper, lower) + _STOPPED * gap
        T = self.poses[upper].copy()
        farthest = min(1.25 * gap / lean, gap / self.config.gap)
        for way in np.geomspace(0.5 * farthest, farthest, _LET_DOWN):
            T[:3, 3] = self.poses[upper][:3, 3] - way * up
            if mutual_depth(a, b, se3.inverse(self.poses[lower]) @ T) > deeper:
                return True
        return False

    def _gap(self, first: str, second: str) -> float:
        """Gap up to which two bodies count as touching [m]."""
        return self.config.gap * min(self.bodies[first].smallest_extent, self.bodies[second].smallest_extent)

    def depth(self, first: str, second: str) -> float:
        """Return how deep the two overlap as assembled [m]."""
        key = frozenset((first, second))
        if key not in self._depths:
            self._depths[key] = 0.0
            if self._near(first, second, 0.0):
                T = se3.inverse(self.poses[second]) @ self.poses[first]
                self._depths[key] = mutual_depth(self.bodies[first], self.bodies[second], T)
        return self._depths[key]

    def fastened(self, first: str, second: str) -> bool:
        """Return whether the two hold one another: declared so, or overlapping as assembled by more than facets do."""
        key = frozenset((first, second))
        if key not in self._fastened:
            least = min(self.bodies[first].smallest_extent, self.bodies[second].smallest_extent)
            self._fastened[key] = self.depth(first, second) > self.config.fastened * least
        return self._fastened[key]

    def joined(self, name: str) -> frozenset[str]:
        """Return the names of all bodies that are fastened to one."""
        if name not in self._joined:
            others = (other for other in self.bodies if other != name)
            self._joined[name] = frozenset(other for other in others if self.fastened(name, other))
        return self._joined[name]

    def around(self, name: str) -> frozenset[str]:
        """Return the names of all bodies whose boxes are near enough to one's to touch it."""
        if name not in self._around:
            others = (other for other in self.bodies if other != name)
            self._around[name] = frozenset(other for other in others if self._near(name, other, self._gap(name, other)))
        return self._around[name]

    def on_table(self, name: str, table: Table) -> Touch:
        """Return where the body stands on the table: corners of its convex hull."""
        body = self.bodies[name]
        points = se3.apply(self.poses[name], body.hull_points)
        heights = points @ table.normal - table.offset
        points = points[np.abs(heights) <= self.config.table_gap * body.smallest_extent]
        if len(points):
            points = points[spread(points / body.radius, 2 * self.config.max_points)]
        return Touch(points, np.tile(table.normal, (len(points), 1)))

    def _near(self, first: str, second: str, gap: float) -> bool:
        a, b = self._boxes[first], self._boxes[second]
        return bool((a[0] <= b[1] + gap).all() and (b[0] <= a[1] + gap).all())

    def meeting(self, first: str, second: str, gap: float) -> Touch:
        """Return all surface points of either body that face the other within a gap [m], not only a few of them."""
        a, b = self.bodies[first], self.bodies[second]
        if not self._near(first, second, gap):
            return Touch(np.zeros((0, 3)), np.zeros((0, 3)))
        T_a, T_b = self.poses[first], self.poses[second]
        on_a, into_a = self._facing(a, b, se3.inverse(T_b) @ T_a, gap)
        on_b, into_b = self._facing(b, a, se3.inverse(T_a) @ T_b, gap)
        points = np.concatenate([se3.apply(T_a, on_a), se3.apply(T_b, on_b)])
        return Touch(points, np.concatenate([into_a @ T_a[:3, :3].T, -into_b @ T_b[:3, :3].T]))

    def _find(self, first: str, second: str) -> Touch:
        a, b = self.bodies[first], self.bodies[second]
        points, normals = self.meeting(first, second, self._gap(first, second))
        if not len(points):
            return Touch(points, normals)
        reach = max(float(np.ptp(points, axis=0).max()), 1e-3 * min(a.radius, b.radius))
        kept = spread(np.concatenate([points / reach, 0.5 * normals], axis=1), self.config.max_points)
        return Touch(points[kept], normals[kept])

    def _facing(self, body: Body, other: Body, T_other_body: np.ndarray, gap: float) -> tuple[np.ndarray, np.ndarray]:
        """Surface points of the body that lie on the other's surface and face it, and the other's normals there."""
        points, normals = _surface(body, other, T_other_body, gap)
        seen, R = se3.apply(T_other_body, points), T_other_body[:3, :3]
        near = ((seen > other.bounds[0] - gap) & (seen < other.bounds[1] + gap)).all(axis=1)
        points, normals = points[near], normals[near]
        if not len(points):
            return points, normals
        d, n = other.signed_distance.normals(seen[near], 1.01 * gap)
        outward = normals @ R.T
        touching = (np.abs(d) <= gap) & ((n * outward).sum(axis=1) < -self.config.facing)
        touching[touching] = _leads_inside(
            seen[near][touching], outward[touching], n[touching], d[touching], other, gap
        )
        seen, n, outward = seen[near][touching], n[touching], outward[touching]
        on_face = _on_faces(seen, n, other, gap)
        return points[touching], np.where(on_face[:, None], n, -outward) @ R


def _leads_inside(
    points: np.ndarray, outward: np.ndarray, normals: np.ndarray, distances: np.ndarray, other: Body, gap: float
) -> np.ndarray:
    """From which of the points it goes into the other body along the own surface's normal.

    The wall of a ring's bore and that of a groove as wide below it meet in an edge only: they face one another, and
    neither can push the other.
    """
    outside = np.maximum(distances, 0.0)
    way = outside / -(outward * normals).sum(axis=1) + _INWARD * gap
    beyond = other.signed_distance.query(points + way[:, None] * outward)
    return beyond < distances - outside - 0.25 * _INWARD * gap


def _on_faces(points: np.ndarray, normals: np.ndarray, body: Body, gap: float) -> np.ndarray:
    """Which of the points have a face of the body nearest to them, and no edge: there the gradient of the distance does
    not turn. Next to an edge it leans to wherever the point happens to lie, and says nothing of the surface."""
    across = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    steady = np.ones(len(points), dtype=bool)
    for way in (across, -across, np.cross(normals, across), -np.cross(normals, across)):
        _, turned = body.signed_distance.normals(points + gap * way, 4.0 * gap)
        steady &= (turned * normals).sum(axis=1) > _STEADY
    return steady


def _box_corners(body: Body) -> np.ndarray:
    return np.array(np.meshgrid(*body.bounds.T)).reshape(3, -1).T


def _surface(body: Body, other: Body, T_other_body: np.ndarray, gap: float) -> tuple[np.ndarray, np.ndarray]:
    """Samples of the surface, and the corners of the faces that may reach the other body; with their normals."""
    triangles = body.vertices[body.faces]
    seen = se3.apply(T_other_body, triangles.reshape(-1, 3)).reshape(triangles.shape)
    near = ((seen.min(axis=1) <= other.bounds[1] + gap) & (seen.max(axis=1) >= other.bounds[0] - gap)).all(axis=1)
    triangles = triangles[near]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    triangles, normals = triangles[lengths > 0.0], normals[lengths > 0.0] / lengths[lengths > 0.0, None]
    corners = (triangles + _INSET * (triangles.mean(axis=1, keepdims=True) - triangles)).reshape(-1, 3)
    normals = np.repeat(normals, 3, axis=0)
    if len(corners) > _MOST_CORNERS:
        taken = np.linspace(0, len(corners) - 1, _MOST_CORNERS).astype(np.int64)
        corners, normals = corners[taken], normals[taken]
    return np.concatenate([body.samples, corners]), np.concatenate([body.sample_normals, normals])
