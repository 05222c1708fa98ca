"""What the planners ask of a part's shape again and again, worked out once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from sashimono.geometry import mesh
from sashimono.geometry.signed_distance import SignedDistance


@dataclass(frozen=True, kw_only=True)
class SampleConfig:
    """How densely surfaces are sampled for depth checks."""

    area_samples: int = 800
    """Points spread over the surface by area, with their normals."""
    max_vertices: int = 3000
    """Vertices taken besides; of a finer mesh, that many drawn at random."""


class Body:
    """A closed surface in its own frame with samples, size and signed distance; immutable."""

    def __init__(
        self,
        vertices: Float[np.ndarray, "vertex 3"],
        faces: Int[np.ndarray, "face 3"],
        *,
        config: SampleConfig,
        rng: np.random.Generator,
    ) -> None:
        self.vertices = vertices
        self.faces = faces
        self.mass_properties = mesh.mass_properties(vertices, faces)
        self.smallest_extent = mesh.smallest_extent(vertices, faces)
        self.bounds = np.array([vertices.min(axis=0), vertices.max(axis=0)])
        self.samples, self.sample_normals, _ = mesh.sample_surface(vertices, faces, config.area_samples, rng)
        corners = vertices
        if len(corners) > config.max_vertices:
            corners = vertices[np.sort(rng.choice(len(vertices), config.max_vertices, replace=False))]
        self.probes = np.concatenate([self.samples, corners])
        """Points whose depth inside another body is looked at: samples first, then vertices."""

    @cached_property
    def signed_distance(self) -> SignedDistance:
        """Signed distance to the surface, in the body's frame."""
        return SignedDistance(self.vertices, self.faces)
