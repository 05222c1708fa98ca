"""Ball valves: a ball between seats and pinned caps, turned by a stem that may lean and is pinned in its groove."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

_SEAT = 6.0
_DEPTH = 11.0
"""Length of a cap's spigot."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one valve."""
    pick = kit.Draw(rng)
    return {
        "ball": pick.length(20.0, 26.0),
        "stem": pick.length(8.0, 9.5),
        "lean": pick.choice((90.0, 90.0, 83.0, 78.0, 73.0)),
        "slot": pick.choice((0.0, 90.0)),
        "fit": pick.choice(("H9/d9", "H8/f7", "exact")),
        "caps": [
            {
                "angle": pick.choice((0.0, 180.0)) + pick.length(-32.0, 32.0, 1.0),
                "seat": pick.chance(0.7),
                "pipe": pick.choice((0.0, 18.0)),
            }
            for _ in range(pick.choice((1, 1, 2)))
        ],
        "stem_side": pick.choice((-1.0, 1.0)),
        "pin_up": pick.choice((-1.0, 1.0)),
        "packings": pick.count(0, 2),
        "gland": pick.chance(0.6),
        "lever": pick.length(26.0, 40.0),
        "lever_angle": pick.length(0.0, 360.0, 1.0),
        "lever_pin": pick.chance(0.75),
        "drain": pick.choice((0.0, 35.0, 55.0, 72.0), (9, 1, 1, 1)),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the valve: the way through along x, the stem in the plane y = 0, the ball at the origin."""
    product, ball, caps = Product(), params["ball"], params["caps"]
    hole, gap, wide = 0.4 * ball, clearance(ball, params["fit"]), ball + 0.6
    half = 0.44 * ball + _SEAT
    lean = math.radians(params["lean"])
    axis = (math.cos(lean), 0.0, math.sin(lean))
    ends = [half + _DEPTH, half + _DEPTH if len(caps) > 1 else half + 6.0]
    low, thick = -wide / 2.0 - 6.0, wide / 2.0 + 6.0
    body = kit.box((-ends[1], -thick, low), (ends[0], thick, wide / 2.0 + 6.0))
    body += kit.place(kit.cylinder(params["stem"] + 18.0, 0.0, _boss(params)), (0.0, 0.0, 0.0), axis)
    body -= kit.place(
        kit.cylinder(wide, -half - (99.0 if len(caps) > 1 else 0.0), 99.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0)
    )
    body -= kit.place(kit.cylinder(hole, -99.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    product.add("body", body)
    flats = kit.box((0.02 - half + _SEAT, -ball, -ball), (half - _SEAT - 0.02, ball, ball))
    turned = (kit.sphere(ball) ^ flats) - kit.place(kit.cylinder(hole, -ball, ball), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    product.add("ball", turned)
    for sign, cap in zip((1.0, -1.0), caps, strict=False):
        _add_cap(product, params, cap, sign)
    if len(caps) == 1:
        ring = kit.cylinder(wide - gap, half - _SEAT, half) - kit.cylinder(hole, 0.0, 99.0)
        product.add("seat", kit.place(ring, (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)))
    _add_stem(product, params, axis)
    if params["drain"] and not params["packings"]:
        angle = math.radians(-params["drain"])
        down = (0.0, math.cos(angle), math.sin(angle))
        plug = kit.cylinder(8.0, wide / 2.0 + 0.5, wide / 2.0 + 18.0)
        product.cut(["body"], kit.place(kit.cylinder(8.0, 0.0, 99.0), (0.0, 0.0, 0.0), down))
        product.add("drain_plug", kit.place(plug, (0.0, 0.0, 0.0), down))
    return product


def _boss(params: Mapping[str, Any]) -> float:
    """Return how far the stem's boss reaches from the origin."""
    return params["ball"] / 2.0 + 26.0


def _add_cap(product: Product, params: Mapping[str, Any], cap: Mapping[str, Any], sign: float) -> None:
    """Add a seat, a gasket and the cap with its cross pin on one end."""
    ball, origin, along = params["ball"], (0.0, 0.0, 0.0), (sign, 0.0, 0.0)
    hole, gap, wide, half = 0.4 * ball, clearance(ball, params["fit"]), ball + 0.6, 0.44 * ball + _SEAT
    through, start = kit.cylinder(hole, 0.0, 199.0), half
    ring = kit.cylinder(wide - gap, half - _SEAT, half) - through
    if cap["seat"]:
        product.add("seat", kit.place(ring, origin, along))
    else:
        start = half - _SEAT
    end = half + _DEPTH
    solid = kit.cylinder(wide - gap, start, end) + kit.cylinder(wide + 10.0, end, end + 6.0)
    solid += kit.cylinder(hole + 8.0, end, end + 6.0 + cap["pipe"])
    name = product.add("cap", kit.place(solid - through, origin, along))
    angle, reach = math.radians(cap["angle"]), ball / 2.0 + 12.0
    axis, at = (0.0, math.cos(angle), math.sin(angle)), (sign * (half + 5.5), 0.0, 0.0)
    product.cut(["body", name], kit.place(kit.cylinder(5.5, -99.0, 99.0, segments=16), at, axis))
    product.add("pin", kit.place(kit.cylinder(5.5, 2.0 - reach, reach, segments=16), at, axis))


def _add_stem(product: Product, params: Mapping[str, Any], axis: tuple[float, float, float]) -> None:
    """Add the stem with its tongue in the ball, the pin in its groove, what seals it, and the lever."""
    ds, ball, top, origin = params["stem"], params["ball"], _boss(params), (0.0, 0.0, 0.0)
    gap, is_upright = clearance(ds, params["fit"]), params["lean"] == 90.0
    foot, wide, tongue = ball / 2.0 - 5.0, ds + 8.0, 0.55 * ds
    long = ds if is_upright else 0.7 * ds
    tip = kit.box((-long, -tongue / 2.0, foot), (long, tongue / 2.0, ball / 2.0 + 1.0)) ^ kit.cylinder(ds, 0.0, 99.0)
    room = kit.box((-long, -tongue / 2.0 - 0.05, foot), (long, tongue / 2.0 + 0.05, ball))
    if is_upright:
        room = kit.box((-ball, -tongue / 2.0 - 0.05, foot), (ball, tongue / 2.0 + 0.05, ball))
        room, tip = room.rotate((0.0, 0.0, params["slot"])), tip.rotate((0.0, 0.0, params["slot"]))
    else:
        tip = kit.cylinder(0.6 * ds, foot, ball / 2.0 + 1.0)
        room = kit.cylinder(0.6 * ds + 0.1, foot, ball)
    product.cut(["ball"], kit.place(room, origin, axis))
    product.cut(["body"], kit.place(kit.cylinder(ds + gap, 0.0, top + 1.0), origin, axis))
    base = top - 4.0 * params["packings"]
    if params["packings"]:
        product.cut(["body"], kit.place(kit.cylinder(wide, base, top + 1.0), origin, axis))
    for k in range(params["packings"]):
        ring = kit.tube(wide, ds + gap, base + 4.0 * k, base + 4.0 * k + 4.0)
        product.add("packing", kit.place(ring, origin, axis))
    base = top
    if params["gland"]:
        product.add("gland", kit.place(kit.tube(ds + 16.0, ds + gap, base, base + 5.0), origin, axis))
        base += 5.0
    groove = ball / 2.0 + 11.0
    stem = (
        kit.cylinder(ds, ball / 2.0 + 1.0, base + 15.0) + tip - kit.tube(ds + 4.0, ds - 4.6, groove - 2.6, groove + 2.6)
    )
    name = product.add("stem", kit.place(stem, origin, axis))
    # a pin along y across the groove
    side, up = params["stem_side"] * (ds / 2.0 + 0.2), params["pin_up"]
    at = (groove * axis[0] - side * axis[2], 0.0, groove * axis[2] + side * axis[0])
    product.cut(["body"], kit.place(kit.cylinder(5.0, -ball / 2.0, 99.0, segments=16), at, (0.0, up, 0.0)))
    pin = kit.cylinder(5.0, -ball / 2.0, ball / 2.0 + 10.0, segments=16)
    product.add("stem_pin", kit.place(pin, at, (0.0, up, 0.0)))
    lever = kit.plate(params["lever"], 10.0, base, base + 10.0, radius=4.0).translate(
        (params["lever"] / 2.0 - 5.0, 0.0, 0.0)
    )
    lever = (lever + kit.cylinder(ds + 10.0, base, base + 10.0)).rotate((0.0, 0.0, params["lever_angle"]))
    lever -= kit.cylinder(ds + gap, 0.0, 199.0)
    lever_name = product.add("lever", kit.place(lever, origin, axis))
    if params["lever_pin"]:
        spin = math.radians(params["lever_angle"] + 75.0)
        across, middle = (math.cos(spin), math.sin(spin), 0.0), (0.0, 0.0, base + 5.0)
        tool = kit.place(kit.cylinder(4.0, -40.0, 40.0, segments=12), middle, across)
        product.cut([name, lever_name], kit.place(tool, origin, axis))
        pin = kit.place(kit.cylinder(4.0, -ds / 2.0 - 4.0, ds / 2.0 + 8.0, segments=12), middle, across)
        product.add("pin", kit.place(pin, origin, axis))


FAMILY = Family(
    name="ball_valve",
    version=2,
    summary="a ball behind caps on oblique cross pins, keyed to a leaning stem that a pin across its groove holds",
    draw=draw,
    build=build,
)
