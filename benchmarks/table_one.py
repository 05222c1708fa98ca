"""Table I: every method on the test split, what each was trained on, and how PAST learns with more of it.

    python benchmarks/table_one.py FIGURES --weights FILE... [--curve JSON...] [--images docs/images]

FIGURES is a folder that `sashimono evaluate` wrote. Its tables are copied, and what it says by group without the single
blueprints; its figure and the learning curve go to the folder of images. --curve names evaluations of one model after
longer and longer training. What each was trained on is read from the weights that are called as it is.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from common import REPOSITORY, machine, table, write_json

from sashimono.learning.evaluate import Evaluation, Interval, read_evaluation
from sashimono.learning.figures import draw_learning_curve
from sashimono.learning.weights import read_weights

GROUPED = ("blueprints", "argmax", "sequence", "sequence_exchange", "pose_distance")
"""What is kept by group."""

CURVE = {"argmax": "1-Acc, argmax", "sequence": "Seq-Acc"}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figures", type=Path)
    parser.add_argument("--weights", type=Path, nargs="*", default=[])
    parser.add_argument("--curve", type=Path, nargs="*", default=[])
    parser.add_argument("--out", type=Path, default=REPOSITORY / "benchmarks" / "results" / "table_one")
    parser.add_argument("--images", type=Path, help="folder for the figures, such as docs/images")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(options.figures / "tables.md", options.out / "tables.md")
    if options.images:
        shutil.copyfile(options.figures / "sensitivity.svg", options.images / "sensitivity.svg")
    methods = [read_evaluation(path) for path in sorted(options.figures.glob("*.json"))]
    trained = {title(path): spent(path) for path in options.weights}
    content: dict[str, Any] = {
        "machine": machine(),
        "data": methods[0].data,
        "trained": trained,
        "methods": {evaluation.name: slim(evaluation) for evaluation in methods},
    }
    points = sorted(
        ((trained[path.stem]["states"], read_evaluation(path)) for path in options.curve), key=lambda point: point[0]
    )
    if points:
        levels = {e.name: e.overall["sequence"].value for e in methods if e.name in ("inside out", "rule")}
        draw_learning_curve(points, (options.images or options.out) / "learning_curve.svg", lines=levels)
        content["curve"] = [{"states": states, **values(evaluation.overall)} for states, evaluation in points]
        content["points_per_tenfold"] = slopes = {key: slope(points, key) for key in CURVE}
        rows = [
            (f"{states:,.0f}", *(f"{100 * evaluation.overall[key].value:.1f} %" for key in CURVE))
            for states, evaluation in points
        ]
        print(table(("states", *CURVE.values()), rows))
        print("ten times the states:", ", ".join(f"{slopes[key]:+.1f} points of {name}" for key, name in CURVE.items()))
    write_json(options.out / "results.json", content)


def title(path: Path) -> str:
    """Return what `sashimono evaluate` calls a file of weights."""
    return path.resolve().parent.name if path.stem == "weights" else path.stem


def spent(path: Path) -> dict[str, float]:
    """Return the states that a model was trained on and the minutes that it took, earlier cycles included."""
    card = read_weights(path).card
    return {key: card[key] + card.get(f"{key}_before", 0) for key in ("states", "minutes")}


def slim(evaluation: Evaluation) -> dict[str, Any]:
    """Return an evaluation without its single blueprints."""
    groups = {
        name: {
            key: {figure: round(group[figure].value, 4) for figure in GROUPED if figure in group}
            for key, group in getattr(evaluation, name).items()
        }
        for name in ("by_split", "by_parts", "by_family")
    }
    return {"overall": values(evaluation.overall), **groups, "milliseconds": dict(evaluation.milliseconds)}


def values(group: dict[str, Interval] | Any) -> dict[str, list[float]]:
    """Return figures as value, low and high."""
    return {name: [round(x, 4) for x in (i.value, i.low, i.high)] for name, i in group.items()}


def slope(points: list[tuple[float, Evaluation]], key: str) -> float:
    """Return the points of a figure that ten times the states bring, by least squares."""
    found = [100 * evaluation.overall[key].value for _, evaluation in points]
    return round(float(np.polyfit(np.log10([states for states, _ in points]), found, 1)[0]), 2)


if __name__ == "__main__":
    main()
