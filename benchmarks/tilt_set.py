"""The tilt set: two-part assemblies in which one part must tilt or turn to leave, and each with the way blocked.

Truth by construction. In each, no row of translations frees the part, and a motion given in the docstring does; in
its blocked twin the opening is narrower than the part is thin, or the part is linked with or shut into the other one.
Drawn in millimetres, built by manifold3d, in metres once built.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import manifold3d
import numpy as np

from sashimono.assembly import Assembly, Part

Manifold = manifold3d.Manifold
Builder = Callable[[bool], tuple[Manifold, Manifold]]
"""Given whether the way is open, returns the fixed solid and the one that has to leave."""


@dataclass(frozen=True, kw_only=True)
class TiltCase:
    """An assembly of the set."""

    name: str
    kind: str
    """What it stands for: hinge, hook, ears, clamp, plug, ..."""
    build: Builder

    def assembly(self, *, is_open: bool) -> Assembly:
        """Return the assembly, or its twin with the way blocked: parts ``fixed`` and ``moving``, in place."""
        fixed, moving = self.build(is_open)
        return Assembly(parts=(part_of("fixed", fixed), part_of("moving", moving)))


def moved(assembly: Assembly, T: np.ndarray) -> Assembly:
    """Return the assembly moved as a whole."""
    return replace(assembly, parts=tuple(replace(part, T_world_part=T @ part.T_world_part) for part in assembly.parts))


def part_of(name: str, solid: Manifold) -> Part:
    assert solid.status() == manifold3d.Error.NoError, "a solid that is none"
    assert not solid.is_empty(), "a solid without volume"
    assert sum(piece.volume() > 0.0 for piece in solid.decompose()) == 1, "a part in pieces"
    mesh = solid.to_mesh64()
    vertices = 1e-3 * np.array(mesh.vert_properties[:, :3])
    return Part(
        name=name, vertices_part=vertices, faces=np.array(mesh.tri_verts, dtype=np.int32), T_world_part=np.eye(4)
    )


def span(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Manifold:
    """Return the box between these bounds."""
    low, high = np.array([x, y, z], dtype=float).T
    return Manifold.cube(high - low).translate(low)


def rod(radius: float, z: tuple[float, float], *, segments: int = 48) -> Manifold:
    """Return a cylinder about z."""
    return Manifold.cylinder(z[1] - z[0], radius, radius, segments).translate((0.0, 0.0, z[0]))


def extruded(points: list[tuple[float, float]], y: tuple[float, float]) -> Manifold:
    """Return a polygon of the x-z plane (counter-clockwise, z up), extruded along y."""
    flat = manifold3d.CrossSection([points]).extrude(y[1] - y[0])
    # the profile's (a, b, c) becomes (a, y[1] - c, b)
    return flat.transform(np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -1.0, y[1]], [0.0, 1.0, 0.0, 0.0]]))


def across(solid: Manifold) -> Manifold:
    """Return what stood along z laid along y."""
    return solid.rotate((90.0, 0.0, 0.0))


def sector(radii: tuple[float, float], degrees: tuple[float, float], y: tuple[float, float]) -> Manifold:
    """Return a piece of a ring about the y axis, angles from x towards z."""
    t = np.radians(np.linspace(degrees[0], degrees[1], max(3, int(abs(degrees[1] - degrees[0]) / 5.0))))
    rim = [[(r * np.cos(a), r * np.sin(a)) for a in t] for r in radii]
    return extruded([*rim[1], *rim[0][::-1]], y)


def battery(is_open: bool) -> tuple[Manifold, Manifold]:
    """A battery in a cage with a lip over each end: shifted under one lip, tilted, drawn out past the other."""
    lip = 21.0 if is_open else 4.0
    cage = span((-30, 30), (-9, 9), (-3, 14)) - span((-27, 27), (-6, 6), (0, 12)) - span((-lip, lip), (-6, 6), (11, 20))
    return cage, span((-23, 23), (-5, 5), (0, 10))


def round_battery(is_open: bool) -> tuple[Manifold, Manifold]:
    """A round cell, slender, in such a cage."""
    lip = 26.0 if is_open else 3.0
    cage = span((-36, 36), (-8, 8), (-3, 12)) - span((-33, 33), (-5, 5), (0, 10)) - span((-lip, lip), (-5, 5), (9, 20))
    return cage, rod(4.0, (-28.0, 28.0), segments=32).rotate((0.0, 90.0, 0.0)).translate((0.0, 0.0, 4.1))


def lid_with_lip(is_open: bool) -> tuple[Manifold, Manifold]:
    """A lid flush in a box, its lip under the rim on one side: turned up on the other, then drawn off."""
    shell = span((-26, 26), (-19, 19), (-12, 4)) - span((-19, 19), (-13, 13), (-9, 5))
    shell -= span((-21, 21), (-15, 15), (0, 5))  # the recess
    shell -= span((-24.2, -20), (-8, 8), (0, 2.8))  # under the rim
    lid = span((-19.8, 19.8), (-14.7, 14.7), (0.05, 3.9)) + span((-22.5, -19), (-7, 7), (0.05, 2))
    if not is_open:
        shell += span((-26, 26), (-19, 19), (4, 7)) - span((-1.5, 1.5), (-15, 15), (3.9, 8))
    return shell, lid


def floor_plank(is_open: bool) -> tuple[Manifold, Manifold]:
    """A plank hooked under its neighbour's tongue, between two walls: turned up, then drawn out."""
    base = span((-30, 30), (-15, 15), (-4, 0)) + span((-30, -15), (-15, 15), (0, 8))
    base -= extruded([(-22, 2), (-14, 2), (-14, 5.2), (-22, 5.2)], (-20, 20))  # groove under an overhang
    walls = (
        span((-30, 30), (-18, -15), (-4, 12)) + span((-30, 30), (15, 18), (-4, 12)) + span((16, 20), (-18, 18), (-4, 5))
    )
    plank = span((-14.8, 15.2), (-14.5, 14.5), (0.05, 8)) + span((-20, -14), (-14.5, 14.5), (2.2, 4.6))
    if not is_open:
        walls += (
            span((-30, 30), (-18, 18), (12, 15))
            + span((20, 24), (-18, 18), (-4, 15))
            - span((-4, 2), (-15, 15), (11, 16))
        )
        walls += span((16, 20), (-18, 18), (-4, 15))
    return base + walls, plank


