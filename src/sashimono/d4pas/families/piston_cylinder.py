"""Radial pistons in the oblique bores of a flat case: heads on cross pins, rods stacked on a crank."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

_BORE = 46.0
"""Length of a cylinder's bore."""
_ROD = 5.0
"""Thickness of a connecting rod; the rods lie over one another on the crank pin."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one machine."""
    pick = kit.Draw(rng)
    layout = pick.choice(((0.0, 63.0), (0.0, 90.0), (0.0, 120.0, 240.0), (0.0, 77.0, 180.0), (0.0, 180.0), (0.0,)))
    return {
        "angles": [round(angle + pick.length(-5.0, 5.0, 1.0), 3) for angle in layout],
        "bore": pick.length(22.0, 25.0),
        "crank": pick.length(8.0, 10.0),
        "fit": pick.choice(("H9/d9", "H8/f7", "exact")),
        "screws": pick.count(2, 3),
        "wheel": pick.chance(0.6),
        "wheel_angle": pick.length(0.0, 180.0, 1.0),
        "cylinders": [
            {
                "ring": pick.chance(0.5),
                "pin": pick.choice((0.0, 180.0)) + pick.length(-22.0, 22.0, 1.0),
                "pipe": pick.choice((0.0, 14.0)),
            }
            for _ in layout
        ],
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the machine: the crank along z, the cylinders about the plane z = 0."""
    product, bore, dc = Product(), params["bore"], params["crank"]
    half, angles = bore / 2.0 + 6.0, sorted(params["angles"])
    turns = [b - a for a, b in pairwise([*angles, angles[0] + 360.0])]
    narrow = math.radians(min(*turns, 180.0)) if len(turns) > 1 else math.pi
    pit, rods_low = dc + 12.0, -_ROD * len(angles) / 2.0
    start = max((bore / 2.0 + 1.5) / math.tan(narrow / 2.0), pit / 2.0 + 4.0)
    case = kit.cylinder(2.0 * start + 28.0, -half, half, segments=32)
    for angle in angles:
        arm = kit.box((0.0, -half, -half), (start + _BORE, half, half))
        case += arm.rotate((0.0, 0.0, angle))
    case -= kit.cylinder(pit, rods_low, half + 1.0)
    case -= kit.cylinder(dc + clearance(dc, params["fit"]), -half + 2.0, rods_low + 1.0)
    product.add("case", case)
    for k, (angle, cylinder) in enumerate(zip(params["angles"], params["cylinders"], strict=True)):
        turn = math.radians(angle)
        _add_cylinder(
            product, params, cylinder, ((math.cos(turn), math.sin(turn), 0.0), angle, start, rods_low + _ROD * k)
        )
    places = []
    for angle, turn in zip(angles, turns, strict=True):
        shares = (0.5,) if turn < 150.0 else (0.33, 0.67) if turn < 300.0 else (0.25, 0.5, 0.75)
        places += [math.radians(angle + share * turn) for share in shares]
    _add_crank(product, params, (start, half, -rods_low), places[: params["screws"]])
    return product


def _add_cylinder(product: Product, params: Mapping[str, Any], cylinder: Mapping[str, Any], where: Any) -> None:
    """Add piston, wrist pin, rod and head of one cylinder."""
    (axis, angle, start, low), bore, dc, origin = where, params["bore"], params["crank"], (0.0, 0.0, 0.0)
    gap, half = clearance(bore, params["fit"]), bore / 2.0 + 6.0
    out, wrist, end, spin = start + _BORE, start + 9.0, start + 22.0, (0.0, 0.0, angle)
    product.cut(["case"], kit.place(kit.cylinder(bore, start, out + 1.0), origin, axis))
    lane = kit.box((0.0, -3.6, low), (wrist + 3.7, 3.6, half + 1.0)).rotate(spin)
    product.cut(["case"], lane)
    piston = product.add("piston", kit.place(kit.cylinder(bore - gap, start, end), origin, axis) - lane)
    rod = kit.box((0.0, -3.5, low), (wrist, 3.5, low + _ROD)) + kit.cylinder(dc + 6.0, low, low + _ROD)
    rod += kit.cylinder(7.0, low, low + _ROD).translate((wrist, 0.0, 0.0))
    bore_tool = kit.cylinder(dc + clearance(dc, params["fit"]), -99.0, 99.0)
    rod_name = product.add("rod", rod.rotate(spin) - bore_tool)
    # the wrist pin stands in a hole that is longer than the rod is thick
    room = kit.cylinder(4.0, low - 2.5, 99.0, segments=16).translate((wrist, 0.0, 0.0)).rotate(spin)
    product.cut([piston, rod_name], room)
    pin = kit.cylinder(4.0, low - 2.5, half - 0.4, segments=16).translate((wrist, 0.0, 0.0)).rotate(spin)
    product.add("wrist_pin", pin)
    foot = out - 13.0
    if cylinder["ring"]:
        product.add("liner", kit.place(kit.tube(bore - gap, bore - 7.0, end, end + 6.0), origin, axis))
        foot = end + 6.0
    head = kit.cylinder(bore - gap, foot, out) + kit.cylinder(bore + 9.0, out, out + 6.0)
    head += kit.cylinder(13.0, out, out + 6.0 + cylinder["pipe"])
    head_name = product.add("head", kit.place(head - kit.cylinder(6.0, 0.0, 199.0), origin, axis))
    tilt, middle = math.radians(cylinder["pin"]), (0.0, 0.0, out - 6.0)
    across = (-math.cos(tilt), math.sin(tilt), 0.0)
    hole, long = kit.cylinder(5.5, -99.0, 99.0, segments=16), kit.cylinder(5.5, 1.5 - half, half + 5.0, segments=16)
    product.cut(["case", head_name], kit.place(kit.place(hole, middle, across), origin, axis))
    product.add("pin", kit.place(kit.place(long, middle, across), origin, axis))


def _add_crank(product: Product, params: Mapping[str, Any], where: tuple[float, float, float], places: Any) -> None:
    """Add the crank through the rods, the cover over rods and wrist pins, and the flywheel."""
    (start, half, high), dc = where, params["crank"]
    gap, top = clearance(dc, params["fit"]), half + 8.0
    end = top + (18.0 if params["wheel"] else 6.0)
    product.add("crank", kit.cylinder(dc, -half + 2.0, end) + kit.cylinder(dc + 5.0, high, high + 2.5))
    cover = kit.cylinder(2.0 * start + 28.0, half, top, segments=32) - kit.cylinder(dc + gap, 0.0, 99.0)
    name = product.add("cover", cover)
    for turn in places:
        at = ((start + 8.0) * math.cos(turn), (start + 8.0) * math.sin(turn), top)
        product.cut(["case", name], kit.cylinder(7.1, -15.5, 1.0, segments=12).translate(at))
        screw = kit.cylinder(7.0, -15.5, 0.0, segments=12) + kit.cylinder(11.0, 0.0, 6.0, segments=16)
        product.add("screw", screw.translate(at))
    if params["wheel"]:
        wheel = product.add("flywheel", kit.cylinder(dc + 14.0, top, top + 12.0) - kit.cylinder(dc + gap, 0.0, 99.0))
        turn = math.radians(params["wheel_angle"])
        axis, at = (math.cos(turn), math.sin(turn), 0.0), (0.0, 0.0, top + 6.0)
        product.cut(["crank", wheel], kit.place(kit.cylinder(4.5, -99.0, 99.0, segments=16), at, axis))
        product.add("pin", kit.place(kit.cylinder(4.5, -dc / 2.0 - 5.0, dc / 2.0 + 10.0, segments=16), at, axis))


FAMILY = Family(
    name="piston_cylinder",
    version=2,
    summary="pistons at odd angles on one crank: rods leave in their order, once cover, crank and wrist pins are gone",
    draw=draw,
    build=build,
)
