"""Whether one part is all around another about an axis, as a thread is around a screw."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.geometry.features.circle import widest_gap
from sashimono.stability.touching import Touch

_SIDE = 0.34
"""Largest cosine between the axis and a normal that belongs to a wall around it."""
_RADIAL = 0.9
"""Least cosine between such a normal and the line from the axis to its point."""


def embraces(
    touch: Touch, axis: Float[np.ndarray, "3"], point: Float[np.ndarray, "3"], *, most_open: float = 2.2
) -> bool:
    """Return whether touching points lie all around an axis, their normals pointing to it or away from it.

    Args:
        touch: Where one part touches the other.
        axis: Unit.
        point: On the axis [m].
        most_open: Widest angle about the axis without a touching point [rad]: the points are few, and stand for more.
    """
    arms = touch.points - point
    arms = arms - np.outer(arms @ axis, axis)
    lengths = np.linalg.norm(arms, axis=1)
    wall = (np.abs(touch.normals @ axis) < _SIDE) & (lengths > 0.0)
    wall[wall] &= np.abs((arms[wall] * touch.normals[wall]).sum(axis=1)) > _RADIAL * lengths[wall]
    if wall.sum() < 3:
        return False
    across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    across /= np.linalg.norm(across)
    return widest_gap(np.arctan2(arms[wall] @ np.cross(axis, across), arms[wall] @ across)) <= most_open
