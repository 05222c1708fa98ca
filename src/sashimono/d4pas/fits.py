"""Fits between a hole and a shaft, after ISO 286, for nominal diameters of 1 to 120 mm."""

from __future__ import annotations

_UPPER = (3.0, 6.0, 10.0, 18.0, 30.0, 50.0, 80.0, 120.0)
"""Upper ends of the ranges of nominal diameters [mm]; the first begins above 0."""

_CLEARANCE: dict[str, tuple[float, ...]] = {
    "H11/c11": (120, 145, 170, 205, 240, 290, 340, 395),
    "H9/d9": (45, 60, 76, 93, 117, 142, 174, 207),
    "H8/f7": (18, 25, 31.5, 38.5, 47, 57, 68, 80.5),
    "H7/g6": (10, 14, 17, 20.5, 24, 29.5, 34.5, 40.5),
    "H7/h6": (8, 10, 12, 14.5, 17, 20.5, 24.5, 28.5),
    "exact": (0, 0, 0, 0, 0, 0, 0, 0),
    "H7/p6": (-4, -10, -12, -15, -18, -21.5, -26.5, -30.5),
}
"""Diametral clearance in the middle of both tolerances [µm], by range; negative is interference. ``exact`` is CAD's
habit of drawing hole and shaft alike."""

FITS = tuple(_CLEARANCE)
"""Names of the fits, loosest first."""


def clearance(diameter: float, fit: str) -> float:
    """Return the diametral clearance of a fit at a nominal diameter [mm]; negative is interference."""
    row = next((k for k, upper in enumerate(_UPPER) if diameter <= upper), len(_UPPER) - 1)
    return _CLEARANCE[fit][row] * 1e-3
