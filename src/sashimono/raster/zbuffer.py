"""Triangles to pixels: what is nearest to the viewer at each of them, and how it faces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numba import njit

NOTHING = -1
"""Part number of a pixel that shows none."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """The nearest surface at each pixel."""

    depth: Float[np.ndarray, "row column"]
    """Distance along the view; infinite where there is nothing."""
    part: Int[np.ndarray, "row column"]
    """Part number, or `NOTHING`."""
    normal: Float[np.ndarray, "row column 3"]
    """Unit normal: right, up, towards the viewer."""

    @property
    def covered(self) -> np.ndarray:
        """Where there is something."""
        return self.part != NOTHING

    def cut(self, box: tuple[slice, ...]) -> Layer:
        """Return a window of the layer."""
        return Layer(depth=self.depth[box], part=self.part[box], normal=self.normal[box])


def empty_layer(rows: int, columns: int) -> Layer:
    """Return a layer that shows nothing."""
    return Layer(
        depth=np.full((rows, columns), np.inf, dtype=np.float32),
        part=np.full((rows, columns), NOTHING, dtype=np.int32),
        normal=np.zeros((rows, columns, 3), dtype=np.float32),
    )


def draw(
    layer: Layer,
    part: int,
    points: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    normals: Float[np.ndarray, "shaded 3 3"],
) -> None:
    """Draw a part into a layer.

    Args:
        layer: Changed in place.
        part: Its number.
        points: Column, row and depth of each vertex.
        faces: Triangles.
        normals: Unit normals of the triangles' corners: right, up, towards the viewer. There may be none: then the
            layer's normals stay as they are.
    """
    _draw(points, faces, normals.astype(np.float32), part, layer.depth, layer.part, layer.normal)


def smooth_normals(
    points: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, crease: float = 0.6
) -> Float[np.ndarray, "face 3 3"]:
    """Return unit normals of the triangles' corners, smooth over edges that bend by less than ``crease`` [rad]."""
    a, b, c = (points[faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-30)
    corners = np.argsort(faces.reshape(-1), kind="stable")
    starts = np.searchsorted(faces.reshape(-1)[corners], np.arange(len(points) + 1))
    out = _corner_normals(points, faces, flat, corners, starts, float(np.cos(crease)))
    return out / np.maximum(np.linalg.norm(out, axis=2, keepdims=True), 1e-30)


@njit(cache=True, nogil=True)
def _corner_normals(points, faces, flat, corners, starts, least):  # pragma: no cover - compiled
    out = np.zeros((len(faces), 3, 3))
    weight = np.empty(len(faces) * 3)
    for f in range(len(faces)):
        for k in range(3):
            o = points[faces[f, k]]
            u, v = points[faces[f, (k + 1) % 3]] - o, points[faces[f, (k + 2) % 3]] - o
            length = np.sqrt((u * u).sum() * (v * v).sum())
            cosine = (u * v).sum() / max(length, 1e-30)
            weight[3 * f + k] = np.arccos(min(max(cosine, -1.0), 1.0))
    for vertex in range(len(points)):
        for m in range(starts[vertex], starts[vertex + 1]):
            f, k = corners[m] // 3, corners[m] % 3
            for n in range(starts[vertex], starts[vertex + 1]):
                g = corners[n] // 3
                if (flat[f] * flat[g]).sum() >= least:
                    out[f, k] += weight[corners[n]] * flat[g]
    return out


@njit(cache=True, nogil=True)
def _draw(points, faces, normals, number, depth, part, normal):  # pragma: no cover - compiled
    rows, columns = depth.shape
    shaded = len(normals) > 0
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = points[i, 0], points[i, 1], points[i, 2]
        bx, by, bz = points[j, 0], points[j, 1], points[j, 2]
        cx, cy, cz = points[k, 0], points[k, 1], points[k, 2]
        det = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(det) < 1e-12:
            continue
        left = max(0, int(np.ceil(min(ax, bx, cx))))
        right = min(columns - 1, int(np.floor(max(ax, bx, cx))))
        top = max(0, int(np.ceil(min(ay, by, cy))))
        bottom = min(rows - 1, int(np.floor(max(ay, by, cy))))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                u = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / det
                v = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / det
                if u < -1e-9 or v < -1e-9 or u + v > 1.0 + 1e-9:
                    continue
                z = az + u * (bz - az) + v * (cz - az)
                if z < depth[y, x]:
                    depth[y, x] = z
                    part[y, x] = number
                    if not shaded:
                        continue
                    for axis in range(3):
                        first = normals[f, 0, axis]
                        normal[y, x, axis] = (
                            first + u * (normals[f, 1, axis] - first) + v * (normals[f, 2, axis] - first)
                        )
