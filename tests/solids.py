"""Small solids with known answers, in metres."""

from __future__ import annotations

import manifold3d
import numpy as np

from sashimono.assembly import Assembly, Part

Manifold = manifold3d.Manifold

LEAD = 0.01
"""Of a bolt, per turn [m]."""


def box(size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Manifold:
    """A box of this size centred at a point."""
    return Manifold.cube(size, center=True).translate(at)


def rod(radius: float, height: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0), segments: int = 48) -> Manifold:
    """A cylinder along z centred at a point."""
    return Manifold.cylinder(height, radius, radius, segments, center=True).translate(at)


def part(name: str, solid: Manifold, T_world_part: np.ndarray | None = None) -> Part:
    """A part whose mesh is the solid, in place unless a pose is given."""
    mesh = solid.to_mesh64()
    return Part(
        name=name,
        vertices_part=np.array(mesh.vert_properties[:, :3]),
        faces=np.array(mesh.tri_verts, dtype=np.int32),
        T_world_part=np.eye(4) if T_world_part is None else T_world_part,
    )


def assembly(**solids: Manifold) -> Assembly:
    """An assembly of solids in place."""
    return Assembly(parts=tuple(part(name, solid) for name, solid in solids.items()))


def peg_in_plate(clearance: float = 0.0) -> Assembly:
    """A 10 mm peg through a plate: leaves along z only."""
    plate = box((0.06, 0.06, 0.02)) - rod(0.005 + clearance, 0.04)
    return assembly(plate=plate, peg=rod(0.005, 0.04))


def box_with_lid() -> Assembly:
    """An open box, a cube inside, a lid on top: the cube is caught until the lid or the box is gone."""
    shell = box((0.06, 0.06, 0.04)) - box((0.05, 0.05, 0.04), (0.0, 0.0, 0.005))
    content = box((0.02, 0.02, 0.02), (0.0, 0.0, -0.005))
    return assembly(shell=shell, content=content, lid=box((0.06, 0.06, 0.004), (0.0, 0.0, 0.022)))


def linked_rings() -> Assembly:
    """Two square rings through one another: nothing ever separates them."""
    first = box((0.06, 0.06, 0.01)) - box((0.04, 0.04, 0.02))
    second = (box((0.06, 0.01, 0.06)) - box((0.04, 0.02, 0.04))).translate((0.03, 0.0, 0.0))
    return assembly(first=first, second=second)


def l_tunnel() -> Assembly:
    """A cube at the closed end of a tunnel with a bend: it leaves by two translations, not by one."""
    block = box((0.06, 0.06, 0.06))
    block -= box((0.01, 0.01, 0.04), (0.0, 0.0, -0.005))
    block -= box((0.05, 0.01, 0.01), (0.02, 0.0, 0.01))
    return assembly(block=block, cube=box((0.01, 0.01, 0.01), (0.0, 0.0, -0.02)) ^ box((1.0, 1.0, 1.0)))


def sealed_box(sunk: float) -> Assembly:
    """A screw in a closed box, sunk this deep into a post that has no hole: it cannot leave."""
    shell = box((0.05, 0.05, 0.05)) - box((0.04, 0.04, 0.04))
    shell += box((0.01, 0.01, 0.01), (0.0, 0.0, -0.0151))
    return assembly(shell=shell, screw=rod(0.002, 0.012, (0.0, 0.0, -0.0041 - sunk)))


def sliding_halves(size: tuple[float, float, float], *, gap: float = 0.0) -> tuple[Manifold, Manifold]:
    """A block in two halves along x, dovetailed: each leaves the other along x only. ``gap`` is the joint's play."""
    width, depth, height = size
    neck, wide, tall = 0.2 * depth, 0.4 * depth, 0.3 * height
    profile = [(-neck / 2, 0.0), (neck / 2, 0.0), (wide / 2, tall), (-wide / 2, tall)]
    tail = manifold3d.CrossSection([profile]).extrude(width)
    # the profile's plane (a, b) becomes (y, z), its extrusion x
    tail = tail.transform(np.array([[0.0, 0.0, 1.0, -width / 2], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]))
    lower, upper = (box((width, depth, height / 2), (0.0, 0.0, z)) for z in (-height / 4, height / 4))
    room = tail if gap == 0.0 else tail.scale((1.0, 1.0 + gap, 1.0 + gap))
    return lower + tail, upper - room


