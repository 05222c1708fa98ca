"""A linear slide: carriages on a dovetail or T rail, gib strips behind slanted screws, end stops, plates on top."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

Outline = list[tuple[float, float]]
HEIGHT, UNDERCUT, GIB = 14.0, 7.0, 3.5
"""Height of the rail, how far it overhangs on either side, thickness of a gib [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one slide."""
    pick = kit.Draw(rng)
    carriages = [
        {
            "length": pick.length(24.0, 34.0),
            "gib": pick.choice((0, 1, -1), (4, 1, 1)),
            "elevation": pick.choice((0.0, 10.0, 20.0)),
        }
        for _ in range(pick.choice((1, 2, 3), (2, 4, 2)))
    ]
    return {
        "rail": pick.choice(("dovetail", "tee")),
        "neck": pick.length(9.0, 13.0),
        "fit": pick.choice(("H8/f7", "H7/g6", "exact")),
        "carriages": carriages,
        "stops": [pick.choice(("plate", "pin", "none"), (2, 4, 2)) for _ in range(2)],
        "stop_tilt": pick.choice((0.0, 12.0, 25.0), (3, 1, 1)),
        "plate": pick.choice(("none", "each", "all"), (1, 1, 2)),
        "overhang": pick.choice((0.0, 14.0)),
        "rail_screws": pick.count(1, 2),
        "slope": pick.choice((12.0, 20.0, 30.0)),
        "below": pick.chance(0.3),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the slide: the rail runs along x with its foot on z = 0, then all is tilted onto its wedge."""
    product, gap = Product(), clearance(20.0, params["fit"])
    ends = [12.0 if kind == "pin" else 0.0 for kind in params["stops"]]
    length = sum(ends) + sum(c["length"] for c in params["carriages"])
    neck = params["neck"]
    rail = _along(_rail(params["rail"], neck, 0.0), 0.0, length)
    rail += kit.box((0.0, -neck - 4.0, -10.0), (length, neck + 4.0, 0.0))
    product.add("rail", rail)
    _stops(product, params, length)
    x, names = ends[0], []
    for carriage in params["carriages"]:
        names.append((_carriage(product, params, carriage, x, gap), x, x + carriage["length"]))
        x += carriage["length"]
    _plates(product, params, names)
    _wedge(product, params, length)
    return product


def _rail(kind: str, neck: float, wider: float) -> Outline:
    """Return the rail's section (y, z), wider all round by a gap, from below its foot."""
    foot, wide, high = neck + wider, neck + UNDERCUT + wider, HEIGHT + wider
    if kind == "dovetail":
        slope = UNDERCUT / HEIGHT
        return [(-foot, 0.0), (foot, 0.0), (wide + slope * wider, high), (-wide - slope * wider, high)]
    step = HEIGHT / 2.0 - wider
    right = [(foot, 0.0), (foot, step), (wide, step), (wide, high)]
    return [(-foot, 0.0), *right, *[(-y, z) for y, z in reversed(right)][:-1]]


def _along(outline: Outline, start: float, end: float) -> Manifold:
    """Return the prism along x over a section (y, z)."""
    return kit.prism(outline, start, end).rotate((90.0, 0.0, 90.0))


def _carriage(product: Product, params: Mapping[str, Any], carriage: Mapping[str, Any], x: float, gap: float) -> str:
    """Add a carriage, and its gib behind two slanted screws; return its name."""
    neck, side, end = params["neck"], carriage["gib"], x + carriage["length"]
    half = neck + UNDERCUT + 16.0
    block = _along([(-half, 0.6), (half, 0.6), (half - 2.0, HEIGHT + 14.0), (2.0 - half, HEIGHT + 14.0)], x, end)
    tool = _rail(params["rail"], neck, gap / 2.0)
    block -= _along([(y, z - 0.5 if z == 0.0 else z) for y, z in tool], x - 1.0, end + 1.0)
    if not side or params["rail"] == "tee":
        return product.add("carriage", block)

    def face(z: float) -> float:
        return neck + UNDERCUT * z / HEIGHT

    strip = [(face(1.2), 1.2), (face(1.2) + GIB, 1.2), (face(HEIGHT) + GIB, HEIGHT), (face(HEIGHT), HEIGHT)]
    room = [(face(0.0), 0.0), (face(0.0) + GIB, 0.0), *strip[2:]]
    if side < 0:
        strip, room = [[(-y, z) for y, z in reversed(section)] for section in (strip, room)]
    name = product.add("carriage", block - _along(room, x - 1.0, end + 1.0))
    gib = product.add("gib", _along(strip, x, end))
    elevation = math.radians(carriage["elevation"])
    axis = (0.0, side * math.cos(elevation), math.sin(elevation))
    middle = (face(0.55 * HEIGHT) + GIB / 2.0 + 10.0 * math.cos(elevation), 0.55 * HEIGHT + 10.0 * axis[2])
    kit.fasten(product, [name, gib], 4.0, 9.2, ((x + end) / 2.0, side * middle[0], middle[1]), axis, reach=30.0)
    return name


def _stops(product: Product, params: Mapping[str, Any], length: float) -> None:
    """Add what keeps the carriages on the rail: plates under screws, or pins through the rail."""
    neck, tilt = params["neck"], math.radians(params["stop_tilt"])
    for sign, kind in zip((-1.0, 1.0), params["stops"], strict=True):
        x = 0.0 if sign < 0 else length
        if kind == "plate":
            low, high = min(x, x + 10.0 * sign), max(x, x + 10.0 * sign)
            wide = neck + UNDERCUT + 3.0
            name = product.add("stop", kit.box((low, -wide, -8.0), (high, wide, HEIGHT + 8.0)))
            axis = (sign * math.cos(tilt), 0.0, math.sin(tilt))
            origin = (x + sign * 8.0, 0.0, HEIGHT / 2.0 + 8.0 * math.tan(tilt) - 2.0)
            kit.fasten(product, [name, "rail"], 6.0, 16.0, origin, axis, reach=20.0)
        elif kind == "pin":
            tilt = min(tilt, math.radians(12.0))  # a steeper pin bars the gibs
            axis = (0.0, math.sin(tilt), math.cos(tilt))
            origin = (x - 8.0 * sign, 8.0 * math.tan(tilt), HEIGHT + 8.0)
            kit.peg(product, ["rail"], 8.0, (8.0 + HEIGHT) / axis[2], origin, axis, reach=9.0)


def _plates(product: Product, params: Mapping[str, Any], names: list[tuple[str, float, float]]) -> None:
    """Add plates on the carriages, one for each or one over all, under screws from above."""
    if params["plate"] == "none":
        return
    half, low = params["neck"] + UNDERCUT + 14.0 + params["overhang"], HEIGHT + 14.0
    groups = [names] if params["plate"] == "all" else [[entry] for entry in names]
    for group in groups:
        plate = product.add("plate", kit.box((group[0][1], -half, low), (group[-1][2], half, low + 8.0)))
        for k, (name, start, end) in enumerate(group):
            for y in (-8.0, 8.0) if k % 2 == 0 else (0.0,):
                origin = ((start + end) / 2.0, y, low + 8.0)
                kit.fasten(product, [plate, name], 6.0, 18.0, origin, (0.0, 0.0, 1.0))


def _wedge(product: Product, params: Mapping[str, Any], length: float) -> None:
    """Add the wedge under the rail, screwed on from above or below, and tilt all so that the wedge stands level."""
    width, slope = params["neck"] + 4.0, math.radians(params["slope"])
    high = 14.0 + length * math.sin(slope)
    # a level foot, drawn in the rail's frame
    foot = [(0.0, -24.0), (length * math.cos(slope) ** 2, -24.0 - length * math.cos(slope) * math.sin(slope))]
    outline = [foot[0], (foot[1][0], foot[1][1]), (length, -10.0), (0.0, -10.0)]
    wedge = product.add("wedge", kit.prism(outline, -width, width).rotate((90.0, 0.0, 0.0)))
    count = params["rail_screws"] if length > 56.0 else 1
    for k in range(count):
        x = length / 2.0 + (k - (count - 1) / 2.0) * (length - 44.0)
        if params["below"] and k == 0:
            depth = 14.0 + x * math.tan(slope)
            seat = -10.0 - min(12.0, depth - 2.0)
            kit.fasten(product, [wedge, "rail"], 6.0, 8.0 - 10.0 - seat, (x, 0.0, seat), (0.0, 0.0, -1.0), reach=high)
        else:
            kit.fasten(product, ["rail", wedge], 6.0, HEIGHT + 12.0, (x, 0.0, HEIGHT - 6.0), (0.0, 0.0, 1.0), reach=8.0)
    product.solids = {name: s.rotate((0.0, -params["slope"], 0.0)) for name, s in product.solids.items()}


FAMILY = Family(
    name="linear_slide",
    version=2,
    summary="carriages that leave past their neighbours and stops; gibs held by slanted screws; screws under carriages",
    draw=draw,
    build=build,
)
