"""Gearboxes of one or two stages: gears and shafts in a case, bearings under a lid, sensors over the gears' rims."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from manifold3d import Manifold

from sashimono.d4pas import kit
from sashimono.d4pas.fits import clearance
from sashimono.d4pas.product import Family, Product

MODULE, WALL, FLOOR = 3.0, 17.0, 15.0
"""Module of the gears, thickness of the case's walls and floor."""


def draw(rng: np.random.Generator) -> dict[str, Any]:
    """Return the parameters of one gearbox."""
    pick = kit.Draw(rng)
    stages = pick.choice((1, 2), (0.75, 0.25))
    return {
        "stages": stages,
        "pinions": [pick.count(8, 9) for _ in range(stages)],
        "wheels": [pick.count(10, 14) for _ in range(stages)],
        "bend": pick.length(100.0, 180.0, 5.0),
        "face": pick.length(9.0, 13.0),
        "journal": pick.choice((8.0, 8.5, 9.0)),
        "bearing": pick.length(6.0, 8.0),
        "bush": pick.chance(0.6),
        "bolts": pick.choice((2, 3, 4)),
        "screws": pick.count(1, 2),
        "dowels": pick.count(0, 2),
        "sensor": pick.chance(0.6),
        "azimuth": pick.choice((-20.0, -12.0, 12.0, 20.0)),
        "coupling": pick.chance(0.4),
        "angle": pick.choice((25.0, 40.0, 65.0, 110.0)),
        "fit": pick.choice(("H8/f7", "H7/g6", "H7/h6", "exact")),
    }


def build(params: Mapping[str, Any]) -> Product:
    """Return the gearbox: shafts along z, the case's floor up to z = 0, the wheels' levels above it."""
    product, face, stages = Product(), params["face"], params["stages"]
    wheels, pinions = list(params["wheels"]), params["pinions"]
    if stages == 2:  # each shaft stands clear of the others' gears, but for wheels above wheels
        wheels[0] = max(wheels[0], 13)
        wheels[1] = max(wheels[1], wheels[0] + 8 - pinions[1])
    places, phases = _places(params, wheels)
    levels = [5.0 + (face + 3.0) * (stages - 1 - k) for k in range(stages)]
    height = levels[0] + face + (18.0 if params["sensor"] else 2.0)
    for k, place in enumerate(places):
        pinion = (pinions[k], levels[k], phases[2 * k]) if k < stages else None
        wheel = (wheels[k - 1], levels[k - 1], phases[2 * k - 1]) if k > 0 else None
        _shaft(product, params, place, height, pinion, wheel)
    reach = [_tip(wheels[k - 1]) if k else _tip(pinions[0]) for k in range(stages + 1)]
    _case(product, params, places, reach, height)
    if params["sensor"]:
        low, _ = _walls(places, reach)
        _sensor(product, params, places[1], reach[1], levels[0] + face, low[1])
    if params["coupling"]:
        z, j = height + 12.0 + params["bearing"] + 6.0, params["journal"] / 2.0
        solid = kit.cylinder(2.0 * j + 9.0, z, z + 14.0) - kit.cylinder(2.0 * j, z - 1.0, z + 20.0)
        screw, room = (
            kit.place(kit.cylinder(6.0 + d, 0.2 * j, top, segments=12), (0.0, 0.0, z + 7.0), (1.0, 0.0, 0.0))
            for d, top in ((0.0, j + 6.0), (0.06, j + 30.0))
        )
        product.add("coupling", solid)
        product.cut(("coupling", "shaft"), room.rotate((0.0, 0.0, params["angle"])))
        product.add("grub", screw.rotate((0.0, 0.0, params["angle"])))
    return product


def _tip(teeth: int) -> float:
    return (teeth + 1.8) * MODULE / 2.0


def _places(params: Mapping[str, Any], wheels: list[int]) -> tuple[list[tuple[float, float]], list[float]]:
    """Return the shafts' places, and the phases of pinion, wheel, pinion, wheel, so that they mesh."""
    places, phases, x, y = [(0.0, 0.0)], [], 0.0, 0.0
    for k in range(params["stages"]):
        heading = 0.0 if k == 0 else 180.0 - params["bend"]
        distance = (params["pinions"][k] + wheels[k]) * MODULE / 2.0
        x, y = x + distance * math.cos(math.radians(heading)), y + distance * math.sin(math.radians(heading))
        places.append((x, y))
        phases += [heading, heading + 180.0 + 180.0 / wheels[k]]
    return places, phases


