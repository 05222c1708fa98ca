"""Grasps among obstacles: known answers, an independent check of what comes back, invariances."""

import json

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_body
from sashimono.contact import (
    PRESETS,
    ContactConfig,
    Obstacle,
    choose_contact,
    choose_contacts,
    named_gripper,
    proportionate_gripper,
)
from sashimono.contact.clearance import TABLE, Surroundings
from sashimono.contact.gripper import Boxes
from sashimono.contact.poses import exp_many, resample
from sashimono.errors import SashimonoError
from sashimono.geometry import se3
from sashimono.plan import Motion, Segment, Table

PANDA = PRESETS["franka-hand"]
CONFIG = ContactConfig(samples=128, max_candidates=60)
TABLE_AT_ZERO = Table(normal=np.array([0.0, 0.0, 1.0]), offset=0.0)


def at(x, y, z):
    return se3.make(translation=np.array([x, y, z]))


def box(name, extents, middle=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.box(extents)
    return Part(name=name, vertices_part=mesh.vertices, faces=mesh.faces, T_world_part=at(*middle))


def part_of(name, mesh, T=None):
    return Part(name=name, vertices_part=mesh.vertices, faces=mesh.faces, T_world_part=np.eye(4) if T is None else T)


def pocket(outer, inner, depth):
    """A block, its top at z = 0, with a rectangular pocket from above."""
    block = trimesh.creation.box(outer)
    block.apply_translation([0.0, 0.0, -outer[2] / 2.0])
    cavity = trimesh.creation.box([inner[0], inner[1], 2.0 * depth])
    return trimesh.boolean.difference([block, cavity])


def drop_in(part, *, beside=0.5, height=0.3, rest_z=None):
    """Up from a place beside, across, and straight down into the assembled pose."""
    T_end = part.T_world_part
    shift = np.eye(4)
    shift[0, 3] = beside
    T_rest = shift @ T_end
    if rest_z is not None:
        T_rest[2, 3] = rest_z
    T_lifted, T_above = T_rest.copy(), T_end.copy()
    T_lifted[2, 3] = T_above[2, 3] = T_end[2, 3] + height
    return Motion(
        T_world_part=np.array([T_rest, T_lifted, T_above, T_end]),
        segments=(Segment(kind="transit", start=0, stop=2), Segment(kind="insertion", start=2, stop=3)),
    )


def still(part):
    return Obstacle(body=make_body(part), T_world_part=part.T_world_part)


def choose(part, motion, parts=(), table=None, gripper=PANDA, config=CONFIG, seed=0):
    obstacles = [still(other) for other in parts]
    choice = choose_contact(
        part, motion, obstacles, table, gripper=gripper, config=config, rng=np.random.default_rng(seed)
    )
    return choice.contact, choice.reason


def check_contact(part, contact):
    """The contact is what it says, by none of the code that made it."""
    first, second = contact.points_part
    line = (second - first) / np.linalg.norm(second - first)
    distances, nearest, *_ = igl.signed_distance(
        np.array(contact.points_part), np.array(part.vertices_part), part.faces.astype(np.int64)
    )
    assert np.abs(distances).max() < 1e-9 * np.ptp(part.vertices_part)
    normals = trimesh.Trimesh(part.vertices_part, part.faces, process=False).face_normals[np.asarray(nearest)]
    np.testing.assert_allclose(contact.normals_part, -normals, atol=1e-6)
    limit = np.cos(np.arctan(contact.friction)) - 1e-9
    assert line @ contact.normals_part[0] >= limit
    assert -line @ contact.normals_part[1] >= limit
    T = contact.T_part_gripper
    assert se3.is_pose(T)
    np.testing.assert_allclose(T[:3, 3], (first + second) / 2.0, atol=1e-12)
    np.testing.assert_allclose(T[:3, 0], line, atol=1e-12)
    assert contact.details["gripper"]["opening"] == pytest.approx(np.linalg.norm(second - first))
    assert contact.details["contact_model"] == "soft finger"
    assert contact.quality > 0.0
    json.dumps(contact.details)


def depth_in_fingers(points_gripper, gripper):
    """How deep the deepest point lies in a finger or the palm of the closed gripper, from the plan's details alone."""
    half, width, length = gripper["opening"] / 2.0, gripper["finger_width"] / 2.0, gripper["finger_length"]
    x, y, z = np.abs(points_gripper[:, 0]), np.abs(points_gripper[:, 1]), points_gripper[:, 2]
    finger = np.min([x - half, half + gripper["finger_thickness"] - x, width - y, z + length, -z], axis=0)
    palm_low = -length - gripper["palm_length"]
    palm = np.min([gripper["palm_width"] / 2 - x, gripper["palm_depth"] / 2 - y, -length - z, z - palm_low], axis=0)
    return max(0.0, finger.max(), palm.max())


def test_box_beside_a_wall_on_a_table():
    part = box("block", (0.04, 0.03, 0.05), (0.0, 0.0, 0.025))
    wall = box("wall", (0.02, 0.2, 0.2), (0.031, 0.0, 0.1))  # 1 mm from the block: no finger fits between
    motion = drop_in(part, beside=-0.4)
    contact, reason = choose(part, motion, [wall], TABLE_AT_ZERO)
    assert reason is None
    check_contact(part, contact)
    # across y: the wall is in the way of x, the table of z
    assert abs(contact.T_part_gripper[1, 0]) > 0.95
    assert contact.details["gripper"]["opening"] == pytest.approx(0.03, rel=0.03)
    surface = trimesh.Trimesh(wall.vertices_world, wall.faces).sample(4000, seed=1)
    for u in np.linspace(0.0, 1.0, 40):
        for T_a, T_b in zip(motion.T_world_part[:-1], motion.T_world_part[1:], strict=True):
            T_gripper = se3.interpolate(T_a, T_b, u) @ contact.T_part_gripper
            inside = depth_in_fingers(se3.apply(se3.inverse(T_gripper), surface), contact.details["gripper"])
            assert inside <= 0.011 * PANDA.finger_thickness


def test_sphere_is_held_through_its_centre():
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=0.02)
    part = part_of("ball", mesh)
    contact, _ = choose(part, drop_in(part))
    check_contact(part, contact)
    line = contact.T_part_gripper[:3, 0]
    assert np.linalg.norm(np.cross(line, contact.T_part_gripper[:3, 3])) < 0.05 * 0.02
    # torsion limits it: (2/3) μ a over the radius
    assert contact.quality == pytest.approx(2 / 3 * 0.2 * PANDA.patch_radius / 0.02, rel=0.1)


