"""Several bodies that move as one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from sashimono.geometry import se3
from sashimono.verify.body import SampledBody


class Compound(SampledBody):
    """The members of a subassembly as one rigid body, in the frame of one of them.

    Vertices, extents, volume and centre of mass are those of all members; distances are to their union.
    """

    def __init__(
        self, name: str, members: Sequence[tuple[SampledBody, Float[np.ndarray, "4 4"]]], *, samples: int
    ) -> None:
        """Take in the members, each with its pose in the common frame."""
        starts = np.cumsum([0, *(len(body.vertices) for body, _ in members)])
        super().__init__(
            name,
            np.concatenate([se3.apply(T, body.vertices) for body, T in members]),
            np.concatenate([body.faces + start for (body, _), start in zip(members, starts, strict=False)]),
            samples=samples,
        )
        self._members = [(body, se3.inverse(T)) for body, T in members]

    def distance(
        self, points: Float[np.ndarray, "n 3"], beyond: Float[np.ndarray, "n"] | None = None
    ) -> Float[np.ndarray, "n"]:
        """Return the signed distance of each point to the nearest member [m], negative inside any of them."""
        return self._distances(points, beyond).min(axis=0)

    def contains(self, points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, "n"]:
        """Return which points are inside any member."""
        return np.any([body.contains(se3.apply(T, points)) for body, T in self._members], axis=0)

    def nearest_normal(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the outward normal of the face nearest to each point, of whichever member."""
        normals = [body.nearest_normal(se3.apply(T, points)) @ T[:3, :3] for body, T in self._members]
        nearest = np.abs(self._distances(points)).argmin(axis=0)
        return np.stack(normals)[nearest, np.arange(len(points))]

    def _distances(
        self, points: Float[np.ndarray, "n 3"], beyond: Float[np.ndarray, "n"] | None = None
    ) -> Float[np.ndarray, "member n"]:
        return np.stack([body.distance(se3.apply(T, points), beyond) for body, T in self._members])
