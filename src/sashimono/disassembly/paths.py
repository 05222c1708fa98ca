"""The exact check of a path: how far a part follows a geodesic before it is deeper in another than tolerated."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.blocking import Blocking
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.geometry.screw import adjoint, between, march_screw

_STRIDES = (16, 1)
"""Some probes are followed first, as most legs that are blocked are blocked for these; all have the last word."""
_REFINE = 1.0 / 16.0
"""Where a leg stops is found to this share of the least step."""


class Paths:
    """Paths of one part past some others, as displacements from the assembled pose in the world frame.

    Every answer is a pure function of its arguments. The probes of both parts are followed with the least step of
    the blocking relation.
    """

    def __init__(self, blocking: Blocking, part: int, others: Sequence[int], *, tolerance: float) -> None:
        """Take in the parts, and the depth allowed beyond the assembled overlap, over the smaller part's extent."""
        self.tolerance = tolerance
        self.blocking = blocking
        self.part = part
        self.others = tuple(others)
        self.body = blocking.bodies[part]
        self.T_assembled = blocking.poses[part]
        self.size = float(blocking.sizes[part])
        self.center = se3.apply(self.T_assembled, self.body.center[None])[0]
        """Centre of the part in the assembled pose [m], world frame."""
        boxes = [blocking.assembly.parts[k].bounds_world for k in self.others]
        self._low = np.array([box[0] for box in boxes]).reshape(-1, 3)
        self._high = np.array([box[1] for box in boxes]).reshape(-1, 3)

    def advance(self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"]) -> tuple[float, int | None]:
        """Return how far the part gets from D along ``exp(u twist) @ D``, and the part that stops it.

        The twist is spatial, in the world frame. u is 1 and the part None if nothing stops it.
        """
        scale, stopper = 1.0, None
        near = self.near(D, self.rate(D, twist))
        for stride in _STRIDES:
            for other in near:
                u = self._past(D, scale * twist, other, stride, self.blocking.config.least_step)
                if np.isfinite(u):
                    scale, stopper = scale * u, other
                if scale == 0.0:
                    return 0.0, stopper
        return scale, stopper

    def halt(self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"]) -> tuple[float, int | None]:
        """Return as `advance` does, but kept back so that the part just touches what stops it."""
        u, stopper = self.advance(D, twist)
        if stopper is None:
            return u, None
        rate = self.rate(D, twist)
        config = self.blocking.config
        size = min(self.size, float(self.blocking.sizes[stopper]))
        start = max(0.0, u - config.least_step * size / rate)
        D_start = se3.exp(start * twist) @ D
        fine = config.least_step * _REFINE
        first = min(
            (self._past(D_start, (u - start) * twist, other, 1, fine) for other in self.near(D, rate)), default=1.0
        )
        stop = start + (u - start) * min(first, 1.0)
        allowed = self.tolerance * size + float(self.blocking.allowances[self.part, stopper])
        return max(0.0, stop - (fine * size + allowed) / rate), stopper

    def check(self, displacements: Float[np.ndarray, "waypoint 4 4"]) -> bool:
        """Return whether the part can follow the geodesics through all displacements."""
        return all(self.advance(a, between(a, b))[1] is None for a, b in pairwise(displacements))

    def way_out(self, D: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"]) -> float:
        """Return how far the part must go from D along a unit direction to be past the others' boxes [m]."""
        back = self.body.lowest(D @ self.T_assembled, direction)
        fronts = [float(self.blocking.world_bounds_along(k, direction)[1]) for k in self.others]
        return max(max(fronts, default=back) - back, 0.0) + 0.05 * self.size

    def exit(self, D: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"] | None:
        """Return where the part is past the others after a straight exit from D; None if something stops it."""
        length = self.way_out(D, direction)
        twist = np.concatenate([length * direction, np.zeros(3)])
        if self.advance(D, twist)[1] is not None:
            return None
        return se3.make(None, length * direction) @ D

    def distance(self, D_a: Float[np.ndarray, "4 4"], D_b: Float[np.ndarray, "4 4"]) -> float:
        """Return how far apart two displacements are [m], rotation weighed by the part's radius."""
        return self.rate(D_a, between(D_a, D_b))

    def rate(self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"]) -> float:
        """Return an upper bound of the way of any point [m] along the twist, u from 0 to 1."""
        center = se3.apply(D, self.center[None])[0]
        v, w = twist[:3], twist[3:]
        return float(np.linalg.norm(v + np.cross(w, center)) + np.linalg.norm(w) * self.body.radius)

    def near(self, D: Float[np.ndarray, "4 4"], way: float = 0.0) -> list[int]:
        """Return the others whose boxes the part may come to within this way from D [m]."""
        center = se3.apply(D, self.center[None])[0]
        gap = np.linalg.norm(np.maximum(0.0, np.maximum(self._low - center, center - self._high)), axis=1)
        reach = 1.1 * self.body.radius + way
        return [other for other, distance in zip(self.others, gap, strict=True) if distance <= reach]

    def _past(
        self, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"], other: int, stride: int, least: float
    ) -> float:
        """The u at which the part is first too deep in one other; infinite if it passes."""
        table = self.blocking
        b = table.bodies[other]
        size = min(self.size, float(table.sizes[other]))
        options = {
            "limit": float(table.allowances[self.part, other]) + self.tolerance * size,
            "least_step": least * size,
        }
        T_b_world = se3.inverse(table.poses[other])
        T_b_a = T_b_world @ D @ self.T_assembled
        T_a_b = se3.inverse(T_b_a)
        along_b = adjoint(T_b_world, twist)
        probes = se3.apply(T_b_a, self.body.probes[::stride])
        first = march_screw(b.signed_distance, probes, along_b, **options)
        if first == 0.0:
            return 0.0
        scale = first if np.isfinite(first) else 1.0
        # seen from the part, the other moves the opposite way
        probes = se3.apply(T_a_b, b.probes[::stride])
        second = march_screw(self.body.signed_distance, probes, -scale * adjoint(T_a_b, along_b), **options)
        return scale * second if np.isfinite(second) else first


def hit_by_path(blocking: Blocking, part: int, removal: Removal, among: Sequence[int], *, tolerance: float) -> int:
    """Return the mask of the parts that a removal by any motion runs into; tolerance as for `Paths`."""
    mask = 0
    for other in among:
        paths = Paths(blocking, part, [other], tolerance=tolerance)
        displacements = removal.displacements
        if not paths.check(displacements) or paths.exit(displacements[-1], removal.exit_direction) is None:
            mask |= 1 << other
    return mask
