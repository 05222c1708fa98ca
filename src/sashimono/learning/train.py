"""Training: AdamW with one cycle, checkpoints that go on bit for bit, the same code on CPUs and GPUs."""

from __future__ import annotations

import csv
import importlib.util
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel

from sashimono.errors import InputError
from sashimono.files import atomic_write
from sashimono.learning.batch import Batch, DeviceClouds, make_batch
from sashimono.learning.cloud_cache import CloudCache
from sashimono.learning.config_files import OptimizerConfig, TrainConfig, to_values
from sashimono.learning.devices import Place
from sashimono.learning.schedule import BatchOrder, one_cycle, step_seed
from sashimono.learning.weights import make_model, write_weights

CHECKPOINT = "checkpoint.pt"
LOG = "log.csv"
WEIGHTS = "weights.npz"

Row = dict[str, int | float]
"""A line of the log, by column."""

Clock = Callable[[], float]
"""Seconds since some moment: of the wall, or of this process on its processors."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Trained:
    """What came of a run."""

    steps: int
    states: int
    """States seen, over all devices."""
    minutes: float
    """Of training, all runs of it together."""
    states_per_second: float
    outside: float
    """Share of the time not spent in the network: batches."""
    loss: float
    """Mean over the last line of the log."""
    weights: Path


class Lossy(nn.Module):
    """A model whose forward pass is its loss: what `DistributedDataParallel` can wrap."""

    def __init__(self, model: nn.Module) -> None:
        super().__init__()
        self.model = model

    def forward(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        return self.model.loss(batch)  # type: ignore[operator]


class Average:
    """The moving average of a model's floating-point values, in single precision."""

    def __init__(self, model: nn.Module, memory: float) -> None:
        self.memory = memory
        self.now = model.state_dict()  # the model's own tensors: they change with it
        self.state = {name: value.clone() for name, value in self.now.items()}

    @torch.no_grad()
    def update(self, step: int) -> None:
        """Take in the model's values after this step; the memory grows from nothing."""
        memory = min(self.memory, (1 + step) / (10 + step))
        names = [name for name, value in self.state.items() if value.is_floating_point()]
        torch._foreach_lerp_(  # pyright: ignore[reportPrivateImportUsage]
            [self.state[n] for n in names], [self.now[n] for n in names], 1.0 - memory
        )
        for name in self.state.keys() - set(names):
            self.state[name].copy_(self.now[name])


