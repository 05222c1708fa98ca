"""Measures of a closed triangle mesh: volume, inertia, extents, surface samples.

Volume integrals are exact for the polyhedron, as sums over the tetrahedra that its
triangles span with one point (Mirtich, "Fast and accurate computation of polyhedral mass
properties", 1996, gives the same integrals). Density is 1, so masses are volumes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from numba import njit

from sashimono.geometry.mesh.extents import principal_extents


@dataclass(frozen=True, kw_only=True, eq=False)
class MassProperties:
    """Volume integrals of a solid of density 1."""

    volume: float
    """Signed volume [m³]; negative if the surface points inward."""
    center: Float[np.ndarray, "3"]
    """Centre of mass [m]."""
    inertia: Float[np.ndarray, "3 3"]
    """Inertia tensor about the centre of mass, mesh axes [m⁵]."""
    moments: Float[np.ndarray, "3"]
    """Principal moments, ascending [m⁵]."""
    axes: Float[np.ndarray, "3 3"]
    """Principal axes as columns, right-handed, in the order of the moments."""


def triangle_cross(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> Float[np.ndarray, "face 3"]:
    """Return each triangle's normal, twice its area long [m²]."""
    corners = vertices[faces]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def tetrahedron_volumes(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> Float[np.ndarray, "face"]:
    """Return the signed volume [m³] between each triangle and the mean vertex; a closed mesh's volume is the sum."""
    corners = vertices[faces] - vertices.mean(axis=0)
    return np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0


def volume(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> float:
    """Return the signed volume [m³] of a closed mesh; negative if it points inward."""
    return float(tetrahedron_volumes(vertices, faces).sum())


def area(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> float:
    """Return the surface area [m²]."""
    return float(np.linalg.norm(triangle_cross(vertices, faces), axis=1).sum() / 2.0)


def mass_properties(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> MassProperties:
    """Return volume, centre of mass and inertia of a closed mesh of non-zero volume."""
    origin = vertices.mean(axis=0)
    corners = vertices[faces] - origin
    weights = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
    total = float(weights.sum())
    sums = corners.sum(axis=1)
    first = weights @ sums / 4.0
    # ∫ x xᵀ over a tetrahedron with one corner at the origin: V/20 (Σ cᵢcᵢᵀ + s sᵀ)
    weighted = weights[:, None, None] * corners
    second = (np.tensordot(weighted, corners, ([0, 1], [0, 1])) + (weights[:, None] * sums).T @ sums) / 20.0
    offset = first / total
    covariance = second - total * np.outer(offset, offset)
    inertia = np.trace(covariance) * np.eye(3) - covariance
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] = -axes[:, 2]
    return MassProperties(volume=total, center=origin + offset, inertia=inertia, moments=moments, axes=axes)


def inertia_extents(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> Float[np.ndarray, "3"]:
    """Return the extents [m] of the vertices along the principal axes, in the order of the moments.

    Of equal moments, those of the smallest box: see `principal_extents`.
    """
    mass = mass_properties(vertices, faces)
    return principal_extents(vertices, mass.moments, mass.axes)


def smallest_extent(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> float:
    """Return the smallest extent [m] along a principal axis: the length that tolerances are tied to."""
    return float(inertia_extents(vertices, faces).min())


def radius(vertices: Float[np.ndarray, "vertex 3"], center: Float[np.ndarray, "3"]) -> float:
    """Return the largest distance [m] of a vertex from the centre."""
    return float(np.sqrt(((vertices - center) ** 2).sum(axis=1).max()))


def sample_surface(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    count: int,
    rng: np.random.Generator,
) -> tuple[Float[np.ndarray, "count 3"], Float[np.ndarray, "count 3"], Int[np.ndarray, "count"]]:
    """Return points spread evenly by area [m], their outward unit normals, and the face of each.

    Stratified: the k-th point falls in the k-th of ``count`` equal slices of the area, so
    that no region is left out by chance.
    """
    cross = triangle_cross(vertices, faces)
    lengths = np.linalg.norm(cross, axis=1)
    cumulative = np.cumsum(lengths)
    targets = (np.arange(count) + rng.random(count)) / count * cumulative[-1]
    chosen = np.minimum(np.searchsorted(cumulative, targets, side="right"), len(faces) - 1)
    u, v = rng.random((2, count, 1))
    folded = u + v > 1.0
    u, v = np.where(folded, 1.0 - u, u), np.where(folded, 1.0 - v, v)
    corners = vertices[faces[chosen]]
    points = corners[:, 0] + u * (corners[:, 1] - corners[:, 0]) + v * (corners[:, 2] - corners[:, 0])
    return points, cross[chosen] / lengths[chosen, None], chosen


def winding_numbers(
    points: Float[np.ndarray, "n 3"],
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
) -> Float[np.ndarray, "n"]:
    """Return the winding number of the mesh about each point: 1 inside, 0 outside, -1 inside an inward surface.

    Sum of solid angles (van Oosterom & Strackee, 1983); for a few points, as each costs all faces.
    """
    triangles = np.ascontiguousarray(vertices[faces], dtype=np.float64)
    return _winding_numbers(np.ascontiguousarray(points, dtype=np.float64), triangles)


@njit(cache=True, nogil=True)
def _winding_numbers(points, triangles):  # pragma: no cover - compiled
    out = np.empty(len(points))
    for k in range(len(points)):
        x, y, z = points[k]
        turned = 0.0
        for m in range(len(triangles)):
            ax, ay = triangles[m, 0, 0] - x, triangles[m, 0, 1] - y
            az = triangles[m, 0, 2] - z
            bx, by = triangles[m, 1, 0] - x, triangles[m, 1, 1] - y
            bz = triangles[m, 1, 2] - z
            cx, cy = triangles[m, 2, 0] - x, triangles[m, 2, 1] - y
            cz = triangles[m, 2, 2] - z
            la = np.sqrt(ax * ax + ay * ay + az * az)
            lb = np.sqrt(bx * bx + by * by + bz * bz)
            lc = np.sqrt(cx * cx + cy * cy + cz * cz)
            triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
            dots = (ax * bx + ay * by + az * bz) * lc
            dots += (bx * cx + by * cy + bz * cz) * la + (cx * ax + cy * ay + cz * az) * lb
            turned += np.arctan2(triple, la * lb * lc + dots)
        out[k] = turned / (2.0 * np.pi)
    return out
