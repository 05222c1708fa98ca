"""What the command line calls: train, campaign, evaluate. PyTorch is imported inside, once it is known to be there."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from sashimono.errors import InputError
from sashimono.learning.cloud_cache import CloudConfig, Dataset

if TYPE_CHECKING:
    from sashimono.learning.evaluate import Evaluation

Say = Callable[[str], None]
"""Called with each line of progress."""


def require_torch() -> None:
    """Raise InputError if PyTorch is not installed."""
    if importlib.util.find_spec("torch") is None:
        raise InputError("training needs PyTorch. Install it with: pip install 'sashimono[train]'.")


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
    from sashimono.learning.devices import find_place
    from sashimono.learning.registry import prepared
    from sashimono.learning.train import train
    from sashimono.learning.weights import read_weights

    if threads is not None:
        torch.set_num_threads(threads)
    asked = read_config(config, **({} if steps is None else {"steps": steps}))
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
            start=None if start is None else read_weights(start).state,
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
    cache: Path | None = None,
    device: str | None = None,
    workers: int = 1,
    clouds: CloudConfig | None = None,
    say: Say = lambda line: None,
) -> int:
    """Evaluate trained models, and what needs no learning; write a JSON file each and print table I.

    Args:
        models: Files of weights; a method is called as its file.
        out: Folder to write into.
        data: A dataset's name or folder, or what returns it.
        splits: Splits to evaluate on.
        limit: Only so many blueprints of each split, over all families.
        states: States of each blueprint for one-step accuracy.
        timed: Blueprints inferred one at a time, for the time of a sequence.
        with_heuristics: Whether random orders, inside out and the rule are evaluated too.
        cache: Folder for clouds; ``out`` if not given.
        device: A GPU if there is one, unless given.
        workers: Processes that make the clouds.
        clouds: What is sampled.
        say: Called with each line of the result.
    """
    require_torch()
    import numpy as np

    from sashimono.learning.cloud_cache import make_cache
    from sashimono.learning.devices import find_place
    from sashimono.learning.evaluate import evaluate, heuristics, write_evaluation
    from sashimono.learning.predictor import NetworkPredictor
    from sashimono.learning.registry import prepared
    from sashimono.learning.report import group_table, table_one
    from sashimono.learning.weights import load_model, read_weights

    dataset = data() if callable(data) else load_data(data)
    made = make_cache(dataset, cache or out, config=clouds, workers=workers)
    read = {path.stem: read_weights(path) for path in models}
    made = prepared(made, dataset, [weights.config.kind for weights in read.values()], workers=workers)
    rows = np.concatenate([made.split(split, limit=limit) for split in splits])
    out.mkdir(parents=True, exist_ok=True)
    found: dict[str, Evaluation] = {}
    if with_heuristics:
        for name, method in heuristics(made).items():
            found[name] = evaluate(name, method, dataset, made, rows, states=states, timed=timed)
    with find_place(device) as place:
        tensors = made.to(place.device)
        for name, weights in read.items():
            predictor = NetworkPredictor(
                model=load_model(weights, place.device),
                clouds=tensors,
                batch=weights.config.batch,
                precision=weights.config.precision,
            )
            found[name] = evaluate(name, predictor, dataset, made, rows, states=states, timed=timed)
    for name, evaluation in found.items():
        write_evaluation(out / f"{name.replace(' ', '-')}.json", evaluation)
    say(table_one(found))
    for group in ("by_split", "by_parts", "by_family"):
        say(group_table(found, group))
    return 0


def _line(row: dict[str, int | float]) -> str:
    rest = " ".join(
        f"{name} {value:.4g}" for name, value in row.items() if name not in ("step", "minutes", "states_per_second")
    )
    return f"step {row['step']:.0f} {row['minutes']:.2f} min {row['states_per_second']:.0f} states/s {rest}"
