"""What a method of sequence inference reaches, judged by exact conditions: one-step and whole-sequence accuracy.

A method gives probabilities for states. It may be a network, an exported one, or an order that needs no learning. All
figures are kept by blueprint, and summed up over groups of blueprints with bootstrap intervals.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from sashimono import __version__
from sashimono.d4pas.heuristics import by_clearance, inside_out
from sashimono.d4pas.states import right_next
from sashimono.files import atomic_write
from sashimono.learning.cloud_cache import MOST_PARTS, CloudCache, Dataset, LabelledBlueprint, shape_classes

MOST_STATES = 16
"""Most sets of placed parts that are followed at once when identical parts may be exchanged. With more, an order that
could be carried out may be missed, never the other way round."""


@runtime_checkable
class Predictor(Protocol):
    """A method: says of states which parts are right next."""

    def encode(self, blueprints: np.ndarray) -> Any:
        """Return what the method needs to know of these blueprints of the cache."""
        ...

    def probabilities(self, encoded: Any, placed: np.ndarray) -> np.ndarray:
        """Return the probability of each part (B, S, M) in states given as masks (B, S); 0 for placed parts."""
        ...

    def orders(self, encoded: Any) -> list[list[int]] | None:
        """Return an assembly order of each blueprint, or None: then the most probable part is placed each time."""
        ...

    def pose_errors(self, encoded: Any) -> np.ndarray | None:
        """Return mean errors of the predicted poses, with nothing placed: distance and angle [rad] (B, 2), or None."""
        ...


@runtime_checkable
class Timed(Protocol):
    """A method that takes its own time, since it would take too long to infer blueprints once more."""

    def milliseconds(self, blueprints: Sequence[int] | np.ndarray) -> dict[str, float]:
        """Return median and 90 % quantile over blueprints that it was asked about, and what else it knows [ms]."""
        ...


@dataclass(frozen=True, kw_only=True)
class Record:
    """What a method reached on one blueprint. Means are over states, each number of placed parts weighing the same."""

    id: str
    family: str
    split: str
    parts: int
    chance: float
    """Share of the remaining parts that are right: 1-Acc of a random choice."""
    expected: float
    """Share of the probability that is on right parts: 1-Acc of a choice drawn by it."""
    argmax: float
    """Share of states in which the most probable part is right; who says nothing is not."""
    argmax_exchange: float
    """The same, if any remaining part of the same shape counts as right."""
    set_hits: float
    """Right parts of probability above one half, a state."""
    set_said: float
    """Parts of probability above one half, a state."""
    set_right: float
    """Right parts, a state."""
    sequence: bool
    """Whether the whole order can be carried out."""
    sequence_exchange: bool
    """Whether it can, with parts of the same shape exchanged."""
    sequence_listed: bool
    """Whether every step of it is one of the listed sequences'."""
    sequence_listed_exchange: bool
    """Whether it is, with parts of the same shape exchanged."""
    first_error: int | None
    """Number of placed parts at the first wrong step."""
    pose_distance: float | None
    """Mean error of the predicted translations, over the blueprint's radius."""
    pose_angle: float | None
    """Mean error of the predicted rotations [rad]."""


@dataclass(frozen=True, kw_only=True)
class Interval:
    """A figure with its 95 % bootstrap interval over blueprints."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What a method reached on some blueprints."""

    name: str
    data: str
    """Hash of the dataset."""
    records: tuple[Record, ...]
    overall: Mapping[str, Interval]
    by_split: Mapping[str, Mapping[str, Interval]]
    by_family: Mapping[str, Mapping[str, Interval]]
    by_parts: Mapping[str, Mapping[str, Interval]]
    """By number of parts: the paper's sensitivity."""
    milliseconds: Mapping[str, float]
    """Time of one blueprint's whole sequence, batch of 1: median and 90 % quantile; empty if it was not measured."""
    version: str = __version__


