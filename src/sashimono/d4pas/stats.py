"""What a dataset holds and how hard it is, as lines to print and values to keep."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from hashlib import sha256
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from sashimono.d4pas import heuristics
from sashimono.d4pas.clouds import normalised, part_clouds, unit_frame
from sashimono.d4pas.dataset import Blueprint, Dataset
from sashimono.d4pas.splits import TRAIN
from sashimono.d4pas.states import insertable, is_right_order, random_state, right_next

PAPER = {"3": 7278, "4-7": 54612, "more": 22436}
"""Sequences of the paper's dataset, by steps."""


def summary(dataset: Dataset) -> dict[str, Any]:
    """Return counts: blueprints by split and parts, sequences by steps, failures by family and reason."""
    multi = [b for b in dataset if len(b) > 2]
    attempted = len(dataset) + len(dataset.failures)
    steps = {"2": 0, "3": 0, "4-7": 0, "more": 0}
    for b in dataset:
        steps[_steps_class(len(b))] += len(b.sequences)
    return {
        "blueprints": len(dataset),
        "multi_part": len(multi),
        "splits": _counted(b.split for b in dataset),
        "parts": _counted(str(len(b)) for b in dataset),
        "orders": _counted(_decade(b.orders) for b in multi),
        "sequences": steps,
        "sequences_total": sum(steps.values()),
        "sequences_of_paper": PAPER,
        "moves": sum(len(step["waypoints"]) > 1 for rows in dataset.steps.values() for step in rows),
        "contacts": sum(step["contact"] is not None for rows in dataset.steps.values() for step in rows),
        "solved": len(dataset) / attempted if attempted else float("nan"),
        "proven_complete": float(np.mean([b.complete for b in multi])) if multi else float("nan"),
        "failures": _counted(f"{row['family']}: {row['reason'].split(':')[0]}" for row in dataset.failures),
    }


