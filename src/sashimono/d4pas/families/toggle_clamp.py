"""A toggle clamp: links on pivot pins kept by clips that slide in sideways, a grip on the handle, a tilted spindle."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from manifold3d import CrossSection, Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

FACETS = 12
"""Facets of pins and their holes."""
CLIP = 3.0
"""Thickness of a clip [mm]."""

Point = tuple[float, float]


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one clamp."""
    pick = kit.Draw(rng)
    return {
        "pin": pick.length(7.0, 10.0, 0.5),
        "plate": pick.length(6.0, 9.0),
        "web": pick.length(15.4, 18.0),
        "fit": pick.choice(("H9/d9", "H7/g6", "exact")),
        "points": {
            "ground": [pick.length(42.0, 52.0), pick.length(0.0, 6.0)],
            "knee": [pick.length(4.0, 14.0), pick.length(32.0, 38.0)],
            "joint": [pick.length(50.0, 58.0), pick.length(38.0, 46.0)],
            "tip": [pick.length(-75.0, -55.0), pick.length(10.0, 30.0)],
        },
        "reach": pick.length(50.0, 70.0),
        "arms": pick.choice((1, 2), (1, 2)),
        "links": pick.choice((1, 2), (1, 1)),
        "keepers": [pick.choice(("clip", "peg", "none"), (4, 2, 2)) for _ in range(4)],
        "sides": [pick.choice((1, -1)) for _ in range(4)],
        "turns": [pick.choice((0.0, 20.0, 50.0, 75.0, 110.0, 160.0, 235.0, 300.0)) for _ in range(4)],
        "grip": pick.choice(("none", "plain", "pinned"), (1, 1, 2)),
        "spindle": pick.chance(0.6),
        "bolts": pick.choice((0, 2)),
        "lean": pick.choice((0.0, 15.0, 25.0)),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the clamp in the plane x, z; its pins run along y, the pivot of the arm at the origin."""
    product, half, plate = Product(), params["web"] / 2.0, params["plate"]
    arm, ground = (0.0, 0.0), _point(params, "ground")
    knee, joint, tip = _point(params, "knee"), _point(params, "joint"), _point(params, "tip")
    turn = math.atan2(joint[1] - knee[1], joint[0] - knee[0])
    end = (joint[0] + params["reach"] * math.cos(turn), joint[1] + params["reach"] * math.sin(turn))
    radius = params["pin"] / 2.0 + 6.0
    base = _slab([arm, ground, (arm[0], -14.0), (ground[0], -14.0)], radius, -half, half)
    base += kit.box((-14.0, -half - plate - 12.0, -30.0), (ground[0] + 14.0, half + plate + 12.0, -20.0))
    names = {"base": product.add("base", base - kit.box((-99.0, -99.0, -60.0), (199.0, 99.0, -30.0)))}
    handle = _slab([knee, joint], radius, -half, half) + _slab([joint, end], 7.0, -half + 1.0, half - 1.0)
    names["handle"] = product.add("handle", handle)
    sides = (1.0, -1.0)
    arms, links = [], []
    for side in sides[: params["arms"]]:
        low, high = sorted((side * half, side * (half + plate)))
        arms.append(product.add("arm", _slab([arm, knee], radius, low, high) + _slab([arm, tip], radius, low, high)))
    for side in sides[: params["links"]]:
        low, high = sorted((side * half, side * (half + plate)))
        links.append(product.add("link", _slab([ground, joint], radius, low, high)))
    _pivot(product, params, 0, arm, [names["base"], *arms])
    _pivot(product, params, 1, ground, [names["base"], *links])
    _pivot(product, params, 2, knee, [names["handle"], *arms])
    _pivot(product, params, 3, joint, [names["handle"], *links])
    _grip(product, params, names["handle"], end, turn)
    if params["spindle"]:
        _spindle(product, params, arms, tip)
    _bolts(product, params, names["base"], ground)
    return product


def _point(params: Mapping[str, Any], name: str) -> Point:
    x, z = params["points"][name]
    return (x, z)


def _slab(points: Sequence[Point], radius: float, low: float, high: float) -> Manifold:
    """Return a plate round points (x, z), from low to high along y."""
    circle = CrossSection.circle(radius, 16)
    section = CrossSection.batch_hull([circle.translate((x, -z)) for x, z in points])
    return Manifold.extrude(section, high - low).translate((0.0, 0.0, low)).rotate((-90.0, 0.0, 0.0))


def _pivot(product: Product, params: Mapping[str, Any], number: int, at: Point, parts: list[str]) -> None:
    """Add a pin through parts, with a head on one side and what keeps it on the other."""
    size, side, kind = params["pin"], params["sides"][number], params["keepers"][number]
    gap = clearance(size, params["fit"])
    boxes = [product.solids[name].bounding_box() for name in parts]
    # the plates lie flush against the web or the handle; the base's foot is wider
    half, plate = params["web"] / 2.0, params["plate"]
    low = -half - (plate if any(box[1] < -half - 1.0 for box in boxes[1:]) else 0.0)
    high = half + (plate if any(box[4] > half + 1.0 for box in boxes[1:]) else 0.0)
    start, stop = (low, high) if side > 0 else (-high, -low)
    tail = {"clip": CLIP + 3.0, "peg": size + 4.0, "none": 0.0}[kind]
    pin = kit.cylinder(size, start, stop + tail, segments=FACETS) + kit.cylinder(size + 5.0, start - 4.0, start)
    if kind == "clip":
        pin -= kit.tube(2.0 * size, 0.6 * size, stop, stop + CLIP, segments=FACETS)
    pose, axis = (at[0], 0.0, at[1]), (0.0, float(side), 0.0)
    hole = kit.cylinder(size + gap, -half - plate - 1.0, half + plate + 1.0, segments=FACETS)
    product.cut(parts, kit.place(hole, pose, axis))
    name = product.add("pin", kit.place(pin, pose, axis))
    turn = params["turns"][number]
    if kind == "clip":
        bore = 0.6 * size + 0.1
        clip = kit.cylinder(size + 7.0, stop, stop + CLIP, segments=16) - kit.cylinder(
            bore, stop - 1.0, stop + CLIP + 1.0
        )
        clip -= kit.box((0.0, -bore / 2.0, stop - 1.0), (size + 9.0, bore / 2.0, stop + CLIP + 1.0))
        product.add("clip", kit.place(clip, pose, axis, spin=turn))
    elif kind == "peg":
        way = kit.place(kit.box((0.0, -0.5, -0.5), (10.0, 0.5, 0.5)).rotate((0.0, 0.0, turn)), (0.0, 0.0, 0.0), axis)
        box = way.bounding_box()
        middle = ((box[0] + box[3]) / 2.0, 0.0, (box[2] + box[5]) / 2.0)
        norm = math.hypot(middle[0], middle[2])
        across = (middle[0] / norm, 0.0, middle[2] / norm)
        thick = 0.4 * size
        reach = size / 2.0 + 3.0
        y = side * (stop + thick / 2.0)
        origin = (at[0] + reach * across[0], y, at[1] + reach * across[2])
        kit.peg(product, [name], thick, 2.0 * reach, origin, across, part="peg", reach=2.0)


def _grip(product: Product, params: Mapping[str, Any], handle: str, end: Point, turn: float) -> None:
    """Add the grip over the handle's end, and the pin across it."""
    if params["grip"] == "none":
        return
    half = params["web"] / 2.0
    start = 0.45 * params["reach"]
    axis = (math.cos(turn), 0.0, math.sin(turn))
    origin = (end[0] - start * axis[0], 0.0, end[1] - start * axis[2])
    shape = kit.plate(26.0, 2.0 * half + 10.0, 0.0, start + 14.0, radius=5.0)
    hole = kit.plate(14.0, 2.0 * half - 2.0, -1.0, start - 6.0)
    grip = kit.place(shape - hole, origin, axis)
    # the handle's round end gets square where the grip holds it
    square = kit.place(kit.plate(14.0, 2.0 * half - 2.0, -6.0, start - 6.0), origin, axis)
    round_end = kit.place(kit.box((-40.0, -40.0, start - 6.0), (40.0, 40.0, start + 40.0)), origin, axis)
    product.join(handle, square)
    product.cut([handle], round_end)
    name = product.add("grip", grip)
    if params["grip"] == "pinned":
        middle = (origin[0] + 0.5 * start * axis[0], half + 6.0, origin[2] + 0.5 * start * axis[2])
        kit.peg(product, [name, handle], 6.0, 2.0 * half + 12.0, middle, (0.0, 1.0, 0.0), reach=2.0)


def _spindle(product: Product, params: Mapping[str, Any], arms: list[str], tip: Point) -> None:
    """Add the block at the arm's tip on a slanted bolt, the spindle through it and its nuts."""
    half, size = params["web"] / 2.0, 8.0
    lean = math.radians(params["lean"])
    axis = (math.sin(lean), 0.0, math.cos(lean))
    pose = (tip[0], 0.0, tip[1])
    block = kit.place(kit.box((-11.0, -half, -11.0), (11.0, half, 11.0)), pose, axis)
    name = product.add("block", block)
    product.cut([name], kit.place(kit.cylinder(size, -40.0, 40.0, segments=12), pose, axis))
    spindle = kit.cylinder(size, -30.0, 26.0, segments=12) + kit.cylinder(18.0, -36.0, -30.0)
    product.add("spindle", kit.place(spindle, pose, axis))
    for bottom in (-11.0 - kit.METRIC[size][3], 11.0):
        nut = kit.nut(size).translate((0.0, 0.0, bottom))
        product.add("nut", kit.place(nut, pose, axis))
    for side, arm in zip((1.0, -1.0), arms, strict=False):
        # beside the spindle, in the block's own slant
        foot = (tip[0] + 7.5 * axis[2], side * (half + params["plate"]), tip[1] - 7.5 * axis[0])
        kit.fasten(product, [arm, name], 3.0, params["plate"] + 0.8 * half, foot, (0.0, side, 0.0), head="hex")


def _bolts(product: Product, params: Mapping[str, Any], base: str, ground: Point) -> None:
    """Add a table below the base, bolted on aslant."""
    if not params["bolts"]:
        return
    wide = params["web"] / 2.0 + params["plate"] + 12.0
    table = product.add("table", kit.box((-24.0, -wide - 10.0, -46.0), (ground[0] + 24.0, wide + 10.0, -30.0)))
    for y in (-wide + 7.0, wide - 7.0):
        lean = math.radians(params["lean"])
        axis = (0.0, math.copysign(math.sin(lean), y), math.cos(lean))
        x = 6.0 if y < 0.0 else ground[0] - 6.0
        kit.fasten(product, [base, table], 5.0, 18.0, (x, y, -21.0), axis, reach=12.0)


FAMILY = Family(
    name="toggle_clamp",
    version=1,
    summary="links on pins behind clips that leave sideways at any angle; a grip off an oblique handle",
    draw=draw,
    build=build,
)