def evaluate(
    name: str,
    predictor: Predictor,
    data: Dataset,
    cache: CloudCache,
    blueprints: Sequence[int] | np.ndarray,
    *,
    states: int = 16,
    chunk: int = 32,
    timed: int = 0,
    seed: int = 0,
) -> Evaluation:
    """Return what a method reaches on these blueprints of three and more parts.

    Args:
        name: What the method is called.
        predictor: The method.
        data: The dataset, for conditions and listed sequences.
        cache: Its clouds and states.
        blueprints: Which of the cache's blueprints.
        states: States of each that one-step accuracy is measured on.
        chunk: Blueprints at a time.
        timed: So many blueprints are inferred once more, one at a time, against the clock.
        seed: Of the bootstrap.
    """
    chosen = np.asarray(blueprints)
    chosen = chosen[cache.counts[chosen] > 2]
    chosen = chosen[np.argsort(cache.counts[chosen], kind="stable")]
    records: list[Record] = []
    for start in range(0, len(chosen), chunk):
        rows = chosen[start : start + chunk]
        placed, right = _states(cache, rows, states)
        encoded = predictor.encode(rows)
        probabilities = predictor.probabilities(encoded, placed)
        orders = predictor.orders(encoded) or greedy_orders(predictor, encoded, cache.counts[rows])
        errors = predictor.pose_errors(encoded)
        for k, row in enumerate(rows.tolist()):
            blueprint = data.blueprints[row]
            one = one_step(blueprint, placed[k], right[k], probabilities[k])
            pose = None if errors is None else errors[k]
            records.append(_record(blueprint, one, orders[k], pose))
    times = predictor.milliseconds(chosen) if isinstance(predictor, Timed) else _times(predictor, chosen, cache, timed)
    rng = np.random.default_rng(seed)

    def grouped(key: Callable[[Record], Any]) -> dict[str, dict[str, Interval]]:
        keys = sorted({key(record) for record in records})
        return {str(k): summarise([r for r in records if key(r) == k], rng) for k in keys}

    return Evaluation(
        name=name,
        data=data.hash,
        records=tuple(records),
        overall=summarise(records, rng),
        by_split=grouped(lambda record: record.split),
        by_family=grouped(lambda record: record.family),
        by_parts=grouped(lambda record: record.parts),
        milliseconds=times,
    )


def greedy_orders(predictor: Predictor, encoded: Any, counts: np.ndarray) -> list[list[int]]:
    """Return the orders that come of placing the most probable part each time."""
    orders: list[list[int]] = [[] for _ in counts]
    placed = np.zeros((len(counts), 1), dtype=np.int64)
    for _ in range(int(counts.max())):
        probabilities = predictor.probabilities(encoded, placed)[:, 0]
        for k, count in enumerate(counts):
            if len(orders[k]) < count:
                remaining = [part for part in range(count) if not int(placed[k, 0]) >> part & 1]
                best = max(remaining, key=lambda part, k=k: (probabilities[k, part], -part))
                orders[k].append(best)
                placed[k, 0] |= 1 << best
    return orders


def one_step(
    blueprint: LabelledBlueprint, placed: np.ndarray, right: np.ndarray, probabilities: np.ndarray
) -> dict[str, float]:
    """Return the one-step figures of one blueprint, as means over its states.

    Args:
        blueprint: Whose states they are.
        placed: The states, masks (state,).
        right: Right next parts, masks (state,).
        probabilities: Of each part (state, part), at least as many as there are.
    """
    count = len(blueprint.parts)
    shift = np.arange(count)
    remaining = (placed[:, None] >> shift & 1) == 0
    wanted = (right[:, None] >> shift & 1) == 1
    p = np.where(remaining, probabilities[:, :count], 0.0)
    total = p.sum(axis=1)
    share = (p * wanted).sum(axis=1) / np.maximum(total, 1e-30)
    chance = wanted.sum(axis=1) / remaining.sum(axis=1)
    best = np.where(remaining, p, -1.0).argmax(axis=1)
    rows = np.arange(len(placed))
    classes = shape_classes(count, blueprint.identical)
    same = (classes[best][:, None] == classes) & remaining
    said = remaining & (p > 0.5)
    return {
        "chance": float(chance.mean()),
        "expected": float(np.where(total > 0, share, chance).mean()),
        "argmax": float((wanted[rows, best] & (total > 0)).mean()),
        "argmax_exchange": float(((wanted & same).any(axis=1) & (total > 0)).mean()),
        "set_hits": float((said & wanted).sum(axis=1).mean()),
        "set_said": float(said.sum(axis=1).mean()),
        "set_right": float(wanted.sum(axis=1).mean()),
    }


def judge_order(blueprint: LabelledBlueprint, order: Sequence[int]) -> tuple[dict[str, bool], int | None]:
    """Return which ways an order is right, and how many parts were placed at its first wrong step, if there is one."""
    count = len(blueprint.parts)
    alone = np.arange(count)
    classes = shape_classes(count, blueprint.identical)
    table = listed_steps(blueprint.sequences)
    known: dict[int, int] = {}

    def exact(state: int) -> int:
        if state not in known:
            known[state] = right_next(blueprint.masks, state)
        return known[state]

    def listed(state: int) -> int:
        return table.get(state, 0)

    steps = follow(order, exact, alone)
    is_right, is_listed = steps == count, follow(order, listed, alone) == count
    verdicts = {
        "sequence": is_right,
        "sequence_exchange": is_right or follow(order, exact, classes) == count,
        "sequence_listed": is_listed,
        "sequence_listed_exchange": is_listed or follow(order, listed, classes) == count,
    }
    return verdicts, None if is_right else steps


