"""The elastic set: assemblies in which one part has to give, and rigid ones that look alike.

Truth by construction. In each elastic one, no rigid motion frees any part, and a straight one does if the part that is
named gives as far as its docstring says. In each rigid one nothing can give so far: what would have to bend is thick,
closed, of solid material, or has no room. Drawn in millimetres, built by manifold3d, in metres once built.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import manifold3d
import numpy as np
from tilt_set import across, extruded, part_of, rod, sector, span

from sashimono.assembly import Assembly

Manifold = manifold3d.Manifold
Builder = Callable[[], dict[str, Manifold]]
"""Returns the solids by name."""


@dataclass(frozen=True, kw_only=True)
class FitCase:
    """An assembly of the set."""

    name: str
    kind: str
    """The kind of fit that is to be declared, or what the rigid one looks like."""
    build: Builder
    elastic: bool
    depth: float = 0.0
    """How far the part has to give [mm]; of elastic ones."""

    def assembly(self) -> Assembly:
        """Return the assembly, its parts in place."""
        return Assembly(parts=tuple(part_of(name, solid) for name, solid in self.build().items()))


def ring(inner: float, outer: float, z: tuple[float, float], *, segments: int = 64) -> Manifold:
    """Return a ring about z."""
    return rod(outer, z, segments=segments) - rod(inner, (z[0] - 1.0, z[1] + 1.0), segments=segments)


def wedge(degrees: float, reach: float, z: tuple[float, float]) -> Manifold:
    """Return what is within half of an angle of the x axis, for the mouth of an open ring."""
    half = np.radians(0.5 * degrees)
    tip = (reach * np.cos(half), reach * np.sin(half))
    flat = manifold3d.CrossSection([[(0.0, 0.0), (tip[0], -tip[1]), (1.3 * reach, 0.0), tip]])
    return flat.extrude(z[1] - z[0]).translate((0.0, 0.0, z[0]))


def torus(radius: float, section: float, *, z: float = 0.0) -> Manifold:
    """Return a torus about z, its middle line of this radius."""
    circle = manifold3d.CrossSection.circle(section, 24).translate((radius, 0.0))
    return circle.revolve(64).translate((0.0, 0.0, z))


def coil(radius: float, wire: float, pitch: float, turns: float) -> Manifold:
    """Return a helical spring about z, from z = 0 up, its ends cut flat across the wire."""
    steps, around = int(24 * turns), 10
    angles = np.linspace(0.0, 2.0 * np.pi * turns, steps + 1)
    u = 2.0 * np.pi * np.arange(around) / around
    points = []
    for a in angles:
        radial = np.array([np.cos(a), np.sin(a), 0.0])
        tangent = np.array([-radius * np.sin(a), radius * np.cos(a), pitch / (2.0 * np.pi)])
        tangent /= np.linalg.norm(tangent)
        normal = np.cross(tangent, radial)
        center = radius * radial + np.array([0.0, 0.0, pitch * a / (2.0 * np.pi)])
        points += [center + wire * (np.cos(t) * radial + np.sin(t) * normal) for t in u]
    faces = []
    for k in range(steps):
        for j in range(around):
            a, b = k * around + j, k * around + (j + 1) % around
            faces += [(a, a + around, b), (b, a + around, b + around)]
    last = steps * around
    for j in range(1, around - 1):
        faces += [(0, j, j + 1), (last, last + j + 1, last + j)]
    mesh = manifold3d.Mesh64(np.array(points), np.array(faces, dtype=np.uint64))
    solid = Manifold(mesh)
    return (
        solid
        if solid.volume() > 0.0
        else Manifold(manifold3d.Mesh64(np.array(points), np.array(faces, np.uint64)[:, ::-1]))
    )


def circlip() -> dict[str, Manifold]:
    """A circlip in the groove of a shaft with a collar, 0.4 mm deep; it opens by that much to come off over the end."""
    shaft = rod(10.0, (-20.0, 20.0)) - ring(9.6, 11.0, (9.9, 11.1)) + rod(14.0, (-20.0, -14.0))
    clip = ring(9.62, 12.0, (10.0, 11.0)) - wedge(40.0, 20.0, (5.0, 15.0))
    return {"shaft": shaft, "clip": clip}


def lug(angle: float, radius: float, z: tuple[float, float]) -> Manifold:
    """Return a round lug of a circlip, with its hole for the pliers, at an angle [degrees] and a radius."""
    x, y = radius * np.cos(np.radians(angle)), radius * np.sin(np.radians(angle))
    return (rod(1.4, z, segments=24) - rod(0.6, (z[0] - 1, z[1] + 1), segments=24)).translate((x, y, 0.0))


def bought_circlip() -> dict[str, Manifold]:
    """A gear against a shaft's collar, kept by a circlip with lugs, wider opposite to its gap: 0.5 mm."""
    shaft = rod(10.0, (-20.0, 20.0), segments=72) - ring(9.5, 11.0, (9.9, 11.3)) + rod(13.0, (-20.0, -14.0))
    clip = rod(12.2, (10.0, 11.2), segments=72).translate((-0.4, 0.0, 0.0)) - rod(9.51, (9.0, 12.0), segments=72)
    clip = clip - wedge(32.0, 20.0, (5.0, 15.0)) + lug(22.0, 11.6, (10.0, 11.2)) + lug(-22.0, 11.6, (10.0, 11.2))
    clip -= rod(9.51, (9.0, 12.0), segments=72)
    return {"shaft": shaft, "gear": ring(10.05, 24.0, (-13.95, 9.7)), "clip": clip}


