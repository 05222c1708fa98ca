"""Parts that are caged in one other part, and parts of several solids: found when planning failed, planned again."""

from __future__ import annotations

import json
from pathlib import Path

import manifold3d
import numpy as np
import pytest
from manifold3d import Manifold
from nested import Node, write_glb
from solids import assembly, bayonet, box, box_with_lid, keyhole, linked_rings, peg_in_plate, rod, screwed

from sashimono.assembly import Assembly
from sashimono.caged import caged_for, find_caged
from sashimono.cli import NO_PLAN, OK, run
from sashimono.io.plan_input import read_plan_input
from sashimono.io.plan_json import read_plan
from sashimono.io.read import read_assembly
from sashimono.plan import Answer, MotionClass, Unsolved


def cylinder() -> list[Node]:
    """A rod with a piston in a cylinder that is closed but for the rod's hole."""
    body = rod(0.012, 0.04) - rod(0.008, 0.03) - rod(0.00405, 0.03, (0.0, 0.0, 0.02))
    piston = rod(0.0079, 0.0298) + rod(0.004, 0.04, (0.0, 0.0, 0.02))
    return [("cyl_body", body), ("cyl_rod", piston)]


def flat_piston() -> Assembly:
    """The same with a piston thinner than the hole is wide: a ball inside it would pass."""
    body = rod(0.012, 0.04) - rod(0.008, 0.0032) - rod(0.00405, 0.03, (0.0, 0.0, 0.015))
    return assembly(body=body, rod=rod(0.0079, 0.003) + rod(0.004, 0.04, (0.0, 0.0, 0.02)))


def flange() -> Node:
    """A plate with a hole for the rod's end."""
    return ("flange", box((0.03, 0.03, 0.01), (0.0, 0.0, 0.035)) - rod(0.0042, 0.02, (0.0, 0.0, 0.035)))


def ring(radius: float, thickness: float) -> Manifold:
    """A torus about z."""
    return Manifold.revolve(manifold3d.CrossSection.circle(thickness, 24).translate((radius, 0.0)), 48)


def grooved(radius: float, depth: float, width: float) -> Manifold:
    """A rod along z with a groove around its middle."""
    return rod(radius, 0.03) - (rod(radius + 0.01, width) - rod(radius - depth, 0.03))


def clip(gap: float) -> Manifold:
    """An open ring, 1 mm thick, that goes into the groove of a rod of 10 mm."""
    return rod(0.006, 0.001) - rod(0.00455, 0.01) - box((0.01, gap, 0.01), (0.006, 0.0, 0.0))


def snap() -> Assembly:
    """A plug with a ridge, 1.6 mm high, in a groove of its socket's bore: it snaps in."""
    socket = rod(0.03, 0.02) - rod(0.01, 0.04) - rod(0.0117, 0.004)
    return assembly(socket=socket, plug=rod(0.0098, 0.03) + rod(0.0116, 0.0036))


@pytest.mark.parametrize(
    ("parts", "motions"),
    [
        (assembly(**dict(cylinder())), MotionClass.ALL),
        (assembly(cage=box((0.02,) * 3) - box((0.012,) * 3), ball=Manifold.sphere(0.005, 24)), MotionClass.ALL),
        (flat_piston(), MotionClass.TRANSLATIONS),
        (linked_rings(), None),
        (assembly(cage=box((0.02,) * 3) - box((0.012, 0.012, 0.05)), ball=Manifold.sphere(0.005, 24)), None),
        (peg_in_plate(), None),
        (screwed(0.0), None),
        (screwed(0.0002, lead=-0.01), None),
        (bayonet(), None),
        (keyhole(), None),
        (assembly(shaft=grooved(0.005, 0.0005, 0.0012), clip=clip(0.008)), None),
        (assembly(shaft=grooved(0.005, 0.0012, 0.0026), seal=ring(0.005, 0.0012)), None),
        (snap(), None),
        (assembly(shaft=rod(0.005, 0.03), hub=rod(0.02, 0.01) - rod(0.0048, 0.02)), None),
    ],
    ids=[
        "rod", "ball", "flat-piston", "links", "open", "peg", "thread", "left-hand", "bayonet", "keyhole", "circlip",
        "o-ring", "snap", "press",
    ],
)  # fmt: skip
def test_what_is_caged_in_one_part_and_what_comes_apart_otherwise(parts: Assembly, motions: MotionClass | None) -> None:
    first, second = parts.names
    assert caged_for(parts, second, first) is motions


def stuck(part: str, *others: str) -> Unsolved:
    """What a plan says of a part that provably no translation frees."""
    return Unsolved(
        part=part,
        answer=Answer.PROVEN_BLOCKED,
        proven_for=MotionClass.TRANSLATIONS,
        blocked_by=others,
        reason="",
    )


