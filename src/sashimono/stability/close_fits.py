"""Close fits: a gear on its shaft, a shaft in its bearing, a dowel in its hole, drawn without clearance.

Static equilibrium alone lets every gear slide down an upright shaft, for no force squeezes the two. Whoever draws a
bore and a shaft alike means them to stay where they are put: by a press fit, glue, or a ring that is not drawn. So such
a pair counts as joined, and the plan says so, as it does of a screw whose thread is not drawn.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.geometry.features.circle import widest_gap
from sashimono.stability.touching import Touching

_WALL = 0.1
"""Largest cosine between the axis and a normal that belongs to a wall along it."""
_RADIAL = 0.85
"""Least cosine between such a normal and the line from the axis: the flats of a hexagon have 0.87 at their edges."""
_ROUND = 0.8
"""Least share of the walls that are so."""
_ALIKE = 0.02
"""Normals that differ by less belong to one wall."""
_OPEN = 1.8
"""Widest angle about the axis without a wall [rad]; that of a square shank is a right angle."""


@dataclass(frozen=True, kw_only=True)
class FitAxis:
    """The line about which two parts fit."""

    axis: tuple[float, float, float]
    """Unit, world."""
    point: tuple[float, float, float]
    """World [m]."""


def close_fit(touching: Touching, first: str, second: str, lines: Float[np.ndarray, "line 3"]) -> FitAxis | None:
    """Return the axis about which one part is all around the other without clearance; None if there is none.

    Args:
        touching: The parts.
        first: One of them.
        second: The other.
        lines: Unit, world: axes that are tried.
    """
    config = touching.config
    coarse = touching.between(first, second).normals
    if len(coarse) < 3 or float((coarse @ coarse.T).min()) > -0.5:  # nothing is between two walls
        return None
    extents = [touching.bodies[name].smallest_extent for name in (first, second)]
    points, normals = touching.meeting(first, second, config.fit_gap * min(extents))
    for axis in lines:
        if (found := _about(axis, points, normals, config.fit_length)) is not None:
            x, y, z = (float(value) for value in found)
            return FitAxis(axis=(float(axis[0]), float(axis[1]), float(axis[2])), point=(x, y, z))
    return None


def _about(
    axis: Float[np.ndarray, "3"],
    points: Float[np.ndarray, "point 3"],
    normals: Float[np.ndarray, "point 3"],
    length: float,
) -> Float[np.ndarray, "3"] | None:
    """A point on the line along an axis that all walls are around; None if they are not around one line."""
    wall = np.abs(normals @ axis) < _WALL
    if wall.sum() < 6:
        return None
    x = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    x /= np.linalg.norm(x)
    flat = np.stack([x, np.cross(axis, x)])
    seen, facing = points[wall] @ flat.T, normals[wall] @ flat.T
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    # the centre is on the line along the normal of each wall from its middle: least squares
    kinds, owner = np.unique(np.round(facing / _ALIKE), axis=0, return_inverse=True)
    across = np.empty((len(kinds), 2))
    middle = np.empty(len(kinds))
    for k in range(len(kinds)):
        mine = owner.reshape(-1) == k
        x, y = facing[mine].mean(axis=0)
        across[k] = -y, x
        along = seen[mine] @ across[k]
        middle[k] = 0.5 * (along.min() + along.max())
    center, _, rank, _ = np.linalg.lstsq(across, middle, rcond=1e-6)
    if rank < 2:
        return None
    spokes = seen - center
    radii = np.linalg.norm(spokes, axis=1)
    around = (radii > 0.0) & (np.abs((spokes * facing).sum(axis=1)) > _RADIAL * radii)
    if around.sum() < 6 or around.mean() < _ROUND:
        return None
    heights = points[wall][around] @ axis
    open_angle = widest_gap(np.arctan2(spokes[around, 1], spokes[around, 0]))
    if open_angle > _OPEN or float(np.ptp(heights)) < length * 2.0 * float(np.median(radii[around])):
        return None
    return center @ flat + float(heights.mean()) * axis