def inner_circlip() -> dict[str, Manifold]:
    """A bearing in a blind bore, kept by an inner circlip with lugs: it closes by 0.5 mm."""
    bore = rod(18.0, (-10.0, 14.0), segments=72) - rod(13.0, (-6.0, 15.0), segments=72) - rod(9.0, (-11.0, 0.0))
    bore -= rod(13.5, (6.2, 7.6), segments=72)
    clip = rod(13.49, (6.3, 7.5), segments=72) - rod(11.3, (5.0, 9.0), segments=72) - wedge(40.0, 20.0, (5.0, 15.0))
    clip += lug(26.0, 11.2, (6.3, 7.5)) + lug(-26.0, 11.2, (6.3, 7.5))
    return {"bore": bore, "bearing": ring(6.0, 12.97, (-5.95, 6.1), segments=72), "clip": clip}


def e_clip() -> dict[str, Manifold]:
    """An E-clip in the groove of a pin: three prongs, put on from the side; it opens by 0.36 mm."""
    pin = rod(3.0, (-10.0, 10.0)) - ring(2.5, 4.0, (3.95, 4.75)) + rod(5.0, (-10.0, -6.0))
    clip = ring(3.6, 5.5, (4.0, 4.7)) + span((-5.0, -2.45), (-1.2, 1.2), (4.0, 4.7))
    for sign in (1.0, -1.0):
        clip += span((2.4, 5.0), (-0.8, 0.8), (4.0, 4.7)).rotate((0.0, 0.0, sign * 76.0))
    clip = clip - ring(5.5, 9.0, (3.0, 6.0)) - rod(2.52, (3.0, 6.0), segments=64) - wedge(110.0, 9.0, (3.0, 6.0))
    return {"pin": pin, "clip": clip}


def c_clip_on_rod() -> dict[str, Manifold]:
    """A C-clip on a rod between two collars; its mouth is 7 mm wide, the rod 8."""
    bar = across(rod(4.0, (-20.0, 20.0))) + across(ring(3.0, 7.0, (6.2, 9.0))) + across(ring(3.0, 7.0, (-9.0, -6.2)))
    bow = sector((4.05, 5.8), (60.0, 300.0), (-6.0, 6.0))
    return {"bar": bar, "clip": bow + span((-9.0, -5.0), (-6.0, 6.0), (-3.0, 3.0)) - rod_across(4.05)}


