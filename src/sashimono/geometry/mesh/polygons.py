"""Cutting polygons in space into triangles."""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np
from jaxtyping import Float, Int

_ABSURD = 1e100


def triangulate(
    vertices: Float[np.ndarray, "vertex 3"], polygons: Int[np.ndarray, "face 3"] | Sequence[Sequence[int]]
) -> Int[np.ndarray, "triangle 3"]:
    """Return triangles that cover the polygons, wound like them; polygons of under 3 corners cover nothing."""
    if isinstance(polygons, np.ndarray):
        return polygons
    out: list[np.ndarray] = []
    for polygon in polygons:
        if len(polygon) >= 3:
            out.append(triangulate_polygon(vertices, np.asarray(polygon, dtype=np.int64)))
    return np.concatenate(out) if out else np.zeros((0, 3), dtype=np.int64)


def triangulate_polygon(
    vertices: Float[np.ndarray, "vertex 3"], polygon: Int[np.ndarray, "corner"]
) -> Int[np.ndarray, "triangle 3"]:
    """Return triangles that cover one roughly planar polygon, wound like it and using all its edges."""
    fan = np.column_stack([np.full(len(polygon) - 2, polygon[0]), polygon[1:-1], polygon[2:]])
    if len(polygon) == 3 or polygon.min() < 0 or polygon.max() >= len(vertices):
        return fan
    points = vertices[polygon]
    if not (np.abs(points) < _ABSURD).all():  # readers refuse such coordinates; squares of them are no numbers
        return fan
    normal = polygon_normal(points)
    cross = np.cross(points[1:-1] - points[0], points[2:] - points[0])
    if (cross @ normal >= 0.0).all() or not np.isfinite(normal).all() or not normal.any():
        return fan
    return polygon[manifold3d.triangulate([project(points, normal)])]


def polygon_normal(points: Float[np.ndarray, "corner 3"]) -> Float[np.ndarray, "3"]:
    """Return the unit normal of a polygon (Newell), counter-clockwise seen from its tip; zero if it has no area."""
    centered = points - points.mean(axis=0)
    normal = np.cross(centered, np.roll(centered, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(normal))
    return normal / length if length > 0.0 else np.zeros(3)


def project(points: Float[np.ndarray, "n 3"], normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 2"]:
    """Return the points' coordinates in a plane with this unit normal, not mirrored as seen from its tip."""
    x = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    x /= np.linalg.norm(x)
    return (points - points[0]) @ np.column_stack([x, np.cross(normal, x)])
