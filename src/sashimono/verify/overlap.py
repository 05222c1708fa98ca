"""How deep do two bodies overlap in one pose? A second route: the exact intersection body.

Samples along a path can miss a slim part in a thin sheet; the boolean intersection cannot, in the poses where it is
taken. The overlap that a pair has in the assembled pose is measured here too: it may reach as deep on its way.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.verify.body import Body

_REFINED_POINTS = 3000


@dataclass(frozen=True, kw_only=True)
class Overlap:
    """The intersection of two bodies in one pose."""

    volume: float
    """[m³]; 0 where the bodies do not overlap, or where no boolean could be taken."""
    depth: float
    """Deepest point of one inside the other [m]."""
    exact: bool
    """Whether both meshes allowed a boolean."""


def intersection(moving: Body, fixed: Body, T_fixed_moving: Float[np.ndarray, "4 4"]) -> Overlap:
    """Return the intersection body's volume and how deep its surface lies in either of the two."""
    if moving.solid is None or fixed.solid is None:
        return Overlap(volume=0.0, depth=0.0, exact=False)
    common = moving.solid.transform(np.ascontiguousarray(T_fixed_moving[:3])) ^ fixed.solid
    volume = float(common.volume())
    if common.is_empty() or volume <= 0.0:
        return Overlap(volume=0.0, depth=0.0, exact=True)
    # by length, not so many pieces each: of a peg in solid material, the long faces reach deepest in their middle
    refined = common.refine_to_length(float(np.sqrt(common.surface_area() / _REFINED_POINTS)))
    points = np.ascontiguousarray(np.asarray(refined.to_mesh64().vert_properties)[:, :3])
    # each point lies on one surface and within the other body: the greater distance, whatever its sign, is its depth
    depth_fixed = np.abs(fixed.distance(points))
    depth_moving = np.abs(moving.distance(se3.apply(se3.inverse(T_fixed_moving), points)))
    return Overlap(volume=volume, depth=float(np.maximum(depth_fixed, depth_moving).max()), exact=True)


def sampled_depth(moving: Body, fixed: Body, T_fixed_moving: Float[np.ndarray, "4 4"]) -> float:
    """Return how deep the deepest surface sample of one lies inside the other [m], both ways; 0 if none does."""
    depth = 0.0
    for points, target, T in (
        (moving.tree.leaves, fixed, T_fixed_moving),
        (fixed.tree.leaves, moving, se3.inverse(T_fixed_moving)),
    ):
        seen = se3.apply(T, points)
        seen = seen[target.box_distance(seen) <= 0.0]
        if len(seen):
            depth = max(depth, -float(target.distance(seen).min()))
    return depth


@dataclass(frozen=True, eq=False)
class AssembledOverlaps:
    """Depth at which pairs overlap in the assembled pose, measured when first asked for."""

    bodies: dict[str, Body]
    poses: dict[str, Float[np.ndarray, "4 4"]]
    _known: dict[frozenset[str], float] = field(default_factory=dict)

    def depth(self, moving: str, fixed: str) -> float:
        """Return the pair's depth in the assembled pose [m]."""
        key = frozenset((moving, fixed))
        if key not in self._known:
            T = se3.inverse(self.poses[fixed]) @ self.poses[moving]
            exact = intersection(self.bodies[moving], self.bodies[fixed], T)
            # samples can err on a surface that meets itself, and would then excuse what is no overlap
            sampled = 0.0 if exact.exact else sampled_depth(self.bodies[moving], self.bodies[fixed], T)
            self._known[key] = max(exact.depth, sampled)
        return self._known[key]
