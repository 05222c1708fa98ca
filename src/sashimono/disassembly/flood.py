"""Walk over a lattice of displacements: the kernels that look for a way out of the configuration space."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def label(points, owners, cell, labels, known):  # pragma: no cover - compiled
    """Return the obstacles (bits) that a part, moved to a cell of the displacement lattice, runs into."""
    i, j, k = cell
    if not known[i, j, k]:
        mask = 0
        for p in range(points.shape[0]):
            mask |= owners[points[p, 0] + i, points[p, 1] + j, points[p, 2] + k]
        labels[i, j, k] = mask
        known[i, j, k] = True
    return labels[i, j, k]


@njit(cache=True, nogil=True)
def explore(points, owners, labels, known, start, obstacles, steps, queue, budget):
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
    first = (start[0] * shape[1] + start[1]) * shape[2] + start[2]
    steps[start[0], start[1], start[2]] = 0
    heads[0] = first
    bucket = 0
    count = 0
    while bucket <= longest:
        index = heads[bucket]
        if index < 0:
            bucket += 1
            continue
        heads[bucket] = links[index]
        i, j, k = index // (shape[1] * shape[2]), index // shape[2] % shape[1], index % shape[2]
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
                    near = (x * shape[1] + y) * shape[2] + z
                    if steps[x, y, z] >= 0:
                        continue
                    mask = label(points, owners, (x, y, z), labels, known) & obstacles
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
                    links[near] = heads[place]
                    heads[place] = near
                    bucket = min(bucket, place)
    return False, count, walls[:count_walls]


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
def cast(points, owners, labels, known, start, direction, obstacles):  # pragma: no cover - compiled
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
        mask = label(points, owners, (i, j, k), labels, known) & obstacles
        if mask != 0:
            return travel, mask
        travel += 0.4


@njit(cache=True, nogil=True)
def nearest_steps(cells, steps, places, out):  # pragma: no cover - compiled
    """Write, for each place, the fewest steps: to a cell visited, and from there to the way out."""
    for n in range(places.shape[0]):
        best = np.inf
        for m in range(cells.shape[0]):
            far = steps[m] + max(
                abs(cells[m, 0] - places[n, 0]), abs(cells[m, 1] - places[n, 1]), abs(cells[m, 2] - places[n, 2])
            )
            best = min(best, far)
        out[n] = best
