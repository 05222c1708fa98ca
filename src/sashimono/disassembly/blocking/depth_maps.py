"""Depth maps along a direction: the kernels behind the blocking relation.

A part's shadow along +d is two maps over the pixels of a plane across d: the lowest and the highest
point of the part on each pixel's line. Part a, moving to infinity along +d, runs into b where
``highest_b - lowest_a > tolerance``.
"""

from __future__ import annotations

import numpy as np
from numba import njit

_EMPTY = np.float32(1e30)
"""Depth of a pixel that a part does not cover; finite, for the kernels are compiled with fast maths."""

FREE, BLOCKED, OPEN = 0, 1, 2
"""Classes of a pair in the coarse maps: free, blocked, or to be looked at more closely."""


@njit(cache=True, nogil=True, fastmath=True)
def _draw(vertices, faces, x0, y0, pixel, low, high):  # pragma: no cover - compiled
    """Lower ``low`` and raise ``high`` (ny, nx) by the triangles over each pixel centre."""
    ny, nx = low.shape
    inv = 1.0 / pixel
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay = (vertices[i, 0] - x0) * inv - 0.5, (vertices[i, 1] - y0) * inv - 0.5
        bx, by = (vertices[j, 0] - x0) * inv - 0.5, (vertices[j, 1] - y0) * inv - 0.5
        cx, cy = (vertices[k, 0] - x0) * inv - 0.5, (vertices[k, 1] - y0) * inv - 0.5
        det = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(det) < 1e-12:
            continue
        left = max(0, int(np.ceil(min(ax, bx, cx))))
        right = min(nx - 1, int(np.floor(max(ax, bx, cx))))
        bottom = max(0, int(np.ceil(min(ay, by, cy))))
        top = min(ny - 1, int(np.floor(max(ay, by, cy))))
        inv_det = 1.0 / det
        az, bz, cz = vertices[i, 2], vertices[j, 2], vertices[k, 2]
        for y in range(bottom, top + 1):
            for x in range(left, right + 1):
                u = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) * inv_det
                v = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) * inv_det
                if u < -1e-9 or v < -1e-9 or u + v > 1.0 + 1e-9:
                    continue
                z = az + u * (bz - az) + v * (cz - az)
                if z < low[y, x]:
                    low[y, x] = z
                if z > high[y, x]:
                    high[y, x] = z


@njit(cache=True, nogil=True)
def _any_over(low_a, high_b, window, tolerance):  # pragma: no cover - compiled
    for y in range(window[2], window[3] + 1):
        for x in range(window[0], window[1] + 1):
            if high_b[y, x] - low_a[y, x] > tolerance:
                return True
    return False


@njit(cache=True, nogil=True)
def _block_over(low_a, high_b, window, tolerance, margin):  # pragma: no cover - compiled
    """Whether a full square of (2 margin + 1)² pixels is over the tolerance: overlap, not mere contact."""
    size = 2 * margin + 1
    run = np.zeros(window[1] - window[0] + 1, np.int32)  # rows of overlap that end here, by column
    for y in range(window[2], window[3] + 1):
        wide = 0
        for x in range(window[0], window[1] + 1):
            c = x - window[0]
            if high_b[y, x] - low_a[y, x] > tolerance:
                run[c] += 1
            else:
                run[c] = 0
            wide = wide + 1 if run[c] >= size else 0
            if wide >= size:
                return True
    return False


