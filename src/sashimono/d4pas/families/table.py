"""Tables: aprons dropped into the legs' open slots, corner blocks screwed at 45 degrees, a top, perhaps a drawer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one table."""
    pick = kit.Draw(rng)
    blocks = pick.some(range(4), pick.count(1, 4))
    return {
        "length": pick.length(230.0, 380.0),
        "width": pick.length(200.0, 280.0),
        "height": pick.length(120.0, 260.0),
        "top": pick.length(12.0, 20.0),
        "radius": pick.choice((0.0, 10.0, 25.0)),
        "leg": pick.length(27.0, 34.0),
        "apron": pick.length(8.0, 10.0),
        "depth": pick.length(38.0, 46.0),
        "slope": pick.choice((0.0, 0.04, 0.08)),
        "blocks": [
            {
                "corner": k,
                "ears": pick.some(range(2), pick.count(0, 2)),
                "lag": pick.chance(0.8),
                "up": pick.chance(0.6),
            }
            for k in blocks
        ],
        "dowels": pick.some(range(2), pick.count(0, 2)),
        "drawer": pick.chance(0.6),
        "divider": pick.chance(0.5),
        "feet": pick.some(range(4), pick.choice((0, 2, 4))),
        "fit": pick.choice(("H11/c11", "H9/d9", "H8/f7", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the table: the top's underside at z = 0, the drawer's front at -y."""
    product, w, t = Product(), params["leg"], params["apron"]
    a, b = params["length"] / 2.0 - w, params["width"] / 2.0 - w
    gap, depth = clearance(t, params["fit"]), params["depth"]
    product.add("top", kit.plate(params["length"], params["width"], 0.0, params["top"], radius=params["radius"]))
    legs = []
    for sx, sy in CORNERS:
        shift = params["slope"] * params["height"]
        head = kit.box((-w / 2, -w / 2, -0.1), (w / 2, w / 2, 0.0))
        foot = kit.box((-w / 2, -w / 2, -params["height"]), (w / 2, w / 2, 0.1 - params["height"]))
        solid = Manifold.batch_hull([head, foot.translate((sx * shift, sy * shift, 0.0))])
        legs.append(product.add("leg", solid.translate((sx * a, sy * b, 0.0))))
    reach = w / 2.0 - t / 2.0 - 1.3
    for along, across, turn in ((a, b, False), (b, a, True)):
        half = along - w / 2.0 + reach
        for sign in (1, -1):
            low, high = (-half, sign * across - t / 2.0, -depth), (half, sign * across + t / 2.0, 0.0)
            room = kit.box((low[0] - gap, low[1] - gap / 2.0, low[2]), (high[0] + gap, high[1] + gap / 2.0, 10.0))
            solid = kit.box(low, high)
            if turn:
                solid, room = solid.rotate((0.0, 0.0, 90.0)), room.rotate((0.0, 0.0, 90.0))
            product.cut(legs, room)
            product.add("apron", solid)
    for block in params["blocks"]:
        _block(product, params, block, legs[block["corner"]], (a, b))
    for k in params["dowels"]:
        x, y = CORNERS[k][0] * (a - w / 2.0 - 4.0), CORNERS[k][1] * b

        tight = clearance(5.0, params["fit"])
        origin = (x - CORNERS[k][0] * 50.0, y, 0.5 * params["top"])
        kit.peg(
            product, ["top", "apron"], 5.0, 0.5 * params["top"] + 12.0, origin, (0, 0, 1), clearance=tight, part="dowel"
        )
    for k in params["feet"]:
        shift = params["slope"] * params["height"]
        x, y, z = CORNERS[k][0] * (a + shift), CORNERS[k][1] * (b + shift), -params["height"]
        stem = clearance(7.0, params["fit"])
        product.cut([legs[k]], kit.cylinder(7.0 + stem, z - 1.0, z + 14.0, segments=12).translate((x, y, 0.0)))
        foot = kit.cylinder(7.0, z - 1.0, z + 14.0, segments=12) + kit.cylinder(0.8 * w, z - 5.0, z)
        product.add("foot", foot.translate((x, y, 0.0)))
    if params["drawer"]:
        _drawer(product, params, (a, b))
    return kit.tidy(product)


def _block(
    product: Product, params: Mapping[str, Any], block: Mapping[str, Any], leg: str, places: tuple[float, float]
) -> None:
    """Add a corner block with its lag screw at 45 degrees, its ears over the aprons and its screw into the top."""
    w, t, depth, fit = params["leg"], params["apron"], params["depth"], params["fit"]
    sx, sy = CORNERS[block["corner"]]
    h = (w - t) / 2.0
    q, low = 2.0 * h + 24.0, -0.8 * depth
    aprons = ["apron" if sy > 0 else "apron_2", "apron_4" if sx > 0 else "apron_3"]

    def at(u: float, v: float) -> tuple[float, float]:
        return sx * (places[0] - t / 2.0 - u), sy * (places[1] - t / 2.0 - v)

    def solid(points: list[tuple[float, float]], z0: float) -> Manifold:
        outline = [at(u, v) for u, v in points]
        return kit.prism(outline if sx * sy > 0 else outline[::-1], z0, 0.0)

    body = solid([(h, 0), (q, 0), (0, q), (0, h), (h, h)], low)
    for ear in block["ears"]:
        points = [(h + 3, -0.6 * t), (q - 4, -0.6 * t), (q - 4, 1), (h + 3, 1)]
        tab = solid(points if ear == 0 else [(v, u) for u, v in points[::-1]], -7.0)
        body += tab
        product.cut([aprons[ear]], tab)
    name = product.add("block", body)
    if block["lag"]:
        s = math.sqrt(0.5)
        x, y = at(q / 2.0 - s, q / 2.0 - s)
        length = (q - 2.0 * h) * s - 1.0 + 2.0 * s * (w / 2.0 - t / 2.0 - 3.0)
        gap = clearance(4.0, fit)
        kit.fasten(
            product, [name, leg], 4.0, length, (x, y, 0.5 * low), (-sx * s, -sy * s, 0.0), clearance=gap, part="lag"
        )
    if block["up"] or not block["lag"]:
        x, y = at(q - 13.0, 5.5)
        length = -low - 3.5 + 0.6 * params["top"]
        origin, gap = (x, y, low + 3.5), clearance(3.0, fit)
        kit.fasten(product, [name, "top"], 3.0, length, origin, (0.0, 0.0, -1.0), clearance=gap)


def _drawer(product: Product, params: Mapping[str, Any], places: tuple[float, float]) -> None:
    """Add a drawer through the front apron on a runner; its front hides the runner's screws."""
    w, t, depth, fit = params["leg"], params["apron"], params["depth"], params["fit"]
    front, back = -places[1] - t / 2.0, places[1] - t / 2.0
    wide = 0.5 * (places[0] - w)
    low, high, gap = 11.0 - depth, -7.0, 0.3
    product.cut(["apron_2"], kit.box((-wide, front - 1, low), (wide, front + t + 1, high)))
    runner = product.add("runner", kit.box((-wide - 5, front + t, low - 9.0), (wide + 5, back, low)))
    loose = clearance(3.0, fit)
    for x in (-0.6 * wide, 0.6 * wide):
        y = front
        kit.fasten(
            product, ["apron_2", runner], 3.0, t + 10, (x, y, low - 5), (0, -1, 0), clearance=loose, head="countersunk"
        )
    origin = (0.0, back + t, low - 5.0)
    kit.fasten(product, ["apron", runner], 3.0, t + 10.0, origin, (0, 1, 0), clearance=loose, head="countersunk")
    end = front + 0.7 * (back - front)
    body = kit.box((gap - wide, front - 1, low), (wide - gap, end, high - gap))
    body -= kit.box((gap - wide + 4, front + 5, low + 4), (wide - gap - 4, end - 4, 1.0))
    body += kit.box((-wide - 8, front - 5, low - 9.5), (wide + 8, front, high + 5))
    drawer = product.add("drawer", body)
    middle = (low + high) / 2.0
    product.add(
        "knob", kit.place(kit.cylinder(16.0, 0.0, 14.0, top=20.0), (0.0, front - 5.0, middle), (0.0, -1.0, 0.0))
    )
    origin = (0.0, front + 5.0, middle)
    kit.fasten(product, ["knob", drawer], 3.0, 18.0, origin, (0, 1, 0), clearance=loose, reach=4.0)
    if params["divider"]:
        y = (front + end) / 2.0
        slot = kit.box((gap - wide + 2, y - 2, low + 4), (wide - gap - 2, y + 2, high - gap))
        product.cut([drawer], slot)
        product.add("divider", slot)


FAMILY = Family(
    name="table",
    version=1,
    summary="legs that drop off open slots, aprons under ears of screwed corner blocks, a drawer over hidden screws",
    draw=draw,
    build=build,
)
