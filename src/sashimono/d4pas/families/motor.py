"""Electric motors: a keyed rotor on bearings between end bells, with radial brushes, fans, pulleys and a box."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

EXTRAS = ("brush", "fan", "pulley", "box")


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one motor."""
    pick = kit.Draw(rng)
    extras = pick.some(EXTRAS, pick.choice((1, 2, 3), (0.3, 0.5, 0.2)))
    return {
        "journal": pick.length(8.0, 12.0, 0.5),
        "half": pick.length(10.0, 18.0),
        "rotor": pick.length(12.0, 17.0),
        "wall": pick.length(13.0, 17.0),
        "bearing": pick.length(6.0, 9.0),
        "closed": pick.chance(0.4),
        "bolts": pick.choice((2, 3), (0.7, 0.3)),
        "size": pick.choice((5.0, 6.0, 8.0)),
        "phase": pick.length(0.0, 90.0, 1.0),
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
        "extras": extras,
        "brushes": pick.count(1, 2),
        "tilt": pick.choice((0.0, 17.0, 30.0)),
        "disc": pick.choice((0.5, 0.95)),
        "turns": [pick.length(-15.0, 15.0, 1.0) for _ in range(3)],
    }


@dataclass(frozen=True)
class Sizes:
    """Lengths that follow from the parameters: diameters, and heights along the axis."""

    journal: float
    middle: float
    bore: float
    body: float
    """Outer diameter of body and end bells."""
    low: float
    high: float
    """The body's end faces."""
    past: float
    """Height of a cover and a bolt's head on it."""


def build(params: Mapping[str, Any]) -> Product:
    """Return the motor, its shaft along z."""
    product, half = Product(), params["half"]
    middle = params["journal"] + 6.0
    bore = middle + 2.0 * params["rotor"] + 1.0
    s = Sizes(
        journal=params["journal"],
        middle=middle,
        bore=bore,
        body=bore + 2.0 * params["wall"],
        low=-half - 11.0 - params["bearing"],
        high=half + (22.0 if "brush" in params["extras"] else 9.0),
        past=6.5 + params["size"],
    )
    _rotor(product, params, s)
    _body(product, params, s)
    if "brush" in params["extras"]:
        _brushes(product, params, s)
    tail, nose = s.low - s.past, s.high + params["bearing"] - 1.0 + s.past
    if "fan" in params["extras"] and not params["closed"]:
        fan = kit.cylinder(s.journal + 14.0, tail - 13.0, tail)
        for k in range(5):
            blade = kit.box((s.journal / 2.0 + 2.0, -1.5, tail - 5.0), (0.45 * s.body, 1.5, tail))
            fan += blade.rotate((0.0, 0.0, 72.0 * k))
        _on_shaft(product, params, "fan", fan - kit.cylinder(s.journal, tail - 20.0, tail + 1.0), tail - 9.0, 0)
    if "pulley" in params["extras"]:
        wheel = kit.cylinder(params["disc"] * s.body, nose, nose + 10.0, segments=32)
        wheel += kit.cylinder(s.journal + 14.0, nose, nose + 18.0)
        wheel -= kit.cylinder(s.journal, nose - 1.0, nose + 20.0)
        _on_shaft(product, params, "pulley", wheel, nose + 14.0, 1)
    if "box" in params["extras"]:
        _box(product, params, s)
    return product


def _angle(params: Mapping[str, Any], index: int) -> float:
    """Return an angle between two bolts [degrees]: somewhere near the middle of a gap."""
    return params["phase"] + 120.0 * (index + 0.5) + params["turns"][index]


def _radial(solid: Manifold, radius: float, angle: float, z: float) -> Manifold:
    """Return a solid drawn along z with its axis pointing outwards, its origin at this radius, angle and height."""
    return kit.place(solid, (radius, 0.0, z), (1.0, 0.0, 0.0)).rotate((0.0, 0.0, angle))


def _rotor(product: Product, params: Mapping[str, Any], s: Sizes) -> None:
    """Add shaft, rotor against its collar, and bearings."""
    half, width = params["half"], params["bearing"]
    tail = s.low - (0.0 if params["closed"] else s.past + 14.0)
    nose = s.high + width + s.past + 20.0
    foot, head = s.low + width, s.high - 1.0
    j, m = s.journal / 2.0, s.middle / 2.0
    below = [(0.0, tail), (j, tail), (j, foot), (m + 3.0, foot), (m + 3.0, -half - 4.0), (m + 9.0, -half - 4.0)]
    above = [(m + 9.0, -half), (m, -half), (m, head), (j, head), (j, nose), (0.0, nose)]
    shaft = kit.revolve(below + above)
    core = kit.cylinder(s.bore - 1.0, -half, half, segments=32)
    if "brush" in params["extras"]:
        core += kit.cylinder(s.middle + 14.0, half, half + 14.0)
        core -= kit.tube(s.middle + 20.0, s.middle + 7.0, half + 4.0, half + 10.0)
    product.add("shaft", shaft)
    product.add("rotor", core - kit.cylinder(s.middle, -half - 1.0, half + 20.0))
    product.add("bearing", kit.tube(s.middle + 20.0, s.journal, s.low, foot))
    product.add("bearing", kit.tube(s.middle + 20.0, s.journal, head, head + width))


