"""An assembly that the examples draw themselves, in metres."""

from __future__ import annotations

import manifold3d
import numpy as np

from sashimono import Assembly, Part

Solid = manifold3d.Manifold


def part(name: str, solid: Solid) -> Part:
    """Return a part whose mesh is a solid, in its place in the assembly."""
    mesh = solid.to_mesh64()
    return Part(
        name=name,
        vertices_part=np.array(mesh.vert_properties[:, :3]),
        faces=np.array(mesh.tri_verts, dtype=np.int32),
        T_world_part=np.eye(4),
    )


def box(size: tuple[float, float, float], at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Solid:
    """Return a box of this size, centred at a point."""
    return Solid.cube(size, center=True).translate(at)


def rod(radius: float, length: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Solid:
    """Return a cylinder along z, centred at a point."""
    return Solid.cylinder(length, radius, radius, 48, center=True).translate(at)


def screwed_lid() -> Assembly:
    """Return a box with something in it, a lid, and two screws without threads that hold the lid."""
    base = box((0.08, 0.05, 0.03)) - box((0.05, 0.04, 0.03), (0.0, 0.0, 0.005))
    lid = box((0.08, 0.05, 0.004), (0.0, 0.0, 0.017))
    parts = []
    for k, x in enumerate((-0.033, 0.033)):
        hole = rod(0.002, 0.03, (x, 0.0, 0.01))
        base, lid = base - hole, lid - hole
        screw = rod(0.002, 0.02, (x, 0.0, 0.009)) + rod(0.004, 0.003, (x, 0.0, 0.0205))
        parts.append(part(f"screw_{k + 1}", screw))
    return Assembly(parts=(part("base", base), part("lid", lid), part("board", box((0.03, 0.03, 0.01))), *parts))
