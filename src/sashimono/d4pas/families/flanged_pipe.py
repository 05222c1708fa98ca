"""Flanged pipes: arms at oblique angles, sunk inserts, loose rings, cross pins, bolts and studs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import combinations
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

_INSERT = 4.0
_LAYOUTS = {
    "elbow": (0.0, 118.0),
    "wye": (0.0, 128.0, 227.0),
    "lateral": (0.0, 180.0, 68.0),
    "cross": (0.0, 82.0, 171.0, 256.0),
}
"""Directions of the arms in the plane z = 0 [degrees]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one pipe."""
    pick = kit.Draw(rng)
    layout = pick.choice(tuple(_LAYOUTS))
    joints: list[dict[str, Any] | None] = [_draw_joint(pick) for _ in _LAYOUTS[layout]]
    if len(joints) > 2 and pick.chance(0.15):
        joints[pick.count(0, 2)] = None
    return {
        "layout": layout,
        "bore": pick.length(8.0, 12.0),
        "size": pick.choice((8.0, 10.0)),
        "thickness": pick.length(9.0, 12.0),
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
        "turn": pick.length(-10.0, 10.0, 1.0),
        "joints": joints,
    }


def _draw_joint(pick: kit.Draw) -> dict[str, Any]:
    return {
        "held": pick.choice(("bolt", "stud", "pin", "pin")),
        "mate": pick.choice(("blind", "pipe", "lap")),
        "angle": pick.choice((0.0, 180.0)) + pick.length(-30.0, 30.0, 1.0),
        "inserts": pick.choice((0, 1, 1, 2)),
        "stop": pick.chance(0.7),
        "length": pick.length(22.0, 36.0),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the pipe: arms from the origin in the plane z = 0, a joint at the end of each."""
    product, bore, outer = Product(), params["bore"], params["bore"] + 14.0
    rim, depth = outer + 4.2 * params["size"], 14.0 + 2.0 * _INSERT
    azimuths = [azimuth + params["turn"] * k for k, azimuth in enumerate(_LAYOUTS[params["layout"]])]
    axes = [(math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth)), 0.0) for azimuth in azimuths]
    closest = min(math.acos(a[0] * b[0] + a[1] * b[1]) for a, b in combinations(axes, 2))
    reach = max(rim / 2.0 / math.tan(closest / 2.0) + params["thickness"] + 1.0, outer / 2.0 + depth)
    ends = [(reach * x, reach * y, 0.0) for x, y, _ in axes]
    solid, hollow = kit.sphere(outer), kit.sphere(bore)
    for end, axis, joint in zip(ends, axes, params["joints"], strict=True):
        arm = kit.cylinder(outer, -reach, 0.0)
        if joint is not None and joint["held"] != "pin":
            arm += _flange(params, -params["thickness"], 0.0)
        solid += kit.place(arm, end, axis)
        hollow += kit.place(kit.cylinder(bore, -reach, 1.0), end, axis)
    product.add("body", solid - hollow)
    for end, axis, joint in zip(ends, axes, params["joints"], strict=True):
        if joint is not None:
            _add_joint(product, params, joint, (end, axis))
    return product


def _flange(params: Mapping[str, Any], z0: float, z1: float) -> Manifold:
    """Return an oval flange for two bolts."""
    size, outer = params["size"], params["bore"] + 14.0
    lobe = kit.cylinder(2.2 * size, z0, z1, segments=16)
    lobes = [lobe.translate((x, y, 0.0)) for x, y in kit.on_circle(2, outer + 2.2 * size, phase=90.0)]
    return Manifold.batch_hull([*lobes, kit.cylinder(outer + 2.0, z0, z1)])


