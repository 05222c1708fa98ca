"""Points on a circle: its centre, and the widest angle at which there are none."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def circle_center(points: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "2"]:
    """Return the centre of the circle through some points, by linear least squares (Kåsa 1976)."""
    rows = np.column_stack([2.0 * points, np.ones(len(points))])
    return np.linalg.lstsq(rows, (points**2).sum(axis=1), rcond=None)[0][:2]


def widest_gap(angles: Float[np.ndarray, "n"]) -> float:
    """Return the widest angle between neighbours around the circle [rad], of one angle and more, in any order."""
    angles = np.sort(angles)
    return float(np.diff(np.append(angles, angles[0] + 2.0 * np.pi)).max())
