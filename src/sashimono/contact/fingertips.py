"""Fingertips: balls at the contact points, which must stay clear of everything but the part they touch.

This asks what the paper asks: can two points hold the part? Whether a real gripper gets its points there is another
question, answered by `access`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit

from sashimono.contact.config import ContactConfig
from sashimono.contact.poses import exp_many
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.geometry.distance.signed_distance import nearest
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion, Table

_LEAST_STEP = 0.1
"""Shortest step along a way, over the distance that a ball's centre must keep: it comes no nearer by half of that."""
_RUN = 16
"""Poses of a dense path whose surroundings are looked at together."""


@dataclass(frozen=True, kw_only=True)
class Fingertips:
    """Two balls on the part, with a soft skin. Lengths in metres."""

    name: str = "fingertips"
    radius: float
    patch_radius: float
    """Radius of the contact patch, from which the torsional friction follows."""
    approach: float
    """Way straight off the surface that must be clear before pick-up and after release."""
    max_opening: float = np.inf


def fingertips_for(body: Body, config: ContactConfig, scale: float = 1.0) -> Fingertips:
    """Return fingertips in proportion to a part, or as large as the configuration allows."""
    radius = scale * min(config.tip_radius * float(body.extents[1]), config.largest_tip)
    return Fingertips(radius=radius, patch_radius=config.tip_patch * radius, approach=config.tip_approach * radius)


class DensePath(NamedTuple):
    """A path as poses close together."""

    T_world_part: Float[np.ndarray, "pose 4 4"]
    length: Float[np.ndarray, "pose"]
    """How far any point near the part has moved at most since the start [m]."""
    parameter: Float[np.ndarray, "pose"]
    """Index in the motion's poses, with fractions between two of them."""

    @classmethod
    def along(cls, motion: Motion, body: Body, *, reach: float, step: float, most: int) -> DensePath:
        """Return poses of which two neighbours displace no point by more than ``step``, or more so for long ways."""
        poses = motion.T_world_part
        twists = [se3.log(se3.inverse(a) @ b) for a, b in itertools.pairwise(poses)]
        lengths = [
            float(np.linalg.norm(t[:3] + np.cross(t[3:], body.center)) + np.linalg.norm(t[3:]) * reach) for t in twists
        ]
        spacing = max(step, sum(lengths) / most)
        out, far, where = [poses[:1]], [np.zeros(1)], [np.zeros(1)]
        for k, (twist, length) in enumerate(zip(twists, lengths, strict=True)):
            u = np.arange(1, (count := max(1, int(np.ceil(length / spacing)))) + 1) / count
            out.append(poses[k] @ exp_many(twist, u))
            far.append(far[-1][-1] + length * u)
            where.append(k + u)
        return cls(np.ascontiguousarray(np.concatenate(out)), np.concatenate(far), np.concatenate(where))


