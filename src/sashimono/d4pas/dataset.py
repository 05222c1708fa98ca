"""A dataset as values: blueprints with their labels; geometry is made again from the recipe when asked for."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from sashimono.assembly import Assembly
from sashimono.d4pas import tables
from sashimono.d4pas.recipe import Recipe, build_assembly
from sashimono.d4pas.states import Masks, random_state, right_next
from sashimono.errors import InputError

SHIPPED = "v1"
"""The dataset in the package."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Blueprint:
    """One product with its labels. Parts are given by position; part sets as bit masks."""

    id: str
    family: str
    version: int
    params: Mapping[str, Any]
    seed: int
    split: str
    parts: tuple[str, ...]
    """Names, in part order."""
    masks: Masks
    """By part, the blockers of each clause: the part may leave when all of one clause are gone. A part that never
    leaves before all others has the one clause of all others."""
    executable: Masks | None
    """The same with a contact along the motion that was found: a grasp by two fingertips, or a push through the centre
    of mass. A part without any has no clause. None in datasets from before version 1.1."""
    complete: bool
    """Whether the conditions are proven to be all, for motions of ``motion_class``."""
    motion_class: str
    orders: int | None
    """Exact number of complete orders; None where counting ran out of its budget."""
    identical: tuple[tuple[int, ...], ...]
    """Classes of parts of one shape."""
    geometry_hash: str
    """First 16 digits of the hash of the geometry that was labelled."""
    sequences: tuple[tuple[int, ...], ...] = field(repr=False)
    """Listed assembly orders, base part first."""
    source: Path | None = None
    """Folder or file of an assembly that no recipe makes."""

    def __len__(self) -> int:
        return len(self.parts)

    @property
    def recipe(self) -> Recipe:
        """What makes the geometry again."""
        return Recipe(family=self.family, version=self.version, params=self.params, seed=self.seed)

    def assembly(self) -> Assembly:
        """Return the parts in place [m]: made again from the recipe, or read from where they came from.

        Raises InputError if this release draws the family otherwise, or the file is gone.
        """
        if self.source is not None:
            from sashimono.d4pas.foreign import read_foreign

            return read_foreign(self.source, self.params)
        return build_assembly(self.recipe)

    def state(self, placed: int) -> int:
        """Return the right next parts for the placed ones: y as a mask (`sashimono.d4pas.states`)."""
        return right_next(self.masks, placed)

    def random_state(self, count: int, rng: np.random.Generator) -> int:
        """Return a reachable set of this many placed parts."""
        return random_state(self.masks, count, rng)


class Dataset(Sequence[Blueprint]):
    """The blueprints of one folder. Indexed by position or by id."""

    def __init__(self, folder: Path, manifest: Mapping[str, Any], blueprints: Sequence[Blueprint]) -> None:
        self.folder = folder
        self.manifest = manifest
        self.blueprints = tuple(blueprints)
        self._by_id = {blueprint.id: blueprint for blueprint in self.blueprints}

    def __len__(self) -> int:
        return len(self.blueprints)

    def __getitem__(self, key: int | slice | str) -> Any:
        """Return a blueprint by position or id, or several by a slice; InputError for an unknown id."""
        if isinstance(key, str):
            if key not in self._by_id:
                raise InputError(
                    f"{self.folder}: no blueprint {key!r}; ids are like {next(iter(self._by_id), 'none')!r}"
                )
            return self._by_id[key]
        return self.blueprints[key]

    def __iter__(self) -> Iterator[Blueprint]:
        return iter(self.blueprints)

    def __repr__(self) -> str:
        return f"Dataset({self.manifest['name']!r}, {len(self)} blueprints)"

    @property
    def hash(self) -> str:
        """Content hash."""
        return str(self.manifest["content_hash"])

    def split(self, name: str) -> tuple[Blueprint, ...]:
        """Return the blueprints of one split."""
        return tuple(blueprint for blueprint in self.blueprints if blueprint.split == name)

    @cached_property
    def steps(self) -> dict[str, list[dict[str, Any]]]:
        """Motions and contacts by blueprint, as in ``steps.parquet``; read when first asked for."""
        out: dict[str, list[dict[str, Any]]] = {}
        for row in tables.read_table(self.folder, "steps"):
            out.setdefault(row["id"], []).append(row)
        return out

    @cached_property
    def failures(self) -> list[dict[str, Any]]:
        """Recipes that have no labels, with the reason."""
        return tables.read_table(self.folder, "failures")

    @cached_property
    def descriptors(self) -> np.ndarray:
        """Geometry descriptors, (blueprint, number)."""
        return np.array([row["descriptor"] for row in tables.read_table(self.folder, "blueprints")])


def load(name: str | Path = SHIPPED) -> Dataset:
    """Return the shipped dataset by its name, or the one in a folder; InputError if there is none.

    The name comes first: a folder that is called so is ``"./v1"``.

    >>> data = load("v1")
    >>> blueprint = data.split("train")[0]
    >>> clouds = part_clouds(blueprint.assembly(), 512)
    """
    if name == SHIPPED:
        with as_file(files("sashimono.d4pas") / "data" / SHIPPED) as folder:
            return _read(folder)
    return _read(Path(name))


def _read(folder: Path) -> Dataset:
    manifest = tables.read_manifest(folder)
    sequences: dict[str, list[tuple[int, ...]]] = {}
    for row in tables.read_table(folder, "sequences"):
        sequences.setdefault(row["id"], []).append(tuple(row["order"]))
    rows = tables.read_table(folder, "blueprints")
    sources = tables.read_sources(folder)
    try:
        blueprints = [_blueprint(row, tuple(sequences.get(row["id"], ())), sources) for row in rows]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{folder}: blueprints.parquet is not as it was written ({error!r}); make it again") from error
    return Dataset(folder, manifest, blueprints)


def _blueprint(row: Mapping[str, Any], sequences: tuple[tuple[int, ...], ...], sources: Path) -> Blueprint:
    count = row["n_parts"]
    masks = []
    for part, clauses in enumerate(row["clauses"]):
        own = tuple(map(_mask, clauses))
        masks.append(own or (((1 << count) - 1) & ~(1 << part),))
    grasped = row.get("executable")
    params = json.loads(row["params"])
    return Blueprint(
        id=row["id"],
        family=row["family"],
        version=row["version"],
        params=params,
        seed=row["seed"],
        split=row["split"],
        parts=tuple(row["parts"]),
        masks=tuple(masks),
        executable=None if grasped is None else tuple(tuple(map(_mask, clauses)) for clauses in grasped),
        complete=row["complete"],
        motion_class=row["motion_class"],
        orders=int(row["orders"]) if row["orders"] else None,
        identical=tuple(tuple(members) for members in row["identical"]),
        geometry_hash=row["geometry_hash"],
        sequences=sequences,
        source=sources / params["path"] if "path" in params else None,
    )


def _mask(parts: Sequence[int]) -> int:
    return sum(1 << part for part in parts)
