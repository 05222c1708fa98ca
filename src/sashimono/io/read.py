"""Reading an assembly: any supported file or folder in, checked parts in metres out."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sashimono.assembly import Assembly, Part, Source
from sashimono.errors import InputError
from sashimono.geometry.mesh import topology
from sashimono.geometry.mesh.shapes import identical_shapes
from sashimono.io.checks import BrokenPart, close_parts, find_overlaps, size_note
from sashimono.io.formats import meshes
from sashimono.io.formats.folders import read_folder
from sashimono.io.formats.fusion360 import ASSEMBLY_FILE, read_fusion360
from sashimono.io.formats.scenes import read_3mf_scene, read_gltf_scene
from sashimono.io.formats.step import read_step
from sashimono.io.kept import keep_together
from sashimono.io.mending.split import split_parts
from sashimono.io.names import unique_names
from sashimono.io.raw import METRES, RawAssembly, RawPart, ReadConfig, refuse_many
from sashimono.io.tree import find_products
from sashimono.selection import matching

SCENE_SUFFIXES = (".step", ".stp", ".glb", ".gltf", ".3mf")
"""Files that hold a whole assembly."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Inspection:
    """All that a source holds, sound or not."""

    assembly: Assembly
    """The parts whose surfaces are closed, perhaps after mending."""
    broken: tuple[tuple[Part, str], ...]
    """The other parts, as their file has them, and what is wrong with each."""
    mended: Mapping[str, tuple[str, ...]]
    """What was changed of the surfaces, by the name of the part in the file."""
    folded: Mapping[str, int]
    """How many triangles at least lie back to back with a neighbour, by the name of the part in the file."""
    unit_stated: bool
    """Whether the source says in which unit it is."""
    unit_given: bool
    """Whether the caller said so."""


def read_assembly(
    path: str | Path, *, unit: str | None = None, repair: bool = True, config: ReadConfig | None = None
) -> Assembly:
    """Return the assembly in a STEP, glTF or 3MF file, or in a folder of OBJ, STL or PLY files in place.

    A folder may also have the form of the Fusion 360 Gallery assembly dataset.

    Parts come in product-tree order (scenes) or natural name order (folders), in metres, with
    closed outward surfaces. ``unit`` ("mm", "m", "cm", "in", ...) is for mesh files, which state
    none. With ``repair``, small faults are mended and named in the notes. Raises InputError, one
    line with the way out, for anything that cannot be used.
    """
    return _read(path, unit, repair, config or ReadConfig(), refuse_broken=True).assembly


def inspect_assembly(path: str | Path, *, unit: str | None = None, config: ReadConfig | None = None) -> Inspection:
    """Return what a source holds, parts that cannot be closed included; see `read_assembly`.

    Raises InputError only where there is nothing to look at.
    """
    return _read(path, unit, True, config or ReadConfig(), refuse_broken=False)


def _read(path: str | Path, unit: str | None, repair: bool, config: ReadConfig, *, refuse_broken: bool) -> Inspection:
    path = Path(path)
    if unit is not None and unit not in METRES:
        raise InputError(f"unit {unit!r} is not known; use one of {', '.join(METRES)}")
    try:
        raw = _read_raw(path, unit, config)
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path}: cannot be read ({reason}); check the path and its rights") from error
    notes = list(raw.notes)
    if unit is not None and unit != raw.unit:
        notes.append(f"the file states its unit ({raw.unit}): unit {unit} not used")
    raw_parts, split_notes = _split_single(raw)
    refuse_many(len(raw_parts), str(path), config.max_parts)
    _check_coordinates(raw_parts, str(path), config)
    if len(raw_parts) < 2:
        what = f"holds 1 part ({raw_parts[0].name})" if raw_parts else "holds no part with a surface"
        raise InputError(f"{path}: {what}; an assembly needs at least 2")
    names = unique_names([part.name for part in raw_parts])
    raw_parts = [replace(part, name=name) for part, name in zip(raw_parts, names, strict=True)]
    excluded = matching(names, config.exclude, "--exclude")
    raw_parts = [part for part in raw_parts if part.name not in excluded]
    if len(raw_parts) < 2:
        raise InputError(f"{path}: --exclude leaves {len(raw_parts)} of {len(names)} parts; leave out fewer")
    closed = close_parts(raw_parts, repair=repair, config=config)
    if refuse_broken:
        closed.refuse_broken(str(path), repair=repair)
    parts, origins, kept_notes = split_parts(
        closed.parts, config=config, whole={entry.part for entry in closed.stand_ins}
    )
    names = [part.name for part in parts]
    broken = [(_as_it_is(each), each.problem) for each in closed.broken]
    notes += [*split_notes, *closed.notes, *kept_notes]
    notes += size_note([*parts, *(part for part, _ in broken)], raw.unit, config, stated=raw.unit_stated)
    same = identical_shapes([(part.vertices_part, part.faces) for part in parts])
    above = {part.name: part.products for part in raw_parts}
    products = find_products({name: above[origin] for name, origin in zip(names, origins, strict=True)})
    assembly = Assembly(
        parts=tuple(parts),
        source=Source(
            path=str(path),
            sha256=_digest(raw.files, path),
            unit=raw.unit,
            split=config.split,
            excluded=excluded,
            products=products,
            stand_ins=closed.stand_ins,
        ),
        overlaps=() if config.kept else find_overlaps(parts, config),
        identical=tuple(tuple(names[k] for k in members) for members in same),
        notes=tuple(notes),
        products=products,
    )
    assembly = keep_together(assembly, config.kept, config=config)
    return Inspection(
        assembly=assembly,
        broken=tuple(broken),
        mended=closed.mended,
        folded=closed.folded,
        unit_stated=raw.unit_stated,
        unit_given=unit is not None,
    )


