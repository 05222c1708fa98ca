"""A part's shape as the planners ask for it: worked out once, and shared by all levels."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Error, Manifold
from scipy.spatial import ConvexHull, QhullError

from sashimono.geometry import se3
from sashimono.geometry.distance.collision import Collider
from sashimono.geometry.distance.rays import cast_rays
from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.mesh import measures
from sashimono.geometry.mesh.extents import principal_extents
from sashimono.geometry.mesh.solid import to_manifold


@dataclass(frozen=True, kw_only=True)
class SampleConfig:
    """How densely surfaces are sampled for depth checks."""

    area_samples: int = 800
    """Points spread over the surface by area, with their normals."""
    max_vertices: int = 3000
    """Vertices taken besides; of a finer mesh, that many drawn at random."""


_POINTS_AT_ONCE = 200_000
"""Most points that are moved at once."""


class Body:
    """A closed surface in its own frame [m]: samples, hull, mass, distances. Immutable but for `move`.

    Everything costly is worked out when it is first asked for. Not for sharing between threads: see `Collider`.
    """

    def __init__(
        self,
        name: str,
        vertices: Float[np.ndarray, "vertex 3"],
        faces: Int[np.ndarray, "face 3"],
        *,
        config: SampleConfig,
        rng: np.random.Generator,
    ) -> None:
        """Take in a closed part surface [m]."""
        self.name = name
        self.vertices = vertices
        self.faces = faces
        self.bounds = np.array([vertices.min(axis=0), vertices.max(axis=0)])
        self.center = self.bounds.mean(axis=0)
        """Centre of the bounding box, about which rotation is measured [m]."""
        self.radius = measures.radius(vertices, self.center)
        """Distance of the farthest point from `center` [m]."""
        self.mass_properties = measures.mass_properties(vertices, faces)
        mass = self.mass_properties
        self.extents = np.sort(principal_extents(vertices, mass.moments, mass.axes))
        """Extents along the inertia axes [m], ascending; of the smallest box where these are not determined."""
        self.samples, self.sample_normals, _ = measures.sample_surface(vertices, faces, config.area_samples, rng)
        corners = vertices
        if len(corners) > config.max_vertices:
            corners = vertices[np.sort(rng.choice(len(vertices), config.max_vertices, replace=False))]
        self.probes = np.concatenate([self.samples, corners])
        """Points whose depth inside another body is looked at: samples first, then vertices."""

    @property
    def smallest_extent(self) -> float:
        """Smallest extent along an inertia axis [m]: what tolerances are tied to."""
        return float(self.extents[0])

    @property
    def size(self) -> float:
        """Half the geometric mean of the extents [m]: the scale of clearances, fair to rods and plates."""
        return float(np.cbrt(np.prod(self.extents)) / 2.0)

    @cached_property
    def wall(self) -> float:
        """Thickness of the thin walls [m]: one surface sample in twenty has less material straight behind it."""
        origins = self.samples - 1e-6 * self.radius * self.sample_normals
        thickness, _ = cast_rays(self.signed_distance, origins, -self.sample_normals, side="leaving")
        thickness = thickness[np.isfinite(thickness)]
        return float(np.quantile(thickness, 0.05)) if len(thickness) else self.smallest_extent

    @property
    def mass_center(self) -> Float[np.ndarray, "3"]:
        """Centre of mass of the homogeneous solid [m]."""
        return self.mass_properties.center

    @cached_property
    def hull(self) -> ConvexHull:
        """Convex hull of the vertices; of (nearly) no volume, joggled by Qhull."""
        try:
            return ConvexHull(self.vertices)
        except QhullError:
            return ConvexHull(self.vertices, qhull_options="QJ")

    @cached_property
    def hull_points(self) -> Float[np.ndarray, "point 3"]:
        """Corners of the convex hull [m]."""
        return np.ascontiguousarray(self.vertices[self.hull.vertices])

    @cached_property
    def signed_distance(self) -> SignedDistance:
        """Signed distance to the surface [m]."""
        return SignedDistance(self.vertices, self.faces)

    @cached_property
    def collider(self) -> Collider:
        """The surface as a collision object."""
        return Collider(self.vertices, self.faces, self.signed_distance)

    @cached_property
    def solid(self) -> Manifold | None:
        """The part as an exact solid for booleans; None if its surface does not bound one."""
        solid = to_manifold(self.vertices, self.faces)
        return solid if solid.status() == Error.NoError else None

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

    def supports(
        self, T_world_part: Float[np.ndarray, "pose 4 4"], directions: Float[np.ndarray, "direction 3"]
    ) -> tuple[Float[np.ndarray, "pose direction"], Float[np.ndarray, "pose direction"]]:
        """Return the same at each of many poses."""
        turned, shift = directions @ T_world_part[:, :3, :3], T_world_part[:, :3, 3] @ directions.T
        at_once = max(1, _POINTS_AT_ONCE // len(self.hull_points))
        found = []
        for first in range(0, len(turned), at_once):
            along = turned[first : first + at_once] @ self.hull_points.T
            found.append((along.min(axis=2), along.max(axis=2)))
        low, high = (np.concatenate(side) for side in zip(*found, strict=True))
        return low + shift, high + shift

    def lowest(self, T_world_part: Float[np.ndarray, "4 4"], normal: Float[np.ndarray, "3"]) -> float:
        """Return the least coordinate along the normal at this pose [m]."""
        return float((self.hull_points @ (T_world_part[:3, :3].T @ normal)).min() + normal @ T_world_part[:3, 3])

    def move(self, T_world_part: Float[np.ndarray, "4 4"]) -> None:
        """Put the collision object at this pose."""
        self.collider.move(T_world_part)

    def collides(self, other: Body) -> bool:
        """Return whether the two share a point where they were last moved to, containment included."""
        return self.collider.collides(other.collider)

    def distance(self, other: Body) -> float:
        """Return the gap between the surfaces where they were last moved to [m], 0 if they cross."""
        return self.collider.distance(other.collider)

    def depth(self, other: Body, T_self_other: Float[np.ndarray, "4 4"]) -> float:
        """Return how deep the other's probes, at this pose, lie inside this body [m]; 0 if none does."""
        return self.signed_distance.depth(other.probes, T_self_other)


