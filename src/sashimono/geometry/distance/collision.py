"""Does a rigid body touch another? FCL for crossing surfaces, an inside test for containment."""

from __future__ import annotations

import fcl
import numpy as np
from jaxtyping import Float, Int

from sashimono.geometry.distance.signed_distance import SignedDistance

FCL_UNITS = 1000.0
"""FCL's lengths in a metre: in metres its distances between triangles of 0.1 mm and less are wrong, some of them 0."""


class Collider:
    """One closed mesh as a persistent FCL object; moving it is cheap, building it is not.

    Poses and distances are in metres; the FCL object itself is in `FCL_UNITS`. Not for sharing between threads:
    FCL keeps the last pose in the object.
    """

    def __init__(
        self,
        vertices: Float[np.ndarray, "vertex 3"],
        faces: Int[np.ndarray, "face 3"],
        signed_distance: SignedDistance,
    ) -> None:
        model = fcl.BVHModel()
        model.beginModel(len(faces), len(vertices))
        model.addSubModel(np.ascontiguousarray(vertices * FCL_UNITS), np.ascontiguousarray(faces))
        model.endModel()
        self.fcl_object = fcl.CollisionObject(model)
        self._signed_distance = signed_distance
        self._probe = np.array(vertices[faces[0]].mean(axis=0))
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        self._center, self._radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2)
        self._T = np.eye(4)

    def move(self, T: Float[np.ndarray, "4 4"]) -> None:
        """Put the body at this pose, mesh frame to world [m]."""
        self._T = T
        self.fcl_object.setTransform(fcl.Transform(np.ascontiguousarray(T[:3, :3]), FCL_UNITS * T[:3, 3]))

    def _far(self, other: Collider) -> bool:
        gap = (self._T[:3, :3] @ self._center + self._T[:3, 3]) - (other._T[:3, :3] @ other._center + other._T[:3, 3])
        reach = self._radius + other._radius
        return float(gap @ gap) > reach * reach

    def _holds_probe_of(self, other: Collider) -> bool:
        probe_world = other._T[:3, :3] @ other._probe + other._T[:3, 3]
        return self._signed_distance.contains((probe_world - self._T[:3, 3]) @ self._T[:3, :3])

    def collides(self, other: Collider) -> bool:
        """Return whether the two bodies share a point, at the poses they were last moved to."""
        if self._far(other):
            return False
        if fcl.collide(self.fcl_object, other.fcl_object, fcl.CollisionRequest(), fcl.CollisionResult()) > 0:
            return True
        return self._holds_probe_of(other) or other._holds_probe_of(self)

    def distance(self, other: Collider) -> float:
        """Return the gap between the surfaces [m], 0 if they cross; containment is not looked at."""
        gap = fcl.distance(self.fcl_object, other.fcl_object, fcl.DistanceRequest(), fcl.DistanceResult())
        return max(0.0, float(gap)) / FCL_UNITS
