"""Which lattice points decide whether a part meets an obstacle: few, and all that matter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int
from numba import njit

from sashimono.disassembly.translation.lattice_flood import LatticeScene

_BLOCK = 4
"""Lattice points along a block: what decides which points can meet need not be finer."""
_CANDIDATES = 16
"""Points looked at for each that is kept."""


class Drawn(NamedTuple):
    """Some of a solid's lattice points: a box of the lattice, with a layer around that is there for its shell only."""

    solid: Bool[np.ndarray, "x y z"]
    first: Int[np.ndarray, "3"]
    """The lattice point of the box's first corner."""
    rim: Int[np.ndarray, "point 3"] | None = None
    """The solid's `shell`, from that corner, if somebody worked it out."""

    @property
    def shell(self) -> Int[np.ndarray, "point 3"]:
        """The points, but those of the outermost layer, that have one of their six neighbours outside the solid."""
        return (shell(self.solid) if self.rim is None else self.rim) + self.first


class LatticeSceneBuilder:
    """Takes in obstacles as they are drawn and keeps, of each pair, the side with fewer points that can meet at all.

    A small screw in a wide lid is told by the screw's points; sampled evenly, the lid's would miss it.
    """

    def __init__(self, displacements: Int[np.ndarray, "3"], count: int, *, max_points: int) -> None:
        """Take in the shape of the lattice of displacements, and how many obstacles there are."""
        self._reach = displacements - 1
        self._most = max_points
        self._points = [np.zeros((0, 3), np.int64)] * count
        self._is_own = [True] * count
        self._boxes = [np.array([[1, 1, 1], [0, 0, 0]])] * count
        self._grids: list[Drawn | None] = [None] * count

    def put(self, bit: int, part: Drawn, obstacle: Drawn) -> None:
        """Put in an obstacle: where it and the part can meet, of both. One that is not put in is met nowhere.

        The obstacle's points are counted from the corner of the lattice that the part's corner is on when it is moved
        to the first displacement.
        """
        own, theirs = part.shell, obstacle.shell
        if not len(own) or not len(theirs):
            return
        (low, high), (first, last) = _bounds(own), _bounds(theirs)
        box = np.stack([first - high, last - low])
        own = _within(own, first - self._reach, last)
        theirs = _within(theirs, low, high + self._reach)
        if min(len(own), len(theirs)) > self._most:
            own, theirs = _thinned(own, _CANDIDATES * self._most), _thinned(theirs, _CANDIDATES * self._most)
            none = np.zeros(3, np.int64)
            own = _that_may_meet(own, _summed(obstacle.solid), -obstacle.first, none, self._reach)
            theirs = _that_may_meet(theirs, _summed(part.solid), -part.first, -self._reach, none)
        is_own = len(own) <= len(theirs)
        self._points[bit] = _thinned(own if is_own else theirs, self._most)
        self._is_own[bit] = is_own
        self._boxes[bit] = box
        self._grids[bit] = obstacle if is_own else part

    def finished(self) -> LatticeScene | None:
        """Return the scene of all obstacles put in; None if none is met anywhere."""
        grids: dict[int, tuple[int, Drawn]] = {}  # many obstacles may share the part's
        size, start = 0, []
        for drawn in self._grids:
            if drawn is not None and id(drawn.solid) not in grids:
                grids[id(drawn.solid)] = size, drawn
                size += drawn.solid.size
            start.append(0 if drawn is None else grids[id(drawn.solid)][0])
        if not grids:
            return None
        return LatticeScene(
            points=np.concatenate([np.zeros((0, 3), np.int64), *self._points]).astype(np.int32),
            start=np.cumsum([0, *(len(points) for points in self._points)]),
            is_own=np.array(self._is_own, np.bool_),
            boxes=np.array(self._boxes, np.int64).reshape(-1, 2, 3),
            grids=np.concatenate([drawn.solid.ravel() for _, drawn in grids.values()]),
            grid_start=np.array(start, np.int64),
            grid_low=np.array([np.zeros(3) if d is None else d.first for d in self._grids], np.int64),
            grid_shape=np.array([np.zeros(3) if d is None else d.solid.shape for d in self._grids], np.int64),
            drawn=sum(1 << bit for bit, drawn in enumerate(self._grids) if drawn is not None),
        )


