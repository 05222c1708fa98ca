"""Gate valves: a wedge on a T-headed stem under a bonnet, packing and a handwheel, on a pipe that may be oblique."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

_SKIRT = 12.0
"""How far the bonnet reaches down over the body's neck."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one valve."""
    pick = kit.Draw(rng)
    return {
        "bore": pick.length(10.0, 15.0),
        "lean": pick.choice((90.0, 75.0, 68.0, 60.0)),
        "wedge": pick.length(12.0, 15.0),
        "stem": pick.length(6.0, 8.0),
        "fit": pick.choice(("H9/d9", "H8/f7", "exact")),
        "screws": pick.some((20.0, 65.0, 115.0, 160.0, 200.0, 245.0, 295.0, 340.0), pick.count(1, 3)),
        "packings": pick.count(0, 3),
        "gland": pick.choice(("bolted", "loose")),
        "wheel": pick.choice(("pin", "clip")),
        "wheel_angle": pick.length(0.0, 180.0, 1.0),
        "lobes": pick.count(2, 5),
        "seats": [
            {
                "there": pick.chance(0.5),
                "angle": pick.choice((90.0, 270.0)) + pick.length(-25.0, 25.0, 1.0),
                "lock": pick.chance(0.8),
            }
            for _ in range(2)
        ],
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the valve: the stem along z, the middle of the pipe at the origin."""
    product, bore, w = Product(), params["bore"], params["wedge"]
    width = bore + 8.0
    barrel = math.hypot(width, w) + 10.0
    lean = math.radians(params["lean"])
    pipe = bore + 18.0
    floor = -bore / 2.0 - 3.0
    reach = (barrel / 2.0 + 14.0) / math.sin(lean)
    top = reach * math.cos(lean) + pipe / 2.0 * math.sin(lean) + 4.0 + _SKIRT
    body = kit.cylinder(barrel, floor - 7.0, top)
    sides = [(s * math.sin(lean), 0.0, s * math.cos(lean)) for s in (1.0, -1.0)]
    for side in sides:
        body += kit.place(kit.cylinder(pipe, 0.0, reach), (0.0, 0.0, 0.0), side)
    gap = clearance(w, params["fit"])
    body -= kit.box(
        (-w / 2.0 - gap / 2.0, -width / 2.0 - gap / 2.0, floor),
        (w / 2.0 + gap / 2.0, width / 2.0 + gap / 2.0, top + 1.0),
    )
    for side in sides:
        body -= kit.place(kit.cylinder(bore, 0.0, reach + 1.0), (0.0, 0.0, 0.0), side)
    product.add("body", body)
    for side, seat in zip(sides, params["seats"], strict=True):
        if seat["there"]:
            _add_seat(product, params, seat, tuple(reach * v for v in side), side)
    peak = top + 14.0
    _add_stem(product, params, floor, peak)
    _add_bonnet(product, params, (barrel, top, peak))
    return product


def _add_seat(product: Product, params: Mapping[str, Any], seat: Mapping[str, Any], end: Any, side: Any) -> None:
    """Add a ring in one end of the pipe, and its locking screw."""
    bore = params["bore"]
    gap, depth = clearance(bore, params["fit"]), 12.0
    product.cut(["body"], kit.place(kit.cylinder(bore + 8.0, -depth, 1.0), end, side))
    name = product.add("seat", kit.place(kit.tube(bore + 8.0 - gap, bore - 6.0, -depth, 0.0), end, side))
    if seat["lock"]:
        angle = math.radians(seat["angle"])
        axis, base = (math.cos(angle), math.sin(angle), 0.0), (0.0, 0.0, -depth / 2.0)
        tool = kit.cylinder(6.0, bore / 2.0 - 1.5, bore + 20.0, segments=12)
        product.cut(["body", name], kit.place(kit.place(tool, base, axis), end, side))
        screw = kit.cylinder(6.0, bore / 2.0 - 1.5, bore / 2.0 + 13.0, segments=12)
        product.add("lock_screw", kit.place(kit.place(screw, base, axis), end, side))


def _add_stem(product: Product, params: Mapping[str, Any], floor: float, peak: float) -> None:
    """Add the wedge and the stem, whose head slides into the wedge from the side."""
    w, ds, width = params["wedge"], params["stem"], params["bore"] + 8.0
    wedge = kit.box((-w / 2.0, -width / 2.0, floor), (w / 2.0, width / 2.0, peak))
    wedge -= kit.box((-w, -width, floor - 1.0), (w, -width / 2.0 + 3.0, floor + 4.0))
    long = _length(params, peak)
    stem = kit.cylinder(ds, peak - 11.0, long - 16.0) + kit.cylinder(ds - 2.0, peak - 11.0, long)
    stem += kit.cylinder(ds + 4.0, peak - 11.0, peak - 6.0)
    slot = kit.box((-w, -ds / 2.0 - 2.2, peak - 11.0), (w, ds / 2.0 + 2.2, peak - 5.8))
    slot += kit.box((-w, -ds / 2.0 - 0.1, peak - 8.0), (w, ds / 2.0 + 0.1, peak + 1.0))
    product.add("wedge", wedge - slot)
    product.add("stem", stem)


def _length(params: Mapping[str, Any], peak: float) -> float:
    """Return the height of the stem's end: above bonnet, packing, gland and handwheel."""
    return peak + 1.0 + 9.0 + 5.0 * params["packings"] + 5.0 + 14.0 + 16.0 + 6.0


def _add_bonnet(product: Product, params: Mapping[str, Any], where: tuple[float, float, float]) -> None:
    """Add the bonnet over the wedge's end, and what is on the stem above it."""
    (barrel, top, peak), ds, rings = where, params["stem"], params["packings"]
    gap, roof = clearance(ds, params["fit"]), peak + 1.0
    box_floor = roof + 9.0
    box_top = box_floor + 5.0 * rings + 5.0
    w, width = params["wedge"] + 0.4, params["bore"] + 8.4
    bonnet = kit.cylinder(barrel + 12.0, top - _SKIRT, box_floor) - kit.cylinder(barrel, 0.0, top)
    neck = kit.cylinder(ds + 18.0, box_floor - 5.0, box_top)
    bonnet += _oval(ds, box_floor - 5.0, box_top) if params["gland"] == "bolted" else neck
    bonnet -= kit.box((-w / 2.0, -width / 2.0, top - 1.0), (w / 2.0, width / 2.0, roof))
    bonnet -= kit.cylinder(ds + gap, top, box_top + 1.0)
    bonnet -= kit.cylinder(ds + 10.0, box_floor, box_top + 1.0)
    name = product.add("bonnet", bonnet)
    for angle in params["screws"]:
        axis, at = (math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.0), (0.0, 0.0, top - _SKIRT / 2.0)
        tool = kit.cylinder(7.0, barrel / 2.0 - 4.0, barrel, segments=16)
        product.cut(["body", name], kit.place(tool, at, axis))
        screw = kit.cylinder(7.0, barrel / 2.0 - 4.0, barrel / 2.0 + 10.0, segments=16)
        product.add("screw", kit.place(screw, at, axis))
    for k in range(rings):
        low = box_floor + 5.0 * k
        product.add("packing", kit.tube(ds + 10.0 - gap, ds + gap, low, low + 5.0))
    gland = _oval(ds, box_top, box_top + 8.0) + kit.cylinder(ds + 10.0 - gap, box_top - 5.0, box_top + 1.0)
    gland -= kit.cylinder(ds + gap, 0.0, box_top + 9.0)
    gland_name = product.add("gland", gland)
    if params["gland"] == "bolted":
        for x in (ds / 2.0 + 11.0, -ds / 2.0 - 11.0):
            product.cut(
                [gland_name, name], kit.cylinder(6.1, box_top - 5.0, 999.0, segments=12).translate((x, 0.0, 0.0))
            )
            product.add("gland_bolt", kit.bolt(6.0, 13.0).translate((x, 0.0, box_top + 8.0)))
    _add_wheel(product, params, _length(params, peak))


def _oval(ds: float, z0: float, z1: float) -> Manifold:
    """Return an oval plate for a gland with two bolts."""
    lobe, x = kit.cylinder(14.0, z0, z1, segments=16), ds / 2.0 + 11.0
    return Manifold.batch_hull(
        [lobe.translate((x, 0.0, 0.0)), lobe.translate((-x, 0.0, 0.0)), kit.cylinder(ds + 18.0, z0, z1)]
    )


def _add_wheel(product: Product, params: Mapping[str, Any], end: float) -> None:
    """Add the handwheel on the stem's thinner end, and what holds it."""
    ds, angle, radius = params["stem"] - 2.0, params["wheel_angle"], 0.4 * params["bore"] + 11.0
    if params["gland"] == "bolted":
        radius = ds / 2.0 + 6.0
    low = end - 16.0
    wheel = kit.cylinder(2.0 * radius, low, low + 10.0)
    for x, y in kit.on_circle(params["lobes"], 2.3 * radius, phase=angle):
        wheel -= kit.cylinder(radius, low - 1.0, low + 11.0, segments=16).translate((x, y, 0.0))
    wheel -= kit.cylinder(ds + clearance(ds, params["fit"]), low - 1.0, low + 11.0)
    if params["wheel"] == "pin":
        wheel += kit.cylinder(radius, low + 10.0, end + 4.0) - kit.cylinder(ds + 1.0, low, end + 0.5)
    name = product.add("handwheel", wheel)
    if params["wheel"] == "pin":
        axis = (math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.0)
        tool = kit.cylinder(3.0, -2.0 * radius, 2.0 * radius, segments=12)
        hole = kit.place(tool, (0.0, 0.0, low + 5.0), axis)
        product.cut([name, "stem"], hole)
        product.add(
            "pin",
            kit.place(kit.cylinder(3.0, 1.0 - radius / 2.0, radius / 2.0, segments=12), (0.0, 0.0, low + 5.0), axis),
        )
    elif params["wheel"] == "clip":
        product.cut(["stem"], kit.tube(ds + 4.0, ds - 2.0, low + 10.0, low + 12.0))
        clip = kit.tube(ds + 8.0, ds - 2.0, low + 10.0, low + 12.0)
        mouth = kit.box((0.0, 1.0 - ds / 2.0, low), (ds + 9.0, ds / 2.0 - 1.0, low + 20.0))
        product.add("clip", clip - mouth.rotate((0.0, 0.0, angle)))


FAMILY = Family(
    name="gate_valve",
    version=2,
    summary="a wedge and a T-headed stem that part sideways once the bonnet is off; seats locked along an oblique pipe",
    draw=draw,
    build=build,
)
