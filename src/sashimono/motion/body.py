"""A part as level 2 sees it: convex hull, mass, size, and a collision object. Built once, used for a whole run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sashimono.assembly import Assembly, Part
from sashimono.geometry import se3
from sashimono.geometry.collision import Collider
from sashimono.geometry.signed_distance import SignedDistance


@dataclass(frozen=True, kw_only=True, eq=False)
class Body:
    """The geometry of one part, in the part's frame. Not for sharing between threads: see `Collider`."""

    name: str
    hull: ConvexHull
    hull_points: Float[np.ndarray, "point 3"]
    """Corners of the convex hull [m]."""
    mass_center: Float[np.ndarray, "3"]
    """Centre of mass of the homogeneous solid [m]."""
    center: Float[np.ndarray, "3"]
    """Centre of the bounding box, about which rotation is measured [m]."""
    radius: float
    """Distance of the farthest point from `center` [m]."""
    extents: Float[np.ndarray, "3"]
    """Extents along the inertia axes [m], ascending."""
    scale: float
    """Units of the collision objects in one metre, the same for all bodies of an assembly.

    In metres FCL's distances between triangles of 0.1 mm and less are wrong, some of them 0."""
    collider: Collider
    """In scaled units."""
    signed_distance: SignedDistance
    """In scaled units."""
    samples: Float[np.ndarray, "sample 3"]
    """Points of the surface: its vertices and the middles of its triangles [m]."""

    @property
    def size(self) -> float:
        """Half the geometric mean of the extents [m]: the scale of clearances, fair to rods and plates."""
        return float(np.cbrt(np.prod(self.extents)) / 2.0)

    def center_world(self, T_world_part: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "3"]:
        """Return where the centre is at this pose [m]."""
        return T_world_part[:3, :3] @ self.center + T_world_part[:3, 3]

    def support(
        self, T_world_part: Float[np.ndarray, "4 4"], directions: Float[np.ndarray, "direction 3"]
    ) -> tuple[Float[np.ndarray, "direction"], Float[np.ndarray, "direction"]]:
        """Return the least and greatest coordinate along each world direction at this pose [m]."""
        along = self.hull_points @ (T_world_part[:3, :3].T @ directions.T)
        shift = directions @ T_world_part[:3, 3]
        return along.min(axis=0) + shift, along.max(axis=0) + shift

    def move(self, T_world_part: Float[np.ndarray, "4 4"]) -> None:
        """Put the collision object at this pose."""
        self.collider.move(self._scaled(T_world_part))

    def collides(self, other: Body) -> bool:
        """Return whether the two share a point where they were last moved to, containment included."""
        return self.collider.collides(other.collider)

    def distance(self, other: Body) -> float:
        """Return the gap between the surfaces where they were last moved to [m], 0 if they cross."""
        return self.collider.distance(other.collider) / self.scale

    def depth(self, other: Body, T_self_other: Float[np.ndarray, "4 4"]) -> float:
        """Return how deep the other's surface samples, at this pose, lie inside [m]; 0 if none does."""
        return self.signed_distance.depth(other.samples * self.scale, self._scaled(T_self_other)) / self.scale

    def _scaled(self, T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
        out = T.copy()
        out[:3, 3] *= self.scale
        return out

    def lowest(self, T_world_part: Float[np.ndarray, "4 4"], normal: Float[np.ndarray, "3"]) -> float:
        """Return the least coordinate along the normal at this pose [m]."""
        return float((self.hull_points @ (T_world_part[:3, :3].T @ normal)).min() + normal @ T_world_part[:3, 3])


def convex_hull(points: Float[np.ndarray, "point 3"]) -> ConvexHull:
    """Return the convex hull; points of (nearly) no volume are joggled by Qhull."""
    try:
        return ConvexHull(points)
    except QhullError:
        return ConvexHull(points, qhull_options="QJ")


def make_body(part: Part, scale: float = 1.0) -> Body:
    """Return the part's geometry for level 2; ``scale`` as in `Body`."""
    vertices = part.vertices_part
    hull = convex_hull(vertices)
    corners = np.ascontiguousarray(vertices[hull.vertices])
    low, high = corners.min(axis=0), corners.max(axis=0)
    center = (low + high) / 2.0
    mass_center, axes = _mass_properties(vertices[part.faces], corners)
    signed_distance = SignedDistance(vertices * scale, part.faces)
    return Body(
        name=part.name,
        hull=hull,
        hull_points=corners,
        mass_center=mass_center,
        center=center,
        radius=float(np.linalg.norm(corners - center, axis=1).max()),
        extents=np.sort(np.ptp(corners @ axes, axis=0)),
        scale=scale,
        collider=Collider(vertices * scale, part.faces, signed_distance),
        signed_distance=signed_distance,
        samples=np.concatenate([vertices, vertices[part.faces].mean(axis=1)]),
    )


def make_bodies(assembly: Assembly) -> dict[str, Body]:
    """Return the geometry of every part, by name."""
    scale = 1000.0 / max(float(np.linalg.norm(part.bounds_world[1] - part.bounds_world[0])) for part in assembly.parts)
    return {part.name: make_body(part, scale) for part in assembly.parts}


def _mass_properties(
    triangles: Float[np.ndarray, "face 3 3"], corners: Float[np.ndarray, "point 3"]
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Centre of mass and inertia axes (columns); of the hull's box and corners if the surface bounds no volume."""
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = float((high - low).max())
    # unit scale about the middle, so that a small part far from the origin loses no digits
    mass = trimesh.triangles.mass_properties((triangles - (low + high) / 2.0) / scale)
    center = np.asarray(mass.center_mass) * scale + (low + high) / 2.0
    if mass.volume <= 0.0 or not ((center >= low) & (center <= high)).all():
        spread = np.cov(corners.T)
        return (low + high) / 2.0, np.linalg.eigh(spread)[1]
    return center, np.linalg.eigh(np.asarray(mass.inertia))[1]


def displacement_rate(body: Body, twist: Float[np.ndarray, "6"]) -> float:
    """Return an upper bound of any point's path length along the body-fixed twist for unit time [m]."""
    v, w = twist[:3], twist[3:]
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return float(np.linalg.norm(v))
    return float(np.linalg.norm(v + np.cross(w, body.center))) + angle * body.radius


def path_length(body: Body, T_a: Float[np.ndarray, "4 4"], T_b: Float[np.ndarray, "4 4"]) -> float:
    """Return the length of the geodesic from a to b [m], rotation weighed by the part's radius."""
    return displacement_rate(body, se3.log(se3.inverse(T_a) @ T_b))
