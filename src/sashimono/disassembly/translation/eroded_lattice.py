"""Lattice points inside a solid and away from its surface: kernels behind the configuration space."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit

from sashimono.geometry.distance.signed_distance import closest_on_triangle


def eroded_lattice(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    *,
    origin: Float[np.ndarray, "3"],
    spacing: float,
    shape: tuple[int, int, int],
    radius: float,
) -> Bool[np.ndarray, "x y z"]:
    """Return which points ``origin + spacing * (i, j, k)`` are the centre of a ball of this radius [m] inside a solid.

    Exact: a point counts if its winding number is positive and no triangle comes nearer than the radius.
    """
    winding = np.zeros(shape, np.int16)
    scaled = np.ascontiguousarray((vertices - origin) / spacing)
    _wind(scaled, faces, winding)
    _strip(scaled, faces, radius / spacing, winding)
    return winding > 0


def grown_lattice(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    *,
    origin: Float[np.ndarray, "3"],
    spacing: float,
    shape: tuple[int, int, int],
    radius: float,
) -> Bool[np.ndarray, "x y z"]:
    """Return which points ``origin + spacing * (i, j, k)`` are in a solid or nearer to it than a radius [m]."""
    winding = np.zeros(shape, np.int16)
    scaled = np.ascontiguousarray((vertices - origin) / spacing)
    _wind(scaled, faces, winding)
    outside = (winding <= 0).astype(np.int16)
    _strip(scaled, faces, radius / spacing, outside)
    return outside == 0


@njit(cache=True, nogil=True)
def _left_of(ax, ay, bx, by, x, y):  # pragma: no cover - compiled
    """Whether a point lies left of the line from a to b; the line itself belongs to the same side from both ends."""
    if bx < ax or (bx == ax and by < ay):
        return (ax - bx) * (y - by) - (ay - by) * (x - bx) < 0.0
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0


@njit(cache=True, nogil=True)
def _wind(vertices, faces, winding):  # pragma: no cover - compiled
    """Write the winding number at each lattice point, counted along the lattice lines in z."""
    nx, ny, nz = winding.shape
    for f in range(faces.shape[0]):
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        for i in range(max(0, int(np.ceil(min(a[0], b[0], c[0])))), min(nx - 1, int(max(a[0], b[0], c[0]))) + 1):
            for j in range(max(0, int(np.ceil(min(a[1], b[1], c[1])))), min(ny - 1, int(max(a[1], b[1], c[1]))) + 1):
                side = _left_of(a[0], a[1], b[0], b[1], i, j)
                if side != _left_of(b[0], b[1], c[0], c[1], i, j) or side != _left_of(c[0], c[1], a[0], a[1], i, j):
                    continue
                det = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])
                if det == 0.0:
                    continue
                u = ((i - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (j - a[1])) / det
                v = ((b[0] - a[0]) * (j - a[1]) - (i - a[0]) * (b[1] - a[1])) / det
                k = max(0, int(np.ceil(a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]))))
                if k < nz:
                    winding[i, j, k] += -1 if side else 1
    for i in range(nx):
        for j in range(ny):
            for k in range(1, nz):
                winding[i, j, k] += winding[i, j, k - 1]


@njit(cache=True, nogil=True)
def _strip(vertices, faces, radius, winding):  # pragma: no cover - compiled
    """Clear the lattice points nearer than the radius to a triangle, walking along each one's plane."""
    shape = np.array(winding.shape)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    normal, at = np.empty(3), np.empty(3, np.int64)
    triangle = np.empty((3, 3))
    for f in range(faces.shape[0]):
        is_near = True
        for axis in range(3):
            a, b, c = vertices[faces[f, 0], axis], vertices[faces[f, 1], axis], vertices[faces[f, 2], axis]
            first[axis] = max(0, int(np.ceil(min(a, b, c) - radius)))
            last[axis] = min(shape[axis] - 1, int(np.floor(max(a, b, c) + radius)))
            triangle[0, axis], triangle[1, axis], triangle[2, axis] = a, b, c
            if first[axis] > last[axis]:
                is_near = False
                break
        if not is_near:
            continue
        squared = 0.0
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            normal[axis] = (triangle[1, u] - triangle[0, u]) * (triangle[2, v] - triangle[0, v]) - (
                triangle[1, v] - triangle[0, v]
            ) * (triangle[2, u] - triangle[0, u])
            squared += normal[axis] * normal[axis]
        if squared == 0.0:
            continue
        w = 0
        for axis in range(3):
            normal[axis] /= np.sqrt(squared)
            if abs(normal[axis]) > abs(normal[w]):
                w = axis
        u, v = (w + 1) % 3, (w + 2) % 3
        half = radius / abs(normal[w])
        for i in range(first[u], last[u] + 1):
            for j in range(first[v], last[v] + 1):
                middle = (
                    triangle[0, w] - (normal[u] * (i - triangle[0, u]) + normal[v] * (j - triangle[0, v])) / normal[w]
                )
                for k in range(
                    max(first[w], int(np.ceil(middle - half))), min(last[w], int(np.floor(middle + half))) + 1
                ):
                    at[u], at[v], at[w] = i, j, k
                    if winding[at[0], at[1], at[2]] <= 0:
                        continue
                    x, y, z, _ = closest_on_triangle(float(at[0]), float(at[1]), float(at[2]), triangle)
                    if (x - at[0]) ** 2 + (y - at[1]) ** 2 + (z - at[2]) ** 2 < radius * radius:
                        winding[at[0], at[1], at[2]] = 0
