"""A closed body in place of a surface that cannot be closed: it contains that, so that its way is free for it too.

Covering every hole, however large and bent, leaves all the rest as it is; where the holes' rims cross or branch, each
open shell is replaced by its convex hull.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Manifold, OpType, triangulate

from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.mesh import measures, topology
from sashimono.geometry.mesh.polygons import polygon_normal, project
from sashimono.geometry.mesh.solid import to_manifold
from sashimono.io.mending.holes import hole_rims
from sashimono.io.mending.mend import Surface, close_surface
from sashimono.io.raw import ReadConfig

_SAMPLES = 2000
"""Points of what was added whose distance from the surface is taken."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ClosedBody:
    """A closed body that contains an open surface."""

    surface: Surface
    how: str
    """What was done."""
    off: float
    """How far what was added reaches from the surface, at most, by samples [m]."""


def stand_in(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, config: ReadConfig
) -> ClosedBody | None:
    """Return a closed body that contains the surface; None for a surface that spans no volume.

    Args:
        vertices: Points [m].
        faces: Triangles that do not bound a solid.
        config: How vertices are welded.
    """
    welded, triangles = _welded(vertices, faces)
    if not len(triangles):
        return None
    return _covered(welded, triangles, config) or _hulls(welded, triangles)


def _welded(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> tuple[Float[np.ndarray, "_ 3"], Int[np.ndarray, "_ 3"]]:
    """Vertices that agree to a millionth of the diagonal as one; each triangle once, wound like its neighbours."""
    size = float(np.linalg.norm(np.ptp(vertices[np.unique(faces)], axis=0)))
    if size == 0.0:
        return vertices, faces[:0]
    cells = np.round(vertices / (1e-6 * size)).astype(np.int64)
    _, first, inverse = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    f = inverse.reshape(-1)[faces]
    f = f[(f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])]
    f = f[np.sort(np.unique(np.sort(f, axis=1), axis=0, return_index=True)[1])]
    used, renumbered = np.unique(f.reshape(-1), return_inverse=True)
    f = renumbered.reshape(-1, 3)
    return vertices[first[used]], topology.unify_winding(f)[0] if len(f) else f


def _covered(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], config: ReadConfig
) -> ClosedBody | None:
    """The surface with every hole covered."""
    rims = hole_rims(faces)
    if not rims:
        return None
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    covers = []
    for group in _by_plane(vertices, rims, config.hole_flatness * 1e-2 * size):
        normal = polygon_normal(vertices[max(group, key=lambda rim: _spread(vertices[rim]))])
        if not normal.any():
            return None
        corners = np.concatenate(group)
        cover = corners[triangulate([project(vertices[rim], normal) for rim in group])]
        if len(np.unique(cover)) != len(corners):
            return None
        covers.append(cover)
    closed = close_surface(vertices, np.concatenate([faces, *covers]), repair=True, config=config)
    if isinstance(closed, str):
        return None
    count = len(rims)
    return ClosedBody(
        surface=closed,
        how=f"{count} hole{'s' * (count > 1)} covered",
        off=_reach(vertices, np.concatenate(covers), vertices, faces),
    )


def _by_plane(
    vertices: Float[np.ndarray, "vertex 3"], rims: Sequence[Int[np.ndarray, "_"]], tolerance: float
) -> list[list[Int[np.ndarray, "_"]]]:
    """Rims in groups that lie in one plane: a rim inside another is the hole of the face that is missing there."""
    groups: list[list[Int[np.ndarray, "_"]]] = []
    for rim in sorted(rims, key=lambda rim: -_spread(vertices[rim])):
        for group in groups:
            points = vertices[group[0]]
            normal = polygon_normal(points)
            if all(np.abs((p - points.mean(axis=0)) @ normal).max() <= tolerance for p in (points, vertices[rim])):
                group.append(rim)
                break
        else:
            groups.append([rim])
    return groups


def _spread(points: Float[np.ndarray, "corner 3"]) -> float:
    return round(float(np.linalg.norm(np.ptp(points, axis=0))), 12)


def _hulls(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> ClosedBody | None:
    """Closed shells as they are, and open ones as their convex hulls, united."""
    of_face = topology.shells(faces)
    solids, count = [], 0
    for shell in range(int(of_face.max()) + 1):
        own = faces[of_face == shell]
        used, renumbered = np.unique(own.reshape(-1), return_inverse=True)
        points, triangles = vertices[used], renumbered.reshape(-1, 3)
        if topology.is_closed(triangles):
            inward = measures.volume(points, triangles) < 0.0
            solids.append(to_manifold(points, triangles[:, ::-1] if inward else triangles))
        else:
            count += 1
            solids.append(Manifold.hull_points(points))
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    if any(solid.volume() <= 1e-9 * size**3 for solid in solids):  # a flat shell has no hull of its own
        solids, count = [Manifold.hull_points(vertices)], 1
    out = Manifold.batch_boolean(solids, OpType.Add).to_mesh64()
    made, corners = np.array(out.vert_properties[:, :3]), np.array(out.tri_verts).astype(np.int64)
    if not topology.is_closed(corners) or measures.volume(made, corners) <= 1e-9 * size**3:
        return None
    return ClosedBody(
        surface=Surface(vertices=made, faces=corners),
        how=f"{count} open shell{'s' * (count > 1)} replaced by the convex hull{'s' * (count > 1)}",
        off=_reach(made, corners, vertices, faces),
    )


def _reach(
    vertices: Float[np.ndarray, "_ 3"],
    added: Int[np.ndarray, "_ 3"],
    old_vertices: Float[np.ndarray, "_ 3"],
    old_faces: Int[np.ndarray, "_ 3"],
) -> float:
    """How far some triangles reach from a surface, at most, by samples of them [m]."""
    points, _, _ = measures.sample_surface(vertices, added, _SAMPLES, np.random.default_rng(0))
    return float(np.abs(SignedDistance(old_vertices, old_faces.astype(np.int32)).query(points)).max())
