"""Meshes as they are drawn: smooth where the surface is, sharp and lined where it has an edge."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

_NEXT = np.array([1, 2, 0])


@dataclass(frozen=True, kw_only=True, eq=False)
class DisplayMesh:
    """A surface split along its creases, with one normal a vertex."""

    positions: Float[np.ndarray, "vertex 3"]
    """In the part's frame [m]."""
    normals: Float[np.ndarray, "vertex 3"]
    """Unit outward normals."""
    faces: Int[np.ndarray, "face 3"]
    edges: Int[np.ndarray, "edge 2"]
    """Vertex pairs of the sharp edges."""


def cluster_vertices(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], bits: int
) -> tuple[Float[np.ndarray, "cluster 3"], Int[np.ndarray, "kept 3"]]:
    """Return the mesh with vertices merged that share a cell of a 2^bits grid over its box.

    Faces that collapse are dropped, a mesh that would vanish is returned as it is. With 16 bits this welds
    seams; with fewer it decimates (Rossignac and Borrel 1993).
    """
    lower = vertices.min(axis=0)
    extent = max(float((vertices.max(axis=0) - lower).max()), 1e-12)
    cells = np.rint((vertices - lower) * ((2**bits - 1) / extent)).astype(np.int64)
    keys = (cells[:, 0] << 40) | (cells[:, 1] << 20) | cells[:, 2]
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    merged = inverse.reshape(-1)[faces]
    alive = (merged != merged[:, _NEXT]).all(axis=1)
    if not alive.any():
        return vertices, faces
    return vertices[first], merged[alive]


def _face_normals(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]
) -> tuple[Float[np.ndarray, "face 3"], Bool[np.ndarray, "face"]]:
    """Return unit normals (zero where undefined) and which faces are too thin for theirs to mean anything."""
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(cross, axis=1)
    longest = np.linalg.norm(corners - corners[:, _NEXT], axis=2).max(axis=1)
    extent = float(np.ptp(vertices, axis=0).max())
    thin = twice_area <= 1e-5 * extent * longest
    return cross / np.maximum(twice_area, 1e-300)[:, None], thin


def _corner_angles(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> np.ndarray:
    corners = vertices[faces]
    ahead = corners[:, _NEXT] - corners
    ahead /= np.maximum(np.linalg.norm(ahead, axis=2, keepdims=True), 1e-300)
    back = -ahead[:, [2, 0, 1]]
    return np.arccos(np.clip(np.einsum("fcx,fcx->fc", ahead, back), -1.0, 1.0))


def make_display_mesh(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    *,
    crease_angle: float,
    bits: int = 16,
) -> DisplayMesh:
    """Return the mesh to draw. Faces across an edge of less than ``crease_angle`` [rad] share their normals.

    ``bits`` is the resolution of the welding grid (see `cluster_vertices`).
    """
    vertices, faces = cluster_vertices(vertices, np.asarray(faces, dtype=np.int64), bits)
    face_normals, thin = _face_normals(vertices, faces)

    # half-edge h = 3 f + c runs from corner c of face f to the next one
    corner_vertex = faces.reshape(-1)
    tail, head = corner_vertex, faces[:, _NEXT].reshape(-1)
    next_corner = (3 * np.arange(len(faces))[:, None] + _NEXT).reshape(-1)
    key = np.minimum(tail, head) * len(vertices) + np.maximum(tail, head)
    order = np.argsort(key, kind="stable")
    _, begins, counts = np.unique(key[order], return_index=True, return_counts=True)
    pairs = begins[counts == 2]
    h, g = order[pairs], order[pairs + 1]
    cosine = np.einsum("ex,ex->e", face_normals[h // 3], face_normals[g // 3])
    usable = ~(thin[h // 3] | thin[g // 3])
    opposed = tail[h] == head[g]
    smooth = usable & opposed & (cosine > np.cos(crease_angle))
    sharp = h[usable & ~smooth]

    # corners joined across smooth edges become one vertex
    a, b = h[smooth], g[smooth]
    rows = np.concatenate([a, next_corner[a]])
    columns = np.concatenate([next_corner[b], b])
    size = len(corner_vertex)
    links = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(size, size))
    count, label = connected_components(links, directed=False)

    weight = _corner_angles(vertices, faces).reshape(-1, 1)
    normals = np.zeros((count, 3))
    np.add.at(normals, label, weight * np.repeat(face_normals, 3, axis=0))
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-12, normals / np.maximum(length, 1e-300), [0.0, 0.0, 1.0])
    positions = np.empty((count, 3))
    positions[label] = vertices[corner_vertex]
    return DisplayMesh(
        positions=positions,
        normals=normals,
        faces=label.reshape(-1, 3),
        edges=np.stack([label[sharp], label[next_corner[sharp]]], axis=1),
    )
