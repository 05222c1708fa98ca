"""Level 2 as a whole: every pose of every motion against the obstacles, by another route (libigl)."""

from itertools import pairwise

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from sashimono.assembly import Assembly, Part
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.motion import MotionConfig, RRTConfig, plan_motions
from sashimono.plan import Motion

X, Y, Z = np.eye(3)


def part(name, mesh, T=None):
    vertices = np.array(mesh.vertices)
    middle = vertices.mean(axis=0)
    T_world_part = (np.eye(4) if T is None else T) @ se3.make(translation=middle)
    return Part(name=name, vertices_part=vertices - middle, faces=np.array(mesh.faces), T_world_part=T_world_part)


def case(T=None):
    """A tray-like box with a block inside, a lid on it, a pin through its side, and a foot below it."""
    box = trimesh.creation.box(bounds=[[-0.03, -0.03, 0], [0.03, 0.03, 0.03]])
    cavity = trimesh.creation.box(bounds=[[-0.025, -0.025, 0.005], [0.025, 0.025, 0.04]])
    hole = trimesh.creation.cylinder(radius=0.004, height=0.02, sections=32)
    hole.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, Y))
    hole.apply_translation([0.03, 0, 0.015])
    socket = trimesh.creation.cylinder(radius=0.004, height=0.006, sections=32)
    base = trimesh.boolean.difference([box, cavity, hole, socket], engine="manifold")
    block = trimesh.creation.box(bounds=[[-0.01, -0.01, 0.005], [0.01, 0.01, 0.02]])
    lid = trimesh.creation.box(bounds=[[-0.03, -0.03, 0.03], [0.03, 0.03, 0.034]])
    pin = trimesh.creation.cylinder(radius=0.0038, height=0.02, sections=32)
    pin.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, Y))
    pin.apply_translation([0.035, 0, 0.015])
    foot = trimesh.creation.cylinder(radius=0.0038, height=0.012, sections=32)
    foot.apply_translation([0, 0, -0.0041])
    meshes = {"base": base, "block": block, "lid": lid, "pin": pin, "foot": foot}
    turn = np.eye(3) if T is None else T[:3, :3]
    exits = {"block": Z, "lid": Z, "pin": X, "foot": -Z}
    removals = {name: Removal.straight(turn @ direction, 0.2) for name, direction in exits.items()}
    return Assembly(parts=tuple(part(name, mesh, T) for name, mesh in meshes.items())), removals


ORDER = ("base", "block", "lid", "pin", "foot")


def depth_at(moving, T, other, T_other):
    """Least signed distance between two parts' surfaces, by libigl: negative inside."""
    gaps = []
    for a, T_a, b, T_b in ((moving, T, other, T_other), (other, T_other, moving, T)):
        points = np.concatenate([a.vertices_part, a.vertices_part[a.faces].mean(axis=1)])
        local = se3.apply(se3.inverse(T_b) @ T_a, points)
        signed = igl.signed_distance(local, b.vertices_part, b.faces.astype(np.int64))[0]
        gaps.append(signed.min())
    return min(gaps)


def check(assembly, order, result, per_edge=6):
    """Each motion starts at rest, ends assembled, and in between meets nothing it must not meet."""
    normal, offset = result.table.normal, result.table.offset
    for k, name in enumerate(order[1:], start=1):
        motion, moving = result.motions[name], assembly.part(name)
        poses = motion.T_world_part
        assert [s.kind for s in motion.segments] == ["transit", "insertion"]
        assert motion.segments[0].start == 0
        assert motion.segments[0].stop == motion.segments[1].start
        assert motion.segments[1].stop == len(poses) - 1
        assert np.array_equal(poses[-1], moving.T_world_part)
        assert np.array_equal(poses[0], result.resting[name])
        assert motion.evidence["transit_certified"]
        heights = se3.apply(poses[0], moving.vertices_part) @ normal - offset
        assert heights.min() == pytest.approx(0.0, abs=1e-12)
        for e, (a, b) in enumerate(pairwise(poses)):
            transit = e < motion.segments[0].stop
            for u in np.linspace(0, 1, per_edge):
                T = se3.interpolate(a, b, float(u))
                assert (se3.apply(T, moving.vertices_part) @ normal).min() >= offset - 1e-9
                others = [(n, result.resting[n]) for n in order[k + 1 :]]
                if transit:
                    others += [(n, assembly.part(n).T_world_part) for n in order[:k]]
                for other, T_other in others:
                    assert depth_at(moving, T, assembly.part(other), T_other) > 0.0, (name, other, e, u)


def test_every_pose_of_a_small_plan_is_free_by_another_route():
    assembly, removals = case()
    result = plan_motions(assembly, ORDER, removals, config=MotionConfig(), rng=np.random.default_rng(0))
    assert result.complete
    assert result.table.normal == pytest.approx(Z)
    check(assembly, ORDER, result)


def test_the_base_is_held_high_enough_for_what_comes_from_below():
    assembly, removals = case()
    result = plan_motions(assembly, ORDER, removals, config=MotionConfig(), rng=np.random.default_rng(0))
    assert result.fixture_height > 0.012
    foot = result.motions["foot"]
    start = foot.T_world_part[foot.segments[1].start]
    assert start[2, 3] < assembly.part("foot").T_world_part[2, 3] - 0.0019
    above = {name: removals[name] for name in ("block", "lid", "pin")}
    standing = plan_motions(assembly, ORDER[:4], above, config=MotionConfig(), rng=np.random.default_rng(0))
    assert standing.fixture_height == 0.0
    assert len(standing.motions["base"].T_world_part) == 1
    assert standing.motions["base"].segments == ()


