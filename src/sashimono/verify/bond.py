"""Is a part that a plan calls a screw, bolt or nut really in what it is said to be screwed into? Is a close fit one?

A plan's word alone joins nothing. Here the two must touch all around the stated axis, over a length, as a thread or a
press fit does; whether there is a thread, or a squeeze, cannot be seen where the CAD draws plain cylinders.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.plan import AssemblyPlan

THREADED = ("screw", "bolt", "nut")
"""Kinds of fasteners that are screwed."""

_WALL = 0.35
_RADIAL = 0.88
_OPEN = np.radians(120.0)
_LENGTH = 0.25


class StatedBond(NamedTuple):
    """What a plan says of two parts that it joins."""

    axis: Sequence[float]
    point: Sequence[float]
    close: bool
    """Whether they fit without clearance; else they are screwed together."""


def stated_bonds(plan: AssemblyPlan) -> dict[frozenset[str], StatedBond]:
    """Return the pairs of parts that a plan says are joined, each with the axis."""
    found: dict[frozenset[str], StatedBond] = {}
    for step in plan.all_steps:
        for fit in step.close_fits:
            found[frozenset((fit.part, fit.other))] = StatedBond(fit.axis, fit.point, close=True)
        if step.fastener is not None and step.fastener.kind in THREADED:
            for other in step.fastener.joins:
                found[frozenset((step.part, other))] = StatedBond(step.fastener.axis, step.fastener.point, close=False)
    return found


def is_around(points: Float[np.ndarray, "point 3"], normals: Float[np.ndarray, "point 3"], bond: StatedBond) -> bool:
    """Return whether touching points with the surface's normals lie around the stated axis like a hole around a shank.

    Only walls along the axis count. They must face it, leave no more than 120 degrees open, and be longer than a
    quarter of the diameter.
    """
    axis, start = np.array(bond.axis), np.array(bond.point)
    size = float(np.linalg.norm(axis))
    if axis.shape != (3,) or start.shape != (3,) or not np.isfinite([*axis, *start]).all() or abs(size - 1.0) > 1e-6:
        return False
    heights = (points - start) @ axis
    spokes = points - start - heights[:, None] * axis
    radii = np.linalg.norm(spokes, axis=1)
    facing = np.abs((normals * spokes).sum(axis=1))
    round_it = (np.abs(normals @ axis) < _WALL) & (radii > 0.0) & (facing > _RADIAL * radii)
    if round_it.sum() < 4:
        return False
    heights, spokes, radii = heights[round_it], spokes[round_it], radii[round_it]
    first = spokes[0] / radii[0]
    around = np.sort(np.arctan2(spokes @ np.cross(axis, first), spokes @ first))
    widest = float(np.max(np.diff(around, append=around[0] + 2.0 * np.pi)))
    return bool(widest <= _OPEN and float(np.ptp(heights)) >= _LENGTH * 2.0 * float(np.median(radii)))


Bonds = Mapping[frozenset[str], StatedBond]
"""Pairs that a plan says are joined."""
