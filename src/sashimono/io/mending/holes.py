"""Filling small, flat holes in a surface."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int
from manifold3d import triangulate

from sashimono.geometry.mesh import measures, topology
from sashimono.geometry.mesh.polygons import polygon_normal, project
from sashimono.io.raw import ReadConfig


def fill_holes(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], config: ReadConfig
) -> tuple[Int[np.ndarray, "filled 3"], str] | None:
    """Return the faces with every hole filled and a note that says so; None unless all holes are small and flat.

    A patch has all its corners on the rim, so a flat rim bounds how far it can be from the true
    surface. Several holes of which one lies within a flat face are left open: they may be the
    two ends of a bore whose wall is missing, and filling would plug it.
    """
    rims = hole_rims(faces)
    if not rims or (len(rims) > 1 and any(_within_flat_face(vertices, faces, rim) for rim in rims)):
        return None
    limit = config.hole_area * measures.area(vertices, faces)
    patches = [faces]
    for rim in rims:
        points = vertices[rim]
        normal = polygon_normal(points)
        heights = (points - points.mean(axis=0)) @ normal
        if not normal.any() or np.ptp(heights) > config.hole_flatness * np.linalg.norm(np.ptp(points, axis=0)):
            return None
        patch = rim[triangulate([project(points, normal)])]
        if len(patch) != len(rim) - 2 or measures.area(vertices, patch) > limit:
            return None
        patches.append(patch)
    longest = max(len(rim) for rim in rims)
    note = f"{len(rims)} flat hole{'s' * (len(rims) > 1)} of up to {longest} edges filled"
    return np.concatenate(patches), note


def _within_flat_face(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], rim: Int[np.ndarray, "corner"]
) -> bool:
    """Return whether the triangles along a hole's rim lie in the plane of the rim."""
    normal = polygon_normal(vertices[rim])
    along = faces[np.isin(faces, rim).sum(axis=1) >= 2]
    heights = (vertices[along] - vertices[rim].mean(axis=0)) @ normal
    size = np.linalg.norm(np.ptp(vertices[rim], axis=0))
    return bool((np.ptp(heights, axis=1) < 0.02 * size).all())


def hole_rims(faces: Int[np.ndarray, "face 3"]) -> list[Int[np.ndarray, "_"]] | None:
    """Return the rims of a mesh's holes as vertex loops, running as a patch must; None if they cross or branch."""
    e = topology.edges(faces)
    if (e.uses > 2).any() or ((e.uses == 2) & (e.net != 0)).any():
        return None
    single = e.uses[e.of_face] == 1
    start, stop = faces[single], np.roll(faces, -1, axis=1)[single]
    after = dict(zip(stop.tolist(), start.tolist(), strict=True))  # a patch runs the other way
    if len(after) != len(stop):
        return None
    rims = []
    while after:
        first = min(after)
        rim = [first]
        while (following := after.pop(rim[-1], None)) is not None and following != first:
            rim.append(following)
        if following is None or len(rim) < 3:
            return None
        rims.append(np.array(rim, dtype=np.int64))
    return rims
