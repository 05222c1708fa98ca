"""Does one part slip through another? A dented one has material left behind the dent, a pierced wall has not.

Depth alone does not tell: no point of a wall is deeper in anything than half its thickness. So where a declared fit
lets a pair go deeper than else, it is looked, along the way, how thick each part is where the other is in it. If it is
hardly more than twice as thick as the other is deep, in both parts at once, one goes through the other.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.verify.body import SampledBody
from sashimono.verify.sweep import Screws

_MAX_POSES = 400
_STEP = 0.5
"""Travel between two looks, over the depth that is declared."""


def pierced_at(
    moving: SampledBody,
    fixed: SampledBody,
    seen: Screws,
    contact: Float[np.ndarray, "n"],
    *,
    least: float,
    depth: float,
    through: float,
) -> float | None:
    """Return the first time looked at, in stretches, at which one part goes through the other; None if there is none.

    Args:
        moving: The part that moves.
        fixed: The part that stays.
        seen: The path, in the frame of the fixed part.
        contact: Times at which the two were found to touch.
        least: Depth up to which no place counts [m]: no wall is so thin.
        depth: How deep they may go into each other [m].
        through: Thickness over depth, up to which a place is gone through.
    """
    if not len(contact):
        return None
    for time in _times(moving, seen, contact, depth):
        T = seen.pose_at(time)
        if not _goes_through(moving, fixed, T, least, through):
            continue
        if _goes_through(fixed, moving, se3.inverse(T), least, through):
            return float(time)
    return None


def _goes_through(
    first: SampledBody, second: SampledBody, T: Float[np.ndarray, "4 4"], least: float, through: float
) -> bool:
    """Whether some sample of the first body is deep in the second where that is hardly more than twice as thick."""
    points = se3.apply(T, first.tree.leaves)
    points = points[second.box_distance(points) <= 0.0]
    if not len(points):
        return False
    depths = -second.distance(points)
    points, depths = points[depths > least], depths[depths > least]
    return bool(len(points)) and bool((second.thickness_at(points, depths) < through * depths).any())


def _times(
    moving: SampledBody, seen: Screws, contact: Float[np.ndarray, "n"], depth: float
) -> Float[np.ndarray, "look"]:
    """Times of contact and near to it, evenly spaced by the travel of the point that moves most."""
    count, first, last = len(seen.angle), float(contact.min()), float(contact.max())
    speed = np.linalg.norm(seen.shift, axis=1) + np.abs(seen.angle) * [moving.reach(p) for p in seen.point]
    marks = np.unique(np.concatenate([[first, last], np.arange(np.ceil(first), last)]))
    lengths = [(b - a) * speed[min(int(0.5 * (a + b)), count - 1)] for a, b in pairwise(marks)]
    travel = np.concatenate([[0.0], np.cumsum(lengths)])
    step = _STEP * depth
    grid = np.linspace(0.0, travel[-1], int(np.ceil(travel[-1] / step)) + 1)
    touched = np.interp(np.sort(contact), marks, travel)
    after = np.searchsorted(touched, grid).clip(1, max(len(touched) - 1, 1))
    off = np.minimum(np.abs(grid - touched[after - 1]), np.abs(grid - touched[after.clip(max=len(touched) - 1)]))
    looks = grid[off <= 2.0 * step]
    if len(looks) > _MAX_POSES:
        looks = looks[np.linspace(0.0, len(looks) - 1.0, _MAX_POSES).round().astype(int)]
    return np.interp(looks, travel, marks)