def test_thin_plate_upright():
    part = box("plate", (0.3, 0.002, 0.2), (0.0, 0.0, 0.1))
    contact, _ = choose(part, drop_in(part), table=TABLE_AT_ZERO)
    check_contact(part, contact)
    assert contact.details["gripper"]["opening"] == pytest.approx(0.002, rel=0.03)


def test_wider_than_the_opening():
    part = box("big", (0.2, 0.3, 0.4))
    contact, reason = choose(part, drop_in(part))
    assert contact is None
    assert reason == "no antipodal pair within the 80 mm opening (the narrowest spans 200 mm)"


def test_flush_in_a_pocket():
    mesh = pocket((0.2, 0.2, 0.1), (0.0402, 0.0302), 0.05)
    part = box("insert", (0.04, 0.03, 0.05), (0.0, 0.0, -0.025))
    contact, reason = choose(part, drop_in(part), [part_of("pocket", mesh)])
    assert contact is None
    assert reason is not None
    assert "candidate grasps" in reason
    assert "pocket at the assembled pose" in reason
    # with the top standing out far enough it is held there
    high = box("insert", (0.04, 0.03, 0.05), (0.0, 0.0, 0.005))
    contact, _ = choose(high, drop_in(high), [part_of("pocket", mesh)])
    check_contact(high, contact)
    assert contact.points_part[:, 2].min() > -0.005


def test_neighbour_at_pick_up_and_gate_on_the_way():
    part = box("block", (0.03, 0.03, 0.03))
    motion = drop_in(part, beside=1.0, height=0.4)
    shell = trimesh.boolean.difference(
        [trimesh.creation.box((0.3, 0.3, 0.3)), trimesh.creation.box((0.034, 0.034, 0.034))]
    )
    cage = part_of("cage", shell, at(1.0, 0.0, 0.0))
    _, reason = choose(part, motion, [cage])
    assert reason is not None
    assert "cage at pick-up" in reason
    # a gate that lets the part through, and no hand
    sheet = trimesh.boolean.difference(
        [trimesh.creation.box((0.01, 0.8, 1.6)), trimesh.creation.box((0.1, 0.034, 0.034))]
    )
    gate = part_of("gate", sheet, at(0.5, 0.0, 0.4))
    _, reason = choose(part, motion, [gate])
    assert reason is not None
    assert "gate during the transit" in reason


