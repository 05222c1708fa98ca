"""Other people's assemblies as items of a dataset: folders of meshes, CAD files, the forms of published datasets."""

from __future__ import annotations

import hashlib
import json
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

from sashimono.assembly import Assembly
from sashimono.d4pas.recipe import Recipe
from sashimono.d4pas.rows import Outcome, RowConfig, rows_of
from sashimono.errors import InputError
from sashimono.io.formats.folders import natural_key
from sashimono.io.formats.fusion360 import ASSEMBLY_FILE
from sashimono.io.formats.fusion360 import UNIT as GALLERY_UNIT
from sashimono.io.formats.meshes import SUFFIXES
from sashimono.io.raw import METRES
from sashimono.io.read import SCENE_SUFFIXES, read_assembly

ASSEMBLE_THEM_ALL, ASAP, FUSION_360, FOLDER = "assemble-them-all", "asap", "fusion360", "folder"
"""Families of foreign assemblies, by the form that they come in; a CAD file is of the last."""

FORMS = {"config.json": (ASAP, "cm"), "translation.json": (ASSEMBLE_THEM_ALL, "cm")}
"""Published forms by the file that places their meshes, and the unit of those (their longest side is about 10 cm)."""

MULTI_ASSEMBLY = "multi_assembly"
"""Folder of Assemble-Them-All whose assemblies are meshes in place, without a file beside them."""

UNSTATED = "mm"
"""Unit of meshes of which nothing says it."""


@dataclass(frozen=True, kw_only=True)
class ForeignItem:
    """One assembly of somebody else's."""

    key: str
    """Name of the item, unique in a run, and fit for a file's name."""
    family: str
    path: Path
    """File or folder."""
    relative: str
    """The path from the folder that was searched, with forward slashes."""
    unit: str
    """Of mesh files, which state none."""

    @property
    def base(self) -> Path:
        """The folder that ``relative`` starts from."""
        return self.path.parents[len(PurePosixPath(self.relative).parts) - 1]

    @cached_property
    def params(self) -> dict[str, Any]:
        """What identifies it again: where it is, in which form and unit, and the SHA-256 of its files."""
        try:
            sha256 = _digest(self.path)
        except OSError:  # reading it will say so
            sha256 = ""
        return {"path": self.relative, "form": self.family, "unit": self.unit, "sha256": sha256}


def find_assemblies(folder: Path) -> list[ForeignItem]:
    """Return the assemblies in a folder, in natural order of their paths; the folder may be one itself.

    An assembly is a CAD file, a folder with ``assembly.json``, or one with two mesh files or more, which is not
    searched further; a lone mesh counts only where nothing below its folder does. Raises InputError if there is none.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; check the path")
    try:
        paths = list(_search(folder, frozenset(), top=True))
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{folder}: cannot be read ({reason}); check its rights") from error
    if not paths:
        raise InputError(
            f"{folder}: holds no assembly; give a folder of folders with an .obj, .stl or .ply file for each part,"
            f" of {', '.join(SCENE_SUFFIXES)} files, or of Fusion 360 Gallery assemblies"
        )
    taken: set[str] = set()
    items = []
    for path in paths:
        relative = path.relative_to(folder).as_posix() if path != folder else folder.resolve().name
        relative = relative.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")
        key = _key(relative, taken)
        taken.add(key.casefold())
        family = _family(path)
        unit = _unit(path, family)
        items.append(ForeignItem(key=key, family=family, path=path.absolute(), relative=relative, unit=unit))
    return items


def foreign_rows(item: ForeignItem, *, config: RowConfig) -> Outcome:
    """Return the rows of somebody else's assembly, or why it has none."""
    clock = [time.process_time()]
    try:
        assembly = read_assembly(item.path, unit=item.unit if _has_meshes(item.path) else None)
    except InputError as error:
        return Outcome(rows=None, reason=_portable(str(error), item), seconds={})
    clock.append(time.process_time())
    recipe = Recipe(family=item.family, version=0, params=item.params, seed=0, name=item.key)
    return rows_of(assembly, recipe, config=config, clock=clock)


