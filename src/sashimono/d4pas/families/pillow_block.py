"""Pillow blocks: a bearing between base and cap whose parting plane and bolts may lean, collars under radial screws."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one pillow block."""
    pick = kit.Draw(rng)
    return {
        "shaft": pick.choice((12.0, 16.0, 20.0, 25.0)),
        "inner": pick.length(3.0, 5.0),
        "bearing": pick.choice(("bush", "shells", "rings")),
        "outer": pick.length(4.0, 6.0),
        "width": pick.length(10.0, 18.0),
        "lip": pick.length(4.0, 6.0),
        "wall": pick.length(14.0, 18.0),
        "feet": pick.length(14.0, 22.0),
        "lean": pick.choice((0.0, 17.0, 30.0, 45.0)),
        "bolts": pick.choice((1, 2)),
        "size": pick.choice((6.0, 8.0)),
        "shoulder": pick.chance(0.5),
        "collars": pick.count(1, 2),
        "angles": [pick.choice((18.0, 40.0, 72.0, 105.0, 160.0, 200.0)) for _ in range(2)],
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the block, its shaft along z, its foot at -y; cap and base part at a plane that leans."""
    product, half = Product(), params["width"] / 2.0
    bore = params["shaft"] + clearance(params["shaft"], params["fit"])
    race = params["shaft"] + 2.0 * params["inner"]
    outer = race + 2.0 * params["outer"]
    side = half + params["lip"]
    _housing(product, params, outer, race + 1.0, side)
    whole = kit.tube(outer, bore, -half, half)
    if params["bearing"] == "rings":
        product.add("ring", kit.tube(race, bore, -half, half))
        product.add("ring", kit.tube(outer, race, -half, half))
    elif params["bearing"] == "shells":
        above = _above(params)
        product.add("shell", whole - above)
        product.add("shell", whole ^ above)
    else:
        product.add("bush", whole)
    _shaft(product, params, side)
    return product


def _above(params: Mapping[str, Any]) -> Manifold:
    """Return the half space above the parting plane."""
    return kit.box((-900.0, 0.0, -99.0), (900.0, 900.0, 99.0)).rotate((0.0, 0.0, params["lean"]))


def _housing(product: Product, params: Mapping[str, Any], outer: float, race: float, side: float) -> None:
    """Add base and cap around the bearing, their bolts across the parting plane."""
    size, lean = params["size"], params["lean"]
    radius, half = outer / 2.0 + params["wall"], params["width"] / 2.0
    ear = radius + 2.2 * size
    body = kit.cylinder(2.0 * radius, -side, side, segments=32)
    body += kit.box((-ear, -size * 1.6, -side), (ear, size * 1.6, side)).rotate((0.0, 0.0, lean))
    floor = -radius - 4.0
    turn = math.radians(lean)
    span = max(ear * math.cos(turn) + 2.6 * size * math.sin(turn), radius) + 2.6 * size
    foot = kit.box((-span, floor - params["feet"] / 2.0, -side), (span, 0.0, side))
    foot = foot - kit.box((-2.0 * span, floor + params["feet"] / 2.0, -99.0), (-radius, 99.0, 99.0))
    foot = foot - kit.box((radius, floor + params["feet"] / 2.0, -99.0), (2.0 * span, 99.0, 99.0))
    above = _above(params)
    hollow = kit.cylinder(outer, -half, half) + kit.cylinder(race, -side - 1.0, side + 1.0)
    for sign in (-1.0, 1.0):
        hole = kit.place(kit.cylinder(size, -99.0, 99.0, segments=12), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        foot -= hole.translate((sign * (span - 1.2 * size), 0.0, 0.0))
    product.add("base", (body + foot) - above - hollow)
    product.add("cap", (body ^ above) - hollow)
    gap = clearance(size, params["fit"])
    length = 1.6 * size + 1.5 * size
    for sign in (1.0, -1.0)[: params["bolts"]]:
        at = (sign * (radius + 0.9 * size), 1.6 * size, 0.0)
        room = kit.place(kit.bolt_room(size, length, clearance=gap), at, (0.0, 1.0, 0.0)).rotate((0.0, 0.0, lean))
        product.cut(("base", "cap"), room)
        bolt = kit.place(kit.bolt(size, length), at, (0.0, 1.0, 0.0))
        product.add("bolt", bolt.rotate((0.0, 0.0, lean)))


def _shaft(product: Product, params: Mapping[str, Any], side: float) -> None:
    """Add the shaft through the bearing and collars beside it, a radial screw in each."""
    half, shaft, wide = params["width"] / 2.0, params["shaft"], 0.6 * params["shaft"] + 4.0
    reach = side + wide + 8.0
    solid = kit.cylinder(shaft, -reach, reach)
    places = [1.0, -1.0]
    if params["shoulder"]:
        places = [1.0]
        solid += kit.cylinder(shaft + 2.0 * params["inner"], -reach + 3.0, -half)
    shaft_name = product.add("shaft", solid)
    for k, sign in enumerate(places[: params["collars"]]):
        low, high = (half, side + wide) if sign > 0.0 else (-side - wide, -half)
        collar = kit.tube(shaft + 2.0 * params["inner"], shaft, low, high)
        face = (side, high) if sign > 0.0 else (low, -side)
        collar += kit.tube(1.9 * shaft + 4.0, shaft, face[0] + 0.5 * (sign > 0), face[1] - 0.5 * (sign < 0))
        name = product.add("collar", collar)
        z, across = (face[0] + face[1]) / 2.0, 0.36 * shaft
        screw = kit.cylinder(across, 0.22 * shaft, 0.95 * shaft + 2.0, segments=12)
        room = kit.cylinder(across + 0.04, 0.22 * shaft, 2.0 * shaft, segments=12)
        for part in (name, shaft_name):
            tool = kit.place(room, (0.0, 0.0, z), (1.0, 0.0, 0.0)).rotate((0.0, 0.0, params["angles"][k]))
            product.cut((part,), tool)
        product.add("screw", kit.place(screw, (0.0, 0.0, z), (1.0, 0.0, 0.0)).rotate((0.0, 0.0, params["angles"][k])))


FAMILY = Family(
    name="pillow_block",
    version=2,
    summary="base and cap part at a leaning plane; bearing and shaft are held by collars whose screws point anywhere",
    draw=draw,
    build=build,
)
