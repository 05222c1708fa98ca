"""Resting poses: which faces of its convex hull can a part stand on?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.motion.config import RestingConfig

_SAME_FACE = float(np.cos(np.radians(2.0)))
_FLAT = 1e-7
"""Angle below which faces are one whatever the part [rad]: rounding."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StablePose:
    """A face of the convex hull over which the centre of mass stands."""

    down_part: Float[np.ndarray, "3"]
    """Outward unit normal of the face, in the part's frame: it points down when the part stands on it."""
    margin: float
    """Distance from the centre of mass's foot to the nearest edge of the face [m]."""
    height: float
    """Height of the centre of mass [m]."""
    probability: float
    """That the part, put down turned at random, comes to rest on this face (Goldberg et al., "Part pose statistics",
    1999): the share of all directions, seen from the centre of mass, of this face and of those that tip onto it."""

    @property
    def tipping_angle(self) -> float:
        """Tilt of the table that the pose withstands [rad]."""
        return float(np.arctan2(self.margin, self.height))


def stable_poses(body: Body, config: RestingConfig | None = None) -> tuple[StablePose, ...]:
    """Return every face on which the part stands, most stable first; never empty.

    A part without a clear face (a sphere, a lying cylinder) stands on one facet of
    its mesh: the one nearest to the centre of mass holds it, however narrow.
    """
    config = config or RestingConfig()
    angle = config.coplanar_angle
    poses = _poses(body, angle)
    while angle > _FLAT and not all(_stands(body, pose, config.touching_height) for pose in poses):
        angle /= 10.0
        poses = _poses(body, angle)
    return poses


def _stands(body: Body, pose: StablePose, touching_height: float) -> bool:
    """Whether the centre of mass is over the corners that touch the table, or the pose is one on a line or a point."""
    if pose.margin <= 0.0:
        return True
    points = body.hull_points
    heights = points @ pose.down_part
    feet = points[heights >= heights.max() - touching_height * body.smallest_extent]
    across = np.cross(pose.down_part, np.eye(3)[int(np.argmin(np.abs(pose.down_part)))])
    plane = np.stack([across / np.linalg.norm(across), np.cross(pose.down_part, across / np.linalg.norm(across))])
    try:
        sides = ConvexHull((feet - body.mass_center) @ plane.T).equations
    except (QhullError, ValueError):  # an edge or a point
        return False
    return bool((sides[:, 2] < 0.0).all())


def _poses(body: Body, coplanar_angle: float) -> tuple[StablePose, ...]:
    """Stable poses on faces of which neighbouring triangles differ by less than an angle [rad]."""
    hull, points = body.hull, body.hull.points
    corners = points[hull.simplices]
    normals = hull.equations[:, :3]
    faces = _coplanar_faces(hull.neighbors, normals, coplanar_angle)
    # edge k of a triangle lies opposite its corner k, and so does neighbour k
    origin, ahead = corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]
    along = ahead - origin
    along = along / np.maximum(np.linalg.norm(along, axis=2, keepdims=True), np.finfo(float).tiny)
    inward = corners - origin
    inward = inward - (inward * along).sum(axis=2, keepdims=True) * along
    lengths = np.linalg.norm(inward, axis=2, keepdims=True)
    inward = np.divide(inward, lengths, out=np.zeros_like(inward), where=lengths > 0.0)
    inside = ((body.mass_center - origin) * inward).sum(axis=2)
    inside[(faces[hull.neighbors] == faces[:, None]) | (lengths[:, :, 0] == 0.0)] = np.inf
    margins = np.full(faces.max() + 1, np.inf)
    np.minimum.at(margins, faces, inside.min(axis=1))
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    downs = np.zeros((len(margins), 3))
    np.add.at(downs, faces, normals * areas[:, None])
    lengths = np.linalg.norm(downs, axis=1)
    solid = lengths > 0.0
    downs[solid] /= lengths[solid, None]
    heights = (body.hull_points @ downs.T).max(axis=0) - body.mass_center @ downs.T
    stable = np.flatnonzero(solid & (margins > 0.0) & np.isfinite(margins))
    if not len(stable):
        stable = np.array([np.argmin(np.where(solid, heights, np.inf))])
    chances = _chances(_solid_angles(corners - body.mass_center), faces, inside, faces[hull.neighbors], stable)
    poses = [
        StablePose(
            probability=float(chances[k]),
            down_part=downs[k],
            margin=max(float(margins[k]), 0.0) if np.isfinite(margins[k]) else 0.0,
            height=float(heights[k]),
        )
        for k in stable
    ]
    # rounding keeps mirror-image faces in mesh order, whatever the last bits say
    return tuple(sorted(poses, key=lambda pose: -round(pose.tipping_angle, 6)))


