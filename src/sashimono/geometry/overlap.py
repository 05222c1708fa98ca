"""How deep two bodies overlap in one pose, from the exact body that they share."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import Body


def intersection_depth(
    first: Body,
    second: Body,
    T_second_first: Float[np.ndarray, "4 4"],
    *,
    accuracy: float = 0.004,
    max_points: int = 8000,
    batch: int = 128,
) -> float | None:
    """Return the depth [m] of the deepest point that the two share, 0 if there is none; None if no boolean is had.

    Every point of the shared body's surface lies on one of the two surfaces; its distance to the other one is its
    depth, which changes no faster than the point moves, and which a triangle's corners bound
    (`SignedDistance.bounds_on`). So triangles are quartered only while they may hold a point deeper than the best by
    ``accuracy`` times the smaller body's smallest extent, the most promising ``batch`` at a time, up to ``max_points``
    looked at.
    """
    if first.solid is None or second.solid is None:
        return None
    common = first.solid.transform(np.ascontiguousarray(T_second_first[:3])) ^ second.solid
    if common.is_empty() or common.volume() <= 0.0:
        return 0.0
    T_first_second = se3.inverse(T_second_first)

    def depths(pieces: Float[np.ndarray, "n 3 3"]) -> tuple[Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
        """Depth at the centre of each triangle, and the most that any of its points can have."""
        in_first = se3.apply(T_first_second, pieces.reshape(-1, 3)).reshape(-1, 3, 3)
        centers, bounds = np.maximum(
            first.signed_distance.bounds_on(in_first), second.signed_distance.bounds_on(pieces)
        )
        reach = np.linalg.norm(pieces - pieces.mean(axis=1, keepdims=True), axis=2).max(axis=1)
        return centers, np.minimum(bounds, centers + reach)

    shared = common.to_mesh64()
    corners = np.array(shared.vert_properties)[:, :3]
    triangles = corners[np.array(shared.tri_verts).astype(np.int64)]
    at_centers, bounds = depths(triangles)
    at_corners = np.maximum(
        np.abs(first.signed_distance.query(se3.apply(T_first_second, corners))),
        np.abs(second.signed_distance.query(corners)),
    )
    # ridges are deepest at a corner, and of a fine mesh the triangles alone are more than are looked at
    best, looked = max(float(at_centers.max()), float(at_corners.max())), len(triangles)
    slack = accuracy * min(first.smallest_extent, second.smallest_extent)
    while looked < max_points:
        # the most promising first, and of all only those that may be deeper
        order = np.argsort(-np.round(bounds, 12), kind="stable")[: int((bounds > best + slack).sum())]
        if not len(order):
            break
        pieces = _quartered(triangles[order[:batch]])
        at_centers, most = depths(pieces)
        looked += len(pieces)
        best = max(best, float(at_centers.max()))
        triangles = np.concatenate([triangles[order[batch:]], pieces])
        bounds = np.concatenate([bounds[order[batch:]], most])
    return best


def _quartered(triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "m 3 3"]:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    pieces = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(piece, axis=1) for piece in pieces])