def train(
    config: TrainConfig,
    cache: CloudCache,
    out: Path,
    *,
    place: Place,
    minutes: float | None = None,
    clock: Clock = time.perf_counter,
    start: Mapping[str, Tensor] | None = None,
    clouds: DeviceClouds | None = None,
    card: Mapping[str, Any] | None = None,
    weights: Path | None = None,
    report: Callable[[Row], None] = lambda row: None,
) -> Trained:
    """Train, from the newest checkpoint in ``out`` if there is one, and return what came of it.

    Writes ``checkpoint.pt``, ``log.csv`` and ``weights.npz`` into ``out``; each is whole at every moment. With a number
    of steps a resumed run is the uninterrupted one, bit for bit, on the same device.

    Args:
        config: The run.
        cache: Clouds and states.
        out: Folder to write into.
        place: Device and share of this process.
        minutes: Train that long, whatever the steps; the cycle follows the clock.
        clock: What ``minutes`` are counted by, in seconds.
        start: Weights to begin with, instead of random ones.
        clouds: The cache's arrays on the device, if they are there already.
        card: What else the weights' card says: the dataset's hash, what was trained before.
        weights: File to write the weights to, instead of ``weights.npz`` in ``out``.
        report: Called with each line of the log.
    """
    out.mkdir(parents=True, exist_ok=True)
    clouds = clouds or cache.to(place.device, extras=config.batch.extras)
    chosen = cache.split(config.split, limit=config.limit, complete=not config.incomplete)
    order = BatchOrder(
        blueprints=chosen, counts=cache.counts[chosen], size=config.batch.blueprints, seed=config.seed + 1
    )
    model = make_model(config).to(place.device)
    if start is not None:
        model.load_state_dict(dict(start))
    average = Average(model, config.optimizer.average)
    optimizer = make_optimizer(model, config.optimizer)
    done = _Progress()
    if (out / CHECKPOINT).exists():
        done = _restore(out / CHECKPOINT, config, model, average, optimizer, place)
    lossy: nn.Module = Lossy(model)
    if place.world > 1:
        lossy = DistributedDataParallel(lossy)
    if config.compile:
        lossy = torch.compile(lossy)  # type: ignore[assignment]
    writer = LogWriter(out, done.step) if place.is_first else None
    meter = _Meter(done, place, clock)
    model.train()

    def over() -> float:
        share = done.step / config.steps if minutes is None else meter.minutes / minutes
        return place.agreed(share) if minutes is not None else share

    def save() -> None:
        if place.is_first:
            _save(out, config, model, average, optimizer, done)
            write_weights(written, config, average.state, {**(card or {}), **done.card()})

    written = weights or out / WEIGHTS
    last: Row = {"loss": float("nan")}
    while (progress := over()) < 1.0:
        seed = step_seed(config.seed, done.step, place.rank)
        timed = (done.step + 1) % config.log_every == 0
        torch.manual_seed(seed)  # dropout
        with meter.timing("outside", timed):
            rows = order.batch(done.step * place.world + place.rank)
            batch = make_batch(clouds, rows, config=config.batch, seed=seed, progress=progress)
        with meter.timing("network", timed):
            rate = one_cycle(progress, config.optimizer)
            for group in optimizer.param_groups:
                group["lr"] = rate
            with place.autocast(config.precision):
                loss, terms = lossy(batch)
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            norm = nn.utils.clip_grad_norm_(model.parameters(), config.optimizer.clip)
            optimizer.step()
            average.update(done.step)
        done.step += 1
        done.states += config.batch.blueprints * config.batch.states * place.world
        meter.add({"loss": loss, "gradient": norm, **terms})
        if timed:
            last = meter.row(rate)
            if writer:
                writer.write(last)
                report(last)
        if meter.since_checkpoint() > config.checkpoint_seconds:
            save()
            meter.mark_checkpoint()
    done.minutes = meter.minutes
    if meter.count:
        last = meter.row(one_cycle(1.0, config.optimizer))
        if writer:
            writer.write(last)
            report(last)
    save()
    if writer:
        writer.close()
    return Trained(
        steps=done.step,
        states=done.states,
        minutes=done.minutes,
        states_per_second=meter.speed(),
        outside=meter.outside(),
        loss=last["loss"],
        weights=written,
    )


def make_optimizer(model: nn.Module, config: OptimizerConfig) -> torch.optim.AdamW:
    """Return AdamW with weight decay on matrices only."""
    matrices = [p for p in model.parameters() if p.requires_grad and p.dim() > 1]
    vectors = [p for p in model.parameters() if p.requires_grad and p.dim() <= 1]
    groups = [{"params": matrices, "weight_decay": config.decay}, {"params": vectors, "weight_decay": 0.0}]
    return torch.optim.AdamW(groups, lr=config.rate, betas=(0.9, config.beta2), fused=next(model.parameters()).is_cuda)


@dataclass(kw_only=True)
class _Progress:
    step: int = 0
    states: int = 0
    minutes: float = 0.0

    def card(self) -> Row:
        """Return it for the weights' card."""
        return {"steps": self.step, "states": self.states, "minutes": round(self.minutes, 3)}


