"""Make the shipped example: a single-stage spur gear reducer of sixteen parts, as STEP.

Needs the ``cad`` extra. Run from the repository root::

    python examples/make_gearbox.py src/sashimono/examples/gearbox.step

All lengths are in millimetres. The shafts are along z and the case opens upward, the way it lies on
the bench. Fits have ``FIT`` of clearance all around, more than a tessellation's sagitta, and screws have a
plain shank in place of the thread, so that no two parts overlap. What goes together along which axis:

- bearings, shafts, gear, cover and cover screws along -z;
- the level plug along -x, the drain plug along +y, the key along -x, once the cover is over the shaft end.
"""
# pyright: reportMissingImports=false

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass
from pathlib import Path

import build123d as b3d
from build123d import (
    Align,
    Axis,
    Box,
    BuildLine,
    BuildPart,
    BuildSketch,
    Color,
    Compound,
    Cone,
    Cylinder,
    GeomType,
    Location,
    Mode,
    Part,
    Plane,
    Pos,
    RectangleRounded,
    RegularPolygon,
    Rot,
    chamfer,
    extrude,
)

FIT = 0.05
"""Clearance on every fitted surface: radial for bores, normal for flats [mm]."""
BOTTOM = (Align.CENTER, Align.CENTER, Align.MIN)

STEEL = Color(0.72, 0.74, 0.77)
BEARING_STEEL = Color(0.87, 0.88, 0.90)
BLACK_OXIDE = Color(0.20, 0.20, 0.22)
BRONZE = Color(0.83, 0.57, 0.27)
CAST_BLUE = Color(0.24, 0.45, 0.62)
CAST_GREY = Color(0.62, 0.68, 0.72)
BRASS = Color(0.88, 0.74, 0.32)


@dataclass(frozen=True)
class Bearing:
    """A deep-groove ball bearing's main dimensions, ISO 15."""

    name: str
    bore: float
    outer: float
    width: float


BEARING_608 = Bearing("bearing_608ZZ", 8.0, 22.0, 7.0)
BEARING_6001 = Bearing("bearing_6001ZZ", 12.0, 28.0, 8.0)

MODULE = 2.5
PINION_TEETH, GEAR_TEETH = 10, 21
BACKLASH = 0.2
"""Gap between flanks along the pitch circle, taken off each gear's teeth [mm]."""
CENTRES = MODULE * (PINION_TEETH + GEAR_TEETH) / 2
PINION_X, GEAR_X = -25.0, -25.0 + CENTRES

LENGTH, WIDTH, WALL = 100.0, 74.0, 5.0
FLOOR, SEAT, RIM = 5.0, 13.0, 40.0
"""Heights of the floor's upper side, of the lower bearings' faces and of the case's rim [mm]."""
PROUD = 3.5
"""How far the lower bearings stand out of their seats, so that fingers can hold them [mm]."""
COVER, COVER_BOSS = 6.0, 11.0
SCREWS = [(sx * 43.0, sy * 30.0) for sx in (-1, 1) for sy in (-1, 1)]
PLUG_LEVEL = (LENGTH / 2, 0.0, 32.0)
PLUG_DRAIN = (-22.0, -WIDTH / 2, 14.0)
KEY_LENGTH, KEY_SIZE, KEY_DEPTH = 14.0, 4.0, 2.5
KEY_BOTTOM = 58.0
SHAFT_END = 76.0


def cylinder(diameter: float, bottom: float, top: float) -> Part:
    """Return an upright cylinder about z."""
    return Pos(0, 0, bottom) * Cylinder(diameter / 2, top - bottom, align=BOTTOM)


def turned(*steps: tuple[float, float, float], edge: float = 0.5) -> Part:
    """Return a turned shaft, (diameter, bottom, top) a step, with its two ends chamfered."""
    shaft = cylinder(*steps[0])
    for step in steps[1:]:
        shaft += cylinder(*step)
    ends = shaft.faces().sort_by(Axis.Z)
    return chamfer([*ends[0].edges(), *ends[-1].edges()], edge)


