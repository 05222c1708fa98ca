"""Bad input through every command: one line on standard error, exit status 2, soon, and nothing written."""

from __future__ import annotations

import json
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer.main
from broken_products import PRODUCTS, SHIFTED, folder_with, obj_text

from sashimono.cli import BAD_INPUT, app, run

SECONDS = 10.0
"""Processor time that a refusal may take."""

READERS = ("plan", "conditions", "fasteners", "explain", "doctor", "diff", "infer")
"""Commands that read a product."""

LOOKED_AT = {"OBJ flat", "OBJ in a point"}
"""Products at which the doctor looks, as it looks at open meshes: it says what is wrong, with exit status 1."""

OTHER_WORDS = {("PLY without faces", "infer"): "have no normals"}
"""What a command says that reads a product in another way: points without faces are a scan, for the network."""

CUTS = {"3MF bomb", "10,000 files", "3MF of 10,000 items"}
"""Cases that take a second each to make: through one command."""


def product_cases() -> list[Any]:
    """Every product through `plan` and, in turn, one of the other commands; through all the others if slow ones run."""
    cases = []
    for k, name in enumerate(PRODUCTS):
        quick = {"plan"} if name in CUTS else {"plan", READERS[1 + k % (len(READERS) - 1)]}
        for command in READERS:
            if not (command == "doctor" and name in LOOKED_AT):
                marks = () if command in quick else pytest.mark.slow
                cases.append(pytest.param(name, command, marks=marks, id=f"{name}-{command}"))
    return cases


def reading(command: str, path: Path) -> list[str]:
    """Return the arguments of a command that reads a product."""
    return {
        "plan": ["plan", str(path), "--out", "out"],
        "conditions": ["conditions", str(path), "--json", "c.json"],
        "fasteners": ["fasteners", str(path), "--json", "f.json"],
        "explain": ["explain", str(path), "--html", "e.html"],
        "doctor": ["doctor", str(path), "--json", "d.json", "--html", "d.html"],
        "diff": ["diff", str(path), str(path), "--json", "d.json"],
        "infer": ["infer", str(path), "--json", "i.json"],
    }[command]


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], place: Path) -> str:
    """Return the one line that a command says; it must have exit status 2, be quick, and write nothing."""
    capsys.readouterr()
    before = sorted(str(path) for path in place.rglob("*"))
    start = time.process_time()
    signal.setitimer(signal.ITIMER_VIRTUAL, 3.0 * SECONDS)  # what hangs fails, and does not hold up the others
    try:
        status = run(arguments)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    took = time.process_time() - start
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert status == BAD_INPUT, captured
    assert captured.out == ""
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("sashimono: ")
    assert sorted(str(path) for path in place.rglob("*")) == before, "something was written"
    assert took < SECONDS
    return lines[0]


