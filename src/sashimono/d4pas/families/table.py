"""Tables: splayed legs in a frame's oblique sockets, corner pins, stretchers, a top on pinned lugs, a drawer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))
RAIL, PIN = 12.0, 9.0
"""Thickness of the frame's rails, and its pins [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one table."""
    pick = kit.Draw(rng)
    return {
        "length": pick.length(130.0, 170.0),
        "width": pick.length(126.0, 145.0),
        "depth": pick.length(32.0, 36.0),
        "height": pick.length(60.0, 100.0),
        "top": pick.length(10.0, 16.0),
        "radius": pick.choice((0.0, 8.0, 20.0)),
        "leg": pick.length(20.0, 24.0),
        "splay": pick.choice((0.0, 14.0, 18.0), (1, 3, 3)),
        "legs": [{"pin": pick.chance(0.7), "shoulder": pick.chance(0.4)} for _ in range(4)],
        "dip": pick.choice((0.0, 15.0, 25.0)),
        "lugs": pick.count(2, 3),
        "lug_pins": pick.count(1, 2),
        "skew": pick.choice((0.0, 17.0, 30.0)),
        "ties": [{"flip": pick.chance(0.5), "pin": pick.chance(0.6)} for _ in range(pick.count(0, 2))],
        "drawer": pick.chance(0.7),
        "stop": pick.chance(0.5),
        "divider": pick.chance(0.5),
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the table: the top's underside at z = 0, the drawer's front at -y."""
    product, depth, w = Product(), params["depth"], params["leg"]
    length, width, block = params["length"], params["width"], params["leg"] + 2.0 * RAIL
    frame = kit.plate(length, width, -depth, 0.0, radius=4.0)
    frame -= kit.box((RAIL - length / 2, RAIL - width / 2, -depth - 1), (length / 2 - RAIL, width / 2 - RAIL, 1.0))
    for sx, sy in CORNERS:
        x, y = sx * length / 2.0, sy * width / 2.0
        low, high = (min(x, x - sx * block), min(y, y - sy * block)), (max(x, x - sx * block), max(y, y - sy * block))
        frame += kit.box((*low, -depth), (*high, 0.0)) ^ kit.plate(length, width, -depth, 0.0, radius=4.0)
    frame = product.add("frame", frame)
    tilt, legs = math.radians(params["splay"]), []
    for (sx, sy), leg in zip(CORNERS, params["legs"], strict=True):
        axis = np.array((0.0, -sy * math.sin(tilt), math.cos(tilt)))
        middle = np.array((sx * (length - block) / 2.0, sy * (width - block) / 2.0, -depth / 2.0))
        legs.append((_leg(product, params, middle, axis, leg), middle, axis, sx * sy))
        if leg["pin"]:
            dip = math.radians(params["dip"])
            side = np.array((sx * math.cos(dip), 0.0, -math.sin(dip)))
            origin = middle + side * (block / 2.0 / math.cos(dip))
            hole = clearance(PIN, params["fit"])
            length_in = block / 2.0 / math.cos(dip) + 0.25 * w
            kit.peg(
                product, [frame, legs[-1][0]], PIN, length_in, origin.tolist(), side.tolist(), clearance=hole, reach=9.0
            )
    _ties(product, params, legs)
    _top(product, params)
    if params["drawer"]:
        _drawer(product, params)
    return product


def _leg(
    product: Product, params: Mapping[str, Any], middle: np.ndarray, axis: np.ndarray, leg: Mapping[str, Any]
) -> str:
    """Add one leg in its socket, square to a seat below; a shoulder keeps it from leaving upwards."""
    w, gap, depth = params["leg"] / 2.0, clearance(params["leg"], params["fit"]) / 2.0, params["depth"]
    low = -(depth / 2.0 + params["height"]) / axis[2]
    bar, room = (kit.place(_square(w + e, low, 100.0), middle.tolist(), axis.tolist()) for e in (0.0, gap))
    product.cut(["frame"], room)
    seat = (2.0 - depth / 2.0) / axis[2] + (w + 5.0) * math.hypot(axis[0], axis[1]) / axis[2]
    product.cut(["frame"], kit.place(_square(w + 5.0, -100.0, seat), middle.tolist(), axis.tolist()))
    solid = bar.trim_by_plane((0.0, 0.0, -1.0), 0.0)
    if leg["shoulder"]:
        solid += kit.place(_square(w + 5.0 - gap, seat - 16.0, seat), middle.tolist(), axis.tolist())
    return product.add("leg", solid)


def _square(half: float, z0: float, z1: float) -> kit.Manifold:
    return kit.box((-half, -half, z0), (half, half, z1))


def _ties(product: Product, params: Mapping[str, Any], legs: list[tuple[str, np.ndarray, np.ndarray, int]]) -> None:
    """Add stretchers along x: through one leg, blind in the other, perhaps pinned."""
    w, d = params["leg"], 0.5 * params["leg"]
    for tie, pair in zip(params["ties"], ((0, 1), (3, 2)), strict=False):
        near, far = pair[::-1] if tie["flip"] else pair
        z = -params["depth"] - 0.6 * params["height"]
        start, end = (legs[k][1] + legs[k][2] * (z - legs[k][1][2]) / legs[k][2][2] for k in (near, far))
        side = math.copysign(1.0, start[0])
        origin = (start[0] + side * (w / 2.0 + 5.0), start[1], z)
        reach = abs(origin[0] - end[0]) + 0.25 * w
        gap, names = clearance(d, params["fit"]), [legs[near][0], legs[far][0]]
        bar = kit.peg(product, names, d, reach, origin, (side, 0, 0), clearance=gap, reach=5.0, part="stretcher")
        if tie["pin"]:
            y = math.copysign(1.0, start[1])
            lean = legs[near][2][2]
            outside = (start[0], start[1] + y * (w / 2.0 + 1.0) / lean, z)
            hole = clearance(5.0, params["fit"])
            kit.peg(product, [names[0], bar], 5.0, w / 2.0 / lean + 4.0, outside, (0, y, 0), clearance=hole, reach=9.0)


def _top(product: Product, params: Mapping[str, Any]) -> None:
    """Add the top; its lugs go down inside the frame, where oblique pins hold them."""
    length, width, skew = params["length"], params["width"], math.radians(params["skew"])
    top = kit.plate(length + 16.0, width + 16.0, 0.0, params["top"], radius=params["radius"])
    places = ((1, 0), (-1, 0), (0, 1))[: params["lugs"]]
    for sx, sy in places:
        x, y = sx * (length / 2.0 - RAIL - 10.0), sy * (width / 2.0 - RAIL - 10.0)
        half = (9.8, 11.0) if sx else (11.0, 9.8)
        top += kit.box((x - half[0], y - half[1], 4.0 - params["depth"]), (x + half[0], y + half[1], 1.0))
    name = product.add("top", top)
    for sx, sy in places[: params["lug_pins"]]:
        out = np.array((sx * math.cos(skew) - sy * math.sin(skew), sy * math.cos(skew) + sx * math.sin(skew), 0.0))
        inside = np.array((sx * (length / 2.0 - RAIL - 12.0), sy * (width / 2.0 - RAIL - 12.0), -0.5 * params["depth"]))
        reach, hole = (RAIL + 12.0) / math.cos(skew), clearance(PIN, params["fit"])
        origin = (inside + out * reach).tolist()
        kit.peg(product, [name, "frame"], PIN, reach, origin, out.tolist(), clearance=hole, reach=9.0)


def _drawer(product: Product, params: Mapping[str, Any]) -> None:
    """Add a drawer through the frame's front, perhaps stopped by a pin up through the front rail."""
    front, depth = -params["width"] / 2.0, params["depth"]
    half, end = 0.5 * params["length"] - params["leg"] - 2.0 * RAIL - 6.0, params["width"] / 2.0 - RAIL - 20.0
    low, high = 8.0 - depth, -5.0
    product.cut(["frame"], kit.box((-half, front - 1.0, low), (half, front + RAIL + 1.0, high)))
    body = kit.box((0.2 - half, front - 1.0, low), (half - 0.2, end, high - 0.2))
    body -= kit.box((6.0 - half, front + RAIL + 2.0, low + 5.0), (half - 6.0, end - 6.0, 1.0))
    body += kit.box((-half - 5.0, front - 6.0, low - 4.0), (half + 5.0, front, high + 3.0))
    body += kit.place(kit.cylinder(10.0, 5.0, 16.0, top=14.0), (0.0, front, (low + high) / 2.0), (0.0, -1.0, 0.0))
    drawer = product.add("drawer", body)
    if params["stop"]:
        lean, tight = math.radians(params["skew"]), clearance(6.0, params["fit"])
        axis = (math.sin(lean), 0.0, -math.cos(lean))
        origin = (0.0, front + RAIL / 2.0, -depth)
        kit.peg(product, ["frame", drawer], 6.0, 16.0, origin, axis, clearance=tight, reach=9.0, part="stop")
    if params["divider"]:
        y = (front + RAIL + end) / 2.0
        slot = kit.box((3.0 - half, y - 3.0, low + 3.0), (half - 3.0, y + 3.0, high - 0.2))
        product.cut([drawer], slot)
        product.add("divider", slot)


FAMILY = Family(
    name="table",
    version=1,
    summary="legs in oblique sockets, free upwards once the top is off; pins, stretchers and a stopped drawer",
    draw=draw,
    build=build,
)
