"""Folders of mesh files in their assembled place, and the forms of Assemble-Them-All and ASAP."""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.errors import InputError
from sashimono.geometry import se3
from sashimono.io.formats.meshes import SUFFIXES, read_mesh
from sashimono.io.raw import METRES, RawAssembly, RawPart, refuse_many


def read_folder(folder: Path, unit: str | None, *, most: int) -> RawAssembly:
    """Return the parts of a folder of .obj, .stl or .ply files, named by file stem, in natural order.

    Coordinates are taken in ``unit``, millimetres if None. The files lie in their assembled place,
    unless ``config.json`` (ASAP: ``{id: {"final_state": [x, y, z] or [x, y, z, a, b, c]}}``, angles
    about the fixed axes x, y, z in turn [rad]) or ``translation.json`` (Assemble-Them-All:
    ``{id: [x, y, z]}``) moves them there. Raises InputError for what cannot be used, and for more than ``most`` files.
    """
    paths = sorted((p for p in folder.iterdir() if _is_mesh(p)), key=lambda p: natural_key(p.name))
    if not paths:
        raise InputError(_nothing_found(folder))
    for path in paths:
        try:
            path.name.encode()
        except UnicodeEncodeError:
            raise InputError(f"{folder}: the file name {path.name!a} is not UTF-8; rename it.") from None
    refuse_many(len(paths), str(folder), most)
    names = [p.stem for p in paths]
    for name, count in Counter(names).items():
        if count > 1:
            same = [p.name for p in paths if p.stem == name]
            raise InputError(f"{folder}: {' and '.join(same)} name the same part {name}; keep one of them")
    notes = []
    if unit is None:
        notes.append("mesh files state no unit: millimetres assumed; give --unit if they are not")
    scale = METRES[unit or "mm"]
    poses, pose_file, pose_notes = _poses(folder, names)
    files = {p.name: p.read_bytes() for p in paths}
    parts = []
    for path in paths:
        mesh = read_mesh(path, files[path.name])
        T = poses.get(path.stem, np.eye(4)).copy()
        T[:3, 3] *= scale
        parts.append(RawPart(
            name=path.stem, where=str(path), vertices=mesh.vertices * scale, faces=mesh.faces, T_world_part=T,
            color=mesh.color,
        ))  # fmt: skip
    if pose_file is not None:
        files[pose_file.name] = pose_file.read_bytes()
    return RawAssembly(
        parts=tuple(parts), unit=unit or "mm", files=files, notes=(*notes, *pose_notes), unit_stated=False
    )


def natural_key(name: str) -> list[tuple[int, int, str]]:
    """Return a sort key that puts ``part_2`` before ``part_10``."""
    pieces = re.split(r"(\d+)", name)
    return [(0, int(piece), "") if k % 2 else (1, 0, piece) for k, piece in enumerate(pieces)] + [(2, 0, name)]


def _is_mesh(path: Path) -> bool:
    return path.suffix.lower() in SUFFIXES and not path.name.startswith(".") and path.is_file()


def _nothing_found(folder: Path) -> str:
    found = sorted((p.name for p in folder.iterdir() if not p.name.startswith(".")), key=natural_key)
    if not found:
        return f"{folder}: the folder is empty; it should hold one .obj, .stl or .ply file for each part"
    shown = ", ".join(found[:5]) + (f" and {len(found) - 5} more" if len(found) > 5 else "")
    scenes = [name for name in found if Path(name).suffix.lower() in (".step", ".stp", ".glb", ".gltf", ".3mf")]
    way_out = f"give {folder / scenes[0]} itself" if scenes else "put one such file for each part there"
    return f"{folder}: no .obj, .stl or .ply file in the folder (found {shown}); {way_out}"


def _poses(folder: Path, names: list[str]) -> tuple[dict[str, Float[np.ndarray, "4 4"]], Path | None, tuple[str, ...]]:
    """Return the poses that a folder's JSON gives its parts, in the file's unit, where from, and what to note.

    A JSON file that speaks of none of the parts belongs to something else and is left alone.
    """
    for file_name, state_of in (("config.json", _asap_state), ("translation.json", _ata_state)):
        path = folder / file_name
        if not path.is_file():
            continue
        states = _load_states(path, names, state_of)
        if states:
            poses = {name: _pose(path, name, state) for name, state in states.items()}
            missing = [name for name in names if name not in poses]
            notes = [f"{', '.join(missing)}: no pose in {file_name}; taken in place"] if missing else []
            return poses, path, tuple(notes)
    return {}, None, ()


def _load_states(path: Path, names: list[str], state_of: Callable[[object], object]) -> dict[str, Any]:
    try:
        content = json.loads(path.read_bytes())
    except ValueError as error:
        way_out = "mend it, or remove it if the meshes are in place"
        raise InputError(f"{path}: not readable JSON ({error}); {way_out}") from error
    if not isinstance(content, dict):
        return {}
    found = {name: state_of(content[name]) for name in names if name in content}
    return {name: state for name, state in found.items() if state is not None}


def _asap_state(value: object) -> object:
    return value.get("final_state") if isinstance(value, dict) else None


def _ata_state(value: object) -> object:
    return value if isinstance(value, list) else None


def _pose(path: Path, name: str, state: object) -> Float[np.ndarray, "4 4"]:
    """Return the pose for a state of 3 or 6 numbers."""
    numbers = state if isinstance(state, list) else []
    good = all(isinstance(x, int | float) and math.isfinite(x) for x in numbers)
    if not good or len(numbers) not in (3, 6):
        raise InputError(f"{path}: the pose of {name} should be 3 or 6 finite numbers; mend it, or remove the file")
    values = np.array(numbers, dtype=np.float64)
    rotation = Rotation.from_euler("xyz", values[3:]).as_matrix() if len(values) == 6 else None
    return se3.make(rotation, values[:3])