class _Meter:
    """Time, speed and means between two lines of the log."""

    def __init__(self, done: _Progress, place: Place, clock: Clock) -> None:
        self.done, self.place, self.clock, self.clock_begun = done, place, clock, clock()
        self.begun = self.line = self.checkpoint = time.perf_counter()
        self.minutes_before, self.states_before, self.states_line = done.minutes, done.states, done.states
        self.seconds = {"outside": 0.0, "network": 0.0}
        self.sums: dict[str, Tensor] = {}
        self.count = 0

    @property
    def minutes(self) -> float:
        """Minutes of training, those before a resumption included."""
        return self.minutes_before + (self.clock() - self.clock_begun) / 60.0

    def timing(self, what: str, timed: bool) -> _Stopwatch:
        """Return a context that is timed, if asked for: the device is waited for before and after."""
        return _Stopwatch(self.seconds, what, self.place if timed else None)

    def add(self, values: Mapping[str, Tensor]) -> None:
        """Take in a step's values; the device is not waited for."""
        for name, value in values.items():
            value = value.detach().float()
            self.sums[name] = self.sums[name] + value if name in self.sums else value
        self.count += 1

    def row(self, rate: float) -> Row:
        """Return a line of the log, and begin the next."""
        means = {name: float(value) / self.count for name, value in self.sums.items()}
        now = time.perf_counter()
        speed = (self.done.states - self.states_line) / (now - self.line)
        self.sums, self.count, self.line, self.states_line = {}, 0, now, self.done.states
        return {
            "step": self.done.step,
            "minutes": round(self.minutes, 4),
            "states": self.done.states,
            "states_per_second": round(speed, 1),
            "outside": round(self.outside(), 4),
            "rate": rate,
            **means,
        }

    def speed(self) -> float:
        """Return states a second of this run."""
        return (self.done.states - self.states_before) / (time.perf_counter() - self.begun)

    def outside(self) -> float:
        """Return the share of the time not spent in the network, of the steps that were timed."""
        total = sum(self.seconds.values())
        return self.seconds["outside"] / total if total else 0.0

    def since_checkpoint(self) -> float:
        """Return the seconds since the last checkpoint."""
        return self.place.agreed(time.perf_counter() - self.checkpoint)

    def mark_checkpoint(self) -> None:
        """Remember that a checkpoint was written."""
        self.done.minutes = self.minutes
        self.checkpoint = time.perf_counter()


class _Stopwatch:
    def __init__(self, seconds: dict[str, float], what: str, place: Place | None) -> None:
        self.seconds, self.what, self.place = seconds, what, place

    def __enter__(self) -> None:
        if self.place:
            self.place.synchronize()
            self.begun = time.perf_counter()

    def __exit__(self, *_: object) -> None:
        if self.place:
            self.place.synchronize()
            self.seconds[self.what] += time.perf_counter() - self.begun


class LogWriter:
    """``log.csv``, without lines from after the step that is gone on from; TensorBoard beside it if installed."""

    def __init__(self, out: Path, step: int) -> None:
        self.path = out / LOG
        self.rows = [row for row in _read_rows(self.path) if int(row["step"]) <= step]
        self.board: Any = None
        if importlib.util.find_spec("tensorboard"):
            from torch.utils.tensorboard import SummaryWriter

            self.board = SummaryWriter(str(out / "tensorboard"), purge_step=step + 1)

    def write(self, row: Row) -> None:
        """Add a line."""
        self.rows.append({name: _plain(value) for name, value in row.items()})
        _write_rows(self.path, self.rows)
        if self.board:
            for name, value in row.items():
                if name != "step":
                    self.board.add_scalar(name, value, int(row["step"]))

    def close(self) -> None:
        """Finish what is open."""
        if self.board:
            self.board.close()


def _plain(value: int | float) -> str:
    return str(value) if isinstance(value, int) else f"{value:.6g}"


def _read_rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _write_rows(path: Path, rows: list[dict[str, str]]) -> None:
    names = list(dict.fromkeys(name for row in rows for name in row))
    with atomic_write(path) as scratch, scratch.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _save(
    out: Path,
    config: TrainConfig,
    model: nn.Module,
    average: Average,
    optimizer: torch.optim.Optimizer,
    done: _Progress,
) -> None:
    with atomic_write(out / CHECKPOINT) as scratch:
        torch.save(
            {
                "config": to_values(config),
                "model": model.state_dict(),
                "average": average.state,
                "optimizer": optimizer.state_dict(),
                "done": vars(done),
            },
            scratch,
        )


def _restore(
    path: Path,
    config: TrainConfig,
    model: nn.Module,
    average: Average,
    optimizer: torch.optim.Optimizer,
    place: Place,
) -> _Progress:
    saved = torch.load(path, map_location=place.device, weights_only=True)
    asked, had = to_values(config), saved["config"]
    changed = [name for name in ("kind", "model", "batch", "seed") if asked[name] != had[name]]
    if changed:
        raise InputError(f"{path} is of a run with another {changed[0]}. Choose another folder, or that configuration.")
    model.load_state_dict(saved["model"])
    average.state = saved["average"]
    optimizer.load_state_dict(saved["optimizer"])
    log.info("goes on from step %d of %s", saved["done"]["step"], path)
    return _Progress(**saved["done"])
