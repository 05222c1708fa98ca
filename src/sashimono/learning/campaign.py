"""A campaign: several models, one after the other or side by side, for so many minutes, as often as there is time.

Each call goes on where the last one ended. What is worth keeping lies flat in one folder and is whole at every moment;
clouds and checkpoints lie in another, that may be thrown away.
"""

from __future__ import annotations

import csv
import json
import logging
import sys
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import torch

from sashimono.errors import InputError
from sashimono.files import atomic_write
from sashimono.learning.batch import DeviceClouds
from sashimono.learning.cloud_cache import CloudCache, CloudConfig, Dataset, make_cache, open_cache
from sashimono.learning.config_files import TrainConfig, from_values, read_config
from sashimono.learning.devices import Place, find_place
from sashimono.learning.evaluate import evaluate, heuristics, read_evaluation, write_evaluation
from sashimono.learning.predictor import NetworkPredictor
from sashimono.learning.registry import BY_REWARD, needs_more, prepared
from sashimono.learning.report import table_one
from sashimono.learning.train import CHECKPOINT, LOG, train
from sashimono.learning.weights import Weights, load_model, read_weights

EVALUATION = "evaluation.json"
POLL = 5.0
"""Seconds between two looks at what the lanes have written."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One model of a campaign."""

    config: str
    """A shipped training configuration, or a .toml file."""
    share: float = 1.0
    """Share of its lane's time, relative to the others in that lane."""
    lane: int = 0
    """Lanes run side by side on a GPU, each in a process of its own; on CPUs one after the other."""
    blueprints: int | None = None
    """Blueprints a batch, instead of the configuration's."""
    rate: float | None = None
    """Highest learning rate, instead of the configuration's."""

    @property
    def name(self) -> str:
        """What the model's files are called."""
        return Path(self.config).stem if self.config.endswith(".toml") else self.config

    def read(self) -> TrainConfig:
        """Return the training configuration.

        Raises InputError for a kind that a campaign does not train.
        """
        found = read_config(self.config)
        if found.kind == BY_REWARD:
            raise InputError(f"{self.config}: a campaign trains no policies; run 'sashimono train {self.config}'")
        batch, optimizer = found.batch, found.optimizer
        if self.blueprints is not None:
            batch = replace(batch, blueprints=self.blueprints)
        if self.rate is not None:
            optimizer = replace(optimizer, rate=self.rate)
        return replace(found, batch=batch, optimizer=optimizer)


@dataclass(frozen=True, kw_only=True)
class CampaignConfig:
    """What a campaign trains."""

    model: tuple[Entry, ...]
    """In the order in which they are trained."""
    evaluated: int = 300
    """Blueprints of ``split`` that each model is evaluated on."""
    states: int = 8
    """States of each of them."""
    split: str = "val"
    reserve: float = 0.1
    """Share of the time that is kept for evaluation."""
    again: float = 0.5
    """Highest learning rate when a model is trained further, over that of the first time."""
    threads: int = 1
    """Threads of torch in each lane."""


@dataclass(frozen=True, kw_only=True)
class Folders:
    """Where a campaign writes."""

    out: Path
    """Weights by model, ``log.csv``, ``results.json``."""
    work: Path
    """Clouds and checkpoints."""
    start: Path | None
    """Weights to begin with where ``out`` has none."""


def read_campaign(name: str | Path) -> CampaignConfig:
    """Return a campaign: of a .toml file, or a shipped one by its name.

    Raises InputError if there is none, or its fields are wrong.
    """
    folder = files("sashimono.learning") / "campaigns"
    path = Path(name)
    if path.suffix == ".toml":
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        text = path.read_text(encoding="utf-8")
    else:
        shipped = sorted(item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml"))
        if str(name) not in shipped:
            raise InputError(f"no campaign {str(name)!r}; give a .toml file or {', '.join(shipped)}")
        text = (folder / f"{name}.toml").read_text(encoding="utf-8")
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name}: no TOML: {error}") from error
    config = from_values(CampaignConfig, values, str(name))
    names = [entry.name for entry in config.model]
    if len(set(names)) < len(names) or not names:
        raise InputError(f"{name}: each model is named once, and one at least")
    return config


