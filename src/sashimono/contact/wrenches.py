"""Wrenches that a contact can exert on a part: linearised friction cones of hard and soft fingers.

A soft finger transmits, besides the force in its friction cone, a torque about the contact normal. Force and
torque share the elliptic friction limit of Howe & Cutkosky, "Practical force-motion models for sliding
manipulation" (1996): ``|f_t|²/μ² + τ_n²/t² ≤ f_n²`` with t [m] the torsional friction coefficient.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float


def torsional_friction(friction: float, patch_radius: float) -> float:
    """Return the largest torque about the normal per normal force [m]: (2/3) μ a for even pressure on a disc."""
    return 2.0 / 3.0 * friction * patch_radius


def unit_across(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Return a unit vector perpendicular to each of the unit vectors."""
    helper = np.eye(3)[np.argmin(np.abs(vectors), axis=1)]
    across = np.cross(helper, vectors)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


def contact_wrenches(
    points: Float[np.ndarray, "grasp contact 3"],
    normals: Float[np.ndarray, "grasp contact 3"],
    *,
    tangential_friction: float,
    torsion: float,
    edges: int,
    center: Float[np.ndarray, "3"],
    radius: float,
    first_edges: Float[np.ndarray, "grasp 3"] | None = None,
) -> Float[np.ndarray, "grasp wrench 6"]:
    """Return the extreme wrenches (force, torque/radius) of unit normal force at each contact of each grasp.

    Each contact gives ``edges`` forces on the rim of its friction cone and, if ``torsion`` [m] is not
    zero, its normal force with the largest torque either way about the normal: an inscribed polytope of the
    friction limit. Torques are about ``center``, divided by ``radius`` [m], so all six components are
    dimensionless. Normals are unit and inward. ``first_edges``: where the first edge of a grasp's cones lies,
    projected; not along a normal.
    """
    if first_edges is None:
        first_edges = unit_across(normals[:, 0])
    u = first_edges[:, None] - (first_edges[:, None] * normals).sum(axis=2, keepdims=True) * normals
    u = u / np.linalg.norm(u, axis=2, keepdims=True)
    v = np.cross(normals, u)
    angles = 2.0 * np.pi * np.arange(edges) / edges
    lateral = np.cos(angles)[:, None] * u[:, :, None] + np.sin(angles)[:, None] * v[:, :, None]
    forces = normals[:, :, None] + tangential_friction * lateral
    arms = ((points - center) / radius)[:, :, None]
    wrenches = np.concatenate([forces, np.cross(arms, forces)], axis=3)
    if torsion > 0.0:
        turns = torsion / radius * np.array([1.0, -1.0])[:, None] * normals[:, :, None]
        push = np.broadcast_to(normals[:, :, None], turns.shape)
        twisted = np.concatenate([push, np.cross(arms, push) + turns], axis=3)
        wrenches = np.concatenate([wrenches, twisted], axis=2)
    return wrenches.reshape(len(points), wrenches.shape[1] * wrenches.shape[2], 6)
