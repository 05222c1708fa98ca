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
    depth, and changes no faster than the point moves. So triangles are quartered only while they may hold a point
    deeper than the best by ``accuracy`` times the smaller body's smallest extent, the most promising ``batch`` at a
    time, up to ``max_points`` looked at.
    """
    if first.solid is None or second.solid is None:
        return None
    common = first.solid.transform(np.ascontiguousarray(T_second_first[:3])) ^ second.solid
    if common.is_empty() or common.volume() <= 0.0:
        return 0.0
    T_first_second = se3.inverse(T_second_first)

    def depths(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        in_first = np.abs(first.signed_distance.query(se3.apply(T_first_second, points)))
        return np.maximum(in_first, np.abs(second.signed_distance.query(points)))

    shared = common.to_mesh64()
    corners = np.array(shared.vert_properties)[:, :3]
    triangles = corners[np.array(shared.tri_verts).astype(np.int64)]
    best = float(depths(corners).max())
    slack = accuracy * min(first.smallest_extent, second.smallest_extent)
    bounds = np.full(len(triangles), np.inf)
    looked = len(corners)
    while looked < max_points:
        # the most promising first, and of all only those that may be deeper
        order = np.argsort(-np.round(bounds, 12), kind="stable")[: int((bounds > best + slack).sum())]
        if not len(order):
            break
        pieces = _quartered(triangles[order[:batch]])
        centers = pieces.mean(axis=1)
        at_centers = depths(centers)
        looked += len(centers)
        best = max(best, float(at_centers.max()))
        reach = np.linalg.norm(pieces - centers[:, None], axis=2).max(axis=1)
        triangles = np.concatenate([triangles[order[batch:]], pieces])
        bounds = np.concatenate([bounds[order[batch:]], at_centers + reach])
    return best


def _quartered(triangles: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "m 3 3"]:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
    pieces = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(piece, axis=1) for piece in pieces])
