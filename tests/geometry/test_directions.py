"""Directions are read off faces, holes and inertia, exactly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from solids import box, part, rod

from sashimono.geometry import se3
from sashimono.geometry.features.directions import (
    DirectionConfig,
    frame_along,
    inertia_directions,
    merge_directions,
    part_directions,
    sphere_directions,
)
from sashimono.geometry.mesh.measures import mass_properties

CONFIG = DirectionConfig()


def lines_of(solid) -> np.ndarray:
    p = part("p", solid)
    return part_directions(p.vertices_part, p.faces, config=CONFIG)[0]


def has(lines: np.ndarray, direction: np.ndarray) -> bool:
    return bool((np.abs(lines @ direction) > 1.0 - 1e-12).any())


def test_a_tilted_hole_gives_its_axis_exactly() -> None:
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    drill = rod(0.004, 0.2).transform(se3.make(frame_along(axis).T)[:3])
    assert has(lines_of(box((0.1, 0.1, 0.1)) - drill), axis)


def test_a_box_gives_its_face_normals_only() -> None:
    R = se3.exp_so3(np.array([0.3, -0.2, 0.5]))
    lines = lines_of(box((0.1, 0.2, 0.3)).transform(se3.make(R)[:3]))
    assert len(lines) == 3
    assert all(has(lines, R[:, k]) for k in range(3))


def test_inertia_axes_of_a_symmetric_part_are_left_out() -> None:
    p = part("p", rod(0.01, 0.1, segments=64))
    axes = inertia_directions(mass_properties(p.vertices_part, p.faces).inertia, config=CONFIG)
    assert len(axes) == 1
    assert abs(axes[0, 2]) == pytest.approx(1.0, abs=1e-9)


def test_near_directions_are_merged_by_dropping_the_lighter() -> None:
    heavy, light = np.array([0.0, 0.0, 1.0]), np.array([np.sin(1e-3), 0.0, np.cos(1e-3)])
    lines = merge_directions([(np.stack([light, heavy]), np.array([1.0, 2.0]))], config=CONFIG)
    np.testing.assert_array_equal(lines, [heavy])


@given(st.integers(0, 10_000))
def test_frame_is_right_handed_with_the_direction_last(seed: int) -> None:
    d = np.random.default_rng(seed).normal(size=3)
    d /= np.linalg.norm(d)
    R = frame_along(d)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_array_equal(R[2], d)


def test_sphere_directions_are_even() -> None:
    points = sphere_directions(1000)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0)
    cosines = points @ points.T - 2.0 * np.eye(1000)
    nearest = np.degrees(np.arccos(cosines.max(axis=1)))
    assert nearest.min() > 2.5
    assert nearest.max() < 7.5
