"""A few rows far from one another."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def spread(rows: Float[np.ndarray, "row column"], count: int) -> list[int]:
    """Return indices of at most ``count`` rows: the farthest from the mean, then each the farthest from those before.

    Rows that coincide with one taken before are left out. There must be a row.
    """
    away = np.linalg.norm(rows - rows.mean(axis=0), axis=1)
    kept = [int(away.argmax())]
    nearest = np.linalg.norm(rows - rows[kept[0]], axis=1)
    while len(kept) < count and nearest.max() > 1e-6:
        kept.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(rows - rows[kept[-1]], axis=1))
    return kept
