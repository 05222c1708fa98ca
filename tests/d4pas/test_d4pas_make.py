"""Making a dataset: the same bytes for any number of workers and after kills, failures recorded, labels that hold."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from sashimono.cli import run
from sashimono.d4pas import load, make_dataset
from sashimono.d4pas.check import check_blueprint, check_dataset
from sashimono.d4pas.descriptor import describe
from sashimono.d4pas.export import file_stems
from sashimono.d4pas.journal import Journal
from sashimono.d4pas.recipe import build_assembly, draw_recipe
from sashimono.d4pas.splits import SplitConfig, assign_splits, near_duplicates
from sashimono.d4pas.states import is_right_order
from sashimono.d4pas.workers import run_items
from sashimono.errors import InputError

BOOK = """
name = "test"
max_sequences = 6
[families]
bolted_plates = 4
[pairs]
bolted_plates = 2
[split]
test = 1
val = 0
most_share = 0.5
"""


@pytest.fixture(scope="module")
def book(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("book") / "book.toml"
    path.write_text(BOOK, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def made(book: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("dataset")
    assert run(["dataset", "make", str(book), "--out", str(out)]) == 0
    return out


def files_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "timings.json"}


def test_what_is_written_is_what_the_contract_says(made: Path) -> None:
    assert set(files_of(made)) == {f"{name}.parquet" for name in ("blueprints", "sequences", "steps", "failures")} | {
        "manifest.json"
    }
    rows = pq.read_table(made / "blueprints.parquet").to_pylist()
    assert len(rows) == 6
    assert {row["n_parts"] for row in rows} > {2}
    for row in rows:
        assert len(row["clauses"]) == row["n_parts"] == len(row["parts"])
        assert int(row["orders"]) >= 1
    steps = pq.read_table(made / "steps.parquet").to_pylist()
    assert len(steps) == sum(row["n_parts"] for row in rows)
    assert {len(pose) for step in steps for pose in step["waypoints"]} == {7}
    assert {step["contact"] for step in steps} <= {None, "grasp", "push"}


def test_loaded_blueprints_follow_their_own_conditions(made: Path) -> None:
    data = load(made)
    assert sum(len(blueprint) > 2 for blueprint in data.split("test")) == 1
    for blueprint in data:
        assert blueprint.sequences
        assert len(set(blueprint.sequences)) == len(blueprint.sequences)
        assert blueprint.orders is not None
        assert len(blueprint.sequences) == min(6, blueprint.orders)
        assert all(is_right_order(blueprint.masks, order) for order in blueprint.sequences)
        assert blueprint.assembly().names == blueprint.parts
    with pytest.raises(InputError, match="no blueprint 'nothing'"):
        data["nothing"]


def test_labels_hold_against_the_verifier_and_wrong_ones_do_not(made: Path) -> None:
    data = load(made)
    assert check_dataset(data, sample=None).problems == ()
    blueprint = max(data, key=len)
    steps = [dict(step) for step in data.steps[blueprint.id]]
    through = next(step for step in reversed(steps) if len(step["waypoints"]) > 1)
    start = np.array(through["waypoints"][0])
    start[:3] *= -1.0  # the other way: through what is placed
    through["waypoints"] = [start.tolist(), through["waypoints"][-1]]
    assert any("deep" in problem or "mm" in problem for problem in check_blueprint(blueprint, steps))
    held = next(step for step in steps if step["contact"] == "grasp")
    held["points"] = [[x + 0.01 for x in point] for point in held["points"]]
    assert any("off the surface" in problem for problem in check_blueprint(blueprint, steps))


def test_contacts_that_meet_a_part_or_that_the_conditions_do_not_know_are_found(made: Path) -> None:
    blueprint = max(load(made), key=len)
    steps = [dict(step) for step in load(made).steps[blueprint.id]]
    fat = [step | {"radius": step["radius"] and 20.0 * step["radius"]} for step in steps]
    assert any("fingertip" in problem for problem in check_blueprint(blueprint, fat))
    nowhere = replace(blueprint, executable=((),) * len(blueprint))
    assert any("is grasped where" in problem for problem in check_blueprint(nowhere, steps))
    everywhere = replace(blueprint, executable=((0, 1),) + ((0,),) * (len(blueprint) - 1))
    found = check_blueprint(everywhere, steps)
    assert any("not minimal" in problem for problem in found)
    assert any("held where it cannot leave" in problem for problem in found)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ({"sequences": ()}, "0 orders are listed"),
        ({"sequences": "twice"}, "1 of them different"),
        ({"steps": []}, "not those of the first listed orders"),
        ({"steps": "cut"}, "not those of the first listed orders"),
        ({"waypoints": "still"}, "does not begin outside"),
        ({"waypoints": "one"}, "does not begin outside"),
    ],
)
def test_labels_that_say_too_little_are_found(made: Path, edit: dict[str, Any], said: str) -> None:
    data = load(made)
    blueprint = max(data, key=len)
    steps = [dict(step) for step in data.steps[blueprint.id]]
    if "sequences" in edit:
        blueprint = replace(blueprint, sequences=blueprint.sequences[:1] * 2 if edit["sequences"] else ())
    if "steps" in edit:
        steps = steps[:-1] if edit["steps"] else []
    if "waypoints" in edit:
        last = steps[-1]["waypoints"][-1]
        steps[-1]["waypoints"] = [last, last] if edit["waypoints"] == "still" else [last]
    assert any(said in problem for problem in check_blueprint(blueprint, steps))


@pytest.mark.parametrize("workers", [2, pytest.param(4, marks=pytest.mark.slow)])
def test_more_workers_make_the_same_bytes(book: Path, made: Path, tmp_path: Path, workers: int) -> None:
    make_dataset(str(book), tmp_path / "more", workers=workers)
    assert files_of(tmp_path / "more") == files_of(made)


@pytest.mark.parametrize("kills", [(2, 4), pytest.param((1, 2, 4, 5, 6), marks=pytest.mark.slow)])
def test_killed_at_any_moment_it_goes_on(book: Path, made: Path, tmp_path: Path, kills: tuple[int, ...]) -> None:
    out = tmp_path / "killed"
    command = [sys.executable, "-m", "sashimono", "dataset", "make", str(book), "--out", str(out)]
    journal = out / "journal.jsonl"
    for lines in kills:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while process.poll() is None and not (journal.exists() and journal.read_bytes().count(b"\n") >= lines):
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
        process.wait()
        with journal.open("ab") as file:
            file.write(b'{"key": "torn')  # as if killed in the middle of a line
    assert run(["dataset", "make", str(book), "--out", str(out)]) == 0
    assert files_of(out) == files_of(made)
    journal.write_text("left by a kill between the manifest and its removal", encoding="utf-8")
    assert run(["dataset", "make", str(book), "--out", str(out)]) == 0
    assert not journal.exists()


def test_a_shipped_book_goes_on_in_a_folder_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for limit in ("1", "2"):  # another limit is another run
        assert run(["dataset", "make", "tiny", "--out", "tiny", "--limit", limit]) == (0 if limit == "1" else 2)
    assert run(["dataset", "make", "tiny", "--out", "tiny", "--limit", "1"]) == 0


def test_one_run_at_a_time_is_at_work_in_a_folder(
    book: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    journal = Journal(tmp_path / "journal.jsonl", {"identity": "ours"})
    assert run(["dataset", "make", str(book), "--out", str(tmp_path)]) == 2
    assert "another run is at work here" in capsys.readouterr().err
    journal.close()


def test_another_run_in_the_same_folder_is_refused(
    made: Path, book: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["dataset", "make", "tiny", "--out", str(made)]) == 2
    assert "holds another finished dataset" in capsys.readouterr().err
    Journal(tmp_path / "journal.jsonl", {"identity": "another"}).close()
    assert run(["dataset", "make", str(book), "--out", str(tmp_path)]) == 2
    assert "holds the beginning of another run" in capsys.readouterr().err


def test_commands_look_at_a_dataset(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    blueprint = load(made)[0]
    assert run(["dataset", "stats", str(made), "--json", str(tmp_path / "stats.json")]) == 0
    assert "proven complete" in capsys.readouterr().out
    assert run(["dataset", "check", str(made), "--sample", "1"]) == 0
    assert run(["dataset", "export", blueprint.id, "--from", str(made), "--out", str(tmp_path / "parts")]) == 0
    assert sorted(path.stem for path in (tmp_path / "parts").iterdir()) == sorted(blueprint.parts)
    for _ in range(2):
        assert run(["dataset", "show", blueprint.id, "--from", str(made), "--out", str(tmp_path / "shown")]) == 0
    assert "can leave at once" in capsys.readouterr().out
    assert run(["dataset", "export", "nothing", "--from", str(made), "--out", str(tmp_path / "none")]) == 2
    assert run(["dataset", "stats", str(tmp_path)]) == 2
    assert "no manifest.json" in capsys.readouterr().err


def dies(item: int) -> dict[str, int]:
    if item == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"square": item * item}


def test_a_worker_that_dies_costs_one_item() -> None:
    done = dict(run_items(range(8), dies, workers=2))
    assert done == {k: None if k == 3 else {"square": k * k} for k in range(8)}


def test_names_become_files_each_once() -> None:
    assert file_stems(["M3/pin", "M3\\pin", "m3_PIN", ".hidden", "ok-1 a"]) == [
        "M3_pin", "M3_pin_2", "m3_PIN_3", "hidden", "ok-1 a",
    ]  # fmt: skip


@pytest.mark.parametrize("family", ["tripod", "table", "ball_valve"])
def test_a_descriptor_is_that_of_the_product_whatever_the_seed(family: str) -> None:
    recipe = draw_recipe(family, 3)
    one, two = (describe(build_assembly(replace(recipe, seed=seed))) for seed in (1, 2))
    assert np.sqrt(((one - two) ** 2).mean()) < SplitConfig().near / 4


def test_near_duplicates_stay_on_one_side() -> None:
    rng = np.random.default_rng(0)
    centers = rng.random((60, 17))
    rows = [
        {"id": f"a-{k}", "family": "a", "n_parts": 5, "descriptor": list(centers[k // 2] + 1e-4 * rng.random(17))}
        for k in range(120)
    ]
    rows += [{"id": "b-0", "family": "b", "n_parts": 5, "descriptor": [0.0] * 17}]
    rows = [row | {"seed": int(row["id"].split("-")[1])} for row in rows]
    rows += [
        {"id": f"a-{k}-pair", "family": "a", "n_parts": 2, "descriptor": [0.0] * 17, "seed": k} for k in (0, 1, 200)
    ]
    splits = assign_splits(rows, config=SplitConfig(test=20, val=20, unseen=("b",)))
    assert splits[:120:2] == splits[1:120:2]
    assert splits.count("test") == splits.count("val") == 20
    assert splits[120:] == ["unseen-families", *splits[:2], "train"]  # pairs go with their product
    assert len(near_duplicates([row["descriptor"] for row in rows[:120]], near=0.02)) == 60