def _shaft(
    product: Product,
    params: Mapping[str, Any],
    place: tuple[float, float],
    height: float,
    pinion: tuple[int, float, float] | None,
    wheel: tuple[int, float, float] | None,
) -> None:
    """Add a shaft with its pinion in one piece, its wheel on a shoulder, its bearing above and bush below."""
    x, y = place
    journal, face, width = params["journal"], params["face"], params["bearing"]
    middle, top = journal + 4.0, height + 4.0
    end = top + width + (28.0 if params["coupling"] and wheel is None else 12.0)
    seat = wheel[1] if wheel else height - 1.0
    parts = [
        kit.cylinder(journal, 2.0 - FLOOR + 4.0, end),
        kit.cylinder(middle, 0.0, top),
        kit.cylinder(journal + 10.0, 0.0, min(seat, pinion[1] + 1.0 if pinion else seat)),
    ]
    if pinion:
        teeth, z, phase = pinion
        parts.append(kit.spur_gear(teeth, MODULE, 0.0, z, z + face, phase=phase))
        if wheel:
            parts.append(kit.cylinder(journal + 10.0, z + face - 1.0, seat))
    product.add("shaft", kit.union(parts).translate((x, y, 0.0)))
    if wheel:
        teeth, z, phase = wheel
        bore = middle + clearance(middle, params["fit"])
        product.add("gear", kit.spur_gear(teeth, MODULE, bore, z, z + face, phase=phase).translate((x, y, 0.0)))
    product.add("bearing", kit.tube(journal + 9.0, journal, top, top + width).translate((x, y, 0.0)))
    if params["bush"]:
        product.add("bush", kit.tube(journal + 12.0, journal, 6.0 - FLOOR, 0.0).translate((x, y, 0.0)))


def _case(
    product: Product, params: Mapping[str, Any], places: list[tuple[float, float]], reach: list[float], height: float
) -> None:
    """Add case, cover and lid with their bolts and dowels: hollow around the gears, bored for the bearings."""
    journal, width = params["journal"], params["bearing"]
    low, high = _walls(places, reach)
    top = height + 4.0 + width
    case = kit.box((*low, -FLOOR), (*high, height))
    rooms = [
        kit.cylinder(2.0 * r + 3.0, 0.0, height + 1.0).translate((x, y, 0.0))
        for (x, y), r in zip(places, reach, strict=True)
    ]
    case -= Manifold.batch_hull(rooms)
    cover = kit.box((*low, height), (*high, top))
    lid = kit.box((low[0] + WALL, low[1] + WALL, top), (high[0] - WALL, high[1] - WALL, top + 6.0))
    below = journal + 12.0 if params["bush"] else journal
    for x, y in places:
        case -= kit.cylinder(below, 6.0 - FLOOR, 1.0).translate((x, y, 0.0))
        hole = kit.cylinder(journal + 9.0, height + 4.0, top + 1.0)
        cover -= (hole + kit.cylinder(journal + 4.3, height - 1.0, top)).translate((x, y, 0.0))
        lid -= kit.cylinder(journal + 1.0, top - 1.0, top + 9.0).translate((x, y, 0.0))
    names = [product.add("case", case), product.add("cover", cover), product.add("lid", lid)]
    middle = ((low[0] + high[0]) / 2.0, (low[1] + high[1]) / 2.0)
    spots = kit.corners(high[0] - low[0], high[1] - low[1], WALL / 2.0)
    order = [spots[0], spots[2], spots[1], spots[3]]
    length = top - height + 0.6 * height
    for x, y in order[: params["bolts"]]:
        at = (x + middle[0], y + middle[1], top)
        product.cut(names[:2], kit.bolt_room(8.0, length, clearance=clearance(8.0, params["fit"])).translate(at))
        product.add("bolt", kit.bolt(8.0, length).translate(at))
    spots = kit.corners(high[0] - low[0], high[1] - low[1], WALL + 5.0)
    for x, y in spots[1::2][: params["screws"]]:
        at = (x + middle[0], y + middle[1], top + 6.0)
        product.cut(names[1:], kit.bolt_room(5.0, 6.0 + width, clearance=0.0).translate(at))
        product.add("screw", kit.bolt(5.0, 6.0 + width).translate(at))
    for k in range(params["dowels"]):
        pin = kit.cylinder(6.0, height - 8.0, height + 3.0 + 0.5 * width, segments=12)
        pin = pin.translate((low[0] + WALL / 2.0 if k else high[0] - WALL / 2.0, middle[1], 0.0))
        product.cut(names[:2], pin)
        product.add("dowel", pin)


def _walls(places: list[tuple[float, float]], reach: list[float]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the corners of the case's outline."""
    room = [r + 1.5 + WALL for r in reach]
    low = (
        min(x - r for (x, _), r in zip(places, room, strict=True)),
        min(y - r for (_, y), r in zip(places, room, strict=True)),
    )
    high = (
        max(x + r for (x, _), r in zip(places, room, strict=True)),
        max(y + r for (_, y), r in zip(places, room, strict=True)),
    )
    return low, high


def _sensor(
    product: Product, params: Mapping[str, Any], place: tuple[float, float], tip: float, z: float, wall: float
) -> None:
    """Add a sensor through the case's wall at this y: its tip lies over a gear's rim, so the gear stays below it."""
    azimuth = math.radians(-90.0 + params["azimuth"])
    axis = (math.cos(azimuth), math.sin(azimuth), 0.0)
    out = (wall - place[1]) / axis[1]
    sensor = kit.cylinder(11.0, tip - 7.0, out + 6.0, segments=16)
    room = kit.cylinder(11.06, tip - 7.0, out + 30.0, segments=16)
    at = (place[0], place[1], z + 5.9)
    product.cut(("case",), kit.place(room, at, axis))
    product.add("sensor", kit.place(sensor, at, axis))


FAMILY = Family(
    name="gearbox",
    version=1,
    summary="gears under sensors and under other gears, bearings under a lid, a coupling under a grub screw",
    draw=draw,
    build=build,
)