def ears(is_open: bool) -> tuple[Manifold, Manifold]:
    """A motor with two ears under the rim of a window: shifted, one ear lifted out, then the other drawn from below."""
    half = 13.0 if is_open else 10.2
    frame = (
        span((-26, 26), (-20, 20), (-9, 3))
        - span((-22, 22), (-14, 14), (-6, 0))
        - span((-half, half), (-11, 11), (-1, 4))
    )
    motor = span((-10, 10), (-10, 10), (-4.5, 12)) + span((-14, 14), (-4, 4), (-4.5, -2.5))
    return frame, motor


def camera(is_open: bool) -> tuple[Manifold, Manifold]:
    """A camera, its lens in a wide hole, one edge under a lip: tilted about that edge, then drawn out."""
    holder = span((-18, 18), (-14, 14), (-4, 8)) - span((-13, 13), (-11, 11), (0, 9)) - rod(6.0, (-5.0, 1.0))
    holder += span((-14, -9), (-12, 12), (6.6, 9.5))
    body = span((-11.5, 11.5), (-10, 10), (0.1, 6)) + rod(3.5, (-3.5, 1.0), segments=32)
    if not is_open:
        holder += span((-14, 14), (-12, 12), (6.6, 9.5)) - span((-2, 2), (-11, 11), (6, 10))
    return holder, body