class Passage:
    """Where along one step balls on the part are clear of everything around; each ball is looked at once."""

    def __init__(
        self, body: Body, motion: Motion, obstacles: Sequence[Obstacle], table: Table | None, config: ContactConfig
    ) -> None:
        self._config, self._table = config, table
        largest = fingertips_for(body, config, max(config.tip_scales)).radius
        self._body = body
        self.path = DensePath.along(
            motion,
            body,
            reach=body.radius + 4.0 * largest,
            step=0.1 * largest,
            most=4 * (config.max_insertion_poses + config.max_transit_poses),
        )
        self._around = [(o.body, np.ascontiguousarray(se3.inverse(o.T_world_part))) for o in obstacles]
        self._boxes = _world_boxes(obstacles)
        self._reach = body.radius + 2.0 * largest
        """How far from the part's centre a ball at its surface reaches."""
        self._passed = self._on_path(self._reach)

    def _on_path(self, reach: float) -> list[int]:
        """Obstacles that something within this distance of the part's centre may meet on the path."""
        poses = self.path.T_world_part
        centers = poses[:, :3, :3] @ self._body.center + poses[:, :3, 3]
        starts = np.arange(0, len(centers), _RUN)
        following = centers[np.minimum(starts + _RUN, len(centers) - 1)]  # a run goes on to where the next one begins
        low = np.minimum(np.minimum.reduceat(centers, starts), following)
        high = np.maximum(np.maximum.reduceat(centers, starts), following)
        meets = np.zeros(len(self._around), dtype=np.bool_)
        for lower, upper in zip(low - reach, high + reach, strict=True):
            meets |= self._in_box(lower, upper)
        return np.flatnonzero(meets).tolist()

    def _in_box(self, low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]) -> Bool[np.ndarray, "obstacle"]:
        return np.all((self._boxes[:, 0] <= high) & (self._boxes[:, 1] >= low), axis=1)

    @property
    def last(self) -> int:
        """The last index of the dense path."""
        return len(self.path.length) - 1

    def clear_from(self, centers: Float[np.ndarray, "ball 3"], radius: float) -> Int[np.ndarray, "ball"]:
        """Return the first index of the dense path from which on each ball is clear up to its end."""
        return self._walk(centers, radius, backward=True)

    def clear_until(self, centers: Float[np.ndarray, "ball 3"], radius: float) -> Int[np.ndarray, "ball"]:
        """Return the last index of the dense path up to which each ball is clear from its start."""
        return self._walk(centers, radius, backward=False)

    def _walk(self, centers: np.ndarray, radius: float, *, backward: bool) -> np.ndarray:
        limit = radius * (1.0 - self._config.tip_slack)
        poses, length = self.path.T_world_part, self.path.length
        if backward:
            poses, length = np.ascontiguousarray(poses[::-1]), np.ascontiguousarray(length[-1] - length[::-1])
        reached = np.full(len(centers), self.last, dtype=np.int64)
        if self._table is not None:
            n = self._table.normal
            heights = (poses[:, :3, :3].transpose(0, 2, 1) @ n) @ centers.T + (poses[:, :3, 3] @ n)[:, None]
            low = heights < self._table.offset + limit
            reached = np.where(low.any(axis=0), low.argmax(axis=0) - 1, reached)
        reach = float(np.linalg.norm(centers - self._body.center, axis=1).max(initial=0.0)) + limit
        for k in self._passed if reach <= self._reach else self._on_path(reach):
            body, T_body_world = self._around[k]
            _advance(centers, limit, poses, length, T_body_world, *body.signed_distance.arrays, reached)
            if (reached < 0).all():
                break
        return self.last - reached if backward else reached

    def clear_way_off(
        self, centers: Float[np.ndarray, "ball 3"], ways: Float[np.ndarray, "ball 3"], radius: float, index: int
    ) -> np.ndarray:
        """Return which balls can come straight off the part by these ways [m] at one pose of the path."""
        limit = radius * (1.0 - self._config.tip_slack)
        T = self.path.T_world_part[index]
        starts, stops = se3.apply(T, centers), se3.apply(T, centers + ways)
        clear = np.ones(len(centers), dtype=np.bool_)
        if self._table is not None:
            clear &= np.minimum(starts @ self._table.normal, stops @ self._table.normal) >= self._table.offset + limit
        both = np.concatenate([starts, stops]) if len(starts) else np.zeros((1, 3))
        for k in np.flatnonzero(self._in_box(both.min(axis=0) - limit, both.max(axis=0) + limit)):
            body, T_body_world = self._around[k]
            _way_off(
                se3.apply(T_body_world, starts),
                se3.apply(T_body_world, stops),
                limit,
                *body.signed_distance.arrays,
                clear,
            )
        return clear

    def hits(
        self, centers: Float[np.ndarray, "ball 3"], ways: Float[np.ndarray, "ball 3"], radius: float
    ) -> Bool[np.ndarray, "ball obstacle"]:
        """Return which obstacles each ball meets on the whole path or on the way off the part at either end of it.

        The table does not count.
        """
        limit = radius * (1.0 - self._config.tip_slack)
        poses, length = self.path.T_world_part, self.path.length
        out = np.zeros((len(centers), len(self._around)), dtype=np.bool_)
        for k, (body, T_body_world) in enumerate(self._around):
            arrays = body.signed_distance.arrays
            reached = np.full(len(centers), self.last, dtype=np.int64)
            _advance(centers, limit, poses, length, T_body_world, *arrays, reached)
            clear = reached == self.last
            for index in (0, self.last):
                T = T_body_world @ poses[index]
                _way_off(se3.apply(T, centers), se3.apply(T, centers + ways), limit, *arrays, clear)
            out[:, k] = ~clear
        return out


