"""A vise: a jaw on guide bars, drawn by a lead screw whose head carries a slanted handle, and bolted jaw plates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

FACETS = 16
"""Facets of bars, lead screw and handle."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one vise."""
    pick = kit.Draw(rng)
    plates = [pick.choice((0, 1, 2)), pick.choice((0, 2), (3, 1))]
    # the screws of a plate on the jaw that moves need room to leave, or nothing comes apart
    opening = pick.length(16.0, 30.0) if plates[1] else pick.choice((0.0, pick.length(4.0, 9.0)), (4, 1))
    return {
        "width": pick.length(60.0, 76.0),
        "jaw": pick.length(18.0, 26.0),
        "opening": opening,
        "screw": pick.length(12.0, 16.0, 0.5),
        "gap": pick.choice((0.0, 10.0), (3, 1)),
        "bars": pick.choice((0, 2), (1, 2)),
        "bar_locks": pick.choice(("set", "cross"), (2, 1)),
        "lock_tilt": pick.choice((0.0, 25.0, 40.0)),
        "handle": pick.choice((0.0, 17.0, 30.0, 45.0, 72.0)),
        "knobs": pick.choice((1, 2)),
        "retainer": pick.choice(("pin", "plate", "none"), (2, 2, 1)),
        "plates": plates,
        "plate_tilt": pick.choice((0.0, 12.0)),
        "fit": pick.choice(("H9/d9", "H7/g6", "exact")),
        "base": pick.choice(("none", "swivel"), (1, 1)),
        "swivel": pick.choice((0.0, 17.0, 30.0, 45.0)),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the vise: the fixed jaw's face on x = 0, the jaw that moves on its -x side, the screw along x."""
    product = Product()
    half, jaw, opening = params["width"] / 2.0, params["jaw"], params["opening"]
    plates = [8.0 if count else 0.0 for count in params["plates"]]
    face = -plates[0] - opening - plates[1]
    back = face - jaw
    bridge = back - params["gap"]
    front = bridge - 18.0
    body = kit.box((front, -half, 0.0), (jaw, half, 14.0))
    body += kit.box((0.0, -half, 13.0), (jaw, half, 58.0)) + kit.box((front, -half, 13.0), (bridge, half, 44.0))
    product.add("body", body)
    product.add("jaw", kit.box((back, -half, 14.0), (face, half, 58.0)))
    _plates(product, params, (0.0, face))
    _screw(product, params, (front, back))
    _bars(product, params, (front, jaw))
    if params["base"] == "swivel":
        _base(product, params, (front + jaw) / 2.0)
    return product


def _plates(product: Product, params: Mapping[str, Any], faces: tuple[float, float]) -> None:
    """Add the plates on both jaws, screwed on from between the jaws."""
    half, tilt = params["width"] / 2.0, math.radians(params["plate_tilt"])
    for x, sign, count, holder in zip(faces, (-1.0, 1.0), params["plates"], ("body", "jaw"), strict=True):
        if not count:
            continue
        low, high = sorted((x, x + 8.0 * sign))
        name = product.add("plate", kit.box((low, -half, 40.0), (high, half, 58.0)))
        for k in range(count):
            y = (k - (count - 1) / 2.0) * half
            axis = (sign * math.cos(tilt), 0.0, math.sin(tilt))
            origin = (x + 1.5 * sign, y, 48.0)
            kit.fasten(product, [name, holder], 5.0, 8.5, origin, axis, reach=20.0)


def _screw(product: Product, params: Mapping[str, Any], places: tuple[float, float]) -> None:
    """Add the lead screw through the bridge into the jaw, what keeps it there, and the handle through its head."""
    front, back = places
    size, high = params["screw"], 30.0
    gap, tip = clearance(size, params["fit"]), back + 0.7 * params["jaw"]
    head = front - 6.0

    def along(diameter: float, start: float, end: float) -> Manifold:
        solid = kit.cylinder(diameter, start, end, segments=FACETS)
        return kit.place(solid, (0.0, 0.0, high), (1.0, 0.0, 0.0))

    screw = along(size, head - 20.0, tip) + along(size + 12.0, head - 24.0, head)
    product.cut(["body", "jaw"], along(size + gap, head, tip))
    name = product.add("spindle", screw)
    _handle(product, params, name, (head - 12.0, high))
    at = back + 0.4 * params["jaw"]
    if params["retainer"] == "pin":
        tilt = math.radians(params["lock_tilt"])
        axis = (0.0, math.sin(tilt), math.cos(tilt))
        origin = (at, 0.3 * size * axis[2] + 34.0 * axis[1], high - 0.3 * size * axis[1] + 34.0 * axis[2])
        kit.peg(product, ["jaw", name], 6.0, 34.0 + 0.5 * size, origin, axis, reach=20.0)
    elif params["retainer"] == "plate":
        # a fork in a groove of the screw, let into the back of the jaw from above
        wide = size + 10.0
        slot = kit.box((at - 3.0, -wide / 2.0, high - wide / 2.0), (at + 3.0, wide / 2.0, 70.0))
        product.cut(["jaw"], slot)
        groove = along(size + 2.0, at - 3.0, at + 3.0) - along(0.6 * size, at - 4.0, at + 4.0)
        product.cut([name], groove)
        fork = kit.box((at - 3.0, -wide / 2.0, high - wide / 2.0), (at + 3.0, wide / 2.0, 58.0))
        fork -= along(0.6 * size, at - 4.0, at + 4.0)
        fork -= kit.box((at - 4.0, -0.3 * size, 0.0), (at + 4.0, 0.3 * size, high))
        fork_name = product.add("fork", fork)
        kit.fasten(product, ["jaw", fork_name], 6.0, 0.4 * params["jaw"] + 2.0, (back, 0.0, 51.0), (-1.0, 0.0, 0.0))


def _handle(product: Product, params: Mapping[str, Any], screw: str, place: tuple[float, float]) -> None:
    """Add the handle through the screw's head, a knob on one end or on both."""
    turn = math.radians(params["handle"])
    axis, middle = (0.0, math.sin(turn), math.cos(turn)), (place[0], 0.0, place[1])
    length, knobs = 26.0, params["knobs"]
    product.cut([screw], kit.place(kit.cylinder(8.0, -40.0, 40.0, segments=FACETS), middle, axis))
    handle = kit.cylinder(8.0, -length, length, segments=FACETS)
    if knobs == 1:
        handle += kit.cylinder(16.0, -length - 10.0, -length, segments=FACETS)
    product.add("handle", kit.place(handle, middle, axis))
    for sign in (1.0, -1.0)[:knobs]:
        way = (0.0, sign * axis[1], sign * axis[2])
        # the bore keeps the handle's facets
        name = product.add("knob", kit.place(kit.cylinder(16.0, length - 8.0, length + 6.0), middle, way))
        product.cut([name], kit.place(kit.cylinder(8.0, -length, length, segments=FACETS), middle, axis))
        if sign > 0 and knobs == 2:
            cross = (1.0, 0.0, 0.0)
            origin = (middle[0] + 9.0, way[1] * (length - 4.0), place[1] + way[2] * (length - 4.0))
            kit.peg(product, [name, "handle"], 4.0, 18.0, origin, cross, reach=4.0)


def _bars(product: Product, params: Mapping[str, Any], places: tuple[float, float]) -> None:
    """Add the guide bars through the jaw, each held in the fixed jaw by a slanted screw or a pin across."""
    if not params["bars"]:
        return
    (front, jaw), half = places, params["width"] / 2.0
    gap, tilt = clearance(10.0, params["fit"]), math.radians(params["lock_tilt"])
    for sign in (1.0, -1.0):
        y, z = sign * (half - 10.0), 24.0
        hole = kit.place(
            kit.cylinder(10.0 + gap, front - 1.0, jaw - 5.0, segments=FACETS), (0.0, y, z), (1.0, 0.0, 0.0)
        )
        product.cut(["body", "jaw"], hole)
        bar = kit.place(kit.cylinder(10.0, front, jaw - 5.0, segments=FACETS), (0.0, y, z), (1.0, 0.0, 0.0))
        name = product.add("bar", bar)
        if params["bar_locks"] == "set":
            axis = (0.0, sign * math.cos(tilt), math.sin(tilt))
            origin = (0.5 * jaw - 1.0, y + 9.0 * axis[1], z + 9.0 * axis[2])
            kit.fasten(product, ["body", name], 5.0, 10.0, origin, axis, reach=30.0)
        else:
            axis = (math.sin(0.4 * tilt), 0.0, -math.cos(0.4 * tilt))
            kit.peg(product, ["body", name], 5.0, 24.0, (0.4 * jaw, y, 1.5), axis, reach=4.0)


def _base(product: Product, params: Mapping[str, Any], middle: float) -> None:
    """Add a round base below, screwed to the body from below at an angle to the vise."""
    base = product.add(
        "base", kit.cylinder(params["width"] - 4.0, -14.0, 0.0, segments=32).translate((middle, 0.0, 0.0))
    )
    for x, y in kit.on_circle(2, 0.5 * params["width"], phase=params["swivel"]):
        kit.fasten(product, [base, "body"], 6.0, 16.0, (middle + x, y, -7.0), (0.0, 0.0, -1.0), reach=20.0)


FAMILY = Family(
    name="vise",
    version=2,
    summary="knob, handle, lead screw and jaw in a chain; closed jaws hide the screws of their plates",
    draw=draw,
    build=build,
)
