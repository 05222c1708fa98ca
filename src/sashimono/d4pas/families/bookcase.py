"""Bookcases: shelves in level or sloping dados, on pegs or on pocket screws, with back, top and drawer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

GROOVE = 5.0
"""Depth of dados and grooves in the sides [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one bookcase."""
    pick = kit.Draw(rng)
    kinds = ("dado", "sloped", "loose", "pocket")
    return {
        "width": pick.length(140.0, 240.0),
        "depth": pick.length(70.0, 110.0),
        "board": pick.length(12.0, 16.0),
        "bay": pick.length(62.0, 85.0),
        "shelves": [
            {
                "kind": pick.choice(kinds, (2, 4, 2, 3)),
                "slope": pick.choice((12.0, 17.0, 24.0)),
                "up": pick.chance(0.5),
                "lock": pick.choice(("none", "screw", "dowel"), (1, 2, 2)),
                "sides": pick.choice(([1], [-1], [1, -1])),
                "skew": pick.choice((0.0, 15.0, 25.0)),
            }
            for _ in range(pick.count(1, 3))
        ],
        "back": pick.choice(("groove", "screwed", "none"), (3, 2, 1)),
        "top_screws": pick.count(1, 2),
        "top_tilt": pick.choice((0.0, 15.0, 30.0)),
        "top_dowel": pick.chance(0.4),
        "plinth": pick.chance(0.5),
        "drawer": pick.choice(("none", "free", "latched")),
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the bookcase: its back at y = 0, its front towards -y, standing on z = 0."""
    product, t, deep = Product(), params["board"], params["depth"]
    inner = params["width"] / 2.0 - t
    floor = 14.0
    height = floor + t + (len(params["shelves"]) + 1) * params["bay"]
    for sign in (1, -1):
        low, high = sorted((sign * inner, sign * (inner + t)))
        product.add("side", kit.box((low, -deep, 0.0), (high, 0.0, height)))
    _shelf(product, params, {"kind": "dado", "lock": "screw", "sides": [1, -1], "skew": 0.0}, floor, "bottom")
    product.add(
        "top", kit.plate(params["width"] + 10.0, deep + 8.0, height, height + t).translate((0.0, -deep / 2.0, 0.0))
    )
    tight = clearance(4.0, params["fit"])
    tilt = math.radians(params["top_tilt"])
    for name, sign in (("side", 1), ("side_2", -1)):
        for k in range(params["top_screws"]):
            origin = (sign * (inner + 0.5 * t), -deep * (0.75 - 0.5 * k), height + t - 4.0)
            axis = (0.0, (-1) ** k * math.sin(tilt), math.cos(tilt))
            kit.fasten(product, ["top", name], 3.0, t + 12.0, origin, axis, clearance=tight)
        if params["top_dowel"]:
            origin = (sign * (inner + 0.5 * t), -0.5 * deep, height + 0.6 * t)
            kit.peg(product, ["top", name], 5.0, 0.6 * t + 9.0, origin, (0, 0, 1), clearance=tight, part="dowel")
    if params["plinth"]:
        board = kit.box((-inner, -deep, 0.0), (inner, 8.0 - deep, floor))
        plinth = product.add("plinth", board)
        for name, sign in (("side", 1), ("side_2", -1)):
            axis, origin = (sign, 0, 0), (sign * (inner + t), 4.0 - deep, 7.0)
            kit.peg(product, [name, plinth], 4.0, t + 9.0, origin, axis, clearance=tight, reach=5.0, part="dowel")
    for k, shelf in enumerate(params["shelves"]):
        _shelf(product, params, shelf, floor + (k + 1) * params["bay"], "shelf")
    _back(product, params, inner, (floor, height))
    if params["drawer"] != "none":
        _drawer(product, params, inner, floor + t)
    return kit.tidy(product)


def _shelf(product: Product, params: Mapping[str, Any], shelf: Mapping[str, Any], z: float, noun: str) -> None:
    """Add one shelf with its underside at z (a sloping one: about its middle) and what holds it."""
    t, deep, fit = params["board"], params["depth"], params["fit"]
    inner, gap = params["width"] / 2.0 - t, clearance(t, params["fit"])
    end = -11.0
    kind, middle = shelf["kind"], (end - deep) / 2.0
    if kind == "loose":
        _loose(product, params, z, (inner, end))
        return
    half = inner if kind == "pocket" else inner + GROOVE
    if kind == "sloped":
        slope = (1 if shelf["up"] else -1) * shelf["slope"]
        run = (deep + end) / 2.0 * math.cos(math.radians(slope)) - 6.0
        solid, room = (
            kit.box((-half, -r, -t / 2.0 - e), (half, run, t / 2.0 + e))
            .rotate((slope, 0, 0))
            .translate((0, middle, z + t / 2))
            for r, e in ((run, 0.0), (run + 60.0, gap / 2.0))
        )
    else:
        solid = kit.box((-half, -deep, z), (half, end, z + t))
        room = kit.box((-half, -deep - 5.0, z - gap / 2.0), (half, end, z + t + gap / 2.0))
    if kind != "pocket":
        product.cut(["side", "side_2"], room)
    name = product.add(noun, solid)
    for sign in shelf["sides"]:
        side, tight = "side" if sign > 0 else "side_2", clearance(3.5, fit)
        if kind == "pocket":
            for y in (0.7 * middle, 1.3 * middle):
                a = math.radians(20.0)
                origin, axis = (sign * (inner - 13.0), y, z + 2.8), (-sign * math.cos(a), 0.0, -math.sin(a))
                kit.fasten(product, [name, side], 3.0, 23.0, origin, axis, clearance=tight)
            continue
        skew = math.radians(shelf["skew"])
        axis = (
            sign * math.cos(skew),
            0.0 if kind == "sloped" else -math.sin(skew),
            math.sin(skew) * (kind == "sloped"),
        )
        origin = (sign * (inner + t - 3.5), middle, z + t / 2.0)
        if kind == "sloped":
            origin = (origin[0], middle, z + t / 2.0 + (t - 3.5) * math.tan(skew))
        if shelf["lock"] == "screw":
            kit.fasten(product, [name, side], 3.0, t + 9.0, origin, axis, clearance=tight)
        elif shelf["lock"] == "dowel":
            kit.peg(product, [name, side], 4.0, t + 8.0, origin, axis, clearance=tight, reach=20.0, part="dowel")


def _loose(product: Product, params: Mapping[str, Any], z: float, room: tuple[float, float]) -> None:
    """Add a loose shelf whose notches sit on four pegs: it lifts before it slides."""
    (inner, end), t, deep = room, params["board"], params["depth"]
    tight = clearance(6.0, params["fit"])
    shelf = kit.box((0.2 - inner, -deep, z), (inner - 0.2, end, z + t))
    for sign, name in ((1, "side"), (-1, "side_2")):
        for y in (-deep + 14.0, end - 12.0):
            origin = (sign * (inner - 8.0), y, z)
            kit.peg(product, [name], 6.0, 15.0, origin, (-sign, 0, 0), clearance=tight, part="peg")
            notch = kit.cylinder(6.0 + tight, -15.0, 0.0, segments=12)
            shelf -= kit.place(notch, origin, (-sign, 0, 0))
    product.add("shelf", shelf)


def _back(product: Product, params: Mapping[str, Any], inner: float, levels: tuple[float, float]) -> None:
    """Add the back: in grooves, out upwards under the top; or on the edges, screwed."""
    (floor, height), t = levels, params["board"]
    if params["back"] == "groove":
        gap = clearance(4.0, params["fit"])
        low, half = floor + t, inner + GROOVE
        product.cut(["side", "side_2"], kit.box((-half, -9.0 - gap / 2, low), (half, -5.0 + gap / 2, height + 5.0)))
        product.add("back", kit.box((-half, -9.0, low), (half, -5.0, height)))
        product.join("bottom", kit.box((-inner, -12.0, floor), (inner, -3.0, low)))
    elif params["back"] == "screwed":
        half = inner + t - 2.0
        back = product.add("back", kit.box((-half, 0.0, floor), (half, 4.0, height)))
        for name, sign in (("side", 1), ("side_2", -1)):
            for share in (0.15, 0.85):
                origin = (sign * (inner + 0.5 * t), 4.0, floor + share * (height - floor))
                tight, axis = clearance(2.5, params["fit"]), (0.0, 1.0, 0.0)
                kit.fasten(product, [back, name], 2.5, 11.0, origin, axis, clearance=tight, head="countersunk")


def _drawer(product: Product, params: Mapping[str, Any], inner: float, floor: float) -> None:
    """Add a drawer on the bottom, perhaps latched: an oblique pin goes down through its front."""
    deep, tall = params["depth"], 24.0
    half = inner - 0.25
    body = kit.box((-half, -deep, floor), (half, -16.0, floor + tall))
    body -= kit.box((8.0 - half, 12.0 - deep, floor + 4.0), (half - 8.0, -24.0, floor + tall + 5.0))
    drawer = product.add("drawer", body)
    tight = clearance(5.0, params["fit"])
    if params["drawer"] == "latched":
        a = math.radians(17.0)
        axis, origin = (0.0, -math.sin(a), math.cos(a)), (0.0, 6.0 - deep, floor + tall + 3.0)
        low = kit.cylinder(5.0, -tall - 3.0 - 6.0, 0.0, segments=12)
        product.cut(
            [drawer, "bottom"], kit.place(kit.cylinder(5.0 + tight, -tall - 9.0, 5.0, segments=12), origin, axis)
        )
        product.add("latch", kit.place(low, origin, axis))
    knob = kit.place(kit.cylinder(10.0, 0.0, 9.0, top=14.0), (half / 2.0, -deep, floor + tall / 2.0), (0.0, -1.0, 0.0))
    knob = product.add("knob", knob)
    origin = (half / 2.0, 12.0 - deep, floor + tall / 2.0)
    kit.fasten(product, [knob, drawer], 3.0, 18.0, origin, (0, 1, 0), clearance=tight, reach=4.0)


FAMILY = Family(
    name="bookcase",
    version=1,
    summary="shelves that slide out level or on a slope, lift off pegs or hang on screws; the top holds the back",
    draw=draw,
    build=build,
)
