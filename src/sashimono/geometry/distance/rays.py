"""Where a ray meets a closed triangle mesh, on the hierarchy that the signed distance already has."""

from __future__ import annotations

from typing import Literal

import numpy as np
from jaxtyping import Float
from numba import njit

from sashimono.geometry.distance.signed_distance import SignedDistance

_STACK_SIZE = 128


def cast_rays(
    surface: SignedDistance,
    origins: Float[np.ndarray, "ray 3"],
    directions: Float[np.ndarray, "ray 3"],
    *,
    side: Literal["entering", "leaving"],
) -> tuple[Float[np.ndarray, "ray"], Float[np.ndarray, "ray 3"]]:
    """Return the distance to the first crossing of each ray [m] and the outward normal of the face there.

    Only faces that the ray crosses into the solid (``"entering"``) or out of it (``"leaving"``) count,
    so a ray that starts on the surface and goes inward does not meet the face it starts on. A ray that
    meets nothing has distance inf and a zero normal. Directions are unit vectors.
    """
    boxes, links, triangles, normals = surface.hierarchy
    origins = np.ascontiguousarray(origins, dtype=np.float64)
    directions = np.ascontiguousarray(directions, dtype=np.float64)
    distances = np.empty(len(origins))
    hits = np.empty(len(origins), np.int64)
    sign = 1.0 if side == "leaving" else -1.0
    _cast(origins, directions, sign, boxes, links, triangles, distances, hits)
    return distances, np.where((hits >= 0)[:, None], normals[np.maximum(hits, 0)], 0.0)


@njit(cache=True, nogil=True, inline="always")
def _box_entry(o, inverse, box):  # pragma: no cover - compiled
    """Distance at which the ray enters the box; inf if it misses it. A tiny slack keeps flat boxes whole."""
    near, far = 0.0, np.inf
    for k in range(3):
        t1 = (box[k] - o[k]) * inverse[k]
        t2 = (box[3 + k] - o[k]) * inverse[k]
        if t1 > t2:
            t1, t2 = t2, t1
        near = max(near, t1)
        far = min(far, t2)
    return near if near <= far * (1.0 + 1e-12) + 1e-12 else np.inf


@njit(cache=True, nogil=True, inline="always")
def _triangle_crossing(o, d, sign, t):  # pragma: no cover - compiled
    """Distance to a triangle crossed on the wanted side (Möller & Trumbore, 1997); inf if there is none."""
    e1x, e1y, e1z = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    e2x, e2y, e2z = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    px, py, pz = d[1] * e2z - d[2] * e2y, d[2] * e2x - d[0] * e2z, d[0] * e2y - d[1] * e2x
    det = e1x * px + e1y * py + e1z * pz  # = -direction · (unnormalised normal)
    size = np.sqrt((e1x * e1x + e1y * e1y + e1z * e1z) * (e2x * e2x + e2y * e2y + e2z * e2z))
    if -sign * det <= 1e-9 * size:
        return np.inf
    sx, sy, sz = o[0] - t[0, 0], o[1] - t[0, 1], o[2] - t[0, 2]
    u = (sx * px + sy * py + sz * pz) / det
    if u < -1e-9 or u > 1.0 + 1e-9:
        return np.inf
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    v = (d[0] * qx + d[1] * qy + d[2] * qz) / det
    if v < -1e-9 or u + v > 1.0 + 1e-9:
        return np.inf
    distance = (e2x * qx + e2y * qy + e2z * qz) / det
    return distance if distance >= 0.0 else np.inf


@njit(cache=True, nogil=True)
def _cast(origins, directions, sign, boxes, links, triangles, distances, hits):  # pragma: no cover - compiled
    stack = np.empty(_STACK_SIZE, np.int32)
    inverse = np.empty(3)
    for ray in range(origins.shape[0]):
        o, d = origins[ray], directions[ray]
        for k in range(3):
            inverse[k] = 1.0 / d[k] if abs(d[k]) > 1e-300 else 1e300
        best, hit = np.inf, -1
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            if _box_entry(o, inverse, boxes[node]) >= best:
                continue
            first, count = links[node, 0], links[node, 1]
            if count > 0:
                for m in range(first, first + count):
                    distance = _triangle_crossing(o, d, sign, triangles[m])
                    if distance < best:
                        best, hit = distance, m
                continue
            stack[top] = first
            stack[top + 1] = first + 1
            top += 2
        distances[ray] = best
        hits[ray] = hit
