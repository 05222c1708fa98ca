"""Antipodal grasps: two contacts whose connecting line lies in both friction cones.

For point contacts with friction that is force closure in the plane, and with soft fingers in space
(Nguyen, "Constructing force-closure grasps", 1988).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from sashimono.contact.config import ContactConfig
from sashimono.contact.samples import SurfaceSamples, cast
from sashimono.geometry.body import Body


@dataclass(frozen=True, kw_only=True, eq=False)
class GraspPairs:
    """Antipodal pairs of contacts in the part frame."""

    points: Float[np.ndarray, "grasp 2 3"]
    """Contact points [m]."""
    normals: Float[np.ndarray, "grasp 2 3"]
    """Unit inward normals of the surface there."""
    found: int
    """Antipodal pairs before thinning, whatever their span."""
    narrowest: float
    """Smallest span of all those [m]; inf if there are none."""

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def lines(self) -> Float[np.ndarray, "grasp 3"]:
        """Unit vectors from the first contact to the second."""
        lines = self.points[:, 1] - self.points[:, 0]
        return lines / np.linalg.norm(lines, axis=1, keepdims=True)


def antipodal_pairs(
    samples: SurfaceSamples,
    body: Body,
    *,
    max_opening: float,
    center: Float[np.ndarray, "3"],
    radius: float,
    config: ContactConfig,
) -> GraspPairs:
    """Return the antipodal pairs that a jaw of this opening can span, thinned so that they are distinct.

    Tried are all pairs of samples, and for each sample the points of the surface straight behind it: the nearest
    one (a wall's other side) and the farthest (the outside of a hollow part).
    """
    tangent = config.tangential_friction
    first, second, n_first, n_second = (
        np.concatenate(arrays)
        for arrays in zip(_among_samples(samples, tangent), _behind_samples(samples, body, radius), strict=True)
    )
    lines = second - first
    spans = np.linalg.norm(lines, axis=1)
    real = spans > 1e-6 * radius
    lines = np.divide(lines, spans[:, None], out=np.zeros_like(lines), where=real[:, None])
    limit = 1.0 / np.hypot(1.0, tangent)
    slack = np.minimum((lines * n_first).sum(axis=1), -(lines * n_second).sum(axis=1))
    antipodal = real & (slack >= limit - 1e-12)
    fits = np.flatnonzero(antipodal & (spans <= max_opening))
    # the best stand for their neighbours: the line near the centre of mass and well inside the cones
    offset = np.linalg.norm(np.cross(lines[fits], first[fits] - center), axis=1) / radius
    worst = np.arccos(np.clip(slack[fits], -1.0, 1.0)) / np.arctan(tangent)
    fits = fits[np.argsort(np.round(offset + 0.25 * worst, 9), kind="stable")]
    kept = fits[_distinct(first[fits], second[fits], config.spread * radius)]
    return GraspPairs(
        points=np.stack([first[kept], second[kept]], axis=1),
        normals=np.stack([n_first[kept], n_second[kept]], axis=1),
        found=int(antipodal.sum()),
        narrowest=float(spans[antipodal].min(initial=np.inf)),
    )


def _among_samples(samples: SurfaceSamples, tangent: float) -> tuple[np.ndarray, ...]:
    """Pairs of samples that face each other along their line, each pair once."""
    points, normals = samples
    # n_i · (p_j - p_i), without building all differences
    ahead = normals @ points.T - (normals * points).sum(axis=1)[:, None]
    squares = (points**2).sum(axis=1)
    spans2 = np.maximum(squares[:, None] + squares[None, :] - 2.0 * points @ points.T, 0.0)
    limit = 0.999 / np.hypot(1.0, tangent)  # the exact test follows
    inside = (ahead > 0.0) & (ahead**2 >= limit**2 * spans2)
    i, j = np.nonzero(np.triu(inside & inside.T, k=1))
    return points[i], points[j], normals[i], normals[j]


def _behind_samples(samples: SurfaceSamples, body: Body, radius: float) -> tuple[np.ndarray, ...]:
    """Each sample with the nearest and the farthest point of the surface straight behind it."""
    points, normals = samples
    near, near_normals = cast(body, points, normals, side="leaving")
    start = points + 4.0 * radius * normals
    far, far_normals = cast(body, start, -normals, side="entering")
    hit, back = np.isfinite(near), np.isfinite(far)
    return (
        np.concatenate([points[hit], points[back]]),
        np.concatenate([points[hit] + near[hit, None] * normals[hit], start[back] - far[back, None] * normals[back]]),
        np.concatenate([normals[hit], normals[back]]),
        np.concatenate([-near_normals[hit], -far_normals[back]]),
    )


def _distinct(first: Float[np.ndarray, "pair 3"], second: Float[np.ndarray, "pair 3"], distance: float) -> list[int]:
    """Indices of pairs, earlier ones preferred, of which no two have both contacts nearer than the distance."""
    ends = np.concatenate([first, second], axis=1)
    swapped = np.concatenate([second, first], axis=1)
    left = np.arange(len(ends))
    kept = []
    while len(left):
        head = left[0]
        kept.append(int(head))
        near = np.zeros(len(left), dtype=bool)
        for candidates in (ends[left], swapped[left]):
            gap2 = (candidates - ends[head]) ** 2
            near |= np.maximum(gap2[:, :3].sum(axis=1), gap2[:, 3:].sum(axis=1)) < distance**2
        near[0] = True
        left = left[~near]
    return kept