def _add_joint(product: Product, params: Mapping[str, Any], joint: Mapping[str, Any], at: Any) -> None:
    """Add what is on one arm; z = 0 is the face of the body's end, z points outwards."""
    thick, bore, outer = params["thickness"], params["bore"], params["bore"] + 14.0
    socket, collar, is_pinned = outer - 8.0, 5.0, joint["held"] == "pin"
    gap, deep = clearance(socket, params["fit"]), 12.0 if is_pinned else 6.0
    low = deep + _INSERT * joint["inserts"]
    product.cut(["body"], kit.place(kit.cylinder(socket, -low, 1.0), *at))
    for k in range(joint["inserts"]):
        ring = kit.tube(socket - gap, bore - 2.0 * k, _INSERT * k - low, _INSERT * (k + 1) - low)
        product.add(("seal", "orifice")[k], kit.place(ring, *at))
    solid, drilled = kit.cylinder(socket - gap, -deep, 1.0), ["body"]
    top, end = thick, thick + joint["length"]
    if joint["mate"] == "lap":
        top, end = collar + thick, collar + thick + joint["length"]
        solid += kit.cylinder(outer + 0.9 * params["size"], 0.0, collar) + kit.cylinder(outer, 0.0, end)
    else:
        solid += kit.cylinder(outer, 0.0, thick) if is_pinned else _flange(params, 0.0, thick)
        if joint["mate"] == "pipe":
            solid += kit.cylinder(outer, 0.0, end)
    hollow = kit.cylinder(bore, -deep - 1.0, 0.0 if joint["mate"] == "blind" else end + 1.0)
    mate = product.add("cover" if joint["mate"] == "blind" else "pipe", kit.place(solid - hollow, *at))
    drilled.append(mate)
    if joint["mate"] == "lap":
        ring = _flange(params, collar, collar + thick) - kit.cylinder(outer + gap, 0.0, 99.0)
        drilled[1] = product.add("ring", kit.place(ring, *at))
        if joint["stop"] and joint["held"] != "stud":
            _add_pin(product, [mate], (top + 0.7 * joint["length"], 70.0, outer), at)
    if is_pinned:
        _add_pin(product, ["body", mate], (-6.0, joint["angle"], outer), at)
    else:
        _add_bolts(product, params, joint["held"] == "stud", (drilled, top), at)


def _add_pin(product: Product, drilled: list[str], where: tuple[float, float, float], at: Any) -> None:
    """Add a pin with a head across one arm; at an angle from the plane's normal."""
    z, angle, outer = where
    axis = (-math.cos(math.radians(angle)), math.sin(math.radians(angle)), 0.0)
    hole = kit.cylinder(5.0, -outer, outer, segments=16)
    pin = kit.cylinder(5.0, 1.0 - outer / 2.0, outer / 2.0 + 4.0, segments=16)
    pin += kit.cylinder(8.0, outer / 2.0 + 0.5, outer / 2.0 + 4.0, segments=16)
    product.cut(drilled, kit.place(kit.place(hole, (0.0, 0.0, z), axis), *at))
    product.add("pin", kit.place(kit.place(pin, (0.0, 0.0, z), axis), *at))


def _add_bolts(
    product: Product, params: Mapping[str, Any], is_stud: bool, where: tuple[list[str], float], at: Any
) -> None:
    """Drill the flanges of one joint and add its bolts, or its shouldered studs and their nuts."""
    (drilled, top), size = where, params["size"]
    gap, depth = clearance(size, params["fit"]), 0.7 * params["thickness"]
    for x, y in kit.on_circle(2, params["bore"] + 14.0 + 2.2 * size, phase=90.0):
        tool = kit.cylinder(size + gap, -depth, top + 1.0, segments=12)
        if is_stud:
            bolt = kit.cylinder(1.3 * size, -depth, 0.0, segments=12)
            bolt += kit.cylinder(size, -depth, top + kit.METRIC[size][3] + 2.0, segments=12)
            room = kit.cylinder(1.3 * size + gap, -depth, 1.0, segments=12)
            product.cut(drilled[:1], kit.place(room.translate((x, y, 0.0)), *at))
        else:
            bolt = kit.bolt(size, top + depth).translate((0.0, 0.0, top))
        product.cut(drilled[1:] if is_stud else drilled, kit.place(tool.translate((x, y, 0.0)), *at))
        product.add("stud" if is_stud else "bolt", kit.place(bolt.translate((x, y, 0.0)), *at))
        if is_stud:
            nut = kit.nut(size, clearance=gap).translate((x, y, top))
            product.add("nut", kit.place(nut, *at))


FAMILY = Family(
    name="flanged_pipe",
    version=2,
    summary="pipe joints on oblique arms: loose rings behind collars, sunk inserts, cross pins, shouldered studs",
    draw=draw,
    build=build,
)
