"""A hinge: leaves with interlaced knuckles on one pin, washers between them, caps on its ends, blocks behind."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

FACETS = 20
"""Facets of knuckles, pin and washers."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one hinge."""
    pick = kit.Draw(rng)
    blocks = [pick.choice(("outer", "inner", "none"), (4, 1, 2)) for _ in range(2)]
    return {
        "knuckles": pick.choice((2, 3, 5), (1, 3, 2)),
        "knuckle": pick.length(12.0, 20.0),
        "pin": pick.length(7.0, 11.0, 0.5),
        "leaf": pick.length(30.0, 45.0),
        "thick": pick.length(4.0, 6.0),
        "opening": pick.choice((137.0, 165.0) if blocks == ["inner", "inner"] else (103.0, 120.0, 137.0, 165.0)),
        "fit": pick.choice(("H9/d9", "H7/g6", "exact")),
        "washers": pick.choice((0.0, 2.5), (4, 1)),
        "ends": [pick.choice(("head", "cap", "clip", "plain"), (2, 3, 3, 1)) for _ in range(2)],
        "cross": pick.choice((0.0, 25.0, 72.0, 110.0)),
        "blocks": blocks,
        "covers": [pick.chance(0.5) for _ in range(2)],
        "screws": pick.choice((1, 2), (1, 2)),
        "lean": pick.choice((0.0, 0.0, 0.0, 15.0)),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the hinge: its pin along z from z = 0, one leaf along +x, the other turned by the opening."""
    product, pin = Product(), params["pin"]
    gap, outer = clearance(pin, params["fit"]), pin + 9.0
    count, pitch = params["knuckles"], params["knuckle"] + params["washers"]
    spans = [(k * pitch, k * pitch + params["knuckle"]) for k in range(count)]
    height = spans[-1][1]
    hole = kit.cylinder(pin + gap, -50.0, height + 50.0, segments=FACETS)
    leaves = []
    for side in range(2):
        thick = params["thick"]
        leaf = kit.box((0.0, -thick / 2.0, 0.0), (outer / 2.0 + params["leaf"], thick / 2.0, height))
        turn = (0.0, 0.0, side * params["opening"])
        # knuckles and gaps are cut after the turn: all keep their facets
        leaf = leaf.rotate(turn) - kit.cylinder(outer + 0.1, -1.0, height + 1.0, segments=FACETS)
        for low, high in spans[side::2]:
            leaf += kit.cylinder(outer, low, high, segments=FACETS)
            leaf += kit.box((0.0, -thick / 2.0, low), (outer, thick / 2.0, high)).rotate(turn)
        leaves.append(product.add("leaf", leaf - hole))
    for low, high in pairwise(spans):
        if params["washers"]:
            product.add("washer", kit.cylinder(outer, low[1], high[0], segments=FACETS) - hole)
    _pin(product, params, height)
    for side in range(2):
        _screws(product, params, leaves[side], side, height)
    return product


def _pin(product: Product, params: Mapping[str, Any], height: float) -> None:
    """Add the pin, with a head, a cross-pinned cap, a clip or nothing at either end."""
    pin, (lower, upper) = params["pin"], params["ends"]
    if lower == "plain" and upper in ("plain", "head"):
        lower = "cap"
    elif lower == upper == "head":
        lower = "clip"
    elif lower == "head" and upper == "plain":
        upper = "cap"
    length = 2.0 * pin
    solid = kit.cylinder(pin, 0.0, height, segments=FACETS)
    locks: list[tuple[str, float]] = []
    for kind, sign, end in ((lower, -1.0, 0.0), (upper, 1.0, height)):
        piece = kit.cylinder(pin, -1.0, 1.0 if kind == "plain" else length, segments=FACETS)
        if kind == "head":
            piece = kit.cylinder(pin + 7.0, 0.0, 4.0) + kit.cylinder(pin, -1.0, 2.0, segments=FACETS)
        elif kind == "clip":
            piece = kit.cylinder(pin, -1.0, 7.0, segments=FACETS) - kit.tube(2.0 * pin, 0.6 * pin, 0.0, 3.0)
        solid += piece.scale((1.0, 1.0, sign)).translate((0.0, 0.0, end))
        locks.append((kind, sign))
    name = product.add("pin", solid)
    gap = clearance(pin, params["fit"])
    for (kind, sign), end, turn in zip(locks, (0.0, height), (params["cross"], params["cross"] + 40.0), strict=True):
        if kind == "cap":
            cap = kit.cylinder(pin + 8.0, 0.0, length + 4.0, top=pin + 5.0)
            cap -= kit.cylinder(pin + gap, -1.0, length, segments=FACETS)
            cap_name = product.add("cap", cap.scale((1.0, 1.0, sign)).translate((0.0, 0.0, end)))
            axis = (math.cos(math.radians(turn)), math.sin(math.radians(turn)), 0.0)
            origin = (axis[0] * (pin / 2.0 + 5.0), axis[1] * (pin / 2.0 + 5.0), end + sign * pin)
            kit.peg(product, [cap_name, name], 0.4 * pin, pin + 10.0, origin, axis, reach=4.0, part="peg")
        elif kind == "clip":
            clip = _clip(pin).rotate((0.0, 0.0, turn))
            product.add("clip", clip.scale((1.0, 1.0, sign)).translate((0.0, 0.0, end)))


def _clip(pin: float) -> Manifold:
    """Return a clip on z from 0 upwards: a fork that sits in a groove and leaves along -x."""
    bore = 0.6 * pin + 0.1  # wider than the groove: its facets lie otherwise
    clip = kit.cylinder(2.0 * pin, 0.0, 3.0) - kit.cylinder(bore, -1.0, 4.0)
    return clip - kit.box((0.0, -bore / 2.0, -1.0), (2.0 * pin, bore / 2.0, 4.0))


def _screws(product: Product, params: Mapping[str, Any], leaf: str, side: int, height: float) -> None:
    """Add a block behind a leaf, or before it, and the screws through the leaf into it."""
    kind = params["blocks"][side]
    if kind == "none":
        return
    outer, thick = params["pin"] + 9.0, params["thick"]
    sign = (-1.0 if kind == "outer" else 1.0) * (1.0 if side == 0 else -1.0)
    start, end = outer / 2.0 + 3.0, outer / 2.0 + params["leaf"]
    turn = (0.0, 0.0, side * params["opening"])
    low, high = sorted((sign * thick / 2.0, sign * (thick / 2.0 + 14.0)))
    block: Manifold = kit.box((start, low, 0.0), (end, high, height))
    name = product.add("block", block.rotate(turn))
    turned = math.radians(turn[2])
    covered = params["covers"][side]
    lean = 0.0 if covered else math.radians(params["lean"])
    spin = np.array([[math.cos(turned), -math.sin(turned)], [math.sin(turned), math.cos(turned)]])
    way = np.array([math.sin(lean), -sign * math.cos(lean)])
    axis = (*(spin @ way), 0.0)
    for k in range(params["screws"]):
        x, z = (start + end) / 2.0 + (4.0 if k % 2 else -4.0), (0.27 + 0.46 * k) * height
        origin = (*(spin @ (np.array([x, -sign * thick / 2.0]) + (1.5 * way if lean else 0.0))), z)
        head = "cap" if lean else "countersunk"
        kit.fasten(product, [leaf, name], 4.0, thick + 9.0, origin, axis, head=head, reach=30.0)
    if covered:
        low, high = sorted((-sign * thick / 2.0, -sign * (thick / 2.0 + 5.0)))
        cover = product.add("cover", kit.box((start + 2.0, low, 2.0), (end, high, height - 2.0)).rotate(turn))
        lean = math.radians(params["lean"])
        way = np.array([math.sin(lean), -sign * math.cos(lean)])
        origin = (*(spin @ (np.array([(start + end) / 2.0, -sign * thick / 2.0]) + 6.0 * way)), height / 2.0)
        parts = [cover, leaf, name]
        kit.fasten(product, parts, 5.0, thick + 12.0, origin, (*(spin @ way), 0.0), head="hex", reach=30.0)


FAMILY = Family(
    name="hinge",
    version=2,
    summary="interlaced knuckles on a pin behind cross-pinned caps or clips; covers over the leaves' screws",
    draw=draw,
    build=build,
)
