"""The command line's contract: exit status, one clear line, all files or none."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from sashimono import __version__
from sashimono.cli import BAD_INPUT, INTERRUPTED, NO_PLAN, OK, run
from sashimono.cli_common import GRIPPERS, UNITS

COMMANDS = ("demo", "plan", "verify", "conditions", "fasteners", "explain", "train", "evaluate", "infer")

CUBE = """
v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1
f 1 3 2\nf 1 4 3\nf 5 6 7\nf 5 7 8\nf 1 2 6\nf 1 6 5\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8
"""


def write_box(path: Path, low: tuple[float, float, float], high: tuple[float, float, float]) -> None:
    lines = []
    for line in CUBE.split("\n"):
        kind, *rest = line.split() or [""]
        if kind == "v":
            rest = [str(lo + float(u) * (hi - lo)) for u, lo, hi in zip(rest, low, high, strict=True)]
        lines.append(" ".join([kind, *rest]))
    path.write_text("\n".join(lines))


@pytest.fixture
def two_boxes(tmp_path: Path) -> Path:
    """A plate of 40 mm with a block of 20 mm on it."""
    folder = tmp_path / "boxes"
    folder.mkdir()
    write_box(folder / "plate.obj", (0, 0, 0), (40, 40, 10))
    write_box(folder / "block.obj", (10, 10, 10), (30, 30, 30))
    return folder


def one_line(text: str) -> str:
    """Return standard error's only line."""
    lines = text.splitlines()
    assert len(lines) == 1, text
    return lines[0]


