"""The legs of a path: straight stretches joined, screws with their turns, turns in place."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sashimono.geometry import se3
from sashimono.geometry.legs import Leg, main_leg, path_legs, simple_legs

UP = np.array([0.0, 0.0, 1.0])


def screw(axis: np.ndarray, point: np.ndarray, angle: float, shift: float) -> np.ndarray:
    """Return the displacement that turns about a line and shifts along it."""
    R = se3.exp_so3(axis * angle)
    return se3.make(R, point - R @ point + shift * axis)


def test_straight_stretches_along_one_line_are_one_leg() -> None:
    poses = np.array([se3.make(translation=np.array([0.0, 0.0, z])) for z in (0.03, 0.02, 0.005, 0.0)])
    (leg,) = path_legs(poses)
    assert leg.straight
    assert leg.direction == pytest.approx(-UP)
    assert leg.length == pytest.approx(0.03)


def test_a_bend_makes_two_legs() -> None:
    places = np.array([[0.0, 0.02, 0.016], [0.0, 0.0, 0.016], [0.0, 0.0, 0.0]])
    legs = path_legs(np.array([se3.make(translation=p) for p in places]))
    assert [leg.length for leg in legs] == pytest.approx([0.02, 0.016])
    assert legs[-1].direction == pytest.approx(-UP)


@pytest.mark.parametrize("pitch", [0.0007, -0.0007])
def test_turns_of_a_thread_are_counted_with_their_hand(pitch: float) -> None:
    point = np.array([0.1, -0.2, 0.0])
    start = screw(UP, np.array([0.3, 0.1, 0.2]), 0.4, 0.02)
    # down by four turns: a right-hand thread goes clockwise for who looks down on it
    quarter = screw(-UP, point, np.sign(pitch) * 0.5 * np.pi, abs(pitch) / 4.0)
    poses = [start]
    for _ in range(16):
        poses.append(quarter @ poses[-1])
    (leg,) = path_legs(np.array(poses))
    assert leg.turns == pytest.approx(4.0 * np.sign(pitch))
    assert leg.length == pytest.approx(4.0 * abs(pitch))
    assert leg.direction == pytest.approx(-UP)
    assert leg.point == pytest.approx(point)


def test_a_turn_in_place_has_no_length() -> None:
    D = screw(UP, np.array([0.05, 0.0, 0.0]), 0.5, 0.0)
    (leg,) = path_legs(np.array([np.eye(4), D]))
    assert leg.length == pytest.approx(0.0, abs=1e-12)
    assert abs(leg.turns) == pytest.approx(0.5 / (2.0 * np.pi))


def test_what_does_not_move_has_no_legs() -> None:
    assert path_legs(np.eye(4)[None]) == ()
    assert path_legs(np.array([np.eye(4), np.eye(4)])) == ()


@given(
    st.floats(-3.0, 3.0).filter(lambda angle: abs(angle) > 0.01),
    st.floats(-0.1, 0.1).filter(lambda shift: abs(shift) > 1e-4),
    st.lists(st.floats(-0.5, 0.5), min_size=3, max_size=3),
)
def test_moving_the_world_turns_directions_and_keeps_lengths_and_turns(
    angle: float, shift: float, place: list[float]
) -> None:
    poses = np.array([np.eye(4), screw(UP, np.array([0.1, 0.0, 0.0]), angle, shift)])
    T = se3.make(se3.exp_so3(np.array(place)), np.array(place[::-1]))
    (leg,), (moved,) = path_legs(poses), path_legs(T @ poses)
    assert moved.direction == pytest.approx(T[:3, :3] @ leg.direction, abs=1e-9)
    assert (moved.length, moved.turns) == pytest.approx((leg.length, leg.turns), abs=1e-9)


def leg(direction: tuple[float, float, float], length: float, turns: float = 0.0) -> Leg:
    return Leg(direction=np.array(direction), length=length, turns=turns, point=np.zeros(3))


def test_a_way_is_told_without_its_small_legs() -> None:
    down, nudge = leg((0.0, 0.0, -1.0), 0.02), leg((1.0, 0.0, 0.0), 1e-5)
    turn, back = leg((0.0, 0.0, 1.0), 1e-6, 0.04), leg((0.0, 0.0, -1.0), 0.0, -0.04)
    told = simple_legs((down, nudge, down, turn, back, turn))
    assert [(each.length, round(each.turns, 9)) for each in told] == [(pytest.approx(0.04), 0.0), (0.0, 0.12)]
    assert simple_legs(()) == ()
    assert simple_legs((nudge,)) == (nudge,)  # all there is


def test_the_main_leg_is_the_last_that_travels() -> None:
    across, down, turn = leg((1.0, 0.0, 0.0), 0.03), leg((0.0, 0.0, -1.0), 0.01), leg((0.0, 0.0, 1.0), 0.0, 0.25)
    assert main_leg((across, down, turn)) is down
    assert main_leg((turn,)) is turn
    assert main_leg(()) is None
