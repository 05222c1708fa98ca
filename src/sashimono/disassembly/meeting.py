"""Which lattice points decide whether a part meets an obstacle: few, and all that matter."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Int

from sashimono.disassembly.flood import Scene

_BLOCK = 4
"""Lattice points along a block: what decides which points can meet need not be finer."""
_CANDIDATES = 16
"""Points looked at for each that is kept."""


class SceneBuilder:
    """Takes in obstacles one by one and keeps, of each pair, the side with fewer points that can meet at all.

    A small screw in a wide lid is told by the screw's points; sampled evenly, the lid's would miss it.
    """

    def __init__(
        self, solid: Bool[np.ndarray, "x y z"], displacements: Int[np.ndarray, "3"], *, max_points: int
    ) -> None:
        """Take in the part's lattice points and the shape of the lattice of displacements."""
        self._solid = solid
        self._reach = displacements - 1
        self._most = max_points
        self._table: np.ndarray | None = None
        self._own = shell(solid)
        self._low, self._high = self._own.min(axis=0), self._own.max(axis=0)
        self._owners = np.zeros(tuple(np.array(solid.shape) + self._reach), np.int64)
        self._points: list[np.ndarray] = []
        self._is_own: list[bool] = []
        self._boxes: list[np.ndarray] = []

    def add(self, drawn: Bool[np.ndarray, "x y z"], first: Int[np.ndarray, "3"]) -> None:
        """Add the next obstacle: its lattice points, drawn from this corner of the common lattice on."""
        bit = len(self._points)
        theirs = shell(drawn) + first
        own = self._own
        box = np.array([[1, 1, 1], [0, 0, 0]])
        is_own = True
        if len(theirs):
            last = first + drawn.shape
            view = self._owners[first[0] : last[0], first[1] : last[1], first[2] : last[2]]
            view[drawn] |= 1 << bit
            box = np.stack([theirs.min(axis=0) - self._high, theirs.max(axis=0) - self._low])
            own = _within(own, theirs.min(axis=0) - self._reach, theirs.max(axis=0))
            theirs = _within(theirs, self._low, self._high + self._reach)
            if min(len(own), len(theirs)) > self._most:
                own, theirs = _thinned(own, _CANDIDATES * self._most), _thinned(theirs, _CANDIDATES * self._most)
                own = own[_any_within(_summed(drawn), own - first, own - first + self._reach)]
                self._table = _summed(self._solid) if self._table is None else self._table
                theirs = theirs[_any_within(self._table, theirs - self._reach, theirs)]
            is_own = len(own) <= len(theirs)
        self._points.append(_thinned(own if is_own and len(theirs) else theirs, self._most))
        self._is_own.append(is_own)
        self._boxes.append(box)

    def finished(self) -> Scene:
        """Return the scene of all obstacles added, by bit in their order."""
        return Scene(
            points=np.concatenate([np.zeros((0, 3), np.int64), *self._points]).astype(np.int32),
            start=np.cumsum([0, *(len(points) for points in self._points)]),
            is_own=np.array(self._is_own, np.bool_),
            boxes=np.array(self._boxes, np.int64).reshape(-1, 2, 3),
            owners=self._owners,
            solid=self._solid,
        )


def shell(solid: Bool[np.ndarray, "x y z"]) -> Int[np.ndarray, "point 3"]:
    """Return the lattice points of a solid that have one of their six neighbours outside it."""
    if not solid.size:
        return np.zeros((0, 3), np.int64)
    out = solid.copy()
    inner = solid[1:-1, 1:-1, 1:-1]
    inner = inner & solid[:-2, 1:-1, 1:-1] & solid[2:, 1:-1, 1:-1] & solid[1:-1, :-2, 1:-1]
    inner &= solid[1:-1, 2:, 1:-1] & solid[1:-1, 1:-1, :-2] & solid[1:-1, 1:-1, 2:]
    out[1:-1, 1:-1, 1:-1] &= ~inner
    return np.argwhere(out)


def _within(
    points: Int[np.ndarray, "point 3"], low: Int[np.ndarray, "3"], high: Int[np.ndarray, "3"]
) -> Int[np.ndarray, "_ 3"]:
    return points[((points >= low) & (points <= high)).all(axis=1)]


def _summed(solid: Bool[np.ndarray, "x y z"]) -> Int[np.ndarray, "x1 y1 z1"]:
    """How many blocks of lattice points that hold one of a solid come before each block along all three axes."""
    blocks = solid
    for axis in range(3):
        blocks = np.logical_or.reduceat(blocks, np.arange(0, blocks.shape[axis], _BLOCK), axis=axis)
    table = np.zeros(tuple(n + 1 for n in blocks.shape), np.int32)
    table[1:, 1:, 1:] = blocks.cumsum(axis=0, dtype=np.int32).cumsum(axis=1).cumsum(axis=2)
    return table


def _any_within(
    table: Int[np.ndarray, "x1 y1 z1"], low: Int[np.ndarray, "box 3"], high: Int[np.ndarray, "box 3"]
) -> Bool[np.ndarray, "box"]:
    """Whether a solid, by its summed table, may have a point in each box, both ends included; to the block."""
    shape = np.array(table.shape) - 1
    ends = np.stack([np.clip(low // _BLOCK, 0, shape), np.clip(high // _BLOCK + 1, 0, shape)])
    total = np.zeros(len(low), np.int64)
    for corner in np.ndindex(2, 2, 2):
        x, y, z = (ends[side, :, axis] for axis, side in enumerate(corner))
        total += (-1) ** (3 - sum(corner)) * table[x, y, z].astype(np.int64)
    return total > 0


def _thinned(points: Int[np.ndarray, "point 3"], most: int) -> Int[np.ndarray, "_ 3"]:
    """Evenly many of the points, at most so many."""
    return points if len(points) <= most else points[np.linspace(0, len(points) - 1, most).astype(int)]
