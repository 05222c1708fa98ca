"""The three levels composed: complete plans hold, partial ones say why, the seed decides."""

import json
from pathlib import Path

import numpy as np
import pytest
from solids import assembly, box, box_with_lid, linked_rings, part, peg_in_plate, rod, sealed_box

from sashimono import tree
from sashimono.assembly import Assembly
from sashimono.contact.grasp import ContactChoice
from sashimono.errors import InputError, SashimonoError
from sashimono.geometry import se3
from sashimono.io.plan_json import plan_to_json, write_plan
from sashimono.io.resting_file import read_resting_poses
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import Answer, AssemblyPlan, RestingPoses, Table
from sashimono.verify import verify_plan


def without_timings(plan: AssemblyPlan) -> str:
    text = plan_to_json(plan)
    return text[: text.index('"timings"')]


@pytest.mark.parametrize("parts", [peg_in_plate(), peg_in_plate(1e-4), box_with_lid()], ids=["fit", "loose", "lid"])
def test_a_complete_plan_places_every_part_and_holds(parts: Assembly) -> None:
    plan = plan_assembly(parts)
    assert plan.status == "complete"
    assert sorted(plan.order) == sorted(parts.names)
    assert plan.unsolved == ()
    for k, step in enumerate(plan.steps):
        assert step.fixed == plan.order[:k]
        np.testing.assert_allclose(step.motion.T_world_part[-1], parts.part(step.part).T_world_part, atol=1e-12)
        assert step.motion.evidence["max_penetration"] <= step.motion.evidence["tolerance"]
    assert verify_plan(plan, parts).ok


def test_the_seed_decides_and_nothing_else() -> None:
    first, again = (without_timings(plan_assembly(box_with_lid(), seed=3)) for _ in range(2))
    assert first == again
    assert first != without_timings(plan_assembly(box_with_lid(), seed=4))


def test_what_cannot_come_apart_is_partial_with_a_reason() -> None:
    rings = linked_rings()
    loose = part("cube", box((0.01, 0.01, 0.01), (0.0, 0.0, 0.055)))
    plan = plan_assembly(Assembly(parts=(*rings.parts, loose)))
    assert plan.status == "partial"
    assert set(plan.order) | {entry.part for entry in plan.unsolved} == {"first", "second", "cube"}
    (entry,) = plan.unsolved
    assert entry.answer in (Answer.PROVEN_BLOCKED, Answer.UNKNOWN)
    assert entry.blocked_by
    assert entry.reason


def test_a_cage_holds_even_what_could_leave_alone() -> None:
    """A rod through a cage with closed ends is stuck, and the plan does not claim otherwise."""
    cage = box((0.05, 0.05, 0.05)) - box((0.04, 0.04, 0.04))
    plan = plan_assembly(assembly(cage=cage, rod=rod(0.005, 0.03)))
    assert plan.status == "partial"
    assert [entry.part for entry in plan.unsolved] == ["rod"]


def test_a_step_without_a_grasp_says_so() -> None:
    plan = plan_assembly(peg_in_plate(), config=PipelineConfig(contacts=False))
    assert all(step.contact is None and step.contact_reason for step in plan.steps)
    assert plan.status == "complete"


