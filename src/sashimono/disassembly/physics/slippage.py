"""Slippage: the small motions that touching surfaces let happen, and the screws they belong to.

A contact with unit normal n, pointing into the moving part at r from its centre, resists a twist (v, ω) by
``n · v + (r × n) · ω``. The twists that nearly all contacts leave free span the near-null space of these rows
(Gelfand & Guibas, "Shape segmentation using local slippage analysis", 2004): a screw for a thread, a turn and a
shift for a cylinder, a turn and two shifts for a plane.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics.contact_solver import Contacts
from sashimono.geometry import se3


@dataclass(frozen=True, kw_only=True)
class SlippageConfig:
    """What counts as contact, and as free."""

    gaps: tuple[float, ...] = (0.01, 0.04)
    """Surfaces nearer than this share of the smaller part's extent touch; tried in turn."""
    free: float = 0.02
    """Largest mean squared normal velocity over the contacts of a free twist of unit size."""
    receding: float = 0.1
    """Normal velocity at which a contact opens, and no longer counts for the motion that opens it."""
    refinements: int = 3
    """Times a twist is fitted again without the contacts that it opens."""
    snap: float = np.radians(3.0)
    """Angle to a line of the geometry [rad] below which that is the axis."""
    least_pitch: float = 0.005
    """Shift per turn, over the part's radius, below which there is no pitch [1/rad]."""
    facing: float = 0.5
    """Least cosine between one surface's normal and the reverse of the other's where they touch."""


def find_contacts(paths: Paths, D: Float[np.ndarray, "4 4"], *, gap: float, facing: float) -> Contacts:
    """Return the contacts of the part at a displacement: surface samples of both sides near the other's surface.

    ``gap`` is relative to the smaller part's smallest extent. What the pair overlaps assembled is no overlap here.
    """
    parts, a = paths.parts, paths.body
    center = se3.apply(D, paths.center[None])[0]
    T_a = D @ paths.T_assembled
    normals, arms, gaps = [np.zeros((0, 3))], [np.zeros((0, 3))], [np.zeros(0)]
    overlaps = parts.overlaps[paths.part, list(paths.others)]
    for other in paths.near(D, margin=gap * paths.size + float(overlaps.max(initial=0.0))):
        b, T_b = parts.bodies[other], parts.poses[other]
        allowed = float(parts.overlaps[paths.part, other])
        near = gap * min(paths.size, float(parts.sizes[other])) + allowed
        for first, second, T_first, T_second, sign in ((a, b, T_a, T_b, 1.0), (b, a, T_b, T_a, -1.0)):
            T = se3.inverse(T_second) @ T_first
            points = se3.apply(T, first.samples)
            inside = ((points > second.bounds[0] - near) & (points < second.bounds[1] + near)).all(axis=1)
            if not inside.any():
                continue
            distances, gradients = second.signed_distance.normals(points[inside], near)
            opposed = -(gradients * (first.sample_normals[inside] @ T[:3, :3].T)).sum(axis=1)
            touching = opposed > facing
            if touching.any():
                paths.touched.add(other)
            normals.append(sign * gradients[touching] @ T_second[:3, :3].T)
            arms.append(se3.apply(T_first, first.samples[inside][touching]) - center)
            gaps.append(distances[touching] + allowed)
    return Contacts(np.concatenate(normals), np.concatenate(arms) / a.radius, np.concatenate(gaps) / a.radius)


def free_twists(paths: Paths, D: Float[np.ndarray, "4 4"], *, config: SlippageConfig) -> list[Float[np.ndarray, "6"]]:
    """Return spatial twists, in the world frame, that the contacts leave free; each moves by about the part's radius.

    Signs matter: a twist and its reverse are both listed where both are free. Most free first.
    """
    center = se3.apply(D, paths.center[None])[0]
    found: list[np.ndarray] = []
    for gap in config.gaps:
        rows = find_contacts(paths, D, gap=gap, facing=config.facing).rows
        if len(rows) < 6:
            continue
        for twist in _null_twists(rows, config.free):
            for start in (twist, -twist):
                refined = snapped(rows, _refined(rows, start, config), paths.parts.lines, config=config)
                refined /= np.linalg.norm(refined)
                if all(np.linalg.norm(refined - known) > 0.02 for known in found):
                    found.append(refined)
    return [spatial_twist(twist, center, paths.body.radius) for twist in found]


