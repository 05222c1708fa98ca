"""Timing of paths: closed forms, limits kept, corners taken slowly."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from sashimono.assembly import Part
from sashimono.bodies import make_body
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.motion import SpeedLimits, TrajectoryConfig, time_path
from sashimono.plan import Segment

LIMITS = SpeedLimits(speed=0.25, acceleration=1.0, turn_speed=1.5, turn_acceleration=6.0)
CONFIG = TrajectoryConfig(transit=LIMITS, insertion=LIMITS, deviation=0.0)


@pytest.fixture(scope="module")
def block() -> Body:
    mesh = trimesh.creation.box((0.1, 0.1, 0.1))
    return make_body(
        Part(name="block", vertices_part=np.array(mesh.vertices), faces=np.array(mesh.faces), T_world_part=np.eye(4))
    )


def at(x: float, y: float = 0.0, turn: float = 0.0) -> np.ndarray:
    return se3.make(se3.exp_so3(np.array([0.0, 0.0, turn])), np.array([x, y, 0.0]))


def timed(poses: list[np.ndarray], body: Body, config: TrajectoryConfig = CONFIG, kind: str = "transit"):
    return time_path(np.array(poses), [Segment(kind=kind, start=0, stop=len(poses) - 1)], body, config)


def test_a_long_line_speeds_up_cruises_and_slows_down(block: Body) -> None:
    assert timed([at(0.0), at(1.0)], block).duration == pytest.approx(1.0 / 0.25 + 0.25 / 1.0)


def test_a_short_line_never_reaches_full_speed(block: Body) -> None:
    assert timed([at(0.0), at(0.01)], block).duration == pytest.approx(2.0 * np.sqrt(0.01))


def test_poses_on_a_line_cost_no_time(block: Body) -> None:
    line = timed([at(x) for x in np.linspace(0.0, 1.0, 12)], block)
    assert line.duration == pytest.approx(4.25)
    assert line.direction_changes == 0
    assert (np.diff(line.times) > 0.0).all()


def test_a_turn_alone_is_limited_by_its_own_speed(block: Body) -> None:
    quarter = timed([at(0.0), at(0.0, turn=np.pi / 2.0)], block)
    assert quarter.duration == pytest.approx(np.pi / 2.0 / 1.5 + 1.5 / 6.0)
    assert quarter.length == pytest.approx(0.0, abs=1e-12)
    assert quarter.turning == pytest.approx(np.pi / 2.0)


def test_a_square_corner_is_a_stop_and_one_that_may_be_rounded_is_faster(block: Body) -> None:
    corner = [at(0.0), at(0.5), at(0.5, 0.5)]
    stopped = timed(corner, block)
    assert stopped.times[1] == pytest.approx(0.5 / 0.25 + 0.25)
    assert stopped.duration == pytest.approx(2.0 * stopped.times[1])
    assert stopped.direction_changes == 1
    rounded = timed(corner, block, TrajectoryConfig(transit=LIMITS, insertion=LIMITS, deviation=0.01))
    assert 4.25 < rounded.duration < stopped.duration


def test_no_stretch_is_passed_faster_than_its_limits(block: Body) -> None:
    rng = np.random.default_rng(0)
    config = TrajectoryConfig(transit=LIMITS, insertion=LIMITS, deviation=0.05)
    for _ in range(20):
        poses = [at(0.0)]
        for _ in range(12):
            poses.append(poses[-1] @ se3.exp(rng.normal(0.0, 0.05, 6)))
        path = timed(poses, block, config)
        spent = np.diff(path.times)
        twists = np.array([se3.log(se3.inverse(a) @ b) for a, b in pairwise(poses)])
        ways = np.linalg.norm(twists[:, :3] + np.cross(twists[:, 3:], block.center), axis=1)
        turns = np.linalg.norm(twists[:, 3:], axis=1)
        assert (ways <= LIMITS.speed * spent * (1.0 + 1e-9)).all()
        assert (turns <= LIMITS.turn_speed * spent * (1.0 + 1e-9)).all()


def test_an_insertion_has_limits_of_its_own(block: Body) -> None:
    slow = TrajectoryConfig()
    line = [at(0.0), at(1.0)]
    assert timed(line, block, slow, "insertion").duration > 3.0 * timed(line, block, slow).duration


def test_a_path_that_stands_still_takes_no_time(block: Body) -> None:
    assert timed([at(0.0), at(0.0)], block).times.tolist() == [0.0, 0.0]
