"""Do fingertips stay clear? Balls at the contact points, followed along the way without a gap."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import Contact, Motion
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.target import HalfSpace

Around = Mapping[str, tuple[SampledBody, Float[np.ndarray, "4 4"]]]


def tip_problems(
    contact: Contact, motion: Motion, body: SampledBody, around: Around, table: HalfSpace | None, config: VerifyConfig
) -> list[str]:
    """Return what is wrong with a contact's fingertips between the two poses at which it begins and ends.

    Each ball may reach ``config.tip_tolerance`` of its radius into what it meets, and into the part itself. Looked at
    are the way in between, by steps that the distance covers, and the straight ways off the surface at both ends.
    """
    found = _stated(contact, motion)
    if isinstance(found, str):
        return [found]
    radius, approach, start, stop = found
    limit = (1.0 - config.tip_tolerance) * radius
    surroundings = _Distance(around, table, limit)
    for k, (point, normal) in enumerate(zip(contact.points_part, contact.normals_part, strict=True)):
        center, off = point - radius * normal, -approach * normal
        itself = _Distance({body.name: (body, np.eye(4))}, None, limit)
        if itself.first_hit(lambda u, c=center, o=off: c + u * o, approach, config):
            return [f"{contact.kind}: fingertip {k} reaches into the part that it holds"]
        for when, where in (("where it begins", start), ("where it ends", stop)):
            T = _pose_at(motion, where)
            a, b = se3.apply(T, center[None])[0], T[:3, :3] @ off
            if hit := surroundings.first_hit(lambda u, a=a, b=b: a + u * b, approach, config):
                return [f"{contact.kind}: fingertip {k} hits {hit} {when}"]
        for a, b in _legs(motion, start, stop):
            twist = se3.log(se3.inverse(a) @ b)
            speed = float(np.linalg.norm(twist[:3] + np.cross(twist[3:], center)))
            move = lambda u, a=a, t=twist, c=center: se3.apply(a @ se3.exp(u * t), c[None])[0]  # noqa: E731
            if hit := surroundings.first_hit(move, speed, config):
                return [f"{contact.kind}: fingertip {k} hits {hit} on its way"]
    return []


def span_of(contact: Contact, motion: Motion) -> tuple[float, float]:
    """Return the poses between which a contact acts, all of them where nothing is stated."""
    start = contact.details.get("from_pose", 0.0)
    stop = contact.details.get("to_pose", float(len(motion.T_world_part) - 1))
    return start, stop


def _stated(contact: Contact, motion: Motion) -> tuple[float, float, float, float] | str:
    tips: Any = contact.details["fingertips"]
    start, stop = span_of(contact, motion)
    radius, approach = (tips.get(name) if isinstance(tips, Mapping) else None for name in ("radius", "approach"))
    for name, value in (("radius", radius), ("approach", approach)):
        if not isinstance(value, int | float) or not math.isfinite(value) or value <= 0.0:
            return f"{contact.kind}: the fingertips' {name} is not a length"
    last = len(motion.T_world_part) - 1
    if not all(isinstance(value, int | float) for value in (start, stop)) or not 0.0 <= start < stop <= last:
        return f"{contact.kind}: from_pose and to_pose are not two poses of the path, in order"
    return float(radius), float(approach), float(start), float(stop)  # pyright: ignore[reportArgumentType]


def _pose_at(motion: Motion, where: float) -> Float[np.ndarray, "4 4"]:
    poses = motion.T_world_part
    k = min(int(where), len(poses) - 2)
    return se3.interpolate(poses[k], poses[k + 1], where - k)


def _legs(motion: Motion, start: float, stop: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    inner = [float(k) for k in range(len(motion.T_world_part)) if start < k < stop]
    for a, b in pairwise([start, *inner, stop]):
        yield _pose_at(motion, a), _pose_at(motion, b)


class _Distance:
    """How far a ball's centre is from everything, compared with a limit."""

    def __init__(self, around: Around, table: HalfSpace | None, limit: float) -> None:
        self._around = [(name, body, se3.inverse(T)) for name, (body, T) in around.items()]
        self._boxes = np.array([body.box_in(T) for body, T in around.values()]).reshape(-1, 2, 3)
        self._table, self._limit = table, limit

    def first_hit(self, center_at: Any, way: float, config: VerifyConfig) -> str | None:
        """Return what a ball first comes nearer to than the limit, u going from 0 to 1 over a way [m]; None if nothing.

        The centre moves no farther than the way, so that the distance at one u holds for a stretch after it.
        """
        u, least = 0.0, 0.02 * self._limit
        for _ in range(config.max_tip_steps):
            name, room = self._room(center_at(u))
            if room < 0.0:
                return name
            if u >= 1.0 or way <= 0.0:
                return None
            u = min(1.0, u + max(room, least) / way)
        return "more than could be looked at"

    def _room(self, center: Float[np.ndarray, "3"]) -> tuple[str, float]:
        nearest, room = "", math.inf
        if self._table is not None:
            nearest, room = "the table", float(center @ self._table.normal) - self._table.offset - self._limit
        gaps = np.maximum(np.maximum(self._boxes[:, 0] - center, center - self._boxes[:, 1]), 0.0)
        bounds = np.sqrt(np.einsum("ij,ij->i", gaps, gaps)) - self._limit
        for k in np.argsort(bounds, kind="stable").tolist():
            name, body, T = self._around[k]
            if (bound := float(bounds[k])) >= room:
                break
            if bound >= 2.0 * self._limit:  # far enough for the bound to do
                return name, bound
            here = float(body.distance(se3.apply(T, center[None]))[0]) - self._limit
            if here < room:
                nearest, room = name, here
        return nearest, room
