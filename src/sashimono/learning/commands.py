"""What the command line calls: train, campaign, evaluate. PyTorch is imported inside, once it is known to be there."""

from __future__ import annotations

import importlib.util
import re
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from sashimono.errors import InputError, SashimonoError
from sashimono.files import atomic_write
from sashimono.learning.cloud_cache import CloudConfig, Dataset

if TYPE_CHECKING:
    from sashimono.learning.config_files import TrainConfig
    from sashimono.learning.evaluate import Evaluation, Predictor

Say = Callable[[str], None]
"""Called with each line of progress."""


def require_torch() -> None:
    """Raise InputError if PyTorch is not installed."""
    if importlib.util.find_spec("torch") is None:
        raise InputError("training needs PyTorch. Install it with: pip install 'sashimono[train]'.")


def require_rl() -> None:
    """Raise InputError if what reinforcement learning needs is not installed."""
    if any(importlib.util.find_spec(name) is None for name in ("gymnasium", "stable_baselines3")):
        raise InputError(
            "reinforcement learning needs Gymnasium and stable-baselines3. Install them with:"
            " pip install 'sashimono[rl]'."
        )


def load_data(name: str) -> Dataset:
    """Return a dataset by name or folder."""
    from sashimono import d4pas

    return d4pas.load(name)


def train_command(
    config: str,
    out: Path,
    *,
    data: str | Callable[[], Dataset] = "v1",
    steps: int | None = None,
    minutes: float | None = None,
    processor_time: bool = False,
    seed: int | None = None,
    start: Path | None = None,
    cache: Path | None = None,
    device: str | None = None,
    workers: int = 1,
    threads: int | None = None,
    clouds: CloudConfig | None = None,
    say: Say = lambda line: None,
) -> int:
    """Train one configuration and write checkpoint, log and weights into ``out``; return the exit status.

    Of `past-posed`, the exported network is written too, as ``out/network``. Goes on from a checkpoint in ``out``.
    Under torchrun, each process takes its share of the batches.

    Args:
        config: A shipped training configuration, or a .toml file.
        out: Folder to write into.
        data: A dataset's name or folder, or what returns it.
        steps: Instead of the configuration's.
        minutes: Train that long, whatever the steps.
        processor_time: Count ``minutes`` by the processor time of this process, all threads together.
        seed: Instead of the configuration's.
        start: Weights to begin with.
        cache: Folder for clouds; ``out`` if not given.
        device: A GPU if there is one, unless given.
        workers: Processes that make the clouds.
        threads: Threads of torch.
        clouds: What is sampled.
        say: Called with each line of progress.
    """
    require_torch()
    import torch
    from torch import distributed

    from sashimono.learning.cloud_cache import make_cache
    from sashimono.learning.config_files import read_config
    from sashimono.learning.devices import find_place, refuse_device
    from sashimono.learning.registry import BY_REWARD, prepared
    from sashimono.learning.train import train
    from sashimono.learning.weights import read_weights

    if threads is not None:
        torch.set_num_threads(threads)
    changes = {"steps": steps, "seed": seed}
    asked = read_config(config, **{name: value for name, value in changes.items() if value is not None})
    clock = time.process_time if processor_time else time.perf_counter
    # what was asked for is looked at before the clouds are sampled, which takes long
    refuse_device(device)
    began = None if start is None or asked.kind == BY_REWARD else read_weights(start).state
    if asked.kind == BY_REWARD:
        return _train_by_reward(
            asked, out, data=data, minutes=minutes, clock=clock, start=start, cache=cache, device=device,
            workers=workers, clouds=clouds, say=say,
        )  # fmt: skip
    dataset = data() if callable(data) else load_data(data)
    with find_place(device) as place:
        if place.is_first:
            made = make_cache(dataset, cache or out, config=clouds, workers=workers)
            prepared(made, dataset, [asked.kind], workers=workers)
        if place.world > 1:
            distributed.barrier()
        made = make_cache(dataset, cache or out, config=clouds)
        done = train(
            asked,
            made,
            out,
            place=place,
            minutes=minutes,
            clock=clock,
            start=began,
            card={"data": dataset.hash},
            report=lambda row: say(_line(row)),
        )
        if place.is_first:
            say(
                f"{done.steps} steps, {done.states} states in {done.minutes:.1f} min, {done.states_per_second:.0f}"
                f" states a second, {done.outside:.0%} outside the network; {done.weights}"
            )
            if asked.kind == "posed":
                from sashimono.learning.export import export_posed

                say(f"for infer --model: {export_posed(read_weights(done.weights), out / 'network')}")
    return 0