def test_the_insertion_is_the_removal_reversed_and_short():
    assembly, removals = case()
    result = plan_motions(assembly, ORDER, removals, config=MotionConfig(), rng=np.random.default_rng(0))
    motion = result.motions["pin"]
    assert motion.segments[1].stop - motion.segments[1].start == 1
    shift = motion.T_world_part[-2, :3, 3] - motion.T_world_part[-1, :3, 3]
    assert np.linalg.norm(np.cross(shift, X)) < 1e-12
    # the pin sits 5 mm deep: out, and one margin more
    assert 0.005 < shift @ X < 0.008
    assert motion.evidence["preinsertion_gap"] > 0.0


def test_a_removal_with_a_bend_is_shortened_to_what_is_needed():
    assembly, removals = case()
    up, out = np.eye(4), np.eye(4)
    up[2, 3] = 0.05
    out[:3, 3] = (0.2, 0.0, 0.05)
    removals = removals | {"block": Removal(displacements=np.stack([np.eye(4), up, out]), exit_direction=X)}
    result = plan_motions(assembly, ORDER, removals, config=MotionConfig(), rng=np.random.default_rng(0))
    assert result.complete
    poses = result.motions["block"].T_world_part
    block = assembly.part("block").T_world_part
    assert poses[-2] == pytest.approx(up @ block)
    # out after the first leg: no more of the second is needed
    assert result.motions["block"].segments[1].start == len(poses) - 2


def test_the_same_seed_gives_the_same_poses():
    assembly, removals = case()

    def plan(config):
        return plan_motions(assembly, ORDER, removals, config=config, rng=np.random.default_rng(5))

    first, second = plan(MotionConfig()), plan(MotionConfig())
    for name in ORDER:
        assert np.array_equal(first.motions[name].T_world_part, second.motions[name].T_world_part)


@settings(max_examples=4, deadline=None)
@given(st.integers(0, 10_000))
def test_turning_everything_changes_no_answer(seed):
    rng = np.random.default_rng(seed)
    T = se3.make(se3.exp_so3(rng.standard_normal(3)), rng.standard_normal(3))
    assembly, removals = case(T)
    result = plan_motions(assembly, ORDER, removals, config=MotionConfig(), rng=np.random.default_rng(0))
    assert result.complete
    check(assembly, ORDER, result, per_edge=3)


def test_no_removal_and_no_room_are_answers():
    assembly, removals = case()
    kept = {name: removal for name, removal in removals.items() if name != "block"}
    result = plan_motions(assembly, ORDER, kept, config=MotionConfig(), rng=np.random.default_rng(0))
    assert not result.complete
    assert [u.part for u in result.unsolved] == ["block"]
    assert "removal" in result.unsolved[0].reason
    # a wish for a clearance that nothing in the scene can give
    impossible = MotionConfig(clearance=1e3, min_clearance=1e3, rrt=RRTConfig(max_iterations=3))
    result = plan_motions(assembly, ORDER, removals, config=impossible, rng=np.random.default_rng(0))
    assert {u.part for u in result.unsolved} == set(ORDER[1:])


def test_parts_in_place_stand_from_the_beginning():
    assembly, removals = case()
    result = plan_motions(
        assembly,
        ("base", "lid", "pin"),
        removals,
        config=MotionConfig(),
        rng=np.random.default_rng(0),
        in_place=("block",),
    )
    assert result.complete
    assert set(result.motions) == {"base", "block", "lid", "pin"}
    assert len(result.motions["block"].T_world_part) == 1


def test_nothing_to_move_is_no_error():
    assembly, _ = case()
    result = plan_motions(
        assembly, ("base",), {}, config=MotionConfig(), rng=np.random.default_rng(0), in_place=("block",)
    )
    assert result.complete
    assert set(result.motions) == {"base", "block"}


def test_progress_is_told_once_a_part():
    assembly, removals = case()
    seen = []
    plan_motions(
        assembly,
        ORDER,
        removals,
        config=MotionConfig(),
        rng=np.random.default_rng(0),
        progress=lambda done, total: seen.append((done, total)),
    )
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_pure_rrt_connect_puts_a_loose_block_in_place():
    assembly, removals = case()
    config = MotionConfig(insertion="rrt", max_displacement=0.1, rrt=RRTConfig(max_iterations=200))
    result = plan_motions(assembly, ("base", "block"), removals, config=config, rng=np.random.default_rng(0))
    motion = result.motions["block"]
    assert isinstance(motion, Motion)
    assert np.array_equal(motion.T_world_part[-1], assembly.part("block").T_world_part)
    assert not motion.evidence["transit_certified"]
    assert motion.evidence["max_penetration"] <= motion.evidence["tolerance"] + 1e-6
    assert motion.segments[-1].stop == len(motion.T_world_part) - 1


def test_gearbox_of_fourteen_parts(truth_folder):
    parts = []
    for path in sorted((truth_folder / "gearbox14").glob("*.obj")):
        mesh = trimesh.load(path, force="mesh", process=True)
        mesh.apply_scale(1e-3)
        parts.append(part(path.stem, mesh))
    assembly = Assembly(parts=tuple(parts))
    order = ["housing", "b1", "sp1", "gA", "shaft", "gB", "sp2", "b2", "cover", "s0", "s1", "s2", "s3", "pulley"]
    removals = {name: Removal.straight(Z, 0.1) for name in order[1:]}
    result = plan_motions(assembly, order, removals, config=MotionConfig(), rng=np.random.default_rng(0))
    assert result.complete
    check(assembly, order, result, per_edge=2)
