"""Point clouds with normals, as the paper's network sees parts and blueprints; the same for the same seed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.geometry.mesh import measures

BLUEPRINT_POINTS = 1024
"""Points of a blueprint's cloud in the paper."""

PART_POINTS = 512
"""Points of a part's cloud in the paper."""


def part_clouds(assembly: Assembly, count: int = PART_POINTS, *, seed: int = 0) -> Float[np.ndarray, "part point 6"]:
    """Return points spread by area over each part in place, with outward unit normals: x, y, z [m], nx, ny, nz."""
    clouds = [
        _cloud(part.vertices_world, part.faces, count, rng)
        for part, rng in zip(assembly.parts, np.random.default_rng(seed).spawn(len(assembly)), strict=True)
    ]
    return np.stack(clouds)


def blueprint_cloud(
    assembly: Assembly, count: int = BLUEPRINT_POINTS, *, seed: int = 0, quota: float = 0.0
) -> tuple[Float[np.ndarray, "point 6"], np.ndarray]:
    """Return points over all parts in place with normals, shuffled, and the part that each is of.

    Args:
        assembly: What to sample.
        count: Points in all.
        seed: Of the points.
        quota: Share of the points that is dealt evenly to the parts, so that a small screw is not 0 of 1,024; the rest
            is spread by area. 0: all by area, as in the paper.
    """
    rng = np.random.default_rng([seed, 1])
    areas = np.array([measures.area(part.vertices_world, part.faces) for part in assembly.parts])
    shares = share_points(areas, count, quota=quota, rng=rng)
    clouds = [
        _cloud(part.vertices_world, part.faces, int(n), child)
        for part, n, child in zip(assembly.parts, shares, rng.spawn(len(assembly)), strict=True)
    ]
    order = rng.permutation(count)
    return np.concatenate(clouds)[order], np.repeat(np.arange(len(assembly)), shares)[order]


def share_points(areas: Float[np.ndarray, "part"], count: int, *, quota: float, rng: np.random.Generator) -> np.ndarray:
    """Return how many of so many points each part gets: a quota evenly, the rest drawn by area."""
    even = int(quota * count / len(areas))
    return even + rng.multinomial(count - even * len(areas), areas / areas.sum())


def unit_frame(points: Float[np.ndarray, "*batch 3"]) -> tuple[Float[np.ndarray, "3"], float]:
    """Return centre and scale that bring points into the unit ball: ``(points - centre) / scale``.

    The centre is that of their box, the scale the distance of the farthest point.
    """
    flat = points.reshape(-1, 3)
    center = 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    return center, float(np.linalg.norm(flat - center, axis=1).max())


def normalised(cloud: Float[np.ndarray, "*batch 6"], center: Sequence[float] | np.ndarray, scale: float) -> np.ndarray:
    """Return a cloud with its points moved and scaled, its normals as they are."""
    out = np.array(cloud, dtype=np.float64)
    out[..., :3] = (out[..., :3] - np.asarray(center)) / scale
    return out


def _cloud(vertices: np.ndarray, faces: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    points, normals, _ = measures.sample_surface(vertices, faces, count, rng)
    # samples come triangle by triangle; shuffled, the first points of a cloud are a cloud themselves
    return np.concatenate([points, normals], axis=1)[rng.permutation(count)]
