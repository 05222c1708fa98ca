"""Ball valves: a ball between seats, turned by a stem whose tongue fits a slot, entered from outside or from within."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one valve."""
    pick = kit.Draw(rng)
    inside = pick.chance(0.4)
    return {
        "ball": pick.length(26.0, 34.0),
        "bore": pick.choice((0.4, 0.5)),
        "stem": pick.length(8.0, 10.0),
        "from_inside": inside,
        "closed": not inside and pick.chance(0.5),
        "fit": pick.choice(("H9/d9", "H8/f7", "exact")),
        "ends": pick.choice(("one", "two")),
        "bolts": pick.count(2, 4),
        "phase": pick.length(10.0, 80.0, 1.0),
        "packings": pick.count(0, 2),
        "lever": pick.length(35.0, 60.0),
        "lever_angle": pick.length(0.0, 360.0, 1.0),
        "lever_held": pick.choice(("pin", "screw", "none"), (2, 2, 1)),
        "plug": pick.choice((0.0, 37.0, 55.0, 72.0)),
        "seats": pick.count(1, 2),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the valve: the way through along x, the stem along z, the ball at the origin."""
    product, ball, ds = Product(), params["ball"], params["stem"]
    hole, gap = params["bore"] * ball, clearance(ball, params["fit"])
    wide, seat = ball + 1.0, 6.0
    outer, half = wide + 22.0, ball * 0.44 + seat
    two = params["ends"] == "two"
    back = -half if two else -half - 10.0
    body = kit.cylinder(outer, back, half, segments=32)
    body -= kit.cylinder(wide, -half - (1.0 if two else 0.0), half + 1.0)
    body -= kit.cylinder(hole, -2.0 * ball, 2.0 * ball)
    along = (1.0, 0.0, 0.0)
    body = kit.place(body, (0.0, 0.0, 0.0), along)
    body += kit.cylinder(ds + 20.0, 0.5 * wide + 3.0, 0.5 * outer + 3.0)
    name = product.add("body", body)
    round_ball = kit.sphere(ball)
    for sign in (-1.0, 1.0)[2 - params["seats"] :] if not two else (-1.0, 1.0):
        ring = kit.cylinder(wide - gap, half - seat, half) - kit.cylinder(hole, 0.0, 2.0 * ball)
        product.add("seat", kit.place(ring, (0.0, 0.0, 0.0), (sign, 0.0, 0.0)) - kit.sphere(ball + 0.02))
    tongue = ds * 0.45
    turn = 90.0 if params["closed"] else 0.0
    slot = kit.box((-ball, -tongue / 2.0 - 0.05, ball / 2.0 - 5.0), (ball, tongue / 2.0 + 0.05, ball))
    round_ball -= slot.rotate((0.0, 0.0, turn))
    product.add("ball", round_ball - kit.place(kit.cylinder(hole, -ball, ball), (0.0, 0.0, 0.0), along))
    for sign in (1.0, -1.0)[: 2 if two else 1]:
        cap = kit.cylinder(outer, half, half + 10.0, segments=32) + kit.cylinder(hole + 12.0, half, half + 24.0)
        cap -= kit.cylinder(hole, half - 1.0, half + 25.0)
        cap_name = product.add("cap", kit.place(cap, (0.0, 0.0, 0.0), (sign, 0.0, 0.0)))
        for x, y in kit.on_circle(params["bolts"], wide + 11.0, phase=params["phase"]):
            tool = kit.cylinder(6.2, -12.0, 1.0, segments=12).translate((x, y, half + 10.0))
            product.cut([name, cap_name], kit.place(tool, (0.0, 0.0, 0.0), (sign, 0.0, 0.0)))
            bolt = kit.bolt(6.0, 12.0).translate((x, y, half + 10.0))
            product.add("bolt", kit.place(bolt, (0.0, 0.0, 0.0), (sign, 0.0, 0.0)))
    _add_stem(product, params, (wide / 2.0, outer / 2.0 + 3.0, tongue, turn))
    if params["plug"]:
        angle = math.radians(-params["plug"])
        axis = (0.0, math.cos(angle), math.sin(angle))
        product.cut([name], kit.place(kit.cylinder(8.0, 0.0, outer), (0.0, 0.0, 0.0), axis))
        plug = kit.cylinder(8.0, wide / 2.0 + 1.0, outer / 2.0) + kit.hexagon(13.0, outer / 2.0, outer / 2.0 + 6.0)
        product.add("plug", kit.place(plug, (0.0, 0.0, 0.0), axis))
    return product


def _add_stem(product: Product, params: Mapping[str, Any], where: tuple[float, float, float, float]) -> None:
    """Add the stem with its tongue in the ball, what seals it and the lever."""
    (wall, top, tongue, turn), ball, ds = where, params["ball"], params["stem"]
    gap = clearance(ds, params["fit"])
    foot = kit.box((-ds, -tongue / 2.0, ball / 2.0 - 5.0), (ds, tongue / 2.0, ball / 2.0 + 0.2)).rotate(
        (0.0, 0.0, turn)
    )
    foot = foot ^ kit.cylinder(ds, 0.0, ball)
    product.cut(["body"], kit.cylinder(ds + gap, 0.0, top + 1.0))
    wide = ds + 7.0
    low = ball / 2.0 + 0.2
    if params["from_inside"]:
        end = top + 10.0
        stem = kit.cylinder(wide, low, wall + 3.0) + kit.cylinder(ds, low, end)
        product.cut(["body"], kit.cylinder(wide + gap, 0.0, wall + 3.0))
        base = top
    else:
        collar = wall + 3.0
        product.cut(["body"], kit.cylinder(wide + gap, collar, top + 1.0))
        base = collar + 4.0
        for _ in range(params["packings"]):
            product.add("packing", kit.tube(wide, ds + gap, base, base + 4.0))
            base += 4.0
        plate_low = max(base, top)
        plate = kit.plate(ds + 30.0, ds + 14.0, plate_low, plate_low + 5.0, radius=3.0)
        if plate_low > top:
            product.join("body", kit.cylinder(ds + 20.0, top - 1.0, plate_low) - kit.cylinder(wide + gap, 0.0, 99.0))
        elif base < plate_low:
            plate += kit.cylinder(wide, base, plate_low)
        product.add("gland", plate - kit.cylinder(ds + gap, 0.0, 99.0))
        product.join(
            "body",
            kit.plate(ds + 30.0, ds + 14.0, plate_low - 6.0, plate_low, radius=3.0)
            - kit.cylinder(wide + gap, 0.0, 99.0),
        )
        for side in (-1.0, 1.0):
            at = (side * (ds / 2.0 + 10.0), 0.0, plate_low + 5.0)
            product.cut(["body", "gland"], kit.cylinder(4.1, -10.0, 1.0, segments=12).translate(at))
            product.add("gland_bolt", kit.bolt(4.0, 10.0).translate(at))
        base, end = plate_low + 10.0, plate_low + 24.0
        stem = (
            kit.cylinder(wide - gap, collar, collar + 4.0)
            + kit.cylinder(ds, low, base)
            + kit.cylinder(ds - 2.0, low, end)
        )
    product.add("stem", stem + foot)
    thin = ds if params["from_inside"] else ds - 2.0
    held = params["lever_held"]
    lever = kit.plate(params["lever"], 12.0, base, base + 8.0, radius=5.0).translate(
        (params["lever"] / 2.0 - 7.0, 0.0, 0.0)
    )
    lever = (lever + kit.cylinder(ds + 10.0, base, base + 8.0)).rotate((0.0, 0.0, params["lever_angle"]))
    lever_name = product.add("lever", lever - kit.cylinder(thin + gap, 0.0, 99.0))
    if held == "pin":
        spin = math.radians(params["lever_angle"] + 90.0)
        axis, at = (math.cos(spin), math.sin(spin), 0.0), (0.0, 0.0, base + 4.0)
        product.cut(["stem", lever_name], kit.place(kit.cylinder(3.0, -40.0, 40.0, segments=12), at, axis))
        product.add("pin", kit.place(kit.cylinder(3.0, -ds / 2.0 - 3.0, ds / 2.0 + 6.0, segments=12), at, axis))
    elif held == "screw":
        product.cut(["stem"], kit.box((-99.0, -99.0, base + 8.0), (99.0, 99.0, 199.0)))
        product.cut(["stem"], kit.cylinder(4.0, base, base + 9.0, segments=12))
        screw = kit.bolt(4.0, 7.0) + kit.cylinder(ds + 6.0, 0.0, 2.0)
        product.add("screw", screw.translate((0.0, 0.0, base + 8.0)))


FAMILY = Family(
    name="ball_valve",
    version=1,
    summary="a ball held by a stem's tongue; a stem with a collar inside drops and leaves sideways, in two legs",
    draw=draw,
    build=build,
)
