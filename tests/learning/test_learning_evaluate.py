"""Figures of an evaluation, against what can be worked out by hand."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from learning_toy import ToyBlueprint, ToyDataset, toy_dataset

from sashimono.d4pas.states import right_next
from sashimono.learning.cloud_cache import CloudCache, CloudConfig, make_cache
from sashimono.learning.evaluate import (
    Evaluation,
    OrderPredictor,
    evaluate,
    follow,
    heuristics,
    judge_order,
    listed_steps,
    one_step,
    read_evaluation,
    read_evaluations,
    summarise,
    write_evaluation,
)
from sashimono.learning.report import group_table, in_order, table_one

CLOUDS = CloudConfig(part_points=32, blueprint_points=64, states=16)


@pytest.fixture(scope="module")
def data() -> ToyDataset:
    return toy_dataset(12)


@pytest.fixture(scope="module")
def cache(data: ToyDataset, tmp_path_factory: pytest.TempPathFactory) -> CloudCache:
    return make_cache(data, tmp_path_factory.mktemp("cache"), config=CLOUDS)


class Oracle:
    """Knows the conditions; says ``sure`` of what is right, the rest of it of what is not."""

    def __init__(self, data: ToyDataset, sure: float) -> None:
        self.data, self.sure = data, sure

    def encode(self, blueprints: np.ndarray) -> list[ToyBlueprint]:
        return [self.data.blueprints[k] for k in blueprints.tolist()]

    def probabilities(self, encoded: list[ToyBlueprint], placed: np.ndarray) -> np.ndarray:
        out = np.zeros((*placed.shape, max(blueprint.blocks for blueprint in encoded)))
        for k, blueprint in enumerate(encoded):
            for s, state in enumerate(placed[k].tolist()):
                right = right_next(blueprint.masks, state)
                for part in range(blueprint.blocks):
                    if not state >> part & 1:
                        out[k, s, part] = self.sure if right >> part & 1 else 1 - self.sure
        return out

    def orders(self, encoded: Any) -> None:
        return None

    def pose_errors(self, encoded: Any) -> None:
        return None


def judged(data: ToyDataset, cache: CloudCache, predictor: Any, **options: Any) -> Evaluation:
    return evaluate("x", predictor, data, cache, np.arange(len(cache)), states=8, chunk=5, **options)


def test_who_knows_the_conditions_has_everything_right(data: ToyDataset, cache: CloudCache) -> None:
    found = judged(data, cache, Oracle(data, 1.0), timed=3)
    for name in ("argmax", "expected", "sequence", "sequence_exchange", "sequence_listed", "precision", "recall"):
        assert found.overall[name].value == pytest.approx(1.0), name
        assert found.overall[name].low == pytest.approx(1.0)
    assert 0.2 < found.overall["chance"].value < 0.6
    assert found.overall["blueprints"].value == 12
    assert set(found.milliseconds) == {"median", "90 %"}
    assert all(record.first_error is None for record in found.records)


def test_who_is_always_wrong_has_nothing_right(data: ToyDataset, cache: CloudCache) -> None:
    found = judged(data, cache, Oracle(data, 0.0))
    for name in ("argmax", "expected", "sequence", "sequence_listed_exchange", "precision", "recall"):
        assert found.overall[name].value == 0.0, name
    # the last choice is right whatever is said
    parts = np.array([blueprint.blocks for blueprint in data.blueprints])
    assert found.overall["argmax_all"].value == pytest.approx((1 / parts).mean())
    assert all(record.first_error == 0 for record in found.records)


def test_the_expectation_is_the_share_of_the_probability(data: ToyDataset, cache: CloudCache) -> None:
    """One right part of r remaining: sure / (sure + (r - 1) (1 - sure)); each number of placed parts weighs alike."""
    sure = 0.7
    found = judged(data, cache, Oracle(data, sure))
    for record in found.records:
        remaining = np.arange(record.parts, 1, -1)
        share = sure / (sure + (remaining - 1) * (1 - sure))
        picked = share[np.minimum((np.arange(8) + 0.5) / 8 * len(share), len(share) - 1).astype(int)]
        assert record.expected == pytest.approx(picked.mean())
        assert record.chance == pytest.approx(
            (1 / remaining)[((np.arange(8) + 0.5) / 8 * len(share)).astype(int)].mean()
        )


def two_pegs() -> ToyBlueprint:
    """Part 0 first, then parts 1 and 2, of one shape: 2 only after 1."""

    class Pegs(ToyBlueprint):
        @property
        def identical(self) -> tuple[tuple[int, ...], ...]:
            return ((1, 2),)

    return Pegs(seed=0, blocks=3, order=(0, 1, 2))


def test_identical_parts_may_be_exchanged() -> None:
    blueprint = two_pegs()
    verdicts, first = judge_order(blueprint, [0, 2, 1])
    assert verdicts == {
        "sequence": False,
        "sequence_exchange": True,
        "sequence_listed": False,
        "sequence_listed_exchange": True,
    }
    assert first == 1
    assert not any(judge_order(blueprint, [1, 0, 2])[0].values())
    state, right = np.array([0b001]), np.array([0b010])
    said = one_step(blueprint, state, right, np.array([[0.0, 0.2, 0.9]]))
    assert said["argmax"] == 0.0
    assert said["argmax_exchange"] == 1.0
    assert said["expected"] == pytest.approx(0.2 / 1.1)
    assert (said["set_hits"], said["set_said"], said["set_right"]) == (0.0, 1.0, 1.0)


def test_exchanging_looks_further_than_the_next_step() -> None:
    """Parts 0 and 1 look alike, and only one of them leaves room for part 2."""
    room = {0b00: 0b011, 0b01: 0b000, 0b10: 0b100, 0b110: 0b001}
    classes = np.array([0, 0, 2])
    assert follow([0, 2, 1], lambda state: room.get(state, 0), classes) == 3
    assert follow([0, 2, 1], lambda state: room.get(state, 0), np.arange(3)) == 1


def test_listed_sequences_may_be_mixed_where_they_meet() -> None:
    table = listed_steps([(0, 1, 2, 3), (1, 0, 3, 2)])
    assert table == {0: 0b11, 0b01: 0b10, 0b10: 0b01, 0b11: 0b1100, 0b111: 0b1000, 0b1011: 0b0100}
    assert follow([0, 1, 3, 2], lambda state: table.get(state, 0), np.arange(4)) == 4


def test_an_order_is_a_method(data: ToyDataset, cache: CloudCache) -> None:
    """Placed from the ground up, every pile is right; the order's next part is said with certainty."""

    def from_below(clouds: np.ndarray) -> list[int]:
        spread = clouds[:, :, :3].mean(axis=1)
        axis = np.linalg.svd(spread - spread.mean(axis=0))[2][0]
        order = np.argsort(spread @ axis)
        widths = np.linalg.norm(clouds[:, :, :2].std(axis=1), axis=1)
        return [int(k) for k in (order if widths[order[0]] > widths[order[-1]] else order[::-1])]

    found = judged(data, cache, OrderPredictor(cache=cache, order=from_below))
    assert found.overall["sequence"].value == 1.0
    assert found.overall["argmax"].value == 1.0
    assert set(heuristics(cache)) == {"random", "inside out", "rule"}


