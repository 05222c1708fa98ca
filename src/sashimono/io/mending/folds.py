"""Triangles folded back onto their neighbours. The surface is closed, but there is nothing between the two sheets.

CAD kernels leave them at slivers and at walls of no thickness. There the nearest face can tell the wrong side.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int

from sashimono.geometry.mesh.measures import winding_numbers
from sashimono.geometry.mesh.topology import neighbouring_faces
from sashimono.io.raw import ReadConfig


def count_folded(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, config: ReadConfig
) -> int:
    """Return how many triangles of a closed surface lie back to back with a neighbour and bound no material.

    Where two neighbours' normals are opposite, the winding number just behind either must be one and before it zero.
    """
    triangles = vertices[faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    whole = doubled > 1e-9 * doubled.max(initial=0.0)
    normals = normals / np.where(whole, doubled, 1.0)[:, None]
    pairs = neighbouring_faces(faces)
    pairs = pairs[whole[pairs].all(axis=1)]
    opposite = (normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1) < -np.cos(config.fold_angle)
    doubtful = np.unique(pairs[opposite])[: config.max_folds]
    if not len(doubtful):
        return 0
    middles = triangles[doubtful].mean(axis=1)
    steps = config.fold_step * np.sqrt(doubled[doubtful])[:, None] * normals[doubtful]
    behind = winding_numbers(middles - steps, vertices, faces)
    before = winding_numbers(middles + steps, vertices, faces)
    return int(((np.abs(behind - 1.0) > 0.5) | (np.abs(before) > 0.5)).sum())
