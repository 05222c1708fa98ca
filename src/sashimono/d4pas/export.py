"""A blueprint's geometry as files: one OBJ a part, in place."""

from __future__ import annotations

from pathlib import Path

from sashimono.assembly import Assembly
from sashimono.errors import InputError


def export_obj(assembly: Assembly, out: Path) -> list[Path]:
    """Write one OBJ a part, in place, in millimetres, named as the parts; return the files.

    Raises InputError if the folder holds meshes already: they would be read as parts of the same product.
    """
    out.mkdir(parents=True, exist_ok=True)
    if any(path.suffix == ".obj" for path in out.iterdir()):
        raise InputError(f"{out}: holds .obj files already; name an empty folder")
    files = []
    for part in assembly.parts:
        lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in part.vertices_world * 1e3]
        lines += [f"f {a} {b} {c}" for a, b, c in part.faces + 1]
        temporary = out / f".{part.name}.obj"
        temporary.write_text("\n".join(lines) + "\n", encoding="ascii")
        files.append(temporary.rename(out / f"{part.name}.obj"))
    return files