def plan_with_status(status: str, calls: dict[str, Any]) -> Any:
    """Return a stand-in for `plan_assembly` whose plan is the real one with another status."""
    from sashimono import pipeline

    real = pipeline.plan_assembly

    def plan_assembly(assembly: Any, **options: Any) -> Any:
        from dataclasses import replace

        calls.update(options)
        return replace(real(assembly, **options), status=status)

    return plan_assembly


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["assemble"], "No such command 'assemble'. Try 'sashimono --help'"),
        (["plan"], "Missing argument 'INPUT'. Try 'sashimono plan --help'"),
        (["dataset", "mke"], "Did you mean 'make'? Try 'sashimono dataset --help'"),
        (["plan", "in.step"], "Missing option '-o' / '--out'"),
        (["plan", "in.step", "--out", "o", "--seed", "one"], "--seed"),
        (["plan", "in.step", "--out", "o", "--seed", "-1"], "--seed"),
        (["plan", "in.step", "--out", "o", "--wrong"], "No such option"),
        (["plan", "in.step", "--out", "o", "--method", "magic"], "--method magic is not in this version"),
        (["plan", "in.step", "--out", "o", "--gripper", "claw"], "gripper 'claw' is not known"),
        (["plan", "in.step", "--out", "o", "--method", "past", "--explain-order"], "--explain-order is for --method"),
        (["plan", "in.step", "--out", "o"], "in.step"),
        (["verify", "plan.json"], "plan.json"),
        (["conditions", "in.step", "--json", "c.json"], "in.step"),
    ],
)
def test_bad_usage_and_bad_input_say_one_line(
    arguments: list[str], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(arguments) == BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == ""
    line = one_line(captured.err)
    assert line.startswith("sashimono: ")
    assert says in line
    assert list(tmp_path.iterdir()) == []


def test_out_that_is_a_file_is_refused_before_any_work(
    two_boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taken = tmp_path / "taken"
    taken.write_text("mine")
    for out in (taken, taken / "below"):
        assert run(["plan", str(two_boxes), "--out", str(out)]) == BAD_INPUT
        assert "--out" in one_line(capsys.readouterr().err)
    assert taken.read_text() == "mine"


def test_help_and_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["--version"]) == OK
    assert capsys.readouterr().out == f"sashimono {__version__}\n"
    for arguments in (
        [],
        ["--help"],
        ["-h"],
        ["dataset"],
        ["dataset", "make", "-h"],
        *([name, "-h"] for name in COMMANDS),
    ):
        assert run(arguments) == OK
        captured = capsys.readouterr()
        assert "Usage: sashimono" in captured.out
        assert captured.err == ""


def test_help_names_the_grippers(capsys: pytest.CaptureFixture[str]) -> None:
    from sashimono.contact import REAL_TOOLS

    assert (*GRIPPERS, "vacuum-cup") == REAL_TOOLS
    assert run(["plan", "--help"]) == OK
    words = capsys.readouterr().out.split()
    assert {f"{name}," for name in GRIPPERS[1:]} <= set(words)


def test_units_are_those_of_the_reader() -> None:
    from sashimono.io.raw import METRES

    assert tuple(METRES) == UNITS


def test_quiet_says_nothing(two_boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in (
        ["plan", str(two_boxes), "-o", str(tmp_path / "out"), "-q"],
        ["-q", "conditions", str(two_boxes)],
    ):
        assert run(arguments) == OK
        assert capsys.readouterr() == ("", "")
    assert run(["-q", "verify", str(tmp_path / "none.json")]) == BAD_INPUT
    assert "none.json" in one_line(capsys.readouterr().err)


def test_json_lines(two_boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert run(["plan", str(two_boxes), "-o", str(out), "--json-lines"]) == OK
    captured = capsys.readouterr()
    assert captured.err == ""
    events = [json.loads(line) for line in captured.out.splitlines()]
    assert {"event": "progress", "stage": "contact", "done": 2, "total": 2} in events
    assert events[-2] == {
        "event": "plan",
        "status": "complete",
        "executable": True,
        "files": [str(out / f"plan.{kind}") for kind in ("json", "html", "glb")],
    }
    assert events[-1] == {"event": "exit", "status": OK}
    assert run(["--json-lines", "verify", "absent.json"]) == BAD_INPUT
    captured = capsys.readouterr()
    assert [json.loads(line)["event"] for line in captured.out.splitlines()] == ["error", "exit"]
    assert "absent.json" in one_line(captured.err)


def test_verbose_stands_on_either_side(capsys: pytest.CaptureFixture[str]) -> None:
    import logging

    for arguments, level in (
        (["verify", "absent.json", "-v"], logging.INFO),
        (["-v", "verify", "absent.json", "-v"], logging.DEBUG),
        (["verify", "absent.json"], logging.WARNING),
        (["verify", "absent.json", "-q"], logging.ERROR),
    ):
        assert run(arguments) == BAD_INPUT
        assert logging.getLogger("sashimono").level == level
    capsys.readouterr()


def test_the_shell_completes_values() -> None:
    completed = subprocess.run(
        [sys.executable, "-m", "sashimono"],
        env=os.environ
        | {
            "_SASHIMONO_COMPLETE": "complete_bash",
            "COMP_WORDS": "sashimono plan in.step --gripper robotiq",
            "COMP_CWORD": "4",
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert completed.stdout.split() == ["robotiq-hand-e", "robotiq-2f85"]


def test_a_wrong_unit_is_warned_about(two_boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plan", str(two_boxes), "-o", str(tmp_path / "out")]) == OK
    captured = capsys.readouterr()
    assert captured.out.splitlines()[0] == "2 parts, 40 × 40 × 30 mm, from coordinates in mm"
    assert "check the unit" not in captured.err
    assert run(["conditions", str(two_boxes), "--unit", "m"]) == OK
    assert run(["plan", str(two_boxes), "-o", str(tmp_path / "out"), "--unit", "m"]) == OK
    assert "check the unit, 'm' was used (it would be 40 × 40 × 30 mm in mm or" in capsys.readouterr().err


def test_plan_then_verify(two_boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "made" / "here"
    assert run(["plan", str(two_boxes), "--out", str(out), "--unit", "mm"]) == OK
    assert sorted(path.name for path in out.iterdir()) == ["plan.glb", "plan.html", "plan.json"]
    written = json.loads((out / "plan.json").read_text())
    assert written["status"] == "complete"
    assert written["order"] == ["plate", "block"]
    captured = capsys.readouterr().out
    assert "complete and verified: 2 of 2 parts placed" in captured
    assert "base, starts in place" in captured
    assert "along -z" in captured
    assert str(out / "plan.html") in captured

    assert run(["verify", str(out / "plan.json")]) == OK
    assert "block" in capsys.readouterr().out

    (two_boxes / "plate.obj").write_text((two_boxes / "plate.obj").read_text().replace("40.0", "41.0"))
    assert run(["verify", str(out / "plan.json")]) == NO_PLAN
    capsys.readouterr()
    (two_boxes / "plate.obj").unlink()
    assert run(["verify", str(out / "plan.json")]) == BAD_INPUT
    assert "boxes" in one_line(capsys.readouterr().err)


def test_plan_says_what_its_order_costs_and_what_else_could_have_come(
    two_boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "made"
    assert run(["plan", str(two_boxes), "--out", str(out), "--unit", "mm", "--explain-order"]) == OK
    assert "\ncost of the order " in capsys.readouterr().out
    written = json.loads((out / "plan.json").read_text())
    assert written["cost"]["total"] >= 0.0
    assert [step["alternatives"] for step in written["steps"]] == [[], []]


def test_same_seed_same_plan(two_boxes: Path, tmp_path: Path) -> None:
    plans = []
    for name in ("first", "second"):
        assert run(["plan", str(two_boxes), "--out", str(tmp_path / name), "--seed", "3"]) == OK
        written = json.loads((tmp_path / name / "plan.json").read_text())
        assert written.pop("timings")
        plans.append(written)
    assert plans[0] == plans[1]


def test_partial_plan_is_written_and_exits_3(
    two_boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    calls: dict[str, Any] = {}
    monkeypatch.setattr("sashimono.pipeline.plan_assembly", plan_with_status("partial", calls))
    out = tmp_path / "out"
    assert (
        run(["plan", str(two_boxes), "--out", str(out), "--seed", "5", "--gripper", "franka-hand", "--no-contacts"])
        == NO_PLAN
    )
    assert calls["seed"] == 5
    assert calls["config"].gripper == "franka-hand"
    assert calls["config"].contacts is False
    assert json.loads((out / "plan.json").read_text())["status"] == "partial"
    assert "partial" in capsys.readouterr().out
    assert run(["verify", str(out / "plan.json")]) == NO_PLAN


@pytest.mark.parametrize("where", ["sashimono.pipeline.plan_assembly", "sashimono.view.write_glb"])
def test_interruption_leaves_nothing(
    where: str, two_boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*args: Any, **options: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(where, interrupt)
    assert run(["plan", str(two_boxes), "--out", str(tmp_path / "out"), "--unit", "mm"]) == INTERRUPTED
    assert capsys.readouterr().err.splitlines()[-1] == "interrupted, nothing written"
    assert not (tmp_path / "out").exists()


def test_failed_rewrite_keeps_the_earlier_plan(
    two_boxes: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "plan.json").write_text("earlier")

    def disk_full(*args: Any, **options: Any) -> None:
        raise OSError(28, "No space left on device", "plan.glb")

    monkeypatch.setattr("sashimono.view.write_glb", disk_full)
    assert run(["plan", str(two_boxes), "--out", str(out)]) == BAD_INPUT
    assert "No space left on device" in capsys.readouterr().err.splitlines()[-1]
    assert [path.name for path in out.iterdir()] == ["plan.json"]
    assert (out / "plan.json").read_text() == "earlier"


def test_conditions(two_boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "conditions.json"
    graph = tmp_path / "graph.json"
    assert run(["conditions", str(two_boxes), "--json", str(target), "--graph", str(graph)]) == OK
    assert json.loads(target.read_text()) == {
        "parts": ["block", "plate"],
        "clauses": {"block": [[]], "plate": [[]]},
        "orders": 2,
        "orders_reason": "",
        "precedence": [],
        "stuck": [],
        "cut_short": [],
    }
    assert json.loads(graph.read_text())["nodes"] == [["block", "plate"], ["block"], ["plate"]]
    assert "orders: 2" in capsys.readouterr().out
    assert run(["conditions", str(two_boxes), "--json", str(tmp_path)]) == BAD_INPUT
    assert "is a folder" in one_line(capsys.readouterr().err.splitlines()[-1])


def test_progress_is_lines_where_there_is_no_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    from sashimono.console import progress_display

    with progress_display() as progress:
        for done in range(1, 4):
            progress("motion", done, 3)
    assert capsys.readouterr().err == "motion: 3 of 3\n"


def test_directions_in_words() -> None:
    import numpy as np

    from sashimono.console import _direction_words
    from sashimono.geometry import se3

    def path(*offsets: tuple[float, float, float]) -> np.ndarray:
        return np.array([se3.make(translation=np.array(offset, dtype=float)) for offset in offsets])

    assert _direction_words(path((0, 0, 0))) == "base, starts in place"
    assert _direction_words(path((0, 0, 1.0), (0, 0, 0))) == "along -z"
    assert _direction_words(path((0, 9.0, 1.0), (-1.0, 0, 0), (0, 0, 0))) == "along +x"
    assert _direction_words(path((0, 1.0, 1.0), (0, 0, 0))) == "along (0.00, -0.71, -0.71)"
    turned = np.array([se3.make(rotation=se3.exp_so3(np.array([0, 0, 0.5]))), np.eye(4)])
    assert _direction_words(turned) == "turning"


def _without_numbers(text: str) -> str:
    """The words of an answer: the last digits differ from machine to machine."""
    return " ".join(re.sub(r"\d+(\.\d+)?", "#", text).split())


@pytest.mark.slow
def test_demo_as_a_user_runs_it(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", "from sashimono.cli import main; main()", "demo"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == OK, done.stderr
    out = tmp_path / "sashimono_demo"
    assert sorted(path.name for path in out.iterdir()) == ["gearbox.step", "plan.glb", "plan.html", "plan.json"]
    assert str(out / "plan.html") in done.stdout
    readme = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")
    sample = readme.split("here of the gearbox, in part):")[1].split("```")[1].strip().splitlines()
    assert len(sample) >= 6
    for line in sample:
        assert _without_numbers(line.removesuffix("...")) in _without_numbers(done.stdout), line
    check = subprocess.run(
        [sys.executable, "-c", "from sashimono.cli import main; main()", "verify", str(out / "plan.json")],
        cwd=tmp_path.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert check.returncode == OK, check.stdout + check.stderr
