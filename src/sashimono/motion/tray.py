"""The tray: where on the table each part rests, beside a work area that stays free."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.motion.config import TrayConfig


def lay_out(
    footprints: Float[np.ndarray, "part 2"],
    work_low: Float[np.ndarray, "2"],
    work_high: Float[np.ndarray, "2"],
    config: TrayConfig,
) -> Float[np.ndarray, "part 2"]:
    """Return the middle of each part's footprint on the table [m].

    Rows from left to right in the order given, the first row next to the work area and
    each further row in front of it (towards -y), centred on it.

    Args:
        footprints: Width (x) and depth (y) of each part's rectangle, free border included [m].
        work_low: Lower corner of the work area, its free border included [m].
        work_high: Upper corner.
        config: Proportions of the tray.
    """
    if not len(footprints):
        return np.empty((0, 2))
    width = max(
        float(work_high[0] - work_low[0]),
        float(footprints[:, 0].max()),
        float(np.sqrt(config.aspect * footprints.prod(axis=1).sum())),
    )
    rows: list[list[int]] = [[]]
    filled = 0.0
    for k, (part_width, _) in enumerate(footprints):
        if rows[-1] and filled + part_width > width * (1.0 + 1e-9):
            rows.append([])
            filled = 0.0
        rows[-1].append(k)
        filled += part_width
    middles = np.empty_like(footprints)
    middle_x, front = float(work_low[0] + work_high[0]) / 2.0, float(work_low[1])
    for row in rows:
        widths = footprints[row, 0]
        depth = float(footprints[row, 1].max())
        middles[row, 0] = middle_x - widths.sum() / 2.0 + np.cumsum(widths) - widths / 2.0
        middles[row, 1] = front - depth / 2.0
        front -= depth
    return middles