def run_campaign(
    config: CampaignConfig,
    load: Callable[[], Dataset],
    *,
    minutes: float,
    folders: Folders,
    device: str | None = None,
    workers: int = 1,
    clouds: CloudConfig | None = None,
    say: Callable[[str], None] = lambda line: None,
) -> int:
    """Train and evaluate for so many minutes, all included; return the number of lanes that failed.

    Args:
        config: The campaign.
        load: Returns the dataset; called in each process.
        minutes: From now on.
        folders: Where to write.
        device: A GPU if there is one, unless given.
        workers: Processes that make the clouds.
        clouds: What is sampled.
        say: Called with each line of progress.
    """
    begun = time.time()
    deadline = begun + 60 * minutes
    for folder in (folders.out, folders.work):
        folder.mkdir(parents=True, exist_ok=True)
    device = device or ("cuda:0" if torch.cuda.is_available() else "cpu")
    data = load()
    cache = make_cache(data, folders.work, config=clouds, workers=workers)
    say(f"{len(cache)} blueprints, clouds ready after {time.time() - begun:.0f} s, on {device}")
    numbers = sorted({entry.lane for entry in config.model})
    lanes = [[entry for entry in config.model if entry.lane == number] for number in numbers]
    if not device.startswith("cuda"):
        lanes = [list(config.model)]
    running: list[BaseProcess] = []

    def begin(lane: Sequence[Entry]) -> None:
        arguments = (lane, config, load, cache.folder, folders, device, deadline)
        running.append(get_context("spawn").Process(target=_run_lane, args=arguments))
        running[-1].start()

    try:
        waiting = []
        for lane in lanes:  # those that need clouds only need not wait for what the others need
            kinds = [entry.read().kind for entry in lane]
            if needs_more(kinds):
                waiting.append((lane, kinds))
            else:
                begin(lane)
        for lane, kinds in waiting:
            prepared(cache, data, kinds, workers=workers)
            say(f"more for {', '.join(entry.name for entry in lane)} ready after {time.time() - begun:.0f} s")
            begin(lane)
        evaluate_heuristics(config, data, cache, folders)
        while any(process.is_alive() for process in running):
            time.sleep(min(POLL, max(0.2, 2 * minutes)))
            _collect(config, folders)
    except BaseException:
        for process in running:
            process.terminate()
        raise
    failed = sum(process.exitcode != 0 for process in running)
    results = _collect(config, folders)
    say(results["table"])
    say(f"{time.time() - begun:.0f} s in all" + (f"; {failed} lanes failed" if failed else ""))
    return failed


def _run_lane(
    entries: Sequence[Entry],
    config: CampaignConfig,
    load: Callable[[], Dataset],
    cache_folder: Path,
    folders: Folders,
    device: str,
    deadline: float,
) -> None:
    """Train and evaluate the models of one lane, so that all is over at the deadline.

    A model that fails leaves its time to the next; the process then exits with 1.
    """
    logging.basicConfig(stream=sys.stderr, format="%(name)s: %(message)s", level=logging.WARNING)
    torch.set_num_threads(config.threads)
    failed = False
    data, cache = load(), open_cache(cache_folder)
    with find_place(device) as place:
        clouds = cache.to(place.device, extras={name for entry in entries for name in entry.read().batch.extras})
        left = deadline - time.time()
        for k, entry in enumerate(entries):
            waiting = sum(other.share for other in entries[k:])
            seconds = (deadline - time.time()) * entry.share / waiting
            reserved = left * config.reserve * entry.share / sum(other.share for other in entries)
            minutes = max(seconds - reserved, 1.0) / 60
            try:
                _train_entry(entry, config, cache, clouds, folders, place, data.hash, minutes)
                _evaluate_entry(entry, config, data, cache, clouds, folders)
            except Exception:
                log.exception("%s failed", entry.name)
                failed = True
    if failed:
        sys.exit(1)


