"""Does a push balance? Equation (1) of the paper, drawn up again from the input geometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import Contact, Motion
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.fingertips import Around
from sashimono.verify.target import HalfSpace

_GRAVITY = 9.81


def push_problems(
    contact: Contact, motion: Motion, body: SampledBody, fixed: Around, table: HalfSpace | None, config: VerifyConfig
) -> list[str]:
    """Return what is wrong with the balance of a push.

    The stated reactions must come from placed parts, at points where these touch the part, along their normals and in
    their cones; push and reactions must add up to the weight and the resistance along the way that is stated in weights
    of the part.
    """
    details = contact.details
    if contact.force_part is None or "supports" not in details:
        return ["push: no reactions of the parts around are stated, so nothing shows that it balances"]
    numbers = [details.get(name) for name in ("density", "drive")]
    if not all(isinstance(value, int | float) and math.isfinite(value) and value > 0.0 for value in numbers):
        return ["push: density or drive is not a number above 0"]
    density, drive = (float(value) for value in numbers)  # pyright: ignore[reportArgumentType]
    try:
        names, points, normals, forces = _supports(details["supports"])
    except (KeyError, TypeError, ValueError):
        return ["push: its supports are not lists of as many points, normals and forces"]
    problems = _touch_problems(names, points, normals, motion.T_world_part[-1], body, fixed, config)
    along = np.einsum("ij,ij->i", forces, normals)
    aside = np.linalg.norm(forces - along[:, None] * normals, axis=1)
    friction = math.sqrt(contact.friction) if details.get("friction_cone") == "printed" else contact.friction
    weight = density * body.volume * _GRAVITY
    if (aside > friction * along + config.balance_tolerance * weight).any():
        problems.append("push: a reaction is outside its friction cone")
    radius = float(np.linalg.norm(body.vertices - body.center_of_mass, axis=1).max())
    wanted = drive * weight * _direction(motion, body, radius)
    if table is not None:
        wanted[:3] += weight * motion.T_world_part[-1][:3, :3].T @ table.normal
    everywhere = np.concatenate([contact.points_part, points]) - body.center_of_mass
    pushed = np.concatenate([contact.force_part, forces])
    got = np.concatenate([pushed.sum(axis=0), np.cross(everywhere, pushed).sum(axis=0) / radius])
    off = float(np.linalg.norm(got - wanted)) / max(float(np.linalg.norm(wanted)), 1e-30)
    if not off <= config.balance_tolerance:
        problems.append(f"push: forces do not balance, {off:.2g} of the wrench is left")
    return problems


def _supports(stated: Mapping[str, Any]) -> tuple[list[str], np.ndarray, np.ndarray, np.ndarray]:
    names = [str(name) for name in stated["parts"]]
    arrays = [np.array(stated[name], dtype=np.float64) for name in ("points_part", "normals_part", "forces_part")]
    points, normals, forces = (array.reshape(len(names), 3) for array in arrays)
    if not all(np.isfinite(array).all() for array in (points, normals, forces)):
        raise ValueError
    return names, points, normals, forces


def _direction(motion: Motion, body: SampledBody, radius: float) -> Float[np.ndarray, "6"]:
    """Unit direction in which the part goes last, seen from its frame: (velocity of the centre of mass, radius times
    turning rate)."""
    poses = motion.T_world_part
    for a, b in zip(poses[-2::-1], poses[:0:-1], strict=True):
        twist = se3.log(se3.inverse(a) @ b)
        way = np.concatenate([twist[:3] + np.cross(twist[3:], body.center_of_mass), radius * twist[3:]])
        if np.linalg.norm(way) > 1e-9 * radius:
            return way / np.linalg.norm(way)
    return np.zeros(6)


def _touch_problems(
    names: list[str],
    points: np.ndarray,
    normals: np.ndarray,
    T_world_part: np.ndarray,
    body: SampledBody,
    fixed: Around,
    config: VerifyConfig,
) -> list[str]:
    gap = config.support_tolerance * body.smallest_extent
    for name, point, normal in zip(names, points, normals, strict=True):
        if name not in fixed:
            return [f"push: {name!r} is said to support the part, but is not in place"]
        other, T_world_other = fixed[name]
        T = se3.inverse(T_world_other) @ T_world_part
        seen, turned = se3.apply(T, point[None]), (T[:3, :3] @ normal)[None]
        away = max(abs(float(body.distance(point[None])[0])), abs(float(other.distance(seen)[0])))
        if away > gap:
            return [f"push: {name} does not touch the part where it is said to support it ({away * 1e3:.3g} mm off)"]
        shifts = (0.0, gap, -gap)
        faces = np.concatenate([other.nearest_normal(seen + shift * turned) for shift in shifts])
        if (faces @ turned[0]).max() < math.cos(config.normal_tolerance) or abs(np.linalg.norm(normal) - 1.0) > 1e-6:
            return [f"push: the support by {name} has another normal than its surface there"]
    return []