def _stop(*_: object) -> None:
    raise TimeoutError("no answer")


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in; beside it is one for what is read."""
    place = tmp_path / "work"
    place.mkdir()
    monkeypatch.chdir(place)
    signal.signal(signal.SIGVTALRM, _stop)
    return place


@pytest.mark.parametrize(("name", "command"), product_cases())
def test_products_that_cannot_be_used(
    name: str, command: str, work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, says = PRODUCTS[name]
    inputs = tmp_path / "in"
    inputs.mkdir()
    path = make(inputs)
    assert OTHER_WORDS.get((name, command), says) in refused(reading(command, path), capsys, work)


# ------------------------------------------------------------------------------------------------ bad options

GRIPPER = {
    "name": "g", "max_opening": 0.1, "finger_width": 0.01, "finger_thickness": 0.01, "finger_length": 0.05,
    "tip_reach": 0.0, "pad_thickness": 0.0, "patch_radius": 0.005, "open_margin": 0.01, "palm_width": 0.1,
    "palm_depth": 0.1, "palm_length": 0.1,
}  # fmt: skip
TABLE = {"normal": [0, 0, 1], "offset": 0}

FILES: dict[str, str] = {
    "rubbish.json": "{",
    "list.json": "[]",
    "half.json": json.dumps({"name": "g"}),
    "negative.json": json.dumps({**GRIPPER, "finger_width": -1.0}),
    "word.json": json.dumps({**GRIPPER, "finger_width": "wide"}),
    "nan.json": json.dumps({**GRIPPER, "finger_width": float("nan")}),
    "bad.toml": "base = ",
    "unknown.toml": "bsae = 'a'",
    "type.toml": "base = 3",
    "pairs.toml": "before = ['a']",
    "up.toml": "up = [0, 0]",
    "far.toml": "up = [inf, 0, 0]",
    "names.toml": "exclude = 'a'",
    "no_table.json": json.dumps({"parts": {}}),
    "no_part.json": json.dumps({"table": TABLE, "parts": {"z": np.eye(4).tolist()}}),
    "no_pose.json": json.dumps({"table": TABLE, "parts": {"b": [1, 2]}}),
    "stretched.json": json.dumps({"table": TABLE, "parts": {"b": (2 * np.eye(4)).tolist()}}),
    "flat_table.json": json.dumps({"table": {"normal": [0, 0, 0], "offset": 0}, "parts": {"b": np.eye(4).tolist()}}),
    "config.toml": "steps = 'many'",
    "zip.npz": "PK\x03\x04",
    "recipe.toml": "families = 3",
}

PLAN = ["plan", "IN", "--out", "out"]
OPTIONS: list[tuple[list[str], str]] = [
    (["assemble"], "No such command"),
    (["plan"], "Missing argument"),
    (["plan", "IN"], "Missing option"),
    (["plan", "IN", "more", "--out", "out"], "unexpected extra argument"),
    ([*PLAN, "--colour"], "No such option"),
    ([*PLAN, "--seed", "one"], "--seed"),
    ([*PLAN, "--seed", "-1"], "--seed"),
    ([*PLAN, "--seed", "1.5"], "--seed"),
    ([*PLAN, "--seed"], "--seed"),
    ([*PLAN, "--unit", "parsec"], "unit 'parsec' is not known"),
    ([*PLAN, "--split", "half"], "--split half is not known"),
    ([*PLAN, "--method", "magic"], "--method magic"),
    ([*PLAN, "--motion", "fly"], "--motion fly"),
    ([*PLAN, "--device", "cuda:0"], "--device cuda:0 is for --method physics"),
    ([*PLAN, "--hands", "0"], "--hands"),
    ([*PLAN, "--gripper", "claw"], "gripper 'claw' is not known"),
    ([*PLAN, "--gripper", "absent.json"], "absent.json"),
    ([*PLAN, "--gripper", "rubbish.json"], "cannot be read as a gripper"),
    ([*PLAN, "--gripper", "list.json"], "not one JSON object"),
    ([*PLAN, "--gripper", "half.json"], "is missing, or no field"),
    ([*PLAN, "--gripper", "negative.json"], "not a length"),
    ([*PLAN, "--gripper", "word.json"], "not a length"),
    ([*PLAN, "--gripper", "nan.json"], "not a length"),
    ([*PLAN, "--grippers", "claw"], "claw"),
    ([*PLAN, "--base", "z"], "z"),
    ([*PLAN, "--up", "1,2"], "not X,Y,Z"),
    ([*PLAN, "--up", "a,b,c"], "not X,Y,Z"),
    ([*PLAN, "--up", "0,0,0"], "not a direction"),
    ([*PLAN, "--up", "nan,0,1"], "not a direction"),
    ([*PLAN, "--before", "a"], "not A:B"),
    ([*PLAN, "--before", "a:z"], "z"),
    ([*PLAN, "--before", "a:b", "--before", "b:a"], "no order does it all"),
    ([*PLAN, "--before", "a:b", "--base", "b"], "b"),
    ([*PLAN, "--exclude", "z*"], "no part is called so"),
    ([*PLAN, "--exclude", "*"], "leaves 0 of 2"),
    ([*PLAN, "--method", "physics", "--base", "a"], "--base"),
    ([*PLAN, "--constraints", "absent.toml"], "cannot be read as TOML"),
    ([*PLAN, "--constraints", "bad.toml"], "cannot be read as TOML"),
    ([*PLAN, "--constraints", "."], "cannot be read as TOML"),
    ([*PLAN, "--constraints", "unknown.toml"], "bsae is not known"),
    ([*PLAN, "--constraints", "type.toml"], "base is no name"),
    ([*PLAN, "--constraints", "pairs.toml"], "list of pairs"),
    ([*PLAN, "--constraints", "up.toml"], "three numbers"),
    ([*PLAN, "--constraints", "far.toml"], "not a direction"),
    ([*PLAN, "--constraints", "names.toml"], "no list of names"),
    ([*PLAN, "--resting", "absent.json"], "absent.json"),
    ([*PLAN, "--resting", "rubbish.json"], "rubbish.json"),
    ([*PLAN, "--resting", "no_table.json"], "table"),
    ([*PLAN, "--resting", "no_part.json"], "z"),
    ([*PLAN, "--resting", "no_pose.json"], "b"),
    ([*PLAN, "--resting", "stretched.json"], "b"),
    ([*PLAN, "--resting", "flat_table.json"], "normal"),
    (["plan", "IN", "--out", "taken"], "is a file"),
    (["plan", "IN", "--out", "taken/below"], "cannot be written to"),
    (["plan", "IN", "--out", "/proc/1/out"], "cannot be written to"),
    (["plan", "IN", "--out", "full"], "plan.html is a folder"),
    (["demo", "--out", "taken"], "is a file"),
    (["demo", "--seed", "x"], "--seed"),
    (["conditions", "IN", "--thorough", "-1"], "--thorough"),
    (["conditions", "IN", "--json", "."], "is a folder"),
    (["conditions", "IN", "--graph", "."], "is a folder"),
    (["conditions", "IN", "--graph", "taken/g.json"], "--graph"),
    (["fasteners", "IN", "--json", "."], "is a folder"),
    (["explain", "IN", "--part", "z"], "there is no part 'z'"),
    (["explain", "IN", "--fixed", "z"], "there is no part 'z'"),
    (["explain", "IN", "--fixed", ""], "--fixed"),
    (["explain", "IN", "--html", "."], "is a folder"),
    (["doctor", "IN", "--html", "."], "is a folder"),
    (["doctor", "IN", "--exclude", "z"], "no part is called so"),
    (["doctor"], "Missing argument"),
    (["diff", "IN"], "Missing argument"),
    (["diff", "IN", "absent.step"], "no such file"),
    (["diff", "absent.json", "IN"], "cannot be read as a plan"),
    (["diff", "IN", "list.json"], "list.json"),
    (["diff", "IN", "IN", "--json", "."], "is a folder"),
    (["manual"], "Missing argument"),
    (["manual", "absent.json", "--out", "out"], "cannot be read as a plan"),
    (["manual", "IN", "--out", "out"], "cannot be read as a plan"),
    (["manual", "list.json", "--out", "out"], "list.json"),
    (["manual", "list.json", "--out", "taken"], "is a file"),
    (["manual", "list.json", "--out", "out", "--language", "tlh"], "--language"),
    (["export"], "Missing argument"),
    (["export", "absent.json", "--bom", "b.csv"], "cannot be read as a plan"),
    (["export", "rubbish.json", "--steps", "s.csv"], "not JSON"),
    (["export", "list.json"], "--bom"),
    (["export", "list.json", "--bom", "b.docx"], "b.docx"),
    (["export", "list.json", "--mjcf", "taken"], "is a file"),
    (["serve", "--port", "99999"], "--port"),
    (["serve", "--port", "web"], "--port"),
    (["serve", "--jobs", "0"], "--jobs"),
    (["serve", "--out", "taken"], "is a file"),
    (["serve", "--host", "nowhere.invalid", "--out", "out"], "nowhere.invalid"),
    (["verify"], "Missing argument"),
    (["verify", "absent.json"], "cannot be read as a plan"),
    (["verify", "."], "cannot be read as a plan"),
    (["verify", "IN"], "cannot be read as a plan"),
    (["verify", "rubbish.json"], "not JSON"),
    (["verify", "list.json"], "list.json"),
    (["verify", "half.json"], "half.json"),
    (["infer", "IN", "--json", "i.json", "--model", "oracle"], "oracle"),
    (["infer", "IN", "--json", "."], "is a folder"),
    (["infer", "IN"], "Missing option"),
    (["evaluate", "--out", "out"], "WEIGHTS"),
    (["evaluate", "absent.npz", "--out", "out"], "no such file"),
    (["evaluate", "rubbish.json", "--out", "out"], "rubbish.json"),
    (["evaluate", "--ata", "0", "--out", "out"], "--ata"),
    (["evaluate", "zip.npz", "--out", "out"], "no weights"),
    (["evaluate", "--ata", "1", "--data", "oracle", "--out", "out"], "oracle"),
    (["evaluate", "--ata", "1", "--split", "oracle", "--out", "out"], "no split 'oracle'"),
    (["evaluate", "--ata", "1", "--device", "warp9", "--out", "out"], "warp9"),
    (["train", "past", "--device", "warp9", "--out", "out"], "warp9"),
    (["train", "past", "--data", "oracle", "--out", "out"], "oracle"),
    (["train", "past", "--from", "rubbish.json", "--out", "out"], "no weights"),
    (["train", "past", "--steps", "0", "--out", "out"], "--steps"),
    (["train", "--out", "out"], "either CONFIG or --campaign"),
    (["train", "past", "--campaign", "x", "--out", "out"], "either CONFIG or --campaign"),
    (["train", "oracle", "--out", "out"], "oracle"),
    (["train", "bad.toml", "--out", "out"], "bad.toml"),
    (["train", "config.toml", "--out", "out"], "config.toml"),
    (["train", "--campaign", "gpu", "--out", "out"], "--minutes"),
    (["train", "past", "--out", "taken"], "is a file"),
    (["dataset", "make", "oracle", "--out", "out"], "oracle"),
    (["dataset", "make", "recipe.toml", "--out", "out"], "recipe.toml"),
    (["dataset", "make", "bad.toml", "--out", "out"], "bad.toml"),
    (["dataset", "make", "tiny", "--out", "taken"], "is a file"),
    (["dataset", "make", "tiny", "--out", "out", "--limit", "0"], "--limit"),
    (["dataset", "make", "tiny", "--out", "out", "--ray", "auto", "--workers", "2"], "--ray"),
    (["dataset", "stats", "oracle"], "oracle"),
    (["dataset", "stats", "."], "."),
    (["dataset", "show", "oracle", "--out", "out"], "oracle"),
    (["dataset", "export", "oracle", "--out", "out"], "oracle"),
    (["dataset", "check", "oracle"], "oracle"),
    (["dataset", "burn"], "No such command"),
]
"""Arguments in a folder with `FILES`, a file `taken`, a folder `full/plan.html`; IN is a product of parts a and b."""


@pytest.mark.parametrize(
    ("arguments", "says"), OPTIONS, ids=lambda value: " ".join(value) if isinstance(value, list) else ""
)
def test_options_that_cannot_be_used(
    arguments: list[str], says: str, work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in FILES.items():
        (work / name).write_text(text)
    (work / "taken").write_text("mine")
    (work / "full" / "plan.html").mkdir(parents=True)
    product = folder_with("b.obj", obj_text(SHIFTED))(tmp_path)
    assert says in refused([str(product) if each == "IN" else each for each in arguments], capsys, work)
    assert (work / "taken").read_text() == "mine"


# ------------------------------------------------------------------------------------------------ broken plans


@pytest.fixture(scope="module")
def good_plan(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    place = tmp_path_factory.mktemp("good")
    product = folder_with("b.obj", obj_text(SHIFTED))(place)
    assert run(["plan", str(product), "--out", str(place / "out"), "-q"]) == 0
    return json.loads((place / "out" / "plan.json").read_text())


def without(*keys: str | int) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        del document[keys[-1]]

    return change


def with_value(value: Any, *keys: str | int) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = value

    return change


PLANS: list[tuple[Callable[[Any], None], str]] = [
    (without("format"), "format"),
    (with_value("other.plan", "format"), "format"),
    (with_value(99, "version"), "version"),
    (without("steps"), "steps"),
    (with_value("all", "steps"), "steps"),
    (with_value("maybe", "status"), "status"),
    (without("steps", 1, "path"), "path"),
    (with_value([[1, 2], [3, 4]], "steps", 1, "path", "T_world_part"), "T_world_part"),
    (with_value("nan", "steps", 1, "path", "T_world_part", 0, 0, 0), "T_world_part"),
    (with_value(float("nan"), "steps", 1, "path", "T_world_part", 0, 0, 0), "NaN"),
    (with_value({"kind": "kiss"}, "steps", 1, "contact"), "contact"),
    (without("source", "sha256"), "sha256"),
    (with_value("nowhere", "source", "path"), "nowhere"),
    (with_value("parsec", "source", "unit"), "parsec"),
    (with_value({"normal": "up"}, "table"), "table"),
    (with_value([3], "order"), "order"),
]


PLAN_READERS = (
    ["verify", "plan.json"],
    ["manual", "plan.json", "--out", "out", "--no-pdf"],
    ["export", "plan.json", "--bom", "b.csv", "--mjcf", "scene"],
    ["diff", "plan.json", "plan.json", "--json", "d.json"],
)
"""Commands that read a plan."""


WITHOUT_INPUT = {"nowhere", "parsec"}
"""Plans whose input is not there: `diff` compares what the plans say all the same."""

PAIRS = [
    pytest.param(change, says, command, id=f"{k} {says} {command[0]}")
    for k, (change, says) in enumerate(PLANS)
    for command in PLAN_READERS
    if not (command[0] == "diff" and says in WITHOUT_INPUT)
]


@pytest.mark.parametrize(("change", "says", "command"), PAIRS)
def test_plans_that_cannot_be_read(
    change: Callable[[Any], None], says: str, command: list[str], good_plan: dict[str, Any], work: Path,
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    document = json.loads(json.dumps(good_plan))
    document["source"]["path"] = str(folder_with("b.obj", obj_text(SHIFTED))(tmp_path))
    change(document)
    (work / "plan.json").write_text(json.dumps(document))
    assert says in refused(command, capsys, work)


def test_there_are_enough_cases_and_every_command_is_there() -> None:
    assert len(PRODUCTS) + len(OPTIONS) + len(PLANS) >= 80
    asked = {arguments[0] for arguments, _ in OPTIONS}
    assert asked >= set(typer.main.get_group(app).commands)
