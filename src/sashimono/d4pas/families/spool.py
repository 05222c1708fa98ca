"""Spools: coils on a core between flanges that radial pins hold, some of them hidden under a cup."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

ENDS = ("fixed", "pinned", "cupped")


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one spool."""
    pick = kit.Draw(rng)
    first = pick.choice(ENDS)
    return {
        "mandrel": pick.choice((0.0, 16.0, 20.0), (0.4, 0.3, 0.3)),
        "bore": pick.length(12.0, 18.0, 1.0),
        "wall": pick.length(5.0, 7.0),
        "barrel": pick.length(5.0, 8.0),
        "coils": [pick.length(8.0, 20.0) for _ in range(pick.count(1, 4))],
        "depth": pick.length(6.0, 14.0),
        "rim": pick.length(3.0, 10.0),
        "flange": pick.length(7.0, 11.0),
        "ends": [first, pick.choice(ENDS[1:])],
        "pins": [pick.count(1, 3), pick.count(1, 3)],
        "pin": pick.choice((5.0, 6.0)),
        "phases": [pick.length(0.0, 120.0, 1.0), pick.length(0.0, 120.0, 1.0)],
        "spacing": pick.choice((72.0, 90.0, 120.0)),
        "tilt": pick.choice((0.0, 0.0, 20.0, 35.0)),
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the spool, its axis along z."""
    product = Product()
    bore = params["mandrel"] or params["bore"]
    tube = bore + 2.0 * params["wall"]
    barrel = tube + 2.0 * params["barrel"]
    half = sum(params["coils"]) / 2.0
    end = half + params["flange"] + 17.0
    core = kit.cylinder(tube, -end, end) + kit.cylinder(barrel, -half, half)
    core = product.add("core", core - kit.cylinder(bore, -end - 1.0, end + 1.0))
    z = -half
    for length in params["coils"]:
        gap = clearance(barrel, params["fit"])
        product.add("coil", kit.tube(barrel + 2.0 * params["depth"], barrel + gap, z, z + length))
        z += length
    locked = [core]
    if params["mandrel"]:
        size = bore - clearance(bore, params["fit"])
        locked.append(product.add("mandrel", kit.cylinder(size, -end - 12.0, end + 12.0)))
    wide = barrel + 2.0 * params["depth"] + 2.0 * params["rim"]
    for side, kind in enumerate(params["ends"]):
        _end(product, params, kind, side, locked, (half, end, tube, wide))
    return product


def _end(
    product: Product,
    params: Mapping[str, Any],
    kind: str,
    side: int,
    locked: list[str],
    sizes: tuple[float, float, float, float],
) -> None:
    """Add a flange with its pins, and a cup over them; drawn at the upper end, turned over for the lower one."""
    half, end, tube, wide = sizes
    low, hub = half + params["flange"], tube + 16.0
    z, size = low + 8.5, params["pin"]

    def sided(solid: Manifold) -> Manifold:
        return solid.rotate((180.0, 0.0, 0.0)) if side == 0 else solid

    flange = kit.cylinder(wide, half, low, segments=32) + kit.cylinder(hub, half + 1.0, end)
    flange -= kit.cylinder(tube, half - 1.0, end + 1.0)
    if kind == "fixed":
        product.join(locked[0], sided(flange))
        return
    name = product.add("flange", sided(flange))
    apart = 0.55 * size / math.tan(math.radians(params["spacing"]) / 2.0)
    inner = tube / 2.0 - params["wall"] + 0.5 if len(locked) == 1 else max(apart, 0.2 * params["mandrel"])
    tilt = params["tilt"] if kind == "pinned" else 0.0
    for k in range(params["pins"][side]):
        pin, room = (
            kit.place(kit.cylinder(d, inner - 0.5 * tube, top, segments=12), (0.5 * tube, 0.0, z), (1.0, 0.0, 0.0))
            .translate((-0.5 * tube, 0.0, -z))
            .rotate((0.0, -tilt, 0.0))
            .translate((0.5 * tube, 0.0, z))
            .rotate((0.0, 0.0, params["phases"][side] + k * params["spacing"]))
            for d, top in ((size, 7.3 + (3.0 if tilt else 0.0)), (size + 0.06, 40.0))
        )
        product.cut((name, *locked), sided(room))
        product.add("pin", sided(pin))
    if kind == "cupped":
        cup = kit.cylinder(hub + 16.0, low, end + 6.0, segments=32) - kit.cylinder(hub, low - 1.0, end)
        cup = product.add("cup", sided(cup - kit.cylinder(tube - 1.0, low, end + 9.0)))
        angle = params["phases"][side] + params["spacing"] / 2.0
        screw, room = (
            kit.place(kit.cylinder(5.0 + d, hub / 2.0 - 5.0, top, segments=12), (0.0, 0.0, z), (1.0, 0.0, 0.0))
            for d, top in ((0.0, hub / 2.0 + 8.0), (0.06, hub))
        )
        product.cut((name, cup), sided(room.rotate((0.0, 0.0, angle))))
        product.add("screw", sided(screw.rotate((0.0, 0.0, angle))))


FAMILY = Family(
    name="spool",
    version=2,
    summary="coils leave over the end whose flange is off; radial and slanted pins, some under a cup, hold the flanges",
    draw=draw,
    build=build,
)
