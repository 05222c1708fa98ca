"""Screw motions as keyframes for players that interpolate translation and rotation apart."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.geometry import se3


@dataclass(frozen=True, kw_only=True, eq=False)
class Keyframes:
    """Samples of one part's motion, ready for glTF."""

    times: Float[np.ndarray, "key"]
    """Strictly increasing, float32 [s]."""
    translations: Float[np.ndarray, "key 3"]
    """float32 [m]."""
    quaternions_xyzw: Float[np.ndarray, "key 4"]
    """Unit, float32, each on the same hemisphere as the one before; glTF's order, scalar last."""


def quaternion_xyzw(R: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "4"]:
    """Return the unit quaternion of R in glTF's order, scalar last."""
    return np.asarray(Rotation.from_matrix(R).as_quat())


def rotation_between(a: Float[np.ndarray, "3"], b: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4"]:
    """Return the smallest rotation that takes direction a to b, as a quaternion with its scalar last."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis = np.cross(a, b)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        if a @ b > 0.0:
            return np.array([0.0, 0.0, 0.0, 1.0])
        axis = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
    angle = math.atan2(sine, float(a @ b))
    return np.concatenate([axis / np.linalg.norm(axis) * math.sin(angle / 2.0), [math.cos(angle / 2.0)]])


def samples_needed(twist: Float[np.ndarray, "6"], max_deviation: float) -> int:
    """Return into how many equal pieces a screw motion must be cut.

    With translation and rotation interpolated apart, rotation is exact (slerp keeps the axis) and the origin
    takes the chord of its helix: off by ρ (1 - cos(θ/2)) at most, ρ its distance from the screw axis and θ the
    turn of a piece. A piece turns by no more than π/2, so that slerp knows which way to go.
    """
    v, w = twist[:3], twist[3:]
    angle = float(np.linalg.norm(w))
    if angle < 1e-9:
        return 1
    lever = float(np.linalg.norm(np.cross(w, v))) / angle**2
    by_chord = math.sqrt(lever * angle**2 / (8.0 * max_deviation))
    return max(1, math.ceil(by_chord), math.ceil(angle / (0.5 * math.pi)))


def make_keyframes(
    poses: Float[np.ndarray, "pose 4 4"],
    pose_times: Float[np.ndarray, "pose"],
    duration: float,
    max_deviation: float,
) -> Keyframes:
    """Return keyframes from 0 to ``duration`` [s] that stay within ``max_deviation`` [m] of the geodesics."""
    times, sampled = [0.0], [poses[0]]
    for a, b, start, stop in zip(poses[:-1], poses[1:], pose_times[:-1], pose_times[1:], strict=True):
        twist = se3.log(se3.inverse(a) @ b)
        pieces = samples_needed(twist, max_deviation)
        if times[-1] < start:
            times.append(float(start))
            sampled.append(a)
        for k in range(1, pieces + 1):
            times.append(float(start + (stop - start) * k / pieces))
            sampled.append(b if k == pieces else a @ se3.exp(twist * (k / pieces)))
    times.append(duration)
    sampled.append(poses[-1])

    rounded = np.array(times).astype("<f4")
    # the last pose at a time wins, so that rounding never drops the end of a motion
    keep = np.concatenate([rounded[1:] > rounded[:-1], [True]])
    T = np.array(sampled)[keep]
    quaternions = np.asarray(Rotation.from_matrix(T[:, :3, :3]).as_quat())
    flips = np.cumprod(np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0))
    quaternions[1:] *= flips[:, None]
    return Keyframes(
        times=rounded[keep],
        translations=T[:, :3, 3].astype("<f4"),
        quaternions_xyzw=quaternions.astype("<f4"),
    )
