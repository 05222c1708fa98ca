"""Shafts in a row, coupled by pinned sleeves, jaw hubs with spiders, or split shells around collars."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one row of shafts."""
    pick = kit.Draw(rng)
    return {
        "shaft": pick.length(14.0, 18.0),
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
        "length": pick.length(10.0, 25.0),
        "couplings": [
            {
                "kind": pick.choice(("sleeve", "jaw", "split"), (3, 3, 2)),
                "angles": [pick.length(0.0, 180.0, 1.0) for _ in range(2)],
                "tilts": [pick.choice((90.0, 90.0, 75.0, 65.0)) for _ in range(2)],
                "keys": [pick.chance(0.3), False],
                "held": [pick.choice(("pin", "pin", "screw")) for _ in range(2)],
                "bolts": pick.choice((1, 2)),
                "stop": pick.chance(0.5),
            }
            for _ in range(pick.count(1, 3))
        ],
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the shafts along z and a coupling at each meeting of two."""
    product, d, couplings = Product(), params["shaft"], params["couplings"]
    half, z = 28.0, 0.0
    pitch = 2.0 * half + params["length"]
    names = []
    for k in range(len(couplings) + 1):
        low = z - (0.0 if k else half + params["length"])
        z = z + (pitch if 0 < k < len(couplings) else 0.0)
        names.append(
            product.add("shaft", kit.cylinder(d, low, z + (0.0 if k < len(couplings) else half + params["length"])))
        )
    for k, coupling in enumerate(couplings):
        _add_coupling(product, params, coupling, (names[k], names[k + 1], k * pitch))
    return product


def _add_coupling(product: Product, params: Mapping[str, Any], coupling: Mapping[str, Any], where: Any) -> None:
    """Add what joins two shafts that meet at a height."""
    first, second, z = where
    d, gap = params["shaft"], clearance(params["shaft"], params["fit"])
    is_jaw = coupling["kind"] == "jaw"
    outer, middle = (d + 22.0, 16.0) if is_jaw else (d + 14.0, 13.0)
    if coupling["kind"] == "split":
        _add_shells(product, params, coupling, where)
        return
    bore = kit.cylinder(d + gap, z - 99.0, z + 99.0)
    if coupling["kind"] == "sleeve":
        name = product.add("sleeve", kit.cylinder(outer, z - 20.0, z + 20.0) - bore)
        hubs = (name, name)
    else:
        hubs = _add_jaws(product, (outer, d + gap, z), 15.0 * round(coupling["angles"][0] / 15.0))
    for sign, shaft, hub, angle, tilt, key, held in zip(
        (-1.0, 1.0),
        (first, second),
        hubs,
        coupling["angles"],
        coupling["tilts"],
        coupling["keys"],
        coupling["held"],
        strict=True,
    ):
        turn = math.radians(angle)
        polar = math.radians(90.0 if held == "screw" else max(tilt, 75.0) if is_jaw else tilt)
        axis = (math.sin(polar) * math.cos(turn), math.sin(polar) * math.sin(turn), math.cos(polar) * sign)
        at = (0.0, 0.0, z + sign * middle)
        if held == "pin":
            product.cut([shaft, hub], kit.place(kit.cylinder(5.0, -99.0, 99.0, segments=16), at, axis))
            pin = kit.cylinder(5.0, 1.5 - outer / 2.0, outer / 2.0 + 3.0, segments=16)
        else:
            product.cut([shaft, hub], kit.place(kit.cylinder(7.0, 1.0, 99.0, segments=16), at, axis))
            pin = kit.cylinder(7.0, 1.0, outer / 2.0 + 3.0, segments=16)
        product.add("pin" if held == "pin" else "set_screw", kit.place(pin, at, axis))
        if key:
            ends = (z + sign * (middle - 6.0), z + sign * (29.0 if is_jaw else 23.0))
            _add_key(product, (shaft, hub), (d, z + sign * middle, angle + 115.0), ends)


def _add_key(
    product: Product, names: tuple[str, str], where: tuple[float, float, float], ends: tuple[float, float]
) -> None:
    """Add a key, sunk in the shaft; the hub's keyway is open towards its outer end."""
    (d, z, angle), (shaft, hub) = where, names
    key = kit.box((d / 2.0 - 3.0, -2.5, z - 6.0), (d / 2.0 + 2.5, 2.5, z + 6.0)).rotate((0.0, 0.0, angle))
    way = kit.box((0.0, -2.5, min(ends)), (d / 2.0 + 2.6, 2.5, max(ends))).rotate((0.0, 0.0, angle))
    product.cut([shaft], key)
    product.cut([hub], way)
    product.add("key", key)


def _add_jaws(product: Product, where: tuple[float, float, float], turn: float) -> tuple[str, str]:
    """Add two hubs with two jaws each and the spider between them; return the hubs' names."""
    outer, bore, z = where
    ring = kit.tube(outer, bore + 8.0, z - 6.0, z + 6.0)
    jaw = ring ^ kit.box((0.0, -5.5, z - 7.0), (outer, 5.5, z + 7.0))
    spider, names = kit.tube(outer, bore + 1.0, z - 6.0, z + 6.0), []
    for sign in (-1.0, 1.0):
        hub = kit.tube(outer, bore, *sorted((z + sign * 26.0, z + sign * 5.0)))
        hub -= kit.box((-99.0, -99.0, z - 6.0), (99.0, 99.0, z + 6.0))
        for side in (0.0, 180.0):
            teeth = jaw.rotate((0.0, 0.0, side + 45.0 + 45.0 * sign))
            hub += teeth
            wide = kit.tube(outer + 2.0, bore + 7.8, z - 7.0, z + 7.0) ^ kit.box(
                (0.0, -5.6, z - 8.0), (outer, 5.6, z + 8.0)
            )
            spider -= wide.rotate((0.0, 0.0, side + 45.0 + 45.0 * sign))
        names.append(product.add("hub", hub.rotate((0.0, 0.0, turn))))
    product.add("spider", spider.rotate((0.0, 0.0, turn)))
    return names[0], names[1]


def _add_shells(product: Product, params: Mapping[str, Any], coupling: Mapping[str, Any], where: Any) -> None:
    """Add two half shells around the shafts' collars, and the screws that clamp them."""
    first, second, z = where
    d, gap, turn = params["shaft"], clearance(params["shaft"], params["fit"]), params["couplings"][0]["angles"][0]
    rings = kit.tube(d + 8.0, d - 1.0, z - 12.0, z - 6.0), kit.tube(d + 8.0, d - 1.0, z + 6.0, z + 12.0)
    product.join(first, rings[0])
    product.join(second, rings[1])
    bore = kit.cylinder(d + gap, z - 99.0, z + 99.0)
    for low, high in ((z - 12.0, z - 6.0), (z + 6.0, z + 12.0)):
        bore += kit.cylinder(d + 8.0 + gap, low - gap / 2.0, high + gap / 2.0)
    shell = kit.box((-d / 2.0 - 17.0, 0.0, z - 18.0), (d / 2.0 + 17.0, d / 2.0 + 8.0, z + 18.0))
    lower = shell.rotate((0.0, 0.0, 180.0 + turn)) - bore
    upper = shell.rotate((0.0, 0.0, turn)) - bore
    names = [product.add("shell", lower), product.add("shell", upper)]
    heights = (z,) if coupling["bolts"] == 1 else (z - 9.0, z + 9.0)
    depth = d / 2.0 + 8.0
    for height in heights:
        for side, up in ((1.0, 1.0), (-1.0, -1.0 if coupling["stop"] else 1.0)):
            at = (side * (d / 2.0 + 10.5), up * depth, height)
            tool = kit.cylinder(7.1, -1.6 * depth, 1.0, segments=12)
            bolt = kit.cylinder(7.0, -1.6 * depth, 0.0, segments=12) + kit.cylinder(11.0, 0.0, 6.0, segments=16)
            product.cut(names, kit.place(tool, at, (0.0, up, 0.0)).rotate((0.0, 0.0, turn)))
            product.add("bolt", kit.place(bolt, at, (0.0, up, 0.0)).rotate((0.0, 0.0, turn)))


FAMILY = Family(
    name="shaft_coupling",
    version=2,
    summary="shafts in a row, cross pins and set screws at odd angles; keys and collars shut in by hubs and shells",
    draw=draw,
    build=build,
)
