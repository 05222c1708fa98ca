"""Colours of an order: from the first part to the last, all of like lightness, so that shading still shows."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.raster.colors import to_linear, to_srgb

STOPS = ("#3f6fb0", "#3f9fb5", "#5cb88f", "#c9c35e", "#eda24a", "#dd5f57")
"""From first to last."""

_TO_LMS = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
_TO_LAB = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
"""Oklab (Ottosson, 2020), in which halfway between two colours looks so."""


def order_colors(count: int) -> Float[np.ndarray, "count 3"]:
    """Return linear RGB colours in [0, 1] of so many parts, from first to last."""
    return ramp(np.linspace(0.0, 1.0, count) if count > 1 else np.zeros(1))


def ramp(places: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
    """Return linear RGB colours at these places from 0 (first) to 1 (last)."""
    stops = np.array([[int(stop[k : k + 2], 16) / 255.0 for k in (1, 3, 5)] for stop in STOPS])
    lab = np.cbrt(to_linear(stops) @ _TO_LMS.T) @ _TO_LAB.T
    at = np.linspace(0.0, 1.0, len(STOPS))
    mixed = np.stack([np.interp(places, at, lab[:, k]) for k in range(3)], axis=1)
    return np.clip(((mixed @ np.linalg.inv(_TO_LAB).T) ** 3) @ np.linalg.inv(_TO_LMS).T, 0.0, 1.0)


def to_bytes(linear: Float[np.ndarray, "3"]) -> tuple[int, int, int]:
    """Return a linear colour as sRGB bytes."""
    r, g, b = (round(255 * float(x)) for x in to_srgb(np.asarray(linear)))
    return r, g, b
