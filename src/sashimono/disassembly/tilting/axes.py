"""The axes of a surface's round faces: what a hinge, a plug or a key in a curved slot turns about."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.geometry.body import Body
from sashimono.geometry.mesh.topology import edge_keys

_BENT = (np.cos(np.radians(46.0)), np.cos(np.radians(0.5)))
"""Cosines between which neighbouring facets are of one round face."""


def round_axes(body: Body, *, most: int, merge: float) -> Float[np.ndarray, "axis 2 3"]:
    """Return the axes of the round faces as (point [m], unit direction), part frame, the largest area first.

    Two neighbouring facets of a cylinder share an edge along its axis, and their normals through their middles meet on
    it. Axes with directions within 2 degrees and points within ``merge`` [m] are one.
    """
    vertices, faces = body.vertices, body.faces
    triangles = vertices[faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled = np.linalg.norm(normals, axis=1)
    normals = np.divide(normals, doubled[:, None], out=np.zeros_like(normals), where=doubled[:, None] > 0.0)
    keys = edge_keys(faces)
    order = np.argsort(keys, kind="stable")
    twin = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    side, a, b = order[twin], order[twin] // 3, order[twin + 1] // 3
    cosine = (normals[a] * normals[b]).sum(axis=1)
    bent = (cosine > _BENT[0]) & (cosine < _BENT[1]) & (doubled[a] > 0.0) & (doubled[b] > 0.0)
    side, a, b = side[bent], a[bent], b[bent]
    starts, ends = vertices[faces.reshape(-1)[side]], vertices[faces[:, [1, 2, 0]].reshape(-1)[side]]
    lengths = np.linalg.norm(ends - starts, axis=1)
    fine = lengths > 1e-6 * body.radius
    starts, a, b = starts[fine], a[fine], b[fine]
    lines = (ends[fine] - starts) / lengths[fine, None]
    weights = doubled[a] + doubled[b]
    # equal facets on both sides: the axis lies on the bisecting plane, as far as a chord and its bend tell
    bisector = normals[a] + normals[b]
    bisector /= np.linalg.norm(bisector, axis=1, keepdims=True)
    half = 0.5 * np.arccos(np.clip((normals[a] * normals[b]).sum(axis=1), -1.0, 1.0))
    chord = _reach(triangles[a], starts, lines) + _reach(triangles[b], starts, lines)
    rise = ((triangles[b].mean(axis=1) - starts) * normals[a]).sum(axis=1)
    sign = np.where(rise < 0.0, -1.0, 1.0)  # the axis is behind a convex face, before a hollow one
    points = starts + (sign * 0.25 * chord / np.sin(half))[:, None] * bisector
    return _merged(points, lines, weights, most=most, merge=merge)


def _reach(
    triangles: Float[np.ndarray, "n 3 3"], starts: Float[np.ndarray, "n 3"], lines: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n"]:
    """How far each triangle reaches from its edge, at right angles to it."""
    arms = triangles - starts[:, None]
    arms = arms - (arms * lines[:, None]).sum(axis=2, keepdims=True) * lines[:, None]
    return np.linalg.norm(arms, axis=2).max(axis=1)


def _merged(
    points: Float[np.ndarray, "n 3"],
    lines: Float[np.ndarray, "n 3"],
    weights: Float[np.ndarray, "n"],
    *,
    most: int,
    merge: float,
) -> Float[np.ndarray, "axis 2 3"]:
    out: list[np.ndarray] = []
    left = np.ones(len(points), np.bool_)
    while left.any() and len(out) < most:
        heavy = int(np.argmax(np.where(left, weights, -1.0)))
        along = np.abs(lines @ lines[heavy]) > np.cos(np.radians(2.0))
        arms = points - points[heavy]
        arms = arms - np.outer(arms @ lines[heavy], lines[heavy])
        same = left & along & (np.linalg.norm(arms, axis=1) < merge)
        same[heavy] = True
        share = weights[same] / weights[same].sum()
        out.append(np.stack([points[heavy] + share @ arms[same], lines[heavy]]))
        left &= ~same
    return np.array(out).reshape(-1, 2, 3)
