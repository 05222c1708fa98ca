"""Directions along which a part may leave: face normals, hole and cylinder axes, inertia axes.

Directions are lines: d and -d count as one. Each stays exactly as the geometry has it; near ones
are merged by dropping the lighter, never by averaging, for half a degree off over a long hole is a
collision.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from sashimono.geometry.mesh.topology import edge_keys
from sashimono.geometry.se3 import hat


@dataclass(frozen=True, kw_only=True)
class DirectionConfig:
    """Which directions are tried."""

    per_part: int = 8
    """Most directions taken from one part."""
    total: int = 40
    """Most directions tried for every part of the assembly."""
    merge_angle: float = math.radians(0.5)
    """Lines nearer than this [rad] are one."""
    min_weight: float = 0.01
    """Smallest share of a part's surface that must face along, or turn about, a direction."""
    smooth_angle: float = math.radians(46.0)
    """Largest angle [rad] between neighbouring facets of one curved face (an octagon is still a cylinder)."""
    distinct_inertia: float = 0.01
    """Relative difference of principal moments under which their axes are not determined."""


def part_directions(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    *,
    config: DirectionConfig,
) -> tuple[Float[np.ndarray, "line 3"], Float[np.ndarray, "line"]]:
    """Return unit lines taken from one surface and their weights, heaviest first.

    The weight of a line is the share of the surface with that normal, or of the curved surface that
    turns about that axis. Neighbouring facets of a cylinder share an edge along its axis.
    """
    triangles = vertices[faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    double_areas = np.linalg.norm(normals, axis=1)
    keep = double_areas > 1e-12 * double_areas.max()
    faces, normals, areas = faces[keep], normals[keep] / double_areas[keep, None], double_areas[keep]
    areas = areas / areas.sum()
    axes, axis_weights = _edge_axes(vertices, faces, normals, areas, config)
    lines, weights = _merge(np.concatenate([normals, axes]), np.concatenate([areas, axis_weights]), 1e-4)
    enough = weights >= config.min_weight
    lines, weights = _merge(lines[enough], weights[enough], config.merge_angle)
    return lines[: config.per_part], weights[: config.per_part]


def inertia_directions(inertia: Float[np.ndarray, "3 3"], *, config: DirectionConfig) -> Float[np.ndarray, "line 3"]:
    """Return the principal axes that are determined: those whose moment differs from the other two."""
    moments, axes = np.linalg.eigh(inertia)
    gaps = np.abs(moments[:, None] - moments[None, :]) + np.diag([np.inf] * 3)
    distinct = gaps.min(axis=1) > config.distinct_inertia * moments.max()
    return axes.T[distinct]


def merge_directions(
    lists: list[tuple[Float[np.ndarray, "_ 3"], Float[np.ndarray, "_"]]], *, config: DirectionConfig
) -> Float[np.ndarray, "merged 3"]:
    """Return the directions to try for a whole assembly, heaviest first, at most ``config.total``."""
    lines = np.concatenate([entry[0] for entry in lists])
    weights = np.concatenate([entry[1] for entry in lists])
    return _merge(lines, weights, config.merge_angle)[0][: config.total]


def frame_along(direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return a right-handed rotation with rows (u, v, direction)."""
    helper = np.eye(3)[int(np.argmin(np.abs(direction)))]
    u = hat(helper) @ direction
    u /= np.linalg.norm(u)
    return np.stack([u, hat(direction) @ u, direction])


def perpendicular_directions(
    direction: Float[np.ndarray, "3"], lines: Float[np.ndarray, "line 3"]
) -> Float[np.ndarray, "normal 3"]:
    """Return unit vectors at right angles to a direction: across each line, and of each line what is across."""
    across = np.concatenate([np.cross(direction, lines), frame_along(direction)[:1]])
    lengths = np.linalg.norm(across, axis=1)
    across = across[lengths > 1e-6] / lengths[lengths > 1e-6, None]
    return np.concatenate([across, np.cross(direction, across)])


def direction_name(direction: Float[np.ndarray, "3"]) -> str:
    """Return "+z" and the like within half a degree of a world axis, else the components."""
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) > math.cos(math.radians(0.5)):
        return f"{'-' if direction[axis] < 0 else '+'}{'xyz'[axis]}"
    return "({:.2f}, {:.2f}, {:.2f})".format(*(direction + 0.0))


@lru_cache(maxsize=8)
def sphere_directions(count: int) -> Float[np.ndarray, "count 3"]:
    """Return unit vectors spread evenly over the sphere (Fibonacci lattice), read-only."""
    k = np.arange(count) + 0.5
    z = 1.0 - 2.0 * k / count
    turn = np.pi * (1.0 + 5.0**0.5) * k
    r = np.sqrt(1.0 - z * z)
    directions = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)
    directions.flags.writeable = False
    return directions


def _edge_axes(
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    normals: Float[np.ndarray, "face 3"],
    areas: Float[np.ndarray, "face"],
    config: DirectionConfig,
) -> tuple[Float[np.ndarray, "edge 3"], Float[np.ndarray, "edge"]]:
    """Edges between facets that bend smoothly, each weighing half of its two facets' area."""
    keys = edge_keys(faces)
    order = np.argsort(keys, kind="stable")
    owner, keys = order // 3, keys[order]
    twin = np.flatnonzero(keys[1:] == keys[:-1])
    a, b = owner[twin], owner[twin + 1]
    cosine = (normals[a] * normals[b]).sum(axis=1)
    bent = (cosine < np.cos(np.radians(0.5))) & (cosine > np.cos(config.smooth_angle))
    twin, a, b = twin[bent], a[bent], b[bent]
    starts, ends = faces.reshape(-1)[order[twin]], faces[:, [1, 2, 0]].reshape(-1)[order[twin]]
    edges = vertices[ends] - vertices[starts]
    lengths = np.linalg.norm(edges, axis=1)
    fine = lengths > 0.0
    return edges[fine] / lengths[fine, None], 0.5 * (areas[a] + areas[b])[fine]


def _merge(
    lines: Float[np.ndarray, "n 3"], weights: Float[np.ndarray, "n"], angle: float
) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "m"]]:
    """Merge lines nearer than ``angle``: the heaviest stays as it is and takes the weights of the rest."""
    if len(lines) == 0:
        return lines.reshape(0, 3), weights
    # exact repeats first, so that the greedy pass below stays small
    sign = np.where(_leading(lines) < 0.0, -1.0, 1.0)
    lines = lines * sign[:, None]
    _, first, group = np.unique(np.round(lines, 5), axis=0, return_index=True, return_inverse=True)
    totals = np.bincount(group.reshape(-1), weights=weights)
    lines, weights = lines[first], totals
    order = np.lexsort((first, -np.round(weights, 9)))  # of equal ones the first: coordinates would turn with the part
    lines, weights = lines[order], weights[order]
    kept: list[int] = []
    total: list[float] = []
    limit = np.cos(angle)
    alive = np.ones(len(lines), dtype=bool)
    for k in range(len(lines)):
        if not alive[k]:
            continue
        near = alive & (np.abs(lines @ lines[k]) > limit)
        near[k] = True
        alive &= ~near
        kept.append(k)
        total.append(float(weights[near].sum()))
        if len(kept) >= 256:
            break
    again = np.argsort(-np.array(total), kind="stable")
    return lines[np.array(kept)[again]], np.array(total)[again]


def _leading(lines: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
    """The first component that is clearly not zero: fixes the sign of a line."""
    clear = np.abs(lines) > 1e-6
    return lines[np.arange(len(lines)), np.argmax(clear, axis=1)]
