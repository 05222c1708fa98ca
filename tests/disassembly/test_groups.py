"""Subassemblies end to end: planned as a tree, written and read, checked member by member, shown."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from solids import assembly, box, pair_in_pair, pairs_in_pairs, part, sliding_halves

from sashimono.assembly import Assembly
from sashimono.bodies import make_body, merge_parts
from sashimono.console import summary_lines
from sashimono.contact import ContactConfig
from sashimono.geometry import se3
from sashimono.geometry.mesh.solid import unite
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import Answer, AssemblyPlan, Contact, Step, Subassembly
from sashimono.verify import VerifyReport, verify_plan
from sashimono.view import write_glb, write_html
from sashimono.view.config import ViewConfig
from sashimono.view.explode import explode, explosion_offsets
from sashimono.view.scene import make_scene

PARTS = pair_in_pair()
NO_CONTACTS = PipelineConfig(contacts=False)


@pytest.fixture(scope="module")
def plan() -> AssemblyPlan:
    return plan_assembly(PARTS, config=PipelineConfig(contact=ContactConfig(max_candidates=20)))


def group_of(plan: AssemblyPlan) -> tuple[Step, Subassembly]:
    """The plan's last step, which moves the bar."""
    step = plan.steps[-1]
    assert step.subassembly is not None
    return step, step.subassembly


def changed(plan: AssemblyPlan, **fields: object) -> AssemblyPlan:
    """The plan with its last step changed."""
    return replace(plan, steps=(*plan.steps[:-1], replace(plan.steps[-1], **fields)))


def refuted(report: VerifyReport, *words: str) -> None:
    text = "\n".join(report.lines())
    assert not report.ok, text
    assert all(word in text for word in words), text


def test_a_plan_with_a_subassembly_is_complete(plan: AssemblyPlan) -> None:
    step, inside = group_of(plan)
    assert plan.status == "complete"
    assert set(plan.order[:2]) == {"low", "high"}
    assert step.moving == ("front", "back")
    assert inside.order[0] == step.part
    assert set(inside.order) == set(step.moving)
    assert sorted(plan.placed) == sorted(PARTS.names)
    assert inside.steps[1].fixed == inside.order[:1]
    assert step.fixed == plan.order[:2]
    for inner in inside.steps:
        np.testing.assert_allclose(inner.motion.T_world_part[-1], PARTS.part(inner.part).T_world_part, atol=1e-12)
    report = verify_plan(plan, PARTS)
    assert report.ok
    assert [len(entry.inside) for entry in report.steps] == [0, 0, 2]


def test_it_is_written_and_read_without_loss(plan: AssemblyPlan) -> None:
    text = plan_to_json(plan)
    again = plan_from_json(text)
    assert plan_to_json(again) == text
    assert verify_plan(again, PARTS).ok


def test_the_seed_decides_insides_too() -> None:
    first, again = (replace(plan_assembly(PARTS, config=NO_CONTACTS, seed=5), timings={}) for _ in range(2))
    assert plan_to_json(first) == plan_to_json(again)


def test_subassemblies_within_subassemblies() -> None:
    parts = pairs_in_pairs()
    plan = plan_assembly(parts, config=NO_CONTACTS)
    step, inside = group_of(plan)
    assert plan.status == "complete"
    assert set(step.moving) == {"low", "high", "front", "back"}
    assert set(inside.steps[-1].moving) == {"front", "back"}
    assert sorted(plan.placed) == sorted(parts.names)
    report = verify_plan(plan, parts)
    assert report.ok
    lines = report.lines()
    assert lines[-1] == "verified: 8 steps hold; not executable"  # without contacts
    assert sum(line.startswith("        ok") for line in lines) == 2


def test_parts_in_their_own_frames_move_alike() -> None:
    T = se3.exp(np.array([0.3, -0.2, 0.1, 0.4, 1.0, -0.7]))
    framed = Assembly(
        parts=tuple(
            replace(p, vertices_part=se3.apply(se3.inverse(T), p.vertices_part), T_world_part=T) for p in PARTS.parts
        )
    )
    plan = plan_assembly(framed, config=NO_CONTACTS)
    assert plan.status == "complete"
    step, _ = group_of(plan)
    front, back = (step.member_poses(name, plan.parts) for name in step.moving)
    np.testing.assert_allclose(front, back, atol=1e-12)


