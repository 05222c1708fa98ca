"""Signed distance: against closed forms, against libigl, and what sphere tracing makes of it."""

import igl
import numpy as np
import pytest
from solids import box, part, rod

from sashimono.geometry import se3
from sashimono.geometry.distance.advancement import advance_straight
from sashimono.geometry.distance.signed_distance import SignedDistance


def surface(solid) -> tuple[SignedDistance, np.ndarray, np.ndarray]:
    p = part("p", solid)
    return SignedDistance(p.vertices_part, p.faces), p.vertices_part, p.faces


def test_box_distance_has_its_closed_form() -> None:
    tree, _, _ = surface(box((2.0, 4.0, 6.0)))
    points = np.random.default_rng(0).uniform(-5.0, 5.0, (2000, 3))
    q = np.abs(points) - [1.0, 2.0, 3.0]
    exact = np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
    np.testing.assert_allclose(tree.query(points), exact, atol=1e-12)


def test_agrees_with_libigl_on_a_concave_solid() -> None:
    solid = (box((0.06, 0.06, 0.02)) - rod(0.01, 0.04)) + rod(0.004, 0.05, (0.02, 0.02, 0.0))
    tree, vertices, faces = surface(solid)
    rng = np.random.default_rng(1)
    near = vertices[rng.integers(0, len(vertices), 1000)] + rng.normal(0.0, 1e-4, (1000, 3))
    points = np.concatenate([rng.uniform(-0.05, 0.05, (3000, 3)), near])
    expected = igl.signed_distance(points, vertices, faces.astype(np.int64), igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL)[0]
    np.testing.assert_allclose(tree.query(points), expected, atol=1e-12)


def test_depth_is_that_of_the_deepest_point() -> None:
    tree, _, _ = surface(box((2.0, 2.0, 2.0)))
    points = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0]])
    assert tree.depth(points, se3.make(None, np.array([0.7, 0.0, 0.0]))) == pytest.approx(0.3)
    assert tree.depth(points, se3.make(None, np.array([9.0, 0.0, 0.0]))) == 0.0


def test_march_stops_where_the_limit_is_passed() -> None:
    tree, _, _ = surface(box((2.0, 2.0, 2.0)))
    start, along = np.array([[-5.0, 0.0, 0.0]]), np.array([1.0, 0.0, 0.0])
    options = {"length": 20.0, "least_step": 1e-4}
    assert advance_straight(tree, start, along, limit=0.25, **options)[0] == pytest.approx(4.25, abs=2e-4)
    assert advance_straight(tree, start, along, limit=1.01, **options)[0] == np.inf
    assert advance_straight(tree, start, -along, limit=0.0, **options)[0] == np.inf
    assert advance_straight(tree, start, along, length=4.0, limit=0.25, least_step=1e-4)[0] == np.inf


def test_march_does_not_jump_a_thin_sheet() -> None:
    tree, _, _ = surface(box((1e-3, 1.0, 1.0)))
    start, along = np.array([[-0.7, 0.013, -0.2]]), np.array([1.0, 0.0, 0.0])
    assert advance_straight(tree, start, along, length=2.0, limit=1e-4, least_step=1e-4)[0] == pytest.approx(
        0.6996, abs=2e-4
    )


def test_slivers_divide_nothing_by_zero() -> None:
    """Faces with an edge too short for its square to count: the distance stays that of the box."""
    p = part("p", box((2.0, 2.0, 2.0)))
    corner = p.vertices_part[p.faces[0, 0]]
    twin = corner + np.array([1e-170, 0.0, 0.0])
    vertices = np.vstack([p.vertices_part, twin])
    sliver = [
        [p.faces[0, 0], len(p.vertices_part), p.faces[0, 1]],
        [p.faces[0, 1], len(p.vertices_part), p.faces[0, 0]],
    ]
    tree = SignedDistance(vertices, np.vstack([p.faces, sliver]).astype(np.int32))
    points = np.random.default_rng(2).uniform(-3.0, 3.0, (500, 3))
    q = np.abs(points) - 1.0
    exact = np.linalg.norm(np.maximum(q, 0.0), axis=1) + np.minimum(q.max(axis=1), 0.0)
    np.testing.assert_allclose(np.abs(tree.query(points)), np.abs(exact), atol=1e-12)


def test_march_slides_along_walls_of_a_hole() -> None:
    """Flush with the wall of a blind hole, a point goes to its bottom: however long, however finely faceted."""
    tree, _, _ = surface(box((4.0, 4.0, 10.0)) - rod(1.0, 8.0, (0.0, 0.0, 2.0)))
    turn = 2.0 * np.pi * np.arange(48) / 48
    rim = np.stack([np.cos(turn), np.sin(turn), np.full(48, 4.9)], axis=1)
    down = np.array([0.0, 0.0, -1.0])
    travel = advance_straight(tree, rim, down, length=20.0, limit=1e-3, least_step=1e-2)[0]
    assert travel == pytest.approx(6.9, abs=2e-2)
    through, _, _ = surface(box((4.0, 4.0, 10.0)) - rod(1.0, 12.0))
    assert advance_straight(through, rim, down, length=20.0, limit=1e-3, least_step=1e-2)[0] == np.inf


def test_what_runs_along_a_side_of_the_box_is_stopped_exactly_where_it_gets_too_deep() -> None:
    """Points on lines along and across a plate with a raised rim, in every depth about the limit."""
    solid = box((0.1, 0.08, 0.01)) + box((0.1, 0.005, 0.02), (0.0, 0.02, 0.005)) - rod(0.01, 0.05)
    tree, vertices, _ = surface(solid)
    rng = np.random.default_rng(3)
    limit, length = 5e-4, 0.3
    at = np.linspace(0.0, length, 6001)
    stopped = 0
    for _ in range(120):
        along = np.eye(3)[rng.integers(0, 2)] if rng.random() < 0.5 else rng.normal(size=3) * [1.0, 1.0, 0.02]
        along /= np.linalg.norm(along)
        height = rng.choice([vertices[:, 2].max(), vertices[:, 2].min(), 0.005]) + rng.uniform(-3.0, 3.0) * limit
        start = np.append(rng.uniform(-0.02, 0.02, 2), height) - 0.15 * along
        depths = -tree.query(start + at[:, None] * along)
        travel = advance_straight(tree, start[None], along, length=length, limit=limit, least_step=1e-6)[0]
        margin = 1e-6
        if depths.max() > limit + margin:
            first = at[np.argmax(depths > limit + margin)]
            assert travel <= first
            assert depths[at < travel - 1e-4].max() <= limit + margin
            stopped += 1
        elif depths.max() < limit - 1e-5:
            assert np.isinf(travel)
    assert 20 < stopped < 110
