"""The body that two overlapping parts share, and whether it is the tube that a thread drawn as two cylinders leaves.

CAD often has no ridges: the screw is a cylinder of the nominal diameter, the hole one of the core diameter, and the
two overlap in a thin tube as long as the thread is engaged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sashimono.geometry.body import Body


@dataclass(frozen=True, kw_only=True, eq=False)
class SharedBody:
    """The surface of the body that two parts share, by whose surface it lies on."""

    triangles: Float[np.ndarray, "face 3 3"]
    """World frame [m], counter-clockwise from outside."""
    normals: Float[np.ndarray, "face 3"]
    """Unit and outward: of the shared body, and of the part on whose surface it is."""
    areas: Float[np.ndarray, "face"]
    """In m²."""
    is_first: Bool[np.ndarray, "face"]
    """Whether a triangle lies on the first part's surface, not on the second's."""

    def led(self, direction: Float[np.ndarray, "3"]) -> float:
        """Return the share of the surface that goes ahead into the other part's material.

        The first part moves along the direction, the second one stays, or moves the opposite way. A peg pulled out
        of a hole leads nothing; pushed sideways, a third.
        """
        along = (self.normals @ direction) * np.where(self.is_first, 1.0, -1.0)
        return float(self.areas @ np.maximum(along, 0.0) / self.areas.sum())


@dataclass(frozen=True, kw_only=True)
class TubeConfig:
    """What counts as the tube of a thread that is drawn as two cylinders."""

    depth: tuple[float, float] = (0.04, 0.15)
    """Thickness of the tube over its outer diameter, least and most: coarse threads have 5 % (M64) to 14 % (M1), a
    rod pressed into a printed hole has 2 %."""
    across: float = 0.1
    """Largest part of a side face's normal along the axis."""
    round: float = 0.04
    """Largest deviation of a side face from its cylinder, over the radius."""
    closed: float = 0.1
    """Largest sum of the side faces' normals over their area: all around, they cancel."""
    least_share: float = 0.8
    """Share of the side faces that lie on the two cylinders, one on each part's surface."""
    least_side: float = 0.5
    """Share of the surface that is side faces."""
    least_faces: int = 12
    """Fewer side faces on either cylinder tell nothing."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Tube:
    """A thin tube that two parts share."""

    axis: Float[np.ndarray, "3"]
    """Unit direction."""
    point: Float[np.ndarray, "3"]
    """A point on the axis [m]."""
    outer_radius: float
    """Radius of the shank [m]."""
    inner_radius: float
    """Radius of the hole [m]."""


def shared_body(
    first: Body, second: Body, T_first: Float[np.ndarray, "4 4"], T_second: Float[np.ndarray, "4 4"]
) -> SharedBody | None:
    """Return the body that two parts share at these poses, by an exact boolean; None if there is none to be had."""
    if first.solid is None or second.solid is None:
        return None
    # each gets an identity of its own, by which the result's faces are told apart
    a, b = first.solid.as_original(), second.solid.as_original()
    common = a.transform(np.ascontiguousarray(T_first[:3])) ^ b.transform(np.ascontiguousarray(T_second[:3]))
    if common.is_empty():
        return None
    mesh = common.to_mesh64()
    triangles = np.array(mesh.vert_properties)[:, :3][np.array(mesh.tri_verts).astype(np.int64)]
    runs = np.diff(np.array(mesh.run_index).astype(np.int64)) // 3
    is_first = np.repeat(np.array(mesh.run_original_id) == a.original_id(), runs)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    keep = doubled > 1e-12 * doubled.max(initial=0.0)
    if not keep.any():
        return None
    return SharedBody(
        triangles=triangles[keep],
        normals=normals[keep] / doubled[keep, None],
        areas=0.5 * doubled[keep],
        is_first=is_first[keep],
    )


def fit_tube(shared: SharedBody, axis: Float[np.ndarray, "3"], *, config: TubeConfig) -> Tube | None:
    """Return the tube about an axis of this direction that a shared body is; None if it is no tube, or too thick."""
    side = np.abs(shared.normals @ axis) < config.across
    if not side.any() or shared.areas[side].sum() < config.least_side * shared.areas.sum():
        return None
    normals, areas, is_first = shared.normals[side], shared.areas[side], shared.is_first[side]
    middles = shared.triangles[side].mean(axis=1)
    point = _axis_point(middles, normals, areas, axis)
    arms = middles - point
    arms -= np.outer(arms @ axis, axis)
    # a facet's plane is as far from the axis as its cylinder's inscribed one
    distances = (arms * normals).sum(axis=1)
    radii = []
    on_cylinder = np.zeros(len(areas), np.bool_)
    for out in (distances > 0.0, distances < 0.0):
        if out.sum() < config.least_faces:
            return None
        near = np.abs(distances)
        middle = _median(near[out], areas[out])
        good = out & (np.abs(near - middle) <= config.round * middle)
        if np.linalg.norm(areas[good] @ normals[good]) > config.closed * areas[good].sum():
            return None
        corners = shared.triangles[side][good].reshape(-1, 3) - point
        corners -= np.outer(corners @ axis, axis)
        radii.append(_median(np.linalg.norm(corners, axis=1), np.repeat(areas[good], 3)))
        on_cylinder |= good
    if areas[on_cylinder].sum() < config.least_share * areas.sum():
        return None
    # the shank's faces are one part's, the hole's the other's
    outer = areas[on_cylinder & (distances > 0.0)], is_first[on_cylinder & (distances > 0.0)]
    inner = areas[on_cylinder & (distances < 0.0)], is_first[on_cylinder & (distances < 0.0)]
    firsts = [float(a @ f / a.sum()) for a, f in (outer, inner)]
    if min(abs(firsts[0] - firsts[1]), max(firsts), 1.0 - min(firsts)) < config.least_share:
        return None
    if not config.depth[0] <= (radii[0] - radii[1]) / (2.0 * radii[0]) <= config.depth[1]:
        return None
    return Tube(axis=axis, point=point, outer_radius=radii[0], inner_radius=radii[1])


def _axis_point(
    middles: Float[np.ndarray, "face 3"],
    normals: Float[np.ndarray, "face 3"],
    areas: Float[np.ndarray, "face"],
    axis: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "3"]:
    """The point nearest to all lines along the normals, seen along the axis; by least squares."""
    center = areas @ middles / areas.sum()
    tangents = np.cross(axis, normals)
    weighed = tangents * areas[:, None]
    right = (tangents * (middles - center)).sum(axis=1)
    normal_matrix = weighed.T @ tangents + areas.sum() * (1e-9 * np.eye(3) + np.outer(axis, axis))
    return center + np.linalg.solve(normal_matrix, weighed.T @ right)


def _median(values: Float[np.ndarray, "n"], weights: Float[np.ndarray, "n"]) -> float:
    """The weighed median."""
    order = np.argsort(values, kind="stable")
    heaped = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(heaped, 0.5 * heaped[-1])]])
