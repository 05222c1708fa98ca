"""Two revisions: what became of each part, and whether the old plan still works."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from solids import Manifold, box, rod

import sashimono
from sashimono.cli import BAD_INPUT, DIFFERS, NO_PLAN, OK, run
from sashimono.revision import Revision, compare, read_side
from sashimono.revision.carry_over import carry_over
from sashimono.verify import verify_plan


def write_folder(folder: Path, **solids: Manifold) -> Path:
    """Write solids in place as OBJ files in millimetres."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, solid in solids.items():
        mesh = solid.to_mesh64()
        lines = ["v {} {} {}".format(*(1e3 * row)) for row in np.array(mesh.vert_properties)[:, :3]]
        lines += ["f {} {} {}".format(*(row + 1)) for row in np.array(mesh.tri_verts).astype(np.int64)]
        (folder / f"{name}.obj").write_text("\n".join(lines) + "\n")
    return folder


def product() -> dict[str, Manifold]:
    """A plate with a hole, a peg in it, and a block beside it on the plate."""
    plate = box((0.06, 0.06, 0.02)) - rod(0.0051, 0.04).translate((0.015, 0.0, 0.0))
    return {
        "plate": plate,
        "peg": rod(0.005, 0.03).translate((0.015, 0.0, 0.005)),
        "block": box((0.02, 0.02, 0.02), (-0.015, 0.0, 0.02)),
    }


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plan of `product`, with its input beside it."""
    folder = tmp_path_factory.mktemp("planned")
    parts = write_folder(folder / "parts", **product())
    assert run(["plan", str(parts), "-o", str(folder / "out"), "--unit", "mm", "-q"]) == OK
    return folder / "out" / "plan.json"


def against(planned: Path, folder: Path, **solids: Manifold) -> Revision:
    old = read_side(planned)
    return compare(old, read_side(write_folder(folder, **solids), like=old))


def kinds(found: Revision) -> dict[str | None, tuple[str, ...]]:
    return {change.new or change.old: change.kinds for change in found.parts if change.kinds}


def test_the_same_product_twice(planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = (str(write_folder(tmp_path / name, **product())) for name in "ab")
    assert run(["diff", first, second]) == OK
    assert "3 parts as they were, 0 not" in capsys.readouterr().out
    assert run(["diff", str(planned), first]) == OK
    assert capsys.readouterr().out.splitlines()[-1] == "no difference, and the old plan works"
    assert run(["diff", str(planned), str(planned)]) == OK
    assert capsys.readouterr().out.splitlines()[-1] == "no difference, and the old plan works"


def test_what_became_of_each_part(tmp_path: Path) -> None:
    before = write_folder(tmp_path / "a", **product(), foot=box((0.01, 0.01, 0.01), (0.0, 0.0, -0.015)))
    parts = product()
    parts["block"] = box((0.02, 0.02, 0.024), (-0.015, 0.0, 0.022))
    parts["bolt"] = parts.pop("peg").translate((0.0, 0.001, 0.0))
    parts["lid"] = box((0.01, 0.01, 0.01), (0.0, 0.02, 0.015)) - rod(0.002, 0.1).translate((0.0, 0.02, 0.0))
    found = compare(read_side(before), read_side(write_folder(tmp_path / "b", **parts)))
    assert kinds(found) == {
        "bolt": ("renamed", "moved"), "block": ("changed",), "foot": ("removed",), "lid": ("added",)
    }  # fmt: skip
    assert next(change for change in found.parts if change.new == "bolt").shift == pytest.approx(0.001)
    assert found.holds is None
    assert not found.same


def test_a_product_that_was_moved_and_a_part_renamed(planned: Path, tmp_path: Path) -> None:
    moved = {name: solid.rotate((0.0, 0.0, 30.0)).translate((0.1, 0.2, 0.3)) for name, solid in product().items()}
    moved["brick"] = moved.pop("block")
    found = against(planned, tmp_path / "new", **moved)
    assert kinds(found) == {"plate": ("moved",), "peg": ("moved",), "brick": ("renamed", "moved")}
    assert found.holds is True
    assert found.reasons == ()


@pytest.mark.parametrize("height", [0.016, 0.024])
def test_a_part_of_another_height_still_goes_in(height: float, planned: Path, tmp_path: Path) -> None:
    parts = product() | {"block": box((0.02, 0.02, height), (-0.015, 0.0, 0.01 + height / 2))}
    found = against(planned, tmp_path / "new", **parts)
    assert kinds(found) == {"block": ("changed",)}
    assert found.holds is True, found.reasons


def test_a_part_that_moved_on_the_plate_still_goes_in(planned: Path, tmp_path: Path) -> None:
    parts = product() | {"block": box((0.02, 0.02, 0.02), (-0.015, 0.003, 0.02))}
    found = against(planned, tmp_path / "new", **parts)
    assert kinds(found) == {"block": ("moved",)}
    assert found.holds is True, found.reasons


def test_a_lip_over_the_peg_ends_the_plan(planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = product()
    # a bridge over the peg, and the hole closed below: neither order nor motion is left
    post, bridge = box((0.014, 0.01, 0.0125), (0.015, 0.025, 0.016)), box((0.014, 0.06, 0.004), (0.015, 0.0, 0.0225))
    parts["plate"] += post + bridge + box((0.06, 0.06, 0.002), (0.0, 0.0, -0.011))
    found = against(planned, tmp_path / "new", **parts)
    assert found.holds is False
    assert found.order_works is False
    assert any(reason.startswith("step 3, peg: goes") for reason in found.reasons)
    target = tmp_path / "diff.json"
    assert run(["diff", str(planned), str(tmp_path / "new"), "--json", str(target)]) == NO_PLAN
    assert "the old plan does not work any more, nor does its order: plan again" in capsys.readouterr().out
    written = json.loads(target.read_text())
    assert (written["same"], written["holds"], written["order_works"]) == (False, False, False)
    assert [each["kinds"] for each in written["parts"]] == [[], [], ["changed"]]


def test_a_wall_in_the_way_leaves_the_order(planned: Path, tmp_path: Path) -> None:
    # a roof over the block, open to the side: it goes in from there now
    parts = product()
    parts["plate"] += box((0.004, 0.024, 0.03), (-0.028, 0.0, 0.02)) + box((0.03, 0.024, 0.003), (-0.015, 0.0, 0.0325))
    found = against(planned, tmp_path / "new", **parts)
    assert found.holds is False
    assert found.order_works is True


def test_parts_added_and_removed(planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    parts = product()
    found = against(planned, tmp_path / "more", **parts, cap=box((0.02, 0.02, 0.01), (-0.015, 0.0, 0.035)))
    assert (found.holds, found.reasons) == (False, ("cap is new: the old plan has no step for it",))
    without = {name: solid for name, solid in parts.items() if name != "block"}
    assert run(["diff", str(planned), str(write_folder(tmp_path / "less", **without))]) == DIFFERS
    assert "removed: block" in capsys.readouterr().out
    del parts["plate"]
    found = against(planned, tmp_path / "bare", **parts)
    assert found.holds is False
    assert "its base plate is gone" in found.reasons[0]


def test_two_plans(planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = planned.parent.parent / "parts"
    out = tmp_path / "out"
    options = ["--unit", "mm", "--before", "block:peg", "--gripper", "franka-hand"]
    assert run(["plan", str(source), "-o", str(out), *options, "-q"]) == OK
    old, new = read_side(planned), read_side(out / "plan.json")
    assert old.plan is not None
    assert new.plan is not None
    found = compare(old, new)
    assert found.holds is True
    if old.plan.order != new.plan.order:
        assert found.earlier
    assert any("franka-hand" in word for step in found.steps for word in step.words)
    assert run(["diff", str(planned), str(out / "plan.json")]) == DIFFERS
    assert "different, but the old plan still works" in capsys.readouterr().out


def test_a_plan_whose_input_is_gone(planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    alone = tmp_path / "plan.json"
    shutil.copy(planned, alone)
    folder = write_folder(tmp_path / "parts", **product())
    assert run(["diff", str(alone), str(folder)]) == OK
    assert "is not there; names and poses alone are compared" in capsys.readouterr().out
    assert run(["diff", str(folder), str(alone)]) == OK
    capsys.readouterr()
    assert run(["diff", str(folder), str(tmp_path / "none.json")]) == BAD_INPUT


def test_carried_over_onto_itself_a_plan_is_the_same(planned: Path) -> None:
    side = read_side(planned)
    assert side.plan is not None
    assert side.assembly is not None
    found = compare(side, side)
    carried = carry_over(side.plan, side.assembly, found.parts)
    assert carried.order == side.plan.order
    for step, same in zip(side.plan.steps, carried.steps, strict=True):
        assert np.allclose(step.motion.T_world_part, same.motion.T_world_part, atol=1e-12)
    assert verify_plan(carried, side.assembly).ok


def test_the_public_function_says_the_same_and_shows_itself_shortly(planned: Path, tmp_path: Path) -> None:
    found = sashimono.diff(planned, planned)
    assert found.same
    assert repr(found) == "Revision(0 of 3 parts changed, the old plan works)"
    less = {name: solid for name, solid in product().items() if name != "peg"}
    changed = sashimono.diff(planned, write_folder(tmp_path / "less", **less))
    assert repr(changed).startswith("Revision(1 of 3 parts changed, ")
    assert "removed" in changed._repr_html_()