def involute(base: float, radius: float) -> float:
    """Return the polar angle at which the involute of the base circle reaches this radius [rad]."""
    pressure = math.acos(min(1.0, base / radius))  # 0 inside the base circle, where there is no involute
    return math.tan(pressure) - pressure


def spur_gear(teeth: int, width: float, addendum: float = 0.9, dedendum: float = 1.2) -> Part:
    """Return a straight spur gear about z, a tooth centred on +x; flanks are arcs through three involute points.

    Pressure angle 20°. Stub teeth, because ten of full height would be undercut.
    """
    pitch = MODULE * teeth / 2
    base, tip, root = pitch * math.cos(math.radians(20.0)), pitch + addendum * MODULE, pitch - dedendum * MODULE
    half_tooth = (math.pi * MODULE / 2 - BACKLASH) / (2 * pitch) + involute(base, pitch)
    half_tooth = (math.pi * MODULE / 2 - BACKLASH) / (2 * pitch) + involute(base, pitch)

    def at(radius: float, angle: float) -> tuple[float, float]:
        return radius * math.cos(angle), radius * math.sin(angle)

    def flank(radius: float) -> float:
        return half_tooth - involute(base, radius)

    with BuildPart() as gear:
        with BuildSketch():
            with BuildLine():
                for k in range(teeth):
                    axis, following = k * math.tau / teeth, (k + 1) * math.tau / teeth
                    for side in (-1, 1):
                        b3d.ThreePointArc(*(at(r, axis + side * flank(r)) for r in (root, (root + tip) / 2, tip)))
                    b3d.ThreePointArc(at(tip, axis - flank(tip)), at(tip, axis), at(tip, axis + flank(tip)))
                    valley = (axis + following) / 2
                    b3d.ThreePointArc(at(root, axis + flank(root)), at(root, valley), at(root, following - flank(root)))
            b3d.make_face()
        extrude(amount=width)
    return gear.part


def make_bearing(bearing: Bearing) -> Part:
    """Return a bearing as one solid, its lower face at z = 0, a groove on both sides between the rings."""
    ring = cylinder(bearing.outer, 0, bearing.width) - cylinder(bearing.bore, 0, bearing.width)
    ring = chamfer(ring.edges().filter_by(GeomType.CIRCLE), 0.3)
    third = (bearing.outer - bearing.bore) / 6
    groove = cylinder(bearing.outer - 2 * third, 0, 0.8) - cylinder(bearing.bore + 2 * third, 0, 0.8)
    return ring - groove - Pos(0, 0, bearing.width - 0.8) * groove


def make_case() -> Part:
    """Return the case: feet, walls, lower bearing seats, screw bosses, two plug holes."""
    with BuildPart() as case:
        with BuildSketch():
            RectangleRounded(LENGTH + 20, WIDTH - 14, 10)
        extrude(amount=FLOOR + 1)
        with BuildSketch():
            RectangleRounded(LENGTH, WIDTH, 9)
        extrude(amount=RIM)
        with BuildSketch(Plane.XY.offset(FLOOR)):
            RectangleRounded(LENGTH - 2 * WALL, WIDTH - 2 * WALL, 4)
        extrude(amount=RIM, mode=Mode.SUBTRACT)
    body = case.part
    inside = Pos(0, 0, FLOOR) * Box(LENGTH - WALL, WIDTH - WALL, RIM - FLOOR, align=BOTTOM)
    for x, y in SCREWS:
        body += (Pos(x, y, 0) * cylinder(13, FLOOR, RIM)) & inside
    for x, bearing in ((PINION_X, BEARING_608), (GEAR_X, BEARING_6001)):
        body += Pos(x, 0, 0) * cylinder(bearing.outer + 9, 0, SEAT - PROUD)
        body -= Pos(x, 0, 0) * cylinder(bearing.outer + 2 * FIT, SEAT - bearing.width, SEAT)
        body -= Pos(x, 0, 0) * cylinder(bearing.outer - 7, 0, SEAT)
    for x, y in SCREWS:
        body -= Pos(x, y, 0) * cylinder(4.0, RIM - 14, RIM)
    for x in (-1, 1):
        for y in (-1, 1):
            body -= Pos(x * (LENGTH / 2 + 4.5), y * 20.0, 0) * cylinder(5.5, 0, FLOOR + 1)
    for place, direction in ((PLUG_LEVEL, Rot(0, -90, 0)), (PLUG_DRAIN, Rot(-90, 0, 0))):
        body -= Pos(*place) * direction * cylinder(10.0, -1, WALL + 1)
    return body


