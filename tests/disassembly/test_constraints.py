"""What the user decides: base, precedences, table, parts left out; contradictions named; the file read back."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import trimesh
from solids import assembly, box, rod

from sashimono.assembly import Assembly
from sashimono.cli import run
from sashimono.disassembly.sequence.constraints import OrderConstraints, resolve
from sashimono.disassembly.sequence.greedy import SequenceConfig
from sashimono.errors import InputError, SashimonoError
from sashimono.io.constraints_file import Wishes, read_wishes, wishes_to_toml
from sashimono.motion import MotionConfig, TableConfig
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan

NAMES = ("plate", "bolt_1", "bolt_2", "lid")


def blocks() -> Assembly:
    """A plate with four blocks on it: any order, any base."""
    places = {"a": (-0.05, -0.05), "b": (-0.05, 0.05), "c": (0.05, -0.05), "d": (0.05, 0.05)}
    cubes = {name: box((0.03, 0.03, 0.03), (x, y, 0.025)) for name, (x, y) in places.items()}
    return assembly(plate=box((0.2, 0.2, 0.02)), **cubes)


def planned(constraints: OrderConstraints) -> AssemblyPlan:
    sequence = SequenceConfig(constraints=constraints)
    return plan_assembly(blocks(), config=PipelineConfig(contacts=False, sequence=sequence))


@pytest.mark.parametrize("before", [(("d", "a"), ("a", "c")), (("c", "a"), ("b", "d")), (("b", "?"),)])
def test_precedences_hold_whatever_they_ask(before: tuple[tuple[str, str], ...]) -> None:
    found = planned(OrderConstraints(base="plate", before=before))
    assert found.status == "complete"
    order = list(found.order)
    for first, later in before:
        for name in "abcd" if later == "?" else later:
            if name != first:
                assert order.index(first) < order.index(name), order


def test_the_base_is_the_one_that_was_named() -> None:
    assert planned(OrderConstraints(base="c")).order[0] == "c"
    assert planned(OrderConstraints()).order[0] == "plate"


def test_what_waits_for_a_part_that_cannot_leave_says_so() -> None:
    cage = box((0.05, 0.05, 0.05)) - box((0.04, 0.04, 0.04))
    parts = assembly(cage=cage, ball=box((0.01, 0.01, 0.01)), cap=box((0.05, 0.05, 0.01), (0.0, 0.0, 0.03)))
    sequence = SequenceConfig(constraints=OrderConstraints(base="cage", before=(("cap", "ball"),)))
    plan = plan_assembly(parts, config=PipelineConfig(contacts=False, sequence=sequence))
    assert plan.status == "partial"
    said = {entry.part: entry.reason for entry in plan.unsolved}
    assert "--before has it placed earlier than ball" in said["cap"]


def test_the_table_is_where_the_user_has_it() -> None:
    motion = MotionConfig(table=TableConfig(up=(0.0, 2.0, 0.0)))
    plan = plan_assembly(blocks(), config=PipelineConfig(contacts=False, motion=motion))
    assert plan.table is not None
    np.testing.assert_allclose(plan.table.normal, [0.0, 1.0, 0.0])


@pytest.mark.parametrize(
    ("constraints", "said"),
    [
        (OrderConstraints(base="frame"), "--base frame: no part is called so"),
        (OrderConstraints(base="bolt*"), r"names 2 parts \(bolt_1, bolt_2\)"),
        (OrderConstraints(before=(("lid", "bolts"),)), "near are bolt_"),
        (OrderConstraints(base="plate", before=(("lid", "plate"),)), "plate is the base"),
        (OrderConstraints(before=(("lid", "plate"), ("plate", "lid"))), "no order does it all"),
        (OrderConstraints(together=(("bolt_1",),)), "names 1 part: name two or more"),
        (OrderConstraints(together=(("bolt_1", "screw"),)), "--together bolt_1,screw: screw: no part is called so"),
        (
            OrderConstraints(together=(("bolt_1", "plate"),), before=(("plate", "lid"), ("lid", "bolt_1"))),
            "--together bolt_1,plate: lid comes after plate and before bolt_1, as --before has it",
        ),
        (
            OrderConstraints(together=(("bolt_*", "plate"),), base="plate", before=(("lid", "bolt_2"),)),
            "lid comes after plate and before bolt_2",
        ),
    ],
)
def test_contradictions_and_unknown_names_are_one_line(constraints: OrderConstraints, said: str) -> None:
    with pytest.raises(SashimonoError, match=said) as caught:
        resolve(constraints, NAMES)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("group", [("a", "c"), ("b", "d"), ("plate", "d"), ("a", "b", "d")])
def test_parts_that_are_wanted_together_follow_one_another(group: tuple[str, ...]) -> None:
    plan = planned(OrderConstraints(together=(group,)))
    places = sorted(plan.order.index(name) for name in group)
    assert places == [*range(places[0], places[0] + len(group))]
    assert plan.cost is not None
    assert plan.cost.terms["parted"] == 0.0
    assert not [note for note in plan.notes if "--together" in note]


def test_what_cannot_be_together_is_said_in_one_line() -> None:
    """Three discs in a tube that is closed below: the middle one always comes between the others."""
    tube = rod(0.02, 0.06) - rod(0.0151, 0.06, (0.0, 0.0, 0.005))
    discs = {name: rod(0.015, 0.01, (0.0, 0.0, z)) for name, z in (("low", -0.02), ("mid", -0.01), ("top", 0.0))}
    wishes = OrderConstraints(base="tube", together=(("low", "top"),))
    config = PipelineConfig(contacts=False, sequence=SequenceConfig(constraints=wishes))
    plan = plan_assembly(assembly(tube=tube, **discs), config=config)
    assert plan.order == ("tube", "low", "mid", "top")
    (note,) = [note for note in plan.notes if "--together" in note]
    assert note == "--together low,top: mid between them; no order was found without"
    assert plan.cost is not None
    assert plan.cost.terms["parted"] == 1.0


def test_a_circle_is_told_in_its_own_sense() -> None:
    wishes = OrderConstraints(before=(("lid", "plate"), ("plate", "bolt_1"), ("bolt_1", "lid")))
    with pytest.raises(SashimonoError) as caught:
        resolve(wishes, NAMES)
    told = str(caught.value).split(": ", 2)[2].split(".")[0].split(" before ")
    assert set(pairwise(told)) == set(wishes.before)


@pytest.mark.parametrize(
    "wishes",
    [
        Wishes(base='a "b"', up=(0.0, -1.0, 0.5), before=(("x", "y*"), ("é", "z")), exclude=("cable*",)),
        Wishes(),
        Wishes(together=(("a", "b*"), ("ö", "d", "e"))),
    ],
)
def test_the_file_is_read_back_as_it_was_written(tmp_path: Path, wishes: Wishes) -> None:
    file = tmp_path / "constraints.toml"
    file.write_text(wishes_to_toml(wishes), encoding="utf-8")
    assert read_wishes(file) == wishes


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("base = 3", "base is no name"),
        ("bse = 'a'", "bse is not known"),
        ("up = [1, 2]", "three numbers"),
        ("up = [0, 0, 0]", "not a direction"),
        ("before = ['a', 'b']", "list of pairs"),
        ("exclude = 'a'", "list of names"),
        ("together = ['a', 'b']", "list of lists of names"),
        ("base = ", "cannot be read as TOML"),
    ],
)
def test_a_broken_file_is_one_line(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "constraints.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_wishes(file)


def test_by_command_a_part_is_left_out_and_the_plan_verifies(tmp_path: Path) -> None:
    folder, out, again = tmp_path / "in", tmp_path / "out", tmp_path / "again"
    folder.mkdir()
    for part in blocks().parts:
        trimesh.Trimesh(part.vertices_part, part.faces).export(folder / f"{part.name}.obj")
    command = ["plan", str(folder), "--unit", "m", "--no-contacts", "--out"]
    assert run([*command, str(out), "--exclude", "b", "--before", "d:a"]) == 0
    document = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    assert document["source"]["excluded"] == ["b"]
    assert sorted(document["order"]) == ["a", "c", "d", "plate"]
    assert document["order"].index("d") < document["order"].index("a")
    assert run(["verify", str(out / "plan.json")]) == 0
    assert run([*command, str(again), "--constraints", str(out / "constraints.toml")]) == 0
    assert json.loads((again / "plan.json").read_text(encoding="utf-8"))["order"] == document["order"]


@pytest.mark.parametrize(
    "options",
    [
        ["--before", "a"],
        ["--together", "a"],
        ["--together", "a,,b"],
        ["--up", "1,2"],
        ["--exclude", "z*"],
        ["--base", "z"],
        ["--constraints", "none.toml"],
    ],
)
def test_bad_options_are_refused(tmp_path: Path, options: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for part in blocks().parts:
        trimesh.Trimesh(part.vertices_part, part.faces).export(folder / f"{part.name}.obj")
    assert run(["plan", str(folder), "--unit", "m", "--out", str(tmp_path / "out"), *options]) == 2
    (line,) = [row for row in capsys.readouterr().err.splitlines() if row.startswith("sashimono:")]
    assert options[1].split(",")[0] in line
    assert not (tmp_path / "out").exists()
