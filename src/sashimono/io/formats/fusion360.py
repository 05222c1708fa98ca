"""The form of the Fusion 360 Gallery assembly dataset: ``assembly.json``, and a mesh file for each body."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.errors import InputError
from sashimono.geometry import se3
from sashimono.io.formats.meshes import read_mesh
from sashimono.io.formats.scenes import number_shapes, place
from sashimono.io.names import choose_name
from sashimono.io.raw import METRES, Mesh, RawAssembly, RawPart, refuse_many

ASSEMBLY_FILE = "assembly.json"
UNIT = "cm"
"""The dataset's unit, of meshes and placements alike."""

_SECTIONS = ("tree", "root", "occurrences", "components", "bodies")


@dataclass(frozen=True, kw_only=True)
class _PlacedBody:
    body: str
    names: tuple[str, ...]
    T: Float[np.ndarray, "4 4"]


def read_fusion360(folder: Path, *, most: int) -> RawAssembly | None:
    """Return the visible bodies of a folder with ``assembly.json``, in tree order; None if that is another file.

    The form (Willis et al., JoinABLe, 2022): ``tree`` nests occurrences by id, below ``root``, whose component's
    bodies are in place. Each occurrence has bodies and a ``transform``: where its frame stands in that of the
    occurrence above it. Hidden occurrences are left out with all below them, and hidden bodies. Each body names its
    ``obj`` file. Lengths are in centimetres. Raises InputError for what cannot be used, and for more than ``most``
    bodies.
    """
    path = folder / ASSEMBLY_FILE
    data = path.read_bytes()
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not readable JSON ({error}); copy it again") from error
    if not isinstance(content, dict) or not all(isinstance(content.get(name), dict) for name in _SECTIONS):
        return None
    hidden: list[str] = []
    try:
        placed = list(_placed_bodies(content, hidden))
    except (KeyError, TypeError, AttributeError, ValueError, RecursionError) as error:
        reason = f"no {error}" if isinstance(error, KeyError) else str(error)
        raise InputError(f"{path}: not of the form of the Fusion 360 Gallery ({reason}); copy it again") from error
    refuse_many(len(placed), str(path), most)
    files = {path.name: data}
    meshes: dict[str, Mesh] = {}
    parts: list[RawPart] = []
    for item, shape in zip(placed, number_shapes([(item.body,) for item in placed]), strict=True):
        if item.body not in meshes:
            file = _mesh_file(folder, content["bodies"][item.body], item.body)
            files[file.name] = file.read_bytes()
            meshes[item.body] = read_mesh(file, files[file.name])
        mesh = meshes[item.body]
        T = item.T.copy()
        T[:3, 3] *= METRES[UNIT]
        parts.append(
            place(
                name=choose_name(item.names),
                where=str(path),
                T=T,
                vertices=mesh.vertices * METRES[UNIT],
                faces=mesh.faces,
                color=mesh.color,
                shape=shape,
            )
        )
    notes = (f"hidden in the design, left out: {', '.join(hidden)}",) if hidden else ()
    return RawAssembly(parts=tuple(parts), unit=UNIT, files=files, notes=notes)


def _placed_bodies(content: Mapping[str, Any], hidden: list[str]) -> Iterator[_PlacedBody]:
    """Yield every visible body in place, and name what is hidden."""
    root = content["root"]
    shown = root.get("bodies") or {}
    for body in content["components"][root["component"]].get("bodies") or ():
        name = str(content["bodies"][body].get("name", ""))
        if _is_visible(shown.get(body)):
            yield _PlacedBody(body=body, names=(name,), T=np.eye(4))
        else:
            hidden.append(name)
    yield from _below(content, content["tree"].get("root") or {}, np.eye(4), hidden)


def _below(
    content: Mapping[str, Any], tree: Mapping[str, Any], T_world_above: Float[np.ndarray, "4 4"], hidden: list[str]
) -> Iterator[_PlacedBody]:
    for key, subtree in tree.items():
        occurrence = content["occurrences"][key]
        name = str(occurrence.get("name") or "")
        if not _is_visible(occurrence):
            hidden.append(name)
            continue
        T_world = T_world_above @ _transform(occurrence.get("transform"))
        bodies = occurrence.get("bodies") or {}
        for body, state in bodies.items():
            own = str(content["bodies"][body].get("name", ""))
            names = (name, own) if len(bodies) == 1 else (f"{name} {own}", own)
            if _is_visible(state):
                yield _PlacedBody(body=body, names=names, T=T_world)
            else:
                hidden.append(f"{name} {own}")
        yield from _below(content, subtree or {}, T_world, hidden)


def _is_visible(state: Mapping[str, Any] | None) -> bool:
    return state is None or bool(state.get("is_visible", True))


def _transform(state: Mapping[str, Any] | None) -> Float[np.ndarray, "4 4"]:
    """Return a placement: its axes are the columns."""
    if state is None:
        return np.eye(4)
    columns = [[float(state[key][k]) for k in "xyz"] for key in ("x_axis", "y_axis", "z_axis", "origin")]
    return se3.make(np.transpose(columns[:3]), np.array(columns[3]))


def _mesh_file(folder: Path, body: Mapping[str, Any], key: str) -> Path:
    name = str(body.get("obj") or f"{key}.obj")
    if Path(name).name != name or Path(name).suffix.lower() != ".obj":
        raise InputError(f"{folder / ASSEMBLY_FILE}: {name!r} is no .obj file in the folder; copy it again")
    if not (folder / name).is_file():
        raise InputError(f"{folder / name}: the mesh of {body.get('name', key)} is missing; copy the folder again")
    return folder / name
