"""Does a part stand on the table by itself?"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sashimono.geometry import se3
from sashimono.plan import Table
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig


def resting_problems(
    body: SampledBody, T_world_part: Float[np.ndarray, "4 4"], table: Table, config: VerifyConfig
) -> list[str]:
    """Return why the part does not rest: off the table, or its centre of mass beside what it stands on."""
    points = se3.apply(T_world_part, body.vertices)
    heights = points @ table.normal - table.offset
    lowest = float(heights.min())
    tolerance = config.relative_tolerance * body.smallest_extent
    if lowest > tolerance:
        return [f"floats {lowest * 1e3:.4g} mm over the table at the start"]
    if lowest < -tolerance:
        return [f"starts {-lowest * 1e3:.4g} mm inside the table"]
    feet = points[heights <= lowest + config.resting_tolerance * body.smallest_extent]
    plane = np.linalg.svd(table.normal[None])[2][1:]
    center = plane @ se3.apply(T_world_part, body.center_of_mass[None])[0]
    try:
        hull = ConvexHull(feet @ plane.T)
    except (QhullError, ValueError):  # fewer than three feet, or all in a line
        return ["does not rest at the start: it stands on an edge or a point"]
    outside = float((hull.equations[:, :2] @ center + hull.equations[:, 2]).max())
    if outside > config.pose_tolerance * body.size:
        return [f"tips over at the start: its centre of mass is {outside * 1e3:.4g} mm beside its support"]
    return []