def follow(order: Sequence[int], right: Callable[[int], int], classes: np.ndarray) -> int:
    """Return how many steps of an order are right, if each part may stand for any of its class.

    All sets of placed parts that come of exchanges are followed side by side, up to `MOST_STATES`.
    """
    states = {0}
    for step, part in enumerate(order):
        members = [other for other in range(len(classes)) if classes[other] == classes[part]]
        following: set[int] = set()
        for state in sorted(states):
            allowed = right(state)
            following |= {state | 1 << other for other in members if allowed >> other & 1 and not state >> other & 1}
            if len(following) >= MOST_STATES:
                break
        if not following:
            return step
        states = following
    return len(order)


def listed_steps(sequences: Sequence[Sequence[int]]) -> dict[int, int]:
    """Return, by set of placed parts, the next parts of the listed sequences."""
    table: dict[int, int] = {}
    for sequence in sequences:
        placed = 0
        for part in sequence:
            table[placed] = table.get(placed, 0) | 1 << part
            placed |= 1 << part
    return table


def summarise(records: Sequence[Record], rng: np.random.Generator, *, resamples: int = 1000) -> dict[str, Interval]:
    """Return the figures of a group of blueprints with 95 % bootstrap intervals.

    ``*_all`` counts the trivial last choice too. Poses and sets are left out where a method has none.
    """
    parts = np.array([record.parts for record in records], dtype=float)
    ones = np.ones(len(records))

    def column(name: str) -> np.ndarray:
        return np.array([getattr(record, name) for record in records], dtype=float)

    ratios = {"blueprints": (ones * len(records), ones)}
    for name in ("chance", "expected", "argmax", "argmax_exchange"):
        ratios[name] = (column(name), ones)
        ratios[f"{name}_all"] = ((column(name) * (parts - 1) + 1) / parts, ones)
    for name in ("sequence", "sequence_exchange", "sequence_listed", "sequence_listed_exchange"):
        ratios[name] = (column(name), ones)
    ratios["precision"] = (column("set_hits"), column("set_said"))
    ratios["recall"] = (column("set_hits"), column("set_right"))
    if all(record.pose_distance is not None for record in records):
        ratios["pose_distance"] = (column("pose_distance"), ones)
        ratios["pose_angle"] = (column("pose_angle"), ones)
    drawn = rng.integers(len(records), size=(resamples, len(records)))
    out = {}
    for name, (over, under) in ratios.items():
        value = over.sum() / max(under.sum(), 1e-12)
        sums = over[drawn].sum(axis=1) / np.maximum(under[drawn].sum(axis=1), 1e-12)
        low, high = np.quantile(sums, [0.025, 0.975])
        out[name] = Interval(value=float(value), low=float(low), high=float(high))
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class OrderPredictor:
    """A method that fixes the whole order from the clouds in place: its first part that is not placed is next."""

    cache: CloudCache
    order: Callable[[np.ndarray], list[int]]
    """From clouds (part, point, 6) to an assembly order."""

    def encode(self, blueprints: np.ndarray) -> list[list[int]]:
        """Return the orders."""
        return [
            self.order(np.asarray(self.cache.part_points[self.cache.parts_of(row)], dtype=np.float64))
            for row in blueprints.tolist()
        ]

    def probabilities(self, encoded: list[list[int]], placed: np.ndarray) -> np.ndarray:
        """Return 1 for the first part of the order that is not placed."""
        return probabilities_of_orders(encoded, placed)

    def orders(self, encoded: list[list[int]]) -> list[list[int]]:
        """Return the orders."""
        return encoded

    def pose_errors(self, encoded: list[list[int]]) -> None:
        """Return None: there are no poses."""
        return None


def probabilities_of_orders(orders: Sequence[Sequence[int]], placed: np.ndarray) -> np.ndarray:
    """Return 1 for the first part of each order that is not placed (B, S, part); nothing where there is none."""
    out = np.zeros((*placed.shape, MOST_PARTS))
    for k, order in enumerate(orders):
        for s, state in enumerate(placed[k]):
            best = next((part for part in order if not int(state) >> part & 1), None)
            if best is not None:
                out[k, s, best] = 1.0
    return out


