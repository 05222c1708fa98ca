"""Arms that bend: cantilevers with a free end, thin across, rooted on one side, with room behind them.

Where a part is pressed, rays through it tell how thick it is across and how far behind it anything else is. From there
one walks within it, in all directions across: to a free edge, or to where it gets thick, its root. A cantilever of
length L and thickness t whose end gives way by δ is strained by 1.5 t δ / L² at its root.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.fits.config import FitConfig
from sashimono.geometry.body import Body
from sashimono.geometry.distance.rays import cast_rays
from sashimono.geometry.features.directions import frame_along

_WALKS = 16
_STEPS = 64
_STEP = 0.25
"""Length of a step, over the thickness where the walk begins."""


@dataclass(frozen=True, kw_only=True)
class Arm:
    """A cantilever that is pressed near to its end."""

    length: float
    """From where it is pressed to its root [m]."""
    thickness: float
    """Across, in the direction of bending [m]."""
    give: float
    """How far its end can give way [m]."""


def find_arm(
    body: Body, point: Float[np.ndarray, "3"], push: Float[np.ndarray, "3"], depth: float, *, config: FitConfig
) -> tuple[Arm, Float[np.ndarray, "3"]] | None:
    """Return the arm of a part that is pressed at a point of its surface, and its back there; None if it is none.

    Args:
        body: The part.
        point: In its frame [m].
        push: Unit direction in which it would have to give way.
        depth: By how much [m]: so much room must be behind it.
        config: What counts as an arm.
    """
    start = _within(body, point, push, 0.2 * depth)
    if start is None:
        return None
    thick = _across(body, start, push)
    if not np.isfinite(thick[0] + thick[1]) or thick[2] < depth:
        return None
    back = start + thick[1] * push
    frame = frame_along(push)
    turns = 2.0 * np.pi * np.arange(_WALKS) / _WALKS
    directions = np.column_stack([np.cos(turns), np.sin(turns)]) @ frame[:2]
    step = _STEP * (thick[0] + thick[1])
    walks = [_walk(body, back, push, u, step, thick[0] + thick[1], depth, config) for u in directions]
    rooted = np.array([end == "root" for end, _, _ in walks])
    if not rooted.any():
        return None
    lengths = np.array([length for _, length, _ in walks])
    mean = directions[rooted].sum(axis=0)
    if np.linalg.norm(mean) < 1e-9:
        return None
    # the root is on one side, the free end on the other
    along = directions @ (mean / np.linalg.norm(mean))
    if (along[rooted] < -0.1).any():
        return None
    behind = int(np.argmin(along))
    if walks[behind][0] != "free":
        return None
    length = float(lengths[rooted].min())
    thickness = float(np.median([t for (_, _, t), is_rooted in zip(walks, rooted, strict=True) if is_rooted]))
    if length < config.arm_slender * thickness or lengths[behind] > 1.5 * length:
        return None
    give = config.strain * length**2 / (1.5 * thickness)
    return Arm(length=length, thickness=thickness, give=give), back


def _within(
    body: Body, point: Float[np.ndarray, "3"], push: Float[np.ndarray, "3"], least: float
) -> Float[np.ndarray, "3"] | None:
    """A point just inside, near to one of the surface, ahead of it along the push if there is one."""
    u, v, _ = frame_along(push)
    shifts = [push + a * u + b * v for a in (0.0, 1.0, -1.0) for b in (0.0, 1.0, -1.0)]
    tried = point + least * np.array(shifts)
    depths = -body.signed_distance.query(tried)
    inside = np.flatnonzero(depths > 0.05 * least)
    return tried[int(inside[0])] if len(inside) else None


def _across(body: Body, start: Float[np.ndarray, "3"], push: Float[np.ndarray, "3"]) -> tuple[float, float, float]:
    """From a point inside: the way out against the push, along it, and from there to what is behind [m].

    Where the surface is unsound, no way out may be found: then all are infinite.
    """
    ways, _ = cast_rays(body.signed_distance, np.tile(start, (2, 1)), np.stack([-push, push]), side="leaving")
    if not np.isfinite(ways).all():
        return np.inf, np.inf, np.inf
    back = start + (ways[1] + 1e-6 * body.radius) * push
    room, _ = cast_rays(body.signed_distance, back[None], push[None], side="entering")
    return float(ways[0]), float(ways[1]), float(room[0])


def _walk(
    body: Body,
    back: Float[np.ndarray, "3"],
    push: Float[np.ndarray, "3"],
    along: Float[np.ndarray, "3"],
    step: float,
    thickest: float,
    depth: float,
    config: FitConfig,
) -> tuple[str, float, float]:
    """How a walk within the part ends ("root", "free", or "far"), after what length, and the thickness on its way."""
    lanes, seen = [back - 0.25 * thickest * push], [thickest]
    for k in range(1, _STEPS + 1):
        # beside a lip that is as thick as the arm, the middle of both is at the arm's face
        ahead = [lane + step * along for lane in lanes]
        at = next((place for place in ahead if body.signed_distance.contains(place)), None)
        if at is None:
            return "free", k * step, float(np.median(seen))
        front, rest, room = _across(body, at, push)
        across = front + rest
        if across > config.arm_thickens * min(seen) or room < 0.5 * depth:
            return "root", k * step, float(np.median(seen[1:] or seen))
        seen.append(across)
        rim = 0.25 * min(seen)
        lanes = [at + shift * push for shift in (0.5 * (rest - front), rest - rim, rim - front)]
    return "far", _STEPS * step, float(np.median(seen))
