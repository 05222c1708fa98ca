"""Colours as light adds up (linear) and as screens take them (sRGB)."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def to_linear(srgb: Float[np.ndarray, "*any 3"]) -> Float[np.ndarray, "*any 3"]:
    """Return linear RGB of sRGB, both in [0, 1]."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def to_srgb(linear: Float[np.ndarray, "*any 3"]) -> Float[np.ndarray, "*any 3"]:
    """Return sRGB of linear RGB, both in [0, 1]."""
    c = np.clip(linear, 0.0, 1.0)
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)
