"""A rigid body as the check sees it: exact distances, and surface samples in a hierarchy of balls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import manifold3d
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import ConvexHull, QhullError

from sashimono.verify.surface import Surface, box_distance

_FANOUT = 8
_WALL_RAYS = 600
_EQUAL_SPREADS = 1e-3  # relative difference under which a solid's spreads along two axes do not tell these apart


@dataclass(frozen=True, kw_only=True, eq=False)
class BallTree:
    """Surface samples, and balls over ever larger groups of them, all in one list.

    A ball covers its stretch of surface: a leaf's reaches halfway to its neighbours, an inner one holds its children's.
    """

    centers: Float[np.ndarray, "node 3"]
    radii: Float[np.ndarray, "node"]
    first_child: Int[np.ndarray, "node"]
    """-1 for the leaves, which are the samples themselves."""
    child_count: Int[np.ndarray, "node"]
    between: Bool[np.ndarray, "node"]
    """Samples that are no vertex of the mesh; false for inner balls."""
    root: int

    @property
    def leaves(self) -> Float[np.ndarray, "leaf 3"]:
        """The samples."""
        return self.centers[self.first_child < 0]


class SampledBody:
    """One closed surface; distances to it are exact, its sign from angle-weighted pseudonormals."""

    def __init__(
        self, name: str, vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, samples: int
    ) -> None:
        self.name = name
        self.vertices, self.faces = _merge(vertices, faces)
        self.low, self.high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        self.size = float(np.linalg.norm(self.high - self.low))
        self.volume, self.center_of_mass, covariance = _moments(self.vertices[self.faces])
        self.smallest_extent = _smallest_extent(self.vertices - self.center_of_mass, covariance)
        self._samples = samples
        self._normals = _pseudonormals(self.vertices, self.faces)
        self._surface = Surface(self.vertices, self.faces, self._normals)

    @cached_property
    def tree(self) -> BallTree:
        """Samples of the surface: every vertex, and points of edges and faces at about even spacing."""
        points, radii, between = _sample(self.vertices, self.faces, self._samples)
        return _ball_tree(points, radii, between)

    @cached_property
    def wall(self) -> float:
        """Thickness of the thin walls [m]: of the surface, one twentieth has less material straight behind it."""
        triangles = self.vertices[self.faces]
        area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
        share = (np.arange(_WALL_RAYS) + 0.5) / _WALL_RAYS
        # faces in proportion to area; the place on each from a low-discrepancy sequence (Roberts, R2)
        face = np.searchsorted(np.cumsum(area), share * area.sum()).clip(max=len(area) - 1)
        a, b = ((np.arange(_WALL_RAYS)[:, None] * [0.7548776662466927, 0.5698402909980532]) % 1.0).T
        a, b = np.where(a + b > 1.0, 1.0 - a, a), np.where(a + b > 1.0, 1.0 - b, b)
        corner = triangles[face]
        origin = corner[:, 0] + a[:, None] * (corner[:, 1] - corner[:, 0]) + b[:, None] * (corner[:, 2] - corner[:, 0])
        inward = -self._normals[face, 0]
        start = 1e-6 * self.size
        along = self._surface.first_hit(origin + start * inward, inward)
        thickness = along[np.isfinite(along)]
        return float(np.quantile(thickness, 0.05)) if len(thickness) else self.smallest_extent

    @cached_property
    def solid(self) -> manifold3d.Manifold | None:
        """The body for booleans; None if manifold3d does not take its mesh."""
        mesh = manifold3d.Mesh64(vert_properties=self.vertices, tri_verts=self.faces.astype(np.uint64))
        solid = manifold3d.Manifold(mesh)
        return solid if solid.status() == manifold3d.Error.NoError else None

    def reach(self, point: Float[np.ndarray, "3"]) -> float:
        """Return an upper bound of the distance of any point of the body from a point in its frame [m]."""
        return float(np.linalg.norm(np.maximum(np.abs(self.low - point), np.abs(self.high - point))))

    def box_in(self, T: Float[np.ndarray, "4 4"]) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        """Return least and greatest corner of a box around the body's own box, moved to a pose [m]."""
        middle, half = T[:3, :3] @ (0.5 * (self.low + self.high)) + T[:3, 3], 0.5 * (self.high - self.low)
        reach = np.abs(T[:3, :3]) @ half
        return middle - reach, middle + reach

    def box_distance(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Return the distance of each point to the body's box [m], 0 inside: never more than to the body."""
        return box_distance(points, self.low, self.high)

    def distance(
        self, points: Float[np.ndarray, "n 3"], beyond: Float[np.ndarray, "n"] | None = None
    ) -> Float[np.ndarray, "n"]:
        """Return the signed distance of each point to the surface [m], negative inside.

        Where it is no less than ``beyond`` [m], what is returned is only known to be no less than that.
        """
        return self._surface.distance(points, beyond)

    def gap(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Return the distance of each point to the surface [m], from inside too."""
        return self._surface.gap(points)

    def greatest_gap(self, triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n"]:
        """Return for each triangle a distance from the surface that none of its points exceeds [m]."""
        return self._surface.greatest_gap(triangles)

    def contains(self, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Return which points are inside by the winding number (Jacobson et al. 2013).

        Right also where the surface folds back on, or touches, itself, where the sign of `distance` may not be.
        """
        return self._surface.contains(points)

    def thickness_at(self, points: Float[np.ndarray, "n 3"], depths: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n"]:
        """Return how thick the body is at points inside it that are so deep: straight in from the nearest face [m]."""
        return depths + self._surface.first_hit(points, -self.nearest_normal(points))

    def nearest_normal(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the outward normal of the face nearest to each point."""
        return self._normals[self._surface.nearest_face(points), 0]


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ij->i", a, b)


def _merge(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Join vertices at the same place and drop faces that collapse, so that every edge knows both its faces."""
    unique, inverse = np.unique(vertices, axis=0, return_inverse=True)
    faces = inverse.reshape(-1)[faces].astype(np.int64)
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return np.ascontiguousarray(unique, dtype=np.float64), np.ascontiguousarray(faces[distinct])


def _moments(triangles: Float[np.ndarray, "face 3 3"]) -> tuple[float, np.ndarray, np.ndarray]:
    """Return volume, centre of mass and the covariance of the solid, summed over tetrahedra to one inner point."""
    reference = triangles.reshape(-1, 3).mean(axis=0)
    corners = triangles - reference
    volumes = _dot(corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    volume = float(volumes.sum())
    if abs(volume) < 1e-30:  # no solid: fall back on the corners, so that a later check can say what is wrong
        points = corners.reshape(-1, 3)
        return 0.0, reference, np.cov(points.T)
    center = (volumes[:, None] * corners.sum(axis=1)).sum(axis=0) / (4.0 * volume)
    sums = corners.sum(axis=1)
    second = np.einsum("n,nci,ncj->ij", volumes, corners, corners) + np.einsum("n,ni,nj->ij", volumes, sums, sums)
    return volume, reference + center, second / (20.0 * volume) - np.outer(center, center)


def _smallest_extent(points: Float[np.ndarray, "n 3"], covariance: Float[np.ndarray, "3 3"]) -> float:
    """Return the smallest extent along the principal axes; where equal spreads leave them open, the least possible."""
    spreads, axes = np.linalg.eigh(covariance)
    along = points @ axes
    spans = np.ptp(along, axis=0)
    low, high = np.diff(spreads) < _EQUAL_SPREADS * spreads[2]
    if not (low or high):
        return float(spans.min())
    open_axes = [0, 1, 2] if low and high else [0, 1] if low else [1, 2]
    try:
        sides = ConvexHull(along[:, open_axes]).equations[:, :-1]
    except QhullError:  # flat: nothing to choose
        return float(spans.min())
    fixed = [spans[axis] for axis in range(3) if axis not in open_axes]
    return float(min([np.ptp(along[:, open_axes] @ side) for side in np.unique(np.round(sides, 7), axis=0)] + fixed))


def _pseudonormals(vertices: np.ndarray, faces: np.ndarray) -> Float[np.ndarray, "face 7 3"]:
    """Return each face's normal, those of its corners (angle-weighted) and of its edges ab, bc, ca (summed)."""
    corners = vertices[faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(crosses, axis=1, keepdims=True)
    face_normals = np.divide(crosses, twice_area, out=np.zeros_like(crosses), where=twice_area > 0.0)
    angles = np.empty(faces.shape)
    for k in range(3):
        a, b = corners[:, (k + 1) % 3] - corners[:, k], corners[:, (k + 2) % 3] - corners[:, k]
        angles[:, k] = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), _dot(a, b))
    vertex_normals = np.zeros_like(vertices)
    np.add.at(vertex_normals, faces.reshape(-1), (angles[:, :, None] * face_normals[:, None]).reshape(-1, 3))
    low, high = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)]), axis=0)
    _, edge = np.unique((low * len(vertices) + high).reshape(-1), return_inverse=True)
    edge_normals = np.zeros((edge.max() + 1, 3))
    np.add.at(edge_normals, edge.reshape(-1), np.repeat(face_normals, 3, axis=0))
    return np.concatenate([face_normals[:, None], vertex_normals[faces], edge_normals[edge.reshape(-1, 3)]], axis=1)


