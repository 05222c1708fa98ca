"""Nominal sizes of metric fasteners: ISO 261 diameters and pitches, widths across flats, keys, plain washers."""

from __future__ import annotations

from typing import NamedTuple


class MetricSize(NamedTuple):
    """One nominal size; lengths in mm, 0 where the standards have none."""

    diameter: float
    pitch: float
    """Coarse pitch (ISO 261)."""
    flats: tuple[float, ...]
    """Widths across flats of nuts and hexagon heads (ISO 4032, 4014; older DIN widths after)."""
    washers: tuple[tuple[float, float, float], ...]
    """Hole, outer diameter and thickness of plain washers (ISO 7089, 7092, 7093)."""


METRIC = (
    MetricSize(1.6, 0.35, (3.2,), ((1.7, 4.0, 0.3),)),
    MetricSize(2.0, 0.4, (4.0,), ((2.2, 5.0, 0.3), (2.2, 4.5, 0.3))),
    MetricSize(2.5, 0.45, (5.0,), ((2.7, 6.0, 0.5), (2.7, 5.0, 0.5))),
    MetricSize(3.0, 0.5, (5.5,), ((3.2, 7.0, 0.5), (3.2, 6.0, 0.5), (3.2, 9.0, 0.8))),
    MetricSize(4.0, 0.7, (7.0,), ((4.3, 9.0, 0.8), (4.3, 8.0, 0.5), (4.3, 12.0, 1.0))),
    MetricSize(5.0, 0.8, (8.0,), ((5.3, 10.0, 1.0), (5.3, 9.0, 1.0), (5.3, 15.0, 1.0))),
    MetricSize(6.0, 1.0, (10.0,), ((6.4, 12.0, 1.6), (6.4, 11.0, 1.6), (6.4, 18.0, 1.6))),
    MetricSize(8.0, 1.25, (13.0,), ((8.4, 16.0, 1.6), (8.4, 15.0, 1.6), (8.4, 24.0, 2.0))),
    MetricSize(10.0, 1.5, (16.0, 17.0), ((10.5, 20.0, 2.0), (10.5, 18.0, 1.6), (10.5, 30.0, 2.5))),
    MetricSize(12.0, 1.75, (18.0, 19.0), ((13.0, 24.0, 2.5), (13.0, 20.0, 2.0), (13.0, 37.0, 3.0))),
    MetricSize(16.0, 2.0, (24.0,), ((17.0, 30.0, 3.0), (17.0, 28.0, 2.5), (17.0, 50.0, 3.0))),
    MetricSize(20.0, 2.5, (30.0,), ((21.0, 37.0, 3.0), (21.0, 34.0, 3.0), (22.0, 60.0, 4.0))),
    MetricSize(24.0, 3.0, (36.0,), ((25.0, 44.0, 4.0), (25.0, 39.0, 4.0), (26.0, 72.0, 5.0))),
    MetricSize(30.0, 3.5, (46.0,), ((31.0, 56.0, 4.0),)),
    MetricSize(36.0, 4.0, (55.0,), ((37.0, 66.0, 5.0),)),
)


KEYS = (0.7, 0.9, 1.3, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 17.0, 19.0)
"""Widths of hexagon keys [mm] (ISO 2936)."""


def nominal_width(width: float, *, key: bool) -> float:
    """Return the nominal width of the key or wrench for a width across flats [m], in mm.

    A width near none, within 4 %, is given to a tenth.
    """
    wanted = 1e3 * width
    widths = KEYS if key else tuple(flats for size in METRIC for flats in size.flats)
    nearest = min(widths, key=lambda x: abs(x - wanted))
    return nearest if abs(nearest - wanted) <= 0.04 * nearest else round(wanted, 1)


def shank_size(diameter: float) -> str:
    """Return the nominal size of a shank's diameter [m], as "M6"; "" if it is near none.

    A shank is drawn with its nominal diameter, or up to 6 % thinner.
    """
    wanted = 1e3 * diameter
    near = [size for size in METRIC if 0.94 * size.diameter <= wanted <= 1.02 * size.diameter]
    return f"M{near[-1].diameter:g}" if near else ""


def nut_size(hole: float, flats: float) -> str:
    """Return the nominal size of a nut by its hole and width across flats [m]; "" if both fit none.

    The hole is drawn with the nominal or the core diameter of the thread, or between.
    """
    for size in METRIC:
        core = size.diameter - 1.0825 * size.pitch
        wide = any(abs(1e3 * flats - width) <= 0.03 * width for width in size.flats)
        if wide and 0.96 * core <= 1e3 * hole <= 1.05 * size.diameter:
            return f"M{size.diameter:g}"
    return ""


def washer_size(hole: float, outer: float, thickness: float) -> str:
    """Return the nominal size of a plain washer by its measures [m]; "" if it is of no standard."""
    for size in METRIC:
        for wanted in size.washers:
            off = [abs(1e3 * x - y) / y for x, y in zip((hole, outer, thickness), wanted, strict=True)]
            if off[0] <= 0.05 and off[1] <= 0.04 and off[2] <= 0.2:
                return f"M{size.diameter:g}"
    return ""
