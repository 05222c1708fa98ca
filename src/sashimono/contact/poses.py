"""Poses along a path, close enough together that nothing is jumped over."""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import Motion


def exp_many(twist: Float[np.ndarray, "6"], u: Float[np.ndarray, "n"]) -> Float[np.ndarray, "n 4 4"]:
    """Return ``se3.exp(u_k * twist)`` for each u."""
    v, w = twist[:3], twist[3:]
    angle = float(np.linalg.norm(w))
    T = np.tile(np.eye(4), (len(u), 1, 1))
    if angle < 1e-9:
        T[:, :3, 3] = u[:, None] * v
        return T
    W = se3.hat(w / angle)
    a = (u * angle)[:, None, None]
    T[:, :3, :3] += np.sin(a) * W + (1.0 - np.cos(a)) * W @ W
    jacobian = a * np.eye(3) + (1.0 - np.cos(a)) * W + (a - np.sin(a)) * W @ W
    T[:, :3, 3] = jacobian @ v / angle
    return T


def resample(
    T_world_part: Float[np.ndarray, "pose 4 4"],
    *,
    center: Float[np.ndarray, "3"],
    reach: float,
    step: float,
    max_poses: int,
) -> tuple[Float[np.ndarray, "n 4 4"], float]:
    """Return poses along the geodesics between the given ones, which are among them, and their spacing [m].

    No point within ``reach`` of ``center`` (part frame) moves farther than the spacing between two
    of them. The spacing is ``step``, or more where that would take more than about ``max_poses``.
    """
    twists, lengths = [], []
    for T_a, T_b in itertools.pairwise(T_world_part):
        twist = se3.log(se3.inverse(T_a) @ T_b)
        twists.append(twist)
        drift = np.linalg.norm(twist[:3] + np.cross(twist[3:], center))
        lengths.append(float(drift + np.linalg.norm(twist[3:]) * reach))
    spacing = max(step, sum(lengths) / max_poses)
    out = [T_world_part[:1]]
    for T_a, twist, length in zip(T_world_part[:-1], twists, lengths, strict=True):
        if length > 0.0:
            count = int(np.ceil(length / spacing))
            out.append(T_a @ exp_many(twist, np.arange(1, count + 1) / count))
    return np.concatenate(out), spacing


def segment_poses(motion: Motion, kind: str) -> list[Float[np.ndarray, "pose 4 4"]]:
    """Return the given poses of each segment of this kind, in order."""
    return [motion.T_world_part[s.start : s.stop + 1] for s in motion.segments if s.kind == kind]
