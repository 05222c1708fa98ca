"""Conservative advancement along a line: how far points travel before one of them is too deep in a solid.

Outside, a point goes on to where its ray enters the solid. Inside, it is no deeper than its distance to any one
triangle. So it may go on for as long as the closest triangle stays near enough: a slide along a wall is one step.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numba import njit

from sashimono.geometry.distance.signed_distance import (
    STACK_SIZE,
    SignedDistance,
    bound_by,
    closest_on_triangle,
    nearest,
)


def advance_straight(
    solid: SignedDistance,
    points: Float[np.ndarray, "n 3"],
    direction: Float[np.ndarray, "3"],
    *,
    length: float,
    limit: float,
    least_step: float,
    enough: float = 0.0,
) -> tuple[float, int]:
    """Return how far the points travel along a unit direction before one is deeper than ``limit`` [m], and which it is.

    Points and direction are in the solid's frame. Infinite, and -1, if no point gets too deep within ``length``.
    It skips only what lies deeper for less than ``least_step``. Of a travel of at most ``enough`` [m] no more is told
    than that: what comes back is between the two, and of a point that stops there.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    direction = np.ascontiguousarray(direction, dtype=np.float64)
    return advance_points(points, direction, length, limit, least_step, enough, *solid.arrays)


@njit(cache=True, nogil=True)
def _box_range(x, y, z, direction, stop, box):  # pragma: no cover - compiled
    """Part of the line from 0 to ``stop`` that is in a box; empty if the second is less than the first."""
    start = 0.0
    for axis in range(3):
        at = x if axis == 0 else (y if axis == 1 else z)
        slope = direction[axis]
        to_low, to_high = box[axis] - at, box[3 + axis] - at
        if abs(slope) < 1e-15:
            if to_low > 0.0 or to_high < 0.0:
                return 0.0, -1.0
        else:
            t0, t1 = to_low / slope, to_high / slope
            start = max(start, min(t0, t1))
            stop = min(stop, max(t0, t1))
    return start, stop


@njit(cache=True, nogil=True)
def _crossing(x, y, z, direction, t):  # pragma: no cover - compiled
    """Where a line crosses a triangle (Möller & Trumbore 1997), its rim included, and whether it enters there.

    Infinite if it does not cross.
    """
    e1x, e1y, e1z = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    e2x, e2y, e2z = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    px = direction[1] * e2z - direction[2] * e2y
    py = direction[2] * e2x - direction[0] * e2z
    pz = direction[0] * e2y - direction[1] * e2x
    det = e1x * px + e1y * py + e1z * pz
    if abs(det) <= 1e-9 * np.sqrt((e1x * e1x + e1y * e1y + e1z * e1z) * (e2x * e2x + e2y * e2y + e2z * e2z)):
        return np.inf, False  # along the triangle's plane
    inv = 1.0 / det
    sx, sy, sz = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    u = (sx * px + sy * py + sz * pz) * inv
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (direction[0] * qx + direction[1] * qy + direction[2] * qz) * inv
    if u < -1e-9 or v < -1e-9 or u + v > 1.0 + 1e-9:
        return np.inf, False
    return (e2x * qx + e2y * qy + e2z * qz) * inv, det > 0.0


@njit(cache=True, nogil=True)
def _next_crossing(x, y, z, direction, start, stop, boxes, links, triangles):  # pragma: no cover - compiled
    """First crossing of the surface from ``start`` on, and whether it enters; infinite if none is up to ``stop``."""
    nodes = np.empty(STACK_SIZE, np.int32)
    nodes[0] = 0
    top = 1
    best, enters = np.inf, True
    while top > 0:
        top -= 1
        node = nodes[top]
        near, far = _box_range(x, y, z, direction, min(best, stop), boxes[node])
        if far < near or far < start:
            continue
        first, count = links[node, 0], links[node, 1]
        if count > 0:
            for m in range(first, first + count):
                t, into = _crossing(x, y, z, direction, triangles[m])
                if start <= t < best:
                    best, enters = t, into
        else:
            nodes[top], nodes[top + 1] = first, first + 1
            top += 2
    if best > stop:
        return np.inf, True
    return best, enters


@njit(cache=True, nogil=True)
def _within(x, y, z, direction, start, stop, limit, triangle):  # pragma: no cover - compiled
    """Up to which travel a point that is within ``limit`` of a triangle at ``start`` stays so.

    The distance to a triangle is convex along a line, so one bisection finds the end.
    """
    low, high = start, stop
    for k in range(14):
        t = stop if k == 0 else 0.5 * (low + high)
        px, py, pz = x + t * direction[0], y + t * direction[1], z + t * direction[2]
        qx, qy, qz, _ = closest_on_triangle(px, py, pz, triangle)
        if (px - qx) ** 2 + (py - qy) ** 2 + (pz - qz) ** 2 <= limit * limit:
            low = t
            if k == 0:
                break
        else:
            high = t
    return low


@njit(cache=True, nogil=True)
def _nearest_along(x, y, z, direction, t, guess, boxes, links, triangles, normals):  # pragma: no cover - compiled
    """Signed distance of the point after a travel, and its nearest triangle; the guess (-1: none) comes first."""
    px, py, pz = x + t * direction[0], y + t * direction[1], z + t * direction[2]
    bound = np.inf
    if guess >= 0:
        bound = bound_by(px, py, pz, triangles[guess])
    distance, closest, _ = nearest(px, py, pz, bound, boxes, links, triangles, normals)
    return distance, closest


@njit(cache=True, nogil=True)
def advance_points(points, direction, length, limit, least_step, enough, boxes, links, triangles, normals):
    # pragma: no cover - compiled
    """What `advance_straight` returns; for compiled callers."""
    travel, stopper = np.inf, -1
    # nearer to a side of the solid's box than the limit, nothing is deeper than that: what slides along it is soon told
    core = boxes[0].copy()
    for axis in range(3):
        core[axis] += limit
        core[3 + axis] -= limit
        if core[axis] > core[3 + axis]:
            return travel, stopper
    for k in range(points.shape[0]):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        t, stop = _box_range(x, y, z, direction, min(length, travel), core)
        if stop < t:
            continue
        # all of the way through the box: where it goes in may be missed by rounding, and is told by where it comes out
        t, stop = _box_range(x, y, z, direction, min(length, travel), boxes[0])
        outside = t > 0.0
        safe = t
        closest = -1
        while t <= stop:
            if outside:
                crossing, enters = _next_crossing(x, y, z, direction, t, stop, boxes, links, triangles)
                if crossing == np.inf:
                    break
                if enters:  # else it was not outside: the sign erred
                    t = crossing
            distance, closest = _nearest_along(x, y, z, direction, t, closest, boxes, links, triangles, normals)
            if -distance > limit:
                if t <= enough:
                    return t, k
                for _ in range(6):  # between the last look and this one
                    middle = 0.5 * (safe + t)
                    distance, _ = _nearest_along(x, y, z, direction, middle, closest, boxes, links, triangles, normals)
                    if -distance > limit:
                        t = middle
                    else:
                        safe = middle
                if t < travel:
                    travel, stopper = t, k
                break
            safe = t
            outside = distance > 1e-3 * limit
            if outside:
                t += max(distance, 1e-3 * least_step)
            else:
                # one that is d outside is not deeper than the limit before it has gone d + limit
                reach = t + max(limit + distance, least_step)
                if reach < stop:
                    reach = max(reach, _within(x, y, z, direction, t, stop, limit, triangles[closest]))
                t = reach
    return travel, stopper
