"""Measures, topology and identical shapes: known answers and invariants."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

from sashimono.geometry import se3
from sashimono.geometry.mesh import measures, polygons, topology
from sashimono.geometry.mesh.shapes import identical_shapes
from sashimono.verify.body import SampledBody as VerifyBody


def arrays(solid: Manifold) -> tuple[np.ndarray, np.ndarray]:
    out = solid.to_mesh64()
    return np.array(out.vert_properties[:, :3]), np.array(out.tri_verts).astype(np.int64)


def box(x: float = 1.0, y: float = 2.0, z: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    return arrays(Manifold.cube([x, y, z]))


def bracket() -> tuple[np.ndarray, np.ndarray]:
    """A chiral part: an L with a hole off its middle."""
    solid = Manifold.cube([4.0, 1.0, 2.0]) + Manifold.cube([1.0, 3.0, 2.0])
    return arrays(solid - Manifold.cylinder(5.0, 0.3, circular_segments=12).translate([3.0, 0.6, -1.0]))


def poses() -> st.SearchStrategy[np.ndarray]:
    numbers = st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6)
    return numbers.map(lambda x: se3.exp(np.array(x)))


def test_box_measures():
    vertices, faces = box()
    mass = measures.mass_properties(vertices, faces)
    assert mass.volume == pytest.approx(6.0)
    assert measures.area(vertices, faces) == pytest.approx(22.0)
    np.testing.assert_allclose(mass.center, [0.5, 1.0, 1.5])
    np.testing.assert_allclose(mass.inertia, np.diag([6.5, 5.0, 2.5]), atol=1e-12)
    np.testing.assert_allclose(mass.moments, [2.5, 5.0, 6.5])
    np.testing.assert_allclose(measures.inertia_extents(vertices, faces), [3.0, 2.0, 1.0])
    assert measures.smallest_extent(vertices, faces) == pytest.approx(1.0)
    assert measures.radius(vertices, mass.center) == pytest.approx(np.sqrt(14.0) / 2.0)
    assert measures.volume(vertices, faces[:, ::-1]) == pytest.approx(-6.0)


@settings(max_examples=30, deadline=None)
@given(T=poses())
def test_measures_move_with_the_mesh(T):
    vertices, faces = bracket()
    still, moved = measures.mass_properties(vertices, faces), measures.mass_properties(se3.apply(T, vertices), faces)
    assert moved.volume == pytest.approx(still.volume)
    np.testing.assert_allclose(moved.center, se3.apply(T, still.center[None])[0], atol=1e-9)
    np.testing.assert_allclose(moved.inertia, T[:3, :3] @ still.inertia @ T[:3, :3].T, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(moved.axes), 1.0)
    extents = measures.inertia_extents(se3.apply(T, vertices), faces)
    np.testing.assert_allclose(extents, measures.inertia_extents(vertices, faces), atol=1e-9)


def test_surface_samples_lie_on_the_surface_evenly():
    vertices, faces = box()
    points, normals, chosen = measures.sample_surface(vertices, faces, 2200, np.random.default_rng(5))
    again, _, _ = measures.sample_surface(vertices, faces, 2200, np.random.default_rng(5))
    np.testing.assert_array_equal(points, again)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    offsets = np.einsum("ij,ij->i", normals, points - vertices[faces[chosen, 0]])
    np.testing.assert_allclose(offsets, 0.0, atol=1e-12)
    assert (np.einsum("ij,ij->i", normals, points - [0.5, 1.0, 1.5]) > 0.0).all(), "normals point outward"
    on_top = normals[:, 2] > 0.9
    assert abs(on_top.sum() - 200) <= 4


def test_winding_number_inside_outside_and_on_inward_surface():
    vertices, faces = box()
    points = np.array([[0.5, 1.0, 1.5], [5.0, 0.0, 0.0]])
    np.testing.assert_allclose(measures.winding_numbers(points, vertices, faces), [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(measures.winding_numbers(points, vertices, faces[:, ::-1]), [-1.0, 0.0], atol=1e-12)


def test_concave_polygon_is_covered_once():
    corners = np.array([[0, 0], [4, 0], [4, 4], [2, 1], [0, 4]], dtype=float)
    vertices = np.column_stack([corners, np.ones(5)]) @ Rotation.from_rotvec([0.3, 0.5, 0.1]).as_matrix().T
    for order in (np.arange(5), np.arange(5)[::-1], np.roll(np.arange(5), 2)):
        triangles = polygons.triangulate(vertices, [order.tolist()])
        assert len(triangles) == 3
        assert measures.area(vertices, triangles) == pytest.approx(10.0)
        normal = polygons.polygon_normal(vertices[order])
        assert (measures.triangle_cross(vertices, triangles) @ normal > 0.0).all()


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_winding_is_unified_whatever_was_turned(seed):
    vertices, faces = bracket()
    turned = np.random.default_rng(seed).random(len(faces)) < 0.3
    mixed = faces.copy()
    mixed[turned] = mixed[turned][:, ::-1]
    unified, reverse = topology.unify_winding(mixed)
    assert topology.is_closed(unified)
    assert abs(measures.volume(vertices, unified)) == pytest.approx(measures.volume(vertices, faces))
    assert reverse.sum() == min(turned.sum(), len(faces) - turned.sum())


def test_shells_of_a_hollow_ball_in_a_hollow_box():
    hollow = Manifold.cube([10.0] * 3, True) - Manifold.cube([8.0] * 3, True)
    ball = Manifold.sphere(3.0, 16) - Manifold.sphere(2.0, 16)
    vertices, faces = arrays(hollow + ball)
    nest = topology.nesting(vertices, faces)
    assert sorted(nest.inside.sum(axis=1)) == [0, 1, 2, 3]
    assert sorted(np.sign(nest.volumes)) == [-1, -1, 1, 1]
    assert topology.bodies(nest).max() == 1
    inverted = faces[:, ::-1]
    again, turned = topology.orient_outward(topology.nesting(vertices, inverted), inverted, np.zeros(len(faces), bool))
    assert turned == 4
    np.testing.assert_array_equal(again, faces)


def test_solids_written_one_after_another_come_apart_where_they_touch():
    vertices, faces = box(1.0, 1.0, 1.0)
    both = np.vstack([vertices, vertices + np.array([1.0, 0.0, 0.0])])
    solids = topology.split_solids(both, np.vstack([faces, faces + 8]))
    assert [measures.volume(both, s) for s in solids] == pytest.approx([1.0, 1.0])


@settings(max_examples=25, deadline=None)
@given(T=poses(), seed=st.integers(0, 2**32 - 1))
def test_a_moved_and_shuffled_copy_is_identical_and_a_mirrored_one_is_not(T, seed):
    vertices, faces = bracket()
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(vertices))
    shuffled = np.argsort(order)[faces][rng.permutation(len(faces))]
    mirrored = vertices * [-1.0, 1.0, 1.0]
    found = identical_shapes([
        (vertices, faces),
        (se3.apply(T, mirrored), faces[:, ::-1]),
        (se3.apply(T, vertices), faces),
        (se3.apply(T, vertices[order]), shuffled),
        (mirrored[order], shuffled[:, ::-1]),
    ])  # fmt: skip
    assert found == ((0, 2, 3), (1, 4)), "original, moved, shuffled; the mirrored ones"


def test_symmetric_shapes_and_near_copies():
    ball = arrays(Manifold.sphere(2.0, 24))
    rod = arrays(Manifold.cylinder(5.0, 1.0, circular_segments=32))
    T = se3.exp(np.array([1.0, 2.0, 3.0, 0.4, 0.5, 0.6]))
    rng = np.random.default_rng(0)
    meshes = []
    for vertices, faces in (ball, rod):
        order = rng.permutation(len(vertices))
        meshes += [(vertices, faces), (se3.apply(T, vertices[order]), np.argsort(order)[faces])]
    longer = rod[0] * [1.0, 1.0, 1.002]
    assert identical_shapes([*meshes, (longer, rod[1])]) == ((0, 1), (2, 3))


@settings(max_examples=30, deadline=None)
@given(T=poses(), sides=st.sampled_from([3, 4, 5, 6, 8, 32]), height=st.sampled_from([0.2, 1.0, 3.0]))
def test_extents_do_not_depend_on_how_a_symmetric_part_lies(T, sides, height):
    """Equal moments leave the inertia axes to rounding; the tolerances of a plan must not."""
    vertices, faces = arrays(Manifold.cylinder(height, 1.0, 1.0, sides))
    turned = se3.apply(T, vertices)
    still, moved = measures.inertia_extents(vertices, faces), measures.inertia_extents(turned, faces)
    np.testing.assert_allclose(np.sort(moved), np.sort(still), rtol=1e-6)
    seen = VerifyBody("prism", turned, faces, samples=100).smallest_extent
    assert seen == pytest.approx(VerifyBody("prism", vertices, faces, samples=100).smallest_extent, rel=1e-6)
    assert seen == pytest.approx(still.min(), rel=1e-6)


@settings(max_examples=10, deadline=None)
@given(T=poses())
def test_extents_of_a_cube_are_its_sides(T):
    vertices, faces = box()
    cube = vertices / [1.0, 2.0, 3.0]
    np.testing.assert_allclose(measures.inertia_extents(se3.apply(T, cube), faces), [1.0, 1.0, 1.0], rtol=1e-6)
