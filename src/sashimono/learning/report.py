"""Tables of evaluations, beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping

from sashimono.learning.evaluate import Evaluation, Interval

PAPER = {
    "NSM": (75.0, 57.8, 58.5),
    "DGL": (77.4, 54.1, 104.4),
    "ATA": (None, None, 24313.0),
    "RL": (None, 63.9, None),
    "Seg-PAST": (90.3, 80.4, 52.2),
    "NoAux-PAST": (79.1, 58.4, 52.2),
    "PAST": (91.7, 82.9, 52.2),
}
"""Table I of the paper: 1-Acc [%], Seq-Acc [%], time [ms]. RL's figure is its success rate."""

ROW_OF = {
    "nsm": "NSM",
    "dgl": "DGL",
    "ata": "ATA",
    "ppo": "RL",
    "rl": "RL",
    "seg": "Seg-PAST",
    "noaux": "NoAux-PAST",
    "past": "PAST",
}
"""The paper's row that a method is an instance of, by the first word of its name; ``past-posed`` is ours."""

ORDER = ("random", "inside out", "rule", *ROW_OF)
"""The order of table I, by the first word of a method's name or by all of it; ours is last."""


def in_order(evaluations: Mapping[str, Evaluation]) -> dict[str, Evaluation]:
    """Return evaluations in the order of table I, what needs no learning first and ours last."""

    def place(name: str) -> tuple[int, str]:
        known = name if name in ORDER else name.split("-")[0]
        return (ORDER.index(known) if known in ORDER and not is_ours(name) else len(ORDER)), name

    return {name: evaluations[name] for name in sorted(evaluations, key=place)}


def is_ours(name: str) -> bool:
    """Return whether a method is none of the paper's: it has the parts in place."""
    return name.startswith("past-posed")


def table_one(evaluations: Mapping[str, Evaluation]) -> str:
    """Return table I as Markdown: the paper's figures beside ours, on our data. Accuracies in per cent."""
    head = [
        "method",
        "paper 1-Acc",
        "paper Seq",
        "paper ms",
        "1-Acc drawn",
        "1-Acc argmax",
        "chance",
        "precision/recall",
        "Seq exact",
        "Seq exchange",
        "Seq listed",
        "ms",
    ]
    rows = [head, ["---"] * len(head)]
    for name, evaluation in evaluations.items():
        own = evaluation.overall
        row = "" if is_ours(name) else ROW_OF.get(name.split("-")[0], "")
        paper = PAPER.get(row, (None, None, None))
        rows.append(
            [
                name,
                *(_number(value) for value in paper),
                _percent(own["expected"]),
                _percent(own["argmax"]),
                f"{100 * own['chance'].value:.1f}",
                f"{100 * own['precision'].value:.0f}/{100 * own['recall'].value:.0f}",
                _percent(own["sequence"]),
                _percent(own["sequence_exchange"]),
                _percent(own["sequence_listed"]),
                _number(evaluation.milliseconds.get("median")),
            ]
        )
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def group_table(evaluations: Mapping[str, Evaluation], group: str, figure: str = "sequence_exchange") -> str:
    """Return one figure by group as Markdown.

    Args:
        evaluations: By method.
        group: ``by_parts`` (the paper's sensitivity), ``by_family`` or ``by_split``.
        figure: Which of the figures.
    """
    keys: dict[str, Interval] = {}
    for evaluation in evaluations.values():
        keys |= {key: values["blueprints"] for key, values in getattr(evaluation, group).items()}
    order = sorted(keys, key=lambda key: (int(key), "") if key.isdigit() else (0, key))
    rows = [[group.removeprefix("by_"), "blueprints", *evaluations], ["---"] * (2 + len(evaluations))]
    for key in order:
        cells = [getattr(evaluation, group).get(key) for evaluation in evaluations.values()]
        rows.append([key, f"{keys[key].value:.0f}", *("" if c is None else _percent(c[figure]) for c in cells)])
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _percent(interval: Interval) -> str:
    half = 50 * (interval.high - interval.low)
    return f"{100 * interval.value:.1f} ± {half:.1f}"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"