def read_foreign(path: Path, params: Mapping[str, Any]) -> Assembly:
    """Return the assembly that a row's parameters describe, from where it is now.

    Raises InputError if it is not there, or not as it was.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; name its folder in the dataset's sources.json")
    if _digest(path) != params["sha256"]:
        raise InputError(f"{path}: has changed since the dataset was made; make the dataset again")
    return read_assembly(path, unit=params["unit"] if _has_meshes(path) else None)


def _search(folder: Path, above: frozenset[Path], *, top: bool = False) -> Iterator[Path]:
    try:
        real = folder.resolve(strict=True)
        inside = sorted((p for p in folder.iterdir() if not p.name.startswith(".")), key=lambda p: natural_key(p.name))
    except OSError:
        if top:
            raise
        yield folder  # an item that fails, with its reason
        return
    if real in above:  # a link back up
        return
    found = sum(p.suffix.lower() in SUFFIXES and p.is_file() for p in inside)
    if found >= 2 or (folder / ASSEMBLY_FILE).is_file():
        yield folder
        return
    count = 0
    for path in inside:
        if path.is_dir():
            for below in _search(path, above | {real}):
                count += 1
                yield below
        elif path.suffix.lower() in SCENE_SUFFIXES:
            count += 1
            yield path
    if found and not count:
        yield folder


def _family(path: Path) -> str:
    if path.is_file():
        return FOLDER
    if (path / ASSEMBLY_FILE).is_file():
        return FUSION_360
    for name, (family, _) in FORMS.items():
        if _places_parts(path / name):
            return family
    return ASSEMBLE_THEM_ALL if MULTI_ASSEMBLY in path.absolute().parts else FOLDER


def _places_parts(file: Path) -> bool:
    """Whether a file of that name is what its form has: poses by part, not the settings of something else."""
    try:
        content = json.loads(file.read_bytes())
    except (OSError, ValueError, RecursionError):
        return file.is_file()  # broken: reading will say so
    states = content.values() if isinstance(content, dict) else ()
    return any(isinstance(state, list) or (isinstance(state, dict) and "final_state" in state) for state in states)


def _unit(path: Path, family: str) -> str:
    """Return the unit: the form's, or what ``units`` in ``meta.json`` begins with, or else millimetres."""
    if family == FUSION_360:
        return GALLERY_UNIT
    published = dict(FORMS.values())
    if family in published:
        return published[family]
    try:
        stated = json.loads((path / "meta.json").read_bytes())["units"]
    except (OSError, ValueError, KeyError, TypeError):
        return UNSTATED
    word = re.match(r"\w+", str(stated))
    return word.group() if word and word.group() in METRES else UNSTATED


def _has_meshes(path: Path) -> bool:
    """Whether the unit is ours to say."""
    return path.is_dir() and not (path / ASSEMBLY_FILE).is_file()


def _key(relative: str, taken: set[str]) -> str:
    """Return a name of letters, digits, dots, dashes and underscores; with a hash where it is not the path itself."""
    plain = re.sub(r"[^A-Za-z0-9._-]+", "-", relative).strip("-.")[:80]
    if plain == relative and plain.casefold() not in taken:
        return plain
    return f"{plain}-{hashlib.sha256(relative.encode()).hexdigest()[:8]}".lstrip("-")


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file, or of the sorted (name, content hash) list of a folder's meshes and poses."""
    if path.is_file():
        return hashlib.sha256(path.read_bytes()).hexdigest()
    used: Sequence[Path] = sorted(
        p for p in path.iterdir() if p.is_file() and (p.suffix.lower() in SUFFIXES or p.name in {ASSEMBLY_FILE, *FORMS})
    )
    lines = (f"{p.name}\0{hashlib.sha256(p.read_bytes()).hexdigest()}\n" for p in used)
    return hashlib.sha256("".join(lines).encode("utf-8", "surrogateescape")).hexdigest()


def _portable(reason: str, item: ForeignItem) -> str:
    """Return a reason that reads the same wherever the folder lies."""
    return reason.replace(str(item.path), item.relative)
