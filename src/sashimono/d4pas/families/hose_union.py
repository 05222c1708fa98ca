"""Hose unions: tails in the oblique ports of a flat manifold, held by pins across their grooves; nuts, hoses, seals."""

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
    """Return the parameters of one manifold."""
    pick = kit.Draw(rng)
    count = pick.count(2, 5)
    step = 360.0 / count
    return {
        "tail": pick.length(11.0, 14.0),
        "fit": pick.choice(("H9/d9", "H8/f7", "exact")),
        "ports": [
            {
                "angle": round(k * step + pick.length(-0.16 * step, 0.16 * step, 1.0), 3),
                "held": pick.choice(("pin", "cross", "none"), (5, 4, 1)),
                "below": pick.chance(0.4),
                "seal": pick.chance(0.6),
                "nut": pick.chance(0.7),
                "hose": pick.choice(("hose", "cap", "none"), (3, 2, 1)),
                "clamp": count < 5 and pick.chance(0.4),
                "length": pick.length(26.0, 34.0),
            }
            for k in range(count)
        ],
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the manifold in the plane z = 0 and what is in its ports."""
    product, tail = Product(), params["tail"]
    count = len(params["ports"])
    thick, reach = tail + 12.0, max(0.62 * (tail + 16.0) / math.tan(0.68 * math.pi / count), 6.0) + 22.0
    block = [kit.cylinder(2.0 * (reach - 22.0) + 6.0, -thick / 2.0, thick / 2.0)]
    for port in params["ports"]:
        arm = kit.box((0.0, -tail / 2.0 - 8.0, -thick / 2.0), (reach, tail / 2.0 + 8.0, thick / 2.0))
        block.append(arm.rotate((0.0, 0.0, port["angle"])))
    product.add("manifold", kit.union(block))
    for port in params["ports"]:
        angle = math.radians(port["angle"])
        _add_port(product, params, port, (reach, thick, (math.cos(angle), math.sin(angle), 0.0)))
    return product


def _add_port(product: Product, params: Mapping[str, Any], port: Mapping[str, Any], where: Any) -> None:
    """Add one tail and what is on it; z = 0 is the face of the manifold, z points outwards."""
    (reach, thick, axis), tail = where, params["tail"]
    gap, depth = clearance(tail, params["fit"]), 18.0
    end = tuple(reach * value for value in axis)

    def at(solid: Manifold) -> Manifold:
        return kit.place(solid, end, axis)

    bore = kit.cylinder(tail + gap, -depth, 1.0)
    seal = 3.0 if port["seal"] else 0.0
    solid = kit.cylinder(tail, seal - depth, port["length"]) + kit.cylinder(tail + 5.0, 0.0, 4.0)
    product.cut(["manifold"], at(bore))
    if seal:
        product.add("seal", at(kit.tube(tail - gap, 0.5 * tail, -depth, seal - depth)))
    through = kit.cylinder(0.25 * tail, -depth - 1.0, 0.0 if port["hose"] == "cap" else 99.0)
    if port["held"] == "pin":
        solid -= kit.tube(tail + 4.0, tail - 6.0, -11.0, -6.0)
    name = product.add("tail", at(solid - through))
    sign = -1.0 if port["below"] else 1.0
    if port["held"] in ("pin", "cross"):
        # across the groove, or right through tail and manifold
        side = tail / 2.0 - 0.3 if port["held"] == "pin" else 0.0
        size = 5.0 if port["held"] == "pin" else 4.0
        base = (end[0] - 8.5 * axis[0] - side * axis[1], end[1] - 8.5 * axis[1] + side * axis[0], 0.0)
        hole = kit.cylinder(size, -thick / 2.0 + 3.0, thick / 2.0 + 1.0, segments=16)
        pin = kit.cylinder(size, -thick / 2.0 + 3.0, thick / 2.0 + 3.0, segments=16)
        pin += kit.cylinder(size + 3.0, thick / 2.0, thick / 2.0 + 3.0, segments=16)
        product.cut(["manifold"], kit.place(hole, base, (0.0, 0.0, sign)))
        if port["held"] == "cross":
            product.cut([name], kit.place(hole, base, (0.0, 0.0, sign)))
        product.add("pin", kit.place(pin, base, (0.0, 0.0, sign)))
    _add_end(product, params, port, (name, end, axis))


def _add_end(product: Product, params: Mapping[str, Any], port: Mapping[str, Any], where: Any) -> None:
    """Add what is on a tail outside: nut, and hose with clamp, or cap with set screw."""
    (name, end, axis), tail = where, params["tail"]
    gap = clearance(tail, params["fit"])

    def at(solid: Manifold) -> Manifold:
        return kit.place(solid, end, axis)

    z = 4.0
    if port["nut"]:
        product.add("nut", at(kit.hexagon(tail + 8.0, z, z + 7.0) - kit.cylinder(tail + gap, 0.0, 99.0)))
        z += 7.0
    if port["hose"] == "hose":
        product.add("hose", at(kit.tube(tail + 6.0, tail + gap, z, port["length"] + 14.0)))
        if port["clamp"]:
            low, wide = z + 3.0, tail / 2.0 + 3.0
            clamp = kit.cylinder(tail + 12.0, low, low + 8.0)
            clamp += kit.box((0.0, -7.0, low), (wide + 12.0, 7.0, low + 8.0))
            clamp -= kit.cylinder(tail + 6.0, 0.0, 99.0) + kit.box((0.0, -1.0, low - 1.0), (99.0, 1.0, low + 9.0))
            clamp_name = product.add("clamp", at(clamp))
            centre = (wide + 7.5, 7.0, low + 4.0)
            across = (0.0, 1.0, 0.0)
            product.cut([clamp_name], at(kit.place(kit.cylinder(4.0, -20.0, 1.0, segments=12), centre, across)))
            product.add("screw", at(kit.place(kit.bolt(4.0, 14.0), centre, across)))
    elif port["hose"] == "cap":
        cap = kit.cylinder(tail + 6.0, z, port["length"] + 4.0)
        cap_name = product.add("cap", at(cap - kit.cylinder(tail + gap, 0.0, port["length"])))
        centre = (0.0, 0.0, z + 7.0)
        across = (math.cos(0.6), math.sin(0.6), 0.0)
        hole = kit.place(kit.cylinder(5.0, 0.1 * tail, 30.0, segments=12), centre, across)
        product.cut([cap_name, name], at(hole))
        product.add(
            "set_screw", at(kit.place(kit.cylinder(5.0, 0.1 * tail, 0.5 * tail + 4.0, segments=12), centre, across))
        )


FAMILY = Family(
    name="hose_union",
    version=2,
    summary="tails in oblique ports behind pins across their grooves; nuts shut in by hoses",
    draw=draw,
    build=build,
)