def test_what_cannot_come_apart_inside_still_moves_and_is_named() -> None:
    """A shell around a cube, in a case of two halves that it holds together: the cube is unsolved, the shell is not."""
    turned = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    well = box((0.08, 0.06, 0.1))
    bottom, top = (half.transform(turned) - well for half in sliding_halves((0.14, 0.16, 0.06)))
    void = box((0.02, 0.02, 0.02))
    parts = assembly(bottom=bottom, top=top, shell=box((0.08, 0.06, 0.06)) - void, cube=void)
    plan = plan_assembly(parts, config=NO_CONTACTS)
    assert plan.status == "partial"
    step, inside = group_of(plan)
    assert set(step.moving) == {"shell", "cube"}
    assert inside.order == ("shell",)
    assert set(plan.placed) == {"bottom", "top", "shell"}
    (entry,) = plan.unsolved
    assert (entry.part, entry.answer, entry.blocked_by) == ("cube", Answer.PROVEN_BLOCKED, ("shell",))
    assert verify_plan(plan, parts).ok
    refuted(verify_plan(replace(plan, status="complete", unsolved=()), parts), "'cube'", "has no step")
    silent = replace(plan, unsolved=())
    refuted(verify_plan(silent, parts), "neither a step nor a reason", "is not put into it")


def test_a_member_that_is_not_listed_is_missed(plan: AssemblyPlan) -> None:
    step, inside = group_of(plan)
    alone = changed(plan, moving=(step.part,))
    refuted(verify_plan(alone, PARTS), "is put into the subassembly, but does not move with it")
    fewer = replace(inside, order=inside.order[:1], steps=inside.steps[:1])
    refuted(verify_plan(changed(plan, subassembly=fewer), PARTS), "called complete", "is not put into it")
    refuted(verify_plan(changed(plan, subassembly=None), PARTS), "does not say how they were put together")
    refuted(verify_plan(changed(plan, moving=(), subassembly=None), PARTS), "called complete", "has no step")
    refuted(verify_plan(changed(plan, moving=("front", "back", "low")), PARTS), "'low' is in place already")
    refuted(verify_plan(changed(plan, moving=("front", "back", "nobody")), PARTS), "'nobody' is not in the assembly")
    refuted(verify_plan(changed(plan, moving=("front", "back", "back")), PARTS), "'back' moves twice")


def test_a_part_is_not_placed_twice(plan: AssemblyPlan) -> None:
    _, inside = group_of(plan)
    twice = replace(inside, order=(*inside.order, inside.order[1]), steps=(*inside.steps, inside.steps[1]))
    refuted(verify_plan(changed(plan, subassembly=twice), PARTS), "is placed more than once")


def test_the_inside_is_checked_like_a_plan(plan: AssemblyPlan) -> None:
    _, inside = group_of(plan)
    base, second = inside.steps
    backwards = replace(inside, order=inside.order[::-1], steps=(second, base))
    refuted(
        verify_plan(changed(plan, subassembly=backwards), PARTS),
        "the base part must have one pose",
        "placed before are",
    )
    renamed = replace(inside, order=inside.order[::-1])
    refuted(verify_plan(changed(plan, subassembly=renamed), PARTS), "do not follow its order")
    poses = second.motion.T_world_part.copy()
    assembled = poses[-1].copy()
    aside = assembled.copy()
    aside[1, 3] += 0.05 * np.sign(PARTS.part(second.part).bounds_world.mean(axis=0)[1])
    dragged = replace(second.motion, T_world_part=np.concatenate([poses[:-2], [aside], [assembled]]))
    through = replace(inside, steps=(base, replace(second, motion=dragged)))
    refuted(verify_plan(changed(plan, subassembly=through), PARTS), f"deep into {base.part}")
    floating = replace(second.motion, T_world_part=se3.make(translation=np.array([0.0, 0.0, 0.03])) @ poses)
    refuted(
        verify_plan(changed(plan, subassembly=replace(inside, steps=(base, replace(second, motion=floating)))), PARTS),
        "does not end in the assembled pose",
    )


def test_every_member_s_path_is_checked(plan: AssemblyPlan) -> None:
    step, _ = group_of(plan)
    poses = step.motion.T_world_part.copy()
    poses[-2, 0, 3] += 0.004
    refuted(verify_plan(changed(plan, motion=replace(step.motion, T_world_part=poses)), PARTS), "deep into")
    # the far member alone: the bar turned end for end, its path's own part in the same place
    turn = se3.make(se3.exp_so3(np.array([0.0, 0.0, 0.1])))
    turned = step.motion.T_world_part.copy()
    turned[-1] = turned[-1] @ turn
    refuted(verify_plan(changed(plan, motion=replace(step.motion, T_world_part=turned)), PARTS), "assembled pose of")


