"""Fingertips: known answers among obstacles, regrasps and pushes, checked by `verify`."""

import json
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from sashimono.assembly import Assembly, Part, Source
from sashimono.bodies import make_body
from sashimono.commands import find_gripper, find_grippers
from sashimono.contact import FINGERTIPS, PRESETS, ContactConfig, choose_contacts, named_gripper
from sashimono.contact.fingertips import Passage
from sashimono.contact.samples import steady, steady_pairs
from sashimono.errors import SashimonoError
from sashimono.geometry import se3
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.motion.scene import Obstacle
from sashimono.plan import AssemblyPlan, Motion, Segment, Step, Table
from sashimono.verify import verify_plan

CONFIG = ContactConfig()


def at(x, y, z):
    return se3.make(translation=np.array([x, y, z], dtype=np.float64))


def box(name, extents, middle=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.box(extents)
    return Part(name=name, vertices_part=mesh.vertices, faces=mesh.faces, T_world_part=at(*middle))


def block_with_hole(hole, depth):
    block = trimesh.creation.box([0.1, 0.1, 0.05])
    block.apply_translation([0.0, 0.0, -0.025])
    cut = trimesh.creation.box([hole, hole, 2.0 * depth])
    mesh = trimesh.boolean.difference([block, cut])
    return Part(name="block", vertices_part=mesh.vertices, faces=mesh.faces, T_world_part=np.eye(4))


def dropped_in(part, *, beside, rest_z, height=0.08):
    T_end = part.T_world_part
    T_rest, T_up, T_above = at(beside, 0.0, rest_z), at(beside, 0.0, height), at(0.0, 0.0, height)
    return Motion(
        T_world_part=np.array([T_rest, T_up, T_above, T_end]),
        segments=(Segment(kind="transit", start=0, stop=2), Segment(kind="insertion", start=2, stop=3)),
    )


def peg_in_block(sunk):
    """A peg of 10 x 10 x 20 mm, that deep under the block's top when in place."""
    block = block_with_hole(0.01, 0.02 + sunk)
    peg = box("peg", (0.01, 0.01, 0.02), (0.0, 0.0, -0.01 - sunk))
    assembly = Assembly(parts=(block, peg))
    table = Table(normal=np.array([0.0, 0.0, 1.0]), offset=-0.05)
    base = Motion(T_world_part=np.eye(4)[None], segments=())
    return assembly, {"block": base, "peg": dropped_in(peg, beside=0.3, rest_z=-0.04)}, table


def planned(assembly, motions, table, choices):
    names = list(assembly.names)
    steps = tuple(
        Step(
            part=name,
            fixed=tuple(names[:k]),
            motion=motions[name],
            contact=choices[name].contact,
            contact_reason=choices[name].reason,
            carry=choices[name].carry,
            grippers=choices[name].grippers,
        )
        for k, name in enumerate(names)
    )
    return AssemblyPlan(
        status="complete",
        source=Source(path="", sha256="", unit="m"),
        parts={part.name: part.T_world_part for part in assembly.parts},
        order=tuple(names),
        steps=steps,
        unsolved=(),
        table=table,
    )


def chosen(sunk, **options):
    assembly, motions, table = peg_in_block(sunk)
    rng = np.random.default_rng(3)
    choices = choose_contacts(
        assembly, ["block", "peg"], motions, table, gripper=FINGERTIPS, config=CONFIG, rng=rng, **options
    )
    return planned(assembly, motions, table, choices), assembly


def contact_findings(plan, assembly):
    return [problem for step in verify_plan(plan, assembly).steps for problem in step.contact_problems]


def test_a_peg_that_stands_out_is_grasped_there():
    plan, assembly = chosen(-0.012)
    step = plan.steps[1]
    assert step.contact.kind == "grasp"
    assert step.carry is None
    assert step.contact.points_part[:, 2].min() > -0.002  # above the block's top
    assert contact_findings(plan, assembly) == []


def test_a_peg_that_ends_flush_is_carried_and_then_pushed():
    plan, assembly = chosen(0.0)
    step = plan.steps[1]
    assert step.contact.kind == "push"
    np.testing.assert_allclose(step.contact.normals_part, [[0.0, 0.0, -1.0]], atol=1e-9)
    assert step.contact.force_part[0, 2] < 0.0
    assert step.carry.kind == "grasp"
    assert step.carry.details["to_pose"] == step.contact.details["from_pose"]
    assert contact_findings(plan, assembly) == []
    again = plan_from_json(plan_to_json(plan))
    assert again.steps[1].carry.details["to_pose"] == step.carry.details["to_pose"]


def test_the_check_refutes_what_does_not_hold():
    plan, assembly = chosen(0.0)
    step = plan.steps[1]

    def findings(contact, carry=step.carry):
        wrong = replace(plan, steps=(plan.steps[0], replace(step, contact=contact, carry=carry)))
        return " ".join(contact_findings(wrong, assembly))

    push = step.contact
    assert "do not balance" in findings(replace(push, force_part=1.01 * push.force_part))
    bent = np.array([[0.0, np.sin(0.2), -np.cos(0.2)]])
    assert "off the surface's inward normal" in findings(replace(push, normals_part=bent))
    aside = push.force_part + np.array([[np.linalg.norm(push.force_part), 0.0, 0.0]])
    assert "outside its friction cone" in findings(replace(push, force_part=aside))
    nowhere = {**push.details, "supports": {**push.details["supports"], "parts": ["peg"] * 8}}
    if push.details["supports"]["parts"]:
        assert "push" in findings(replace(push, details=nowhere))
    # the grasp that carried it, claimed to hold it to the end: its tips would go into the block
    greedy = replace(step.carry, details={**step.carry.details, "to_pose": 3.0})
    assert "hits block" in findings(greedy, carry=None)
    fat = {**step.carry.details, "fingertips": {**step.carry.details["fingertips"], "radius": 0.06}}
    assert "on the way there" in findings(push, carry=replace(step.carry, details=fat))


def test_the_printed_cone_is_an_option_of_pushes_too():
    assembly, motions, table = peg_in_block(0.0)
    config = ContactConfig(friction_cone="printed")
    rng = np.random.default_rng(3)
    choices = choose_contacts(assembly, ["block", "peg"], motions, table, gripper=FINGERTIPS, config=config, rng=rng)
    assert contact_findings(planned(assembly, motions, table, choices), assembly) == []


def test_contacts_keep_off_edges():
    body = make_body(box("b", (0.02, 0.02, 0.02)))
    points = np.array([[0.01, 0.0, 0.0], [0.01, 0.01, 0.0], [0.01, 0.0099, 0.0]])
    inward = np.tile([-1.0, 0.0, 0.0], (3, 1))
    assert steady(body, points, inward).tolist() == [True, False, False]


def test_each_step_says_which_gripper_can_take_it():
    plan, _ = chosen(-0.012, report=[*PRESETS.values()])
    said = plan.steps[1].grippers
    assert set(said) == set(PRESETS)
    assert said["robotiq-hand-e"] is None
    flush, _ = chosen(0.0, report=[*PRESETS.values()])
    assert all(flush.steps[1].grippers.values())


def test_grippers_by_name_and_by_file(tmp_path):
    assert named_gripper("fingertips") is FINGERTIPS
    assert find_grippers("none") == ()
    assert set(find_grippers("all")) == {*PRESETS, "vacuum-cup"}
    hand = PRESETS["robotiq-2f85"]
    assert hand.reach(hand.max_opening) == hand.finger_length
    assert hand.reach(0.0) == pytest.approx(hand.finger_length + hand.closing_advance)
    fields = {**hand.__dict__, "name": "mine"}
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(fields))
    assert find_gripper(str(path)).name == "mine"
    path.write_text(json.dumps({**fields, "finger_width": "wide"}))
    with pytest.raises(SashimonoError, match="finger_width is 'wide', not a length"):
        find_gripper(str(path))
    fields.pop("max_opening")
    path.write_text(json.dumps(fields))
    with pytest.raises(SashimonoError, match="max_opening is missing"):
        find_gripper(str(path))


