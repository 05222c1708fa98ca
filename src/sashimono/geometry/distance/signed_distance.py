"""Exact signed distance from points to a closed triangle mesh.

A bounding volume hierarchy finds the closest triangle; the sign comes from angle-weighted
pseudonormals (Bærentzen & Aanæs, "Signed distance computation using the angle weighted
pseudonormal", 2005), which is right at faces, edges and vertices alike.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from numba import njit

from sashimono.geometry.mesh.topology import edges

_LEAF_SIZE = 4
STACK_SIZE = 128
"""Nodes that wait at most in a walk down the hierarchy."""
_MIDPOINT_LEVELS = 64
"""Below this level nodes are halved by count, so that the depth stays under the stack size."""


class SignedDistance:
    """Signed distance to one closed mesh, negative inside; built once, queried often.

    Queries release the interpreter lock, so threads may share one object.
    """

    def __init__(self, vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> None:
        triangles = np.ascontiguousarray(vertices[faces], dtype=np.float64)
        order, boxes, links = _build(triangles)
        self._boxes = boxes
        self._links = links
        self._triangles = triangles[order]
        self._normals = _pseudonormals(vertices, faces)[order]

    @property
    def hierarchy(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The boxes (node, 6), links (node, 2), triangles (face, 3, 3) and unit face normals, in tree order."""
        return self._boxes, self._links, self._triangles, self._normals[:, 0]

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """The boxes (node, 6), links (node, 2), triangles (face, 3, 3) and pseudonormals (face, 7, 3), in tree order:
        what the compiled functions `nearest`, `nearest_normal` and `signed_distance` take."""
        return self._boxes, self._links, self._triangles, self._normals

    def query(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Return the signed distance of each point [m], negative inside."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        out = np.empty(len(points))
        _query(points, self._boxes, self._links, self._triangles, self._normals, out)
        return out

    def normals(
        self, points: Float[np.ndarray, "n 3"], bound: float
    ) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n 3"]]:
        """Return the signed distance [m] and its unit gradient at points nearer than ``bound``; (inf, 0) elsewhere."""
        out = np.empty((len(points), 4))
        _normals(np.ascontiguousarray(points, dtype=np.float64), bound, *self.arrays, out)
        return out[:, 0], out[:, 1:]

    def bounds_on(self, triangles: Float[np.ndarray, "n 3 3"]) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
        """Return the distance of each triangle's centre from the surface, and a bound of that of any of its points [m].

        No point is farther from the surface than from the face nearest to the centre, and the distance from one face is
        convex: it is greatest at a corner.
        """
        out = np.empty((2, len(triangles)))
        _bounds_on(np.ascontiguousarray(triangles, dtype=np.float64), *self.arrays, out)
        return out[0], out[1]

    def depth(self, points: Float[np.ndarray, "n 3"], T: Float[np.ndarray, "4 4"]) -> float:
        """Return how deep the deepest of the points, moved by T, lies inside [m]; 0 if none does."""
        return float(_depth(points, T, self._boxes, self._links, self._triangles, self._normals)[0])

    def deepest(self, points: Float[np.ndarray, "n 3"], T: Float[np.ndarray, "4 4"]) -> tuple[float, int]:
        """Return the same, and which point it is; -1 if none lies inside."""
        depth, index = _depth(points, T, self._boxes, self._links, self._triangles, self._normals)
        return float(depth), int(index)

    def contains(self, point: Float[np.ndarray, "3"]) -> bool:
        """Return whether the point lies strictly inside."""
        return bool(self.query(np.asarray(point, dtype=np.float64)[None])[0] < 0.0)


def _pseudonormals(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> Float[np.ndarray, "face 7 3"]:
    """Return, for each face, the normals of its inside, its 3 vertices and its 3 edges (ab, bc, ca)."""
    triangles = vertices[faces]
    sides = triangles[:, [1, 2, 0]] - triangles
    face_normals = np.cross(sides[:, 0], -sides[:, 2])
    lengths = np.linalg.norm(face_normals, axis=1, keepdims=True)
    face_normals = np.divide(face_normals, lengths, out=np.zeros_like(face_normals), where=lengths > 0.0)
    unit = np.linalg.norm(sides, axis=2, keepdims=True)
    unit = np.divide(sides, unit, out=np.zeros_like(sides), where=unit > 0.0)
    angles = np.arccos(np.clip(-(unit * unit[:, [2, 0, 1]]).sum(axis=2), -1.0, 1.0))
    weighted = face_normals[:, None] * angles[:, :, None]
    vertex_normals = _sum_by(faces.reshape(-1), weighted.reshape(-1, 3), len(vertices))
    edge_of = edges(faces).of_face
    edge_normals = _sum_by(edge_of.reshape(-1), np.repeat(face_normals, 3, axis=0), int(edge_of.max()) + 1)
    out = np.empty((len(faces), 7, 3))
    out[:, 0] = face_normals
    out[:, 1:4] = vertex_normals[faces]
    out[:, 4:7] = edge_normals[edge_of]
    return out


def _sum_by(owner: Int[np.ndarray, "n"], vectors: Float[np.ndarray, "n 3"], count: int) -> Float[np.ndarray, "count 3"]:
    return np.stack([np.bincount(owner, weights=vectors[:, k], minlength=count) for k in range(3)], axis=1)


@njit(cache=True, nogil=True)
def _build(triangles):  # pragma: no cover - compiled
    """Midpoint-split hierarchy: triangle order, node boxes (node, 6), links (first child or start, count)."""
    n = triangles.shape[0]
    centers = np.empty((n, 3))
    order = np.empty(n, np.int64)
    for m in range(n):
        order[m] = m
        for k in range(3):
            centers[m, k] = (triangles[m, 0, k] + triangles[m, 1, k] + triangles[m, 2, k]) / 3.0
    boxes = np.empty((2 * n + 1, 6))
    links = np.zeros((2 * n + 1, 2), np.int32)
    todo = np.empty((STACK_SIZE, 4), np.int64)
    todo[0, 0], todo[0, 1], todo[0, 2], todo[0, 3] = 0, 0, n, 0
    top = 1
    nodes = 1
    low = np.empty(3)
    high = np.empty(3)
    while top > 0:
        top -= 1
        node, start, stop, level = todo[top, 0], todo[top, 1], todo[top, 2], todo[top, 3]
        for k in range(3):
            boxes[node, k], boxes[node, 3 + k] = np.inf, -np.inf
            low[k], high[k] = np.inf, -np.inf
            for m in range(start, stop):
                for c in range(3):
                    boxes[node, k] = min(boxes[node, k], triangles[order[m], c, k])
                    boxes[node, 3 + k] = max(boxes[node, 3 + k], triangles[order[m], c, k])
                low[k] = min(low[k], centers[order[m], k])
                high[k] = max(high[k], centers[order[m], k])
        if stop - start <= _LEAF_SIZE:
            links[node, 0], links[node, 1] = start, stop - start
            continue
        axis = 0
        for k in range(1, 3):
            if high[k] - low[k] > high[axis] - low[axis]:
                axis = k
        cut = 0.5 * (low[axis] + high[axis])
        middle = start
        for m in range(start, stop):
            if centers[order[m], axis] < cut:
                order[m], order[middle] = order[middle], order[m]
                middle += 1
        if level > _MIDPOINT_LEVELS or not start < middle < stop:
            middle = (start + stop) // 2
        links[node, 0] = nodes
        todo[top, 0], todo[top, 1], todo[top, 2], todo[top, 3] = nodes, start, middle, level + 1
        todo[top + 1, 0], todo[top + 1, 1], todo[top + 1, 2], todo[top + 1, 3] = nodes + 1, middle, stop, level + 1
        top += 2
        nodes += 2
    return order, boxes[:nodes].copy(), links[:nodes].copy()


@njit(cache=True, nogil=True, inline="always")
def _box_distance2(x, y, z, box):  # pragma: no cover - compiled
    dx = max(box[0] - x, 0.0, x - box[3])
    dy = max(box[1] - y, 0.0, y - box[4])
    dz = max(box[2] - z, 0.0, z - box[5])
    return dx * dx + dy * dy + dz * dz


@njit(cache=True, nogil=True)
def closest_on_triangle(x, y, z, t):  # pragma: no cover - compiled
    """Return the closest point on a triangle (Ericson, Real-Time Collision Detection, 5.1.5) and its feature."""
    abx, aby, abz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    acx, acy, acz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    apx, apy, apz = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return t[0, 0], t[0, 1], t[0, 2], 1
    bpx, bpy, bpz = x - t[1, 0], y - t[1, 1], z - t[1, 2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return t[1, 0], t[1, 1], t[1, 2], 2
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3) if d1 > d3 else 0.0  # an edge of no length
        return t[0, 0] + v * abx, t[0, 1] + v * aby, t[0, 2] + v * abz, 4
    cpx, cpy, cpz = x - t[2, 0], y - t[2, 1], z - t[2, 2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return t[2, 0], t[2, 1], t[2, 2], 3
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6) if d2 > d6 else 0.0
        return t[0, 0] + w * acx, t[0, 1] + w * acy, t[0, 2] + w * acz, 6
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        edge = (d4 - d3) + (d5 - d6)
        w = (d4 - d3) / edge if edge > 0.0 else 0.0
        return (
            t[1, 0] + w * (t[2, 0] - t[1, 0]),
            t[1, 1] + w * (t[2, 1] - t[1, 1]),
            t[1, 2] + w * (t[2, 2] - t[1, 2]),
            5,
        )
    total = va + vb + vc
    if total <= 0.0:  # a sliver of no area
        return t[0, 0], t[0, 1], t[0, 2], 1
    v = vb / total
    w = vc / total
    return t[0, 0] + abx * v + acx * w, t[0, 1] + aby * v + acy * w, t[0, 2] + abz * v + acz * w, 0


@njit(cache=True, nogil=True)
def nearest(x, y, z, bound, boxes, links, triangles, normals):  # pragma: no cover - compiled
    """Signed distance of one point, its nearest triangle and the feature of it; (inf, -1, 0) past ``bound``."""
    nodes = np.empty(STACK_SIZE, np.int32)
    bounds = np.empty(STACK_SIZE)
    nodes[0] = 0
    bounds[0] = _box_distance2(x, y, z, boxes[0])
    top = 1
    best = bound * bound
    sign, found, kind = 1.0, -1, 0
    while top > 0:
        top -= 1
        if bounds[top] > best:
            continue
        node = nodes[top]
        first, count = links[node, 0], links[node, 1]
        if count > 0:
            for m in range(first, first + count):
                qx, qy, qz, feature = closest_on_triangle(x, y, z, triangles[m])
                dx, dy, dz = x - qx, y - qy, z - qz
                d2 = dx * dx + dy * dy + dz * dz
                if d2 < best:
                    best, found, kind = d2, m, feature
                    normal = normals[m, feature]
                    sign = -1.0 if dx * normal[0] + dy * normal[1] + dz * normal[2] < 0.0 else 1.0
            continue
        near, far = first, first + 1
        d_near = _box_distance2(x, y, z, boxes[near])
        d_far = _box_distance2(x, y, z, boxes[far])
        if d_far < d_near:
            near, far = far, near
            d_near, d_far = d_far, d_near
        if d_far <= best:
            nodes[top] = far
            bounds[top] = d_far
            top += 1
        if d_near <= best:
            nodes[top] = near
            bounds[top] = d_near
            top += 1
    if found < 0:
        return np.inf, found, kind
    return sign * np.sqrt(best), found, kind


@njit(cache=True, nogil=True)
def signed_distance(x, y, z, boxes, links, triangles, normals):  # pragma: no cover - compiled
    """Signed distance of one point."""
    return nearest(x, y, z, np.inf, boxes, links, triangles, normals)[0]


@njit(cache=True, nogil=True)
def nearest_normal(x, y, z, bound, boxes, links, triangles, normals):  # pragma: no cover - compiled
    """Signed distance of one point, and its gradient; on the surface, the normal there. (inf, 0) past ``bound``."""
    d, m, kind = nearest(x, y, z, bound, boxes, links, triangles, normals)
    if m < 0:
        return d, 0.0, 0.0, 0.0
    nx, ny, nz = gradient(x, y, z, d, m, kind, bound, triangles, normals)
    return d, nx, ny, nz


@njit(cache=True, nogil=True)
def bound_by(x, y, z, triangle):  # pragma: no cover - compiled
    """A bound for `nearest` from a triangle that may be the nearest: so that it is found, with its sign, if it is."""
    qx, qy, qz, _ = closest_on_triangle(x, y, z, triangle)
    return 1e-150 + (1.0 + 1e-6) * np.sqrt((x - qx) ** 2 + (y - qy) ** 2 + (z - qz) ** 2)


@njit(cache=True, nogil=True)
def gradient(x, y, z, d, m, kind, bound, triangles, normals):  # pragma: no cover - compiled
    """Unit gradient of the signed distance d of a point whose nearest triangle is m; on the surface, the normal there.

    ``bound``: the surface is what is nearer than a millionth of this.
    """
    if kind > 0 and abs(d) > 1e-6 * bound:
        qx, qy, qz, _ = closest_on_triangle(x, y, z, triangles[m])
        return (x - qx) / d, (y - qy) / d, (z - qz) / d
    n = normals[m, kind]
    length = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    return n[0] / length, n[1] / length, n[2] / length


@njit(cache=True, nogil=True)
def _query(points, boxes, links, triangles, normals, out):  # pragma: no cover - compiled
    for k in range(points.shape[0]):
        out[k] = signed_distance(points[k, 0], points[k, 1], points[k, 2], boxes, links, triangles, normals)


@njit(cache=True, nogil=True)
def _bounds_on(pieces, boxes, links, triangles, normals, out):  # pragma: no cover - compiled
    for k in range(pieces.shape[0]):
        t = pieces[k]
        x, y, z = (
            (t[0, 0] + t[1, 0] + t[2, 0]) / 3.0,
            (t[0, 1] + t[1, 1] + t[2, 1]) / 3.0,
            (t[0, 2] + t[1, 2] + t[2, 2]) / 3.0,
        )
        d, face, _ = nearest(x, y, z, np.inf, boxes, links, triangles, normals)
        most = 0.0
        for c in range(3):
            qx, qy, qz, _ = closest_on_triangle(t[c, 0], t[c, 1], t[c, 2], triangles[face])
            dx, dy, dz = t[c, 0] - qx, t[c, 1] - qy, t[c, 2] - qz
            most = max(most, dx * dx + dy * dy + dz * dz)
        out[0, k], out[1, k] = abs(d), np.sqrt(most)


@njit(cache=True, nogil=True)
def _normals(points, bound, boxes, links, triangles, normals, out):  # pragma: no cover - compiled
    for k in range(points.shape[0]):
        out[k] = nearest_normal(points[k, 0], points[k, 1], points[k, 2], bound, boxes, links, triangles, normals)


@njit(cache=True, nogil=True)
def _depth(points, T, boxes, links, triangles, normals):  # pragma: no cover - compiled
    deepest, index = 0.0, -1
    for k in range(points.shape[0]):
        x = T[0, 0] * points[k, 0] + T[0, 1] * points[k, 1] + T[0, 2] * points[k, 2] + T[0, 3]
        y = T[1, 0] * points[k, 0] + T[1, 1] * points[k, 1] + T[1, 2] * points[k, 2] + T[1, 3]
        z = T[2, 0] * points[k, 0] + T[2, 1] * points[k, 1] + T[2, 2] * points[k, 2] + T[2, 3]
        # a point this near to the box, or outside it, cannot be deeper
        if (
            x <= boxes[0, 0] + deepest
            or y <= boxes[0, 1] + deepest
            or z <= boxes[0, 2] + deepest
            or x >= boxes[0, 3] - deepest
            or y >= boxes[0, 4] - deepest
            or z >= boxes[0, 5] - deepest
        ):
            continue
        depth = -signed_distance(x, y, z, boxes, links, triangles, normals)
        if depth > deepest:
            deepest, index = depth, k
    return deepest, index
