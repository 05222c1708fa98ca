"""When a part is where: a path timed within limits of speed and acceleration.

Along each geodesic the part speeds up, keeps its speed and slows down. Corners are taken by the rule of CNC
controllers (junction deviation): as fast as a circle may be run that leaves the corner by ``deviation`` at most, so a
sharp one nearly at rest and a straight one at full speed. Speeds are limited forwards, then backwards.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.motion.config import TrajectoryConfig
from sashimono.plan import Segment

_STANDS = 1e-12


@dataclass(frozen=True, kw_only=True, eq=False)
class Trajectory:
    """A timed path."""

    times: Float[np.ndarray, "pose"]
    """When the part is at each pose [s], from 0."""
    length: float
    """Way of the part's centre [m]."""
    turning: float
    """Sum of all rotation [rad]."""
    direction_changes: int
    """Corners sharper than `TrajectoryConfig.corner`."""

    @property
    def duration(self) -> float:
        """Time from the first pose to the last [s]."""
        return float(self.times[-1])

    def evidence(self) -> dict[str, float | int]:
        """Return the figures that a plan's step states."""
        return {
            "duration": self.duration,
            "path_length": self.length,
            "turning": self.turning,
            "direction_changes": self.direction_changes,
        }


def time_path(
    poses: Float[np.ndarray, "pose 4 4"], segments: Sequence[Segment], body: Body, config: TrajectoryConfig
) -> Trajectory:
    """Return when the part is at each pose of a path, at rest at both ends.

    Speeds are those of the part's centre and of its rotation. What the centre's way along one geodesic bends (a turn
    about an axis beside it) is not limited beyond that.

    Args:
        poses: Joined by geodesics.
        segments: Which of them are transit, which insertion.
        body: The part; corners weigh its rotation by its radius.
        config: Limits.
    """
    twists = np.array([se3.log(se3.inverse(a) @ b) for a, b in pairwise(poses)]).reshape(-1, 6)
    # the centre's velocity, seen from the part, is the same all along a geodesic
    shifts = twists[:, :3] + np.cross(twists[:, 3:], body.center)
    ways, turns = np.linalg.norm(shifts, axis=1), np.linalg.norm(twists[:, 3:], axis=1)
    inserting = np.zeros(len(twists), dtype=np.bool_)
    for segment in segments:
        inserting[segment.start : segment.stop] = segment.kind == "insertion"
    tangents = np.concatenate([shifts, body.radius * twists[:, 3:]], axis=1)
    lengths = np.linalg.norm(tangents, axis=1)
    moves = lengths > _STANDS * body.radius
    tangents = tangents / np.where(moves, lengths, 1.0)[:, None]
    speeds, accelerations = np.zeros(len(twists)), np.zeros(len(twists))
    for rows, limits in ((~inserting, config.transit), (inserting, config.insertion)):
        for out, most, most_turn in (
            (speeds, limits.speed, limits.turn_speed),
            (accelerations, limits.acceleration, limits.turn_acceleration),
        ):
            with np.errstate(divide="ignore", invalid="ignore"):  # what goes nowhere is left out below
                out[rows] = lengths[rows] * np.minimum(most / ways[rows], most_turn / turns[rows])
    kept = np.flatnonzero(moves)
    spent = np.zeros(len(twists))
    cosines = (tangents[kept][:-1] * tangents[kept][1:]).sum(axis=1)
    corners = _corner_speeds(cosines, accelerations[kept], body.radius * config.deviation)
    spent[kept] = _durations(lengths[kept], speeds[kept], accelerations[kept], corners)
    return Trajectory(
        times=np.concatenate([[0.0], np.cumsum(spent)]),
        length=float(ways.sum()),
        turning=float(turns.sum()),
        direction_changes=int((cosines < np.cos(config.corner)).sum()),
    )


def _corner_speeds(cosines: np.ndarray, accelerations: np.ndarray, deviation: float) -> np.ndarray:
    """Return the speed at each corner: sqrt(a r) on the circle of radius r that stays within the deviation."""
    if not len(cosines):
        return np.zeros(0)
    # the half angle between the way in, reversed, and the way out
    sine = np.sqrt(np.clip((1.0 + cosines) / 2.0, 0.0, 1.0))
    with np.errstate(divide="ignore"):
        radius = np.where(sine > 1.0 - 1e-9, np.inf, deviation * sine / np.maximum(1.0 - sine, 1e-300))
    return np.sqrt(np.minimum(accelerations[:-1], accelerations[1:]) * radius)


def _durations(lengths: np.ndarray, speeds: np.ndarray, accelerations: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the time that each stretch takes, within its speed, its acceleration and the speeds at its corners."""
    if not len(lengths):
        return np.zeros(0)
    ends = np.concatenate([[0.0], np.minimum(corners, np.minimum(speeds[:-1], speeds[1:])), [0.0]])
    gain = 2.0 * accelerations * lengths
    for k in range(len(lengths)):
        ends[k + 1] = min(ends[k + 1], np.sqrt(ends[k] ** 2 + gain[k]))
    for k in range(len(lengths) - 1, -1, -1):
        ends[k] = min(ends[k], np.sqrt(ends[k + 1] ** 2 + gain[k]))
    first, last = ends[:-1], ends[1:]
    peak = np.minimum(speeds, np.sqrt((first**2 + last**2 + gain) / 2.0))
    ramps = (2.0 * peak**2 - first**2 - last**2) / (2.0 * accelerations)
    cruise = np.maximum(lengths - ramps, 0.0) / peak
    return (2.0 * peak - first - last) / accelerations + cruise
