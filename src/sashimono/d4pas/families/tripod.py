"""A tripod: splayed legs in oblique sockets under a hub, a column through it, a head on top."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

BOSS_WALL = 5.0
"""Wall of a boss round its leg [mm]."""
FACETS = 16
"""Facets of legs, column and what goes round them."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one tripod."""
    pick = kit.Draw(rng)
    legs = pick.choice((3, 4, 5), (6, 2, 1))
    spreader, cap = pick.chance(0.35), pick.chance(0.6)
    return {
        "legs": legs,
        "leg": pick.length(8.0, 14.0, 0.5),
        "column": pick.length(10.0, 18.0, 0.5),
        "splay": pick.choice((18.0, 23.0, 30.0, 37.0)),
        "reach": pick.length(50.0, 130.0),
        "extra": pick.length(0.0, 40.0),
        "rise": pick.length(3.0, 35.0) if cap or pick.chance(0.5) else 0.0,
        "plate": pick.length(40.0, 190.0, 1.0),
        "fit": pick.choice(("H9/d9", "H8/f7", "exact")),
        "locks": pick.choice(("screw", "pin", "mixed"), (4, 1, 1)),
        "twist": pick.choice((0.0, 30.0, 60.0, 90.0)),
        "elevation": pick.choice((0.0, 15.0, 30.0)),
        "slack": pick.choice((0.0, 0.02)),
        "spreader": spreader,
        "feet": "none" if spreader else pick.choice(("none", "plain", "pinned"), (1, 1, 2)),
        "foot_twist": pick.choice((0.0, 45.0, 90.0)),
        "cap": cap,
        "pin_azimuth": pick.choice((0.0, 17.0, 72.0)),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the tripod; leg k points at azimuth 360° · k / legs, the sockets end on z = 0."""
    product, gap = Product(), clearance(params["leg"], params["fit"])
    count, leg, column, splay = params["legs"], params["leg"], params["column"], math.radians(params["splay"])
    root = max(column / 2.0 + leg / 2.0 + 3.0, (leg + 3.0) / (2.0 * math.sin(math.pi / count)))
    boss = 2.1 * leg
    lock = leg / 2.0 * math.sin(splay) + 6.2
    top = lock + 11.5
    spread = boss * math.cos(splay) + (1.1 * leg + 18.0) / math.tan(splay) + 0.2 * params["reach"]
    length = (spread + 5.0) / math.cos(splay) + 2.0 * leg + params["extra"]
    neck = -(6.5 / math.tan(splay) + 2.0) if params["cap"] else -3.0
    hub = kit.cylinder(2.0 * root + leg + 6.0, -3.0, top) + kit.cylinder(column + 5.0, neck, 0.0, segments=FACETS)
    feet = [(root * math.cos(a), root * math.sin(a), 0.0) for a in (2.0 * math.pi * k / count for k in range(count))]
    axes = [_frame(2.0 * math.pi * k / count, splay) for k in range(count)]
    for origin, (axis, _, _) in zip(feet, axes, strict=True):
        hub += kit.place(kit.cylinder(leg + 2.0 * BOSS_WALL, -4.0, boss, segments=FACETS), origin, axis.tolist())
    hub -= kit.cylinder(column + gap, -200.0, top + 1.0, segments=FACETS)
    product.add("hub", hub)
    _column(product, params, top, neck)
    _lock_column(product, params, lock)
    if params["spreader"]:
        middle, width = 2.0 * (root + spread * math.tan(splay)), 1.2 * leg + 10.0
        disc = kit.tube(middle + width, middle - width, -spread - 4.0, -spread, segments=32)
        product.add("spreader", disc)
    for k, (origin, frame) in enumerate(zip(feet, axes, strict=True)):
        _leg(product, params, k, origin, frame, (boss, length))
    return product


def _frame(azimuth: float, splay: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a leg's axis (down and outwards), and across it the tangent and the way outwards and up."""
    outwards = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    tangent = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    axis = math.sin(splay) * outwards - math.cos(splay) * up
    return axis, tangent, math.cos(splay) * outwards + math.sin(splay) * up


def _across(frame: tuple[np.ndarray, np.ndarray, np.ndarray], twist: float) -> np.ndarray:
    """Return a direction across a leg, between the tangent (0°) and outwards (90°)."""
    angle = math.radians(twist)
    return math.cos(angle) * frame[1] + math.sin(angle) * frame[2]


def _pin(product: Product, name: str, parts: list[str], size: float, length: float, pose: tuple[Any, Any]) -> None:
    """Put a pin centred at a point through parts."""
    pin: Manifold = kit.place(kit.cylinder(size, -length / 2.0, length / 2.0, segments=12), *pose)
    product.cut(parts, kit.place(kit.cylinder(size, -length / 2.0 - 1.0, length / 2.0 + 1.0, segments=12), *pose))
    product.add(name, pin)


def _column(product: Product, params: Mapping[str, Any], top: float, neck: float) -> None:
    """Add the column, the head on it, and the cap below the hub: each held by a pin across."""
    column, gap = params["column"], clearance(params["column"], params["fit"])
    low = neck - 10.0
    shoulder = top + params["rise"]
    high = shoulder + 12.0
    solid = kit.cylinder(column, low, high, segments=FACETS)
    if params["rise"]:
        solid += kit.cylinder(column + 8.0, top, shoulder, segments=FACETS)
    product.add("column", solid)
    azimuth = math.radians(params["pin_azimuth"])
    across = (math.cos(azimuth), math.sin(azimuth), 0.0)
    head = kit.cylinder(params["plate"], high, high + 5.0)
    head += kit.cylinder(column + 10.0, shoulder, high + 1.0, segments=FACETS)
    product.add("head", head - kit.cylinder(column + gap, shoulder - 1.0, high, segments=FACETS))
    _pin(product, "pin", ["head", "column"], 3.0, column + 11.0, ((0.0, 0.0, high - 6.0), across))
    if params["cap"]:
        cap = kit.cylinder(column + 5.0, low - 4.0, neck, segments=FACETS)
        product.add("cap", cap - kit.cylinder(column + gap, low, neck + 1.0, segments=FACETS))
        between = math.pi / params["legs"]  # else the pin runs into a boss
        across = (math.cos(between), math.sin(between), 0.0)
        _pin(product, "pin", ["cap", "column"], 2.0, column + 6.0, ((0.0, 0.0, neck - 5.0), across))


def _lock_column(product: Product, params: Mapping[str, Any], height: float) -> None:
    """Add the screw that holds the column in the hub, between two legs."""
    azimuth, elevation = math.pi / params["legs"], math.radians(params["elevation"])
    outwards = (math.cos(azimuth), math.sin(azimuth))
    axis = (math.cos(elevation) * outwards[0], math.cos(elevation) * outwards[1], math.sin(elevation))
    reach = params["column"] / 2.0
    seat = np.array((reach * outwards[0], reach * outwards[1], height)) + 7.0 * np.array(axis)
    length = 7.0 + 0.5 * params["column"]
    product.cut(
        ["hub", "column"], kit.place(kit.bolt_room(5.0, length + 0.4, clearance=params["slack"]), seat.tolist(), axis)
    )
    product.add("screw", kit.place(kit.bolt(5.0, length), seat.tolist(), axis))


def _leg(
    product: Product,
    params: Mapping[str, Any],
    number: int,
    origin: tuple[float, float, float],
    frame: tuple[np.ndarray, np.ndarray, np.ndarray],
    lengths: tuple[float, float],
) -> None:
    """Add a leg in its socket, what locks it there, and its foot."""
    leg, gap, (boss, length) = params["leg"], clearance(params["leg"], params["fit"]), lengths
    around = ["hub", "spreader"] if params["spreader"] else ["hub"]
    product.cut(
        around, kit.place(kit.cylinder(leg + gap, 0.0, length + 1.0, segments=FACETS), origin, frame[0].tolist())
    )
    name = product.add("leg", kit.place(kit.cylinder(leg, 0.0, length, segments=FACETS), origin, frame[0].tolist()))
    locked = np.array(origin) + 0.6 * boss * frame[0]
    across = _across(frame, params["twist"])
    if params["locks"] == "pin" or (params["locks"] == "mixed" and number % 2):
        _pin(product, "pin", ["hub", name], 2.5, leg + 2.0 * BOSS_WALL + 1.0, (locked, across))
    else:
        size = 3.0 if leg < 10.0 else 4.0
        seat = locked + (leg / 2.0 + 3.0) * across
        length_in = 3.0 + 0.5 * leg
        product.cut(
            ["hub", name],
            kit.place(kit.bolt_room(size, length_in + 0.4, clearance=params["slack"]), seat.tolist(), across.tolist()),
        )
        product.add("screw", kit.place(kit.bolt(size, length_in), seat.tolist(), across.tolist()))
    if params["feet"] == "none":
        return
    foot = kit.cylinder(1.4 * leg, length - 1.2 * leg, length + 0.4 * leg, top=1.8 * leg, segments=FACETS)
    foot -= kit.cylinder(leg + gap, length - 1.3 * leg, length, segments=FACETS)
    foot_name = product.add("foot", kit.place(foot, origin, frame[0].tolist()))
    if params["feet"] == "pinned":
        middle = np.array(origin) + (length - 0.6 * leg) * frame[0]
        pose = (middle, _across(frame, params["foot_twist"]))
        _pin(product, "pin", [foot_name, name], 2.0, 1.8 * leg, pose)


FAMILY = Family(
    name="tripod",
    version=2,
    summary="splayed legs that leave along their axes once an oblique screw is out; a column that leaves either way",
    draw=draw,
    build=build,
)
