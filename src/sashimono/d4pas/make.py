"""Make a dataset: recipes in, Parquet out; resumable, the same bytes however many workers."""

from __future__ import annotations

import hashlib
import json
import resource
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sashimono import __version__
from sashimono.d4pas import tables
from sashimono.d4pas.families import families
from sashimono.d4pas.foreign import ForeignItem, find_assemblies, foreign_rows
from sashimono.d4pas.journal import Journal
from sashimono.d4pas.labels import LabelConfig
from sashimono.d4pas.recipe import Recipe, draw_recipe
from sashimono.d4pas.recipe_book import SHIPPED, RecipeBook, read_book
from sashimono.d4pas.rows import Outcome, RowConfig, canonical, digest, make_rows
from sashimono.d4pas.splits import REAL, assign_splits
from sashimono.d4pas.workers import DIED, run_items
from sashimono.errors import InputError, SashimonoError

Progress = Callable[[int, int, int], None]
"""Called with (done, total, failed)."""

JOURNAL = "journal.jsonl"
TIMINGS = "timings.json"


@dataclass(frozen=True, kw_only=True)
class MakeItem:
    """One member of one family."""

    family: str
    seed: int
    pair: bool
    turned: float
    whole: float

    @property
    def key(self) -> str:
        """Name of the item within a run."""
        return f"{self.family}-{self.seed:06d}{'-pair' if self.pair else ''}"


@dataclass(frozen=True, kw_only=True)
class Made:
    """What came of a run."""

    blueprints: int
    sequences: int
    failures: int
    content_hash: str


Runner = Callable[[Sequence[Any], Callable[[Any], dict[str, Any]]], Iterator[tuple[Any, dict[str, Any] | None]]]
"""Works off items; yields (item, result or None)."""


def make_dataset(
    source: str,
    out: Path,
    *,
    workers: int = 1,
    limit: int | None = None,
    run: Runner | None = None,
    progress: Progress = lambda done, total, failed: None,
) -> Made:
    """Make the dataset of a recipe book, or of a folder of other people's assemblies; return what it holds.

    Killed at any moment, the same call goes on. Raises InputError for a recipe or folder that cannot be used.

    Args:
        source: A shipped book's name, a TOML file, or a folder (`sashimono.d4pas.foreign`).
        out: Folder to write into.
        workers: Processes.
        limit: Only so many items, the first.
        run: What works the items off, instead of processes of this machine.
        progress: Called after each item.
    """
    tables.require_pyarrow()
    book, items = _items(source)
    items = items if limit is None else items[:limit]
    config = RowConfig(labels=LabelConfig(max_sequences=book.max_sequences), max_steps=book.max_steps)
    identity = _identity(book, items, config)
    if (out / "manifest.json").is_file():
        return _finished(out, identity)
    out.mkdir(parents=True, exist_ok=True)
    journal = Journal(out / JOURNAL, {"identity": identity})
    todo = [item for item in items if item.key not in journal.done]
    failed = sum(entry["rows"] is None for entry in journal.done.values())
    progress(len(items) - len(todo), len(items), failed)
    runner = run or partial(run_items, workers=workers)
    try:
        for item, result in runner(todo, partial(work, config=config)):
            # an item that killed its worker is not tried here; family and seed are enough to draw it again
            params = item.params if isinstance(item, ForeignItem) else {}
            entry = result or {**_about(item, params), "rows": None, "reason": DIED, "seconds": {}, "peak": 0}
            failed += entry["rows"] is None
            journal.add(item.key, entry)
            progress(len(journal.done), len(items), failed)
    finally:
        journal.close()
    entries = [journal.done[item.key] for item in items]
    if items and isinstance(items[0], ForeignItem):
        tables.write_sources(out, items[0].base)
    made = _write(out, entries, book, identity)
    journal.remove()
    return made


def work(item: MakeItem | ForeignItem, *, config: RowConfig) -> dict[str, Any]:
    """Return a journal entry: what came of one item. A fault of ours is recorded with the item, not raised."""
    params: Mapping[str, Any] = {}
    try:
        if isinstance(item, ForeignItem):
            params = item.params
            outcome = foreign_rows(item, config=config)
        else:
            recipe = _recipe(item)
            params = recipe.params
            outcome = make_rows(recipe, config=config)
    except (OSError, ImportError) as error:  # a fault of this machine: the run stops, and can go on once it is mended
        raise SashimonoError(f"{item.key}: {error}. Mend that; the same command goes on from here.") from error
    except Exception as error:  # the run goes on, and the reason is in failures.parquet
        outcome = Outcome(rows=None, reason=f"{type(error).__name__}: {error}", seconds={})
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return {**_about(item, params), **asdict(outcome), "peak": peak}


def _recipe(item: MakeItem) -> Recipe:
    return draw_recipe(item.family, item.seed, turned=item.turned, whole=item.whole, pair=item.pair)


