"""The clouds and states of a dataset, made once and memory mapped.

A dataset stores recipes and labels. Meshes are made again from the recipes here, sampled, and written as plain arrays:
one folder per dataset (by its hash) and configuration. Everything in it follows from those two, whatever the number of
worker processes.
"""

from __future__ import annotations

import hashlib
import json
import logging
import shutil
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np

from sashimono.assembly import Assembly
from sashimono.d4pas.clouds import blueprint_cloud, normalised, part_clouds, unit_frame
from sashimono.d4pas.states import Masks, all_states, can_leave, right_next
from sashimono.errors import InputError
from sashimono.files import atomic_write
from sashimono.geometry.mesh import measures

if TYPE_CHECKING:
    from sashimono.learning.batch import DeviceClouds

VERSION = 2
"""Raised whenever the same dataset and configuration would give other arrays."""

MOST_PARTS = 62
"""Most parts of a blueprint: sets of parts are 64-bit masks."""

log = logging.getLogger(__name__)


@runtime_checkable
class LabelledBlueprint(Protocol):
    """What is needed of a dataset's blueprint."""

    @property
    def id(self) -> str: ...
    @property
    def family(self) -> str: ...
    @property
    def split(self) -> str: ...
    @property
    def parts(self) -> Sequence[str]: ...
    @property
    def masks(self) -> Masks: ...
    @property
    def complete(self) -> bool: ...
    @property
    def identical(self) -> Sequence[Sequence[int]]: ...
    @property
    def sequences(self) -> Sequence[Sequence[int]]: ...
    def assembly(self) -> Assembly: ...


@runtime_checkable
class Dataset(Protocol):
    """What is needed of a dataset."""

    @property
    def blueprints(self) -> Sequence[Any]:
        """Its blueprints, each a LabelledBlueprint."""
        ...

    @property
    def hash(self) -> str:
        """Of all that it holds."""
        ...


@dataclass(frozen=True, kw_only=True)
class CloudConfig:
    """What is sampled of each blueprint."""

    part_points: int = 768
    """Points of each part."""
    blueprint_points: int = 2048
    """Points of each blueprint, by area."""
    states: int = 64
    """Most distinct states of each blueprint."""
    seed: int = 0
    """Of points and states."""