def rod_across(radius: float) -> Manifold:
    """Return a long cylinder about y."""
    return across(rod(radius, (-50.0, 50.0)))


def spring_on_post() -> dict[str, Manifold]:
    """A spring on a post with a head 0.4 mm wider in radius than the spring is inside."""
    post = rod(14.0, (-6.0, -2.0)) + rod(5.0, (-3.0, 18.0)) + rod(5.7, (16.6, 19.0))
    return {"post": post, "spring": coil(6.1, 0.8, 3.2, 5.0).translate((0.0, 0.0, -1.1))}


def o_ring() -> dict[str, Manifold]:
    """An O-ring in the groove of a piston, pressed a little as drawn; it is stretched over the piston's end."""
    piston = rod(12.0, (-12.0, 12.0)) - ring(10.9, 13.0, (-1.3, 1.3)) + rod(15.0, (-16.0, -11.0))
    return {"piston": piston, "seal": torus(11.85, 1.0)}


def hooks(thickness: float, *, behind: float | None = None) -> dict[str, Manifold]:
    """Return a lid with two hooks of this thickness behind windows of a box, and a solid core so far behind them."""
    box = span((-20, 20), (-12, 12), (-16, 0)) - span((-18, 18), (-10, 10), (-14, 1))
    box -= span((-21, 21), (-4, 4), (-11, -7.5))
    lid = span((-20, 20), (-12, 12), (0.02, 3))
    for sign in (1.0, -1.0):
        arm = span((17.9 - thickness, 17.9), (-3, 3), (-10.4, 0.5))
        arm += extruded([(17.8, -10.4), (18.4, -9.6), (18.4, -8.2), (17.8, -8.2)], (-3, 3))
        lid += arm if sign > 0 else arm.mirror((1.0, 0.0, 0.0))
    if behind is not None:
        inner = 17.9 - thickness - behind
        lid += span((-inner, inner), (-9, 9), (-12.0, 0.5))
    return {"box": box, "lid": lid}


def snap_lid() -> dict[str, Manifold]:
    """A lid with two hooks behind windows of a box: each bends by 0.4 mm."""
    return hooks(1.5)


def latch() -> dict[str, Manifold]:
    """A drawer in a sleeve, a tongue cut free in its floor with a lip in a hole of the sleeve: it bends by 0.5 mm."""
    sleeve = span((-22, 22), (-10, 10), (-8, 8)) - span((-20, 23), (-8, 8), (-6, 6))
    sleeve -= span((4, 9), (-4, 4), (-9, -5))
    drawer = span((-19.9, 21), (-7.9, 7.9), (-5.95, 5.9)) - span((-18, 19), (-6, 6), (-4.5, 7))
    drawer -= span((-10, 9.5), (-3.6, -2.8), (-7, -4)) + span((-10, 9.5), (2.8, 3.6), (-7, -4))
    drawer -= span((9.0, 9.8), (-3.6, 3.6), (-7, -4))
    drawer += extruded([(5.0, -5.9), (5.8, -6.5), (8.4, -6.5), (8.6, -5.9)], (-2.5, 2.5))
    return {"sleeve": sleeve, "drawer": drawer}


def ball_in_clip() -> dict[str, Manifold]:
    """A ball between two arms of a holder, whose lips reach 0.4 mm over its middle."""
    holder = span((-10, 10), (-6.5, 6.5), (-14, -10))
    for sign in (1.0, -1.0):
        arm = span((5.1, 6.6), (-4, 4), (-11, 4)) + extruded([(4.6, 3.4), (4.6, 2.7), (5.2, 2.2), (5.2, 4.0)], (-1, 1))
        holder += arm if sign > 0 else arm.mirror((1.0, 0.0, 0.0))
    holder += span((-3, 3), (5.15, 6.5), (-11, 8)) + span((-3, 3), (-6.5, -5.15), (-11, 8))
    return {"holder": holder, "ball": Manifold.sphere(5.0, 64)}


