"""Distances and insides of the check's own hierarchy, against libigl's on the whole mesh."""

from __future__ import annotations

from pathlib import Path

import igl
import manifold3d
import numpy as np
import pytest
import trimesh

from sashimono.io.read import read_assembly
from sashimono.verify.body import SampledBody
from sashimono.verify.overlap import Excuse, OverlapPlace

EXAMPLE = Path(__file__).parents[2] / "src" / "sashimono" / "examples" / "gearbox.step"


def bodies() -> dict[str, SampledBody]:
    """A ball, a ring, a long needle, and the parts of the shipped example."""
    meshes = {
        "ball": trimesh.creation.icosphere(subdivisions=3),
        "ring": trimesh.creation.torus(1.0, 0.3, major_sections=40, minor_sections=16),
        "needle": trimesh.creation.cylinder(radius=1e-3, height=2.0, sections=7),
    }
    out = {name: SampledBody(name, mesh.vertices, mesh.faces, samples=500) for name, mesh in meshes.items()}
    for part in read_assembly(EXAMPLE).parts:
        out[part.name] = SampledBody(part.name, part.vertices_part, part.faces, samples=500)
    return out


BODIES = bodies()


def points_about(body: SampledBody) -> np.ndarray:
    """Points in and around the body, close to its surface, and on it."""
    rng = np.random.default_rng(5)
    around = rng.uniform(body.low - 0.2 * body.size, body.high + 0.2 * body.size, (1500, 3))
    leaves = body.tree.leaves
    return np.concatenate([around, leaves + 0.01 * body.size * rng.normal(size=leaves.shape), leaves])


@pytest.mark.parametrize("name", BODIES)
def test_distances_are_those_of_libigl(name: str) -> None:
    body = BODIES[name]
    points = points_about(body)
    tree = igl.AABB()
    tree.init(body.vertices, body.faces)
    squared = tree.squared_distance(body.vertices, body.faces, points)[0]
    found = body.distance(points)
    np.testing.assert_allclose(np.abs(found), np.sqrt(squared), atol=1e-12 * body.size)
    winding = igl.winding_number(body.vertices, body.faces, points)
    clear = np.abs(found) > 1e-9 * body.size
    np.testing.assert_array_equal((found < 0.0)[clear], (winding > 0.5)[clear])
    np.testing.assert_array_equal(body.contains(points)[clear], (winding > 0.5)[clear])


@pytest.mark.parametrize("name", BODIES)
def test_a_bound_changes_nothing_below_it(name: str) -> None:
    body = BODIES[name]
    points = points_about(body)
    exact = body.distance(points)
    for bound in (-0.02, 0.0, 0.005, 0.1):
        beyond = np.full(len(points), bound * body.size)
        bounded = body.distance(points, beyond)
        below = exact < beyond
        np.testing.assert_array_equal(bounded[below], exact[below])
        assert (bounded[~below] >= beyond[~below]).all()


@pytest.mark.parametrize("name", BODIES)
def test_no_point_of_a_triangle_is_farther_off_than_its_greatest_gap(name: str) -> None:
    body = BODIES[name]
    rng = np.random.default_rng(6)
    corners = rng.uniform(body.low, body.high, (300, 1, 3)) + 0.1 * body.size * rng.normal(size=(300, 3, 3))
    most = body.greatest_gap(corners)
    weights = rng.dirichlet((1.0, 1.0, 1.0), 200)
    points = np.einsum("nij,ki->nkj", corners, weights)
    gaps = body.gap(points.reshape(-1, 3)).reshape(300, 200)
    assert (gaps <= most[:, None] + 1e-12 * body.size).all()
    # a small triangle beside one face is bounded by its own distance
    face = body.vertices[body.faces[0]]
    normal = np.cross(face[1] - face[0], face[2] - face[0])
    normal /= np.linalg.norm(normal)
    beside = face.mean(axis=0) + 0.2 * (face - face.mean(axis=0)) + 1e-6 * body.size * normal
    assert body.greatest_gap(beside[None])[0] == pytest.approx(1e-6 * body.size, rel=1e-3)


def test_inside_is_right_where_a_surface_touches_itself() -> None:
    """Two blocks in one mesh, face on face: inside either is inside, whichever face is nearest."""
    first = trimesh.creation.box((1.0, 1.0, 1.0))
    second = trimesh.creation.box((1.0, 1.0, 1.0))
    second.apply_translation((1.0, 0.0, 0.0))
    both = trimesh.util.concatenate([first, second])
    body = SampledBody("both", both.vertices, both.faces, samples=500)
    points = np.random.default_rng(0).uniform((-0.8, -0.8, -0.8), (1.8, 0.8, 0.8), (4000, 3))
    inside = ((points > (-0.5, -0.5, -0.5)) & (points < (1.5, 0.5, 0.5))).all(axis=1)
    np.testing.assert_array_equal(body.contains(points), inside)


def test_rays_along_edges_and_through_corners_are_not_counted() -> None:
    """Points from which rays meet the corners of a cube exactly are told all the same."""
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    body = SampledBody("cube", cube.vertices, cube.faces, samples=500)
    rays = np.array([[0.5435, 0.2873, 0.7887], [-0.3711, 0.8329, -0.4106], [0.6127, -0.6611, -0.4331]])
    corner = np.ones(3)
    points = np.concatenate([corner - 0.5 * rays, corner + 0.5 * rays, -corner - 2.0 * rays])
    inside = (np.abs(points) < 1.0).all(axis=1)
    np.testing.assert_array_equal(body.contains(points), inside)


def test_what_an_excuse_takes_off_is_bounded_by_the_way_to_its_nearest_place() -> None:
    boxes = [trimesh.creation.box(extents=(2.0, 2.0, 2.0)).apply_translation((x, 0.0, 0.0)) for x in (0.0, 9.0)]
    places = [
        OverlapPlace(manifold3d.Manifold.cube((1.0, 1.0, 1.0)).translate((x, 0.0, 0.0)), least=1.0) for x in (0.0, 8.0)
    ]
    excuse = Excuse(depth=0.5, places=tuple(places))
    body = SampledBody("two", *joined(boxes), samples=300)
    rng = np.random.default_rng(3)
    nodes = rng.integers(0, len(body.tree.centers), 400)
    points, distances = body.tree.centers[nodes], rng.uniform(-4.0, 1.0, 400)
    room = np.max([place.reach - place.distance(points) for place in places], axis=0)
    expected = np.maximum(distances, np.minimum(distances + 0.5, room - 0.1))
    np.testing.assert_allclose(excuse.eased(points, distances, 0.1), expected)
    np.testing.assert_allclose(excuse.ease_fixed(body.tree, 0.1)(nodes, points, distances), expected)
    assert (expected > distances).any()
    assert (expected[distances < -3.0] < -2.0).any()


def joined(meshes: list[trimesh.Trimesh]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of several meshes as one."""
    whole = trimesh.util.concatenate(meshes)
    return np.array(whole.vertices), np.array(whole.faces)
