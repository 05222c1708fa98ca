"""Plates clamped by bolts: from above, through with nuts below, or from both sides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one stack of plates."""
    pick = kit.Draw(rng)
    size = pick.choice((3.0, 4.0, 5.0, 6.0))
    plates = [pick.length(3.0, 9.0) for _ in range(pick.count(2, 5))]
    return {
        "plates": plates,
        "length": pick.length(9.0 * size, 16.0 * size),
        "width": pick.length(8.0 * size, 12.0 * size),
        "round": pick.chance(0.3),
        "corner": pick.choice((0.0, 2.0, 4.0)),
        "opening": pick.choice((0.0, 0.3, 0.5)),
        "size": size,
        "fit": pick.choice(("H11/c11", "H9/d9", "exact")),
        "head": pick.choice(("cap", "hex", "countersunk")),
        "bolts": [
            {"kind": pick.choice(("blind", "nut", "below")), "plate": pick.count(0, len(plates) - 2)}
            for _ in range(pick.count(2, 6))
        ],
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the stack: plates upwards from z = 0, bolts around the rim."""
    product, size = Product(), params["size"]
    gap, bolts = clearance(size, params["fit"]), params["bolts"]
    bottoms, z, names = [], 0.0, []
    for thickness in params["plates"]:
        if params["round"]:
            solid = kit.cylinder(params["width"], z, z + thickness, segments=48)
        else:
            solid = kit.plate(params["length"], params["width"], z, z + thickness, radius=params["corner"])
        if params["opening"]:
            solid -= kit.cylinder(params["opening"] * params["width"], z - 1.0, z + thickness + 1.0)
        bottoms.append(z)
        names.append(product.add("plate", solid))
        z += thickness
    rim = params["width"] - 3.0 * size
    inset = 1.8 * size
    places = (
        kit.on_circle(len(bolts), rim)
        if params["round"]
        else [
            *kit.corners(params["length"], params["width"], inset),
            (0.0, params["width"] / 2.0 - inset),
            (0.0, inset - params["width"] / 2.0),
        ]
    )
    for (x, y), choice in zip(places, bolts, strict=False):
        lowest = choice["plate"]
        end = bottoms[lowest] + 0.4 * params["plates"][lowest]
        if choice["kind"] == "below":
            axis, origin, length = (0.0, 0.0, -1.0), (x, y, 0.0), z - 0.4 * params["plates"][-1]
            through = names
        elif choice["kind"] == "nut":
            axis, origin, length = (0.0, 0.0, 1.0), (x, y, z), z + kit.METRIC[size][3] + 0.5
            through = names
        else:
            axis, origin, length = (0.0, 0.0, 1.0), (x, y, z), z - end
            through = names[lowest:]
        room = kit.bolt_room(size, length, clearance=gap, head=params["head"])
        product.cut(through, kit.place(room, origin, axis))
        product.add("bolt", kit.place(kit.bolt(size, length, head=params["head"]), origin, axis))
        if choice["kind"] == "nut":
            product.add("nut", kit.place(kit.nut(size, clearance=gap), (x, y, 0.0), (0.0, 0.0, -1.0)))
    return product


FAMILY = Family(
    name="bolted_plates",
    version=2,
    summary="plates under bolts from either side: a bolt put in early shuts out the plates below its head",
    draw=draw,
    build=build,
)
