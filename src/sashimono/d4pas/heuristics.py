"""Orders that need no learning: at random, inside out, and by lateral clearance ("the rule").

What they reach on a dataset says how much there is to learn.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

Clouds = Float[np.ndarray, "part point 6"]
"""Points of each part in place with normals, in the unit ball."""


def random_order(count: int, rng: np.random.Generator) -> list[int]:
    """Return an assembly order drawn evenly from all."""
    return [int(k) for k in rng.permutation(count)]


def inside_out(clouds: Clouds) -> list[int]:
    """Return the parts by the distance of their centres from the middle, the nearest placed first."""
    distance = np.linalg.norm(clouds[..., :3].mean(axis=1), axis=1)
    return [int(k) for k in np.argsort(np.round(distance, 9), kind="stable")]


def by_clearance(clouds: Clouds) -> list[int]:
    """Return the assembly order of the rule: take apart what has most room to leave, and turn the order round.

    The room of a part is the largest, over six directions, of the smallest lateral distance from its front-facing
    points to back-facing points ahead of them on the parts that remain.
    """
    room = lateral_clearance(clouds, main_directions(clouds.reshape(-1, 6)[:, 3:]))
    room += 1e3 * np.eye(len(clouds))[:, :, None]
    remaining, order = list(range(len(clouds))), []
    while remaining:
        here = room[np.ix_(remaining, remaining)].min(axis=1).max(axis=1)
        order.append(remaining.pop(int(np.argmax(np.round(here, 9)))))
    return order[::-1]


def main_directions(normals: Float[np.ndarray, "point 3"], *, most: int = 512) -> Float[np.ndarray, "6 3"]:
    """Return three lines that most normals lie along, each in both directions."""
    normals = normals[:: max(1, len(normals) // most)]
    weight, candidates, lines = np.ones(len(normals)), normals, []
    while len(lines) < 3 and len(candidates):
        near = np.abs(candidates @ normals.T) > 0.985
        best = int((near * weight).sum(axis=1).argmax())
        line = (normals[near[best]] * np.sign(normals[near[best]] @ candidates[best])[:, None]).sum(axis=0)
        line /= np.linalg.norm(line)
        lines.append(line)
        weight = weight * (np.abs(normals @ line) < 0.9)
        candidates = candidates[np.abs(candidates @ line) < 0.9]
    while len(lines) < 3:
        other = lines[1] if len(lines) == 2 else np.eye(3)[int(np.abs(lines[0]).argmin())]
        line = np.cross(lines[0], other)
        lines.append(line / np.linalg.norm(line))
    return np.concatenate([lines, np.negative(lines)])


def lateral_clearance(
    clouds: Clouds,
    directions: Float[np.ndarray, "direction 3"],
    *,
    points: int = 160,
    facing: float = 0.3,
    behind: float = 0.01,
    most: float = 9.0,
) -> Float[np.ndarray, "part part direction"]:
    """Return the smallest lateral distance [i, j, d] from front-facing points of i to back-facing ones of j ahead.

    Args:
        clouds: The parts.
        directions: Unit vectors d along which i moves.
        points: Points of each part that are looked at.
        facing: Least cosine between normal and direction for a point to face it.
        behind: Points of j so far behind those of i still count as ahead.
        most: What is returned where there is nothing ahead.
    """
    clouds = clouds[:, :points]
    count = len(clouds)
    out = np.full((count, count, len(directions)), most)
    for d, direction in enumerate(directions):
        u = np.cross(direction, np.eye(3)[int(np.abs(direction).argmin())])
        u /= np.linalg.norm(u)
        across = clouds[..., :3] @ np.stack([u, np.cross(direction, u)]).T
        along, cosine = clouds[..., :3] @ direction, clouds[..., 3:] @ direction
        for i in range(count):
            front = cosine[i] > facing
            if not front.any():
                continue
            for j in range(count):
                back = cosine[j] < -facing
                if i == j or not back.any():
                    continue
                gap2 = ((across[i, front][:, None] - across[j, back][None]) ** 2).sum(axis=2)
                ahead = along[j, back][None] - along[i, front][:, None] > -behind
                if ahead.any():
                    out[i, j, d] = np.sqrt(gap2[ahead].min())
    return out
