"""RRT-Connect, smoothing, and the certified edge check: known answers and invariants."""

from itertools import pairwise

import igl
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies, make_body
from sashimono.geometry import se3
from sashimono.geometry.body import path_length
from sashimono.motion.config import RRTConfig, SmoothingConfig
from sashimono.motion.rrt_connect import pose_metric, pose_sampler, rrt_connect
from sashimono.motion.scene import Obstacle, Scene, slab_directions
from sashimono.motion.smoothing import smooth
from sashimono.plan import Table


def body_of(mesh, name="part"):
    return make_body(
        Part(name=name, vertices_part=np.array(mesh.vertices), faces=np.array(mesh.faces), T_world_part=np.eye(4))
    )


def at(x, y, z, w=(0.0, 0.0, 0.0)):
    return se3.make(se3.exp_so3(np.array(w, dtype=float)), np.array([x, y, z], dtype=float))


def wall_with_gap():
    """A wall across x = 0 with a slot, 3 wide and 1 high: only a flat board lying down passes."""
    wall = trimesh.creation.box((0.4, 20, 20))
    slot = trimesh.creation.box((1, 3, 1))
    return trimesh.boolean.difference([wall, slot], engine="manifold")


def scene_with(obstacle, moving, clearance=0.02):
    table = Table(normal=np.array([0.0, 0.0, 1.0]), offset=-5.0)
    return Scene(
        body_of(moving, "moving"),
        [Obstacle(body=body_of(obstacle, "obstacle"), T_world_part=np.eye(4))],
        table,
        slab_directions(np.eye(3)),
        clearance=clearance,
        max_checks=400,
    )


def search(scene, start, goal, seed, config=None):
    config = config or RRTConfig(max_iterations=3000)
    body = scene.moving
    low, high = np.array([-3.0, -3.0, -3.0]), np.array([3.0, 3.0, 3.0])
    return rrt_connect(
        start,
        goal,
        edge_is_free=lambda a, b: scene.check_edge(a, b).free,
        sample=pose_sampler(low, high, np.eye(3), body.center, start, goal, config),
        metric=pose_metric(body.center, body.radius),
        step=body.radius,
        config=config,
        rng=np.random.default_rng(seed),
    )


def test_rrt_connect_threads_a_board_through_a_slot():
    board = trimesh.creation.box((0.5, 2.0, 0.5))
    scene = scene_with(wall_with_gap(), board)
    start, goal = at(-2, 0, 1.5, (0.0, 0.0, 0.0)), at(2, 0, -1.5, (1.2, 0.0, 0.0))
    result = search(scene, start, goal, seed=1)
    assert result.path is not None
    assert np.array_equal(result.path[0], start)
    assert np.array_equal(result.path[-1], goal)
    wall = trimesh.collision.CollisionManager()
    wall.add_object("wall", wall_with_gap())
    for a, b in pairwise(result.path):
        for u in np.linspace(0, 1, 20):
            assert not wall.in_collision_single(board, se3.interpolate(a, b, float(u)))


def test_the_same_seed_gives_the_same_path_and_another_seed_another():
    scene = scene_with(wall_with_gap(), trimesh.creation.box((0.5, 1.0, 0.5)))
    start, goal = at(-2, 0, 1.5), at(2, 0, -1.5)
    first, second, third = (search(scene, start, goal, seed) for seed in (1, 1, 2))
    assert np.array_equal(first.path, second.path)
    assert (first.nodes, first.edge_checks) == (second.nodes, second.edge_checks)
    assert first.path.shape != third.path.shape or not np.allclose(first.path, third.path)


def test_a_closed_wall_is_no_exception_but_no_path():
    scene = scene_with(trimesh.creation.box((0.4, 20, 20)), trimesh.creation.box((0.5, 1.0, 0.5)))
    result = search(scene, at(-2, 0, 0), at(2, 0, 0), 0, RRTConfig(max_iterations=50, max_nodes=300))
    assert result.path is None
    assert result.iterations <= 50
    assert 2 <= result.nodes <= 301


def test_open_space_is_crossed_at_once():
    scene = scene_with(trimesh.creation.box((0.4, 1, 1)), trimesh.creation.box((0.5, 0.5, 0.5)))
    result = search(scene, at(-2, 2, 0), at(2, 2, 0, (0.0, 0.0, 1.0)), 0)
    assert result.iterations == 1


