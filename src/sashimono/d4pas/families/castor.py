"""Castors: a wheel in a fork on a slanted king pin whose nut or head only the missing wheel lets go."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

HUB = 3.0
"""How far the wheel's hub stands out to the legs."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one castor."""
    pick = kit.Draw(rng)
    return {
        "wheel": pick.length(45.0, 90.0, 1.0),
        "width": pick.length(24.0, 34.0),
        "rim": pick.choice((0.0, 3.0, 5.0)),
        "holes": pick.choice((0, 3, 5)),
        "axle": pick.choice((8.0, 10.0, 12.0)),
        "leg": pick.length(8.0, 11.0),
        "pin": pick.choice((8.0, 10.0, 12.0)),
        "crown": pick.length(20.0, 24.0),
        "trail": pick.length(4.0, 16.0),
        "camber": pick.choice((0.0, 4.0), (0.9, 0.1)),
        "plate": pick.length(7.0, 10.0),
        "mount": pick.choice(("below", "above", "socket")),
        "stop": pick.choice(("nut", "pin", "clip"), (0.1, 0.4, 0.5)),
        "angle": pick.choice((15.0, 30.0, 60.0, 75.0)),
        "split": pick.chance(0.08),
        "race": pick.chance(0.5),
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the castor; its king pin stands along z, the axle leans by the camber."""
    product = Product()
    room = kit.METRIC[params["pin"]][3] - 4.5
    crown = params["wheel"] / 2.0 + room
    _fork(product, params, crown)
    _axle(product, params)
    _king_pin(product, params, crown)
    for name, solid in product.solids.items():
        product.solids[name] = solid.rotate((params["camber"], 0.0, 0.0))
    return product


def _fork(product: Product, params: Mapping[str, Any], crown: float) -> None:
    """Add fork, or fork and leg under screws, and the wheel between its legs."""
    inner = params["width"] / 2.0 + HUB
    outer, high, wide = inner + params["leg"], crown + params["crown"] + 20.0, 1.2 * params["axle"]
    foot = -1.2 * params["axle"]
    front, back = wide, -params["trail"] - params["pin"] - 8.0
    leg = kit.box((-wide, inner, 0.0), (wide, outer, high))
    leg += kit.place(kit.cylinder(-2.0 * foot, inner, outer), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    bridge = kit.box((back, -inner - 1.0, crown), (front, inner, high))
    fork = bridge + leg.mirror((0.0, 1.0, 0.0))
    if params["split"]:
        leg = product.add("leg", leg)
        fork = product.add("fork", fork)
        depth = min(8.0, inner - params["pin"] / 2.0 - 3.0)
        for x in (-0.5 * wide, 0.5 * wide):
            origin, length = (x, outer, crown + 11.0), params["leg"] + depth
            product.cut((leg, fork), kit.place(kit.bolt_room(5.0, length, clearance=0.04), origin, (0.0, 1.0, 0.0)))
            product.add("screw", kit.place(kit.bolt(5.0, length), origin, (0.0, 1.0, 0.0)))
    else:
        leg = fork = product.add("fork", fork + leg + kit.box((back, inner - 1.0, crown), (front, outer, high)))
    _trim(product, params, {leg, fork}, crown)
    half = params["width"] / 2.0
    bore = params["axle"] + clearance(params["axle"], params["fit"])
    wheel = kit.cylinder(params["wheel"], -half, half, segments=32) + kit.cylinder(2.0 * params["axle"], -inner, inner)
    if params["rim"]:
        for side in (-1.0, 1.0):
            ring = kit.tube(0.78 * params["wheel"], 2.4 * params["axle"], half - params["rim"], half + 1.0)
            wheel -= ring if side > 0.0 else ring.mirror((0.0, 0.0, 1.0))
    for x, y in kit.on_circle(params["holes"], 0.5 * params["wheel"] + params["axle"]) if params["holes"] else ():
        wheel -= kit.cylinder(0.12 * params["wheel"], -half - 1.0, half + 1.0, segments=12).translate((x, y, 0.0))
    wheel -= kit.cylinder(bore, -inner - 1.0, inner + 1.0)
    product.add("wheel", kit.place(wheel, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    hole = kit.cylinder(bore, -outer - 1.0, outer + 1.0)
    product.cut({leg, fork}, kit.place(hole, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


def _trim(product: Product, params: Mapping[str, Any], names: set[str], crown: float) -> None:
    """Cut the fork's top square to the king pin."""
    above = kit.box((-300.0, -300.0, 0.0), (300.0, 300.0, 200.0))
    product.cut(names, _on_pin(params, above, crown + params["crown"]))


def _on_pin(params: Mapping[str, Any], solid: Manifold, height: float) -> Manifold:
    """Return a solid drawn along z, put on the king pin's axis at a height in the fork's middle plane."""
    return solid.rotate((-params["camber"], 0.0, 0.0)).translate((-params["trail"], 0.0, height))


def _axle(product: Product, params: Mapping[str, Any]) -> None:
    """Add the axle through fork and wheel with what keeps it: a nut, a cross pin or a clip from the side."""
    size, stop = params["axle"], params["stop"]
    face = params["width"] / 2.0 + HUB + params["leg"]
    gap = clearance(size, params["fit"])
    past = kit.METRIC[size][3] + 1.0 if stop == "nut" else size + 4.0
    axle = kit.cylinder(size, -face - 1.0, face + past) + kit.cylinder(1.7 * size, -face - 0.6 * size, -face)
    if stop == "nut":
        keeper = kit.hexagon(kit.METRIC[size][1], face, face + kit.METRIC[size][3])
        keeper -= kit.cylinder(size + gap, face - 1.0, face + 30.0)
    elif stop == "pin":
        across = 0.4 * size
        middle = (0.0, 0.0, face + across / 2.0 + 0.1)
        keeper = kit.place(kit.cylinder(across, -1.1 * size, 1.1 * size, segments=12), middle, (1.0, 0.0, 0.0))
        hole = kit.place(kit.cylinder(across + 0.05, -2.0 * size, 2.0 * size, segments=12), middle, (1.0, 0.0, 0.0))
        keeper = keeper.rotate((0.0, 0.0, params["angle"]))
        axle -= hole.rotate((0.0, 0.0, params["angle"]))
    else:
        axle -= kit.tube(2.0 * size, 0.7 * size, face, face + 3.0)
        keeper = kit.clip(1.7 * size, 0.72 * size, face, face + 3.0).rotate((0.0, 0.0, params["angle"]))
    for name, solid in (("axle", axle), (stop, keeper)):
        product.add(name, kit.place(solid, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))


def _king_pin(product: Product, params: Mapping[str, Any], crown: float) -> None:
    """Add plate or socket on the fork, a race between them, and the pin; drawn with the fork's top at z = 0."""
    size, mount, thick = params["pin"], params["mount"], params["plate"]
    gap, seat = clearance(size, params["fit"]), 6.0 - params["crown"]
    height = 3.0 * size if mount == "socket" else thick
    _, flats, head, tall, _ = kit.METRIC[size]
    wide = params["width"] + 2.0 * params["leg"] + 20.0
    race = 5.0 if params["race"] else 0.0
    if mount == "socket":
        base = kit.cylinder(3.0 * size, race, race + height)
    else:
        base = kit.plate(wide, wide, race, race + height, radius=4.0)
        for x, y in kit.corners(wide, wide, 7.0):
            base -= kit.cylinder(6.0, race - 1.0, race + height + 1.0, segments=12).translate((x, y, 0.0))
    if race:
        ring = kit.tube(2.4 * size, size + gap, -2.0, race + 2.0)
        rooms = kit.cylinder(2.4 * size, -2.0, race + 2.0)
        base -= rooms
        product.cut(("fork",), _on_pin(params, rooms, crown + params["crown"]))
        product.add("race", _on_pin(params, ring, crown + params["crown"]))
    up = race + height
    hole = kit.cylinder(size + gap, -60.0, up - 4.0 if mount == "socket" else up + 1.0)
    under = kit.cylinder(1.2 * flats, -60.0, seat)
    if mount == "below":
        pin = kit.cylinder(size, seat - tall, up + 1.0) + kit.cylinder(1.7 * size, up, up + head)
        other = kit.hexagon(flats, seat - tall, seat) - kit.cylinder(size + gap, -90.0, 9.0)
    else:
        pin = kit.cylinder(size, seat - 1.0, up - 4.0 if mount == "socket" else up + tall + 1.0)
        pin += kit.cylinder(flats, seat - tall, seat)
        other = kit.hexagon(flats, up, up + tall) - kit.cylinder(size + gap, -90.0, 190.0)
    if mount == "socket":
        at = (0.0, 0.0, race + 0.5 * height)
        screw = kit.place(kit.cylinder(0.5 * size, 0.3 * size, 1.8 * size, segments=12), at, (1.0, 0.0, 0.0))
        slot = kit.place(kit.cylinder(0.5 * size + 0.05, 0.3 * size, 3.0 * size, segments=12), at, (1.0, 0.0, 0.0))
        slot, other = slot.rotate((0.0, 0.0, params["angle"])), screw.rotate((0.0, 0.0, params["angle"]))
        base, pin = base - slot, pin - slot
    level = crown + params["crown"]
    product.cut(("fork",), _on_pin(params, hole + under, level))
    names = ("socket" if mount == "socket" else "plate", "pin", "screw" if mount == "socket" else "nut")
    for name, solid in zip(names, (base - hole, pin, other), strict=True):
        product.add(name, _on_pin(params, solid, level))


FAMILY = Family(
    name="castor",
    version=2,
    summary="a keeper on the axle holds the wheel: the king pin's nut under the crown comes before the wheel",
    draw=draw,
    build=build,
)