def over_seeds(name: str, evaluations: Sequence[Evaluation]) -> Evaluation:
    """Return several seeds' evaluations as one: each figure's mean, and one standard deviation over the seeds about it.

    With one seed there is no spread, and its own intervals stay. All are of the same blueprints.
    """
    first = evaluations[0]
    if len(evaluations) == 1:
        return replace(first, name=name)

    def together(groups: Sequence[Mapping[str, Interval]]) -> dict[str, Interval]:
        out = {}
        for figure in groups[0]:
            values = np.array([group[figure].value for group in groups])
            mean, spread = float(values.mean()), float(values.std(ddof=1))
            out[figure] = Interval(value=mean, low=mean - spread, high=mean + spread)
        return out

    def grouped(group: str) -> dict[str, dict[str, Interval]]:
        return {key: together([getattr(e, group)[key] for e in evaluations]) for key in getattr(first, group)}

    return Evaluation(
        name=name,
        data=first.data,
        records=tuple(record for evaluation in evaluations for record in evaluation.records),
        overall=together([evaluation.overall for evaluation in evaluations]),
        by_split=grouped("by_split"),
        by_family=grouped("by_family"),
        by_parts=grouped("by_parts"),
        milliseconds={
            key: float(np.mean([evaluation.milliseconds[key] for evaluation in evaluations]))
            for key in first.milliseconds
        },
    )


def heuristics(cache: CloudCache, *, seed: int = 0) -> dict[str, OrderPredictor]:
    """Return the methods that need no learning: a random order, inside out, the rule."""
    rng = np.random.default_rng(seed)
    return {
        "random": OrderPredictor(cache=cache, order=lambda clouds: [int(k) for k in rng.permutation(len(clouds))]),
        "inside out": OrderPredictor(cache=cache, order=inside_out),
        "rule": OrderPredictor(cache=cache, order=by_clearance),
    }


def write_evaluation(path: Path, evaluation: Evaluation) -> None:
    """Write an evaluation as JSON."""
    with atomic_write(path) as scratch:
        scratch.write_text(json.dumps(asdict(evaluation), indent=1, sort_keys=True), encoding="utf-8")


def read_evaluation(path: Path) -> Evaluation:
    """Return a written evaluation."""
    values = json.loads(path.read_text(encoding="utf-8"))

    def intervals(group: Mapping[str, Any]) -> dict[str, Interval]:
        return {name: Interval(**value) for name, value in group.items()}

    values["records"] = tuple(Record(**record) for record in values["records"])
    values["overall"] = intervals(values["overall"])
    for name in ("by_split", "by_family", "by_parts"):
        values[name] = {key: intervals(group) for key, group in values[name].items()}
    return Evaluation(**{field.name: values[field.name] for field in fields(Evaluation)})


def read_evaluations(folder: Path, like: Evaluation) -> dict[str, Evaluation]:
    """Return, by method, the evaluations in a folder that are of the same blueprints of the same data as one."""
    blueprints = {record.id for record in like.records}
    found = {}
    for path in sorted(folder.glob("*.json")):
        values = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(values, dict) or values.get("data") != like.data or "records" not in values:
            continue  # of other data, or no evaluation
        each = read_evaluation(path)
        if {record.id for record in each.records} == blueprints:
            found[each.name] = each
    return found


def _record(
    blueprint: LabelledBlueprint, one: Mapping[str, float], order: Sequence[int], pose: np.ndarray | None
) -> Record:
    verdicts, first_error = judge_order(blueprint, order)
    return Record(
        id=blueprint.id,
        family=blueprint.family,
        split=blueprint.split,
        parts=len(blueprint.parts),
        **one,
        **verdicts,
        first_error=first_error,
        pose_distance=None if pose is None else float(pose[0]),
        pose_angle=None if pose is None else float(pose[1]),
    )


def _states(cache: CloudCache, rows: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return states of each blueprint, evenly over the numbers of placed parts, and their right parts (B, S)."""
    placed = np.zeros((len(rows), count), dtype=np.int64)
    right = np.zeros_like(placed)
    for k, row in enumerate(rows.tolist()):
        pool = cache.states_of(row)
        masks = np.asarray(cache.placed[pool])
        _, where, sizes = np.unique(np.bitwise_count(masks), return_inverse=True, return_counts=True)
        weights = np.cumsum(1.0 / (len(sizes) * sizes[where]))
        picked = np.searchsorted(weights, (np.arange(count) + 0.5) / count)
        picked = np.minimum(picked, len(masks) - 1)
        placed[k], right[k] = masks[picked], np.asarray(cache.right[pool])[picked]
    return placed, right


def _times(predictor: Predictor, chosen: np.ndarray, cache: CloudCache, count: int) -> dict[str, float]:
    if not count or not len(chosen):
        return {}
    rows = chosen[np.linspace(0, len(chosen) - 1, min(count, len(chosen))).astype(int)]
    seconds = []
    for k, row in enumerate([rows[0], *rows]):
        begun = time.perf_counter()
        encoded = predictor.encode(np.array([row]))
        if predictor.orders(encoded) is None:
            greedy_orders(predictor, encoded, cache.counts[[row]])
        if k:  # the first warms up
            seconds.append(time.perf_counter() - begun)
    median, slow = np.quantile(seconds, [0.5, 0.9]) * 1e3
    return {"median": float(median), "90 %": float(slow)}