def test_table_keeps_the_hand_above():
    part = box("tile", (0.05, 0.04, 0.006), (0.0, 0.0, 0.003))
    contact, reason = choose(part, drop_in(part), table=TABLE_AT_ZERO)
    assert contact is None  # the tips reach 9 mm beyond the contacts, which lie at most 6 mm high
    assert "the table" in reason
    assert PANDA.tip_reach == 0.009
    contact, _ = choose(part, drop_in(part), table=TABLE_AT_ZERO, gripper=proportionate_gripper(make_body(part)))
    assert contact is not None
    assert contact.T_part_gripper[2, 2] < 0.0


def test_surroundings_see_containment_both_ways():
    solid = still(box("solid", (1.0, 1.0, 1.0)))
    pebble = still(box("pebble", (0.01, 0.01, 0.01), (3.0, 0.0, 0.0)))
    surroundings = Surroundings([solid, pebble], TABLE_AT_ZERO)
    hand = Boxes(np.full((1, 3), -0.1), np.full((1, 3), 0.1))
    poses = np.array([at(x, 0.0, z) for x, z in ((0.0, 0.2), (3.0, 0.104), (3.0, 0.2), (5.0, 0.05), (2.0, 0.1))])
    pebble_inside = Surroundings([solid, pebble], None).hits(hand, at(3.0, 0.0, 0.0)[None])
    assert surroundings.hits(hand, poses) == {0: "solid", 1: "pebble", 3: TABLE}
    assert pebble_inside == {0: "pebble"}
    assert surroundings.first_hit(hand, poses[[2, 4]]) is None


@given(st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6))
@settings(max_examples=5)
def test_world_frame_does_not_matter(twist):
    T = se3.exp(np.array(twist))
    part = box("block", (0.04, 0.03, 0.05), (0.0, 0.0, 0.025))
    wall = box("wall", (0.02, 0.2, 0.2), (0.031, 0.0, 0.1))
    motion = drop_in(part, beside=-0.4)
    here, _ = choose(part, motion, [wall], TABLE_AT_ZERO)

    def moved(p):
        return Part(name=p.name, vertices_part=p.vertices_part, faces=p.faces, T_world_part=T @ p.T_world_part)

    normal = T[:3, 2]
    there, _ = choose(
        moved(part),
        Motion(T_world_part=T @ motion.T_world_part, segments=motion.segments),
        [moved(wall)],
        Table(normal=normal, offset=float(normal @ T[:3, 3])),
    )
    np.testing.assert_allclose(there.points_part, here.points_part, atol=1e-12)
    np.testing.assert_allclose(there.T_part_gripper, here.T_part_gripper, atol=1e-9)
    assert there.quality == here.quality


def test_same_seed_same_contact():
    part = part_of("pin", trimesh.creation.cylinder(radius=0.01, height=0.06))
    first, second = (choose(part, drop_in(part), seed=3)[0] for _ in range(2))
    np.testing.assert_array_equal(first.T_part_gripper, second.T_part_gripper)
    assert first.quality == second.quality


def test_best_of_all_when_nothing_is_in_the_way():
    part = box("block", (0.04, 0.03, 0.05))
    contact, _ = choose(part, drop_in(part))
    full, _ = choose(part, drop_in(part), config=ContactConfig(samples=128, max_candidates=10_000))
    assert contact.quality == full.quality
    # an obstacle never makes it better
    wall = box("wall", (0.02, 0.2, 0.2), (0.031, 0.0, 0.0))
    beside, _ = choose(part, drop_in(part, beside=-0.4), [wall])
    assert beside.quality <= contact.quality


