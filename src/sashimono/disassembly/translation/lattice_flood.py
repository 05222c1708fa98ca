"""Walk over a lattice of displacements: the kernels that look for a way out of the configuration space."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int
from numba import njit


class LatticeScene(NamedTuple):
    """A part and its obstacles as lattice points, for the kernels.

    Whether the part, moved to a cell, meets obstacle b is told by the points ``start[b]`` to ``start[b + 1]``: points
    of the part that are looked up in the obstacle's grid, or the other way round, whichever are fewer. Each grid
    covers only where the two can meet.
    """

    points: Int[np.ndarray, "point 3"]
    start: Int[np.ndarray, "obstacle_1"]
    is_own: Bool[np.ndarray, "obstacle"]
    """Whether an obstacle's points are the part's, not its own."""
    boxes: Int[np.ndarray, "obstacle 2 3"]
    """First and last cell of displacement at which the boxes of part and obstacle meet."""
    grids: Bool[np.ndarray, "grid_point"]
    """The lattice points looked up, all grids in a row."""
    grid_start: Int[np.ndarray, "obstacle"]
    grid_low: Int[np.ndarray, "obstacle 3"]
    """First corner of each grid, from the corner of the common lattice, or of the part's own."""
    grid_shape: Int[np.ndarray, "obstacle 3"]
    drawn: int
    """The obstacles that are there to be met (bits)."""


@njit(cache=True, nogil=True)
def label(scene, cell, labels, known):  # pragma: no cover - compiled
    """Return the obstacles (bits) that a part, moved to a cell of the displacement lattice, runs into.

    ``known`` holds, by cell, those that were looked at. Those that a label holds before stay in it.
    """
    i, j, k = cell
    left = scene.drawn & ~known[i, j, k]
    if left != 0:
        mask = labels[i, j, k]
        for b in range(scene.is_own.shape[0]):
            if not left >> b & 1:
                continue
            box = scene.boxes[b]
            if i < box[0, 0] or j < box[0, 1] or k < box[0, 2] or i > box[1, 0] or j > box[1, 1] or k > box[1, 2]:
                continue
            if not mask >> b & 1 and _meets(scene, b, i, j, k):
                mask |= 1 << b
        labels[i, j, k] = mask
        known[i, j, k] = scene.drawn
    return labels[i, j, k]


@njit(cache=True, nogil=True)
def label_all(scene, labels, known):  # pragma: no cover - compiled
    """Work out the labels of all cells."""
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            for k in range(labels.shape[2]):
                label(scene, (i, j, k), labels, known)


@njit(cache=True, nogil=True)
def _meets(scene, b, i, j, k):  # pragma: no cover - compiled
    points, grids = scene.points, scene.grids
    sign = 1 if scene.is_own[b] else -1
    ox, oy, oz = sign * i - scene.grid_low[b, 0], sign * j - scene.grid_low[b, 1], sign * k - scene.grid_low[b, 2]
    nx, ny, nz = scene.grid_shape[b, 0], scene.grid_shape[b, 1], scene.grid_shape[b, 2]
    base = scene.grid_start[b]
    for p in range(scene.start[b], scene.start[b + 1]):
        x, y, z = points[p, 0] + ox, points[p, 1] + oy, points[p, 2] + oz
        if 0 <= x < nx and 0 <= y < ny and 0 <= z < nz and grids[base + (x * ny + y) * nz + z]:
            return True
    return False


