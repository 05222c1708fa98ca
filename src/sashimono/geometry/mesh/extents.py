"""The box along a solid's principal axes, also where these are not determined.

Of equal moments, as those of a square plate, a cube or a regular prism, any axes in their plane (or all) are principal,
and rounding would choose. The smallest box there does not depend on how the solid lies.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

_EQUAL = 1e-3
"""Moments that differ by less than this share of the largest are equal: their axes would turn with noise."""

_MOST_FACES = 32
"""Equally thin faces of a hull that are looked at."""


def principal_extents(
    points: Float[np.ndarray, "point 3"], moments: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "3"]:
    """Return the extents [m] of points along the principal axes (columns), in the order of the ascending moments.

    Of equal moments, those of the box that is smallest in its smallest extent, ascending.
    """
    first, second = np.diff(moments) < _EQUAL * moments[2]
    extents = np.ptp(points @ axes, axis=0)
    if first and second:
        return _smallest_box(points, extents)
    if first:
        extents[:2] = _smallest_rectangle(points @ axes[:, :2], extents[:2])
    elif second:
        extents[1:] = _smallest_rectangle(points @ axes[:, 1:], extents[1:])
    return extents


def _smallest_rectangle(points: Float[np.ndarray, "point 2"], otherwise: Float[np.ndarray, "2"]) -> np.ndarray:
    """Sides of the thinnest rectangle around points in a plane, ascending: one of its sides lies on their hull."""
    try:
        hull = ConvexHull(points)
    except QhullError:  # all on a line
        return np.sort(otherwise)
    corners, normals = points[hull.vertices], hull.equations[:, :2]
    widths = np.ptp(corners @ normals.T, axis=0)
    lengths = np.ptp(corners @ np.stack([-normals[:, 1], normals[:, 0]]), axis=0)
    # the shortest of those that are equally thin, to rounding
    best = np.lexsort((lengths, np.round(widths / lengths.max(), 6)))[0]
    return np.sort([widths[best], lengths[best]])


def _smallest_box(points: Float[np.ndarray, "point 3"], otherwise: Float[np.ndarray, "3"]) -> np.ndarray:
    """Sides of the thinnest box that has a side on the hull of the points, ascending."""
    try:
        hull = ConvexHull(points)
    except QhullError:  # all in a plane
        return np.sort(otherwise)
    corners = points[hull.vertices]
    normals = np.unique(np.round(hull.equations[:, :3], 6), axis=0)
    widths = np.ptp(corners @ normals.T, axis=0)
    boxes = []
    for normal in normals[widths < widths.min() * (1.0 + 1e-6)][:_MOST_FACES]:
        flat = corners @ np.linalg.svd(normal[None])[2][1:].T
        boxes.append(np.sort([float(widths.min()), *_smallest_rectangle(flat, np.ptp(flat, axis=0))]))
    return min(boxes, key=lambda box: tuple(np.round(box / widths.max(), 6)))