def _train_by_reward(
    asked: TrainConfig,
    out: Path,
    *,
    data: str | Callable[[], Dataset],
    minutes: float | None,
    clock: Callable[[], float],
    start: Path | None,
    cache: Path | None,
    device: str | None,
    workers: int,
    clouds: CloudConfig | None,
    say: Say,
) -> int:
    """Train a policy; arguments as for `train_command`."""
    require_rl()
    from sashimono.learning.baselines.episode import make_bench
    from sashimono.learning.baselines.ppo import train_ppo
    from sashimono.learning.cloud_cache import make_cache
    from sashimono.learning.devices import find_place
    from sashimono.learning.weights import read_weights

    dataset = data() if callable(data) else load_data(data)
    made = make_cache(dataset, cache or out, config=clouds, workers=workers)
    rows = made.split(asked.split, limit=asked.limit, complete=not asked.incomplete)
    bench = make_bench(made, dataset, rows, workers=workers)
    with find_place(device) as place:
        if place.world > 1:
            raise InputError("reinforcement learning runs in one process; leave torchrun out")
        done = train_ppo(
            asked,
            bench,
            out,
            device=place.device,
            minutes=minutes,
            clock=clock,
            start=None if start is None else read_weights(start).state,
            card={"data": dataset.hash},
            report=lambda row: say(_line(row)),
        )
    say(f"{done.steps} steps in {done.minutes:.1f} min, {done.states_per_second:.0f} a second; {done.weights}")
    return 0


def campaign_command(
    name: str,
    minutes: float,
    out: Path,
    *,
    data: str | Callable[[], Dataset] = "v1",
    work: Path | None = None,
    start: Path | None = None,
    device: str | None = None,
    workers: int = 1,
    clouds: CloudConfig | None = None,
    say: Say = lambda line: None,
) -> int:
    """Go on with a campaign for so many minutes; return the exit status: 0, or 1 if a model's training failed.

    Args:
        name: A shipped campaign, or a .toml file.
        minutes: All included.
        out: Folder for what is worth keeping: weights, log, results. Earlier weights there are gone on from.
        data: A dataset's name or folder, or what returns it.
        work: Folder for clouds and checkpoints; ``out/work`` if not given.
        start: Folder of weights to begin with, where ``out`` has none.
        device: A GPU if there is one, unless given.
        workers: Processes that make the clouds.
        clouds: What is sampled.
        say: Called with each line of progress.
    """
    require_torch()
    from sashimono.learning.campaign import Folders, read_campaign, run_campaign

    folders = Folders(out=out, work=work or out / "work", start=start)
    load = data if callable(data) else partial(load_data, data)
    config = read_campaign(name)
    failed = run_campaign(
        config, load, minutes=minutes, folders=folders, device=device, workers=workers, clouds=clouds, say=say
    )
    return 1 if failed else 0


