"""Planetary gears: a carrier with locked pins in a ring under grub screws, a clip below, a cover on top."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

SUN, PLANET = 12, 9
"""Teeth; the ring has as many as the sun and two planets."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one planetary gear."""
    pick = kit.Draw(rng)
    return {
        "module": pick.choice((2.0, 2.5, 3.0)),
        "planets": pick.choice((2, 3), (0.3, 0.7)),
        "face": pick.length(14.0, 17.0),
        "plate": pick.length(9.0, 12.0),
        "phase": pick.length(0.0, 60.0, 1.0),
        "wall": pick.length(8.0, 11.0),
        "ring": pick.length(7.0, 10.0),
        "grubs": pick.count(1, 2),
        "clip": pick.choice((15.0, 30.0, 60.0, 105.0, 150.0)),
        "locked": pick.chance(0.93),
        "cover": pick.chance(0.5),
        "screws": pick.count(2, 3),
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the gear, its axis along z; the ring stands on the housing's floor at z = 0."""
    product, module, face = Product(), params["module"], params["face"]
    inner = (SUN + 2 * PLANET + 2.2) * module + 0.6
    outer = inner + 2.0 * params["ring"]
    plate = params["plate"]
    _housing(product, params, inner, outer)
    sizes = (plate + 0.5, plate + 0.5 + face)
    _carrier(product, params, sizes, inner - 2.0)
    _gears(product, params, sizes)
    if params["cover"]:
        _cover(product, params, outer + 2.0 * params["wall"], sizes[1])
    return product


def _radial(solid: Manifold, radius: float, angle: float, z: float) -> Manifold:
    """Return a solid drawn along z with its axis pointing outwards, its origin at this radius, angle and height."""
    return kit.place(solid, (radius, 0.0, z), (1.0, 0.0, 0.0)).rotate((0.0, 0.0, angle))


def _gear(params: Mapping[str, Any], teeth: int, z: tuple[float, float], phase: float, wider: float = 0.0) -> Manifold:
    return kit.spur_gear(teeth, params["module"] * (1.0 + wider), 0.0, *z, phase=phase)


def _housing(product: Product, params: Mapping[str, Any], inner: float, outer: float) -> None:
    """Add the housing with its floor and the ring in it, held by radial grub screws."""
    height = params["plate"] + 0.5 + params["face"]
    wide = outer + 2.0 * params["wall"]
    housing = kit.cylinder(wide, -12.0, height, segments=32) - kit.cylinder(outer, 0.0, height + 1.0, segments=32)
    shaft = _output(params)
    housing -= kit.cylinder(shaft + clearance(shaft, params["fit"]), -20.0, 5.0)
    z = (params["plate"] + 0.5, height)
    ring = kit.cylinder(outer, 0.0, height, segments=32) - kit.cylinder(inner, -1.0, z[0])
    teeth = SUN + 2 * PLANET
    # the tool's teeth cut the gaps: a little wider and turned both ways, they leave play
    for turn in (-0.6, 0.6):
        ring -= _gear(params, teeth, (z[0] - 1.0, height + 1.0), params["phase"] + turn, 0.012)
    product.add("housing", housing)
    product.add("ring", ring)
    for k in range(params["grubs"]):
        angle, deep = params["phase"] + 23.0 + 144.0 * k, outer / 2.0 - 0.6 * params["ring"]
        room = _radial(kit.cylinder(7.06, deep, wide, segments=12), 0.0, angle, 0.5 * params["plate"] + 1.0)
        product.cut(("housing", "ring"), room)
        grub = _radial(kit.cylinder(7.0, deep, wide / 2.0 + 1.0, segments=12), 0.0, angle, 0.5 * params["plate"] + 1.0)
        product.add("grub", grub)


def _output(params: Mapping[str, Any]) -> float:
    return 5.0 * params["module"]


def _carrier(product: Product, params: Mapping[str, Any], z: tuple[float, float], wide: float) -> None:
    """Add the lower plate with its shaft and clip, the upper plate, and the pins that a lock pin each may hold."""
    module, plate, shaft = params["module"], params["plate"], _output(params)
    size, top = 3.4 * module, z[1] + 0.5 + plate
    lower = kit.cylinder(wide, 0.0, plate, segments=32) + kit.cylinder(shaft, -30.0, 1.0)
    lower -= kit.tube(2.0 * shaft, 0.55 * shaft, -18.0, -12.0)
    clip = kit.clip(1.8 * shaft, 0.57 * shaft, -18.0, -12.0).rotate((0.0, 0.0, params["clip"]))
    names = [
        product.add("carrier", lower),
        product.add("plate", kit.cylinder(wide, z[1] + 0.5, top, segments=32)),
    ]
    product.cut(names[1:], kit.cylinder(5.2 * module, z[1] - 1.0, top + 1.0))
    product.add("clip", clip)
    for k in range(params["planets"]):
        angle = params["phase"] + 360.0 * k / params["planets"]
        x, y = kit.on_circle(1, (SUN + PLANET) * module, phase=angle)[0]
        hole = kit.cylinder(size + clearance(size, params["fit"]), 3.0, top + 1.0).translate((x, y, 0.0))
        product.cut(names, hole)
        pin = product.add("pin", kit.cylinder(size, 3.0, top).translate((x, y, 0.0)))
        if params["locked"]:
            reach = (SUN + PLANET) * module / 2.0
            lock, room = (
                _radial(kit.cylinder(5.0 + d, reach, end, segments=12), 0.0, angle, z[1] + 0.5 + plate / 2.0)
                for d, end in ((0.0, wide / 2.0 - 0.3), (0.06, wide))
            )
            product.cut((pin, names[1]), room)
            product.add("lock", lock)


def _gears(product: Product, params: Mapping[str, Any], z: tuple[float, float]) -> None:
    """Add sun and planets; the sun's shaft goes up through the upper plate."""
    module, size = params["module"], 3.4 * params["module"]
    bore = size + clearance(size, params["fit"])
    sun = _gear(params, SUN, z, params["phase"])
    sun += kit.cylinder(5.0 * module, z[0], z[1] + params["plate"] + 40.0)
    product.add("sun", sun)
    for k in range(params["planets"]):
        angle = params["phase"] + 360.0 * k / params["planets"]
        x, y = kit.on_circle(1, (SUN + PLANET) * module, phase=angle)[0]
        planet = _gear(params, PLANET, z, angle + 180.0 + 180.0 / PLANET) - kit.cylinder(bore, 0.0, z[1] + 1.0)
        product.add("planet", planet.translate((x, y, 0.0)))


def _cover(product: Product, params: Mapping[str, Any], wide: float, height: float) -> None:
    """Add the cover: a cup over the upper plate, under radial screws into the housing."""
    top, hollow = height + params["plate"] + 3.0, wide - 2.0 * params["wall"] - 2.0 * params["ring"] + 2.0
    cover = kit.cylinder(wide + 26.0, height - 14.0, top + 8.0, segments=32)
    cover -= kit.cylinder(wide, height - 20.0, height, segments=32)
    cover -= kit.cylinder(hollow, height - 1.0, top, segments=32)
    cover -= kit.cylinder(5.4 * params["module"], top - 1.0, top + 20.0)
    product.add("cover", cover)
    reach = wide / 2.0 - params["wall"] + 1.0
    for k in range(params["screws"]):
        angle = params["phase"] + 47.0 + 360.0 * k / params["screws"]
        room = _radial(kit.cylinder(7.06, reach, wide, segments=12), 0.0, angle, height - 6.0)
        product.cut(("cover", "housing"), room)
        screw = kit.cylinder(7.0, reach, wide / 2.0 + 16.0, segments=12)
        product.add("screw", _radial(screw, 0.0, angle, height - 6.0))


FAMILY = Family(
    name="planetary",
    version=1,
    summary="pins wait for their lock pins, planets for plate and pins, the carrier for its clip, all under a cover",
    draw=draw,
    build=build,
)
