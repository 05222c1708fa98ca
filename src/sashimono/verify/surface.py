"""One closed surface of triangles, asked for distances and for what is inside: the check's own, and no planner's.

A hierarchy of boxes over the triangles, halved at the median. How near a point is matters only up to what would settle
the question, so a search starts from that bound. Signs are those of the feature that is nearest (Bærentzen & Aanæs
2005); a point for which no feature is near enough is told by the crossings of a ray from it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit

_LEAF = 4
"""Most triangles of a leaf."""
_STACK = 96
_ON_FEATURE = 1e-9
"""Distance, over the size, below which a closest point counts as lying on an edge or corner."""
_RAYS = np.array(
    [[0.5435, 0.2873, 0.7887], [-0.3711, 0.8329, -0.4106], [0.6127, -0.6611, -0.4331], [-0.7079, -0.4519, 0.5428]]
)
"""Directions of rays, one after another until one meets no edge."""
_GRAZING = 1e-7
"""Barycentric coordinate below which a ray counts as meeting an edge."""


def box_distance(
    points: Float[np.ndarray, "n 3"], low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "n"]:
    """Return the distance of each point to a box [m], 0 inside."""
    outside = np.maximum(np.maximum(low - points, points - high), 0.0)
    return np.sqrt(np.einsum("ij,ij->i", outside, outside))


class Surface:
    """A closed surface; distances are exact, negative inside."""

    def __init__(
        self,
        vertices: Float[np.ndarray, "vertex 3"],
        faces: Int[np.ndarray, "face 3"],
        normals: Float[np.ndarray, "face 7 3"] | None = None,
    ) -> None:
        """Take in the mesh, and the normals of each face, of its corners, and of its edges ab, bc, ca.

        Without normals no distance has a sign.
        """
        if normals is None:
            normals = np.zeros((len(faces), 7, 3))
        self._vertices, self._faces, self._normals = vertices, faces, normals
        self._near = _ON_FEATURE * float(np.linalg.norm(np.ptp(vertices, axis=0)))

    def distance(
        self, points: Float[np.ndarray, "n 3"], beyond: Float[np.ndarray, "n"] | None = None
    ) -> Float[np.ndarray, "n"]:
        """Return the signed distance of each point [m].

        Where it is no less than ``beyond`` [m], what is returned is only known to be no less than that.
        """
        points = np.ascontiguousarray(points, dtype=np.float64)
        bounds = np.full(len(points), np.inf) if beyond is None else np.ascontiguousarray(beyond, dtype=np.float64)
        return _distances(points, bounds, self._near, *self._tree)

    def contains(self, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Return which points are inside by the winding number, right also where the surface touches itself.

        A closed surface's winding number is the count of its crossings by a ray, out less in.
        """
        return _contained(np.ascontiguousarray(points, dtype=np.float64), self._near, *self._tree)

    def gap(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Return the distance of each point to the surface [m], from inside too."""
        return _gaps(np.ascontiguousarray(points, dtype=np.float64), *self._tree)

    def greatest_gap(self, triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n"]:
        """Return for each triangle a distance from the surface that none of its points exceeds [m].

        It is that of the corner farthest from one face: distance from a convex set is convex, and greatest at a corner.
        The face is the one nearest to the triangle's middle.
        """
        return _greatest_gaps(np.ascontiguousarray(triangles, dtype=np.float64), *self._tree)

    def first_hit(
        self, origins: Float[np.ndarray, "n 3"], directions: Float[np.ndarray, "n 3"]
    ) -> Float[np.ndarray, "n"]:
        """Return how far along its direction each ray first meets the surface; infinite if it does not."""
        rays = (np.ascontiguousarray(origins, dtype=np.float64), np.ascontiguousarray(directions, dtype=np.float64))
        return _first_hits(*rays, *self._tree)

    def nearest_face(self, points: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n"]:
        """Return the face nearest to each point; of several (at an edge), that which the point is straightest over."""
        return self._order[_nearest_faces(np.ascontiguousarray(points, dtype=np.float64), self._near, *self._tree)]

    @cached_property
    def _order(self) -> Int[np.ndarray, "face"]:
        return self._halved[0]

    @cached_property
    def _halved(self) -> tuple[Int[np.ndarray, "face"], Int[np.ndarray, "leaf"]]:
        """The faces in the order of the leaves, and where each leaf begins; last, their number.

        All leaves are equally deep: at every level each run of faces is halved along the longest side of its box.
        """
        middles = self._vertices[self._faces].mean(axis=1)
        order, starts = np.arange(len(middles)), np.array([0, len(middles)])
        while np.diff(starts).max() > _LEAF:
            runs = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
            placed = middles[order]
            low = np.minimum.reduceat(placed, starts[:-1])
            axis = (np.maximum.reduceat(placed, starts[:-1]) - low).argmax(axis=1)
            order = order[np.lexsort((placed[np.arange(len(placed)), axis[runs]], runs))]
            starts = np.unique(np.concatenate([starts, (starts[:-1] + starts[1:]) // 2]))
        return order, starts

    @cached_property
    def _tree(self) -> tuple[np.ndarray, ...]:
        """Boxes in heap order (the children of k are 2k + 1 and 2k + 2), starts of leaves, triangles and normals."""
        order, starts = self._halved
        triangles = np.ascontiguousarray(self._vertices[self._faces[order]])
        low = np.minimum.reduceat(triangles.min(axis=1), starts[:-1])
        high = np.maximum.reduceat(triangles.max(axis=1), starts[:-1])
        levels = [np.stack([low, high], axis=1)]
        while len(levels[0]) > 1:
            below = levels[0]
            joined = [np.minimum(below[0::2, 0], below[1::2, 0]), np.maximum(below[0::2, 1], below[1::2, 1])]
            levels.insert(0, np.stack(joined, axis=1))
        return np.concatenate(levels), starts, triangles, np.ascontiguousarray(self._normals[order])


@njit(cache=True, nogil=True)
def _box_gap(x, y, z, box):  # pragma: no cover - compiled
    """Squared distance of a point to a box."""
    out = 0.0
    for axis in range(3):
        at = x if axis == 0 else (y if axis == 1 else z)
        gap = max(box[0, axis] - at, at - box[1, axis], 0.0)
        out += gap * gap
    return out


@njit(cache=True, nogil=True)
def _closest_on(x, y, z, t):  # pragma: no cover - compiled
    """Nearest point of a triangle (Ericson 2005, 5.1.5)."""
    abx, aby, abz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    acx, acy, acz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    apx, apy, apz = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    d1 = abx * apx + aby * apy + abz * apz
    d2 = acx * apx + acy * apy + acz * apz
    if d1 <= 0.0 and d2 <= 0.0:
        return t[0, 0], t[0, 1], t[0, 2]
    bpx, bpy, bpz = x - t[1, 0], y - t[1, 1], z - t[1, 2]
    d3 = abx * bpx + aby * bpy + abz * bpz
    d4 = acx * bpx + acy * bpy + acz * bpz
    if d3 >= 0.0 and d4 <= d3:
        return t[1, 0], t[1, 1], t[1, 2]
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3) if d1 > d3 else 0.0
        return t[0, 0] + v * abx, t[0, 1] + v * aby, t[0, 2] + v * abz
    cpx, cpy, cpz = x - t[2, 0], y - t[2, 1], z - t[2, 2]
    d5 = abx * cpx + aby * cpy + abz * cpz
    d6 = acx * cpx + acy * cpy + acz * cpz
    if d6 >= 0.0 and d5 <= d6:
        return t[2, 0], t[2, 1], t[2, 2]
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6) if d2 > d6 else 0.0
        return t[0, 0] + w * acx, t[0, 1] + w * acy, t[0, 2] + w * acz
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        total = (d4 - d3) + (d5 - d6)
        w = (d4 - d3) / total if total > 0.0 else 0.0
        return (
            t[1, 0] + w * (t[2, 0] - t[1, 0]),
            t[1, 1] + w * (t[2, 1] - t[1, 1]),
            t[1, 2] + w * (t[2, 2] - t[1, 2]),
        )
    total = va + vb + vc
    v, w = vb / total, vc / total
    return t[0, 0] + v * abx + w * acx, t[0, 1] + v * aby + w * acy, t[0, 2] + v * abz + w * acz


@njit(cache=True, nogil=True)
def _nearest(x, y, z, bound, boxes, starts, triangles):  # pragma: no cover - compiled
    """Squared distance, triangle, and nearest point; the triangle is -1 if none is nearer than the bound."""
    inner = len(starts) - 2
    nodes, gaps = np.empty(_STACK, np.int32), np.empty(_STACK)
    best, face = bound * bound, -1
    cx = cy = cz = 0.0
    nodes[0], gaps[0] = 0, _box_gap(x, y, z, boxes[0])
    top = 1
    while top > 0:
        top -= 1
        if gaps[top] >= best:
            continue
        node = nodes[top]
        if node >= inner:
            for m in range(starts[node - inner], starts[node - inner + 1]):
                px, py, pz = _closest_on(x, y, z, triangles[m])
                squared = (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2
                if squared < best:
                    best, face, cx, cy, cz = squared, m, px, py, pz
        else:
            left, right = 2 * node + 1, 2 * node + 2
            to_left, to_right = _box_gap(x, y, z, boxes[left]), _box_gap(x, y, z, boxes[right])
            if to_left < to_right:  # the nearer one on top
                left, right, to_left, to_right = right, left, to_right, to_left
            nodes[top], gaps[top] = left, to_left
            nodes[top + 1], gaps[top + 1] = right, to_right
            top += 2
    return best, face, cx, cy, cz


@njit(cache=True, nogil=True)
def _from_line(x, y, z, a, b):  # pragma: no cover - compiled
    """Squared distance of a point to the line through two others; infinite where these are one."""
    ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    squared = ex * ex + ey * ey + ez * ez
    if squared == 0.0:
        return np.inf
    px, py, pz = x - a[0], y - a[1], z - a[2]
    return ((ey * pz - ez * py) ** 2 + (ez * px - ex * pz) ** 2 + (ex * py - ey * px) ** 2) / squared


@njit(cache=True, nogil=True)
def _is_inside(x, y, z, cx, cy, cz, face, near, triangles, normals):  # pragma: no cover - compiled
    """Whether a point is behind the feature on which its nearest point lies.

    The feature is told by lengths, not by barycentric coordinates: on a needle these are all rounding.
    """
    t = triangles[face]
    feature, least = 0, near * near
    for k in range(3):
        off = _from_line(cx, cy, cz, t[k], t[(k + 1) % 3])
        if off < least:
            feature, least = 4 + k, off
    least = near * near
    for k in range(3):
        off = (cx - t[k, 0]) ** 2 + (cy - t[k, 1]) ** 2 + (cz - t[k, 2]) ** 2
        if off < least:
            feature, least = 1 + k, off
    n = normals[face, feature]
    return (x - cx) * n[0] + (y - cy) * n[1] + (z - cz) * n[2] < 0.0


@njit(cache=True, nogil=True)
def _meets_box(x, y, z, ray, box):  # pragma: no cover - compiled
    """Whether the ray meets the box."""
    first, last = 0.0, np.inf
    for axis in range(3):
        at = x if axis == 0 else (y if axis == 1 else z)
        if ray[axis] == 0.0:
            if at < box[0, axis] or at > box[1, axis]:
                return False
            continue
        t0, t1 = (box[0, axis] - at) / ray[axis], (box[1, axis] - at) / ray[axis]
        first, last = max(first, min(t0, t1)), min(last, max(t0, t1))
    return first <= last * (1.0 + 1e-12)


@njit(cache=True, nogil=True)
def _crossing(x, y, z, ray, t):  # pragma: no cover - compiled
    """1 where the ray leaves through the triangle, -1 where it enters, 0 if it passes, 2 if that is not clear."""
    e1x, e1y, e1z = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    e2x, e2y, e2z = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    px, py, pz = ray[1] * e2z - ray[2] * e2y, ray[2] * e2x - ray[0] * e2z, ray[0] * e2y - ray[1] * e2x
    det = e1x * px + e1y * py + e1z * pz
    sx, sy, sz = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    u, v = sx * px + sy * py + sz * pz, ray[0] * qx + ray[1] * qy + ray[2] * qz
    along = e2x * qx + e2y * qy + e2z * qz
    if det < 0.0:
        u, v, along, size = -u, -v, -along, -det
    else:
        size = det
    edge = _GRAZING * np.sqrt((e1x * e1x + e1y * e1y + e1z * e1z) * (e2x * e2x + e2y * e2y + e2z * e2z))
    if u < -edge or v < -edge or u + v > size + edge:
        return 0
    if size <= edge or u < edge or v < edge or u + v > size - edge:
        return 2
    if along <= 0.0:
        return 0
    return -1 if det > 0.0 else 1


@njit(cache=True, nogil=True)
def _winding(x, y, z, boxes, starts, triangles):  # pragma: no cover - compiled
    """Winding number of the surface about a point, by the first ray that meets no edge; and whether there is one."""
    inner = len(starts) - 2
    nodes = np.empty(_STACK, np.int32)
    for k in range(_RAYS.shape[0]):
        ray, count, clear = _RAYS[k], 0, True
        nodes[0] = 0
        top = 1
        while top > 0 and clear:
            top -= 1
            node = nodes[top]
            if not _meets_box(x, y, z, ray, boxes[node]):
                continue
            if node >= inner:
                for m in range(starts[node - inner], starts[node - inner + 1]):
                    crossed = _crossing(x, y, z, ray, triangles[m])
                    clear = clear and crossed != 2
                    count += crossed
            else:
                nodes[top], nodes[top + 1] = 2 * node + 1, 2 * node + 2
                top += 2
        if clear:
            return count, True
    return 0, False


@njit(cache=True, nogil=True)
def _distances(points, bounds, near, boxes, starts, triangles, normals):  # pragma: no cover - compiled
    out = np.empty(len(points))
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        # a bound of 0 or less asks only whether the point is inside: of points on the surface, no ray can tell
        squared, face, cx, cy, cz = _nearest(x, y, z, max(bounds[k], near), boxes, starts, triangles)
        if face < 0:
            outside = _box_gap(x, y, z, boxes[0]) > 0.0
            if not outside:
                winding, clear = _winding(x, y, z, boxes, starts, triangles)
                outside = clear and winding <= 0
            if outside:
                out[k] = np.inf
                continue
            squared, face, cx, cy, cz = _nearest(x, y, z, np.inf, boxes, starts, triangles)
        distance = np.sqrt(squared)
        out[k] = -distance if _is_inside(x, y, z, cx, cy, cz, face, near, triangles, normals) else distance
    return out


@njit(cache=True, nogil=True)
def _contained(points, near, boxes, starts, triangles, normals):  # pragma: no cover - compiled
    out = np.empty(len(points), np.bool_)
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        winding, clear = _winding(x, y, z, boxes, starts, triangles)
        if clear:
            out[k] = winding > 0
        else:
            _, face, cx, cy, cz = _nearest(x, y, z, np.inf, boxes, starts, triangles)
            out[k] = _is_inside(x, y, z, cx, cy, cz, face, near, triangles, normals)
    return out


@njit(cache=True, nogil=True)
def _gaps(points, boxes, starts, triangles, normals):  # pragma: no cover - compiled
    out = np.empty(len(points))
    for k in range(len(points)):
        squared, _, _, _, _ = _nearest(points[k, 0], points[k, 1], points[k, 2], np.inf, boxes, starts, triangles)
        out[k] = np.sqrt(squared)
    return out


@njit(cache=True, nogil=True)
def _greatest_gaps(corners, boxes, starts, triangles, normals):  # pragma: no cover - compiled
    out = np.empty(len(corners))
    for k in range(len(corners)):
        x, y, z = corners[k, :, 0].mean(), corners[k, :, 1].mean(), corners[k, :, 2].mean()
        _, face, _, _, _ = _nearest(x, y, z, np.inf, boxes, starts, triangles)
        squared = 0.0
        for m in range(3):
            x, y, z = corners[k, m, 0], corners[k, m, 1], corners[k, m, 2]
            px, py, pz = _closest_on(x, y, z, triangles[face])
            squared = max(squared, (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2)
        out[k] = np.sqrt(squared)
    return out


@njit(cache=True, nogil=True)
def _first_hits(origins, directions, boxes, starts, triangles, normals):  # pragma: no cover - compiled
    """Möller & Trumbore (1997), edges included."""
    inner = len(starts) - 2
    nodes = np.empty(_STACK, np.int32)
    out = np.empty(len(origins))
    for k in range(len(origins)):
        ray = directions[k]
        x, y, z = origins[k, 0], origins[k, 1], origins[k, 2]
        best = np.inf
        nodes[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = nodes[top]
            if not _meets_box(x, y, z, ray, boxes[node]):
                continue
            if node < inner:
                nodes[top], nodes[top + 1] = 2 * node + 1, 2 * node + 2
                top += 2
                continue
            for m in range(starts[node - inner], starts[node - inner + 1]):
                best = min(best, _travel_to(x, y, z, ray, triangles[m]))
        out[k] = best
    return out


@njit(cache=True, nogil=True)
def _travel_to(x, y, z, ray, t):  # pragma: no cover - compiled
    """Where along a ray it meets a triangle, infinite if it does not."""
    e1x, e1y, e1z = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    e2x, e2y, e2z = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    px, py, pz = ray[1] * e2z - ray[2] * e2y, ray[2] * e2x - ray[0] * e2z, ray[0] * e2y - ray[1] * e2x
    det = e1x * px + e1y * py + e1z * pz
    if det == 0.0:
        return np.inf
    sx, sy, sz = x - t[0, 0], y - t[0, 1], z - t[0, 2]
    qx, qy, qz = sy * e1z - sz * e1y, sz * e1x - sx * e1z, sx * e1y - sy * e1x
    u, v = (sx * px + sy * py + sz * pz) / det, (ray[0] * qx + ray[1] * qy + ray[2] * qz) / det
    along = (e2x * qx + e2y * qy + e2z * qz) / det
    if u < -1e-9 or v < -1e-9 or u + v > 1.0 + 1e-9 or along < 0.0:
        return np.inf
    return along


@njit(cache=True, nogil=True)
def _nearest_faces(points, near, boxes, starts, triangles, normals):  # pragma: no cover - compiled
    out = np.empty(len(points), np.int64)
    inner = len(starts) - 2
    nodes = np.empty(_STACK, np.int32)
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        squared, face, _, _, _ = _nearest(x, y, z, np.inf, boxes, starts, triangles)
        equal, straightest = (np.sqrt(squared) + near) ** 2, -1.0
        nodes[0] = 0
        top = 1
        while top > 0:
            top -= 1
            node = nodes[top]
            if _box_gap(x, y, z, boxes[node]) > equal:
                continue
            if node < inner:
                nodes[top], nodes[top + 1] = 2 * node + 1, 2 * node + 2
                top += 2
                continue
            for m in range(starts[node - inner], starts[node - inner + 1]):
                px, py, pz = _closest_on(x, y, z, triangles[m])
                if (x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2 <= equal:
                    n = normals[m, 0]
                    over = abs((x - px) * n[0] + (y - py) * n[1] + (z - pz) * n[2])
                    if over > straightest + near:
                        straightest, face = over, m
        out[k] = face
    return out
