"""A trick box: pins lock key bars, bars lock the sliding lid, a rod under the lid locks the drawers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

WALL, LID, FLOOR = 12.0, 13.0, 6.0
"""Thickness of walls, lid and floors [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one box."""
    pick = kit.Draw(rng)
    bars = pick.choice((0, 1, 2), (1, 3, 3))
    return {
        "length": pick.length(80.0, 110.0),
        "width": pick.length(60.0, 80.0),
        "room": pick.length(15.0, 28.0),
        "fit": pick.choice(("H11/c11", "H9/d9", "exact")),
        "lid_pins": [pick.choice((17.0, 30.0, 45.0)) for _ in range(pick.count(0 if bars else 1, 2))],
        "bars": [
            {"side": pick.choice((1, -1)), "pins": pick.count(0, 2), "tilt": pick.choice((-25.0, -17.0, 17.0, 25.0))}
            for _ in range(bars)
        ],
        "dividers": pick.choice((0, 1, 2), (3, 4, 1)),
        "blocks": pick.choice(("none", "box", "ball")),
        "lip": pick.chance(0.2),
        "drawers": [
            {"height": pick.length(34.0, 38.0), "front": pick.choice((1, -1)), "knob": pick.chance(0.4)}
            for _ in range(pick.choice((0, 1, 2, 3), (2, 3, 2, 1)))
        ],
        "rod": pick.chance(0.8),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the box, centred about z and standing on z = 0; its lid slides out along +x."""
    product = Product()
    length, width = params["length"], params["width"]
    levels, z = [], FLOOR
    for drawer in params["drawers"]:
        levels.append(z)
        z += drawer["height"] + FLOOR
    top = z + params["room"] + LID
    box = kit.plate(length, width, 0.0, top, radius=3.0)
    box -= kit.box((WALL - length / 2.0, WALL - width / 2.0, z), (length / 2.0 - WALL, width / 2.0 - WALL, top + 1.0))
    product.add("box", box)
    for level, drawer in zip(levels, params["drawers"], strict=True):
        _drawer(product, params, level, drawer)
    if params["drawers"] and params["rod"]:
        place = (WALL + 7.0 - length / 2.0, 0.5 * (width / 2.0 - WALL))
        rod = kit.cylinder(8.0, 2.0, z + 4.0, segments=16).translate((*place, 0.0))
        hole = kit.cylinder(8.0 + clearance(8.0, params["fit"]), 2.0, z + 9.0, segments=16).translate((*place, 0.0))
        product.cut([name for name in product.solids if name == "box" or name.startswith("drawer")], hole)
        product.add("rod", rod)
    _contents(product, params, z, top)
    _lid(product, params, top)
    return product


def _drawer(product: Product, params: Mapping[str, Any], level: float, drawer: Mapping[str, Any]) -> None:
    """Add a drawer that leaves along +x or -x, and its knob, which leaves first."""
    length, half, front = params["length"], params["width"] / 2.0 - WALL, drawer["front"]
    gap, height = clearance(2.0 * half, params["fit"]) / 2.0, drawer["height"]
    back, face = -length / 2.0 + WALL - 2.0, length / 2.0
    room = kit.box((back, -half, level), (face + 20.0, half, level + height))
    body = kit.box((back + gap, gap - half, level), (face, half - gap, level + height - gap))
    wall = WALL if front > 0 else 2.0 * WALL + 6.0  # the rod passes both ends of every drawer
    body -= kit.box((back + 16.0, 4.0 - half, level + 3.0), (face - wall, half - 4.0, level + height + 1.0))
    turn = (0.0, 0.0, 0.0 if front > 0 else 180.0)
    middle = level + height / 2.0
    hole = kit.place(
        kit.cylinder(8.0 if drawer["knob"] else 12.0, -wall - 2.0, 2.0), (face, 0.0, middle), (1.0, 0.0, 0.0)
    )
    product.cut(["box"], room.rotate(turn))
    product.add("drawer", (body - hole).rotate(turn))
    if drawer["knob"]:
        knob = kit.cylinder(8.0, -WALL, 0.0) + kit.cylinder(12.0, 0.0, 6.0)
        product.add("knob", kit.place(knob, (face, 0.0, middle), (1.0, 0.0, 0.0)).rotate(turn))


def _contents(product: Product, params: Mapping[str, Any], low: float, top: float) -> None:
    """Add dividers in upright grooves and what lies between them, the first thing under a lip of the back wall."""
    half_length, half, high = params["length"] / 2.0 - WALL, params["width"] / 2.0 - WALL, top - LID
    count = params["dividers"]
    places = [-half_length + (k + 1) * 2.0 * half_length / (count + 1) for k in range(count)]
    for x in places:
        groove = kit.box((x - 2.5, -half - 4.0, low), (x + 2.5, half + 4.0, top + 1.0))
        product.cut(["box"], groove)
        product.add("divider", kit.box((x - 2.5, -half - 4.0, low), (x + 2.5, half + 4.0, high)))
    if params["blocks"] == "none":
        return
    edges = [-half_length, *places, half_length]
    for k in range(count + 1):
        left, right = edges[k] + (2.5 if k else 0.0), edges[k + 1] - (2.5 if k < count else 0.0)
        if k == 0 and params["drawers"] and params["rod"]:
            left += 16.0
        if right - left < 12.0:
            continue
        size = min(right - left, 2.0 * half, high - low)
        if k == 0 and params["lip"] and not params["drawers"]:
            lip = kit.box((left - 1.0, -half - 1.0, high - 5.0), (left + 6.0, half + 1.0, high))
            product.join("box", lip)
            product.add("block", kit.box((left, 0.05 - half, low), (right - 8.0, half - 0.05, high - 5.0)))
        elif params["blocks"] == "ball":
            product.add("ball", kit.sphere(size - 2.0).translate(((left + right) / 2.0, 0.0, low + (size - 2.0) / 2.0)))
        else:
            product.add("block", kit.box((left + 0.05, 0.05 - half, low), (right - 0.05, half - 0.05, high)))


def _lid(product: Product, params: Mapping[str, Any], top: float) -> None:
    """Add the lid in its dovetail, its slanted pins, and the key bars across it with their pins."""
    half_length, half = params["length"] / 2.0, params["width"] / 2.0 - WALL
    gap = clearance(2.0 * half, params["fit"]) / 2.0
    start, end = WALL - half_length, half_length

    def dovetail(wider: float, begin: float, stop: float) -> Manifold:
        wide, narrow = half + 4.0 + wider, half + wider
        outline = [(-wide, top - LID), (wide, top - LID), (narrow, top), (-narrow, top)]
        if wider or stop > end:
            outline = [*outline[:3], (narrow, top + 1.0), (-narrow, top + 1.0), outline[3]]
        return kit.prism(outline, begin, stop).rotate((90.0, 0.0, 90.0))

    product.cut(["box"], dovetail(gap, start - gap, end + 20.0))
    product.add("lid", dovetail(0.0, start, end))
    for k, tilt in enumerate(params["lid_pins"]):
        axis = (0.0, math.sin(math.radians(tilt)) * (-1.0 if k else 1.0), math.cos(math.radians(tilt)))
        origin = np.array([end - 6.0, (0.35 * half if k else -0.35 * half), top]) + 2.0 * np.array(axis)
        kit.peg(product, ["lid", "box"], 6.0, 28.0, origin.tolist(), axis, reach=20.0)
    for k, bar in enumerate(params["bars"]):
        _bar(product, params, top, bar, (0.2 - 0.6 * k) * half_length)


def _bar(product: Product, params: Mapping[str, Any], top: float, bar: Mapping[str, Any], x: float) -> None:
    """Add a key bar: it slides out sideways through one wall and locks the lid against sliding."""
    width, side = params["width"] / 2.0, bar["side"]
    gap = clearance(12.0, params["fit"]) / 2.0
    shape = [(-9.0, -7.0), (9.0, -7.0), (6.5, 1.0), (-6.5, 1.0)]
    room = [(-9.0 - gap, -7.0), (9.0 + gap, -7.0), (6.5 + gap, 2.0), (-6.5 - gap, 2.0)]
    turn = (90.0, 0.0, 0.0)
    low, high = (-width - 9.0, width - 4.0) if side > 0 else (4.0 - width, width + 9.0)
    tool = kit.prism(room, low, high).rotate(turn).translate((x, 0.0, top))
    product.cut(["lid", "box"], tool)
    low, high = (-width, width - 4.0 - gap) if side > 0 else (4.0 + gap - width, width)
    name = product.add("bar", kit.prism(shape, low, high).rotate(turn).translate((x, 0.0, top)))
    tilt = math.radians(bar["tilt"])
    for pin in range(bar["pins"]):
        axis = (math.sin(tilt), 0.0, math.cos(tilt)) if pin == 0 else (-math.sin(tilt), 0.0, math.cos(tilt))
        y = (width - 4.5) * side if pin == 0 else -0.3 * width * side
        under = "box" if pin == 0 else "lid"
        depth = 20.0 if pin == 0 else 12.0
        kit.peg(product, [name, under], 5.0, depth, (x, y, top + 1.0), axis, reach=20.0)


FAMILY = Family(
    name="sliding_box",
    version=2,
    summary="a lid in grooves behind bars behind slanted pins; drawers behind a rod under the lid; what lies inside",
    draw=draw,
    build=build,
)
