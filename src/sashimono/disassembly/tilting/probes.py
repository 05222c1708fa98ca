"""The points of a surface at which a search feels for contact: corners, points along sharp edges, points of faces."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.geometry.body import Body
from sashimono.geometry.mesh.topology import edge_keys

_SHARP = np.cos(np.radians(20.0))
"""Faces that meet at a larger angle than this one form an edge."""


def contact_probes(body: Body, *, most: int) -> Float[np.ndarray, "point 3"]:
    """Return at most so many points [m], part frame: a third each of corners, of edges and of faces, spread evenly.

    Edges matter: where two edges cross, no corner and hardly a point of a face tells of it.
    """
    along = edge_points(body, spacing=0.08 * body.radius)
    third = most // 3
    points = [body.vertices[: len(body.vertices)], along, body.samples]
    taken = [each[:: max(1, -(-len(each) // third))] for each in points]
    return np.ascontiguousarray(np.concatenate(taken))


def edge_points(body: Body, *, spacing: float) -> Float[np.ndarray, "point 3"]:
    """Return points along the sharp convex edges [m], part frame, no farther apart than the spacing [m]."""
    vertices, faces = body.vertices, body.faces
    triangles = vertices[faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0.0)
    keys = edge_keys(faces)
    order = np.argsort(keys, kind="stable")
    twin = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    a, b = order[twin], order[twin + 1]
    starts = vertices[faces.reshape(-1)[a]]
    ends = vertices[faces[:, [1, 2, 0]].reshape(-1)[a]]
    # convex: the other face falls away behind this one
    beyond = triangles[b // 3].mean(axis=1) - starts
    sharp = (normals[a // 3] * normals[b // 3]).sum(axis=1) < _SHARP
    sharp &= (normals[a // 3] * beyond).sum(axis=1) < 0.0
    starts, ends = starts[sharp], ends[sharp]
    counts = np.ceil(np.linalg.norm(ends - starts, axis=1) / spacing).astype(int)
    rows = np.repeat(np.arange(len(counts)), np.maximum(counts - 1, 0))
    within = np.arange(len(rows)) - np.repeat(
        np.cumsum(np.maximum(counts - 1, 0)) - np.maximum(counts - 1, 0), np.maximum(counts - 1, 0)
    )
    share = ((within + 1) / np.maximum(counts[rows], 1))[:, None]
    return starts[rows] + share * (ends[rows] - starts[rows])
