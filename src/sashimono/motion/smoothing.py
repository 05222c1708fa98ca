"""Shortcut smoothing (Geraerts and Overmars, "Creating high-quality paths for motion planning", 2007)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.motion.config import SmoothingConfig

Pose = Float[np.ndarray, "4 4"]


def smooth(
    path: Sequence[Pose],
    *,
    edge_is_free: Callable[[Pose, Pose], bool],
    length: Callable[[Pose, Pose], float],
    config: SmoothingConfig,
    rng: np.random.Generator,
) -> list[Pose]:
    """Return a path with the same ends, no longer than the one given.

    First waypoints that are not needed are left out, then shortcuts between random
    points of the path are tried, a bounded number of times.

    Args:
        path: Poses joined by free geodesics.
        edge_is_free: Whether the geodesic between two poses is free.
        length: Length of the geodesic between two poses.
        config: Number of shortcuts.
        rng: Source of the random points.
    """
    poses = _drop_waypoints(list(path), edge_is_free, length)
    lengths = [length(a, b) for a, b in pairwise(poses)]
    for _ in range(config.iterations if len(poses) > 2 else 0):
        total = sum(lengths)
        s, t = np.sort(rng.random(2)) * total
        i, T_s = _point_at(poses, lengths, float(s))
        j, T_t = _point_at(poses, lengths, float(t))
        if i == j:
            continue
        old = float(t - s)
        if length(T_s, T_t) > old - config.min_gain * total or not edge_is_free(T_s, T_t):
            continue
        poses = [*poses[: i + 1], T_s, T_t, *poses[j + 1 :]]
        lengths = [length(a, b) for a, b in pairwise(poses)]
    return _drop_waypoints(poses, edge_is_free, length)


def _drop_waypoints(
    poses: list[Pose], edge_is_free: Callable[[Pose, Pose], bool], length: Callable[[Pose, Pose], float]
) -> list[Pose]:
    """Skip, from the front, as many waypoints at a time as a free geodesic allows, where that is no detour.

    Of the waypoints more than eight ahead only each second power and the last are tried: a tree's path has hundreds.
    """
    way = np.cumsum([0.0, *(length(a, b) for a, b in pairwise(poses))])
    out, k, last = [poses[0]], 0, len(poses) - 1
    while k < last:
        tried = {*range(k + 2, k + 9), *(k + 2**m for m in range(4, 16)), last}
        for ahead in sorted((m for m in tried if k + 1 < m <= last), reverse=True):
            through = float(way[ahead] - way[k])
            if length(poses[k], poses[ahead]) <= through * (1.0 + 1e-9) and edge_is_free(poses[k], poses[ahead]):
                break
        else:
            ahead = k + 1
        out.append(poses[ahead])
        k = ahead
    return out


def _point_at(poses: list[Pose], lengths: list[float], s: float) -> tuple[int, Pose]:
    """The edge on which the point at this length lies, and the pose there."""
    k = 0
    while k < len(lengths) - 1 and s > lengths[k]:
        s -= lengths[k]
        k += 1
    u = min(s / lengths[k], 1.0) if lengths[k] > 0.0 else 0.0
    return k, se3.interpolate(poses[k], poses[k + 1], u)