ARRAYS = (
    "part_points",
    "part_area",
    "part_volume",
    "part_class",
    "blueprint_points",
    "blueprint_part",
    "blueprint_scale",
    "placed",
    "right",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class CloudCache:
    """Clouds and states of all blueprints, memory mapped. Parts and states are concatenated over the blueprints."""

    folder: Path
    ids: tuple[str, ...]
    """Blueprints, in the order of the dataset."""
    families: tuple[str, ...]
    """Family of each blueprint."""
    splits: tuple[str, ...]
    """Split of each blueprint."""
    complete: np.ndarray
    """Whether the conditions of each blueprint are proven to be all (blueprint,)."""
    counts: np.ndarray
    """Parts of each blueprint (blueprint,)."""
    first_part: np.ndarray
    """Where each blueprint's parts begin, and the end (blueprint + 1,)."""
    first_state: np.ndarray
    """Where each blueprint's states begin, and the end (blueprint + 1,)."""
    part_points: np.ndarray
    """Points in place in the blueprint's unit frame, with normals: (part, point, 6) float16. Any slice is a cloud."""
    part_area: np.ndarray
    """Surface area of each part in the unit frame (part,)."""
    part_volume: np.ndarray
    """Volume of each part in the unit frame (part,)."""
    part_class: np.ndarray
    """Parts of one blueprint with the same number have the same shape (part,)."""
    blueprint_points: np.ndarray
    """Points spread by area over the blueprint: (blueprint, point, 6) float16. Any slice is a cloud."""
    blueprint_part: np.ndarray
    """Index within the blueprint of the part that each of them is of (blueprint, point)."""
    blueprint_scale: np.ndarray
    """Radius of each blueprint: the unit frame's unit [m] (blueprint,)."""
    placed: np.ndarray
    """Distinct states with two or more parts to come, by number of placed parts: masks (state,) int64."""
    right: np.ndarray
    """Right next parts of each state, exactly: masks (state,) int64."""
    part_extras: Mapping[str, np.ndarray]
    """Arrays by part that were added: (part, ...)."""
    pair_extras: Mapping[str, np.ndarray]
    """Arrays by ordered pair of parts of one blueprint that were added: (pair, ...), rows of one blueprint's
    (i, j) by i, then j."""

    def __len__(self) -> int:
        return len(self.ids)

    def split(self, name: str, *, limit: int | None = None, complete: bool = False) -> np.ndarray:
        """Return the blueprints of a split, as ascending indices.

        Args:
            name: Of the split.
            limit: Only so many, over all families: the first by a hash of their ids.
            complete: Only those whose conditions are proven to be all.

        Raises InputError if there are none.
        """
        wanted = (np.array(self.splits) == name) & (self.complete if complete else True)
        found = np.flatnonzero(wanted)
        if not len(found):
            raise InputError(f"the dataset has no split {name!r}; it has {', '.join(sorted(set(self.splits)))}")
        if limit is not None:
            found = np.array(sorted(found, key=lambda k: hashlib.sha256(self.ids[k].encode()).digest())[:limit])
        return np.sort(found)

    @property
    def first_pair(self) -> np.ndarray:
        """Where each blueprint's ordered pairs of parts begin, and the end (blueprint + 1,)."""
        return np.concatenate([[0], np.cumsum(self.counts.astype(np.int64) ** 2)])

    def parts_of(self, blueprint: int) -> slice:
        """Return where a blueprint's parts are."""
        return slice(int(self.first_part[blueprint]), int(self.first_part[blueprint + 1]))

    def states_of(self, blueprint: int) -> slice:
        """Return where a blueprint's states are."""
        return slice(int(self.first_state[blueprint]), int(self.first_state[blueprint + 1]))

    def add_part_extra(self, name: str, array: np.ndarray) -> CloudCache:
        """Write an array by part beside the others, and return the cache with it."""
        assert len(array) == self.first_part[-1]
        _save(self.folder / f"part.{name}.npy", array)
        return open_cache(self.folder)

    def add_pair_extra(self, name: str, array: np.ndarray) -> CloudCache:
        """Write an array by ordered pair of parts beside the others, and return the cache with it."""
        assert len(array) == self.first_pair[-1]
        _save(self.folder / f"pair.{name}.npy", array)
        return open_cache(self.folder)

    def to(self, device: str, *, extras: Collection[str] | None = None) -> DeviceClouds:
        """Return the arrays as tensors on a device; on the CPU they stay memory mapped.

        Args:
            device: Where to.
            extras: Added arrays to bring along; all, if None.
        """
        from sashimono.learning.batch import DeviceClouds

        return DeviceClouds.of(self, device, extras=extras)


def cache_folder(data: Dataset, root: Path, config: CloudConfig) -> Path:
    """Return where the cache of a dataset and a configuration is."""
    key = json.dumps({"version": VERSION, "data": data.hash, **asdict(config)}, sort_keys=True)
    return root / f"clouds-{hashlib.sha256(key.encode()).hexdigest()[:16]}"


def make_cache(data: Dataset, root: Path, *, config: CloudConfig | None = None, workers: int = 1) -> CloudCache:
    """Return the cache of a dataset; made now if it is not there.

    Raises InputError if a blueprint cannot be made again.
    """
    config = config or CloudConfig()
    folder = cache_folder(data, root, config)
    if not (folder / "cache.json").exists():
        root.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f"{folder.name}.", dir=root))
        try:
            _write(data, scratch, config, workers)
            if folder.exists():
                shutil.rmtree(folder)
            scratch.chmod(0o755)
            scratch.rename(folder)
        except BaseException:
            shutil.rmtree(scratch, ignore_errors=True)
            raise
    return open_cache(folder)