def test_level_three_of_a_small_assembly():
    base = part_of("base", pocket((0.2, 0.2, 0.05), (0.0302, 0.0302), 0.02))
    peg = box("peg", (0.03, 0.03, 0.06), (0.0, 0.0, 0.01))
    lid = box("lid", (0.06, 0.06, 0.02), (0.0, 0.0, 0.05))
    assembly = Assembly(parts=(base, peg, lid))
    motions = {
        "base": Motion(T_world_part=base.T_world_part[None], segments=()),
        "peg": drop_in(peg, beside=0.4),
        "lid": drop_in(lid, beside=0.8),
    }
    seen = []
    choices = choose_contacts(
        assembly,
        ("base", "peg", "lid"),
        motions,
        None,
        gripper=None,
        config=CONFIG,
        rng=np.random.default_rng(0),
        progress=seen.append,
    )
    assert seen == ["base", "peg", "lid"]
    assert choices["base"].contact is None
    assert choices["base"].reason == "base part: starts in place"
    for name in ("peg", "lid"):
        check_contact(assembly.part(name), choices[name].contact)
        assert choices[name].contact.details["gripper"]["name"] == "auto"
    without = choose_contacts(
        assembly, ("base", "peg", "lid"), {k: motions[k] for k in ("base", "lid")}, None,
        gripper=None, config=CONFIG, rng=np.random.default_rng(0),
    )  # fmt: skip
    assert without["peg"].contact is None
    assert without["peg"].reason == "no motion along which to hold the part"


def test_gripper_names():
    assert named_gripper("auto") is None
    assert named_gripper("robotiq-2f85").max_opening == 0.085
    with pytest.raises(SashimonoError, match="fingertips, auto, franka-hand"):
        named_gripper("3f")


def test_resampled_path_keeps_its_poses_and_its_spacing():
    rng = np.random.default_rng(2)
    path = np.array([se3.exp(rng.uniform(-1.5, 1.5, 6)) for _ in range(5)])
    center, reach = np.array([3.0, -1.0, 2.0]), 0.5
    poses, spacing = resample(path, center=center, reach=reach, step=0.05, max_poses=10_000)
    assert spacing == 0.05
    for T in path:
        assert np.abs(poses - T).max(axis=(1, 2)).min() < 1e-9
    offsets = rng.normal(size=(50, 3))
    points = center + reach * offsets / np.linalg.norm(offsets, axis=1, keepdims=True)
    places = np.array([se3.apply(T, points) for T in poses])
    assert np.linalg.norm(np.diff(places, axis=0), axis=2).max() <= spacing + 1e-12
    few, wide = resample(path, center=center, reach=reach, step=0.05, max_poses=20)
    assert len(few) <= 20 + len(path)
    assert wide > spacing


@given(st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
@settings(max_examples=30)
def test_exponentials_in_bulk(twist):
    u = np.array([0.0, 0.3, 1.0])
    expected = [se3.exp(k * np.array(twist)) for k in u]
    np.testing.assert_allclose(exp_many(np.array(twist), u), expected, atol=1e-9)


def test_gearbox_parts_lifted_straight_out(truth_folder):
    names = ("housing", "cover", "pulley", "s0", "s1", "s2", "s3")
    parts = []
    for name in names:
        mesh = trimesh.load(truth_folder / "gearbox14" / f"{name}.obj", process=False)
        mesh.merge_vertices()
        parts.append(part_of(name, trimesh.Trimesh(mesh.vertices * 1e-3, mesh.faces, process=False)))
    assembly = Assembly(parts=tuple(parts))
    motions = {name: drop_in(assembly.part(name), beside=0.2 * k, height=0.1) for k, name in enumerate(names)}
    choices = choose_contacts(
        assembly, names, motions, None, gripper=None, config=ContactConfig(), rng=np.random.default_rng(0)
    )
    assert [name for name in names if choices[name].contact is None] == ["housing"]
    for name in names[1:]:
        check_contact(assembly.part(name), choices[name].contact)
        assert choices[name].contact.T_part_gripper[2, 2] < 0.0  # from above, where the way in is
        for other in names[: names.index(name)]:
            mesh = trimesh.Trimesh(assembly.part(other).vertices_world, assembly.part(other).faces, process=False)
            T_gripper_world = se3.inverse(assembly.part(name).T_world_part @ choices[name].contact.T_part_gripper)
            gripper = choices[name].contact.details["gripper"]
            inside = depth_in_fingers(se3.apply(T_gripper_world, mesh.sample(5000, seed=0)), gripper)
            assert inside <= 0.011 * gripper["finger_thickness"]