def test_an_order_whose_step_has_no_contact_is_left_for_one_that_has(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing can hold the block on its way down: it is slid in."""
    parts = assembly(plate=box((0.2, 0.2, 0.02)), block=box((0.03, 0.03, 0.03), (0.0, 0.0, 0.025)))
    choose = tree.choose_contacts

    def grudging(level, order, motions, table, **options):
        found = choose(level, order, motions, table, **options)
        comes_down = {
            name for name, motion in motions.items() if np.ptp(motion.T_world_part[-2:, 2, 3]) > 1e-9
        }  # the last leg
        return {
            name: contact._replace(contact=None, reason="held by nothing") if name in comes_down else contact
            for name, contact in found.items()
        }

    monkeypatch.setattr(tree, "choose_contacts", grudging)
    plan = plan_assembly(parts)
    assert plan.status == "complete"
    step = plan.steps[1]
    assert step.contact is not None
    assert np.ptp(step.motion.T_world_part[-2:, 2, 3]) < 1e-9
    only = plan_assembly(parts, config=PipelineConfig(contact_attempts=0)).steps[1]
    assert only.contact is None
    assert only.contact_reason == "held by nothing"


def test_no_contact_anywhere_costs_no_part(monkeypatch: pytest.MonkeyPatch) -> None:
    nothing = ContactChoice(None, "held by nothing")
    monkeypatch.setattr(tree, "choose_contacts", lambda level, order, *rest, **options: dict.fromkeys(order, nothing))
    plan = plan_assembly(peg_in_plate())
    assert plan.status == "complete"
    assert plan.unsolved == ()
    assert plan.steps[1].contact_reason == "held by nothing"


def test_an_unknown_gripper_is_refused_before_any_work() -> None:
    with pytest.raises(SashimonoError, match=r"not known\. Choose one of"):
        plan_assembly(peg_in_plate(), config=PipelineConfig(gripper="tweezers"))


def test_parts_given_in_their_own_frames_plan_alike() -> None:
    """The same product with parts modelled elsewhere and placed by poses: same order, same world motion."""
    parts = box_with_lid()
    plan = plan_assembly(parts)
    T = se3.exp(np.array([0.3, -0.2, 0.1, 0.4, 1.0, -0.7]))
    framed = Assembly(
        parts=tuple(
            type(p)(
                name=p.name,
                vertices_part=se3.apply(se3.inverse(T), p.vertices_part),
                faces=p.faces,
                T_world_part=T,
            )
            for p in parts.parts
        )
    )
    other = plan_assembly(framed)
    assert other.status == plan.status
    assert other.order == plan.order


@pytest.mark.parametrize("sunk", [0.0, 0.003])
def test_an_overlap_in_the_cad_is_no_pass_through_a_wall(sunk: float) -> None:
    """A screw modelled into solid material may come out of it, and no farther than the walls around it."""
    plan = plan_assembly(sealed_box(sunk))
    assert plan.status == "partial"
    assert [entry.part for entry in plan.unsolved] == ["screw"]


def test_an_overlap_is_part_of_the_evidence() -> None:
    """A screw 5 mm deep in a base without a hole: planned, and said to be that deep."""
    plan = plan_assembly(assembly(base=box((0.04, 0.04, 0.02)), screw=rod(0.003, 0.02, (0.0, 0.0, 0.015))))
    assert plan.status == "complete"
    evidence = plan.steps[1].motion.evidence
    assert evidence["against"] == plan.order[0]
    assert 0.002 < evidence["max_penetration"] <= evidence["tolerance"]


def test_parts_wait_where_they_are_said_to(tmp_path: Path) -> None:
    parts = box_with_lid()
    free = plan_assembly(parts)
    moved = {step.part: step.motion.T_world_part[0].copy() for step in free.steps[1:]}
    name = free.order[1]
    moved[name][:3, 3] += np.array([0.5, 0.25, 0.0])
    assert free.table is not None
    document = {
        "table": {"normal": free.table.normal.tolist(), "offset": free.table.offset},
        "parts": {name: moved[name].tolist()},
    }
    file = tmp_path / "tray.json"
    file.write_text(json.dumps(document))
    plan = plan_assembly(parts, resting=read_resting_poses(file))
    assert plan.status == "complete"
    step = next(step for step in plan.steps if step.part == name)
    np.testing.assert_allclose(step.motion.T_world_part[0], moved[name], atol=1e-12)
    # a plan is such a file too
    written = tmp_path / "plan.json"
    write_plan(free, written)
    again = plan_assembly(parts, resting=read_resting_poses(written))
    for before, after in zip(free.steps, again.steps, strict=True):
        np.testing.assert_allclose(after.motion.T_world_part[0], before.motion.T_world_part[0], atol=1e-12)


@pytest.mark.parametrize(
    ("document", "said"),
    [
        ({}, "parts is missing"),
        ({"parts": {"lid": np.eye(4).tolist()}}, "table is missing"),
        ({"table": {"normal": [0, 0, 2], "offset": 0}, "parts": {"lid": np.eye(4).tolist()}}, "no unit vector"),
        ({"table": {"normal": [0, 0, 1], "offset": 0}, "parts": {"lid": [[1, 2], [3, 4]]}}, "lid is no rigid"),
    ],
)
def test_a_broken_file_of_resting_poses_is_one_clear_line(tmp_path: Path, document: dict, said: str) -> None:
    file = tmp_path / "tray.json"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=said):
        read_resting_poses(file)


def test_a_resting_pose_of_no_part_is_refused() -> None:
    tray = RestingPoses(table=Table(normal=np.array([0.0, 0.0, 1.0]), offset=0.0), poses={"ghost": np.eye(4)})
    with pytest.raises(SashimonoError, match="ghost"):
        plan_assembly(peg_in_plate(), resting=tray)