def evaluate_command(
    models: Sequence[Path],
    out: Path,
    *,
    data: str | Callable[[], Dataset] = "v1",
    splits: Sequence[str] = ("test",),
    limit: int | None = None,
    states: int = 16,
    timed: int = 20,
    with_heuristics: bool = True,
    ata: float | None = None,
    cache: Path | None = None,
    device: str | None = None,
    workers: int = 1,
    clouds: CloudConfig | None = None,
    say: Say = lambda line: None,
) -> int:
    """Evaluate trained models, and what needs no learning; write a JSON file each, print table I and draw figures.

    Tables and figures are of all evaluations in ``out`` of the same blueprints, those of earlier calls too.
    A policy is three methods (`sashimono.learning.baselines.playing`). Of policies of several seeds, called alike but
    for a number at the end (``rl-0``, ``rl-1``), there is one more of each, with means and spread (``rl``).

    Args:
        models: Files of weights; a method is called as its file, or as the folder if several files are called alike.
        out: Folder to write into.
        data: A dataset's name or folder, or what returns it.
        splits: Splits to evaluate on.
        limit: Only so many blueprints of each split, over all families.
        states: States of each blueprint for one-step accuracy.
        timed: Blueprints inferred one at a time, for the time of a sequence.
        with_heuristics: Whether random orders, inside out and the rule are evaluated too.
        ata: Whether Assemble-Them-All is too, and most processor time that it gets for one blueprint [s].
        cache: Folder for clouds; ``out`` if not given.
        device: A GPU if there is one, unless given.
        workers: Processes that make the clouds, and simulate.
        clouds: What is sampled.
        say: Called with each line of the result.
    """
    require_torch()
    import numpy as np

    from sashimono.learning.baselines.ata import simulate
    from sashimono.learning.cloud_cache import make_cache
    from sashimono.learning.devices import find_place, refuse_device
    from sashimono.learning.evaluate import evaluate, heuristics, over_seeds, write_evaluation
    from sashimono.learning.export import note_figures
    from sashimono.learning.predictor import NetworkPredictor
    from sashimono.learning.registry import BY_REWARD, prepared
    from sashimono.learning.weights import load_model, read_weights

    # what was asked for is looked at before the clouds are sampled, which takes long
    read_from = _names(models)
    read = {name: read_weights(path) for name, path in read_from.items()}
    refuse_device(device)
    dataset = data() if callable(data) else load_data(data)
    known = {blueprint.split for blueprint in dataset.blueprints}
    if unknown := [split for split in splits if split not in known]:
        raise SashimonoError(f"--split: the dataset has no split {unknown[0]!r}; it has {', '.join(sorted(known))}.")
    made = make_cache(dataset, cache or out, config=clouds, workers=workers)
    made = prepared(made, dataset, [weights.config.kind for weights in read.values()], workers=workers)
    rows = np.concatenate([made.split(split, limit=limit) for split in splits])
    out.mkdir(parents=True, exist_ok=True)
    found: dict[str, Evaluation] = {}

    def judge(methods: Mapping[str, Predictor]) -> None:
        for name, method in methods.items():
            found[name] = evaluate(name, method, dataset, made, rows, states=states, timed=timed)

    if with_heuristics:
        judge(heuristics(made))
    if ata is not None:
        several = rows[made.counts[rows] > 2]
        judge({"ata": simulate(made, dataset, several, seconds=ata, workers=workers, say=say)})
    with find_place(device) as place:
        tensors = made.to(place.device)
        bench = None
        if any(weights.config.kind == BY_REWARD for weights in read.values()):
            from sashimono.learning.baselines.episode import make_bench

            bench = make_bench(made, dataset, rows, workers=workers)
        policies: dict[str, list[str]] = {}
        for name, weights in read.items():
            model, config = load_model(weights, place.device), weights.config
            if bench is not None and config.kind == BY_REWARD:
                from sashimono.learning.baselines.picker import Picker
                from sashimono.learning.baselines.playing import playing_rows

                assert isinstance(model, Picker)
                methods = playing_rows(name, model, bench, config.batch, place.device)
                for title in methods:
                    policies.setdefault(_without_seed(title), []).append(title)
                judge(methods)
            else:
                options = {"batch": config.batch, "precision": config.precision}
                judge({name: NetworkPredictor(model=model, clouds=tensors, **options)})
                note_figures(read_from[name].parent / "network", found[name])
    for name, seeds in policies.items():
        if len(seeds) > 1:
            found[name] = over_seeds(name, [found[title] for title in seeds])
    for name, evaluation in found.items():
        write_evaluation(out / f"{name.replace(' ', '-')}.json", evaluation)
    _report(out, next(iter(found.values())), say)
    return 0


def _report(out: Path, like: Evaluation, say: Say) -> None:
    """Write and print tables, and draw figures if matplotlib is there, of all evaluations in a folder that are of the
    same blueprints as one: those of earlier calls too."""
    from sashimono.learning.evaluate import read_evaluations
    from sashimono.learning.report import group_table, in_order, table_one

    read = read_evaluations(out, like)
    # a seed by itself only where there is no mean over seeds
    found = in_order({name: each for name, each in read.items() if _without_seed(name) not in read.keys() - {name}})
    tables = [table_one(found), *(group_table(found, group) for group in ("by_split", "by_parts", "by_family"))]
    with atomic_write(out / "tables.md") as scratch:
        scratch.write_text("\n\n".join(tables) + "\n", encoding="utf-8")
    if importlib.util.find_spec("matplotlib"):
        from sashimono.learning.figures import draw_sensitivity

        draw_sensitivity(found, out / "sensitivity.svg")
    for text in tables:  # last: who reads only the first lines of them must not lose the files
        say(text)


def _without_seed(name: str) -> str:
    return re.sub(r"-\d+(?=$|-axes$|-retries$)", "", name)


def _names(models: Sequence[Path]) -> dict[str, Path]:
    """What each file's method is called.

    Raises InputError if two are called alike.
    """
    stems = [path.stem for path in models]
    named = {
        stem if stems.count(stem) == 1 else path.resolve().parent.name: path
        for stem, path in zip(stems, models, strict=True)
    }
    if len(named) < len(models):
        raise InputError("two of these files, in folders called alike, have the same name; rename one")
    return named


def _line(row: dict[str, int | float]) -> str:
    rest = " ".join(
        f"{name} {value:.4g}" for name, value in row.items() if name not in ("step", "minutes", "states_per_second")
    )
    return f"step {row['step']:.0f} {row['minutes']:.2f} min {row['states_per_second']:.0f} states/s {rest}"