def make_cover() -> Part:
    """Return the cover, its lower face at z = 0: upper bearing seats, screw holes, bosses around the shafts."""
    with BuildPart() as cover:
        with BuildSketch():
            RectangleRounded(LENGTH, WIDTH, 9)
        extrude(amount=COVER)
    body = chamfer(cover.faces().sort_by(Axis.Z)[-1].edges(), 1.0)
    for x, bearing, shaft in ((PINION_X, BEARING_608, 8.0), (GEAR_X, BEARING_6001, 12.0)):
        boss = cylinder(bearing.outer + 10, 0, COVER_BOSS)
        body += Pos(x, 0, 0) * chamfer(boss.faces().sort_by(Axis.Z)[-1].edges(), 1.0)
        body -= Pos(x, 0, 0) * cylinder(bearing.outer + 2 * FIT, 0, bearing.width)
        body -= Pos(x, 0, 0) * cylinder(shaft + 1.0, 0, COVER_BOSS)
    for x, y in SCREWS:
        body -= Pos(x, y, 0) * cylinder(4.5, 0, COVER)
    return body


def make_pinion_shaft() -> Part:
    """Return the input shaft with its pinion in one piece, in place: it rests on the lower bearing's face."""
    journal = BEARING_608.bore - 2 * FIT
    shaft = turned(
        (journal, SEAT - BEARING_608.width, SEAT),
        (12.0, SEAT, RIM),
        (journal, RIM, SHAFT_END),
    )
    return shaft + Pos(0, 0, SEAT + 1) * spur_gear(PINION_TEETH, 13.0)


def d_profile(diameter: float, flat: float, bottom: float, top: float) -> Part:
    """Return an upright cylinder with a flat at x = flat."""
    keep = Pos(flat - diameter, 0, bottom) * Box(2 * diameter, 2 * diameter, top - bottom, align=BOTTOM)
    return cylinder(diameter, bottom, top) & keep


def make_output_shaft() -> Part:
    """Return the output shaft, in place: collar on the lower bearing, flatted seat for the gear, keyway."""
    journal = BEARING_6001.bore - 2 * FIT
    shaft = turned(
        (journal, SEAT - BEARING_6001.width, SEAT),
        (18.0, SEAT, SEAT + 2),
        (journal, SEAT + 2, SHAFT_END),
    )
    shaft += d_profile(14.0 - 2 * FIT, 6.0 - FIT, SEAT + 2, RIM)
    return shaft - key_at(12.0 / 2 - KEY_DEPTH, KEY_DEPTH + 1, FIT)


def make_gear() -> Part:
    """Return the wheel with its hub, its lower face at z = 0: flatted bore, four lightening holes."""
    wheel = spur_gear(GEAR_TEETH, 11.0) + cylinder(18.0, 0, RIM - SEAT - 2)
    wheel -= d_profile(14.0, 6.0, 0, RIM)
    for k in range(4):
        wheel -= Rot(0, 0, 45 + 90 * k) * Pos(17.0, 0, 0) * cylinder(10.0, 0, 11.0)
    return wheel


def key_at(depth: float, height: float, gap: float) -> Part:
    """Return a round-ended bar along z on the shaft's +x side, from x = depth outward, grown sideways by the gap."""
    straight = KEY_LENGTH - KEY_SIZE
    bar = Box(height, KEY_SIZE + 2 * gap, straight, align=(Align.MIN, Align.CENTER, Align.MIN))
    end = Rot(0, 90, 0) * Cylinder(KEY_SIZE / 2 + gap, height, align=BOTTOM)
    bar = bar + end + Pos(0, 0, straight) * end
    return Pos(depth, 0, KEY_BOTTOM + KEY_SIZE / 2) * bar


