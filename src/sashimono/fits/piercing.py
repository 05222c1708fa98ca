"""Whether a part that goes straight past another slips through it: then nothing gives, the depth is that of a wall."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.fits.config import FitConfig
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.geometry.distance.rays import cast_rays

_MAX_LOOKS = 96


def slips_through(
    parts: PlacedParts, part: int, other: int, direction: Float[np.ndarray, "3"], depth: float, *, config: FitConfig
) -> bool:
    """Return whether one of two parts goes through the other on a straight way out.

    What is dented has material left behind the dent. Where one goes through the other, both are hardly more than twice
    as thick as the other is deep in them.

    Args:
        parts: The placed parts.
        part: The part that moves.
        other: The part that stays.
        direction: Of the motion, unit, world frame.
        depth: How deep they go into each other [m]: looks are half as far apart.
        config: How thin is thin.
    """
    a, b = parts.bodies[part], parts.bodies[other]
    low, high = parts.boxes[part], parts.boxes[other]
    least = 0.5 * parts.tolerances.translation * parts.scale(part, other)
    length = parts.way_past(part, other, direction)
    looks = int(min(np.ceil(length / (0.5 * depth)), _MAX_LOOKS))
    for travel in length * (np.arange(looks) + 0.5) / max(looks, 1):
        shift = travel * direction
        if (low[0] + shift > high[1]).any() or (low[1] + shift < high[0]).any():
            continue
        T_b_a = se3.inverse(parts.poses[other]) @ se3.make(None, shift) @ parts.poses[part]
        limits = least, config.through
        if _goes_through(a, b, T_b_a, *limits) and _goes_through(b, a, se3.inverse(T_b_a), *limits):
            return True
    return False


def _goes_through(first: Body, second: Body, T: Float[np.ndarray, "4 4"], least: float, through: float) -> bool:
    """Whether some probe of the first body is deep in the second where that is hardly more than twice as thick."""
    points = se3.apply(T, first.probes)
    points = points[((points > second.bounds[0]) & (points < second.bounds[1])).all(axis=1)]
    points = points[second.signed_distance.query(points) < -least]
    if not len(points):
        return False
    distances, outward = second.signed_distance.normals(points, np.inf)
    beyond, _ = cast_rays(second.signed_distance, points, -outward, side="leaving")
    return bool((beyond - distances < -through * distances).any())
