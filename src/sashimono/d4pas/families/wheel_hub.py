"""Spoked wheels: radial spokes in a hub, rim segments on them, a tyre around, an axle with nut and cap."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one wheel."""
    pick = kit.Draw(rng)
    spokes = pick.choice((3, 4, 5, 6), (1, 1, 3, 2))
    return {
        "spokes": spokes,
        "spoke": pick.length(4.0, 9.0),
        "reach": pick.length(8.0, 22.0),
        "rim": pick.length(13.0, 18.0),
        "dish": pick.choice((0.0, 6.0, 10.0, 14.0)),
        "keys": sorted(pick.some(range(spokes), pick.count(0, min(spokes, 4)))),
        "tyre": pick.chance(0.8),
        "tyre_screws": pick.some(range(spokes), pick.count(1, min(spokes, 4))),
        "flange": pick.chance(0.6),
        "axle": pick.choice((6.0, 8.0, 10.0)),
        "stub": pick.length(8.0, 30.0),
        "cotter": pick.length(0.0, 350.0, 5.0),
        "cap": pick.chance(0.7),
        "cap_screws": pick.count(2, 4),
        "tilt": pick.choice((0.0, 20.0, 30.0)),
        "screw": pick.choice((2.0, 2.5, 3.0)),
        "fit": pick.choice(("H9/d9", "H8/f7", "H7/g6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the wheel: its axle along z, spokes around the origin."""
    product, n, d, s = Product(), params["spokes"], params["spoke"], params["screw"]
    slope = math.tan(math.radians(params["dish"]))
    cup = kit.METRIC[params["axle"]][1] / math.cos(math.pi / 6.0) / 2.0 + 2.5
    flange = cup + 1.5 + 1.6 * kit.METRIC[s][0]
    root = max((1.5 * d + 2.0) / (2.0 * math.sin(math.pi / n)), params["axle"] / 2.0 + 3.0 + d * slope, flange - 6.0)
    hub_radius = root + 7.0
    half = d / 2.0 + 2.0 + hub_radius * slope + 3.0 * s + 1.5
    solid = kit.cylinder(2.0 * hub_radius, -half, half, segments=8 * n)
    hubs = [product.add("hub", solid)]
    _rim(product, params, hubs, (root, hub_radius), slope)
    _axle(product, params, hubs, half, (cup, flange))
    return product


def _rim(
    product: Product, params: Mapping[str, Any], hubs: list[str], radii: tuple[float, float], slope: float
) -> None:
    """Add spokes, rim segments, keys in their joints, and the tyre."""
    n, d, s, thick = params["spokes"], params["spoke"], params["screw"], params["rim"]
    root, inner, pitch = radii[0], radii[1] + params["reach"], 360.0 / params["spokes"]
    outer, gap = inner + thick, clearance(d, params["fit"])
    level, half = (inner + outer) / 2.0 * slope, d / 2.0 + 3.0 + thick / 2.0 * slope
    ring = kit.tube(2.0 * outer, 2.0 * inner, level - half, level + half, segments=8 * n)
    far = 2.0 * outer
    names = []
    for k in range(n):
        low, high = (math.radians(pitch * (k + e)) for e in (-0.5, 0.5))
        wedge = [(0.0, 0.0), *((far * math.cos(a), far * math.sin(a)) for a in (low, (low + high) / 2.0, high))]
        names.append(product.add("segment", ring ^ kit.prism(wedge, -far, far)))
    for k in range(n):
        angle = math.radians(pitch * k)
        axis = (math.cos(angle), math.sin(angle), slope)
        stretch = math.hypot(1.0, slope)
        low, high = root * stretch, (inner + 0.6 * thick) * stretch
        spoke, room = (kit.cylinder(d + extra, low, high, segments=12) for extra in (0.0, gap))
        product.cut([*hubs, names[k]], kit.place(room, (0.0, 0.0, 0.0), axis))
        product.add("spoke", kit.place(spoke, (0.0, 0.0, 0.0), axis))
    middle = (inner + outer) / 2.0
    for k in params["keys"]:
        a = math.radians(pitch * (k + 0.5))
        key, room = (
            kit.union(
                [
                    kit.box((-0.11 * thick - e, -0.4 * thick, low), (0.11 * thick + e, 0.4 * thick, high)),
                    *(
                        kit.cylinder(0.4 * thick + 2.0 * e, low, high, segments=12).translate((0.0, y, 0.0))
                        for y in ends
                    ),
                ]
            )
            .rotate((0.0, 0.0, math.degrees(a)))
            .translate((middle * math.cos(a), middle * math.sin(a), 0.0))
            for e, high in ((0.0, level + half), (gap / 2.0, level + half + 5.0))
            for low, ends in ((level + 0.45 * half, (-0.45 * thick, 0.45 * thick)),)
        )
        product.cut([names[k], names[(k + 1) % n]], room)
        product.add("key", key)
    if not params["tyre"]:
        return
    web, gap = 3.0 + kit.METRIC[s][2], clearance(min(2.0 * outer, 120.0), params["fit"])
    tyre = kit.tube(2.0 * (outer + web), 2.0 * outer + gap, level - half, level + half, segments=8 * n)
    if params["flange"]:
        lip = kit.tube(2.0 * (outer + web), 2.0 * outer - 6.0, level - half - 3.0, level - half, segments=8 * n)
        tyre += lip
    tyre = product.add("tyre", tyre)
    for k in params["tyre_screws"]:
        a = math.radians(pitch * (k + 0.25))
        axis = (math.cos(a), math.sin(a), 0.0)
        seat = (outer + web) * math.cos(math.pi / (8 * n)) - kit.METRIC[s][2] - 0.3
        origin = (seat * axis[0], seat * axis[1], level)
        length = seat - outer + 0.5 * thick
        kit.fasten(product, [tyre, names[k]], s, length, origin, axis, clearance=clearance(s, params["fit"]), reach=9.0)


def _axle(
    product: Product, params: Mapping[str, Any], hubs: list[str], half: float, radii: tuple[float, float]
) -> None:
    """Add the axle from below, washer, nut and cotter above the hub, and the cap over them."""
    a, s, (cup, flange) = params["axle"], params["screw"], radii
    gap, height, thin = clearance(a, params["fit"]), kit.METRIC[a][3], 1.5
    top = half + thin + height
    axle = kit.cylinder(a, -half - params["stub"], top + 2.0) + kit.cylinder(2.0 * a, -half - 4.0, -half)
    product.cut(hubs, kit.cylinder(a + gap, -half - 1.0, half + 1.0))
    product.add("axle", axle)
    product.add("washer", kit.tube(2.0 * (cup - 1.5), a + gap, half, half + thin))
    nut = kit.hexagon(kit.METRIC[a][1], half + thin, top) - kit.cylinder(a + gap, half, top + 1.0)
    nut = product.add("nut", nut)
    turn = math.radians(params["cotter"])
    axis, pin = (math.cos(turn), math.sin(turn), 0.0), 2.0 * (cup - 1.0)
    origin = (axis[0] * pin / 2.0, axis[1] * pin / 2.0, half + thin + 0.5 * height)
    kit.peg(
        product, [nut, "axle"], 0.3 * a, pin, origin, axis, clearance=clearance(0.3 * a, params["fit"]), part="cotter"
    )
    if not params["cap"]:
        return
    sunk = 0.6 * kit.METRIC[s][0] * math.sin(math.radians(params["tilt"]))
    plate = 2.0 + 2.0 * sunk
    cap = kit.cylinder(2.0 * cup + 3.0, half, top + 4.5) + kit.cylinder(2.0 * flange, half, half + plate)
    cap = product.add("cap", cap - kit.cylinder(2.0 * cup, half - 1.0, top + 3.0))
    tilt, reach = math.radians(params["tilt"]), cup + 1.5 + 0.65 * kit.METRIC[s][0]
    for x, y in kit.on_circle(params["cap_screws"], 2.0, phase=15.0):
        axis = (x * math.sin(tilt), y * math.sin(tilt), math.cos(tilt))
        origin = (x * reach, y * reach, half + plate - sunk)
        kit.fasten(product, [cap, *hubs[:1]], s, plate + 2.5 * s, origin, axis, clearance=clearance(s, params["fit"]))


FAMILY = Family(
    name="wheel_hub",
    version=2,
    summary="spokes under rim segments under a screwed tyre; the nut's cotter and a cap hold the axle",
    draw=draw,
    build=build,
)
