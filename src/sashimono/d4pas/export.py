"""A blueprint's geometry as files: one OBJ a part, in place."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Sequence
from pathlib import Path

from sashimono.assembly import Assembly
from sashimono.errors import InputError


def export_obj(assembly: Assembly, out: Path) -> list[Path]:
    """Write one OBJ a part, in place, in millimetres, named as the parts, all or none; return the files.

    Raises InputError if the folder holds meshes already: they would be read as parts of the same product.
    """
    if out.is_dir() and any(path.suffix == ".obj" for path in out.iterdir()):
        raise InputError(f"{out}: holds .obj files already; name an empty folder")
    names = [f"{stem}.obj" for stem in file_stems(assembly.names)]
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=out, prefix=".sashimono-") as folder:
        for name, part in zip(names, assembly.parts, strict=True):
            lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in part.vertices_world * 1e3]
            lines += [f"f {a} {b} {c}" for a, b, c in part.faces + 1]
            Path(folder, name).write_text("\n".join(lines) + "\n", encoding="ascii")
        for name in names:
            os.replace(Path(folder, name), out / name)
    return [out / name for name in names]


def file_stems(names: Sequence[str]) -> list[str]:
    """Return names as they can stand in a folder, each once: others than letters, digits and ``-_. `` become ``_``."""
    out: list[str] = []
    for name in names:
        safe = re.sub(r"[^\w\-. ]", "_", name).lstrip(".") or "part"
        stem, number = safe, 1
        while stem.casefold() in {other.casefold() for other in out}:
            number += 1
            stem = f"{safe}_{number}"
        out.append(stem)
    return out