def _items(source: str) -> tuple[RecipeBook, list[MakeItem] | list[ForeignItem]]:
    if source not in SHIPPED and Path(source).is_dir():
        items = find_assemblies(Path(source))
        return RecipeBook(name=Path(source).resolve().name, version="0", counts={}), items
    book = read_book(source)
    return book, [
        MakeItem(family=family, seed=seed, pair=pair, turned=book.turned, whole=book.whole)
        for family, seed, pair in book.items()
    ]


def _about(item: MakeItem | ForeignItem, params: Mapping[str, Any]) -> dict[str, Any]:
    seed = 0 if isinstance(item, ForeignItem) else item.seed
    return {"family": item.family, "params": json.dumps(params, sort_keys=True), "seed": seed}


def _identity(book: RecipeBook, items: Sequence[Any], config: RowConfig) -> str:
    """What a run is: two with the same identity make the same dataset."""
    content = {
        "book": asdict(book),
        "items": [item.params if isinstance(item, ForeignItem) else item.key for item in items],
        "families": {name: family.version for name, family in families().items()},
        "config": asdict(config),
        "version": __version__,
    }
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def _finished(out: Path, identity: str) -> Made:
    manifest = tables.read_manifest(out)
    if manifest.get("identity") != identity:
        raise InputError(f"{out}: holds another finished dataset ({manifest['name']}); name another folder")
    (out / JOURNAL).unlink(missing_ok=True)  # killed between the manifest and this
    counts = manifest["counts"]
    return Made(
        blueprints=counts["blueprints"],
        sequences=counts["sequences"],
        failures=counts["failures"],
        content_hash=manifest["content_hash"],
    )


def _write(out: Path, entries: Sequence[Mapping[str, Any]], book: RecipeBook, identity: str) -> Made:
    solved = [entry["rows"] for entry in entries if entry["rows"] is not None]
    blueprints = [dict(rows["blueprint"]) for rows in solved]
    is_foreign = not book.counts and not book.pairs
    splits = [REAL] * len(solved) if is_foreign else assign_splits(blueprints, config=book.split)
    for row, split in zip(blueprints, splits, strict=True):
        row["split"] = split
    rows: dict[str, list[dict[str, Any]]] = {
        "blueprints": blueprints,
        "sequences": [{"id": r["blueprint"]["id"], "order": order} for r in solved for order in r["sequences"]],
        "steps": [{"id": r["blueprint"]["id"], **step} for r in solved for step in r["steps"]],
        "failures": [
            {key: entry[key] for key in ("family", "params", "seed", "reason")} | {"id": entry["key"]}
            for entry in entries
            if entry["rows"] is None
        ],
    }
    texts = [canonical({"rows": r, "split": split}) for r, split in zip(solved, splits, strict=True)]
    texts += [canonical(row) for row in rows["failures"]]
    content_hash = digest(texts)
    counts = {name: len(table) for name, table in rows.items()} | {
        split: splits.count(split) for split in sorted(set(splits))
    }
    tables.write_tables(out, rows)
    (out / TIMINGS).write_text(json.dumps(_timings(entries), indent=1) + "\n", encoding="utf-8")
    tables.write_manifest(
        out,
        {
            "format": tables.FORMAT,
            "format_version": tables.FORMAT_VERSION,
            "name": book.name,
            "version": book.version,
            "identity": identity,
            "content_hash": content_hash,
            "counts": counts,
            "families": {name: family.version for name, family in families().items() if name in book.counts},
            "unseen": list(book.split.unseen),
            "made_with": tables.package_versions(),
        },
    )
    return Made(
        blueprints=len(blueprints),
        sequences=len(rows["sequences"]),
        failures=len(rows["failures"]),
        content_hash=content_hash,
    )


def _timings(entries: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Processor time by number of parts; not part of the dataset, since it differs from run to run."""
    by_parts: dict[int, list[Mapping[str, float]]] = {}
    for entry in entries:
        if entry["rows"] is not None:
            by_parts.setdefault(entry["rows"]["blueprint"]["n_parts"], []).append(entry["seconds"])
    every = [seconds for group in by_parts.values() for seconds in group]

    def row(group: Sequence[Mapping[str, float]]) -> dict[str, Any]:
        out: dict[str, Any] = {"blueprints": len(group)}
        for stage in ("build", "label", "steps"):
            values = [seconds[stage] for seconds in group]
            out[stage] = {"median": float(np.median(values)), "p90": float(np.quantile(values, 0.9))}
            out[stage]["sum"] = float(np.sum(values))
        return out

    return {
        "seconds_by_parts": {str(parts): row(group) for parts, group in sorted(by_parts.items())},
        "seconds": row(every) if every else {},
        "peak_memory_mb": max((entry["peak"] for entry in entries), default=0) / 1024.0,
    }
