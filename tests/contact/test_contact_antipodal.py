"""Rays, surface samples, antipodal pairs."""

import numpy as np
import pytest
import trimesh

from sashimono.assembly import Part
from sashimono.bodies import make_body
from sashimono.contact.candidates import congruence, find_candidates
from sashimono.contact.config import ContactConfig
from sashimono.contact.gripper import GENERIC, proportionate_gripper
from sashimono.geometry import se3
from sashimono.geometry.distance.rays import cast_rays
from sashimono.geometry.distance.signed_distance import SignedDistance

TURNED = se3.exp(np.array([0.3, -0.2, 0.5, 0.4, 1.1, -0.7]))


def part_of(mesh, name="part", T=None):
    return Part(name=name, vertices_part=mesh.vertices, faces=mesh.faces, T_world_part=np.eye(4) if T is None else T)


def candidates_of(mesh, *, max_opening=10.0, config=None, seed=0):
    part = part_of(mesh)
    body = make_body(part)
    return find_candidates(
        part,
        body,
        gripper=GENERIC.scaled(max_opening),
        config=config or ContactConfig(),
        rng=np.random.default_rng(seed),
    )


def spans(candidates):
    return np.linalg.norm(candidates.pairs.points[:, 1] - candidates.pairs.points[:, 0], axis=1)