def plug_ring() -> dict[str, Manifold]:
    """A plug whose collar sits behind the slotted rim of a socket: eight fingers bend by 0.35 mm."""
    socket = ring(5.2, 6.4, (-12.0, 4.0)) + rod(6.4, (-15.0, -11.0)) + ring(4.75, 6.0, (2.4, 3.6))
    for k in range(4):
        socket -= span((-8, 8), (-0.6, 0.6), (-9.0, 5.0)).rotate((0.0, 0.0, 45.0 * k))
    return {"socket": socket, "plug": rod(4.6, (-10.9, 14.0)) + ring(4.0, 5.1, (0.2, 2.2)) + rod(8.0, (10.0, 14.0))}


def press_disc() -> dict[str, Manifold]:
    """A disc pressed in a seat 0.08 mm too narrow, between two mouths that are 0.17 mm too narrow."""
    block = span((-10, 10), (-10, 10), (-6, 6)) - rod(4.83, (-7, 7), segments=96) - rod(4.92, (-1.6, 1.6), segments=96)
    return {"block": block, "disc": rod(5.0, (-1.5, 1.5), segments=96)}


def barbed_post() -> dict[str, Manifold]:
    """A plate on a split post with two barbs: each half bends by 0.35 mm."""
    post = rod(3.0, (-1.0, 12.6)) + (
        Manifold.cylinder(1.3, 3.4, 2.6, 48).translate((0, 0, 11.3)) ^ span((-9, 9), (-1, 1), (0, 20))
    )
    post -= span((-0.9, 0.9), (-5, 5), (0.4, 15))
    base = span((-14, 14), (-14, 14), (-4, 0)) + ring(9.0, 11.0, (-1.0, 7.95))
    return {"base": base + post, "plate": span((-12, 12), (-10, 10), (8.0, 11.2)) - rod(3.05, (0, 20))}


def clamp_ring() -> dict[str, Manifold]:
    """A slotted clamp ring about a pipe between two beads 0.5 mm high."""
    return {"pipe": beaded_pipe(0.5), "clamp": ring(10.05, 12.5, (-5.0, 5.0)) - wedge(14.0, 30.0, (-9.0, 9.0))}


def beaded_pipe(bead: float) -> Manifold:
    """Return a pipe of radius 10 about z with two beads of this height."""
    beads = ring(9.0, 10.0 + bead, (5.2, 7.0)) + ring(9.0, 10.0 + bead, (-7.0, -5.2))
    return ring(8.0, 10.0, (-25.0, 25.0)) + beads


def closed_ring(outer: float, bead: float) -> Builder:
    """A ring without a gap between two beads."""
    return lambda: {"pipe": beaded_pipe(bead), "ring": ring(10.05, outer, (-5.0, 5.0))}


def thick_c(outer: float, mouth: float) -> Builder:
    """A C of solid section on a bar: too thick to open."""

    def build() -> dict[str, Manifold]:
        case = c_clip_on_rod()
        bow = sector((4.05, outer), (mouth, 360.0 - mouth), (-6.0, 6.0))
        return {"bar": case["bar"], "clip": bow}

    return build


def dumbbell(head: float, plate: float) -> Builder:
    """A bolt with a head on either side of a plate whose hole is a little too narrow for either."""

    def build() -> dict[str, Manifold]:
        bolt = rod(4.0, (-12.0, 12.0)) + rod(head, (0.5 * plate + 0.1, 12.0)) + rod(head, (-12.0, -0.5 * plate - 0.1))
        sheet = span((-15, 15), (-15, 15), (-0.5 * plate, 0.5 * plate)) - rod(4.1, (-9, 9))
        return {"plate": sheet, "bolt": bolt}

    return build


def thick_hooks(thickness: float) -> Builder:
    """Hooks as thick as a third of their length and more: solid blocks with a lip."""
    return lambda: hooks(thickness)


