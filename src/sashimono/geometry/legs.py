"""A path in a few words: straight stretches, screws and turns, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3

_STRAIGHT = 1e-4
"""Turn between two poses below which they count as parallel [rad]."""
_FAR = 1e9
"""Larger numbers are no place of a part [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """One stretch of a path, along one direction."""

    direction: Float[np.ndarray, "3"]
    """Unit, world frame: the way of travel; of a turn in place, its axis by the right-hand rule."""
    length: float
    """Travel along the direction [m]; 0 for a turn in place."""
    turns: float
    """Whole turns about the direction by the right-hand rule: clockwise for who looks along it; 0 if straight."""
    point: Float[np.ndarray, "3"]
    """On the axis of a turn, nearest to the world's origin [m]; the origin if straight."""

    @property
    def straight(self) -> bool:
        """Whether it goes without a turn."""
        return self.turns == 0.0


def path_legs(poses: Float[np.ndarray, "pose 4 4"], *, bend: float = 0.02, small: float = 0.0) -> tuple[Leg, ...]:
    """Return the legs of a path whose poses are joined by geodesics; none where nothing moves, or a pose is not rigid.

    Args:
        poses: ``T_world_part``.
        bend: Neighbours whose directions differ by less than this [rad] are one leg.
        small: Straight legs shorter than this [m] are left out before neighbours are joined.
    """
    legs: list[Leg] = []
    if not _rigid(poses):
        return ()
    for a, b in pairwise(poses):
        leg = _leg(b @ se3.inverse(a))
        if leg is None or (leg.straight and leg.length < small):
            continue
        joined = _joined(legs[-1], leg, bend) if legs else None
        if joined is None:
            legs.append(leg)
        else:
            legs[-1] = joined
    return tuple(legs)


def main_leg(legs: Sequence[Leg], *, share: float = 0.1) -> Leg | None:
    """Return the last leg that travels at least this share of the whole way; the last if none does, None of none."""
    total = sum(leg.length for leg in legs)
    return next((leg for leg in reversed(legs) if leg.length >= share * total > 0.0), legs[-1] if legs else None)


def simple_legs(legs: Sequence[Leg], *, small: float = 0.02, bend: float = 0.4) -> tuple[Leg, ...]:
    """Return the legs as a person would tell them; a path found by contact has many small ones.

    Args:
        legs: As `path_legs` returns them.
        small: Travel below this share of the whole way is left out, and so is a turn below this share of a half turn.
        bend: Neighbours whose directions differ by less than this [rad] are one leg.
    """
    total = sum(leg.length for leg in legs)
    told: list[Leg] = []
    for leg in legs:
        if leg.length < small * total:
            leg = replace(leg, length=0.0)
        joined = _told_together(told[-1], leg, bend) if told else None
        if joined is not None:
            told[-1] = joined
        elif leg.length > 0.0 or leg.turns != 0.0:
            told.append(leg)
    kept = tuple(leg for leg in told if leg.length > 0.0 or abs(leg.turns) >= 0.5 * small)
    return kept or tuple(legs[-1:])


def _told_together(a: Leg, b: Leg, bend: float) -> Leg | None:
    """Both as one leg: straight ones along one another, turns in place about one axis, either way round."""
    along = float(a.direction @ b.direction)
    if a.straight and b.straight and along > np.cos(bend):
        total = a.length * a.direction + b.length * b.direction
        norm = float(np.linalg.norm(total))
        return a if norm == 0.0 else replace(a, direction=total / norm, length=a.length + b.length)
    if a.length == b.length == 0.0 and not a.straight and not b.straight and abs(along) > np.cos(bend):
        return replace(a, turns=a.turns + (b.turns if along > 0.0 else -b.turns))
    return None


def _rigid(poses: Float[np.ndarray, "pose 4 4"]) -> bool:
    if len(poses) == 0 or not np.abs(poses).max() < _FAR:
        return False
    R = poses[:, :3, :3]
    return bool(np.abs(R @ R.transpose(0, 2, 1) - np.eye(3)).max() < 1e-6 and (np.linalg.det(R) > 0.0).all())


def _leg(D: Float[np.ndarray, "4 4"]) -> Leg | None:
    """The screw of one displacement; None if it displaces nothing."""
    w, t = se3.log_so3(D[:3, :3]), D[:3, 3]
    angle = float(np.linalg.norm(w))
    if angle < _STRAIGHT:
        length = float(np.linalg.norm(t))
        if length < 1e-9:
            return None
        return Leg(direction=t / length, length=length, turns=0.0, point=np.zeros(3))
    axis = w / angle
    shift = float(axis @ t)
    # the displacement moves points of its axis along it only: (1 - R) p = t - shift axis, p at right angles to the axis
    p = np.linalg.lstsq(np.eye(3) - D[:3, :3], t - shift * axis, rcond=1e-9)[0]
    p = p - (p @ axis) * axis
    sign = -1.0 if shift < -1e-9 else 1.0
    return Leg(direction=sign * axis, length=abs(shift), turns=sign * angle / (2.0 * np.pi), point=p)


def _joined(a: Leg, b: Leg, bend: float) -> Leg | None:
    """Both as one leg; None if they are not along one another."""
    if a.straight and b.straight:
        total = a.length * a.direction + b.length * b.direction
        if a.direction @ b.direction < np.cos(bend):
            return None
        return replace(a, direction=total / np.linalg.norm(total), length=a.length + b.length)
    if a.straight or b.straight or a.direction @ b.direction < np.cos(bend) or a.turns * b.turns < 0.0:
        return None
    pitches = [leg.length / abs(leg.turns) for leg in (a, b)]
    apart = (b.point - a.point) - ((b.point - a.point) @ a.direction) * a.direction
    if abs(pitches[0] - pitches[1]) > 0.02 * max(pitches) + 1e-9 or np.linalg.norm(apart) > 0.05 * max(pitches) + 1e-5:
        return None
    return replace(a, length=a.length + b.length, turns=a.turns + b.turns)
