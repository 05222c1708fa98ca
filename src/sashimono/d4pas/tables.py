"""The files of a dataset: Parquet that any reader opens, a manifest, and what could not be labelled."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sashimono.errors import InputError, SashimonoError
from sashimono.files import atomic_write

if TYPE_CHECKING:
    import pyarrow

FORMAT, FORMAT_VERSION = "sashimono.d4pas", 1
SOURCES = "sources.json"
"""Where other people's assemblies are on this machine."""

MADE_WITH = ("sashimono", "numpy", "scipy", "manifold3d", "numba", "pyarrow")
"""Packages whose versions the manifest names."""


def require_pyarrow() -> Any:
    """Return pyarrow with its Parquet module; SashimonoError names the extra where it is missing."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise SashimonoError(
            "reading and writing datasets needs pyarrow; install the extra: pip install 'sashimono[dataset]'"
        ) from None
    return pyarrow


def schemas() -> dict[str, pyarrow.Schema]:
    """Return the columns of each file, by file stem."""
    pa = require_pyarrow()
    text, small = pa.string(), pa.int16()
    points = pa.list_(pa.list_(pa.float32()))
    blueprints = {
        "id": text, "family": text, "version": small, "params": text, "seed": pa.int64(), "split": text,
        "n_parts": small, "parts": pa.list_(text), "clauses": pa.list_(pa.list_(pa.list_(small))),
        "executable": pa.list_(pa.list_(pa.list_(small))),
        "stages": pa.list_(pa.list_(text)), "complete": pa.bool_(), "cut_short": pa.list_(small),
        "motion_class": text, "orders": text, "identical": pa.list_(pa.list_(small)), "geometry_hash": text,
        "descriptor": pa.list_(pa.float32()),
    }  # fmt: skip
    steps = {"id": text, "order_index": small, "part": small, "waypoints": points, "contact": text}
    tables = {
        "blueprints": blueprints,
        "sequences": {"id": text, "order": pa.list_(small)},
        "steps": {**steps, "points": points, "normals": points, "radius": pa.float32(), "begins": pa.float32()},
        "failures": {"id": text, "family": text, "params": text, "seed": pa.int64(), "reason": text},
    }
    return {name: pa.schema([pa.field(key, kind) for key, kind in table.items()]) for name, table in tables.items()}


def write_tables(out: Path, rows: Mapping[str, Sequence[Mapping[str, Any]]]) -> None:
    """Write the Parquet files of a dataset; the same rows give the same bytes with the same pyarrow."""
    pa = require_pyarrow()
    for name, schema in schemas().items():
        table = pa.Table.from_pylist([dict(row) for row in rows[name]], schema=schema)
        with atomic_write(out / f"{name}.parquet") as scratch:
            pa.parquet.write_table(table, scratch, compression="zstd", compression_level=15)


def write_manifest(out: Path, content: Mapping[str, Any]) -> None:
    """Write the manifest, last of all: a folder without one is no dataset yet."""
    with atomic_write(out / "manifest.json") as scratch:
        scratch.write_text(json.dumps(content, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def read_manifest(folder: Path) -> dict[str, Any]:
    """Return a dataset's manifest; InputError if the folder holds no dataset that this release reads."""
    path = folder / "manifest.json"
    if not path.is_file():
        raise InputError(f"{folder}: no manifest.json, so no finished dataset; make one with 'sashimono dataset make'")
    try:
        content = json.loads(path.read_bytes())
    except ValueError as error:
        raise InputError(f"{path}: not readable JSON ({error}); make the dataset again") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f"{path}: not the manifest of a {FORMAT} dataset; name the dataset's folder")
    if content.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"{path}: format version {content.get('format_version')}, this release reads {FORMAT_VERSION};"
            " install the release that made it"
        )
    return content


def write_sources(out: Path, base: Path) -> None:
    """Write where other people's assemblies are on this machine; it is no part of the dataset."""
    with atomic_write(out / SOURCES) as scratch:
        scratch.write_text(json.dumps({"folder": str(base)}) + "\n", encoding="utf-8")


def read_sources(folder: Path) -> Path:
    """Return the folder that the paths of other people's assemblies start from: the current one if none is known."""
    path = folder / SOURCES
    if not path.is_file():
        return Path()
    try:
        return Path(json.loads(path.read_bytes())["folder"])
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f'{path}: should hold {{"folder": PATH}}; mend or remove it') from error


def read_table(folder: Path, name: str) -> list[dict[str, Any]]:
    """Return a table's rows; InputError if the file is missing or broken."""
    pa = require_pyarrow()
    path = folder / f"{name}.parquet"
    try:
        return pa.parquet.read_table(path, partitioning=None).to_pylist()
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0][:120] if path.exists() else "no such file"
        raise InputError(f"{path}: cannot be read ({reason}); make the dataset again") from error


def package_versions() -> dict[str, str]:
    """Return the versions of the packages that shape a dataset."""
    found = {}
    for name in MADE_WITH:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "unknown"
    return found