def _train_entry(
    entry: Entry,
    config: CampaignConfig,
    cache: CloudCache,
    clouds: DeviceClouds,
    folders: Folders,
    place: Place,
    data: str,
    minutes: float,
) -> None:
    run = folders.work / entry.name
    asked = entry.read()
    start = None
    checkpoint, trained = run / CHECKPOINT, 0.0
    if checkpoint.exists():
        trained = float(torch.load(checkpoint, map_location="cpu", weights_only=True)["done"]["minutes"])
    else:
        start = find_start(entry.name, asked, folders, data)
    if start is not None:
        asked = replace(asked, optimizer=replace(asked.optimizer, rate=config.again * asked.optimizer.rate))
    before = dict(start.card) if start is not None else {}
    earlier = {f"{key}_before": before.get(key, 0) + before.get(f"{key}_before", 0) for key in ("states", "minutes")}
    train(
        asked,
        cache,
        run,
        place=place,
        minutes=trained + minutes,
        start=None if start is None else start.state,
        clouds=clouds,
        card={"data": data, **earlier},
        weights=folders.out / f"{entry.name}.npz",
    )


def find_start(name: str, config: TrainConfig, folders: Folders, data: str) -> Weights | None:
    """Return the newest weights of a model, if there are any that fit: of an earlier call, or those to begin with.

    Weights that were trained on other data than that of the hash ``data`` do not fit: what is a test there may have
    been trained on.
    """
    shipped = Path(str(files("sashimono.learning") / "weights"))
    for folder in (folders.out, folders.start, shipped):
        if folder is None or not (folder / f"{name}.npz").exists():
            continue
        found = read_weights(folder / f"{name}.npz")
        is_same = found.config.kind == config.kind and found.config.model == config.model
        if is_same and found.card.get("data") == data:
            return found
        of_another = "data" if is_same else "configuration"
        log.warning("%s: weights in %s are of another %s, and left out", name, folder, of_another)
    return None


def _evaluate_entry(
    entry: Entry, config: CampaignConfig, data: Dataset, cache: CloudCache, clouds: DeviceClouds, folders: Folders
) -> None:
    weights = read_weights(folders.out / f"{entry.name}.npz")
    predictor = NetworkPredictor(
        model=load_model(weights, str(clouds.device)),
        clouds=clouds,
        batch=weights.config.batch,
        precision=weights.config.precision,
    )
    rows = cache.split(config.split, limit=config.evaluated)
    found = evaluate(entry.name, predictor, data, cache, rows, states=config.states)
    run = folders.work / entry.name
    write_evaluation(run / EVALUATION, found)
    (run / CHECKPOINT).unlink()  # the cycle is over: the next one begins with its weights


def evaluate_heuristics(config: CampaignConfig, data: Dataset, cache: CloudCache, folders: Folders) -> None:
    """Evaluate what needs no learning on the same blueprints, once."""
    rows = cache.split(config.split, limit=config.evaluated)
    for name, predictor in heuristics(cache).items():
        path = folders.work / name.replace(" ", "-") / EVALUATION
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            write_evaluation(path, evaluate(name, predictor, data, cache, rows, states=config.states))


def _collect(config: CampaignConfig, folders: Folders) -> dict[str, Any]:
    """Write logs and results of all models into the folder that is kept; return the results."""
    rows: list[dict[str, str]] = []
    for entry in config.model:
        path = folders.work / entry.name / LOG
        if path.exists():
            with path.open(newline="", encoding="utf-8") as file:
                rows += [{"model": entry.name, **row} for row in csv.DictReader(file)]
    names = list(dict.fromkeys(name for row in rows for name in row))
    with atomic_write(folders.out / "log.csv") as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names or ["model"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    found = {path.parent.name: read_evaluation(path) for path in sorted(folders.work.glob(f"*/{EVALUATION}"))}
    results: dict[str, Any] = {
        "table": table_one(found),
        "overall": {name: _values(evaluation.overall) for name, evaluation in found.items()},
        "by_parts": {name: _groups(evaluation.by_parts) for name, evaluation in found.items()},
        "by_family": {name: _groups(evaluation.by_family) for name, evaluation in found.items()},
    }
    with atomic_write(folders.out / "results.json") as scratch:
        scratch.write_text(json.dumps(results, indent=1), encoding="utf-8")
    return results


def _values(group: Mapping[str, Any]) -> dict[str, list[float]]:
    return {name: [round(x, 4) for x in (i.value, i.low, i.high)] for name, i in group.items()}


def _groups(groups: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, list[float]]]:
    return {key: _values(group) for key, group in groups.items()}