def snapped(
    rows: Float[np.ndarray, "contact 6"],
    twist: Float[np.ndarray, "6"],
    lines: Float[np.ndarray, "line 3"],
    *,
    config: SlippageConfig,
) -> Float[np.ndarray, "6"]:
    """Return the twist about, or along, the geometry's own line where one is near; else the twist as it is.

    Contact samples tell an axis to about a degree, faces and holes tell it exactly. What else the twist shifts is
    fitted again to the contacts that it keeps, and a shift along the axis too small to be a pitch is dropped.
    """
    v, w = twist[:3], twist[3:]
    turn = float(np.linalg.norm(w))
    turns = turn > 0.1 * float(np.linalg.norm(v))
    along = w if turns else v
    cosines = lines @ along / np.linalg.norm(along)
    best = int(np.argmax(np.abs(cosines)))
    if abs(cosines[best]) < np.cos(config.snap):
        return twist
    axis = np.sign(cosines[best]) * lines[best]
    if not turns:
        return np.concatenate([np.linalg.norm(v) * axis, np.zeros(3)])
    kept = rows[np.abs(rows @ twist) < config.receding * np.linalg.norm(twist)]
    normals = kept[:, :3]
    turning = turn * axis
    damped = normals.T @ normals + 1e-3 * (len(kept) + 1) * np.eye(3)
    v = v - np.linalg.solve(damped, normals.T @ (kept @ np.concatenate([v, turning])))
    if abs(axis @ v) < config.least_pitch * turn:
        v = v - (axis @ v) * axis
    return np.concatenate([v, turning])


def _null_twists(rows: Float[np.ndarray, "contact 6"], free: float) -> list[Float[np.ndarray, "6"]]:
    """Unit twists of the near-null space: its translations, then its turns, cleared of what translations there are."""
    values, vectors = np.linalg.eigh(rows.T @ rows / len(rows))
    basis = vectors[:, values < free] if values[0] < free else vectors[:, :1]
    if basis.shape[1] == 1:
        return [basis[:, 0]]
    # combinations of the basis, sorted by how much they turn
    _, turns, mixes = np.linalg.svd(basis[3:], full_matrices=True)
    turns = np.concatenate([turns, np.zeros(basis.shape[1] - len(turns))])
    shifts = basis @ mixes[turns < 0.1].T
    rotations = basis @ mixes[turns >= 0.1].T
    span = np.linalg.qr(shifts[:3])[0] if shifts.shape[1] else np.zeros((3, 0))
    rotations[:3] -= span @ (span.T @ rotations[:3])
    return [column / np.linalg.norm(column) for column in np.concatenate([shifts, rotations], axis=1).T]


def _refined(
    rows: Float[np.ndarray, "contact 6"], twist: Float[np.ndarray, "6"], config: SlippageConfig
) -> Float[np.ndarray, "6"]:
    """The free twist nearest to this one once the contacts that it opens are left out."""
    for _ in range(config.refinements):
        kept = rows[rows @ twist < config.receding]
        if len(kept) < 6:
            break
        values, vectors = np.linalg.eigh(kept.T @ kept / len(kept))
        free = vectors[:, values < max(config.free * 0.1, 2.0 * values[0])]
        projected = free @ (free.T @ twist)
        if np.linalg.norm(projected) < 0.5:
            break
        twist = projected / np.linalg.norm(projected)
    return twist


def spatial_twist(
    twist: Float[np.ndarray, "6"], center: Float[np.ndarray, "3"], radius: float
) -> Float[np.ndarray, "6"]:
    """Return the spatial twist of one about the centre with lengths over the radius."""
    v, w = radius * twist[:3], twist[3:]
    return np.concatenate([v - se3.cross(w, center), w])