def test_intervals_come_of_blueprints(data: ToyDataset, cache: CloudCache) -> None:
    records = judged(data, cache, Oracle(data, 1.0)).records
    wrong = judged(data, cache, Oracle(data, 0.0)).records
    mixed = summarise([*records, *wrong], np.random.default_rng(0))["sequence"]
    assert mixed.value == 0.5
    half = 1.96 * 0.5 / np.sqrt(24)
    assert mixed.low == pytest.approx(0.5 - half, abs=0.06)
    assert mixed.high == pytest.approx(0.5 + half, abs=0.06)


def test_an_evaluation_is_written_and_read(data: ToyDataset, cache: CloudCache, tmp_path: Path) -> None:
    found = judged(data, cache, Oracle(data, 1.0))
    write_evaluation(tmp_path / "x.json", found)
    assert read_evaluation(tmp_path / "x.json") == found
    assert set(found.by_parts) == {"3", "4", "5"}
    assert set(found.by_split) == {"train", "val"}


def test_table_one_has_the_papers_figures_beside_ours(data: ToyDataset, cache: CloudCache) -> None:
    found = judged(data, cache, Oracle(data, 1.0))
    table = table_one({"noaux-small": found, "past-posed": found, "rule": found}).splitlines()
    assert table[2].startswith("| noaux-small | 79.1 | 58.4 | 52.2 | 100.0 ± 0.0 |")
    assert table[3].startswith("| past-posed |  |  |  | 100.0 ± 0.0 |")
    assert table[4].startswith("| rule |  |  |  |")
    rows = group_table({"rule": found}, "by_parts").splitlines()
    assert [row.split(" | ")[0] for row in rows[2:]] == ["| 3", "| 4", "| 5"]


def test_rows_stand_in_the_order_of_table_one(data: ToyDataset, cache: CloudCache) -> None:
    found = judged(data, cache, Oracle(data, 1.0))
    names = ["past-posed", "past-small", "rl-axes", "inside out", "nsm-small", "mine", "seg-small"]
    expected = ["inside out", "nsm-small", "rl-axes", "seg-small", "past-small", "mine", "past-posed"]
    assert list(in_order(dict.fromkeys(names, found))) == expected


def test_only_evaluations_of_the_same_blueprints_are_reported_together(
    data: ToyDataset, cache: CloudCache, tmp_path: Path
) -> None:
    found = judged(data, cache, Oracle(data, 1.0))
    write_evaluation(tmp_path / "a.json", found)
    write_evaluation(tmp_path / "b.json", replace(found, name="other data", data="0"))
    write_evaluation(tmp_path / "c.json", replace(found, name="fewer", records=found.records[1:]))
    (tmp_path / "card.json").write_text("[]", encoding="utf-8")
    assert read_evaluations(tmp_path, found) == {found.name: found}


@pytest.mark.parametrize("name", ["x.svg", "x.png"])
def test_figures_are_drawn_and_the_same_each_time(
    data: ToyDataset, cache: CloudCache, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    pytest.importorskip("matplotlib", reason="the train extra is not installed")
    from sashimono.learning import figures

    monkeypatch.setattr(figures, "FEWEST", 1)
    right, wrong = judged(data, cache, Oracle(data, 1.0)), judged(data, cache, Oracle(data, 0.0))
    figures.draw_sensitivity({"rule": wrong, "past-posed": right}, tmp_path / name)
    first = (tmp_path / name).read_bytes()
    figures.draw_sensitivity({"rule": wrong, "past-posed": right}, tmp_path / name)
    assert (tmp_path / name).read_bytes() == first
    figures.draw_learning_curve([(100, wrong), (1000, right)], tmp_path / f"curve-{name}", lines={"rule": 0.5})
    assert (tmp_path / f"curve-{name}").stat().st_size > 1000
    if name.endswith("svg"):
        assert "past-posed" in figures_text(first)


def figures_text(svg: bytes) -> str:
    """Return the words of a drawing: matplotlib leaves each as a comment beside its outlines."""
    return " ".join(re.findall(r"<!-- (.*?) -->", svg.decode("utf-8")))