def hinge_leaf(is_open: bool) -> tuple[Manifold, Manifold]:
    """A leaf on a pin with two flats, ears at both its ends: turned until its slot meets the flats, then drawn off."""
    pin = across(rod(3.0, (-12.0, 12.0)))
    if is_open:
        pin ^= span((-2.0, 2.0), (-20, 20), (-5, 5))
    base = span((-8, 8), (-15, 15), (-14, -8)) + pin
    base += span((-6, 6), (-15, -10.2), (-14, 6)) + span((-6, 6), (10.2, 15), (-14, 6))
    knuckle = across(rod(6.0, (-10.0, 10.0)) - rod(3.1, (-11.0, 11.0)))
    leaf = knuckle - span((-7, 0), (-11, 11), (-2.2, 2.2)) + span((5.5, 30), (-10, 10), (-1.5, 1.5))
    return base, leaf


def hook(is_open: bool) -> tuple[Manifold, Manifold]:
    """A hook over a rod under a ceiling: swung up until its mouth looks aside, then drawn off."""
    frame = (
        across(rod(3.0, (-14.0, 14.0))) + span((-14, 14), (-17, -12), (-16, 14)) + span((-14, 14), (12, 17), (-16, 14))
    )
    frame += span((-14, 14), (-17, 17), (8.0, 14.0))
    bow = sector((3.2, 6.0), (0.0, 190.0 if is_open else 360.0), (-4.0, 4.0))
    return frame, bow + span((3.2, 6.0), (-4, 4), (-14, 0.5)) + span((3.2, 20.0), (-4, 4), (-14, -11))


def ring_over_bar(is_open: bool) -> tuple[Manifold, Manifold]:
    """A ring about a post under a bar longer than the ring is wide: one end of the bar through first, aslant."""
    head = span((-10.2, 10.2), (-1, 1), (9, 10.5)) if is_open else rod(12.0, (9.0, 10.5))
    post = rod(16.0, (-4.0, 0.0)) + rod(1.2, (-1.0, 10.0), segments=24) + head
    return post, (rod(13.0, (0.05, 3.0)) - rod(10.0, (-1.0, 4.0))).translate((1.0, 0.0, 0.0))


def curved_key(is_open: bool) -> tuple[Manifold, Manifold]:
    """A curved key in a curved slot, closed at one end: turned out about the axis of its arc."""
    stop = 95.0 if is_open else 62.0
    slot = sector((19.8, 24.2), (-2.0, stop), (-3.1, 3.1))
    block = span((2, 30), (-6, 6), (-6, 30)) - slot
    if is_open:
        block -= span((-1, 5.0), (-7, 7), (17, 31))
    return block, sector((20.0, 24.0), (0.0, 60.0), (-3.0, 3.0))


def plug(is_open: bool) -> tuple[Manifold, Manifold]:
    """A plug with two lugs behind a plate with two slots, a quarter turn off: turned, then drawn out."""
    hole = rod(6.2, (-20.0, 20.0)) + rod(10.2, (-4.0, 4.0))
    if is_open:
        hole += span((-10.3, 10.3), (-2.2, 2.2), (0, 20))
    socket = rod(15.0, (-10.0, 10.0)) - hole - rod(11.0, (-20.0, -9.0)) + rod(15.0, (-13.0, -10.0))
    lugs = (span((-10, 10), (-2, 2), (-1.9, 1.9)) ^ rod(9.9, (-5.0, 5.0))).rotate((0.0, 0.0, 70.0))
    return socket, rod(6.0, (-9.5, 18.0)) + lugs


def pole_clamp(is_open: bool) -> tuple[Manifold, Manifold]:
    """A clamp on a square pole between two collars, its mouth at the corners: turned to the flats, then drawn off."""
    turned = span((-3.5, 3.5), (-3.5, 3.5), (-20, 20)).rotate((0.0, 0.0, 45.0))
    pole = (turned if is_open else rod(4.95, (-20.0, 20.0))) + rod(9.0, (5.2, 9.0)) + rod(9.0, (-9.0, -5.2))
    clamp = rod(9.0, (-5.0, 5.0)) - rod(5.1, (-6.0, 6.0)) - span((0, 12), (-3.8, 3.8), (-6, 6))
    return pole, clamp + span((-18, -8), (-3, 3), (-5, 5))


