"""The paper's sensitivity figure and learning curves, drawn from evaluations; needs matplotlib (extra ``train``)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from sashimono.files import atomic_write
from sashimono.learning.evaluate import Evaluation
from sashimono.learning.report import is_ours

FEWEST = 10
"""Numbers of parts with fewer blueprints are left out of a curve: its interval would be as wide as the figure."""

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#999999")
"""Told apart by colour-blind readers too (Okabe and Ito)."""

LINES = ("-", "--", ":", "-.")

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "sashimono",
}


def draw_sensitivity(evaluations: Mapping[str, Evaluation], path: Path) -> None:
    """Draw Seq-Acc and error of the predicted translations over the number of parts, as the paper's last figure does.

    Args:
        evaluations: By method; those without poses are in the left panel only.
        path: An SVG, PNG or PDF file.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9, 3.8), layout="constrained")
        accuracy, pose = figure.subplots(1, 2)
        for k, (name, evaluation) in enumerate(evaluations.items()):
            look = _look(name, k)
            _curve(accuracy, evaluation, "sequence", 100.0, name, look)
            _curve(pose, evaluation, "pose_distance", 1.0, name, look)
        accuracy.set(xlabel="parts", ylabel="Seq-Acc, exact [%]", ylim=(0, 103))
        pose.set(xlabel="parts", ylabel="error of translation [blueprint's radius]")
        if not pose.lines:
            pose.set_visible(False)
        figure.legend(*accuracy.get_legend_handles_labels(), loc="outside right upper", frameon=False)
        _save(figure, path)


def draw_learning_curve(
    points: Sequence[tuple[float, Evaluation]], path: Path, *, lines: Mapping[str, float] | None = None
) -> None:
    """Draw Seq-Acc and 1-Acc over the states that were trained on, with 95 % intervals.

    Args:
        points: States and what was reached with them, of one model.
        path: An SVG, PNG or PDF file.
        lines: Seq-Acc of other methods, drawn as level lines with their names.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(5.2, 3.6), layout="constrained")
        axes = figure.subplots()
        states = [count for count, _ in points]
        for key, name, colour in (("argmax", "1-Acc, argmax", COLOURS[0]), ("sequence", "Seq-Acc", COLOURS[1])):
            found = [evaluation.overall[key] for _, evaluation in points]
            axes.plot(states, [100 * i.value for i in found], "o-", color=colour, label=name, markersize=4)
            axes.fill_between(
                states, [100 * i.low for i in found], [100 * i.high for i in found], color=colour, alpha=0.15, lw=0
            )
        for k, (name, level) in enumerate((lines or {}).items()):
            axes.axhline(100 * level, color="#555555", ls=LINES[1 + k % 3], lw=1, label=f"{name}, Seq-Acc")
        axes.set(xscale="log", xlabel="states trained on", ylabel="%", ylim=(0, 103))
        axes.legend(frameon=False, loc="lower right")
        _save(figure, path)


def _curve(axes: Any, evaluation: Evaluation, key: str, scale: float, name: str, look: Mapping[str, object]) -> None:
    groups = evaluation.by_parts
    counts = sorted(
        int(parts) for parts, group in groups.items() if key in group and group["blueprints"].value >= FEWEST
    )
    if counts:
        values = [scale * groups[str(parts)][key].value for parts in counts]
        axes.plot(counts, values, label=name, markersize=3, marker="o", **look)


def _look(name: str, k: int) -> dict[str, object]:
    if is_ours(name):
        return {"color": "black", "linestyle": LINES[0], "linewidth": 2.2}
    return {"color": COLOURS[k % len(COLOURS)], "linestyle": LINES[k // len(COLOURS) % len(LINES)], "linewidth": 1.2}


def _save(figure: Figure, path: Path) -> None:
    with atomic_write(path) as scratch:
        figure.savefig(
            scratch, format=path.suffix[1:], dpi=150, metadata={"Date": None} if path.suffix == ".svg" else {}
        )