def _body(product: Product, params: Mapping[str, Any], s: Sizes) -> None:
    """Add the body, the bell on it, and a cover over either bearing under bolts."""
    width, size = params["bearing"], params["size"]
    body = kit.cylinder(s.body, s.low, s.high, segments=48)
    lip = kit.cylinder(s.middle + 6.4, s.low - 1.0, s.high + width)
    body -= kit.cylinder(s.bore, -params["half"] - 4.5, s.high + 1.0, segments=32)
    product.add("body", body - lip - kit.cylinder(s.middle + 20.0, s.low - 1.0, s.low + width))
    top = s.high + width - 1.0
    bell = kit.cylinder(s.body, s.high, top, segments=48) + kit.cylinder(
        s.bore, s.high - 7.0, s.high + 1.0, segments=32
    )
    product.add("bell", bell - lip - kit.cylinder(s.middle + 20.0, s.high - 1.0, top + 1.0))
    gap = clearance(size, params["fit"])
    spread = kit.on_circle(3, s.body - params["wall"], phase=params["phase"])[: params["bolts"]]
    for axis, face, names in ((1.0, top, ("body", "bell")), (-1.0, s.low, ("body",))):
        cover = kit.cylinder(s.body, 0.0, 6.0, segments=48)
        if axis > 0.0 or not params["closed"]:
            cover -= kit.cylinder(s.journal + 1.0, -1.0, 7.0)
        cover = product.add("cover", kit.place(cover, (0.0, 0.0, face), (0.0, 0.0, axis)))
        length = 6.0 + (width if axis > 0.0 else 0.0) + min(2.0 * size, 0.3 * (s.high - s.low))
        for x, y in spread:
            origin = (x, y, face + 6.0 * axis)
            room = kit.place(kit.bolt_room(size, length, clearance=gap), origin, (0.0, 0.0, axis))
            product.cut((cover, *names), room)
            product.add("bolt", kit.place(kit.bolt(size, length), origin, (0.0, 0.0, axis)))


def _brushes(product: Product, params: Mapping[str, Any], s: Sizes) -> None:
    """Add brushes that reach into the rotor's groove, each behind a plug."""
    z, tip, end = params["half"] + 7.0, s.middle / 2.0 + 3.6, s.body / 2.0
    for k in range(params["brushes"]):
        angle = _angle(params, k)
        bar = kit.box((tip, -3.0, z - 3.0), (end - 6.0, 3.0, z + 3.0)).rotate((0.0, 0.0, angle))
        plug = _radial(kit.cylinder(10.0, 0.0, 9.0, segments=16), end - 6.0, angle, z)
        boss = _radial(kit.cylinder(18.0, -8.0, 2.0, segments=16), end, angle, z)
        product.join("body", boss)
        slot = kit.box((tip, -3.0, z - 3.0), (end, 3.0, z + 3.0)).rotate((0.0, 0.0, angle))
        product.cut(("body",), slot + _radial(kit.cylinder(10.06, 0.0, 20.0, segments=16), end - 6.0, angle, z))
        product.add("brush", bar)
        product.add("plug", plug)


def _on_shaft(product: Product, params: Mapping[str, Any], name: str, solid: Manifold, z: float, index: int) -> None:
    """Add a wheel whose hub a radial grub screw holds on the shaft."""
    radius = params["journal"] / 2.0
    angle = _angle(params, index) + params["tilt"]
    room = _radial(kit.cylinder(6.06, 0.2 * radius, radius + 20.0, segments=12), 0.0, angle, z)
    product.add(name, solid)
    product.cut((name, "shaft"), room)
    product.add("grub", _radial(kit.cylinder(6.0, 0.2 * radius, radius + 7.0, segments=12), 0.0, angle, z))


def _box(product: Product, params: Mapping[str, Any], s: Sizes) -> None:
    """Add the terminal box: its dovetail slides along the body from below, where a cover shuts it in."""
    r, top = s.body / 2.0, 0.6 * s.high
    section = [(r - 8.0, -10.0), (r + 0.5, -5.0), (r + 0.5, 5.0), (r - 8.0, 10.0)]
    room = kit.prism(section, s.low - 5.0, top).rotate((0.0, 0.0, _angle(params, 2)))
    box = kit.prism(section, s.low, top) + kit.box((r + 0.4, -12.0, s.low + 4.0), (r + 14.0, 12.0, top + 6.0))
    box -= kit.box((r + 6.0, -7.0, s.low + 9.0), (r + 20.0, 7.0, top + 1.0))
    product.cut(("body",), room)
    product.add("box", box.rotate((0.0, 0.0, _angle(params, 2))))


FAMILY = Family(
    name="motor",
    version=2,
    summary="rotor, key and bearings shut in by end bells; brushes and grub screws at odd angles hold what looks free",
    draw=draw,
    build=build,
)
