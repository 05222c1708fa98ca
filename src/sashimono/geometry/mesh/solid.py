"""Closed surfaces as exact solids, for booleans."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from manifold3d import Error, Manifold, Mesh64, OpType


def to_manifold(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> Manifold:
    """Return the mesh as a manifold3d solid; its status says whether that worked."""
    return Manifold(Mesh64(np.array(vertices, np.float64, order="C"), np.array(faces, np.uint64, order="C")))


def unite(
    meshes: Sequence[tuple[Float[np.ndarray, "_ 3"], Int[np.ndarray, "_ 3"]]],
) -> tuple[Float[np.ndarray, "united 3"], Int[np.ndarray, "united_face 3"]]:
    """Return the surface of the union of closed meshes in one frame [m], by exact booleans.

    If one of them is no oriented 2-manifold, the meshes are put side by side as they are.
    """
    solids = [to_manifold(v, f) for v, f in meshes]
    if all(solid.status() == Error.NoError for solid in solids):
        out = Manifold.batch_boolean(solids, OpType.Add).to_mesh64()
        return np.array(out.vert_properties[:, :3]), np.array(out.tri_verts, dtype=np.int32)
    starts = np.cumsum([0, *(len(v) for v, _ in meshes)])
    faces = [np.asarray(f, np.int32) + start for (_, f), start in zip(meshes, starts, strict=False)]
    return np.concatenate([v for v, _ in meshes]), np.concatenate(faces).astype(np.int32)
