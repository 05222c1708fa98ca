"""Samples that follow one another along a thread: what all that pass over the same helix sweep is looked at once.

On a nut, a turn brings each vertex to where the next one was. Over a path of many turns about one axis at one pitch,
all samples of equal radius and equal height over the thread sweep the same helix, each a stretch of it. So stretches
are gathered by helix and laid together. Helices that are near one another are looked at as one, in a tree: a ball on
the helix in the middle covers a piece of all of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from sashimono.geometry import se3
from sashimono.verify.body import morton_code

_LEAST_TURN = 2.0 * np.pi
"""A run that turns less [rad] is not worth it: no sample passes where another was."""
_FANOUT = 4
_SAME = 1e-6
"""Largest difference between stretches of one run: of directions, of pitches over the larger, of places over a size."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Helices:
    """Screws of long runs of a path, in the target's frame."""

    run: Int[np.ndarray, "stretch"]
    """By stretch: which run it belongs to; -1 if to none."""
    T_axis_target: Float[np.ndarray, "run 4 4"]
    """By run: to a frame whose z is the axis."""
    pitch: Float[np.ndarray, "run"]
    """By run: shift along the axis per turn by one radian [m]."""
    turn: Float[np.ndarray, "stretch"]
    """By stretch: turn about the run's axis [rad], with its sign."""

    def turned(self, run: int) -> tuple[float, float]:
        """Return the least and greatest turn from where a run begins [rad]."""
        so_far = np.append(0.0, np.cumsum(self.turn[self.run == run]))
        return float(so_far.min()), float(so_far.max())

    def times(self, run: int, turned: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Return when a run has turned as far from where it begins [rad], in stretches."""
        stretches = np.flatnonzero(self.run == run)
        turn = self.turn[stretches]
        middles = np.cumsum(turn) - 0.5 * turn
        beside = np.abs(turned[:, None] - middles) - 0.5 * np.abs(turn)
        k = np.maximum(beside, 0.0).argmin(axis=1)
        return stretches[k] + 0.5 + np.clip((turned - middles[k]) / turn[k], -0.5, 0.5)

    def invariants(
        self, run: int, points: Float[np.ndarray, "n 3"]
    ) -> tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n"]]:
        """Return of each point the helix that passes through it, radius and height [m], and where on it [rad]."""
        T, pitch = self.T_axis_target[run], float(self.pitch[run])
        x, y, z = se3.apply(T, points).T
        azimuth = np.arctan2(y, x)
        height = np.mod(z - pitch * azimuth, 2.0 * np.pi * abs(pitch))
        return np.stack([np.hypot(x, y), height], axis=1), (z - height) / pitch

    def points(self, run: int, helix: Float[np.ndarray, "n 2"], at: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 3"]:
        """Return the points of helices at these turns, in the target's frame."""
        pitch = float(self.pitch[run])
        points = np.stack([helix[:, 0] * np.cos(at), helix[:, 0] * np.sin(at), helix[:, 1] + pitch * at], axis=1)
        return se3.apply(se3.inverse(self.T_axis_target[run]), points)


def find_helices(
    axis: Float[np.ndarray, "stretch 3"],
    point: Float[np.ndarray, "stretch 3"],
    angle: Float[np.ndarray, "stretch"],
    shift: Float[np.ndarray, "stretch 3"],
    size: float,
) -> Helices | None:
    """Return the long runs of stretches that turn about one axis at one pitch; None if there is none.

    Args:
        axis: Unit direction by stretch, in the target's frame.
        point: A point on each axis [m].
        angle: Turn of each stretch [rad].
        shift: Shift of each stretch along its axis [m].
        size: Of what moves [m]: how far from the axis places are compared.
    """
    turning = np.abs(angle) > 1e-6
    pitch = np.divide(np.einsum("ij,ij->i", shift, axis), angle, out=np.zeros_like(angle), where=turning)
    run = np.full(len(angle), -1)
    turn, frames, pitches = angle.copy(), [], []
    start = 0
    while start < len(angle):
        stop = start + 1
        while stop < len(angle) and turning[start] and _is_same(start, stop, axis, point, turning, pitch, size):
            stop += 1
        if np.abs(angle[start:stop]).sum() >= _LEAST_TURN and abs(pitch[start]) > _SAME * size:
            run[start:stop] = len(frames)
            turn[start:stop] *= np.sign(axis[start:stop] @ axis[start])
            frames.append(_frame(axis[start], point[start]))
            pitches.append(pitch[start])
        start = stop
    if not frames:
        return None
    return Helices(run=run, T_axis_target=np.array(frames), pitch=np.array(pitches), turn=turn)


def _is_same(
    first: int, other: int, axis: np.ndarray, point: np.ndarray, turning: np.ndarray, pitch: np.ndarray, size: float
) -> bool:
    """Whether two stretches turn about the same line at the same pitch, the same way."""
    if not turning[other] or abs(pitch[first] - pitch[other]) > _SAME * abs(pitch[first]):
        return False
    apart = np.linalg.norm(np.cross(axis[first], axis[other]))
    off = np.linalg.norm(np.cross(axis[first], point[other] - point[first]))
    return bool(apart <= _SAME and off <= _SAME * size)


def _frame(axis: Float[np.ndarray, "3"], point: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    """Return the transform to a frame with its origin at the point and z along the axis."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    return se3.inverse(se3.make(np.stack([x, np.cross(axis, x), axis], axis=1), point))


def laid_together(
    helix: Float[np.ndarray, "n 2"], low: Float[np.ndarray, "n"], high: Float[np.ndarray, "n"], cell: float
) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m"], Float[np.ndarray, "m"]]:
    """Return the helices that stand for these, by cells of this side [m], and their stretches, joined where they meet.

    No helix is farther from the one that stands for it than the cell's half diagonal.
    """
    cells = np.floor(helix / cell).astype(np.int64)
    order = np.lexsort((low, cells[:, 1], cells[:, 0]))
    cells, low, high = cells[order], low[order], high[order]
    fresh = np.append(True, (np.diff(cells, axis=0) != 0).any(axis=1))
    # the farthest that any stretch of the same helix has got so far
    group = np.cumsum(fresh) - 1
    span = float(high.max() - low.min()) + 1.0
    farthest = np.maximum.accumulate(high + group * 2.0 * span) - group * 2.0 * span
    begins = fresh.copy()
    begins[1:] |= low[1:] > farthest[:-1]
    first = np.flatnonzero(begins)
    last = np.append(first[1:], len(low)) - 1
    return (cells[first] + 0.5) * cell, low[first], farthest[last]


@dataclass(frozen=True, kw_only=True, eq=False)
class HelixTree:
    """Stretches of helices, and ever larger groups of neighbouring ones, all in one list; the root is the last."""

    helix: Float[np.ndarray, "node 2"]
    """Radius and height of the one in the middle [m]."""
    reach: Float[np.ndarray, "node"]
    """How far from it the others are [m]."""
    low: Float[np.ndarray, "node"]
    """Where the first of them begins [rad]."""
    high: Float[np.ndarray, "node"]
    """Where the last of them ends [rad]."""
    first_child: Int[np.ndarray, "node"]
    """-1 for the leaves."""
    child_count: Int[np.ndarray, "node"]


def helix_tree(helix: Float[np.ndarray, "n 2"], low: Float[np.ndarray, "n"], high: Float[np.ndarray, "n"]) -> HelixTree:
    """Return a tree over stretches of helices: neighbours along a Morton curve, four at a time."""
    order = np.lexsort((low, morton_code(helix, 16)))
    levels = [(helix[order], np.zeros(len(order)), low[order], high[order])]
    first, count = [np.full(len(order), -1)], [np.zeros(len(order), np.int64)]
    boxes, offset = (helix[order], helix[order]), 0
    while len(levels[-1][0]) > 1:
        starts = np.arange(0, len(levels[-1][0]), _FANOUT)
        boxes = (np.minimum.reduceat(boxes[0], starts), np.maximum.reduceat(boxes[1], starts))
        reach = 0.5 * np.linalg.norm(boxes[1] - boxes[0], axis=1)
        begins, ends = np.minimum.reduceat(levels[-1][2], starts), np.maximum.reduceat(levels[-1][3], starts)
        first.append(starts + offset)
        count.append(np.diff(np.append(starts, len(levels[-1][0]))))
        offset += len(levels[-1][0])
        levels.append((0.5 * (boxes[0] + boxes[1]), reach, begins, ends))
    arrays = [np.concatenate(values) for values in zip(*levels, strict=True)]
    return HelixTree(
        helix=arrays[0],
        reach=arrays[1],
        low=arrays[2],
        high=arrays[3],
        first_child=np.concatenate(first),
        child_count=np.concatenate(count),
    )