def shell(solid: Bool[np.ndarray, "x y z"]) -> Int[np.ndarray, "point 3"]:
    """Return the lattice points of a solid that have one of their six neighbours outside it, but no outermost ones."""
    out = np.empty((int(np.count_nonzero(solid)), 3), np.int64)
    return out[: _shell(solid, out)]


@njit(cache=True, nogil=True)
def _shell(solid, out):  # pragma: no cover - compiled
    count = 0
    for i in range(1, solid.shape[0] - 1):
        for j in range(1, solid.shape[1] - 1):
            for k in range(1, solid.shape[2] - 1):
                if solid[i, j, k] and not (
                    solid[i - 1, j, k]
                    and solid[i + 1, j, k]
                    and solid[i, j - 1, k]
                    and solid[i, j + 1, k]
                    and solid[i, j, k - 1]
                    and solid[i, j, k + 1]
                ):
                    out[count, 0], out[count, 1], out[count, 2] = i, j, k
                    count += 1
    return count


@njit(cache=True, nogil=True)
def _bounds(points):  # pragma: no cover - compiled
    """Least and greatest coordinates of some points."""
    low, high = points[0].copy(), points[0].copy()
    for n in range(1, len(points)):
        for axis in range(3):
            low[axis] = min(low[axis], points[n, axis])
            high[axis] = max(high[axis], points[n, axis])
    return low, high


@njit(cache=True, nogil=True)
def _within(points, low, high):  # pragma: no cover - compiled
    """The points from one corner of a box to the other, both included."""
    out = np.empty_like(points)
    count = 0
    for n in range(len(points)):
        inside = True
        for axis in range(3):
            inside &= low[axis] <= points[n, axis] <= high[axis]
        if inside:
            out[count] = points[n]
            count += 1
    return out[:count].copy()


@njit(cache=True, nogil=True)
def _summed(solid):  # pragma: no cover - compiled
    """How many blocks of lattice points that hold one of a solid come before each block along all three axes."""
    nx, ny, nz = solid.shape
    table = np.zeros(((nx - 1) // _BLOCK + 2, (ny - 1) // _BLOCK + 2, (nz - 1) // _BLOCK + 2), np.int32)
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if solid[i, j, k]:
                    table[i // _BLOCK + 1, j // _BLOCK + 1, k // _BLOCK + 1] = 1
    for i in range(1, table.shape[0]):
        for j in range(1, table.shape[1]):
            along = 0
            for k in range(1, table.shape[2]):
                along += table[i, j, k]
                table[i, j, k] = along + table[i - 1, j, k] + table[i, j - 1, k] - table[i - 1, j - 1, k]
    return table


@njit(cache=True, nogil=True)
def _that_may_meet(points, table, shift, start, stop):  # pragma: no cover - compiled
    """Those points, shifted, about which a solid may have a point in the box from start to stop, both ends included.

    ``table`` is the solid's, summed: to the block.
    """
    out = np.empty_like(points)
    count = 0
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for n in range(len(points)):
        for axis in range(3):
            at, most = points[n, axis] + shift[axis], table.shape[axis] - 1
            first[axis] = min(max((at + start[axis]) // _BLOCK, 0), most)
            last[axis] = min(max((at + stop[axis]) // _BLOCK + 1, 0), most)
        total = 0
        for side in range(8):
            x = last[0] if side & 4 else first[0]
            y = last[1] if side & 2 else first[1]
            z = last[2] if side & 1 else first[2]
            lower = 3 - (side >> 2 & 1) - (side >> 1 & 1) - (side & 1)
            total += -table[x, y, z] if lower & 1 else table[x, y, z]
        if total > 0:
            out[count] = points[n]
            count += 1
    return out[:count].copy()


def _thinned(points: Int[np.ndarray, "point 3"], most: int) -> Int[np.ndarray, "_ 3"]:
    """Evenly many of the points, at most so many."""
    return points if len(points) <= most else points[np.linspace(0, len(points) - 1, most).astype(int)]
