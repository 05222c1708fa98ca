"""A pot under a bayonet cap that must turn, with parts below it; or panels hung on studs by keyholes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

FACETS = 20
"""Facets of the pot and of the cap."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one pot or one set of panels."""
    pick = kit.Draw(rng)
    if pick.chance(0.6):
        return {
            "kind": "cap",
            "bore": pick.length(26.0, 40.0),
            "depth": pick.length(20.0, 40.0),
            "lugs": pick.choice((2, 3), (3, 1)),
            "turn": pick.choice((25.0, 35.0)),
            "hand": pick.choice((1, -1)),
            "lock": pick.choice((0.0, 25.0, 40.0, None)),
            "inner": [pick.choice(("ring", "disc", "sleeve")) for _ in range(pick.count(1, 4))],
            "fit": pick.choice(("H9/d9", "H8/f7")),
            "knob": pick.chance(0.5),
        }
    return {
        "kind": "panels",
        "panels": [
            {
                "height": pick.length(32.0, 45.0),
                "lock": pick.choice(("none", "screw", "pin"), (2, 1, 1)),
                "tilt": pick.choice((0.0, 20.0, 35.0)),
            }
            for _ in range(pick.count(2, 3))
        ],
        "width": pick.length(50.0, 80.0),
        "slope": 0.0,
        "stud": pick.length(6.0, 8.0, 0.5),
        "fit": pick.choice(("H9/d9", "H7/g6", "exact")),
        "thick": pick.length(6.0, 9.0),
        "wedge": pick.choice(("none", "bar"), (1, 2)),
        "single": pick.chance(0.5),
        "studs": pick.choice(("part", "board"), (1, 6)),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the pot with its cap, or the board with its panels."""
    return _pot(params) if params["kind"] == "cap" else _board(params)


def _pot(params: Mapping[str, Any]) -> Product:
    """Return the pot, what stands in it, and the cap whose lugs lie in L-shaped slots of the rim."""
    product, bore, depth = Product(), params["bore"], params["depth"]
    outer = bore + 12.0
    pot = kit.cylinder(outer + 6.0, 0.0, 6.0, segments=FACETS) + kit.cylinder(outer, 5.0, 6.0 + depth, segments=FACETS)
    pot -= kit.cylinder(bore, 6.0, 7.0 + depth, segments=FACETS)
    gap = clearance(bore, params["fit"])
    rim, count = 6.0 + depth, params["lugs"]
    slot = Manifold()
    width = 34.0  # of a lug, in degrees
    for k in range(count):
        at = 360.0 * k / count
        entry = _sector(outer + 2.0, bore - 2.0, at - 1.0, at + width + 1.0, rim - 12.0, rim + 1.0)
        low, high = sorted((at + params["hand"] * params["turn"], at))
        slot += entry + _sector(outer + 2.0, bore - 2.0, low - 1.0, high + width + 1.0, rim - 12.0, rim - 6.0)
    product.add("pot", pot - slot)
    cap = kit.cylinder(outer + 4.0, rim, rim + 6.0, segments=FACETS)
    cap += kit.cylinder(bore - gap - 0.6, rim - 14.0, rim + 1.0, segments=FACETS)
    cap -= kit.cylinder(bore - 10.0, rim - 15.0, rim - 2.0, segments=FACETS)
    for k in range(count):
        at = 360.0 * k / count + params["hand"] * params["turn"]
        cap += _sector(outer - 4.0, bore - 6.0, at, at + width, rim - 12.0, rim - 6.0)
    name = product.add("cap", cap)
    if params["knob"]:
        product.cut([name], kit.cylinder(8.0, rim + 2.0, rim + 20.0, segments=12))
        knob = kit.cylinder(8.0, rim + 2.0, rim + 8.0, segments=12) + kit.cylinder(16.0, rim + 6.0, rim + 16.0)
        product.add("knob", knob)
    if params["lock"] is not None:
        tilt = math.radians(params["lock"])
        axis = (
            math.cos(math.radians(200.0)) * math.sin(tilt),
            math.sin(math.radians(200.0)) * math.sin(tilt),
            math.cos(tilt),
        )
        place = np.array([math.cos(math.radians(200.0)), math.sin(math.radians(200.0))]) * (bore + outer) / 4.0
        origin = (place[0] + 8.0 * axis[0], place[1] + 8.0 * axis[1], rim + 8.0 * axis[2])
        kit.peg(product, [name, "pot"], 3.0, 12.0, origin, axis, reach=6.0)
    _inner(product, params, rim - 14.0)
    return product


def _sector(outer: float, inner: float, start: float, end: float, low: float, high: float) -> Manifold:
    """Return a piece of a tube between two angles [degrees], its ends straight."""
    angles = np.radians(np.linspace(start, end, 4))
    outline = [(outer / 2.0 * math.cos(a), outer / 2.0 * math.sin(a)) for a in angles]
    outline += [(inner / 2.0 * math.cos(a), inner / 2.0 * math.sin(a)) for a in angles[::-1]]
    return kit.prism(outline, low, high)


def _inner(product: Product, params: Mapping[str, Any], top: float) -> None:
    """Stack rings, discs and a sleeve in the pot, up to the cap."""
    count, bore = len(params["inner"]), params["bore"]
    height = (top - 6.0) / count
    gap = clearance(bore, params["fit"])
    for k, kind in enumerate(params["inner"]):
        low, high = 6.0 + k * height, 6.0 + (k + 1) * height
        solid = kit.cylinder(bore - gap, low, high, segments=FACETS)
        if kind != "disc":
            solid -= kit.cylinder(0.5 * bore if kind == "ring" else bore - 5.0, low - 1.0, high + 1.0)
        product.add(kind, solid)


def _board(params: Mapping[str, Any]) -> Product:
    """Return the board in the plane x, y, its studs, the panels one above another, and what bars their way up."""
    product, width, stud, thick = Product(), params["width"], params["stud"], params["thick"]
    panels, slope, rise = params["panels"], params["slope"], 2.2 * params["stud"]
    height = sum(p["height"] for p in panels)
    board = product.add("board", kit.box((-0.5 * width - 6.0, -6.0, -12.0), (0.5 * width + 6.0, height + 18.0, 0.0)))
    gap, y = clearance(stud, params["fit"]), 0.0
    for panel in panels:
        tall = panel["height"]
        name = product.add("panel", kit.box((-width / 2.0, y, 0.0), (width / 2.0, y + tall, thick)))
        for x in (0.0,) if params["single"] else (-0.3 * width, 0.3 * width):
            centre = (x, y + 0.65 * tall)
            below = (x, y + 0.65 * tall - rise)
            slot = _bar(below, below, 2.0 * stud + 0.4, -1.0, thick + 1.0)
            slot += _bar(below, centre, stud + gap, -1.0, thick + 1.0)
            slot += _bar(below, centre, 2.0 * stud + 0.4, thick - 2.5, thick + 1.0)
            product.cut([name], slot)
            solid = _bar(centre, centre, stud, -8.0, thick - 2.4)
            solid += _bar(centre, centre, 2.0 * stud, thick - 2.5, thick + 2.0)
            if params["studs"] == "part":
                product.cut([board], _bar(centre, centre, stud, -8.0, 1.0))
                product.add("stud", solid)
            else:
                product.join(board, solid)
        if panel["lock"] != "none":
            tilt, foot = math.radians(panel["tilt"]), (0.15 * width, y + 0.25 * tall)
            axis = (math.sin(tilt), 0.0, math.cos(tilt))
            origin = (foot[0] + 2.0 * math.tan(tilt), foot[1], thick + 2.0)
            if panel["lock"] == "pin":
                kit.peg(product, [name, board], 6.0, thick + 10.0, origin, axis, reach=8.0)
            else:
                kit.fasten(product, [name, board], 5.0, thick + 6.0, origin, axis, reach=30.0, head="hex")
        y += tall
    if params["wedge"] == "bar":
        # the bar leaves sideways or off the board, once its pins are out
        low, high = (-width / 2.0, height, 0.0), (width / 2.0, height + 12.0, thick + 2.0)
        bar = product.add("bar", kit.box(low, high))
        for x, tilt in ((-0.25, 20.0), (0.25, -20.0)):
            axis = (math.sin(math.radians(tilt)), 0.0, math.cos(math.radians(tilt)))
            kit.peg(product, [bar, board], 6.0, thick + 12.0, (x * width, height + 6.0, thick + 4.0), axis, reach=8.0)
    if slope:
        turned = {name: solid.rotate((0.0, 0.0, -slope)) for name, solid in product.solids.items()}
        product.solids = turned
    return product


def _bar(start: tuple[float, float], end: tuple[float, float], width: float, low: float, high: float) -> Manifold:
    """Return a square bar, or the slot that it leaves on its way from one point to another along y."""
    (x, y), (_, top) = start, end
    return kit.box((x - width / 2.0, y - width / 2.0, low), (x + width / 2.0, top + width / 2.0, high))


FAMILY = Family(
    name="bayonet_cap",
    version=2,
    summary="a cap that turns out of L slots above a stack; panels that slide out of keyholes only when none is above",
    draw=draw,
    build=build,
)
