"""Where two parts that overlap in the assembled pose come apart: from there on the overlap excuses nothing.

CAD has screws in bosses without a hole. Such a pair may overlap as deep on its way as assembled, but only
until it has parted; else a screw could leave through a wall no thicker than the hole that was left out.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import Body, mutual_depth


def parting_travel(
    moving: Body,
    fixed: Body,
    T_fixed_moving: Float[np.ndarray, "4 4"],
    direction_fixed: Float[np.ndarray, "3"],
    *,
    length: float,
    tolerance: float,
    least_step: float,
) -> float:
    """Return how far the moving body goes before the two are first less than ``tolerance`` deep in each other [m].

    Along a unit direction in the fixed body's frame, at most ``length``. A depth of d cannot vanish within
    d - tolerance, so that much is skipped at once.
    """
    travel = 0.0
    while travel < length:
        T = se3.make(None, travel * direction_fixed) @ T_fixed_moving
        depth = mutual_depth(moving, fixed, T)
        if depth <= tolerance:
            return travel
        travel += max(depth - tolerance, least_step)
    return length