def test_a_thin_wire_on_a_bead_is_held_between_its_small_facets():
    """Facets of the wire are 0.08 mm wide: a hundredth of the bead would reach beyond them."""
    bead = trimesh.creation.box([0.02, 0.02, 0.02])
    wire = trimesh.creation.cylinder(radius=0.0003, height=0.03, sections=24)
    wire.apply_translation([0.0, 0.0, 0.02])
    mesh = trimesh.boolean.union([bead, wire])
    body = make_body(Part(name="probe", vertices_part=mesh.vertices, faces=mesh.faces, T_world_part=np.eye(4)))
    turn = (np.arange(24) + 0.5) * 2.0 * np.pi / 24
    outward = np.stack([np.cos(turn), np.sin(turn), np.zeros(24)], axis=1)
    first = 0.0003 * np.cos(np.pi / 24) * outward + [0.0, 0.0, 0.02]
    pairs = np.stack([first, np.roll(first, 12, axis=0)], axis=1), np.stack([-outward, outward], axis=1)
    assert not steady(body, pairs[0][:, 0], pairs[1][:, 0]).any()
    assert steady_pairs(body, *pairs).all()


@pytest.mark.parametrize("seed", range(4))
def test_what_no_fingertip_can_meet_need_not_be_asked(seed, monkeypatch):
    """With all obstacles asked, the same balls are clear as with those whose boxes are near."""
    rng = np.random.default_rng(seed)
    part = box("part", (0.02, 0.02, 0.02))
    bodies = [make_body(box(f"b{k}", rng.uniform(0.005, 0.03, 3))) for k in range(80)]
    around = [
        Obstacle(
            body=body, T_world_part=se3.exp(np.concatenate([rng.uniform(-0.12, 0.12, 3), rng.uniform(-1.0, 1.0, 3)]))
        )
        for body in bodies
    ]
    motion = dropped_in(part, beside=0.15, rest_z=0.0)
    centers = rng.uniform(-0.012, 0.012, (60, 3))
    ways = 0.01 * rng.normal(size=(60, 3))

    def looked_at():
        passage = Passage(make_body(part), motion, around, None, CONFIG)
        clear_off = [passage.clear_way_off(centers, ways, 0.002, index) for index in (0, passage.last)]
        # balls farther from the part than its own fingertips would be are asked too
        far = passage.clear_until(4.0 * centers, 0.002)
        return [passage.clear_from(centers, 0.002), passage.clear_until(centers, 0.002), far, *clear_off]

    few = looked_at()
    monkeypatch.setattr(Passage, "_in_box", lambda self, low, high: np.ones(len(self._around), dtype=bool))
    for one, other in zip(few, looked_at(), strict=True):
        assert np.array_equal(one, other)
    assert any(len(np.unique(found)) > 1 for found in few), "some meet something, some do not"