def brute_force(triangles, origin, direction, leaving):
    """Distance to the nearest face crossed the wanted way, by plane and half-plane tests on every triangle."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    along = normal @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((a - origin) * normal).sum(axis=1) / along
        hit = origin + t[:, None] * direction
    inside = np.ones(len(t), dtype=bool)
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= (np.cross(q - p, hit - p) * normal).sum(axis=1) >= 0.0
    inside &= (along > 0.0 if leaving else along < 0.0) & (t >= 0.0)
    return t[inside].min(initial=np.inf)


@pytest.mark.parametrize("side", ["entering", "leaving"])
def test_rays_against_brute_force(side):
    mesh = trimesh.creation.torus(2.0, 0.6, major_sections=24, minor_sections=12)
    rng = np.random.default_rng(1)
    origins = rng.uniform(-3.0, 3.0, (300, 3))
    directions = rng.normal(size=(300, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    surface = SignedDistance(mesh.vertices, mesh.faces)
    distances, normals = cast_rays(surface, origins, directions, side=side)
    expected = [brute_force(mesh.triangles, o, d, side == "leaving") for o, d in zip(origins, directions, strict=True)]
    assert np.isfinite(distances).sum() > 30
    np.testing.assert_allclose(distances, expected, atol=1e-9)
    facing = (normals * directions).sum(axis=1)[np.isfinite(distances)]
    assert (facing > 0.0).all() if side == "leaving" else (facing < 0.0).all()


def test_pairs_of_a_box_join_parallel_faces():
    candidates = candidates_of(trimesh.creation.box((1.0, 2.0, 3.0)))
    pairs = candidates.pairs
    assert len(candidates) >= 100
    # every point on the surface, every normal inward along an axis, the two opposite
    assert np.isclose(np.abs(pairs.points) / [0.5, 1.0, 1.5], 1.0).any(axis=2).all()
    assert (np.sort(np.abs(pairs.normals), axis=2) == [0.0, 0.0, 1.0]).all()
    np.testing.assert_allclose(pairs.normals[:, 0], -pairs.normals[:, 1], atol=1e-12)
    for width, axis in ((1.0, 0), (2.0, 1), (3.0, 2)):
        assert np.isclose(spans(candidates)[np.abs(pairs.normals[:, 0, axis]) > 0.5], width, rtol=0.03).any()


@pytest.mark.parametrize(("cone", "tangent"), [("coulomb", 0.2), ("printed", np.sqrt(0.2))])
def test_lines_lie_in_both_cones(cone, tangent):
    mesh = trimesh.creation.icosphere(subdivisions=2)
    pairs = candidates_of(mesh, config=ContactConfig(friction_cone=cone)).pairs
    cosines = [(pairs.lines * sign * pairs.normals[:, k]).sum(axis=1) for k, sign in ((0, 1.0), (1, -1.0))]
    angles = np.arccos(np.clip(cosines, -1.0, 1.0))
    assert len(pairs) > 50
    assert np.max(angles) <= np.arctan(tangent) + 1e-6
    assert np.max(angles) > 0.5 * np.arctan(tangent)


def test_narrow_faces_of_a_plate_are_found():
    candidates = candidates_of(trimesh.creation.box((2.0, 1.0, 0.005)))
    assert {round(float(span), 3) for span in spans(candidates)} >= {1.0, 2.0, 0.005}


def test_a_tube_is_held_by_its_wall_and_across():
    tube = trimesh.creation.annulus(r_min=0.8, r_max=1.0, height=1.0, sections=64)
    found = spans(candidates_of(tube))
    assert np.isclose(found, 0.2, atol=0.02).any()
    assert np.isclose(found, 2.0, atol=0.02).any()


def test_opening_limits_the_span():
    candidates = candidates_of(trimesh.creation.box((1.0, 2.0, 3.0)), max_opening=1.5)
    assert len(candidates) > 0
    assert spans(candidates).max() <= 1.5
    none = candidates_of(trimesh.creation.box((1.0, 2.0, 3.0)), max_opening=0.9)
    assert len(none) == 0
    assert none.pairs.narrowest == pytest.approx(1.0)


def test_candidates_are_distinct():
    config = ContactConfig(spread=0.2)
    mesh = trimesh.creation.cylinder(radius=0.5, height=2.0)
    points = candidates_of(mesh, config=config).pairs.points
    distance = 0.2 * np.linalg.norm([0.5, 1.0])
    for k in range(len(points)):
        for other in (points, points[:, ::-1]):
            gap = np.linalg.norm(other - points[k], axis=2).max(axis=1)
            gap[k] = np.inf
            assert gap.min() >= distance * (1.0 - 1e-9)


def test_same_seed_same_candidates():
    mesh = trimesh.creation.cylinder(radius=0.5, height=2.0)
    a, b, c = (candidates_of(mesh, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(a.pairs.points, b.pairs.points)
    assert a.pairs.points.shape != c.pairs.points.shape or not np.array_equal(a.pairs.points, c.pairs.points)


def test_candidates_turn_with_the_mesh():
    mesh = trimesh.creation.box((1.0, 2.0, 3.0))
    turned = mesh.copy()
    turned.apply_transform(TURNED)
    a, b = candidates_of(mesh), candidates_of(turned)
    best_a, best_b = a.ranked()[0], b.ranked()[0]
    assert a.quality(best_a[0]) == pytest.approx(b.quality(best_b[0]), rel=1e-3)


def test_identical_parts_share_by_a_rigid_motion():
    mesh = trimesh.creation.cylinder(radius=0.5, height=2.0, sections=12)
    turned = mesh.copy()
    turned.apply_transform(TURNED)
    first, second = part_of(mesh), part_of(turned)
    T = congruence(first, second)
    np.testing.assert_allclose(T, TURNED, atol=1e-9)
    candidates = candidates_of(mesh)
    moved = candidates.moved(T)
    np.testing.assert_allclose(moved.pairs.points[0], se3.apply(TURNED, candidates.pairs.points[0]), atol=1e-9)
    k = candidates.ranked()[0][0]
    assert candidates.quality(k) == pytest.approx(candidates.moved(T).quality(k))
    longer = trimesh.creation.cylinder(radius=0.5, height=2.1, sections=12)
    assert congruence(first, part_of(longer)) is None


def test_a_mirror_image_is_not_identical():
    mesh = trimesh.creation.cylinder(radius=0.5, height=2.0, sections=12)
    vertices = mesh.vertices + 0.3 * mesh.vertices[:, [1, 2, 0]] ** 2  # no symmetry left
    skewed = trimesh.Trimesh(vertices, mesh.faces, process=False)
    mirrored = trimesh.Trimesh(vertices * [1.0, 1.0, -1.0], mesh.faces, process=False)
    assert congruence(part_of(skewed), part_of(skewed)) is not None
    assert congruence(part_of(skewed), part_of(mirrored)) is None


def test_proportionate_gripper_spans_the_middle_extent():
    body = make_body(part_of(trimesh.creation.box((0.02, 0.3, 2.0))))
    gripper = proportionate_gripper(body)
    assert gripper.name == "auto"
    assert gripper.max_opening == pytest.approx(1.25 * 0.3)
    assert gripper.tip_reach <= 0.2 * 0.02 + 1e-12
