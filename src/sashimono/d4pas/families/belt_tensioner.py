"""Belt tensioners: a slider in a T-slot with a pulley on its stud, a clip from the side and slanted lock screws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

FOOT, NECK = 9.0, 7.0
"""Heights of the T-slot's wide and narrow parts."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one tensioner."""
    pick = kit.Draw(rng)
    return {
        "neck": pick.length(17.0, 22.0),
        "floor": pick.length(7.0, 12.0),
        "slider": pick.length(28.0, 40.0),
        "free": pick.length(6.0, 20.0),
        "rail": pick.length(12.0, 18.0),
        "stud": pick.choice((10.0, 12.0, 14.0)),
        "pulley": pick.length(30.0, 60.0, 1.0),
        "width": pick.length(14.0, 24.0),
        "bush": pick.chance(0.6),
        "disc": pick.chance(0.4),
        "angle": pick.choice((15.0, 30.0, 60.0, 105.0, 150.0)),
        "lock": pick.choice((0, 1, 2)),
        "slant": pick.choice((0.0, 17.0, 30.0)),
        "adjuster": pick.chance(0.7),
        "screws": pick.count(1, 2),
        "idler": pick.chance(0.5),
        "idler_angle": pick.choice((15.0, 45.0, 75.0, 120.0)),
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the tensioner: the base's top at z = 0, its slot along x, open at x = 0 where the end plate sits."""
    product = Product()
    neck, wide = params["neck"] / 2.0, params["neck"] / 2.0 + 7.0
    length = params["slider"] + params["free"]
    back = -length - 10.0 - ((0.5 * params["pulley"] + 40.0) if params["idler"] else 0.0)
    across, low = wide + params["rail"], -FOOT - NECK - params["floor"]
    base = kit.box((back, -across, low), (0.0, across, 0.0))
    base -= kit.box((-length, -wide, -FOOT - NECK), (5.0, wide, -NECK))
    base -= kit.box((-length, -neck, -NECK - 1.0), (5.0, neck, 1.0))
    product.add("base", base)
    slider = kit.box((-length, -wide, -FOOT - NECK), (-params["free"], wide, -NECK))
    slider += kit.box((-length, -neck, -NECK - 1.0), (-params["free"], neck, 0.0))
    product.add("slider", slider)
    middle = -length + params["slider"] / 2.0
    _end_plate(product, params, across, low)
    for k in range(params["lock"]):
        _lock(product, params, -1.0 if k else 1.0, middle, across)
    _pulley(product, params, "slider", middle, params["angle"])
    if params["idler"]:
        _idler(product, params, -length - 20.0 - 0.5 * params["pulley"], low)
    return product


def _end_plate(product: Product, params: Mapping[str, Any], across: float, low: float) -> None:
    """Close the slot with a plate under screws, and reach through it to the slider."""
    plate = kit.box((0.0, -across, low), (9.0, across, 0.0))
    product.add("plate", plate)
    spot = across - params["rail"] / 2.0
    for sign in (1.0, -1.0)[: params["screws"]]:
        at = (9.0, sign * spot, low / 2.0)
        room = kit.place(kit.bolt_room(6.0, 24.0, clearance=0.04), at, (1.0, 0.0, 0.0))
        product.cut(("plate", "base"), room)
        product.add("screw", kit.place(kit.bolt(6.0, 24.0), at, (1.0, 0.0, 0.0)))
    if params["adjuster"]:
        at, length = (9.0, 0.0, -0.6 * (FOOT + NECK)), 9.0 + params["free"] + 9.0
        room = kit.place(kit.bolt_room(6.0, length, clearance=0.04, head="hex"), at, (1.0, 0.0, 0.0))
        product.cut(("plate", "slider"), room)
        product.add("adjuster", kit.place(kit.bolt(6.0, length, head="hex"), at, (1.0, 0.0, 0.0)))


def _lock(product: Product, params: Mapping[str, Any], sign: float, middle: float, across: float) -> None:
    """Add a grub screw through the base's side into the slider's foot, slanted in the plane of the base."""
    slant = math.radians(params["slant"])
    axis = (-math.sin(slant), sign * math.cos(slant), 0.0)
    tip = params["neck"] / 2.0 + 2.0
    at = (middle, sign * tip, -NECK - FOOT / 2.0)
    reach = (across - tip) / math.cos(slant)
    screw = kit.cylinder(6.0, 0.0, reach + 2.0, segments=12)
    room = kit.cylinder(6.06, 0.0, reach + 20.0, segments=12)
    product.cut(("base", "slider"), kit.place(room, at, axis))
    product.add("grub", kit.place(screw, at, axis))


def _pulley(product: Product, params: Mapping[str, Any], carrier: str, x: float, angle: float) -> None:
    """Add a pulley on a stud of the carrier, under a clip that slides in from the side; with bush and disc or not."""
    stud, width = params["stud"], params["width"]
    top = 3.0 + width + (4.0 if params["disc"] else 0.0)
    post = kit.cylinder(stud, -2.0, top + 8.0) + kit.cylinder(stud + 5.0, 0.0, 3.0)
    post -= kit.tube(2.0 * stud, 0.7 * stud, top, top + 4.0)
    product.join(carrier, post.translate((x, 0.0, 0.0)))
    bore = stud + clearance(stud, params["fit"])
    inner = stud + 7.0 if params["bush"] else bore
    wheel = kit.cylinder(params["pulley"], 3.0, 3.0 + width, segments=32)
    wheel -= kit.tube(2.0 * params["pulley"], params["pulley"] - 6.0, 6.0, width, segments=32)
    parts = [("pulley", wheel - kit.cylinder(inner, 0.0, 99.0))]
    if params["bush"]:
        parts.append(("bush", kit.tube(inner, bore, 3.0, 3.0 + width)))
    if params["disc"]:
        parts.append(("disc", kit.tube(stud + 16.0, bore, 3.0 + width, top)))
    clip = kit.clip(stud + 14.0, 0.72 * stud, top, top + 4.0).rotate((0.0, 0.0, angle))
    for name, solid in (*parts, ("clip", clip)):
        product.add(name, solid.translate((x, 0.0, 0.0)))


def _idler(product: Product, params: Mapping[str, Any], x: float, low: float) -> None:
    """Add a second pulley on a headed pin from below, under its own clip."""
    size, width = params["stud"], params["width"]
    pin = kit.cylinder(size, low - 1.0, 3.0 + width + 8.0) + kit.cylinder(1.8 * size, low - 6.0, low)
    pin -= kit.tube(2.0 * size, 0.7 * size, 3.0 + width, 7.0 + width)
    hole = kit.cylinder(size + clearance(size, params["fit"]), low - 9.0, 99.0)
    base = kit.cylinder(size + 8.0, -1.0, 3.0).translate((x, 0.0, 0.0))
    product.join("base", base)
    product.cut(("base",), hole.translate((x, 0.0, 0.0)))
    wheel = kit.cylinder(0.8 * params["pulley"], 3.0, 3.0 + width, segments=32) - hole
    clip = kit.clip(size + 12.0, 0.72 * size, 3.0 + width, 7.0 + width).rotate((0.0, 0.0, params["idler_angle"]))
    for name, solid in (("pin", pin), ("pulley", wheel), ("clip", clip)):
        product.add(name, solid.translate((x, 0.0, 0.0)))


FAMILY = Family(
    name="belt_tensioner",
    version=2,
    summary="pulleys under clips from the side; the slider leaves its T-slot only past adjuster, end plate and locks",
    draw=draw,
    build=build,
)