def _world_boxes(obstacles: Sequence[Obstacle]) -> Float[np.ndarray, "obstacle 2 3"]:
    """Lowest and highest corner of a box around each obstacle, in the world."""
    if not obstacles:
        return np.zeros((0, 2, 3))
    T = np.stack([obstacle.T_world_part for obstacle in obstacles])
    bounds = np.stack([obstacle.body.bounds for obstacle in obstacles])
    middle = np.einsum("nij,nj->ni", T[:, :3, :3], bounds.mean(axis=1)) + T[:, :3, 3]
    half = np.einsum("nij,nj->ni", np.abs(T[:, :3, :3]), 0.5 * (bounds[:, 1] - bounds[:, 0]))
    return np.stack([middle - half, middle + half], axis=1)


def clear_of_itself(
    body: Body,
    points: Float[np.ndarray, "ball 3"],
    normals: Float[np.ndarray, "ball 3"],
    tips: Fingertips,
    slack: float,
) -> np.ndarray:
    """Return at which points a ball touches the part there only, and comes straight off it."""
    centers = points - tips.radius * normals
    clear = np.ones(len(points), dtype=np.bool_)
    limit = tips.radius * (1.0 - slack)
    _way_off(centers, centers - tips.approach * normals, limit, *body.signed_distance.arrays, clear)
    return clear


@njit(cache=True, nogil=True)
def _moved(T, x, y, z):  # pragma: no cover - compiled
    """A point at a pose."""
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@njit(cache=True, nogil=True)
def _distance(x, y, z, limit, boxes, links, triangles, normals):  # pragma: no cover - compiled
    """How far a point is from a body; beyond twice the limit, from its box: a bound that costs nothing."""
    dx = max(boxes[0, 0] - x, 0.0, x - boxes[0, 3])
    dy = max(boxes[0, 1] - y, 0.0, y - boxes[0, 4])
    dz = max(boxes[0, 2] - z, 0.0, z - boxes[0, 5])
    d = np.sqrt(dx * dx + dy * dy + dz * dz)
    return nearest(x, y, z, np.inf, boxes, links, triangles, normals)[0] if d < 2.0 * limit else d


@njit(cache=True, nogil=True)
def _advance(  # pragma: no cover - compiled
    centers, limit, poses, length, T_body_world, boxes, links, triangles, normals, reached
):
    """Lower ``reached`` to the last index before a ball is first nearer to the body than the limit.

    Where a ball is at distance d the walk goes on by d - limit, but at least by a small share of the limit: between
    two poses a ball's centre is taken to go straight.
    """
    for i in range(centers.shape[0]):
        m, far = 0, 0.0
        while m <= reached[i]:
            wx, wy, wz = _moved(poses[m], centers[i, 0], centers[i, 1], centers[i, 2])
            if far > length[m]:  # between two poses
                u = (far - length[m]) / (length[m + 1] - length[m])
                nx, ny, nz = _moved(poses[m + 1], centers[i, 0], centers[i, 1], centers[i, 2])
                wx, wy, wz = wx + u * (nx - wx), wy + u * (ny - wy), wz + u * (nz - wz)
            x, y, z = _moved(T_body_world, wx, wy, wz)
            d = _distance(x, y, z, limit, boxes, links, triangles, normals)
            if d < limit:
                reached[i] = m if far > length[m] else m - 1
                break
            if far >= length[reached[i]]:
                break
            far = min(far + max(d - limit, _LEAST_STEP * limit), length[reached[i]])
            while m < reached[i] and length[m + 1] <= far:
                m += 1


@njit(cache=True, nogil=True)
def _way_off(starts, stops, limit, boxes, links, triangles, normals, clear):  # pragma: no cover - compiled
    """Clear the flag of balls that come nearer to the body than the limit on a straight way."""
    for i in range(starts.shape[0]):
        if not clear[i]:
            continue
        vx, vy, vz = stops[i, 0] - starts[i, 0], stops[i, 1] - starts[i, 1], stops[i, 2] - starts[i, 2]
        way = np.sqrt(vx * vx + vy * vy + vz * vz)
        t = 0.0
        while True:
            u = t / way if way > 0.0 else 0.0
            x, y, z = starts[i, 0] + u * vx, starts[i, 1] + u * vy, starts[i, 2] + u * vz
            d = _distance(x, y, z, limit, boxes, links, triangles, normals)
            if d < limit:
                clear[i] = False
                break
            if t >= way:
                break
            t = min(way, t + max(d - limit, 0.02 * limit))