def backed_hooks(gap: float) -> Builder:
    """Slender hooks with solid material close behind them: no room to bend."""
    return lambda: hooks(1.5, behind=gap)


def ball_in_socket(lip: float) -> Builder:
    """A ball in a solid block, its mouth a little narrower than the ball."""

    def build() -> dict[str, Manifold]:
        level = float(np.sqrt(5.1**2 - (5.0 - lip) ** 2))
        block = span((-9, 9), (-9, 9), (-9, level)) - Manifold.sphere(5.1, 64)
        return {"block": block, "ball": Manifold.sphere(5.0, 64)}

    return build


def loose_torus(section: float) -> Builder:
    """A round ring loose about a spool whose flanges are a little too wide for it."""

    def build() -> dict[str, Manifold]:
        inner = 12.0 - section
        spool = rod(inner - 2.5, (-8, 8)) + rod(inner + 0.4, (6, 8)) + rod(inner + 0.4, (-8, -6))
        return {"spool": spool, "ring": torus(12.0, section)}

    return build


def boxed(gap: float, wall: float) -> Builder:
    """A block in a closed box."""

    def build() -> dict[str, Manifold]:
        inner, outer = 8.0 + gap, 8.0 + gap + wall
        box = span((-outer, outer), (-outer, outer), (-outer, outer)) - span(
            (-inner, inner), (-inner, inner), (-inner, inner)
        )
        return {"box": box, "block": span((-8, 8), (-8, 8), (-8, 8))}

    return build


def drawn_in(wall: float, base: float) -> Builder:
    """A crank in a thin housing whose slots are narrower than its journals, as drawn, and narrower still above."""

    def build() -> dict[str, Manifold]:
        housing = span((-40, 40), (-25, 25), (-25, 14)) - span(
            (-40 + wall, 40 - wall), (-25 + wall, 25 - wall), (-25 + base, 15)
        )
        housing -= span((-41, 41), (-3.9, 3.9), (-3.9, 15))
        for sign in (1.0, -1.0):
            lip = span((40 - wall, 40), (2.8, 5.0), (8, 12))
            for side in (lip, lip.mirror((0.0, 1.0, 0.0))):
                housing += side if sign > 0 else side.mirror((1.0, 0.0, 0.0))
        crank = rod(6.0, (-48, 48)) + rod(15.0, (-5, 5))
        return {"housing": housing, "crank": crank.rotate((0.0, 90.0, 0.0))}

    return build


def blocked_dovetail(step: float) -> Builder:
    """A slide in a dovetail groove with a step at both its ends."""

    def build() -> dict[str, Manifold]:
        tail = [(-4.0, 0.0), (-6.0, -4.0), (6.0, -4.0), (4.0, 0.0)]
        groove = [(-4.1, 0.1), (-6.2, -4.1), (6.2, -4.1), (4.1, 0.1)]
        rail = span((-12, 12), (-20, 20), (-12, 0)) - extruded(groove, (-21, 21))
        rail += span((-7, 7), (14.2, 17), (-8, -4.1 + step)) + span((-7, 7), (-17, -14.2), (-8, -4.1 + step))
        return {"rail": rail, "slide": extruded(tail, (-14, 14)) + span((-4, 4), (-14, 14), (-0.5, 3))}

    return build


def thick_coil(wire: float) -> Builder:
    """A helix of thick wire on a post with a head."""

    def build() -> dict[str, Manifold]:
        pitch = 2.4 * wire
        post = rod(14.0, (-6.0 - wire, -2.0 - wire)) + rod(6.0 - wire, (-5.0, 3.0 * pitch + 2.0 * wire))
        post += rod(7.0 - wire, (3.0 * pitch + 1.5 * wire, 3.0 * pitch + 4.0))
        return {"post": post, "coil": coil(6.4, wire, pitch, 3.0)}

    return build


