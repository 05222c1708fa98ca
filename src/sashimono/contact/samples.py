"""Points on a part's surface at which a finger may touch, with the normals of the faces they lie on."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from sashimono.contact.config import ContactConfig
from sashimono.contact.wrenches import unit_across
from sashimono.geometry.body import Body
from sashimono.geometry.distance.rays import cast_rays
from sashimono.geometry.features.directions import inertia_directions, part_directions
from sashimono.geometry.mesh.measures import sample_surface, triangle_cross

_SAME_NORMAL = np.cos(np.radians(5.0))
_AROUND = 0.01
_SAME_DIRECTION = np.cos(np.radians(1.0))


def cast(
    body: Body,
    origins: Float[np.ndarray, "ray 3"],
    directions: Float[np.ndarray, "ray 3"],
    *,
    side: Literal["entering", "leaving"],
) -> tuple[Float[np.ndarray, "ray"], Float[np.ndarray, "ray 3"]]:
    """Return `cast_rays` on a body's surface, in metres."""
    distances, normals = cast_rays(body.signed_distance, origins, directions, side=side)
    return distances, normals


class SurfaceSamples(NamedTuple):
    """Points on a closed surface."""

    points: Float[np.ndarray, "sample 3"]
    """[m], part frame."""
    normals: Float[np.ndarray, "sample 3"]
    """Unit, inward."""


def main_lines(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], config: ContactConfig
) -> Float[np.ndarray, "line 3"]:
    """Return the unit lines that matter of a part: face normals and hole axes, heaviest first, then the principal
    axes of its surface where they are distinct. A sphere has none."""
    lines, _ = part_directions(vertices, faces, config=config.directions)
    triangles = vertices[faces]
    areas, _ = _areas_and_normals(vertices, faces)
    origin = (areas[:, None] * triangles.mean(axis=1)).sum(axis=0) / areas.sum()
    corners = triangles - origin
    total = corners.sum(axis=1)
    moments = np.einsum("f,fki,fkj->ij", areas, corners, corners) + np.einsum("f,fi,fj->ij", areas, total, total)
    axes = inertia_directions(moments, config=config.directions)
    return np.concatenate([lines, axes])


def sample_contacts(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    body: Body,
    lines: Float[np.ndarray, "line 3"],
    *,
    center: Float[np.ndarray, "3"],
    config: ContactConfig,
    rng: np.random.Generator,
) -> SurfaceSamples:
    """Return about ``config.samples`` random points and, besides, where centre lines meet the surface.

    Half of the random points are spread by area, half evenly among the main face directions. Centre
    lines run along the main lines, through the centre of mass and through the centroids of the faces across them.
    """
    areas, normals = _areas_and_normals(vertices, faces)
    by_area = config.samples // 2
    drawn = [sample_surface(vertices, faces, by_area, rng)]
    sides = [normals @ (sign * line) > _SAME_DIRECTION for line in lines for sign in (1.0, -1.0)]
    sides = [side for side in sides if areas[side].sum() > 0.0]
    for side in sides:
        if count := (config.samples - by_area) // len(sides):
            drawn.append(sample_surface(vertices, faces[side], count, rng))
    more_points, more_normals = _center_line_hits(vertices[faces], areas, normals, body, lines, center)
    return SurfaceSamples(
        np.concatenate([*(points for points, _, _ in drawn), more_points]),
        np.concatenate([*(-outward for _, outward, _ in drawn), more_normals]),
    )


def steady(
    body: Body,
    points: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"],
    widths: Float[np.ndarray, "n"] | float = np.inf,
) -> Bool[np.ndarray, "n"]:
    """Return at which points the stated inward normal is the surface's all around the point, within 5°.

    False at edges and corners, where a finger has no face to rest on and "the" normal is a matter of rounding. Looked
    at are the point and four around it, a hundredth of the part's smallest extent away, or of how wide the part is
    there [m] if that is less: the facets of a thin wire are small.
    """
    step = _AROUND * np.broadcast_to(np.minimum(body.smallest_extent, widths), len(points))[:, None]
    u = unit_across(normals)
    v = np.cross(normals, u)
    around = np.concatenate([points, points + step * u, points - step * u, points + step * v, points - step * v])
    distances, outward = body.signed_distance.normals(around, 10.0 * float(step.max(initial=0.0)))
    agree = -(outward * np.tile(normals, (5, 1))).sum(axis=1) >= _SAME_NORMAL
    return (agree & (np.abs(distances) < 0.1 * np.tile(step[:, 0], 5))).reshape(5, len(points)).all(axis=0)


def steady_pairs(
    body: Body, points: Float[np.ndarray, "pair 2 3"], normals: Float[np.ndarray, "pair 2 3"]
) -> Bool[np.ndarray, "pair"]:
    """Return of which pairs of opposite points both are `steady`."""
    widths = np.repeat(np.linalg.norm(points[:, 1] - points[:, 0], axis=1), 2)
    first, second = steady(body, points.reshape(-1, 3), normals.reshape(-1, 3), widths).reshape(-1, 2).T
    return first & second


def _center_line_hits(
    triangles: Float[np.ndarray, "face 3 3"],
    areas: Float[np.ndarray, "face"],
    normals: Float[np.ndarray, "face 3"],
    body: Body,
    lines: Float[np.ndarray, "line 3"],
    center: Float[np.ndarray, "3"],
) -> tuple[Float[np.ndarray, "hit 3"], Float[np.ndarray, "hit 3"]]:
    """Outermost points of the surface on each centre line, from both ends, with inward normals."""
    centroids = triangles.mean(axis=1)
    reach = 2.0 * float(np.linalg.norm(triangles.reshape(-1, 3) - center, axis=1).max())
    origins, directions = [], []
    for line in lines:
        for side in (line, -line):
            facing = areas * (normals @ side > _SAME_DIRECTION)
            middles = [center]
            if facing.sum() > 0.0:
                middles.append((facing[:, None] * centroids).sum(axis=0) / facing.sum())
            for middle in middles:
                # to the height of the centre, so that the start lies outside the part
                start = middle + ((center - middle) @ side + reach) * side
                origins.append(start)
                directions.append(-side)
    origins, directions = np.array(origins).reshape(-1, 3), np.array(directions).reshape(-1, 3)
    distances, hit_normals = cast(body, origins, directions, side="entering")
    hit = np.isfinite(distances)
    return origins[hit] + distances[hit, None] * directions[hit], -hit_normals[hit]


def _areas_and_normals(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> tuple[Float[np.ndarray, "face"], Float[np.ndarray, "face 3"]]:
    crosses = triangle_cross(vertices, faces)
    doubled = np.linalg.norm(crosses, axis=1)
    normals = np.divide(crosses, doubled[:, None], out=np.zeros_like(crosses), where=doubled[:, None] > 0.0)
    return doubled / 2.0, normals