def make_screw() -> Part:
    """Return an M4x16 socket head screw, under-head at z = 0, plain shank of core diameter."""
    screw = cylinder(7.0, 0, 4.0)
    screw = chamfer(screw.faces().sort_by(Axis.Z)[-1].edges(), 0.4)
    shank = cylinder(4.0 - 2 * FIT, -16.0, 0)
    screw += chamfer(shank.faces().sort_by(Axis.Z)[0].edges(), 0.5)
    return screw - hexagon(3.0, 2.0, 4.0)


def make_plug() -> Part:
    """Return an M10 hexagon plug with a collar; the collar's lower face is at z = 0."""
    shank = cylinder(10.0 - 2 * FIT, -WALL - 1.5, 0)
    plug = chamfer(shank.faces().sort_by(Axis.Z)[0].edges(), 0.8) + cylinder(16.0, 0, 2.0)
    return plug + (hexagon(12.0, 2.0, 10.0) & Cone(13.5, 6.0, 10.0, align=BOTTOM))


def hexagon(across_flats: float, bottom: float, top: float) -> Part:
    """Return an upright hexagonal bar about z."""
    with BuildPart() as bar:
        with BuildSketch(Plane.XY.offset(bottom)):
            RegularPolygon(across_flats / 2, 6, major_radius=False)
        extrude(amount=top - bottom)
    return bar.part


def named(shape: Part, label: str, color: Color) -> Part:
    """Return the shape as one solid with the name and colour that STEP will carry."""
    (solid,) = shape.solids()
    solid.label, solid.color = label, color
    return solid


def placed(shape: Part, place: Location) -> Part:
    """Return another instance of the shape, which the STEP file stores once."""
    instance = shape.__copy__()
    instance.label, instance.color = shape.label, shape.color
    return instance.moved(place)


def make_gearbox() -> Compound:
    """Return the product tree: four groups, sixteen parts, repeated ones as instances of one shape."""
    screw = named(make_screw(), "screw_M4x16", BLACK_OXIDE)
    plug = named(make_plug(), "plug_M10", BRASS)
    small = named(make_bearing(BEARING_608), BEARING_608.name, BEARING_STEEL)
    large = named(make_bearing(BEARING_6001), BEARING_6001.name, BEARING_STEEL)
    housing = Compound(
        label="housing",
        children=[
            named(make_case(), "case", CAST_BLUE),
            placed(plug, Pos(*PLUG_LEVEL) * Rot(0, 90, 0)),
            placed(plug, Pos(*PLUG_DRAIN) * Rot(90, 0, 0)),
        ],
    )
    drive = Compound(
        label="input",
        children=[
            placed(small, Pos(0, 0, SEAT - BEARING_608.width)),
            # its tooth on +x meets the gap that a wheel with an odd number of teeth has on -x
            named(make_pinion_shaft(), "pinion_shaft", STEEL),
            placed(small, Pos(0, 0, RIM)),
        ],
    )
    output = Compound(
        label="output",
        children=[
            placed(large, Pos(0, 0, SEAT - BEARING_6001.width)),
            named(make_output_shaft(), "output_shaft", STEEL),
            placed(named(make_gear(), "gear", BRONZE), Pos(0, 0, SEAT + 2)),
            placed(large, Pos(0, 0, RIM)),
            named(key_at(12.0 / 2 - KEY_DEPTH, KEY_SIZE, 0.0), "key_4x4x14", BRASS),
        ],
    )
    lid = Compound(
        label="lid",
        children=[named(make_cover(), "cover", CAST_GREY)] + [placed(screw, Pos(x, y, COVER)) for x, y in SCREWS],
    )
    groups = [
        housing,
        drive.move(Pos(PINION_X, 0, 0)),
        output.move(Pos(GEAR_X, 0, 0)),
        lid.move(Pos(0, 0, RIM)),
    ]
    return Compound(label="gearbox", children=groups)


def main() -> None:
    """Write the STEP file named on the command line."""
    parser = argparse.ArgumentParser(description="Write the example gearbox as STEP.")
    parser.add_argument("out", type=Path, help="the .step file to write")
    out = parser.parse_args().out
    b3d.export_step(make_gearbox(), out, write_pcurves=False, timestamp="2026-01-01T00:00:00")


if __name__ == "__main__":
    main()