def stepped_pin(step: float) -> Builder:
    """A pin with a collar in a solid block, in two halves of one bore narrower than the collar."""

    def build() -> dict[str, Manifold]:
        pin = rod(5.0, (-14, 14)) + rod(5.0 + step, (-3, 3))
        block = span((-12, 12), (-12, 12), (-10, 10)) - rod(5.1, (-11, 11)) - rod(5.2 + step, (-3.2, 3.2))
        return {"block": block, "pin": pin}

    return build


def bridge(thickness: float) -> Builder:
    """A lid whose lips are in the middle of bars held at both their ends."""

    def build() -> dict[str, Manifold]:
        case = hooks(thickness)
        lid = case["lid"]
        for sign in (1.0, -1.0):
            bar = span((17.9 - thickness, 17.9), (-3, 3), (-13.5, -8.0)) + span((0, 17.9), (-3, 3), (-13.5, -11.5))
            lid += bar if sign > 0 else bar.mirror((1.0, 0.0, 0.0))
        return {"box": case["box"], "lid": lid}

    return build


ELASTIC = tuple(
    FitCase(name=build.__name__, kind=kind, build=build, elastic=True, depth=depth)
    for build, kind, depth in (
        (circlip, "ring", 0.38),
        (bought_circlip, "ring", 0.5),
        (inner_circlip, "ring", 0.5),
        (e_clip, "ring", 0.36),
        (c_clip_on_rod, "ring", 0.5),
        (clamp_ring, "ring", 0.45),
        (spring_on_post, "spring", 0.4),
        (o_ring, "seal", 1.15),
        (snap_lid, "snap", 0.4),
        (latch, "snap", 0.5),
        (ball_in_clip, "snap", 0.4),
        (plug_ring, "snap", 0.35),
        (barbed_post, "snap", 0.35),
        (press_disc, "press", 0.17),
    )
)
"""Assemblies in which one part has to give."""

_ALIKE: tuple[tuple[str, Callable[..., Builder], tuple[tuple[float, ...], ...]], ...] = (
    ("a closed ring", closed_ring, ((11.0, 0.5), (12.5, 0.4), (14.0, 0.5), (16.0, 0.5), (18.0, 0.6))),
    ("a thick C", thick_c, ((7.0, 60.0), (8.0, 60.0), (10.0, 65.0), (7.0, 65.0))),
    ("a bolt in a plate", dumbbell, ((4.5, 4.0), (4.6, 8.0), (5.0, 6.0), (4.8, 12.0))),
    ("a block with a lip", thick_hooks, ((4.0,), (5.0,), (6.0,), (8.0,), (12.0,))),
    ("hooks without room", backed_hooks, ((0.05,), (0.1,), (0.2,), (0.3,))),
    ("a bar with a lip", bridge, ((1.5,), (2.0,), (3.0,))),
    ("a ball in a socket", ball_in_socket, ((0.3,), (0.4,), (0.5,), (0.7,))),
    ("a loose round ring", loose_torus, ((1.0,), (1.5,), (2.0,), (3.0,))),
    ("a block in a box", boxed, ((0.1, 1.0), (0.5, 2.0), (0.2, 4.0))),
    ("a crank drawn in", drawn_in, ((1.5, 1.5), (2.0, 6.0), (3.0, 3.0))),
    ("a blocked dovetail", blocked_dovetail, ((0.4,), (0.5,), (0.8,), (1.0,))),
    ("a thick helix", thick_coil, ((2.0,), (2.2,), (2.5,))),
    ("a collar in a bore", stepped_pin, ((0.3,), (0.4,), (0.5,), (0.6,), (0.8,), (1.0,), (1.5,))),
)

RIGID = tuple(
    FitCase(name=f"{make.__name__}_{'_'.join(f'{x:g}' for x in sizes)}", kind=kind, build=make(*sizes), elastic=False)
    for kind, make, each in _ALIKE
    for sizes in each
)
"""Assemblies that look alike, and in which nothing gives."""
