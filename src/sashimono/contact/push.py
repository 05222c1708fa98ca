"""A push: one point at which a finger drives the part home, against its supports. Equation (1) of the paper.

A lone contact gives six equations in three unknowns, so the reactions of the placed parts, at the points where they
touch the part and within their own friction cones, belong to the balance. W, what the contacts must add up to, carries
the weight and overcomes a resistance along the direction of travel at the end of the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.contact.cone_program import Contacts
from sashimono.contact.config import ContactConfig
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.geometry.features.spread import spread
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion, Table

GRAVITY = 9.81
_FACING = -0.7


class Supports(NamedTuple):
    """Where placed parts touch the part, in its frame."""

    points: Float[np.ndarray, "support 3"]
    """On the moving part's surface [m]."""
    normals: Float[np.ndarray, "support 3"]
    """Unit, into the moving part: the surface of the placed one seen from outside."""
    parts: tuple[str, ...]
    """The placed part at each."""


def travel_at_end(motion: Motion, center: Float[np.ndarray, "3"], radius: float) -> Float[np.ndarray, "6"]:
    """Return the unit direction of the last stretch of the way in the part's frame: (velocity of the centre, turning
    rate times the radius)."""
    poses = motion.T_world_part
    for k in range(len(poses) - 1, 0, -1):
        # seen from the assembled pose, in which the balance is drawn up
        twist = se3.log(se3.inverse(poses[k - 1]) @ poses[k])
        way = np.concatenate([twist[:3] + np.cross(twist[3:], center), radius * twist[3:]])
        length = float(np.linalg.norm(way))
        if length > 1e-9 * radius:
            return way / length
    return np.zeros(6)


def weight_of(body: Body, config: ContactConfig) -> float:
    """Return the weight of a part [N], from its volume and the density assumed."""
    return config.density * body.mass_properties.volume * GRAVITY


def wanted_wrench(
    body: Body, motion: Motion, table: Table | None, radius: float, config: ContactConfig
) -> tuple[Float[np.ndarray, "6"], float]:
    """Return W, (force [N], torque about the centre of mass [N m]) in the part's frame, and the part's weight [N]."""
    weight = weight_of(body, config)
    way = travel_at_end(motion, body.mass_center, radius)
    wrench = config.drive * weight * np.concatenate([way[:3], radius * way[3:]])
    if table is not None:
        wrench[:3] += weight * motion.T_world_part[-1][:3, :3].T @ table.normal
    return wrench, weight


def find_supports(
    body: Body, T_world_part: Float[np.ndarray, "4 4"], fixed: Sequence[Obstacle], config: ContactConfig
) -> Supports:
    """Return where placed parts touch the part at its assembled pose, a few points spread widely."""
    gap = config.support_gap * body.smallest_extent
    points, normals, names = [], [], []
    for obstacle in fixed:
        other = obstacle.body
        T = se3.inverse(obstacle.T_world_part) @ T_world_part  # other from part
        R = T[:3, :3]
        seen = se3.apply(T, body.samples)
        near = ((seen > other.bounds[0] - gap) & (seen < other.bounds[1] + gap)).all(axis=1)
        if near.any():
            d, n = other.signed_distance.normals(seen[near], 2.0 * gap)
            facing = (np.abs(d) <= gap) & ((n * (body.sample_normals[near] @ R.T)).sum(axis=1) < _FACING)
            points.append(body.samples[near][facing])
            normals.append(n[facing] @ R)
            names += [other.name] * int(facing.sum())
        back = se3.inverse(T)
        seen = se3.apply(back, other.samples)
        near = ((seen > body.bounds[0] - gap) & (seen < body.bounds[1] + gap)).all(axis=1)
        if near.any():
            d, n = body.signed_distance.normals(seen[near], 2.0 * gap)
            outward = other.sample_normals[near] @ back[:3, :3].T
            facing = (np.abs(d) <= gap) & ((n * outward).sum(axis=1) < _FACING)
            points.append(seen[near][facing] - d[facing, None] * n[facing])
            normals.append(outward[facing])
            names += [other.name] * int(facing.sum())
    if not names:
        return Supports(np.zeros((0, 3)), np.zeros((0, 3)), ())
    points, normals = np.concatenate(points), np.concatenate(normals)
    kept = spread(np.concatenate([points / body.radius, 0.5 * normals], axis=1), config.max_supports)
    return Supports(points[kept], normals[kept], tuple(names[k] for k in kept))


def scaled(points: np.ndarray, normals: np.ndarray, center: np.ndarray, radius: float) -> Contacts:
    """Return contacts with the origin at the centre of mass and lengths over the radius."""
    return Contacts((points - center) / radius, normals)
