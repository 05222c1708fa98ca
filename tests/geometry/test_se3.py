"""Rigid motions: inverses, exponentials and geodesics, near zero and near π."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sashimono.geometry import se3

TWISTS = hnp.arrays(np.float64, 6, elements=st.floats(-1.5, 1.5))


@given(TWISTS)
def test_log_inverts_exp(twist: np.ndarray) -> None:
    T = se3.exp(twist)
    assert se3.is_pose(T)
    np.testing.assert_allclose(se3.exp(se3.log(T)), T, atol=1e-9)


@given(TWISTS, TWISTS)
def test_inverse_and_composition(a: np.ndarray, b: np.ndarray) -> None:
    A, B = se3.exp(a), se3.exp(b)
    np.testing.assert_allclose(A @ se3.inverse(A), np.eye(4), atol=1e-12)
    np.testing.assert_allclose(se3.inverse(A @ B), se3.inverse(B) @ se3.inverse(A), atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-5, 1e-3, 1.0, np.pi - 1e-3, np.pi - 1e-6, np.pi - 1e-9, np.pi])
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (-1, 2, 0.5), (0.01, -1, 0.02)])
def test_log_near_zero_and_near_pi(angle: float, axis: tuple[float, float, float]) -> None:
    unit = np.array(axis, dtype=float) / np.linalg.norm(axis)
    R = se3.exp_so3(angle * unit)
    w = se3.log_so3(R)
    assert np.linalg.norm(w) == pytest.approx(angle, abs=2e-8)
    np.testing.assert_allclose(se3.exp_so3(w), R, atol=2e-8)


def test_interpolation_is_a_screw_motion() -> None:
    """A quarter turn about the z axis through (1, 0, 0) with a rise of 2: halfway is an eighth turn and a rise of 1."""
    center = se3.make(None, np.array([1.0, 0.0, 0.0]))
    turn = se3.make(se3.exp_so3(np.array([0.0, 0.0, np.pi / 2])), np.array([0.0, 0.0, 2.0]))
    end = center @ turn @ se3.inverse(center)
    half = se3.make(se3.exp_so3(np.array([0.0, 0.0, np.pi / 4])), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(se3.interpolate(np.eye(4), end, 0.5), center @ half @ se3.inverse(center), atol=1e-12)


@given(TWISTS, TWISTS, TWISTS, st.floats(0.0, 1.0))
def test_interpolation_does_not_depend_on_the_body_frame(a: np.ndarray, b: np.ndarray, c: np.ndarray, u: float) -> None:
    A, B, C = se3.exp(a), se3.exp(0.5 * b), se3.exp(c)
    moved = se3.interpolate(A @ C, A @ B @ C, u) @ se3.inverse(C)
    np.testing.assert_allclose(moved, se3.interpolate(A, A @ B, u), atol=1e-7)


@pytest.mark.parametrize(
    "broken", [np.diag([1.0, 1.0, -1.0, 1.0]), 1.1 * np.eye(4), np.full((4, 4), np.nan), np.eye(3)]
)
def test_is_pose_refuses_what_is_not_rigid(broken: np.ndarray) -> None:
    assert not se3.is_pose(broken)