def test_parts_held_by_several_and_sets_of_all_parts_are_not_caged() -> None:
    closed = box_with_lid()
    assert find_caged(closed, [stuck("content", "shell", "lid")]) == ()
    two = assembly(**dict(cylinder()))
    assert find_caged(two, [stuck("cyl_rod", "cyl_body")]) == ()


def test_cages_share_what_is_caged_and_names_are_shared() -> None:
    """Two balls in one cage are one set; a part that is only said to be unknown is not asked about."""
    cage = box((0.04, 0.02, 0.02)) - box((0.012,) * 3, (0.008, 0.0, 0.0)) - box((0.012,) * 3, (-0.008, 0.0, 0.0))
    balls = {
        f"joint_ball_{k}": Manifold.sphere(0.005, 24).translate((x, 0.0, 0.0)) for k, x in ((1, 0.008), (2, -0.008))
    }
    parts = assembly(joint_cage=cage, **balls, foot=box((0.04, 0.04, 0.004), (0.0, 0.0, -0.012)))
    (entry,) = find_caged(parts, [stuck("joint_ball_1", "joint_cage", "foot"), stuck("joint_ball_2", "joint_cage")])
    assert (entry.product, entry.members) == ("joint", ("joint_cage", "joint_ball_1", "joint_ball_2"))
    assert entry.reason == (
        "bought: joint_ball_1 is caged in joint_cage, proven for motions of any kind; "
        "joint_ball_2 is caged in joint_cage, proven for motions of any kind"
    )
    unknown = Unsolved(part="joint_ball_1", answer=Answer.UNKNOWN, blocked_by=("joint_cage",), reason="")
    assert find_caged(parts, [unknown]) == ()


def test_a_rod_in_its_cylinder_is_planned_as_one_part(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_glb(tmp_path / "c.glb", ("all", [*cylinder(), flange()]))
    asked = ["plan", str(source), "--out", str(tmp_path / "out"), "--no-contacts"]
    assert run(asked) == OK
    said = capsys.readouterr()
    reason = "bought: cyl_rod is caged in cyl_body, proven for motions of any kind"
    assert "note: planned again with caged parts kept together: cyl\n" in said.err
    assert f"cyl: 2 parts are one part, {reason}" in said.out
    assert "2 of 2 parts placed, 1 of them several parts taken as bought (--flat: apart)" in said.out
    document = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert f"cyl: 2 parts kept together as one ({reason})" in document["notes"]
    assert document["source"]["kept"] == [{"product": "cyl", "reason": reason, "members": ["cyl_body", "cyl_rod"]}]
    plan = read_plan(tmp_path / "out" / "plan.json")
    assert read_plan_input(plan, tmp_path / "out" / "plan.json").names == tuple(plan.parts) == ("cyl", "flange")
    assert run(["verify", str(tmp_path / "out" / "plan.json")]) == OK
    assert run([*asked, "--flat"]) == NO_PLAN
    assert "kept" not in json.loads((tmp_path / "out" / "plan.json").read_text())["source"]


def two_pins_as_one_part() -> Node:
    """A block with a pin from either side, drawn as one part of two solids: as one it cannot leave."""
    pin = rod(0.003, 0.02) + rod(0.006, 0.003, (0.0, 0.0, 0.0115))
    pins = pin.translate((0.0055, 0.0, 0.0)) + pin.rotate((180.0, 0.0, 0.0)).translate((-0.0055, 0.0, 0.0))
    return ("pins", pins)


def test_solids_that_cannot_move_as_one_are_taken_apart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    holes = rod(0.00305, 0.05, (0.0055, 0.0, 0.0)) + rod(0.00305, 0.05, (-0.0055, 0.0, 0.0))
    source = write_glb(
        tmp_path / "p.glb", ("all", [("block", box((0.04, 0.02, 0.02)) - holes), two_pins_as_one_part()])
    )
    assert read_assembly(source).names == ("block", "pins")
    asked = ["plan", str(source), "--out", str(tmp_path / "out"), "--no-contacts"]
    assert run(asked) == OK
    remark = "planned again with --split all: pins is 2 separate solids"
    assert f"note: {remark}" in capsys.readouterr().err
    plan = read_plan(tmp_path / "out" / "plan.json")
    assert plan.source.split == "all"
    assert remark in plan.notes
    assert len(plan.placed) == 3
    assert np.isfinite(sum(plan.timings.values()))
    assert run(["verify", str(tmp_path / "out" / "plan.json")]) == OK
    assert run([*asked, "--split", "none"]) == NO_PLAN
    assert read_plan(tmp_path / "out" / "plan.json").source.split == "none"
