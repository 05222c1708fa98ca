"""Straight ways out of a pose, past all others at once."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float
from numba import njit

from sashimono.disassembly.tilting.contact_surface import ContactSurface, Gaps
from sashimono.geometry import se3
from sashimono.geometry.distance.advancement import advance_points

_AGAINST = -0.1
"""A direction that closes a touching gap faster than this is no way out."""
_STRIDES = (6, 1)
"""Some probes look along all directions first, as most are blocked for these; then all do, then the exact check."""


def straight_exit(
    surface: ContactSurface, D: Float[np.ndarray, "4 4"], near: Gaps, lines: Float[np.ndarray, "line 3"]
) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, "3"]] | None:
    """Return where the part is out after one translation from D, and its direction; None if there is none.

    Tried are the lines, both ways, and the mean normal of what touches; ``near`` are the gaps at D.
    """
    touching = near.rows[near.gaps < 0.01 * surface.paths.size, :3]
    mean = touching.sum(axis=0)
    length = float(np.linalg.norm(mean))
    directions = np.concatenate([[mean / length], lines, -lines] if length > 1e-9 else [lines, -lines])
    if len(touching):
        directions = directions[(directions @ touching.T).min(axis=1) > _AGAINST]
    for stride in _STRIDES:
        directions = directions[_seem_open(surface, D, directions, stride)]
    for direction in directions:
        end = surface.paths.exit(D, direction)
        if end is not None:
            return end, direction
    return None


def _seem_open(
    surface: ContactSurface, D: Float[np.ndarray, "4 4"], directions: Float[np.ndarray, "direction 3"], stride: int
) -> Bool[np.ndarray, "direction"]:
    """Whether every so manieth probe of both sides, followed along each direction, meets nothing."""
    paths, parts = surface.paths, surface.paths.parts
    is_open = np.ones(len(directions), np.bool_)
    for other in paths.others:
        T = se3.inverse(parts.poses[other]) @ D @ paths.T_assembled
        limit = parts.limit(paths.part, other, paths.tolerance)
        least = parts.tolerances.least_step * parts.smaller_size(paths.part, other)
        body = parts.bodies[other]
        reach = float(np.linalg.norm(se3.apply(T, paths.body.center[None])[0] - body.center))
        options = (reach + paths.body.radius + body.radius, limit, least)
        along = directions @ parts.poses[other][:3, :3]
        points = np.ascontiguousarray(se3.apply(T, surface.own[::stride]))
        paths.traced += _close(points, along, *options, *body.signed_distance.arrays, is_open)
        T = se3.inverse(T)
        points = np.ascontiguousarray(se3.apply(T, surface.theirs[other][::stride]))
        paths.traced += _close(points, -along @ T[:3, :3].T, *options, *paths.body.signed_distance.arrays, is_open)
    return is_open


@njit(cache=True, nogil=True)
def _close(
    points, directions, length, limit, least_step, boxes, links, triangles, normals, is_open
):  # pragma: no cover - compiled
    """Close the directions along which a point gets too deep; return how many points were followed."""
    followed = 0
    first = 0  # what stopped one direction often stops the next
    n = points.shape[0]
    for m in range(directions.shape[0]):
        if not is_open[m]:
            continue
        for k in range(n):
            at = (first + k) % n
            followed += 1
            travel, _ = advance_points(
                points[at : at + 1], directions[m], length, limit, least_step, np.inf, boxes, links, triangles, normals
            )
            if np.isfinite(travel):
                is_open[m] = False
                first = at
                break
    return followed