def mutual_depth(first: Body, second: Body, T_second_first: Float[np.ndarray, "4 4"]) -> float:
    """Return how deep the probes of either lie inside the other at this pose [m]; 0 if none does."""
    return max(second.depth(first, T_second_first), first.depth(second, se3.inverse(T_second_first)))


class DeepestProbe:
    """The deepest probe of two bodies in each other at a pose, followed to other poses."""

    def __init__(self, first: Body, second: Body, T_second_first: Float[np.ndarray, "4 4"]) -> None:
        depth, k = second.signed_distance.deepest(first.probes, T_second_first)
        other, m = first.signed_distance.deepest(second.probes, se3.inverse(T_second_first))
        self.depth = max(depth, other)
        """How deep it is [m]; 0 if none is inside."""
        self._is_of_first = depth >= other
        self._probe = (first.probes[k] if self._is_of_first else second.probes[m])[None]
        self._target = (second if self._is_of_first else first).signed_distance

    def depth_at(self, T_second_first: Float[np.ndarray, "4 4"]) -> float:
        """Return how deep the same probe is at another pose [m], negative outside."""
        T = T_second_first if self._is_of_first else se3.inverse(T_second_first)
        return -float(self._target.query(se3.apply(T, self._probe))[0])


def displacement_rate(body: Body, twist: Float[np.ndarray, "6"]) -> float:
    """Return an upper bound of any point's path length along the body-fixed twist for unit time [m]."""
    v, w = twist[:3], twist[3:]
    angle = float(np.linalg.norm(w))
    if angle == 0.0:
        return float(np.linalg.norm(v))
    return float(np.linalg.norm(v + se3.cross(w, body.center))) + angle * body.radius


def path_length(body: Body, T_a: Float[np.ndarray, "4 4"], T_b: Float[np.ndarray, "4 4"]) -> float:
    """Return the length of the geodesic from a to b [m], rotation weighed by the part's radius."""
    return displacement_rate(body, se3.log(se3.inverse(T_a) @ T_b))