def _as_it_is(broken: BrokenPart) -> Part:
    raw = broken.raw
    return Part(
        name=raw.name, vertices_part=raw.vertices, faces=raw.faces, T_world_part=raw.T_world_part, color=raw.color
    )


def _read_raw(path: Path, unit: str | None, config: ReadConfig) -> RawAssembly:
    if path.is_dir():
        gallery = read_fusion360(path, most=config.max_parts) if (path / ASSEMBLY_FILE).is_file() else None
        return read_folder(path, unit, most=config.max_parts) if gallery is None else gallery
    suffix = path.suffix.lower()
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; check the path")
    if suffix in meshes.SUFFIXES:
        raise InputError(f"{path}: a mesh file is a single part; give the folder that holds one for each part")
    if suffix not in SCENE_SUFFIXES:
        raise InputError(
            f"{path}: {suffix or 'a file without suffix'} is not supported; give {', '.join(SCENE_SUFFIXES)}"
            f" or a folder of {', '.join(meshes.SUFFIXES)}"
        )
    if not path.is_file():  # a pipe or a device may never end
        raise InputError(f"{path}: neither a file nor a folder; give one")
    data = path.read_bytes()
    if not data:
        raise InputError(f"{path}: the file is empty; export it again")
    if suffix in (".step", ".stp"):
        return read_step(path, data, config)
    read_scene = read_3mf_scene if suffix == ".3mf" else read_gltf_scene
    return read_scene(path, data, most=config.max_parts)


def _split_single(raw: RawAssembly) -> tuple[list[RawPart], list[str]]:
    """Return the parts; where the file names only one, its separate solids."""
    if len(raw.parts) != 1 or not raw.split_single:
        return list(raw.parts), []
    part = raw.parts[0]
    solids = topology.split_solids(part.vertices, part.faces)
    if len(solids) < 2:
        return [part], []
    parts = [replace(part, faces=faces, shape=None) for faces in solids]
    return parts, [f"{part.name}: the file's only part holds {len(solids)} solids; each was taken as a part"]


def _check_coordinates(parts: list[RawPart], source: str, config: ReadConfig) -> None:
    """Raise InputError for parts whose arrays are no mesh, or whose coordinates are beyond any product."""
    for part in parts:
        problem = meshes.mesh_problem(meshes.Mesh(vertices=part.vertices, faces=np.asarray(part.faces)))
        if problem:
            raise InputError(f"{source}: {part.name} {problem}; export it again")
        # in double precision a product that is so large or so far away has no details left
        reach = max(float(np.abs(part.vertices).max()), float(np.abs(part.T_world_part[:3, 3]).max()))
        if reach > config.farthest:
            where = part.where if part.where != source else f"{source}: {part.name}"
            raise InputError(
                f"{where}: coordinates of {reach:.3g} m; nothing so large or so far away is planned. Check the unit,"
                " move the product near the origin, or export it again."
            )


def _digest(files: Mapping[str, bytes], path: Path) -> str:
    """Return the hash of the one file, or of the sorted (name, content hash) list of a folder's files."""
    if path.is_file() and len(files) == 1:
        return hashlib.sha256(next(iter(files.values()))).hexdigest()
    lines = (f"{name}\0{hashlib.sha256(files[name]).hexdigest()}\n" for name in sorted(files))
    return hashlib.sha256("".join(lines).encode()).hexdigest()
