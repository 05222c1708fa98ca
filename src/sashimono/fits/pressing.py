"""Where two parts press on each other when one goes straight past the other, and which way each would have to give."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.fits.config import FitConfig
from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.geometry.distance.rays import cast_rays

_STEPS = 96


@dataclass(frozen=True, kw_only=True, eq=False)
class Pressed:
    """A place of a part's surface that goes into the other part."""

    point: Float[np.ndarray, "3"]
    """In the part's frame [m]."""
    push: Float[np.ndarray, "3"]
    """Unit direction, in its frame, in which it would have to give way: across the motion."""
    depth: float
    """How deep it goes in [m]."""
    T_other_part: Float[np.ndarray, "4 4"]
    """Where the two are when it is deepest."""

    def room_behind(self, back: Float[np.ndarray, "3"], other: Body) -> bool:
        """Return whether the other part leaves room behind a point of this part's frame, as deep as it is pressed."""
        start = se3.apply(self.T_other_part, back[None])
        push = (self.T_other_part[:3, :3] @ self.push)[None]
        if other.signed_distance.query(start)[0] < 0.0:
            return False
        room, _ = cast_rays(other.signed_distance, start, push, side="entering")
        return bool(room[0] >= self.depth)


def pressed(
    parts: PlacedParts, part: int, other: int, direction: Float[np.ndarray, "3"], depth: float, *, config: FitConfig
) -> tuple[list[Pressed], list[Pressed]]:
    """Return where a part presses on another on its straight way out, and where that presses on it.

    Args:
        parts: The placed parts.
        part: The part that moves.
        other: The part that stays.
        direction: Of the motion, unit, world frame.
        depth: How deep the two go into each other at most [m].
        config: Which places count.
    """
    a, b = parts.bodies[part], parts.bodies[other]
    length = parts.way_past(part, other, direction)
    T_b_a = se3.inverse(parts.poses[other]) @ parts.poses[part]
    along_b = parts.poses[other][:3, :3].T @ direction
    along_a = parts.poses[part][:3, :3].T @ direction
    travels = length * (np.arange(_STEPS) + 0.5) / _STEPS
    poses = [se3.make(None, travel * along_b) @ T_b_a for travel in travels]
    return (
        _deepest(a, b, poses, along_a, depth, config.pressed_deep),
        _deepest(b, a, [se3.inverse(T) for T in poses], along_b, depth, config.pressed_deep),
    )


def _deepest(
    body: Body,
    other: Body,
    poses: list[Float[np.ndarray, "4 4"]],
    along: Float[np.ndarray, "3"],
    most: float,
    share: float,
) -> list[Pressed]:
    """Where a body's probes are deepest in the other one, of all poses of it in the other's frame."""
    depths, when = np.zeros(len(body.probes)), np.zeros(len(body.probes), dtype=int)
    low, high = other.bounds
    for k, T in enumerate(poses):
        seen = se3.apply(T, body.probes)
        near = np.flatnonzero(((seen > low) & (seen < high)).all(axis=1))
        found = -other.signed_distance.query(seen[near]) if len(near) else np.zeros(0)
        deeper = near[found > depths[near]]
        depths[deeper], when[deeper] = found[found > depths[near]], k
    out = []
    for k in np.flatnonzero(depths > share * max(depths.max(initial=0.0), 1e-12)):
        T = poses[when[k]]
        _, gradient = other.signed_distance.normals(se3.apply(T, body.probes[k : k + 1]), np.inf)
        # outwards, and across the motion
        push = T[:3, :3].T @ gradient[0]
        push = push - (push @ along) * along
        size = float(np.linalg.norm(push))
        if size > 0.3:
            out.append(
                Pressed(point=body.probes[k], push=push / size, depth=min(float(depths[k]), most), T_other_part=T)
            )
    return out


def places(where: list[Pressed], *, config: FitConfig) -> list[Pressed]:
    """Return one for each place where a part is pressed, the deepest first; so many at most, spread over the part.

    Those that are near to one another and pushed alike are one place: its middle, with their mean push and their
    greatest depth. At a corner by itself one would look past the part.
    """
    ordered = sorted(where, key=lambda entry: -round(entry.depth, 12))
    groups: list[list[Pressed]] = []
    for entry in ordered:
        for group in groups:
            near = np.linalg.norm(entry.point - group[0].point) < config.pressed_near * group[0].depth
            if near and entry.push @ group[0].push > config.pressed_alike:
                group.append(entry)
                break
        else:
            groups.append([entry])
    merged = [_merged(group) for group in groups]
    points = np.array([entry.point for entry in merged])
    chosen, gaps = [0], np.linalg.norm(points - points[0], axis=1)
    while len(chosen) < min(config.arm_places, len(merged)) and gaps.max() > 0.0:
        chosen.append(int(np.argmax(gaps)))
        gaps = np.minimum(gaps, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return [merged[k] for k in chosen]


def is_squeezed(entry: Pressed, back: Float[np.ndarray, "3"], where: list[Pressed], *, config: FitConfig) -> bool:
    """Return whether the part is pressed from behind as well, at its back opposite to a place: a post in a ring."""
    reach = config.pressed_opposite * float(np.linalg.norm(back - entry.point))
    return any(
        other.push @ entry.push < -0.5 and np.linalg.norm(other.point - back) < reach + entry.depth for other in where
    )


def _merged(group: list[Pressed]) -> Pressed:
    points = np.array([entry.point for entry in group])
    push = np.sum([entry.push for entry in group], axis=0)
    middle = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    return replace(group[middle], push=push / np.linalg.norm(push), depth=group[0].depth)