def open_cache(folder: Path) -> CloudCache:
    """Return the cache in a folder.

    Raises InputError if there is none.
    """
    try:
        head = json.loads((folder / "cache.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{folder}: no cache of clouds: {error.strerror}") from error
    extras: dict[str, dict[str, np.ndarray]] = {"part": {}, "pair": {}}
    for path in sorted(folder.glob("pa*.*.npy")):
        kind, name = path.name.removesuffix(".npy").split(".", 1)
        extras[kind][name] = np.load(path, mmap_mode="c")
    return CloudCache(
        folder=folder,
        ids=tuple(head["ids"]),
        families=tuple(head["families"]),
        splits=tuple(head["splits"]),
        complete=np.array(head["complete"], dtype=bool),
        counts=np.array(head["counts"], dtype=np.int64),
        first_part=np.concatenate([[0], np.cumsum(head["counts"])]),
        first_state=np.concatenate([[0], np.cumsum(head["states"])]),
        part_extras=extras["part"],
        pair_extras=extras["pair"],
        # copy on write: torch refuses to wrap arrays that cannot be written
        **{name: np.load(folder / f"{name}.npy", mmap_mode="c") for name in ARRAYS},
    )


def state_pool(masks: Masks, most: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return up to so many distinct reachable states with two or more parts to come, and the right next parts of each.

    All, if there are no more. Otherwise as evenly over the number of placed parts as there are states, each met by
    taking parts out at random. Ordered by the number of placed parts.
    """
    count = len(masks)
    known = all_states(masks, limit=most + count + 1)
    if known is not None:
        known = {state: right for state, right in known.items() if state.bit_count() <= count - 2}
    if known is None or len(known) > most:
        known = {state: right_next(masks, state) for state in _states_by_walks(masks, most, rng)}
    placed = np.array(sorted(known, key=lambda state: (state.bit_count(), state)), dtype=np.int64)
    return placed, np.array([known[int(state)] for state in placed], dtype=np.int64)


def _states_by_walks(masks: Masks, most: int, rng: np.random.Generator) -> list[int]:
    count = len(masks)
    levels: list[dict[int, None]] = [{} for _ in range(count - 1)]
    for _ in range(most):
        remaining = (1 << count) - 1
        while remaining:
            others = [
                remaining & ~(1 << part)
                for part in range(count)
                if remaining >> part & 1 and can_leave(masks, part, remaining & ~(1 << part))
            ]
            if not others:  # parts that never leave one at a time
                break
            remaining = others[int(rng.integers(len(others)))]
            if remaining.bit_count() < len(levels):
                levels[remaining.bit_count()].setdefault(remaining)
    chosen: list[int] = []
    waiting = [list(level) for level in levels]
    while len(chosen) < most and any(waiting):
        for level in waiting:
            if level and len(chosen) < most:
                chosen.append(level.pop(0))
    return chosen


def _write(data: Dataset, folder: Path, config: CloudConfig, workers: int) -> None:
    blueprints = data.blueprints
    counts = [len(blueprint.parts) for blueprint in blueprints]
    first = np.concatenate([[0], np.cumsum(counts)])
    large = [blueprint.id for blueprint in blueprints if len(blueprint.parts) > MOST_PARTS]
    if large:
        raise InputError(f"{large[0]}: more than {MOST_PARTS} parts; leave it out")

    def array(name: str, shape: tuple[int, ...], dtype: type) -> np.memmap:
        return np.lib.format.open_memmap(folder / f"{name}.npy", mode="w+", dtype=dtype, shape=shape)

    parts, total = int(first[-1]), len(blueprints)
    out = {
        "part_points": array("part_points", (parts, config.part_points, 6), np.float16),
        "part_area": array("part_area", (parts,), np.float32),
        "part_volume": array("part_volume", (parts,), np.float32),
        "part_class": array("part_class", (parts,), np.int16),
        "blueprint_points": array("blueprint_points", (total, config.blueprint_points, 6), np.float16),
        "blueprint_part": array("blueprint_part", (total, config.blueprint_points), np.uint8),
        "blueprint_scale": array("blueprint_scale", (total,), np.float32),
    }
    pools: list[tuple[np.ndarray, np.ndarray]] = []
    with _mapped(partial(sample_blueprint, config=config), blueprints, workers) as sampled:
        for k, made in enumerate(sampled):
            here = slice(int(first[k]), int(first[k + 1]))
            for name, values in made.items():
                if name.startswith("part_"):
                    out[name][here] = values
                elif name.startswith("blueprint_"):
                    out[name][k] = values
            pools.append((made["placed"], made["right"]))
            if (k + 1) % 1000 == 0:
                log.info("%d of %d blueprints sampled", k + 1, total)
    for values in out.values():
        values.flush()
    _save(folder / "placed.npy", np.concatenate([placed for placed, _ in pools]))
    _save(folder / "right.npy", np.concatenate([right for _, right in pools]))
    head = {
        "version": VERSION,
        "data": data.hash,
        "config": asdict(config),
        "ids": [blueprint.id for blueprint in blueprints],
        "families": [blueprint.family for blueprint in blueprints],
        "splits": [blueprint.split for blueprint in blueprints],
        "complete": [bool(blueprint.complete) for blueprint in blueprints],
        "counts": counts,
        "states": [len(placed) for placed, _ in pools],
    }
    (folder / "cache.json").write_text(json.dumps(head), encoding="utf-8")


def sample_blueprint(blueprint: LabelledBlueprint, config: CloudConfig) -> dict[str, np.ndarray]:
    """Return all that the cache holds of one blueprint, by name."""
    assembly = blueprint.assembly()
    if tuple(assembly.names) != tuple(blueprint.parts):
        raise InputError(f"{blueprint.id}: its recipe makes other parts here; install the release that made the data")
    seed = int.from_bytes(hashlib.sha256(f"{config.seed}/{blueprint.id}".encode()).digest()[:4], "big")
    clouds = part_clouds(assembly, config.part_points, seed=seed)
    center, scale = unit_frame(clouds[..., :3])
    whole, owner = blueprint_cloud(assembly, config.blueprint_points, seed=seed)
    placed, right = state_pool(blueprint.masks, config.states, np.random.default_rng([seed, 3]))
    meshes = [(part.vertices_world, part.faces) for part in assembly.parts]
    return {
        "part_points": normalised(clouds, center.tolist(), scale).astype(np.float16),
        "part_area": np.array([measures.area(*each) for each in meshes]) / scale**2,
        "part_volume": np.array([measures.volume(*each) for each in meshes]) / scale**3,
        "part_class": shape_classes(len(assembly), blueprint.identical),
        "blueprint_points": normalised(whole, center.tolist(), scale).astype(np.float16),
        "blueprint_part": owner.astype(np.uint8),
        "blueprint_scale": np.array(scale),
        "placed": placed,
        "right": right,
    }


def shape_classes(count: int, identical: Sequence[Sequence[int]]) -> np.ndarray:
    """Return a number by part, the same for parts of the same shape: the first such part's index."""
    out = np.arange(count)
    for members in identical:
        out[list(members)] = min(members)
    return out


@contextmanager
def _mapped(
    function: Callable[[Any], dict[str, np.ndarray]], items: Sequence[Any], workers: int
) -> Iterator[Iterator[dict[str, np.ndarray]]]:
    if workers <= 1:
        yield map(function, items)
        return
    # spawned: forking a process that has started threads of numerical libraries may hang
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        yield pool.map(function, items, chunksize=8)


def _save(path: Path, array: np.ndarray) -> None:
    with atomic_write(path) as scratch, scratch.open("wb") as file:
        np.save(file, array)
