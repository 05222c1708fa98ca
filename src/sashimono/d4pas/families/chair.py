"""Chairs and stools: splayed legs in the seat, stretchers that lock them, a raked back of posts, slats and a crest."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one chair."""
    pick = kit.Draw(rng)
    legs = pick.choice((3, 4), (1, 2))
    ties = pick.some(range(legs), pick.count(1, 3))
    joints = ("blind", "through", "pinned")
    return {
        "legs": legs,
        "length": pick.length(118.0, 140.0),
        "width": pick.length(112.0, 132.0),
        "height": pick.length(80.0, 120.0),
        "seat": pick.length(20.0, 26.0),
        "leg": pick.length(16.0, 19.0),
        "splay": pick.length(12.0, 17.0, 0.5) + (4.0 if legs == 3 else 0.0),
        "joints": [pick.choice(joints, (1, 2, 2)) for _ in range(legs)],
        "ties": [{"pair": k, "flip": pick.chance(0.5), "pin": pick.chance(0.6)} for k in ties],
        "cross": pick.chance(0.6),
        "back": legs == 4 and pick.chance(0.75),
        "rake": pick.length(4.0, 20.0, 0.5),
        "back_height": pick.length(60.0, 100.0),
        "slats": pick.count(1, 2),
        "post": pick.chance(0.6),
        "crest_pins": pick.choice((0, 1, 2), (1, 2, 2)),
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the chair: the seat's underside at z = 0, the back at -y."""
    product, thick = Product(), params["seat"]
    if params["legs"] == 3:
        product.add("seat", kit.cylinder(params["width"], 0.0, thick, segments=48))
        feet = kit.on_circle(3, params["width"] - 56.0, phase=90.0)
    else:
        product.add("seat", kit.plate(params["length"], params["width"], 0.0, thick, radius=8.0))
        feet = kit.corners(params["length"], params["width"], 27.0)
    tilt = math.radians(params["splay"])
    axes = []
    for (x, y), joint in zip(feet, params["joints"], strict=True):
        away = math.atan2(y, x) if params["legs"] == 3 else math.copysign(math.pi / 2.0, y)
        axis = (-math.sin(tilt) * round(math.cos(away), 9), -math.sin(tilt) * math.sin(away), math.cos(tilt))
        axes.append((np.array((x, y, 0.0)), np.array(axis)))
        _leg(product, params, (x, y, 0.0), axis, joint)
    _ties(product, params, axes)
    if params["back"]:
        _back(product, params)
    return product


def _leg(product: Product, params: Mapping[str, Any], foot: kit.Vector, axis: kit.Vector, joint: str) -> None:
    """Add one leg, its tenon in the seat, and what locks the tenon."""
    thick, wide, height = params["seat"], params["leg"], params["height"]
    d, gap = 0.7 * params["leg"], clearance(0.7 * params["leg"], params["fit"])
    tenon = (thick + 9.0) / axis[2] if joint == "through" else 0.7 * thick
    body = kit.place(kit.cylinder(wide, -2.0 * height, wide, segments=16), foot, axis)
    body = body.trim_by_plane((0.0, 0.0, -1.0), 0.0).trim_by_plane((0.0, 0.0, 1.0), -height)
    product.cut(["seat"], kit.place(kit.cylinder(d + gap, -wide, tenon, segments=16), foot, axis))
    leg = product.add("leg", body + kit.place(kit.cylinder(d, -6.0, tenon, segments=16), foot, axis))
    away = math.atan2(-axis[1], -axis[0])
    x, y = foot[0], foot[1]
    if joint == "through":
        x, y = x + axis[0] / axis[2] * (thick + 2.0), y + axis[1] / axis[2] * (thick + 2.0)
        key = kit.box((-1.7, -10.0, 0.0), (1.7, 10.0, 4.0)).rotate((0.0, 0.0, math.degrees(away)))
        key = key.translate((x, y, thick))
        product.cut([leg], key)
        product.add("key", key)
    elif joint == "pinned":
        level = 0.35 * thick
        x, y = x + axis[0] / axis[2] * level, y + axis[1] / axis[2] * level
        side = (math.copysign(1.0, x), 0.0, 0.0) if params["legs"] == 4 else (math.cos(away), math.sin(away), 0.0)
        edge = params["length"] / 2.0 - abs(x) if params["legs"] == 4 else params["width"] / 2.0 - math.hypot(x, y)
        origin = (x + side[0] * edge, y + side[1] * edge, level)
        gap = clearance(3.5, params["fit"])
        kit.peg(product, ["seat", leg], 3.5, edge + 0.3 * d, origin, side, clearance=gap, reach=5.0, part="dowel")


def _ties(product: Product, params: Mapping[str, Any], axes: list[tuple[np.ndarray, np.ndarray]]) -> None:
    """Add stretchers: blind in one leg, through the other; a pin or a cross stretcher locks them."""
    legs, d = len(axes), 0.55 * params["leg"]
    gap = clearance(d, params["fit"])
    middles = {}
    for tie in params["ties"]:
        k = tie["pair"]
        share = (0.32, 0.55)[k % 2] if legs == 4 else 0.25 + 0.2 * k
        level = -(1.0 - share) * params["height"]
        pair = (k, (k + 1) % legs)
        near, far = pair[::-1] if tie["flip"] else pair
        start, end = (axes[j][0] + axes[j][1] / axes[j][1][2] * level for j in (near, far))
        along = (start - end) / np.linalg.norm(start - end)
        origin = start + along * (0.5 * params["leg"] + 5.0)
        length = float(np.linalg.norm(origin - end)) + 0.2 * params["leg"]
        names = [_name("leg", near), _name("leg", far)]
        bar = kit.peg(product, names, d, length, origin, along, clearance=gap, reach=5.0, part="stretcher")
        side = (-along[1], along[0], 0.0)
        if tie["pin"]:
            reach = 0.5 * params["leg"]
            outside = (start[0] + side[0] * reach, start[1] + side[1] * reach, level)
            gap_pin = clearance(3.0, params["fit"])
            length = reach + 0.3 * d
            kit.peg(product, [names[0], bar], 3.0, length, outside, side, clearance=gap_pin, reach=5.0)
        middles[k] = (bar, (start + end) / 2.0)
    for pair in ((0, 2), (1, 3)):
        if params["cross"] and legs == 4 and pair[0] in middles and pair[1] in middles:
            (bar, start), (other, end) = middles[pair[0]], middles[pair[1]]
            along = (start - end) / np.linalg.norm(start - end)
            origin, length = start + along * (0.5 * d + 4.0), float(np.linalg.norm(start - end)) + 0.5 * d + 4.0
            kit.peg(product, [bar, other], 0.5 * d, length, origin, along, clearance=gap, reach=5.0, part="cross_bar")


def _back(product: Product, params: Mapping[str, Any]) -> None:
    """Add the raked back: posts and slats in seat and crest, all along one oblique axis."""
    thick, rake, top, fit = params["seat"], params["rake"], params["back_height"], params["fit"]
    gap, reach, count = clearance(12.0, fit), params["length"] / 2.0 - 16.0, params["slats"]

    def lean(solid: Manifold) -> Manifold:
        return solid.rotate((rake, 0.0, 0.0)).translate((0.0, 17.0 - params["width"] / 2.0, thick))

    def turn(x: float, y: float, z: float) -> tuple[float, float, float]:
        c, s = math.cos(math.radians(rake)), math.sin(math.radians(rake))
        return (x, c * y - s * z, s * y + c * z)

    def at(x: float, y: float, z: float) -> tuple[float, float, float]:
        a, b, c = turn(x, y, z)
        return (a, b + 17.0 - params["width"] / 2.0, c + thick)

    crest = kit.box((-reach - 12.0, -9.5, top - 16.0), (reach + 12.0, 9.5, top + 8.0))
    crest = product.add("crest", lean(crest))
    width = min(18.0, 1.5 * reach / (count + 1))
    for k in range(count):
        x = reach * (2.0 * (k + 1) / (count + 1) - 1.0)
        low, high = -0.45 * thick, top - 5.0
        slat = kit.box((x - width / 2.0, -3.0, low), (x + width / 2.0, 3.0, high))
        room = kit.box(
            (x - width / 2.0 - gap / 2.0, -3.0 - gap / 2.0, low), (x + width / 2.0 + gap / 2.0, 3.0 + gap / 2.0, high)
        )
        product.cut(["seat", crest], lean(room))
        product.add("slat", lean(slat))
    for side in (-1.0, 1.0):
        x, low = side * reach, -0.5 * thick
        product.cut(["seat", crest], lean(kit.cylinder(14.0 + gap, low, top, segments=16).translate((x, 0.0, 0.0))))
        post = product.add("post", lean(kit.cylinder(14.0, low, top, segments=16).translate((x, 0.0, 0.0))))
        if params["post"]:
            origin = (x, -params["width"] / 2.0, 0.7 * thick)
            kit.peg(
                product, ["seat", post], 4.0, 20.0, origin, (0.0, -1.0, 0.0), clearance=clearance(3.0, fit), reach=5.0
            )
        if params["crest_pins"] > (side > 0.0):
            origin, axis = at(x, 9.5, top - 8.0), turn(0.0, 1.0, 0.0)
            kit.peg(product, [crest, post], 3.0, 12.0, origin, axis, clearance=clearance(3.0, fit), reach=5.0)


def _name(noun: str, index: int) -> str:
    return noun if index == 0 else f"{noun}_{index + 1}"


FAMILY = Family(
    name="chair",
    version=2,
    summary="splayed legs held by stretchers that slide out through a leg; slats caught between seat and crest",
    draw=draw,
    build=build,
)