def stable_at(body: Body, R_world_part: Float[np.ndarray, "3 3"], normal: Float[np.ndarray, "3"]) -> StablePose:
    """Return the stable pose that a part turned like this stands in; one that withstands no tilt if there is none."""
    down = -R_world_part.T @ normal
    found = max(stable_poses(body), key=lambda pose: float(pose.down_part @ down))
    if found.down_part @ down > _SAME_FACE:
        return found
    return StablePose(down_part=down, margin=0.0, height=body.radius, probability=0.0)


def _solid_angles(corners: Float[np.ndarray, "triangle 3 3"]) -> Float[np.ndarray, "triangle"]:
    """Solid angle of each triangle seen from the origin (van Oosterom and Strackee, 1983)."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    volume = np.abs((a * np.cross(b, c)).sum(axis=1))
    rest = la * lb * lc + (a * b).sum(axis=1) * lc + (a * c).sum(axis=1) * lb + (b * c).sum(axis=1) * la
    return 2.0 * np.arctan2(volume, rest)


def _chances(
    angles: np.ndarray, faces: np.ndarray, inside: np.ndarray, across: np.ndarray, stable: np.ndarray
) -> np.ndarray:
    """The probability of each face: what is not stable tips over its outermost edge, onto the face ``across``."""
    count = faces.max() + 1
    target = np.arange(count)
    order = np.lexsort([inside.reshape(-1), np.repeat(faces, 3)])
    first = order[np.searchsorted(np.repeat(faces, 3)[order], target)]
    falls = np.ones(count, dtype=np.bool_)
    falls[stable] = False
    target[falls] = across.reshape(-1)[first[falls]]
    # a fall lowers the centre of mass, so that no face is met twice
    for _ in range(count):
        if (ahead := target[target]).tolist() == target.tolist():
            break
        target = ahead
    chances = np.bincount(target, weights=np.bincount(faces, weights=angles, minlength=count), minlength=count)
    return chances / chances[stable].sum() if chances[stable].sum() > 0.0 else np.full(count, 1.0 / len(stable))


def resting_rotation(
    body: Body,
    R_assembled: Float[np.ndarray, "3 3"],
    normal: Float[np.ndarray, "3"],
    config: RestingConfig,
) -> tuple[Float[np.ndarray, "3 3"], StablePose]:
    """Return the rotation in which the part rests on the table, and the stable pose it stands in.

    Among the poses that are stable enough, the one least turned from the assembled
    rotation; if none is, the most stable one.
    """
    poses = stable_poses(body, config)
    enough = [pose for pose in poses if pose.tipping_angle >= config.min_tipping_angle] or poses[:1]
    turns = [_least_rotation(R_assembled @ pose.down_part, -normal) for pose in enough]
    best = min(range(len(enough)), key=lambda k: (round(_angle(turns[k]), 3), k))
    return turns[best] @ R_assembled, enough[best]


def _coplanar_faces(neighbors: np.ndarray, normals: np.ndarray, angle: float) -> np.ndarray:
    """Label the hull's triangles by the flat face they belong to."""
    count = len(normals)
    first = np.repeat(np.arange(count), 3)
    second = neighbors.reshape(-1)
    flat = (np.linalg.norm(normals[first] - normals[second], axis=1) < angle) & (second >= 0)
    graph = coo_array((np.ones(flat.sum()), (first[flat], second[flat])), shape=(count, count))
    return connected_components(graph, directed=False)[1]


def _least_rotation(a: Float[np.ndarray, "3"], b: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The least rotation that turns the unit vector a into b."""
    axis = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(axis)), float(a @ b)
    if sine < 1e-9:
        if cosine > 0.0:
            return np.eye(3)
        axis = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
        return se3.exp_so3(np.pi * axis / np.linalg.norm(axis))
    return se3.exp_so3(axis / sine * np.arctan2(sine, cosine))


def _angle(R: Float[np.ndarray, "3 3"]) -> float:
    return float(np.linalg.norm(se3.log_so3(R)))
