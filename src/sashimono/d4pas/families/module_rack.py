"""Racks: modules slide in level or inclined guides; rods, latch pins, a bar and a back panel hold them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

SIDE, TONGUE, BOARD = 13.0, 5.0, 17.0
"""Thickness of the sides, height and depth of the tongues, thickness of top and base [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one rack."""
    pick = kit.Draw(rng)
    columns = pick.choice((1, 2), (2, 1))
    rows = pick.count(4, 8) if columns == 1 else pick.count(3, 5)
    return {
        "columns": columns,
        "width": pick.length(54.0, 80.0),
        "depth": pick.length(44.0, 64.0),
        "module": pick.length(13.0, 18.0),
        "incline": pick.choice((0.0, 12.0, 20.0, 28.0), (1, 2, 2, 2)),
        "down": pick.chance(0.5),
        "bays": [
            {
                "full": pick.chance(0.9),
                "face": pick.chance(0.6),
                "latch": pick.chance(0.6),
                "skew": pick.choice((0.0, 20.0, 35.0)),
            }
            for _ in range(columns * rows)
        ],
        "stopped": pick.chance(0.4),
        "rods": pick.choice(([], [0], [0, 1]), (2, 1, 1)),
        "back": pick.chance(0.6),
        "back_tilt": pick.choice((0.0, 12.0)),
        "fit": pick.choice(("H11/c11", "H9/d9", "H8/f7", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the rack: base on z = 0, front towards -y."""
    product, deep, incline = Product(), params["depth"], math.radians(params["incline"])
    rows, wide = len(params["bays"]) // params["columns"], params["width"]
    pitch = (params["module"] + 5.0) / math.cos(incline)
    plate = 0.5 * (params["module"] + 4.0)
    reach = (deep / 2.0 + plate * math.sin(incline) + 0.5) / math.cos(incline)
    front = (reach + 17.0) * math.cos(incline) + plate * math.sin(incline) + 1.0
    margin = front * math.tan(incline) + pitch / 2.0 + 3.0
    height = 2.0 * margin + (rows - 1) * pitch
    span = params["columns"] * wide + (params["columns"] - 1) * SIDE
    half = span / 2.0 + SIDE
    frame = kit.box((-half, -deep / 2.0, -BOARD), (half, deep / 2.0, height + BOARD))
    for k in range(params["columns"]):
        x = -half + SIDE + k * (wide + SIDE)
        frame -= kit.box((x, -deep, 0.0), (x + wide, deep, height))
    product.add("frame", frame)
    modules: list[list[str]] = []
    for column in range(params["columns"]):
        modules.append([])
        x = -half + SIDE + wide / 2.0 + column * (wide + SIDE)
        for row in range(rows):
            bay = params["bays"][column * rows + row]
            if bay["full"] or row == 0:
                place = (x, 0.0, margin + row * pitch)
                modules[column].append(_module(product, params, bay, place, 2 * column - 1, reach))
    _locks(product, params, modules, (half, height))
    return product


def _module(
    product: Product, params: Mapping[str, Any], bay: Mapping[str, Any], place: kit.Vector, outer: int,
    reach: float,
) -> str:  # fmt: skip
    """Add one module in its guides, and its latch pin through the outer wall at -x or +x (``outer``)."""
    wide, tall, deep, fit = params["width"] / 2.0, params["module"] / 2.0, params["depth"], params["fit"]
    incline, gap = math.radians(params["incline"]), clearance(params["width"], params["fit"])
    rear = (deep / 2.0 - 3.0 - tall * math.sin(incline)) / math.cos(incline)
    near = reach if bay["face"] else reach - 4.0
    angle = params["incline"] if params["down"] else -params["incline"]

    def put(solid: kit.Manifold) -> kit.Manifold:
        return solid.rotate((angle, 0.0, 0.0)).translate((place[0], place[1], place[2]))

    edge, t = wide - gap / 2.0, TONGUE / 2.0
    body = kit.box((-edge, -near, -tall), (edge, rear, tall))
    body -= kit.box((17.0 - wide, 4.0 - near, 3.0 - tall), (wide - 17.0, rear - 4.0, tall + 1.0))
    body += kit.box((-wide - TONGUE + gap / 2, -near, -t), (17.0 - wide, rear, t))
    body += kit.box((wide - 17.0, -near, -t), (wide + TONGUE - gap / 2, rear, t))
    if bay["face"]:
        face = kit.box((-wide - 4.0, -reach - 4.0, -tall - 2.0), (wide + 4.0, -reach, tall + 2.0))
        handle = kit.box((-8.0, -reach - 16.0, -3.0), (8.0, -reach - 4.0, 3.0))
        body += face + handle
    else:
        body += kit.box((-8.0, -near - 6.0, -3.0), (8.0, -near, 3.0))
    t += gap / 2.0
    end = rear + gap if params["stopped"] else 2.0 * deep
    groove = kit.box((-wide - TONGUE, -2.0 * deep, -t), (wide + TONGUE, end, t))
    product.cut(["frame"], put(groove))
    name = product.add("module", put(body))
    if bay["latch"] and not params["rods"]:
        sign = outer
        skew, tight = math.radians(bay["skew"]), clearance(6.0, fit)
        axis = (sign * math.cos(skew), math.sin(skew), 0.0)
        origin = (place[0] + sign * (wide + SIDE), 0.0, place[2])
        kit.peg(product, ["frame", name], 6.0, SIDE + 11.0, origin, axis, clearance=tight, reach=8.0, part="latch")
    return name


def _locks(product: Product, params: Mapping[str, Any], modules: list[list[str]], sizes: tuple[float, float]) -> None:
    """Add what holds many modules at once: headed rods down through a column, a back panel pinned above and below."""
    (half, height), wide, deep = sizes, params["width"], params["depth"]
    tight = clearance(4.0, params["fit"])
    for k in params["rods"]:
        column = k % params["columns"]
        x = -half + SIDE + wide / 2.0 + column * (wide + SIDE) + (-1) ** k * (wide / 2.0 - 9.0)
        origin = (x, 0.2 * deep * (-1) ** k, height + BOARD)
        rod = kit.peg(
            product,
            ["frame", *modules[column]],
            5.0,
            height + 2.0 * BOARD - 4.0,
            origin,
            (0, 0, 1),
            clearance=tight,
            part="rod",
        )
        product.join(rod, kit.cylinder(11.0, 0.0, 4.0).translate(origin))
    if params["back"]:
        tight = clearance(10.0, params["fit"])
        back = product.add("back", kit.box((-half, deep / 2.0, -BOARD), (half, deep / 2.0 + 6.0, height + BOARD)))
        for sign in (1, -1):
            breadth = 9.5 if params["rods"] else 14.0
            low, high = (height + BOARD, height + BOARD + 8.0) if sign > 0 else (-BOARD - 8.0, -BOARD)
            tail = kit.box((-breadth, deep / 2 - 20, low), (breadth, deep / 2 + 6, high))
            arm = kit.box((-breadth, deep / 2, low - 3.0), (breadth, deep / 2 + 6, high + 3.0))
            product.join(back, tail + arm.trim_by_plane((0.0, 0.0, -sign), -(BOARD + 8.0 + height * (sign > 0))))
            level = -BOARD - 8.0 if sign < 0 else height + BOARD + 8.0
            lean = 0.0 if params["rods"] else math.radians(params["back_tilt"])
            axis = (math.sin(lean), 0.0, sign * math.cos(lean))
            origin = (0.0, deep / 2.0 - 10.0, level)
            kit.peg(product, [back, "frame"], 10.0, 22.0, origin, axis, clearance=tight, reach=9.0)


FAMILY = Family(
    name="module_rack",
    version=1,
    summary="modules in inclined guides under rods, latches and a pinned back; faced ones only leave forwards",
    draw=draw,
    build=build,
)
