"""Cases of electronics: a board whose connector pokes through a wall, controls in a sloping front, a lid with a lip."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

WALL, FRONT, POST, LIP = 4.0, 11.0, 10.0, 7.0
"""Walls of the case, its thicker front, its corner posts, and how deep the lid's lip reaches [mm]."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one case."""
    pick = kit.Draw(rng)
    battery = pick.chance(0.5)
    return {
        "length": pick.length(72.0, 90.0),
        "width": pick.length(62.0, 72.0),
        "height": pick.length(30.0, 36.0),
        "slope": pick.choice((0.0, 15.0, 25.0, 35.0)),
        "lock": pick.choice(("above", "side"), (1, 2)),
        "locks": pick.some(range(4), pick.count(1, 4)),
        "tilt": pick.choice((0.0, 17.0, 30.0)),
        "nose": pick.choice((0, 1, 2), (1, 3, 3)),
        "battery": battery,
        "board_screws": pick.some(range(4), pick.count(1, 3)),
        "load": pick.choice(("none", "chip", "sink", "card"), (1, 1, 3, 3)),
        "card": pick.choice((15.0, 20.0, 25.0) if battery else (12.0, 20.0, -17.0)),
        "knobs": pick.count(0, 2),
        "knob_turns": [pick.length(0.0, 350.0, 5.0) for _ in range(2)],
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the case: its floor on z = 0, its front towards -y, its connector towards +x."""
    product = Product()
    length, width, height = params["length"] / 2.0, params["width"] / 2.0, params["height"]
    lean = math.tan(math.radians(params["slope"]))
    inset = FRONT / math.cos(math.radians(params["slope"]))

    def along_x(points: list[tuple[float, float]], half: float) -> kit.Manifold:
        return kit.prism(points, -half, half).rotate((90.0, 0.0, 0.0)).rotate((0.0, 0.0, 90.0))

    outside = along_x([(-width, 0), (width, 0), (width, height), (-width - height * lean, height)], length)
    low, high = WALL, height + 5.0
    front = (-width - low * lean + inset, -width - high * lean + inset)
    rear = width - WALL
    inside = along_x([(front[0], low), (rear, low), (rear, high), (front[1], high)], length - WALL)
    case, posts = outside - inside, []
    for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1)):
        x = sx * (length - WALL - POST / 2.0)
        y = rear - POST / 2.0 if sy > 0 else front[0] + POST / 2.0
        posts.append((x, y))
        reach = (y - POST / 2.0, width + 1.0) if sy > 0 else (-500.0, y + POST / 2.0)
        edge = sorted((x - sx * POST / 2.0, sx * (length + 1.0)))
        case += kit.box((edge[0], reach[0], 0.5), (edge[1], reach[1], height - LIP)) ^ outside
    case = product.add("case", case)
    lip_front = -width - (height - LIP) * lean + inset
    lid = kit.box((-length, -width - height * lean, height), (length, width, height + 3.0))
    lip = kit.box((WALL - length, lip_front, height - LIP), (length - WALL, rear, height + 0.5))
    lip -= kit.box((WALL + 6 - length, lip_front + 6, height - LIP - 1), (length - WALL - 6, rear - 6, height + 1))
    for x, y in posts:
        wide = POST / 2.0
        lip += kit.box(
            (x - wide, max(y - wide, lip_front), height - LIP), (x + wide, min(y + wide, rear), height + 0.5)
        )
    open_front = length - WALL - POST - 1.0
    lip -= kit.box((-open_front, -500.0, height - LIP - 1.0), (open_front, lip_front + POST + 2.0, height))
    lid = product.add("lid", lid + lip)
    board = _board(product, params, case, (front[0] + POST + 1.0, rear - POST - 1.0))
    _on_board(product, params, board)
    _pads(product, lid, height)
    for k in range(params["knobs"]):
        _control(product, params, case, (k - 0.5 * (params["knobs"] - 1)) * 26.0, params["knob_turns"][k])
    _locks(product, params, case, lid, posts)
    return product


def _locks(product: Product, params: Mapping[str, Any], case: str, lid: str, posts: list[tuple[float, float]]) -> None:
    """Add the lid's screws: from above, or through the sides at an angle."""
    height, fit = params["height"], params["fit"]
    gap = clearance(4.0, fit)
    for k in params["locks"]:
        x, y = posts[k]
        if params["lock"] == "above":
            kit.fasten(product, [lid, case], 4.0, LIP + 12.0, (x, y, height + 1.0), (0, 0, 1), clearance=gap)
        elif params["lock"] == "side":
            tilt, side = math.radians(params["tilt"]), math.copysign(1.0, x)
            axis = (side * math.cos(tilt), 0.0, -math.sin(tilt))
            origin = (side * (params["length"] / 2.0 - 1.0), y * 0.5, height - 3.6)
            kit.fasten(product, [lid, case], 4.0, 9.5, origin, axis, clearance=clearance(4.0, fit))


def _board(product: Product, params: Mapping[str, Any], case: str, span: tuple[float, float]) -> str:
    """Add the board on standoffs, its connectors through the wall, and a battery."""
    half, fit = params["length"] / 2.0, params["fit"]
    low, high = WALL + 3.0, WALL + 7.0
    start, end = 14.0 - half, half - WALL - 0.5
    solid = kit.box((start, span[0], low), (end, span[1], high))
    for k in range(params["nose"]):
        y = span[0] + (span[1] - span[0]) * (0.3 + 0.45 * k)
        wide, tall = 4.0, high + 5.0
        solid += kit.box((end - 10.0, y - wide, low + 1.0), (half + 2.0, y + wide, tall))
        product.cut(
            [case],
            kit.box((half - WALL - 1.0, y - wide - 0.2, low + 0.8), (half + 1.0, y + wide + 0.2, params["height"] + 1)),
        )
        product.join("lid", kit.box((half - WALL, y - wide, tall + 0.2), (half, y + wide, params["height"] + 0.5)))
    board = product.add("board", solid)
    gap = clearance(4.0, fit)
    ends = (start + 5.5, end - 14.5)
    for k, (x, y) in enumerate((x, y) for x in ends for y in (span[0] + 4.0, span[1] - 4.0)):
        if k not in params["board_screws"]:
            product.join(case, kit.cylinder(6.0, WALL - 0.5, low, segments=12).translate((x, y, 0.0)))
            continue
        product.join(case, kit.cylinder(9.0, WALL - 0.5, low, segments=12).translate((x, y, 0.0)))
        screw = kit.fasten(product, [board, case], 4.0, high - 1.0, (x, y, 0.0), (0, 0, -1), clearance=gap)
        product.join(screw, kit.cylinder(13.0, -2.0, 0.0).translate((x, y, 0.0)))
    if params["battery"]:
        tall = params["height"] - LIP - 0.8
        product.add("battery", kit.box((WALL - half, span[0] + 1.0, WALL), (start - 0.2, span[1] - 1.0, tall)))
    return board


def _on_board(product: Product, params: Mapping[str, Any], board: str) -> None:
    """Add what sits on the board: a chip in a recess, its screwed heat sink, and an oblique card in a socket."""
    top, fit = WALL + 7.0, params["fit"]
    gap = clearance(12.0, fit) / 2.0
    low, high = product.solids[board].bounding_box()[1], product.solids[board].bounding_box()[4]
    middle = (low + high) / 2.0
    if params["load"] in ("chip", "sink"):
        x = 0.09 * params["length"]
        room = kit.box((x - 5 - gap, middle - 5 - gap, top - 1), (x + 5 + gap, middle + 5 + gap, top + 1))
        product.cut([board], room)
        product.add("chip", kit.box((x - 5, middle - 5, top - 1), (x + 5, middle + 5, top + 3)))
    if params["load"] == "sink":
        sink = kit.box((x - 5, middle - 11, top + 3), (x + 5, middle + 11, top + 6))
        for k in (-1, 0, 1):
            sink += kit.box((x + 3 * k - 0.8, middle - 5, top + 5), (x + 3 * k + 0.8, middle + 5, top + 10))
        sink = product.add("sink", sink)
        for sign in (-1, 1):
            tight, origin = clearance(2.5, fit), (x, middle + sign * 8.4, top + 6)
            kit.fasten(product, [sink, board], 2.5, 8.0, origin, (0, 0, 1), clearance=tight, part="sink_screw")
    if params["load"] == "card":
        x, lean = -0.19 * params["length"], math.radians(params["card"])
        product.join(board, kit.box((x - 6, middle - 7.5, top - 0.5), (x + 6, middle + 7.5, top + 6)))
        axis = (math.sin(lean), 0.0, math.cos(lean))
        long = (params["height"] - LIP - top - 1.2 + 6.0) / math.cos(lean) - 1.5 * abs(math.tan(lean))
        slot, card = (
            kit.place(kit.box((-2 - e, -5 - e, 0), (2 + e, 5 + e, z)), (x - 2 * axis[0], middle, top + 1.2), axis)
            for e, z in ((gap, 30.0), (0.0, long))
        )
        product.cut([board], slot)
        product.add("card", card)


def _pads(product: Product, lid: str, height: float) -> None:
    """Let the lid hold down what is screwed or set into the board: pads end just above it."""
    for name, solid in list(product.solids.items()):
        if name.startswith("sink") or (name == "chip" and "sink" not in product.solids):
            if name.startswith("sink_screw"):
                continue
            box = solid.bounding_box()
            product.join(
                lid, kit.box((box[0] + 0.3, box[1] + 0.3, box[5] + 0.8), (box[3] - 0.3, box[4] - 0.3, height + 0.5))
            )


def _control(product: Product, params: Mapping[str, Any], case: str, x: float, turn: float) -> None:
    """Add a control in the sloping front: a pin under the lid holds it, a set screw its knob."""
    a, fit = math.radians(params["slope"]), params["fit"]
    level = 0.5 * params["height"] + 1.0
    axis = (0.0, -math.cos(a), -math.sin(a))
    origin = np.array((x, -params["width"] / 2.0 - level * math.tan(a), level))
    gap = clearance(12.0, fit)
    product.cut([case], kit.place(kit.cylinder(12.0 + gap, -FRONT - 1.0, 1.0), origin.tolist(), axis))
    body = kit.cylinder(12.0, -FRONT - 2.0, 0.0) + kit.cylinder(17.0, 0.0, 3.0)
    body += kit.cylinder(6.0, 2.0, 15.5, segments=12)
    control = product.add("control", kit.place(body, origin.tolist(), axis))
    knob = kit.cylinder(16.0, 3.5, 18.0, top=14.0) - kit.cylinder(6.0 + clearance(6.0, fit), 3.0, 15.5, segments=12)
    knob = product.add("knob", kit.place(knob, origin.tolist(), axis))
    t = math.radians(turn)
    side = np.array((math.cos(t), -math.sin(t) * math.sin(a), math.sin(t) * math.cos(a)))
    seat = origin + 10.0 * np.array(axis) + 6.5 * side
    tight = clearance(3.0, fit)
    kit.peg(
        product, [knob, control], 3.0, 8.0, seat.tolist(), side.tolist(), clearance=tight, reach=3.0, part="set_screw"
    )
    up, height = np.array((0.0, -math.sin(a), math.cos(a))), params["height"]
    rise = (height - level) / math.cos(a) + 5.0
    top = origin - 0.5 * FRONT * np.array(axis) + rise * up
    pin = kit.peg(product, [case, control], 4.5, rise + 4.0, top.tolist(), up.tolist(), clearance=tight, part="pin")
    product.solids[pin] = product.solids[pin].trim_by_plane((0.0, 0.0, -1.0), -height)


FAMILY = Family(
    name="enclosure",
    version=2,
    summary="a board under the lid with a chip, its sink or an oblique card; pins under the lid hold oblique controls",
    draw=draw,
    build=build,
)
