"""Toy trains: wheels pinned on axles, a boiler keyed by its chimney, a cab on oblique pegs, logs behind a gate."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

DECK, AXLE, PEG, BOILER = 24.0, 8.0, 8.0, 22.0
"""Thickness of a chassis, diameters of axles, pegs and boiler [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one train."""
    pick = kit.Draw(rng)

    def axles(count: int) -> list[dict[str, Any]]:
        return [
            {"side": pick.choice((1, -1)), "turn": pick.length(0.0, 345.0, 15.0), "pin": pick.chance(0.8)}
            for _ in range(count)
        ]

    return {
        "width": pick.length(34.0, 42.0),
        "length": pick.length(96.0, 116.0),
        "wheel": pick.length(26.0, 30.0),
        "axles": axles(pick.count(1, 2)),
        "pegs": pick.count(1, 2),
        "lean": pick.choice((24.0, 27.0, 30.0)),
        "rake": pick.choice((0.0, 12.0, -15.0, 20.0)),
        "dome": pick.choice((None, 0.0, 22.5, -37.5)),
        "roof": pick.choice((-8.0, 0.0, None)),
        "wagon": pick.chance(0.4),
        "wagon_axles": axles(pick.count(1, 2)),
        "logs": pick.count(1, 3),
        "gate": pick.choice((0.0, 20.0, -30.0)),
        "link": pick.choice((0.0, 8.0)),
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the train: the engine from x = 0 forwards, its deck's top at z = 0, the wagon behind it."""
    product, half, length = Product(), params["width"] / 2.0, params["length"]
    engine = product.add("chassis", kit.box((0.0, -half, -DECK), (length, half, 0.0)))
    places = [0.4 * length, 0.8 * length][: len(params["axles"])]
    _axles(product, params, engine, params["axles"], places)
    _engine(product, params, engine)
    if params["wagon"]:
        _wagon(product, params, engine)
    return product


def _axles(
    product: Product, params: Mapping[str, Any], chassis: str, axles: list[dict[str, Any]], places: list[float]
) -> None:
    """Add axles through a chassis: one wheel is part of the axle, the other is pinned on it."""
    half, wheel, gap = params["width"] / 2.0, params["wheel"], clearance(AXLE, params["fit"])
    for axle, x in zip(axles, places, strict=True):
        origin, axis, far = (x, 0.0, 8.0 - DECK), (0.0, axle["side"], 0.0), half + 21.0
        bore = kit.place(kit.cylinder(AXLE + gap, -far - 1.0, far), origin, axis)
        product.cut([chassis], bore)
        rod = kit.cylinder(AXLE, -far, half + 2.0) + kit.cylinder(wheel, half, half + 8.0)
        rod = product.add("axle", kit.place(rod, origin, axis))
        disc = kit.cylinder(wheel, -half - 8.0, -half) + kit.cylinder(AXLE + 10.0, -far, -half - 7.0)
        name = product.add("wheel", kit.place(disc, origin, axis) - bore)
        if axle["pin"]:
            turn = math.radians(axle["turn"])
            side = (math.cos(turn), 0.0, math.sin(turn))
            head = 0.5 * AXLE + 6.0
            top = (x + head * side[0], -axle["side"] * (half + 14.5), origin[2] + head * side[2])
            hole = clearance(4.0, params["fit"])
            kit.peg(product, [name, rod], 4.0, head + 2.0, top, side, clearance=hole, reach=5.0)


def _engine(product: Product, params: Mapping[str, Any], chassis: str) -> None:
    """Add the cab on oblique pegs, the boiler through a saddle into it, chimney, dome and roof."""
    half, length, fit = params["width"] / 2.0, params["length"], params["fit"]
    level, gap = BOILER / 2.0 + 5.0, clearance(BOILER, fit)
    cab = product.add("cab", kit.box((2.0, -half, 0.0), (42.0, half, 46.0)))
    product.join(chassis, kit.box((-5.0, -half, -8.0), (2.0, half, 26.0)))
    key = kit.box((1.0, -8.0, -1.0), (8.5, 8.0, 26.0))
    product.cut([cab], key)
    product.join(chassis, key)
    product.join(chassis, kit.box((length - 24.0, -half, -1.0), (length - 4.0, half, level + BOILER / 2.0 + 6.0)))
    origin, axis, reach = (length + 4.0, 0.0, level), (1, 0, 0), length + 4.0 - 28.0
    boiler = kit.peg(
        product, [cab, chassis], BOILER, reach, origin, axis, clearance=gap, reach=5.0, part="boiler", segments=24
    )
    lean, tight = math.radians(params["lean"]), clearance(PEG, fit)
    for k in range(params["pegs"]):
        side = (1 - 2 * k) * math.sin(lean)
        start = (13.5 + 9.0 * k, 11.0 - 22.0 * k, -DECK)
        tall = (DECK + 13.0) / math.cos(lean)
        kit.peg(
            product,
            [chassis, cab],
            PEG,
            tall,
            start,
            (0.0, side, -math.cos(lean)),
            clearance=tight,
            reach=9.0,
            part="peg",
        )
    rake, top = math.radians(params["rake"]), level + BOILER / 2.0 + 6.0
    axis, hole = (math.sin(rake), 0.0, math.cos(rake)), clearance(9.0, fit)
    start = (length - 14.0, 0.0, top)
    stack = kit.peg(product, [chassis, boiler], 9.0, 16.0, start, axis, clearance=hole, reach=0.0, part="chimney")
    rim = kit.place(kit.cylinder(15.0, 2.6, 16.0, top=18.0) + kit.cylinder(9.0, -1.0, 4.0, segments=12), start, axis)
    product.cut([chassis], kit.place(kit.cylinder(9.0 + hole, -1.0, 9.0, segments=12), start, axis))
    product.join(stack, rim)
    if params["dome"] is not None:
        roll = math.radians(params["dome"])
        axis = (0.0, math.sin(roll), math.cos(roll))
        start = (0.5 * (42.0 + length - 24.0), axis[1] * (BOILER / 2.0 - 0.2), level + axis[2] * (BOILER / 2.0 - 0.2))
        dome = kit.peg(product, [boiler], 8.0, 9.0, start, axis, clearance=clearance(8.0, fit), reach=5.0, part="dome")
        cone = kit.cylinder(13.0, 0.3, 9.0, top=9.0) + kit.cylinder(8.0, -1.0, 1.0, segments=12)
        product.join(dome, kit.place(cone, start, axis))
    if params["roof"] is not None:
        _roof(product, params, cab, half)


def _roof(product: Product, params: Mapping[str, Any], cab: str, half: float) -> None:
    """Add the roof, which slides sideways on a dovetail until a peg keys it."""
    gap, fit = clearance(20.0, params["fit"]) / 2.0, params["fit"]
    tail, room = (
        kit.prism([(-8 - e, 37.0 - e), (8 + e, 37.0 - e), (4 + e, 46.5), (-4 - e, 46.5)], -u, u)
        .rotate((90.0, 0.0, 0.0))
        .translate((13.5, 0.0, 0.0))
        for e, u in ((0.0, half), (gap, half + 5.0))
    )
    product.cut([cab], room)
    roof = product.add("roof", kit.box((-2.0, -half - 4.0, 46.0), (46.0, half + 4.0, 53.0)) + tail)
    lean = math.radians(params["roof"])
    axis, start = (math.sin(lean), 0.0, math.cos(lean)), (28.5, 0.25 * half, 53.0)
    kit.peg(product, [roof, cab], 8.0, 19.0, start, axis, clearance=clearance(8.0, fit), reach=5.0, part="peg")


def _wagon(product: Product, params: Mapping[str, Any], engine: str) -> None:
    """Add a wagon behind the engine: logs in bores that a pinned gate shuts, and the link between the two."""
    half, fit = params["width"] / 2.0, params["fit"]
    front, back = -37.0, -113.0
    body = kit.box((back, -half, -DECK), (front, half, 4.0))
    wagon = product.add("wagon", body)
    places = [back + 20.0, front - 20.0][: len(params["wagon_axles"])]
    _axles(product, params, wagon, params["wagon_axles"], places)
    d, hole = 11.0, clearance(11.0, fit)
    product.join(wagon, kit.box((back, -half, 3.0), (front, half, 16.0)))
    product.join(wagon, kit.box((back, -half, 15.0), (front, 6.0 - half, 28.0)))
    low, high = (back + 6.0, 6.0 - half, 2.0), (front - 6.0, 12.0 - half, 31.0)
    product.cut([wagon], kit.box((low[0] - hole, low[1], low[2]), (high[0] + hole, high[1] + hole, 40.0)))
    gate = product.add("gate", kit.box(low, high))
    for k in range(params["logs"]):
        start = (0.5 * (front + back) + (k - 0.5 * (params["logs"] - 1)) * 18.0, high[1], 9.0)
        length = 2.0 * half - 18.0
        kit.peg(product, [wagon], d, length, start, (0, -1, 0), clearance=hole, reach=30.0, part="log", segments=16)
    lean, tight = math.radians(params["gate"]), clearance(6.0, fit)
    axis, start = (math.sin(lean), -math.cos(lean), 0.0), (0.5 * (front + back), -half, 21.0)
    kit.peg(product, [wagon, gate], 6.0, 11.0 / math.cos(lean), start, axis, clearance=tight, reach=5.0)
    low = 14.0 - DECK
    product.join(engine, kit.box((-19.0, -13.0, -DECK), (1.0, 13.0, low)))
    product.join(wagon, kit.box((front - 1.0, -13.0, -DECK), (-20.0, 13.0, low)))
    link = product.add("link", kit.box((-34.0, -8.0, low), (-5.5, 8.0, low + 6.0)))
    lean = math.radians(params["link"])
    for name, x in ((engine, -11.5), (wagon, -28.0)):
        axis, hole = (0.0, math.sin(lean), math.cos(lean)), clearance(7.0, fit)
        start = (x, 0.0, low + 6.0)
        pin = kit.peg(product, [link, name], 7.0, 18.0, start, axis, clearance=hole, reach=5.0)
        head = kit.cylinder(11.0, 1.5, 4.0, segments=12) + kit.cylinder(7.0, -1.0, 2.0, segments=12)
        product.join(pin, kit.place(head, start, axis))


FAMILY = Family(
    name="toy_train",
    version=2,
    summary="wheels pinned on axles, a boiler keyed by its chimney, a cab on oblique pegs, logs behind a gate",
    draw=draw,
    build=build,
)