@njit(cache=True, nogil=True)
def classify(vertices, vertex_start, faces, face_start, resolution, sizes, overlaps, options, out):
    # pragma: no cover - compiled
    """Sort all pairs of parts by coarse maps along +z of the given vertices.

    ``out[a, b]``: may a, moving along +z, pass b? FREE, BLOCKED, or OPEN. ``options`` holds the axial
    tolerance and the lateral pixel, both relative to a pair's smaller size, and the margin in pixels.
    """
    axial, lateral, margin = options[0], options[1], int(options[2])
    m = vertex_start.shape[0] - 1
    x0, y0 = vertices[:, 0].min(), vertices[:, 1].min()
    width, height = vertices[:, 0].max() - x0, vertices[:, 1].max() - y0
    pixel = max(width, height) / resolution
    nx, ny = int(width / pixel) + 2, int(height / pixel) + 2
    x0 -= 0.31 * pixel
    y0 -= 0.37 * pixel
    low = np.full((m, ny, nx), _EMPTY, np.float32)
    high = np.full((m, ny, nx), -_EMPTY, np.float32)
    box = np.empty((m, 6))
    for a in range(m):
        part = vertices[vertex_start[a] : vertex_start[a + 1]]
        _draw(part, faces[face_start[a] : face_start[a + 1]], x0, y0, pixel, low[a], high[a])
        for k in range(3):
            box[a, 2 * k], box[a, 2 * k + 1] = part[:, k].min(), part[:, k].max()
    window = np.empty(4, np.int64)
    for a in range(m):
        for b in range(m):
            if a == b:
                continue
            size = min(sizes[a], sizes[b])
            tolerance = max(axial * size, overlaps[a, b])
            fine = max(lateral * size, 0.75 * overlaps[a, b])
            wide = min(box[a, 1], box[b, 1]) - max(box[a, 0], box[b, 0])
            tall = min(box[a, 3], box[b, 3]) - max(box[a, 2], box[b, 2])
            if wide < fine or tall < fine or box[b, 5] - box[a, 4] <= tolerance:
                out[a, b] = FREE
                continue
            window[0] = max(0, int((max(box[a, 0], box[b, 0]) - x0) / pixel) - 1)
            window[1] = min(nx - 1, int((min(box[a, 1], box[b, 1]) - x0) / pixel) + 1)
            window[2] = max(0, int((max(box[a, 2], box[b, 2]) - y0) / pixel) - 1)
            window[3] = min(ny - 1, int((min(box[a, 3], box[b, 3]) - y0) / pixel) + 1)
            if min(wide, tall) >= 4.0 * pixel and not _any_over(low[a], high[b], window, tolerance):
                out[a, b] = FREE
            elif overlaps[a, b] < pixel and _block_over(low[a], high[b], window, tolerance, margin):
                out[a, b] = BLOCKED
            else:
                out[a, b] = OPEN


@njit(cache=True, nogil=True)
def pass_finely(vertices_a, faces_a, vertices_b, faces_b, pixel, most_pixels, tolerance, margin):
    # pragma: no cover - compiled
    """Return whether a, moving along +z, and b, moving along +z, are stopped by the other one.

    Looks only at the window where the two shadows' boxes meet, at the wanted pixel or, where that
    would take more than ``most_pixels`` a side, a coarser one.
    """
    left = max(vertices_a[:, 0].min(), vertices_b[:, 0].min())
    right = min(vertices_a[:, 0].max(), vertices_b[:, 0].max())
    bottom = max(vertices_a[:, 1].min(), vertices_b[:, 1].min())
    top = min(vertices_a[:, 1].max(), vertices_b[:, 1].max())
    if right - left < pixel or top - bottom < pixel:
        return False, False
    pixel = max(pixel, max(right - left, top - bottom) / most_pixels)
    nx, ny = int((right - left) / pixel) + 1, int((top - bottom) / pixel) + 1
    x0 = left - 0.5 * (nx * pixel - (right - left)) + 0.013 * pixel
    y0 = bottom - 0.5 * (ny * pixel - (top - bottom)) + 0.017 * pixel
    low_a, high_a = np.full((ny, nx), _EMPTY, np.float32), np.full((ny, nx), -_EMPTY, np.float32)
    low_b, high_b = np.full((ny, nx), _EMPTY, np.float32), np.full((ny, nx), -_EMPTY, np.float32)
    _draw(vertices_a, faces_a, x0, y0, pixel, low_a, high_a)
    _draw(vertices_b, faces_b, x0, y0, pixel, low_b, high_b)
    window = np.array([0, nx - 1, 0, ny - 1])
    return (
        _block_over(low_a, high_b, window, tolerance, margin),
        _block_over(low_b, high_a, window, tolerance, margin),
    )