def bent_key(is_open: bool) -> tuple[Manifold, Manifold]:
    """An angle in a flat box with a hole in its roof: one arm out, turned by a right angle, then the other."""
    half = 8.0 if is_open else 1.5
    box = span((-22, 22), (-8, 8), (-3, 15)) - span((-19, 19), (-5, 5), (0, 12))
    box -= span((-half, half), (-4.5, 4.5), (11, 16))
    key = span((-14, 6), (-2, 2), (0.1, 4)) + span((-14, -10), (-2, 2), (0.1, 9.5))
    return box, key


def t_nut(is_open: bool) -> tuple[Manifold, Manifold]:
    """A nut across a T-slot that is closed at both ends: turned along the slot, then lifted."""
    rail = (
        span((-20, 20), (-12, 12), (-10, 3))
        - span((-15, 15), (-8, 8), (-6, 0.1))
        - span((-15, 15), (-3.3, 3.3), (-1, 4))
    )
    long = span((-3, 3), (-7, 7), (-5, -0.1)) if is_open else span((-7, 7), (-7, 7), (-5, -0.1))
    return rail, (long ^ rod(7.6, (-8.0, 8.0))) + rod(2.6, (-1.0, 12.0))


def drawer(is_open: bool) -> tuple[Manifold, Manifold]:
    """A drawer with a stop at its back, higher than the opening: drawn to the stop, tilted, then out."""
    lintel = 12.0 if is_open else 8.0
    case = (
        span((-24, 24), (-13, 13), (-4, 18))
        - span((-20, 25), (-10, 10), (0, 14))
        + span((20, 24), (-11, 11), (lintel, 15))
    )
    tray = span((-18, 23), (-9.5, 9.5), (0.05, 7)) + span((-18, -16), (-9.5, 9.5), (0, 13))
    return case, tray


def pane(is_open: bool) -> tuple[Manifold, Manifold]:
    """A pane between a deep groove above and a shallow one below: lifted, swung out below, then let down."""
    groove = 8.0 if is_open else 3.0
    low = 3.0 if is_open else 6.0
    sides = span((-8, 8), (-22, -15.3), (-8, 68)) + span((-8, 8), (15.3, 22), (-8, 68))
    sill = span((-8, 8), (-22, 22), (-8, low)) - span((-2.6, 2.6), (-15.4, 15.4), (0, 9))
    head = span((-8, 8), (-22, 22), (52, 68)) - span((-2.6, 2.6), (-15.4, 15.4), (51, 57 + groove - 3.5))
    return sides + sill + head, span((-1.5, 1.5), (-15, 15), (0.05, 56.5))


def stick_in_box(is_open: bool) -> tuple[Manifold, Manifold]:
    """A stick flat on the floor of a box, under a roof with a window at one end: one end up and out through it."""
    box = span((-28, 28), (-8, 8), (-3, 17)) - span((-25, 25), (-5, 5), (0, 14))
    window = (3.0, 23.0) if is_open else (3.0, 5.0)
    return box - span(window, (-4, 4), (13, 18)), span((-23, 15), (-1.5, 1.5), (0.05, 3.0))


CASES = tuple(
    TiltCase(name=build.__name__, kind=kind, build=build)
    for build, kind in (
        (battery, "battery in a cage"),
        (round_battery, "battery in a cage"),
        (lid_with_lip, "lid with a lip"),
        (floor_plank, "lid with a lip"),
        (ears, "ears under a rim"),
        (camera, "ears under a rim"),
        (hinge_leaf, "hinge"),
        (hook, "hook"),
        (ring_over_bar, "ring over a post"),
        (curved_key, "key in a slot"),
        (plug, "plug in a socket"),
        (pole_clamp, "pole clamp"),
        (bent_key, "key in a slot"),
        (t_nut, "key in a slot"),
        (drawer, "drawer"),
        (pane, "pane in grooves"),
        (stick_in_box, "battery in a cage"),
    )
)
"""The set."""
