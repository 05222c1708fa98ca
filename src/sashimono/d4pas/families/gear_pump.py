"""Gear pumps: two gears between body and cover, a keyed drive shaft, fittings in oblique ports behind hidden pins."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

_FLOOR, _GEAR, _COVER = 16.0, 9.0, 10.0
"""Thickness of the body under its pocket, of the gears and of the cover."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one pump."""
    pick = kit.Draw(rng)
    angles = pick.some((35.0, 145.0, 215.0, 325.0), pick.count(1, 3))
    return {
        "teeth": pick.count(7, 9),
        "module": pick.choice((3.0, 3.5)),
        "shaft": pick.length(9.0, 11.0),
        "fit": pick.choice(("H9/d9", "H8/f7", "exact")),
        "key": pick.chance(0.25),
        "screws": pick.count(2, 3),
        "dowel": pick.chance(0.7),
        "seal": pick.chance(0.7),
        "hub": pick.choice(("pin", "screw", "none")),
        "hub_angle": pick.length(0.0, 180.0, 1.0),
        "below": pick.chance(0.2),
        "ports": [
            {
                "angle": angle + pick.length(-10.0, 10.0, 1.0),
                "pin": pick.choice(("hidden", "hidden", "above")),
                "kind": pick.choice(("fitting", "plug", "relief")),
            }
            for angle in angles
        ],
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the pump: the body from z = 0 upwards, the gears' axes along z at x = ± half their distance."""
    product, teeth, module = Product(), params["teeth"], params["module"]
    far, tip = teeth * module / 2.0, (teeth + 1.8) * module + 0.6
    top = _FLOOR + _GEAR
    outline = tip + 30.0
    body = _slab(far, outline, 0.0, top)
    ports = []
    for port in params["ports"]:
        angle = math.radians(port["angle"])
        axis, reach = (math.cos(angle), math.sin(angle), 0.0), outline / 2.0 + far * abs(math.cos(angle)) + 18.0
        ports.append(((reach * axis[0], reach * axis[1], 8.0), axis))
        arm = kit.box((0.0, -10.0, 0.0), (reach, 10.0, _FLOOR)).rotate((0.0, 0.0, port["angle"]))
        body += arm
    pocket = kit.cylinder(tip, _FLOOR, top + 1.0)
    body -= pocket.translate((far, 0.0, 0.0)) + pocket.translate((-far, 0.0, 0.0))
    product.add("body", body)
    product.add("cover", _slab(far, outline, top, top + _COVER))
    for port, (end, axis) in zip(params["ports"], ports, strict=True):
        _add_port(product, params, port, (end, axis))
    _add_gears(product, params, far)
    places = [(0.0, outline / 2.0 - 7.0), (0.0, 7.0 - outline / 2.0), (far + outline / 2.0 - 7.5, 0.0)][
        : params["screws"]
    ]
    sign, base = (-1.0, 0.0) if params["below"] else (1.0, top + _COVER)
    for x, y in places:
        long = top + 0.6 * _COVER if params["below"] else _COVER + 14.0
        product.cut(
            ["body", "cover"], kit.place(kit.cylinder(8.1, -long, 1.0, segments=12), (x, y, base), (0.0, 0.0, sign))
        )
        product.add("bolt", kit.place(kit.bolt(8.0, long), (x, y, base), (0.0, 0.0, sign)))
    if params["dowel"]:
        dowel = kit.cylinder(7.0, top - 10.0, top + 0.6 * _COVER, segments=16)
        dowel = dowel.translate((7.5 - far - outline / 2.0, 0.0, 0.0))
        product.cut(["body", "cover"], dowel)
        product.add("dowel", dowel)
    return product


def _slab(far: float, outline: float, z0: float, z1: float) -> Manifold:
    """Return the long rounded slab that body and cover are made of."""
    ends = [kit.cylinder(outline, z0, z1, segments=32).translate((x, 0.0, 0.0)) for x in (far, -far)]
    return Manifold.batch_hull(ends)


def _add_gears(product: Product, params: Mapping[str, Any], far: float) -> None:
    """Add gears and shafts; the drive shaft comes out through seal and hub."""
    teeth, module, ds, top = params["teeth"], params["module"], params["shaft"], _FLOOR + _GEAR
    gap, lid = clearance(ds, params["fit"]), top + _COVER
    for x, phase, name in ((far, 0.0, "drive"), (-far, 180.0 / teeth if teeth % 2 == 0 else 0.0, "idler")):
        gear = kit.spur_gear(teeth, module, ds + gap, _FLOOR, top, phase=phase).translate((x, 0.0, 0.0))
        is_drive = name == "drive"
        end = lid + (24.0 if is_drive else -4.0)
        shaft = kit.cylinder(ds, 5.0, end).translate((x, 0.0, 0.0))
        room = kit.cylinder(ds + gap, 5.0, lid + 1.0 if is_drive else lid - 4.0).translate((x, 0.0, 0.0))
        product.cut(["body", "cover"], room)
        gear_name, shaft_name = product.add("gear", gear), product.add("shaft", shaft)
        if is_drive and params["key"]:
            key = kit.box((x + ds / 2.0 - 2.5, -2.0, _FLOOR + 0.5), (x + ds / 2.0 + 1.8, 2.0, top - 0.5))
            way = kit.box((x + ds / 2.0 - 2.5, -2.0, _FLOOR + 0.5), (x + ds, 2.0, 99.0))
            product.cut([shaft_name], way)
            product.cut([gear_name], kit.box((x, -2.0, _FLOOR - 1.0), (x + ds / 2.0 + 1.9, 2.0, top + 1.0)))
            product.add("key", key)
    base = lid
    if params["seal"]:
        product.cut(["cover"], kit.cylinder(ds + 8.0, lid - 5.0, lid + 1.0).translate((far, 0.0, 0.0)))
        product.add("seal", kit.tube(ds + 8.0, ds + gap, lid - 5.0, lid).translate((far, 0.0, 0.0)))
    if params["hub"] != "none":
        hub = kit.cylinder(ds + 16.0, base, base + 18.0) - kit.cylinder(ds + gap, 0.0, 99.0)
        hub_name = product.add("hub", hub.translate((far, 0.0, 0.0)))
        angle, at = math.radians(params["hub_angle"]), (far, 0.0, base + 11.0)
        axis, start = (math.cos(angle), math.sin(angle), 0.0), 1.0 if params["hub"] == "screw" else -ds / 2.0 - 7.0
        low = 1.0 if params["hub"] == "screw" else -99.0
        product.cut(["shaft", hub_name], kit.place(kit.cylinder(5.0, low, 99.0, segments=16), at, axis))
        pin = kit.cylinder(5.0, start, ds / 2.0 + 8.5, segments=16)
        product.add("pin" if params["hub"] == "pin" else "set_screw", kit.place(pin, at, axis))


def _add_port(product: Product, params: Mapping[str, Any], port: Mapping[str, Any], at: Any) -> None:
    """Add a fitting in one port, what is behind it and the pin across its groove; z points outwards along the port."""
    (end, axis), size = at, 10.0
    gap, is_hidden = clearance(size, params["fit"]), port["pin"] == "hidden"
    inner, back = (28.0, -24.0) if is_hidden else (19.0, -8.0)
    is_relief = port["kind"] == "relief" and not is_hidden
    deep = 27.0 if is_relief else inner
    product.cut(["body"], kit.place(kit.cylinder(size, -deep, 1.0), end, axis))
    if is_relief:
        product.add("poppet", kit.place(kit.cylinder(size - gap, -deep, -deep + 4.0), end, axis))
        product.add("spring", kit.place(kit.tube(size - gap, size - 5.0, -deep + 4.0, -inner), end, axis))
    solid = kit.cylinder(size - gap, -inner, 2.0) + kit.hexagon(14.0, 0.0, 7.0)
    if port["kind"] == "fitting":
        solid = solid + kit.cylinder(size, 0.0, 20.0) - kit.cylinder(2.5, -inner - 1.0, 30.0)
    name = product.add("fitting" if port["kind"] == "fitting" else "plug", kit.place(solid, end, axis))
    side = (size / 2.0 - 0.2) * math.copysign(1.0, axis[0] * axis[1])
    foot = (end[0] + back * axis[0] - side * axis[1], end[1] + back * axis[1] + side * axis[0], 0.0)
    low, high = 3.0, _FLOOR + (_GEAR if is_hidden else 3.0)
    room = kit.cylinder(5.0, low, 30.0, segments=16)
    product.cut(["body", name], room.translate(foot))
    product.add("pin", kit.cylinder(5.0, low, high, segments=16).translate(foot))


FAMILY = Family(
    name="gear_pump",
    version=2,
    summary="gears, keys and dowels under a cover that also hides the pins of oblique fittings and relief valves",
    draw=draw,
    build=build,
)