AXES_TURNED = np.array([[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
"""Takes x to z, y to x and z to y."""


def pair_in_pair() -> Assembly:
    """A block in two halves that slide along x, and across it a bar in two halves that slide along z.

    No part leaves alone: the bar holds the block together, and the block the bar. The bar leaves along y as one.
    """
    low, high = sliding_halves((0.08, 0.06, 0.06))
    front, back = (half.transform(AXES_TURNED) for half in sliding_halves((0.02, 0.02, 0.06)))
    hole = box((0.02, 0.1, 0.02))
    return assembly(low=low - hole, high=high - hole, front=front, back=back)


def pairs_in_pairs() -> Assembly:
    """`pair_in_pair` in a case of two halves that slide along y: the four of them leave along z, as one."""
    turned = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    halves = (half.transform(turned) - box((0.08, 0.06, 0.1)) for half in sliding_halves((0.14, 0.16, 0.06)))
    bottom, top = (part(name, half) for name, half in zip(("bottom", "top"), halves, strict=True))
    return Assembly(parts=(bottom, top, *pair_in_pair().parts))


def bolt(radius: float, ridge: float, length: float, *, lead: float = LEAD) -> Manifold:
    """A circle off the axis, extruded with a twist; for a left-hand thread mirrored, lest its diagonals lie askew."""
    offset = manifold3d.CrossSection.circle(radius, 64).translate((ridge, 0.0))
    turned = offset.extrude(length, int(48 * length / abs(lead)), 360.0 * length / abs(lead))
    turned = turned.translate((0.0, 0.0, -length / 2))
    return turned if lead > 0.0 else turned.mirror((1.0, 0.0, 0.0))


def screwed(clearance: float, *, lead: float = LEAD, phase: float = 0.0) -> Assembly:
    """A bolt in a nut, both wound; the bolt turned by ``phase`` [degrees] from where it fits."""
    nut = rod(0.02, 0.012) - bolt(0.01 + clearance, 0.003, 0.02, lead=lead)
    return assembly(nut=nut, bolt=bolt(0.01, 0.003, 0.02, lead=lead).rotate((0.0, 0.0, phase)))


def bayonet() -> Assembly:
    """A plug with two lugs, caught in a socket's ring groove that is open for 60 degrees up to a slot along z."""
    lugs = box((0.02, 0.004, 0.004))
    slot = box((0.0204, 0.0044, 0.015), (0.0, 0.0, 0.0075))
    angles = np.radians(np.linspace(84.0, 159.2, 7))
    wedge = [(0.0, 0.0), *((0.012 * np.cos(t), 0.012 * np.sin(t)) for t in angles)]
    stop = manifold3d.CrossSection([wedge]).extrude(0.01).translate((0.0, 0.0, -0.005))
    stops = (stop + stop.rotate((0.0, 0.0, 180.0))) - rod(0.0062, 0.02, segments=96)
    hole = rod(0.0062, 0.06, segments=96) + slot + rod(0.0102, 0.0044, segments=96)
    socket = rod(0.015, 0.02, segments=96) - hole + stops
    return assembly(socket=socket, plug=rod(0.006, 0.04, segments=96) + lugs.rotate((0.0, 0.0, 60.0)))


def keyhole() -> Assembly:
    """A panel on a headed stud in a wall: it slides up to a ledge, its wide hole before the head, then comes off."""
    stud = rod(0.004, 0.03, (0.0, 0.0, 0.005)) + rod(0.008, 0.004, (0.0, 0.0, 0.0173))
    wall = box((0.06, 0.14, 0.01), (0.0, 0.02, -0.005)) + box((0.06, 0.01, 0.03), (0.0, 0.0803, 0.005)) + stud
    slot = rod(0.0045, 0.04) + box((0.009, 0.03, 0.04), (0.0, -0.015, 0.0)) + rod(0.009, 0.04, (0.0, -0.03, 0.0))
    panel = box((0.05, 0.09, 0.015), (0.0, 0.0, 0.0076)) - slot
    return assembly(wall=wall, panel=panel)
