"""Boxes in boxes: each opens another way, under a plug, a sliding lid or a cap that cross pins hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

Pieces = list[tuple[str, Manifold]]
WALL, RIM = 10.0, 20.0
"""Walls, and how far they rise above the contents to hold the lid [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one nest of boxes."""
    pick = kit.Draw(rng)
    return {
        "root": _draw_box(pick, pick.choice((1, 2, 3), (1, 6, 1))),
        "fit": pick.choice(("H11/c11", "H9/d9", "H8/f7", "exact")),
    }


def _draw_box(pick: kit.Draw, depth: int) -> dict[str, Any]:
    cells = pick.count(1, 2) if depth < 3 else 1
    lid = pick.choice(("plug", "slide", "cap", "none"), (3, 3, 3, 0.3))
    return {
        "cells": [
            _draw_box(pick, depth - 1) if depth > 1 and (k == 0 or pick.chance(0.5)) else _draw_item(pick)
            for k in range(cells)
        ],
        "tube": cells == 1 and lid != "none" and pick.chance(0.2),
        "round": pick.chance(0.3),
        "turn": pick.choice((0.0, 17.0, 30.0, 45.0), (2, 1, 1, 1)),
        "lid": lid,
        "pins": [
            {"side": side, "skew": pick.choice((-25.0, 0.0, 17.0, 25.0))}
            for side in pick.choice(((0,), (90,), (0, 180), (90, 270), (0, 180)), (3, 3, 2, 2, 2))
        ],
        "face": pick.count(0, 5),
    }


def _draw_item(pick: kit.Draw) -> dict[str, Any]:
    return {
        "item": pick.choice(("block", "rod")),
        "width": pick.length(14.0, 22.0),
        "depth": pick.length(14.0, 20.0),
        "height": pick.length(14.0, 24.0),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the nest, its outermost box about the origin."""
    product = Product()
    for name, solid in _box(params["root"], params["fit"])[0]:
        product.add(name, solid)
    return product


def _item(node: Mapping[str, Any]) -> tuple[Pieces, tuple[float, float, float]]:
    """Return a block or a rod, and its size; it stands on z = 0 about the z axis."""
    width, height = node["width"], node["height"]
    if node["item"] == "block":
        solid = kit.plate(width, node["depth"], 0.0, height, radius=3.0)
        return [("block", solid)], (width, node["depth"], height)
    return [("rod", kit.cylinder(width, 0.0, height))], (width, width, height)


def _turned(pieces: Pieces, size: tuple[float, float, float], face: int) -> tuple[Pieces, tuple[float, float, float]]:
    """Return pieces in a box of this size with another of its faces up, again on z = 0, and the size then."""
    a, b, c = size
    angles = ((0, 0, 0), (180, 0, 0), (90, 0, 0), (-90, 0, 0), (0, 90, 0), (0, -90, 0))[face]
    sizes = ((a, b, c), (a, b, c), (a, c, b), (a, c, b), (c, b, a), (c, b, a))
    x, y, z = sizes[face]
    moved = [(n, s.translate((0, 0, -c / 2)).rotate(angles).translate((0, 0, z / 2))) for n, s in pieces]
    return moved, (x, y, z)


def _box(node: Mapping[str, Any], fit: str) -> tuple[Pieces, tuple[float, float, float]]:
    """Return a container with all in it, and its size; it opens upwards."""
    cells = []
    for cell in node["cells"]:
        pieces, size = _item(cell) if "item" in cell else _box(cell, fit)
        cells.append(_turned(pieces, size, cell["face"]) if "face" in cell else (pieces, size))
    a = sum(size[0] for _, size in cells) + WALL * (len(cells) - 1)
    b, c = max(size[1] for _, size in cells), max(size[2] for _, size in cells)
    turn = math.radians(node["turn"])
    across = math.hypot(a, b) + 2.0 * WALL + 2.0
    wide = abs(a * math.cos(turn)) + abs(b * math.sin(turn)) + 2.0 * WALL
    long = abs(a * math.sin(turn)) + abs(b * math.cos(turn)) + 2.0 * WALL
    size = (across, across) if node["round"] else (wide, long)
    lidded = node["lid"] != "none"
    high, low = c + (RIM if lidded else 0.0), -RIM if node["tube"] else -5.0
    gap = clearance(min(a, 120.0), fit)
    shape = (
        Manifold.cylinder(high - low, across / 2.0, across / 2.0, 32)
        if node["round"]
        else kit.plate(wide, long, 0, high - low)
    )
    shape = shape.translate((0.0, 0.0, low))
    body, inside, x = shape, [], -a / 2.0
    for pieces, (u, v, h) in cells:
        floor = c - h
        room = kit.box((-(u + gap) / 2, -(v + gap) / 2, floor), ((u + gap) / 2, (v + gap) / 2, c + 1.0))
        if pieces[0][0] == "rod":
            room = kit.cylinder(u + gap, floor, c + 1.0)
        place = (x + u / 2.0, 0.0, 0.0)
        body -= room.translate(place).rotate((0.0, 0.0, node["turn"]))
        inside += [(n, s.translate((*place[:2], floor)).rotate((0.0, 0.0, node["turn"]))) for n, s in pieces]
        x += u + WALL
    own: Pieces = [("box", body)]
    if lidded:
        _lid(own, node, shape, (a, b, c, gap), fit)
    if node["tube"]:
        mirrored = [(n, s.mirror((0.0, 0.0, 1.0)).translate((0.0, 0.0, c))) for n, s in own]
        _lid(mirrored, node, shape.mirror((0.0, 0.0, 1.0)).translate((0.0, 0.0, c)), (a, b, c, gap), fit)
        own = [(n, s.mirror((0.0, 0.0, 1.0)).translate((0.0, 0.0, c))) for n, s in mirrored]
    total = (size[0], size[1], high - low)
    return [(n, s.translate((0.0, 0.0, -low))) for n, s in [*own, *inside]], total


def _lid(
    own: Pieces, node: Mapping[str, Any], shape: Manifold, inner: tuple[float, float, float, float], fit: str
) -> None:
    """Put the lid and its pins on a box, which comes first among the pieces; all ends flush with its outside."""
    a, b, c, gap = inner
    low, high = shape.bounding_box()[:3], shape.bounding_box()[3:]
    turn, kind, tight = node["turn"], node["lid"], clearance(6.0, fit)
    above = kit.box((low[0] - 1, low[1] - 1, c), (high[0] + 1, high[1] + 1, c + RIM + 1))
    slot = None
    if kind == "cap":
        inset = (1.0 - WALL / (high[0] - low[0]), 1.0 - WALL / (high[1] - low[1]), 1.0)
        rim = shape.scale(inset).trim_by_plane((0.0, 0.0, -1.0), -(c + RIM - 3.0))
        hole = shape.scale([1.0 - (WALL - gap) / (e - f) for e, f in zip(high[:2], low[:2], strict=True)] + [1.0])
        hole = hole.trim_by_plane((0.0, 0.0, -1.0), -(c + RIM - 3.0))
        well = kit.box((-a / 2, -b / 2, c), (a / 2, b / 2, c + RIM)).rotate((0.0, 0.0, turn))
        plug = kit.box((0.1 - a / 2, 0.1 - b / 2, c), (a / 2 - 0.1, b / 2 - 0.1, c + RIM)).rotate((0.0, 0.0, turn))
        box, lid = (own[0][1] - above) + ((rim ^ above) - well), ((shape ^ above) - hole) + plug
    else:
        ledge, tail = 2.0, 100.0 if kind == "slide" else 0.0
        slot, plug = (
            kit.box(
                (-a / 2 - ledge - e, -b / 2 - ledge - e, c), (a / 2 + ledge + e, b / 2 + ledge + e + tail, c + RIM + e)
            )
            for e in (gap / 2, 0.0)
        )
        if kind == "slide":
            wings = kit.box((-a / 2 - 4, -b / 2 - 2, c), (a / 2 + 4, b / 2 + 100, c + 4))
            room = kit.box(
                (-a / 2 - 4 - gap / 2, -b / 2 - 2 - gap / 2, c), (a / 2 + 4 + gap / 2, b / 2 + 100, c + 4 + gap / 2)
            )
            slot, plug = slot + room, plug + wings
        box, lid = own[0][1] - slot.rotate((0.0, 0.0, turn)), plug.rotate((0.0, 0.0, turn)) ^ shape
    for pin in node["pins"]:
        side = turn + 180.0 * (pin["side"] >= 180) if kind == "slide" else pin["side"]
        angle = math.radians(side + pin["skew"])
        axis, start = (math.cos(angle), math.sin(angle), 0.0), 0.0 if kind == "cap" else 0.3 * min(a, b)
        rod = kit.cylinder(6.0, start, 200.0, segments=12), kit.cylinder(6.0 + tight, start, 300.0, segments=12)
        stick, hole = (kit.place(s, (0.0, 0.0, c + (8.5 if kind == "cap" else 12.0)), axis) for s in rod)
        stick = stick ^ shape
        if kind == "cap":
            core = kit.box((-a / 2 - 0.5, -b / 2 - 0.5, c - 1), (a / 2 + 0.5, b / 2 + 0.5, c + RIM))
            core = core.rotate((0.0, 0.0, turn))
            stick, hole = stick - core, hole - core
        box, lid = box - hole, lid - hole
        own.append(("pin", stick))
    own[0] = ("box", box)
    own.insert(1, ("lid", lid))


FAMILY = Family(
    name="nested_container",
    version=2,
    summary="boxes in boxes that open up, down and sideways; their flush pins come out only outside the next box",
    draw=draw,
    build=build,
)
