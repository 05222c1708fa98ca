"""An assembly that the examples draw themselves, in metres."""

from __future__ import annotations

from pathlib import Path

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


def screwed_lid(lid_length: float = 0.08) -> Assembly:
    """Return a box with something in it, a lid, and two screws without threads that hold the lid."""
    base = box((0.08, 0.05, 0.03)) - box((0.05, 0.04, 0.03), (0.0, 0.0, 0.005))
    lid = box((lid_length, 0.05, 0.004), (0.0, 0.0, 0.017))
    parts = []
    for k, x in enumerate((-0.033, 0.033)):
        hole = rod(0.002, 0.03, (x, 0.0, 0.01))
        base, lid = base - hole, lid - hole
        screw = rod(0.002, 0.02, (x, 0.0, 0.009)) + rod(0.004, 0.003, (x, 0.0, 0.0205))
        parts.append(part(f"screw_{k + 1}", screw))
    return Assembly(parts=(part("base", base), part("lid", lid), part("board", box((0.03, 0.03, 0.01))), *parts))


def write_parts(assembly: Assembly, folder: Path) -> Path:
    """Write the parts in place as OBJ files in metres, and return their folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for each in assembly.parts:
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in each.vertices_world]
        lines += [f"f {a} {b} {c}" for a, b, c in each.faces + 1]
        (folder / f"{each.name}.obj").write_text("\n".join(lines) + "\n", encoding="ascii")
    return folder