@pytest.mark.parametrize("way", [0.05, 1.0, 30.0])
@pytest.mark.parametrize("thickness", [0.002, 1e-4])
def test_nothing_is_passed_over_however_long_the_way_is(way, thickness):
    """A sheet stands beside the end of a straight way, thinner than the poses looked at are apart."""
    part = box("part", (0.02, 0.02, 0.02))
    motion = Motion(
        T_world_part=np.array([at(way, 0.0, 0.0), at(0.0, 0.0, 0.0)]),
        segments=(Segment(kind="insertion", start=0, stop=1),),
    )
    sheet = make_body(box("sheet", (thickness, 0.005, 0.02)))
    around = [Obstacle(body=sheet, T_world_part=at(0.0312, 0.0145, 0.0))]
    passage = Passage(make_body(part), motion, around, None, CONFIG)
    centers = np.array([[0.0, 0.0115, 0.0], [0.0, 0.0095, 0.0], [0.0, -0.0115, 0.0]])
    first = passage.clear_from(centers, 0.001)
    until = passage.clear_until(centers, 0.001)
    assert first[0] > 0, "it meets the sheet"
    assert passage.path.parameter[first[0]] > 1.0 - 0.035 / way
    assert passage.path.parameter[until[0]] < 1.0 - 0.028 / way
    assert (first[1:] == 0).all(), "these go past it"
    assert (until[1:] == passage.last).all()
    assert passage.hits(centers, np.zeros((3, 3)), 0.001)[:, 0].tolist() == [True, False, False]