def by_family(
    dataset: Dataset,
    *,
    states: int = 1,
    most: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """Return a row a family: sizes, shares, precedence structure, and what orders without learning reach.

    Args:
        dataset: What is measured; blueprints of two parts are left out.
        states: Random states looked at on each level of each blueprint.
        most: Blueprints measured of each family, the first by a hash of their ids; all if None. Counts are of all.
        progress: Called with blueprints done and in all.
    """
    failures = _counted(row["family"] for row in dataset.failures)
    families = sorted({b.family for b in dataset if len(b) > 2} | set(failures))
    multi = [b for b in dataset if len(b) > 2]
    chosen = []
    for family in families:
        members = sorted((b for b in multi if b.family == family), key=lambda b: sha256(b.id.encode()).digest())
        chosen += members[:most]
    measured = []
    for k, blueprint in enumerate(chosen):
        measured.append(measure(blueprint, states=states))
        progress(k + 1, len(chosen))
    out = []
    for family in families:
        members = [b for b in multi if b.family == family]
        rows = [row for row in measured if row["family"] == family]
        row: dict[str, Any] = {"family": family, "blueprints": len(members), "failed": failures.get(family, 0)}
        row["share"] = len(members) / max(1, len(multi))
        row["splits"] = _counted(b.split for b in members)
        if rows:
            parts = [len(b) for b in members]
            row |= {"parts": [min(parts), float(np.median(parts)), max(parts)], "measured": len(rows)}
            row |= {key: float(np.mean([entry[key] for entry in rows])) for key in MEASURES}
            row["complete"] = float(np.mean([b.complete for b in members]))
        out.append(row)
    return out


MEASURES = (
    "complete", "chance", "alternatives", "dead_ends", "dead_end_states", "series", "look_alikes", "random",
    "inside_out", "rule",
)  # fmt: skip
"""What is averaged over a family's blueprints."""


def measure(blueprint: Blueprint, *, states: int = 1) -> dict[str, Any]:
    """Return what one blueprint teaches.

    ``chance``: mean share of right parts among those that remain, over levels but the last. ``alternatives``: share
    of parts with more than one clause. ``dead_ends``: whether some state looked at has a part that can be inserted but
    leads nowhere; ``dead_end_states``: share of such states. ``series``: share of levels with one right class of parts.
    """
    masks, rng = blueprint.masks, np.random.default_rng(blueprint.seed)
    kind = list(range(len(masks)))
    for members in blueprint.identical:
        for part in members:
            kind[part] = members[0]
    chances, dead, forced = [], [], []
    for count in range(len(masks) - 1):
        for _ in range(states):
            state = random_state(masks, count, rng)
            right = right_next(masks, state)
            chances.append(right.bit_count() / (len(masks) - count))
            dead.append(insertable(masks, state) != right)
            forced.append(len({kind[k] for k in range(len(masks)) if right >> k & 1}) == 1)
    clouds = part_clouds(blueprint.assembly(), 256, seed=blueprint.seed)
    clouds = normalised(clouds, *unit_frame(clouds[..., :3]))
    orders = {
        "random": heuristics.random_order(len(masks), rng),
        "inside_out": heuristics.inside_out(clouds),
        "rule": heuristics.by_clearance(clouds),
    }
    return {
        "id": blueprint.id,
        "family": blueprint.family,
        "split": blueprint.split,
        "parts": len(masks),
        "complete": blueprint.complete,
        "chance": float(np.mean(chances)),
        "alternatives": float(np.mean([len(clauses) > 1 for clauses in masks])),
        "dead_ends": any(dead),
        "dead_end_states": float(np.mean(dead)),
        "series": float(np.mean(forced)),
        "look_alikes": len(masks) > len(set(kind)),
    } | {name: is_right_order(masks, order) for name, order in orders.items()}


def nearest_neighbours(dataset: Dataset) -> dict[str, dict[str, float]]:
    """Return, by split, how far blueprints are from the nearest training one (root mean square of descriptors)."""
    multi = np.array([len(b) > 2 for b in dataset], dtype=bool)
    splits = np.array([b.split for b in dataset], dtype=str)
    points = dataset.descriptors
    train = points[multi & (splits == TRAIN)]
    out = {}
    for split in sorted(set(splits) - {TRAIN}):
        mine = points[multi & (splits == split)]
        if len(mine) and len(train):
            gaps = KDTree(train).query(mine)[0] / np.sqrt(points.shape[1])
            names = ("least", "p10", "median", "p90")
            quantiles = np.quantile(gaps, (0.0, 0.1, 0.5, 0.9))
            out[split] = dict(zip(names, (round(float(x), 4) for x in quantiles), strict=True))
    return out


def summary_lines(found: dict[str, Any]) -> list[str]:
    """Return a summary in words, with the paper's numbers beside."""
    sequences, paper = found["sequences"], found["sequences_of_paper"]
    lines = [
        f"{found['blueprints']} blueprints, {found['multi_part']} of three and more parts; "
        + ", ".join(f"{split} {count}" for split, count in found["splits"].items()),
        f"solved {100 * found['solved']:.1f} % of those attempted, "
        f"conditions proven complete {100 * found['proven_complete']:.1f} %",
        "sequences by steps     ours    paper",
    ]
    lines += [f"  {name:<16} {sequences[name]:>9} {paper.get(name, 0):>8}" for name in ("3", "4-7", "more")]
    lines += [f"  {'all':<16} {sum(sequences[n] for n in paper):>9} {sum(paper.values()):>8}"]
    lines += [f"motions {found['moves']}, with a contact {found['contacts']}"]
    lines += ["parts: " + ", ".join(f"{n}: {count}" for n, count in sorted(found["parts"].items(), key=_as_number))]
    lines += ["orders: " + ", ".join(f"{n}: {count}" for n, count in sorted(found["orders"].items()))]
    lines += [f"failed: {reason} ({count})" for reason, count in found["failures"].items()]
    return lines


def family_lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return a table, a line a family."""
    heads = ("share", "complete", "chance", "altern.", "dead st.", "series", "random", "inside", "rule")
    lines = [f"{'family':<18} {'made':>5} {'failed':>6} {'parts':>9} " + " ".join(f"{head:>8}" for head in heads)]
    for row in rows:
        line = f"{row['family']:<18} {row['blueprints']:>5} {row['failed']:>6}"
        if "parts" in row:
            low, middle, high = row["parts"]
            keys = ("share", "complete", "chance", "alternatives", "dead_end_states", "series")
            values = [row[key] for key in (*keys, "random", "inside_out", "rule")]
            line += f" {low:>2}-{middle:>2.0f}-{high:>3} " + " ".join(f"{value:>8.3f}" for value in values)
        lines.append(line)
    return lines


def _as_number(item: tuple[str, int]) -> int:
    return int(item[0])


def _steps_class(parts: int) -> str:
    return "2" if parts < 3 else "3" if parts == 3 else "4-7" if parts < 8 else "more"


def _decade(orders: int | None) -> str:
    return "not counted" if orders is None else f"1e{len(str(orders)) - 1:02d}"


def _counted(names: Iterable[str]) -> dict[str, int]:
    out: dict[str, int] = {}
    for name in names:
        out[name] = out.get(name, 0) + 1
    return dict(sorted(out.items()))
