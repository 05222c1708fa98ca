"""Small solids with known answers, in metres."""

from __future__ import annotations

import manifold3d
import numpy as np

from sashimono.assembly import Assembly, Part

Manifold = manifold3d.Manifold


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
    """A cube in the elbow of a tunnel with a bend: it leaves by two translations, not by one."""
    block = box((0.06, 0.06, 0.06))
    block -= box((0.01, 0.01, 0.05), (0.0, 0.0, -0.01))
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