def test_all_members_of_a_resting_subassembly_are_in_the_way(plan: AssemblyPlan) -> None:
    """The block's second half is led through the far end of the bar that still rests."""
    step, _ = group_of(plan)
    second = plan.steps[1]
    far = next(name for name in step.moving if name != step.part)
    middle = PARTS.part(far).bounds_world.mean(axis=0)
    there = se3.apply(step.member_poses(far, plan.parts)[0], middle[None])[0]
    poses = second.motion.T_world_part.copy()
    poses[1, :3, 3] = there - PARTS.part(second.part).bounds_world.mean(axis=0)
    moved = replace(second, motion=replace(second.motion, T_world_part=poses))
    refuted(verify_plan(replace(plan, steps=(plan.steps[0], moved, plan.steps[2])), PARTS), f"deep into {far}")


def test_it_rests_as_one_body(plan: AssemblyPlan) -> None:
    step, _ = group_of(plan)
    poses = step.motion.T_world_part.copy()
    poses[0, 2, 3] += 0.01
    refuted(verify_plan(changed(plan, motion=replace(step.motion, T_world_part=poses)), PARTS), "floats")
    upright = se3.make(se3.exp_so3(np.array([0.3, 0.0, 0.0]))) @ step.motion.T_world_part[0]
    poses = np.concatenate([[upright], step.motion.T_world_part[1:]])
    report = verify_plan(changed(plan, motion=replace(step.motion, T_world_part=poses)), PARTS)
    assert any("start" in problem for problem in report.steps[-1].problems)


def test_it_may_be_held_by_any_member_s_surface(plan: AssemblyPlan) -> None:
    """A grasp across the joint, one finger on either half; and points inside the material are no contacts."""
    ends = np.array([[0.0, -0.03, 0.003], [0.0, 0.03, 0.003]])
    grasp = Contact(
        kind="grasp",
        points_part=ends,
        normals_part=np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]),
        friction=0.5,
        quality=0.1,
    )
    assert verify_plan(changed(plan, contact=grasp, contact_reason=None), PARTS).ok
    within = replace(grasp, points_part=0.5 * ends)
    refuted(verify_plan(changed(plan, contact=within), PARTS), "off the surface")


def test_united_parts_measure_as_one() -> None:
    left, right = box((0.02, 0.02, 0.02), (-0.01, 0.0, 0.0)), box((0.02, 0.02, 0.02), (0.01, 0.0, 0.0))
    T = se3.exp(np.array([0.1, 0.2, 0.0, 0.3, 0.0, 0.0]))
    second = part("right", right.transform(se3.inverse(T)[:3]), T)
    body = make_body(merge_parts([part("left", left), second], "right"))
    np.testing.assert_allclose(body.mass_properties.volume, 1.6e-5, rtol=1e-9)
    np.testing.assert_allclose(T[:3, :3] @ body.mass_center + T[:3, 3], 0.0, atol=1e-9)
    open_mesh = (np.eye(3), np.array([[0, 1, 2]], dtype=np.int32))
    vertices, faces = unite([open_mesh, open_mesh])
    assert vertices.shape == (6, 3)
    np.testing.assert_array_equal(faces, [[0, 1, 2], [3, 4, 5]])


def test_the_files_show_all_members(plan: AssemblyPlan, tmp_path: Path) -> None:
    scene = make_scene(plan, PARTS, ViewConfig()).json
    front, back = PARTS.index("front"), PARTS.index("back")
    last = scene["steps"][-1]
    assert last["moving"] == [front, back]
    inside = plan.steps[-1].subassembly
    assert inside is not None
    shown = [(step["label"], step["part"]) for step in scene["steps"] if step["depth"] == 1]
    assert shown == [(f"3.{k + 1}", PARTS.index(name)) for k, name in enumerate(inside.order)]
    assert all(row["solved"] for row in scene["parts"])
    offsets = explosion_offsets(plan, PARTS, ViewConfig())
    # one pull brings both out, and one more draws them apart
    found = explode(plan, PARTS, ViewConfig())
    assert abs(len(found.pulls["front"]) - len(found.pulls["back"])) == 1
    assert found.pulls["front"][-1] == found.pulls["back"][-1] or found.pulls["front"][0] is found.pulls["back"][0]
    assert (offsets["front"] != offsets["back"]).any()
    assert write_html(plan, PARTS, tmp_path / "plan.html").stat().st_size > 0
    assert write_glb(plan, PARTS, tmp_path / "plan.glb").stat().st_size > 0


def test_the_summary_names_the_members(plan: AssemblyPlan) -> None:
    lines = summary_lines(plan, PARTS)
    assert lines[0] == "complete and verified: 4 of 4 parts placed"
    assert lines[1].startswith("motions 3/3 · contacts ")
    assert lines[2].startswith("cost of the order ")
    steps = lines[3:7]
    assert steps[0].split()[0] == "1"
    assert sum("subassembly of 2: front, back, along" in line for line in steps) == 1
