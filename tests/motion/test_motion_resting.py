"""Stable poses, the table's normal and height, the tray: known answers."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from sashimono.assembly import Part
from sashimono.bodies import make_body
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.motion.config import RestingConfig, TableConfig, TrayConfig
from sashimono.motion.resting import resting_rotation, stable_poses
from sashimono.motion.table import choose_normal, frame, table_offset
from sashimono.motion.tray import lay_out

UP = np.array([0.0, 0.0, 1.0])


def body_of(mesh: trimesh.Trimesh, name: str = "part") -> Body:
    return make_body(
        Part(name=name, vertices_part=np.array(mesh.vertices), faces=np.array(mesh.faces), T_world_part=np.eye(4))
    )


def l_shape() -> trimesh.Trimesh:
    """A thin post at the end of a long foot: its mass centre stands over the foot, not over the post."""
    foot = trimesh.creation.box(bounds=[[0, 0, 0], [0.10, 0.02, 0.01]])
    post = trimesh.creation.box(bounds=[[0, 0, 0.01 - 1e-4], [0.01, 0.02, 0.05]])
    return trimesh.boolean.union([foot, post], engine="manifold")


def test_a_cube_stands_on_six_faces():
    poses = stable_poses(body_of(trimesh.creation.box((0.02, 0.02, 0.02))))
    assert len(poses) == 6
    for pose in poses:
        assert pose.tipping_angle == pytest.approx(np.pi / 4)
        assert pose.height == pytest.approx(0.01)
        assert np.sort(np.abs(pose.down_part)) == pytest.approx([0.0, 0.0, 1.0])


def test_an_l_stands_on_its_foot_and_not_on_the_top_of_its_post():
    poses = stable_poses(body_of(l_shape()))
    downs = np.array([pose.down_part for pose in poses])
    assert (downs @ [0, 0, -1] > 0.999).any()
    assert not (downs @ [0, 0, 1] > 0.999).any()
    assert (downs @ [-1, 0, 0] > 0.999).any(), "it also stands on the back of its post"


def test_a_sheet_that_is_bent_a_little_stands_on_one_of_its_halves():
    """0.02 mm thick, 1 mm long, bent by 0.0006 rad: less than what makes two faces, but it rests on one side only."""
    bend, thick = 0.0003, 2e-5
    profile = [(-1e-3, 1e-3 * bend), (0.0, 0.0), (4e-4, 4e-4 * bend), (4e-4, thick), (-1e-3, thick)]
    corners = [(x, y, z) for x, z in profile for y in (0.0, 8e-4)]
    body = body_of(trimesh.convex.convex_hull(np.array(corners)))
    for pose in stable_poses(body):
        heights = body.hull_points @ pose.down_part
        feet = body.hull_points[heights >= heights.max() - 0.005 * body.smallest_extent]
        across = np.linalg.svd(pose.down_part[None])[2][1:]
        sides = ConvexHull((feet - body.mass_center) @ across.T).equations
        assert (sides[:, 2] <= 0.0).all(), "its mass centre is over what touches the table"


def test_tipping_angle_of_a_brick_by_hand():
    poses = stable_poses(body_of(trimesh.creation.box((0.04, 0.02, 0.01))))
    assert np.allclose(np.abs(poses[0].down_part), [0, 0, 1])
    assert poses[0].margin == pytest.approx(0.01)
    assert poses[0].tipping_angle == pytest.approx(np.arctan2(0.01, 0.005))
    angles = [pose.tipping_angle for pose in poses]
    assert angles == sorted(angles, reverse=True)


def test_a_cylinder_prefers_its_ends_and_can_lie_if_it_must():
    disc = body_of(trimesh.creation.cylinder(radius=0.02, height=0.01, sections=64))
    assert np.allclose(np.abs(stable_poses(disc)[0].down_part), [0, 0, 1])
    lying = [pose for pose in stable_poses(disc) if abs(pose.down_part[2]) < 0.1]
    assert len(lying) == 64
    assert lying[0].tipping_angle == pytest.approx(np.pi / 64, rel=1e-3)


@pytest.mark.parametrize("offset", [0.0, 0.004])
def test_a_sphere_always_rests_somewhere(offset):
    sphere = trimesh.creation.icosphere(subdivisions=3, radius=0.01)
    sphere.apply_translation([offset, 0, 0])
    body = body_of(sphere)
    R, pose = resting_rotation(body, np.eye(3), UP, RestingConfig())
    assert pose.tipping_angle > 0.0
    assert R @ pose.down_part == pytest.approx(-UP, abs=1e-9)


def test_a_part_that_stands_as_assembled_is_not_turned():
    body = body_of(trimesh.creation.box((0.02, 0.02, 0.05)))
    R, _ = resting_rotation(body, np.eye(3), UP, RestingConfig())
    assert np.allclose(R, np.eye(3))
    tilted = se3.exp_so3(np.array([0.3, 0.1, 0.0]))
    R, pose = resting_rotation(body, tilted, UP, RestingConfig())
    assert R @ pose.down_part == pytest.approx(-UP, abs=1e-9)
    assert np.linalg.norm(se3.log_so3(R @ tilted.T)) < 0.4


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_the_mass_centre_stands_over_the_points_that_touch_the_table(seed):
    rng = np.random.default_rng(seed)
    body = body_of(trimesh.convex.convex_hull(rng.standard_normal((12, 3)) * 0.01))
    for pose in stable_poses(body):
        heights = (body.hull_points - body.mass_center) @ pose.down_part
        touching = body.hull_points[heights > heights.max() - 1e-9]
        assert len(touching) >= 3
        # the foot against the polygon of the touching corners, by another route
        foot = body.mass_center + pose.height * pose.down_part
        polygon = ConvexHull((touching - foot) @ frame(-pose.down_part)[:, :2])
        assert -polygon.equations[:, 2].max() == pytest.approx(pose.margin, abs=1e-9)


def test_plus_z_is_up_unless_parts_come_from_below():
    base = body_of(trimesh.creation.box((0.1, 0.1, 0.02)))
    up = {name: Removal.straight(UP, 1.0) for name in "abc"}
    down = {name: Removal.straight(-UP, 1.0) for name in "abc"}
    sides = {"a": Removal.straight(np.eye(3)[0], 1.0), "b": Removal.straight(-np.eye(3)[0], 1.0)}
    for removals, expected in ((up, UP), (down, -UP), (sides, UP), ({}, UP)):
        normal = choose_normal(base, np.eye(3), removals, TableConfig(), RestingConfig())
        assert normal == pytest.approx(expected)


def test_a_tilted_base_can_stand_on_its_own_face():
    tilt = se3.exp_so3(np.array([0.0, 0.5, 0.0]))
    base = body_of(trimesh.creation.box((0.1, 0.1, 0.02)))
    removals = {"a": Removal.straight(tilt @ UP, 1.0)}
    assert choose_normal(base, tilt, removals, TableConfig(), RestingConfig()) == pytest.approx(tilt @ UP)


def test_the_base_stands_on_the_table_unless_something_comes_lower():
    margins = {"a": 0.01, "b": 0.01}
    assert table_offset(0.0, {"a": 0.05, "b": 0.05}, {"a": 0.0, "b": 0.03}, margins) == 0.0
    assert table_offset(0.0, {"a": 0.05, "b": 0.05}, {"a": -0.05, "b": 0.03}, margins) == pytest.approx(-0.06)
    # slid in along the table: it must not scrape while it is carried there
    assert table_offset(0.0, {"a": 0.0, "b": 0.05}, {"a": 0.0, "b": 0.0}, margins) == pytest.approx(-0.01)


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda n: np.linalg.norm(n) > 0.1))
def test_the_table_frame_is_a_rotation(n):
    normal = np.array(n) / np.linalg.norm(n)
    R = frame(normal)
    assert np.allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert R[:, 2] == pytest.approx(normal)
    assert np.allclose(frame(UP), np.eye(3))


@given(st.lists(st.tuples(st.floats(0.001, 1.0), st.floats(0.001, 1.0)), min_size=0, max_size=40))
def test_no_two_footprints_overlap_and_the_work_area_stays_free(sizes):
    footprints = np.array(sizes).reshape(-1, 2)
    low, high = np.array([-0.2, -0.1]), np.array([0.3, 0.4])
    middles = lay_out(footprints, low, high, TrayConfig())
    assert len(middles) == len(footprints)
    lows, highs = middles - footprints / 2, middles + footprints / 2
    for i in range(len(footprints)):
        assert (lows[i] >= high - 1e-9).any() or (highs[i] <= low + 1e-9).any()
        for j in range(i):
            assert (lows[i] >= highs[j] - 1e-9).any() or (highs[i] <= lows[j] + 1e-9).any()


def test_resting_probabilities_are_those_of_an_independent_library():
    rng = np.random.default_rng(4)
    for _ in range(6):
        mesh = trimesh.convex.convex_hull(rng.normal(size=(12, 3)) * [0.03, 0.02, 0.01])
        got = sorted((pose.probability for pose in stable_poses(body_of(mesh))), reverse=True)
        _, expected = trimesh.poses.compute_stable_poses(mesh, n_samples=1)
        assert sum(got) == pytest.approx(1.0)
        assert got[:4] == pytest.approx(sorted(expected, reverse=True)[:4], abs=1e-6)
