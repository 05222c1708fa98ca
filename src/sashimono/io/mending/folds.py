"""Triangles folded back onto their neighbours. The surface is closed, but there is nothing between the two sheets.

CAD kernels leave them at slivers and at walls of no thickness. There the nearest face can tell the wrong side. Those of
one flat face, as where the fan of a ring crosses its hole, are drawn anew; others are counted.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float, Int
from manifold3d import triangulate
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from sashimono.geometry.mesh.measures import winding_numbers
from sashimono.geometry.mesh.polygons import project
from sashimono.geometry.mesh.topology import is_closed, neighbouring_faces
from sashimono.io.raw import ReadConfig


def count_folded(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, config: ReadConfig
) -> int:
    """Return how many triangles of a closed surface lie back to back with a neighbour and bound no material.

    Where two neighbours' normals are opposite, the winding number just behind either must be one and before it zero.
    """
    triangles = vertices[faces]
    normals, doubled, whole = _normals(triangles)
    pairs = neighbouring_faces(faces)
    doubtful = np.unique(pairs[_back_to_back(pairs, normals, whole, config)])[: config.max_folds]
    if not len(doubtful):
        return 0
    middles = triangles[doubtful].mean(axis=1)
    steps = config.fold_step * np.sqrt(doubled[doubtful])[:, None] * normals[doubtful]
    behind = winding_numbers(middles - steps, vertices, faces)
    before = winding_numbers(middles + steps, vertices, faces)
    return int(((np.abs(behind - 1.0) > 0.5) | (np.abs(before) > 0.5)).sum())


def without_flat_folds(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, config: ReadConfig
) -> Int[np.ndarray, "_ 3"]:
    """Return the faces of a closed surface, with the flat ones whose triangles lie on one another drawn anew.

    A flat face is drawn from its rims alone, and only where the new triangles cover as much as the old ones did,
    counted with their signs. So no point of the surface moves, but for sheets with nothing between them. The faces come
    back as they are where that leaves no fewer folds (`count_folded`), and where more than ``max_folds`` triangles are
    folded: such a surface is not one that a few faces spoil, and looking at each takes minutes.
    """
    tolerance = config.weld * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    triangles = vertices[faces]
    normals, _, whole = _normals(triangles)
    pairs = neighbouring_faces(faces)
    left = set(pairs[_back_to_back(pairs, normals, whole, config)][:, 0].tolist())
    if len(left) > config.max_folds:
        return faces
    kept, drawn = np.ones(len(faces), np.bool_), []
    while left:
        seed = min(left)
        left.discard(seed)
        heights = (triangles - triangles[seed, 0]) @ normals[seed]
        flat = kept & (np.abs(heights).max(axis=1) <= tolerance)
        patch = flat.copy()
        patch[flat] = _joined(faces[flat], int(np.count_nonzero(flat[:seed])))
        left.difference_update(np.flatnonzero(patch).tolist())
        new = _drawn_anew(vertices, faces[patch], normals[seed])
        if new is not None:
            kept &= ~patch
            drawn.append(new)
    out = np.concatenate([faces[kept], *drawn])
    if not drawn or not is_closed(out):
        return faces
    before, after = (count_folded(vertices, each, config=config) for each in (faces, out))
    return out if after < before else faces


def _joined(faces: Int[np.ndarray, "face 3"], seed: int) -> Bool[np.ndarray, "face"]:
    """Which faces hang together with one of them by corners that they share."""
    corners = np.unique(faces, return_inverse=True)[1].reshape(-1) + len(faces)
    rows, size = np.repeat(np.arange(len(faces)), 3), len(faces) + int(corners.max()) + 1
    graph = coo_array((np.ones(len(rows), np.int8), (rows, corners)), shape=(size, size))
    labels = connected_components(graph, directed=False)[1][: len(faces)]
    return labels == labels[seed]


def _drawn_anew(
    vertices: Float[np.ndarray, "vertex 3"], patch: Int[np.ndarray, "face 3"], normal: Float[np.ndarray, "3"]
) -> Int[np.ndarray, "new 3"] | None:
    """Triangles between the rims of a flat patch; None if its rims cross, or do not bound what it covers."""
    corners = vertices[patch]
    area = 0.5 * float((np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ normal).sum())
    if area < 0.0:
        normal, area = -normal, -area
    edges = {(int(a), int(b)) for face in patch for a, b in zip(face, np.roll(face, -1), strict=True)}
    rim = [edge for edge in edges if edge[::-1] not in edges]
    after = dict(sorted(rim))
    if len(after) != len(rim):
        return None
    rims: list[np.ndarray] = []
    while after:
        loop = [next(iter(after))]
        while (following := after.pop(loop[-1], None)) is not None and following != loop[0]:
            loop.append(following)
        if following is None or len(loop) < 3:
            return None
        rims.append(np.array(loop))
    if not rims:
        return None
    flat = project(vertices[np.concatenate(rims)], normal)
    stops = np.cumsum([len(loop) for loop in rims])[:-1]
    new = np.concatenate(rims)[triangulate(np.split(flat, stops))]
    corners = vertices[new]
    signed = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ normal
    covers = np.abs(signed).sum() <= (1.0 + 1e-9) * area and signed.sum() >= (1.0 - 1e-9) * area
    return new.astype(patch.dtype) if covers else None


def _normals(
    triangles: Float[np.ndarray, "face 3 3"],
) -> tuple[Float[np.ndarray, "face 3"], Float[np.ndarray, "face"], Bool[np.ndarray, "face"]]:
    """Unit normals, twice the areas, and which triangles have one to speak of."""
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    whole = doubled > 1e-9 * doubled.max(initial=0.0)
    return normals / np.where(whole, doubled, 1.0)[:, None], doubled, whole


def _back_to_back(
    pairs: Int[np.ndarray, "pair 2"],
    normals: Float[np.ndarray, "face 3"],
    whole: Bool[np.ndarray, "face"],
    config: ReadConfig,
) -> Bool[np.ndarray, "pair"]:
    """Which neighbours look opposite ways."""
    opposite = (normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) < -np.cos(config.fold_angle)
    return opposite & whole[pairs].all(axis=1)