@njit(cache=True, nogil=True)
def explore(scene, labels, known, start, obstacles, steps, queue, budget):
    # pragma: no cover - compiled
    """Look for a way from ``start`` to the rim of the displacement lattice past the obstacles (bits).

    A* over 26 neighbours, each entered by the first way that finds it. Returns (whether the rim was
    reached, cells visited or -1 past the budget, the labels of the cells that stopped it). ``queue``
    (cells, 3) gets the cells visited in their order, ``steps`` (lattice shape, -1 elsewhere) the number
    of steps to each.
    """
    shape = steps.shape
    longest = 3 * (shape[0] + shape[1] + shape[2])
    heads = np.full(longest + 1, -1, np.int64)
    links = np.full(steps.size, -1, np.int64)
    walls = np.zeros(64, np.int64)
    count_walls = 0
    steps[start[0], start[1], start[2]] = 0
    heads[0] = _index(start[0], start[1], start[2], shape)
    bucket = 0
    count = 0
    while bucket <= longest:
        index = heads[bucket]
        if index < 0:
            bucket += 1
            continue
        heads[bucket] = links[index]
        i, j, k = _cell(index, shape)
        queue[count, 0], queue[count, 1], queue[count, 2] = i, j, k
        count += 1
        if _rim(i, j, k, shape) == 0:
            return True, count, walls[:count_walls]
        if count >= budget:
            return True, -1, walls[:count_walls]
        for di in range(-1, 2):
            for dj in range(-1, 2):
                for dk in range(-1, 2):
                    x, y, z = i + di, j + dj, k + dk
                    if steps[x, y, z] >= 0:
                        continue
                    # all that is met, not what is known: proofs must not depend on what was asked before
                    mask = label(scene, (x, y, z), labels, known) & obstacles
                    if mask != 0:
                        new = True
                        for m in range(count_walls):
                            if walls[m] & mask == walls[m]:
                                new = False
                                break
                        if new:
                            if count_walls == walls.shape[0]:
                                walls = np.concatenate((walls, np.zeros(count_walls, np.int64)))
                            walls[count_walls] = mask
                            count_walls += 1
                        continue
                    steps[x, y, z] = steps[i, j, k] + 1
                    place = min(longest, steps[x, y, z] + _rim(x, y, z, shape))
                    near = _index(x, y, z, shape)
                    links[near] = heads[place]
                    heads[place] = near
                    bucket = min(bucket, place)
    return False, count, walls[:count_walls]


@njit(cache=True, nogil=True)
def met_on_every_way(scene, labels, known, start, base, obstacles, budget):
    # pragma: no cover - compiled
    """Return those of the obstacles (bits) that every way from ``start`` to the rim meets, if it is to miss the base.

    None of them if no such way is found, or the budget of cells visited runs out, one that is visited again counted
    again. By cell, what all ways to it meet is what it meets itself and what all ways to one of its neighbours do: a
    fixed point, reached from above, the cells nearest to the rim first. Ways that have met all that is left are not
    followed on.
    """
    shape = labels.shape
    met = np.full(shape, -1, np.int64)
    waits = np.zeros(shape, np.bool_)
    heads = np.full(max(shape), -1, np.int64)
    links = np.empty(labels.size, np.int64)
    met[start[0], start[1], start[2]] = 0
    bucket = _rim(start[0], start[1], start[2], shape)
    heads[bucket] = _index(start[0], start[1], start[2], shape)
    links[heads[bucket]] = -1
    every, is_out = obstacles, False
    while bucket < len(heads):
        index = heads[bucket]
        if index < 0:
            bucket += 1
            continue
        heads[bucket] = links[index]
        i, j, k = _cell(index, shape)
        waits[i, j, k] = False
        if is_out and met[i, j, k] & every == every:
            continue
        if bucket == 0:
            is_out = True
            every &= met[i, j, k]
            if every == 0:
                return 0
            continue
        if budget == 0:
            return 0
        budget -= 1
        for x in range(i - 1, i + 2):
            for y in range(j - 1, j + 2):
                for z in range(k - 1, k + 2):
                    before, mask = met[x, y, z], labels[x, y, z]  # a wall known by one need not be known by all
                    if mask & base != 0 or before & (met[i, j, k] | mask & obstacles) == before:
                        continue
                    mask = label(scene, (x, y, z), labels, known)
                    less = before & (met[i, j, k] | mask & obstacles)
                    if mask & base != 0 or less == before:
                        continue
                    met[x, y, z] = less
                    if not waits[x, y, z]:
                        waits[x, y, z] = True
                        place, near = _rim(x, y, z, shape), _index(x, y, z, shape)
                        links[near] = heads[place]
                        heads[place] = near
                        bucket = min(bucket, place)
    return every if is_out else 0


@njit(cache=True, nogil=True)
def _index(i, j, k, shape):  # pragma: no cover - compiled
    """The number of a cell."""
    return (i * shape[1] + j) * shape[2] + k


@njit(cache=True, nogil=True)
def _cell(index, shape):  # pragma: no cover - compiled
    """The cell of a number."""
    return index // (shape[1] * shape[2]), index // shape[2] % shape[1], index % shape[2]