def _sample(vertices: np.ndarray, faces: np.ndarray, samples: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices, points along edges and points inside faces; how far each stands for the surface around it;
    and which are no vertices.

    No point of the surface is farther than the spacing from a sample; where faces are small, their own size counts.
    """
    triangles = vertices[faces]
    lengths = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
    area = 0.5 * np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    spacing = np.sqrt(area.sum() / samples)
    # long thin facets need more points along their edges than their area tells: widen the spacing until they fit
    while (0.5 * np.floor(lengths / spacing).sum() + area.sum() / spacing**2) > 2.0 * samples:
        spacing *= 1.25
    reach = np.zeros(len(vertices))
    np.maximum.at(reach, faces.reshape(-1), np.repeat(np.minimum(lengths.max(axis=1) / np.sqrt(3.0), spacing), 3))
    used = np.unique(faces)
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    ends = np.unique(np.sort(ends, axis=1), axis=0)
    between = np.concatenate(
        [
            _along(vertices[ends[:, 0]], vertices[ends[:, 1]], spacing),
            _inside_faces(triangles, lengths, area, spacing),
        ]
    )
    points = np.concatenate([vertices[used], between])
    return points, np.append(reach[used], np.full(len(between), spacing)), np.arange(len(points)) >= len(used)


def _along(starts: np.ndarray, stops: np.ndarray, spacing: float) -> Float[np.ndarray, "n 3"]:
    """Return points between the ends of each line, at most ``spacing`` apart."""
    pieces = np.ceil(np.linalg.norm(stops - starts, axis=1) / spacing).astype(np.int64).clip(min=1)
    rows, within = counted(pieces - 1)
    return starts[rows] + ((within + 1) / pieces[rows])[:, None] * (stops - starts)[rows]


def _inside_faces(
    triangles: np.ndarray, lengths: np.ndarray, area: np.ndarray, spacing: float
) -> Float[np.ndarray, "n 3"]:
    """Return points on lines parallel to each face's longest edge; none where the face is narrower than the spacing."""
    longest = lengths.argmax(axis=1)  # edge k joins corner k and the one before it
    index = np.arange(len(triangles))
    a, b = triangles[index, longest], triangles[index, longest - 1]
    apex = triangles[index, (longest + 1) % 3]
    lines = np.ceil(2.0 * area / lengths.max(axis=1) / spacing).astype(np.int64).clip(min=1) - 1
    rows, within = counted(lines)
    t = ((within + 1) / (lines[rows] + 1))[:, None]
    return _along(a[rows] + t * (apex - a)[rows], b[rows] + t * (apex - b)[rows], spacing)


def morton_code(points: Float[np.ndarray, "n d"], bits: int) -> Int[np.ndarray, "n"]:
    """Return where each point is along a Morton curve through a grid with so many bits an axis."""
    low, span = points.min(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-30)
    cells = ((points - low) / span * float((1 << bits) - 1)).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(bits):
        for axis, along in enumerate(cells.T):
            code |= ((along >> bit) & 1) << (len(cells.T) * bit + axis)
    return code


def counted(counts: Int[np.ndarray, "row"]) -> tuple[Int[np.ndarray, "n"], Int[np.ndarray, "n"]]:
    """Return each row as often as it counts, and how often it was there before."""
    rows = np.repeat(np.arange(len(counts)), counts)
    return rows, np.arange(len(rows)) - np.repeat(np.cumsum(counts) - counts, counts)


def _ball_tree(points: np.ndarray, radii: np.ndarray, between: np.ndarray) -> BallTree:
    """Group samples along a Morton curve, eight at a time, up to one ball."""
    order = np.argsort(morton_code(points, 10), kind="stable")
    levels = [(points[order], radii[order])]
    first, count = [np.full(len(points), -1)], [np.zeros(len(points), np.int64)]
    offset = 0
    while len(levels[-1][0]) > 1:
        centers, reach = levels[-1]
        starts = np.arange(0, len(centers), _FANOUT)
        sizes = np.diff(np.append(starts, len(centers)))
        box_low = np.minimum.reduceat(centers - reach[:, None], starts)
        box_high = np.maximum.reduceat(centers + reach[:, None], starts)
        middle = 0.5 * (box_low + box_high)
        far = np.linalg.norm(centers - np.repeat(middle, sizes, axis=0), axis=1) + reach
        levels.append((middle, np.maximum.reduceat(far, starts)))
        first.append(starts + offset)
        count.append(sizes)
        offset += len(centers)
    return BallTree(
        centers=np.concatenate([level[0] for level in levels]),
        radii=np.concatenate([level[1] for level in levels]),
        first_child=np.concatenate(first),
        child_count=np.concatenate(count),
        between=np.append(between[order], np.zeros(sum(len(level[0]) for level in levels[1:]), bool)),
        root=offset,
    )