def test_smoothing_keeps_the_ends_and_never_lengthens():
    scene = scene_with(wall_with_gap(), trimesh.creation.box((0.5, 1.0, 0.5)))
    path = list(search(scene, at(-2, 0, 1.5), at(2, 0, -1.5), 1).path)

    def length(a, b):
        return path_length(scene.moving, a, b)

    def total(poses):
        return sum(length(a, b) for a, b in pairwise(poses))

    def free(a, b):
        return scene.check_edge(a, b).free

    out = smooth(
        path, edge_is_free=free, length=length, config=SmoothingConfig(iterations=40), rng=np.random.default_rng(0)
    )
    assert np.array_equal(out[0], path[0])
    assert np.array_equal(out[-1], path[-1])
    assert total(out) <= total(path) * (1 + 1e-9)
    assert len(out) <= len(path)
    assert total(out) < 1.5 * np.linalg.norm([4, 0, 3]) + 1.0


def test_a_thin_wall_is_never_jumped():
    scene = scene_with(trimesh.creation.box((1e-4, 20, 20)), trimesh.creation.box((0.1, 0.1, 0.1)), clearance=1e-3)
    check = scene.check_edge(at(-2, 0.3, 0), at(3, 0.2, 0))
    assert not check.free
    assert check.blocked_by == "obstacle"


def test_the_table_blocks_from_above_and_from_inside():
    scene = scene_with(trimesh.creation.box((0.1, 0.1, 0.1)), trimesh.creation.box((0.5, 0.5, 0.5)))
    assert scene.check_edge(at(2, 0, 0), at(2, 0, -6)).blocked_by == "table"
    assert scene.check_edge(at(2, 0, -4.75), at(2, 0, -4.5), table=False).free


def test_a_part_inside_a_solid_is_not_free():
    scene = scene_with(trimesh.creation.box((4, 4, 4)), trimesh.creation.box((0.1, 0.1, 0.1)))
    assert scene.blocker(np.eye(4)) == "obstacle"
    assert scene.hit(np.eye(4)) == "obstacle"


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_a_certified_gap_holds_on_the_whole_edge(seed):
    rng = np.random.default_rng(seed)
    obstacle = trimesh.creation.icosphere(subdivisions=2, radius=1.0)
    moving = trimesh.creation.box((0.6, 0.3, 0.2))
    scene = scene_with(obstacle, moving)
    ends = [at(*(rng.standard_normal(3) * 1.5), rng.standard_normal(3)) for _ in range(2)]
    check = scene.check_edge(*ends)
    if scene.blocker(ends[0]) is not None:
        return
    gaps = []
    for u in np.linspace(0, 1, 60):
        corners = se3.apply(se3.interpolate(*ends, float(u)), np.array(moving.vertices))
        # over corners only: never less than the gap
        squared = igl.point_mesh_squared_distance(corners, np.array(obstacle.vertices), np.array(obstacle.faces))[0]
        gaps.append(np.sqrt(squared.min()))
    if check.free:
        assert check.min_gap <= min(gaps) + 1e-9
        assert check.min_gap >= scene.clearance / 2 - 1e-9
    else:
        assert check.blocked_by is not None


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_slab_gaps_never_exceed_the_distance(seed):
    rng = np.random.default_rng(seed)
    scene = scene_with(trimesh.creation.box((1, 2, 0.5)), trimesh.creation.box((0.6, 0.3, 0.2)))
    T = at(*(rng.standard_normal(3) * 2), rng.standard_normal(3) * 2)
    gap = scene.slab_gaps(T)[0][0]
    assert gap <= scene.distance(T, 0) + 1e-9


def test_tiny_parts_have_the_same_gaps_as_large_ones():
    """In metres FCL gets a third of these distances wrong, and some of them 0."""
    rng = np.random.default_rng(0)
    turns = [se3.exp_so3(2.0 * rng.standard_normal(3)) for _ in range(60)]
    ways = [d / np.linalg.norm(d) for d in rng.standard_normal((60, 3))]
    gaps = []
    for side in (1e-4, 1.0):
        box = trimesh.creation.box((side, side, side))
        vertices, faces = np.array(box.vertices), np.array(box.faces)
        parts = [Part(name=name, vertices_part=vertices, faces=faces, T_world_part=np.eye(4)) for name in "ab"]
        a, b = make_bodies(Assembly(parts=tuple(parts))).values()
        a.move(np.eye(4))
        for R, way in zip(turns, ways, strict=True):
            b.move(se3.make(R, 1.75 * side * way))
            gaps.append(a.distance(b) / side)
    assert gaps[:60] == pytest.approx(gaps[60:], abs=1e-9)


@given(st.integers(0, 10_000))
def test_the_metric_is_symmetric_zero_at_home_and_the_triangle_holds(seed):
    rng = np.random.default_rng(seed)
    metric = pose_metric(rng.standard_normal(3), 0.7)
    a, b, c = (at(*rng.standard_normal(3), rng.standard_normal(3)) for _ in range(3))

    def d(x, y):
        return metric(x, y[None])[0]

    assert d(a, a) == pytest.approx(0.0, abs=1e-9)
    assert d(a, b) == pytest.approx(d(b, a))
    assert d(a, c) <= d(a, b) + d(b, c) + 1e-9