@njit(cache=True, nogil=True)
def _rim(i, j, k, shape):  # pragma: no cover - compiled
    """Fewest steps to the rim of the lattice."""
    return min(i, j, k, shape[0] - 1 - i, shape[1] - 1 - j, shape[2] - 1 - k)


@njit(cache=True, nogil=True)
def steps_back(queue, count, steps):  # pragma: no cover - compiled
    """Replace the steps from the start, of the cells visited, by the steps to the last one (the way out)."""
    shape = steps.shape
    for n in range(count):
        steps[queue[n, 0], queue[n, 1], queue[n, 2]] = -2
    todo = np.empty((count, 3), np.int32)
    todo[0] = queue[count - 1]
    steps[todo[0, 0], todo[0, 1], todo[0, 2]] = 0
    head, tail = 0, 1
    while head < tail:
        i, j, k = todo[head]
        head += 1
        for x in range(max(0, i - 1), min(shape[0], i + 2)):
            for y in range(max(0, j - 1), min(shape[1], j + 2)):
                for z in range(max(0, k - 1), min(shape[2], k + 2)):
                    if steps[x, y, z] == -2:
                        steps[x, y, z] = steps[i, j, k] + 1
                        todo[tail, 0], todo[tail, 1], todo[tail, 2] = x, y, z
                        tail += 1


@njit(cache=True, nogil=True)
def cast(scene, labels, known, start, direction, obstacles):  # pragma: no cover - compiled
    """Return the steps along a unit direction to the first cell labelled with one of the obstacles, and its label.

    No label (0) if the line leaves the lattice before: then the steps to its rim. ``start`` is in lattice
    steps, not whole ones.
    """
    shape = labels.shape
    travel = 0.0
    while True:
        i = int(np.floor(start[0] + travel * direction[0] + 0.5))
        j = int(np.floor(start[1] + travel * direction[1] + 0.5))
        k = int(np.floor(start[2] + travel * direction[2] + 0.5))
        if i <= 0 or j <= 0 or k <= 0 or i >= shape[0] - 1 or j >= shape[1] - 1 or k >= shape[2] - 1:
            return travel, 0
        mask = label(scene, (i, j, k), labels, known) & obstacles
        if mask != 0:
            return travel, mask
        travel += 0.4


@njit(cache=True, nogil=True)
def nearest_steps(cells, steps, places, out):  # pragma: no cover - compiled
    """Write, for each place, two guesses of the steps to the way out by way of a cell visited.

    The first is the fewest, straight to any cell: through walls, too. The second is from the nearest cell on.
    """
    for n in range(places.shape[0]):
        nearest = np.inf
        out[0, n] = np.inf
        for m in range(cells.shape[0]):
            far = max(abs(cells[m, 0] - places[n, 0]), abs(cells[m, 1] - places[n, 1]), abs(cells[m, 2] - places[n, 2]))
            out[0, n] = min(out[0, n], steps[m] + far)
            if far < nearest or (far == nearest and steps[m] + far < out[1, n]):
                nearest = far
                out[1, n] = steps[m] + far


def steps_from(steps: Int[np.ndarray, "x y z"], end: Int[np.ndarray, "3"]) -> list[Int[np.ndarray, "3"]]:
    """Return the cells from the start of an exploration to one that it reached, by the steps to each."""
    path = [np.asarray(end, dtype=int)]
    while (left := int(steps[tuple(path[-1])])) > 0:
        low = path[-1] - 1
        around = np.argwhere(steps[tuple(slice(max(int(at), 0), int(at) + 3) for at in low)] == left - 1)
        path.append(around[0] + np.maximum(low, 0))
    return path[::-1]


def straightened(scene, labels, known, obstacles: int, path: list[np.ndarray]) -> list[np.ndarray]:
    """Return a few cells of a path, each in line of sight of the one before."""
    kept, at = [path[0]], 0
    while at < len(path) - 1:
        for to in range(len(path) - 1, at, -1):
            way = (path[to] - path[at]).astype(float)
            far = float(np.linalg.norm(way))
            if to == at + 1 or cast(scene, labels, known, path[at].astype(float), way / far, obstacles)[0] >= far - 0.5:
                break
        kept.append(path[to])
        at = to
    return kept
