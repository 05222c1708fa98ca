"""The contact surface of a part among fixed ones: gaps, how motions change them, the nearest motion that keeps them.

A small motion about the part's centre is (v, R ω) [m] with R the part's radius, so that its length bounds the way of
the part's points alike in turning and in shifting. A contact with unit normal n, pointing into the part, at r from its
centre changes its gap by ``n · v + (r × n) · ω``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.tilting.probes import contact_probes
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import adjoint, advance_along_screw, between
from sashimono.geometry.distance.signed_distance import bound_by, gradient, nearest

_COARSER = 6.0
"""Least step of the look along a stretch, over that of the exact check."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Gaps:
    """What is near the part at one pose."""

    rows: Float[np.ndarray, "contact 6"]
    """How much a motion (v, R ω) opens each gap."""
    gaps: Float[np.ndarray, "contact"]
    """Gap [m], negative where the two are deeper in one another than allowed for."""


class ContactSurface:
    """What keeps one part from moving past some others, felt at probes of both sides.

    Every answer is a pure function of its arguments; what they took is counted in ``paths.traced``.
    """

    def __init__(self, paths: Paths, *, most_probes: int, leeway: float) -> None:
        """Take in the parts, the most probes of one, and the share of the tolerated depth that sliding may use."""
        self.paths, self.leeway = paths, leeway
        parts = paths.parts
        self.own = contact_probes(paths.body, most=most_probes)
        self.theirs = {k: contact_probes(parts.bodies[k], most=most_probes) for k in paths.others}
        self._closest = {k: (np.full(len(self.own), -1), np.full(len(theirs), -1)) for k, theirs in self.theirs.items()}
        """By other part: of its own probes and of the other's, the faces that were closest last, looked at first."""
        self._inverse = {k: se3.inverse(parts.poses[k]) for k in paths.others}

    def gaps(self, D: Float[np.ndarray, "4 4"], *, margin: float) -> Gaps:
        """Return the gaps smaller than the margin [m] with the part displaced by D."""
        paths, parts = self.paths, self.paths.parts
        T = D @ paths.T_assembled
        center = se3.apply(D, paths.center[None])[0]
        radius = paths.body.radius
        near = paths.near(D, margin=margin)
        most = sum(len(self.own) + len(self.theirs[other]) for other in near)
        rows, gaps, count = np.empty((most, 6)), np.empty(most), 0
        for other in near:
            body = parts.bodies[other]
            allowed = parts.limit(paths.part, other, self.leeway * paths.tolerance)
            T_other_part = self._inverse[other] @ T
            closest = self._closest[other]
            for points, T_field_points, T_world_field, field, sign, last in (
                (self.own, T_other_part, parts.poses[other], body.signed_distance, 1.0, closest[0]),
                (self.theirs[other], se3.inverse(T_other_part), T, paths.body.signed_distance, -1.0, closest[1]),
            ):
                about = (T_field_points, T_world_field, sign, center, radius, margin, allowed)
                count = _contacts(points, *about, last, rows, gaps, count, *field.arrays)
                paths.traced += len(points)
        return Gaps(rows=rows[:count], gaps=gaps[:count])

    def is_clear(self, D_a: Float[np.ndarray, "4 4"], D_b: Float[np.ndarray, "4 4"]) -> bool:
        """Return whether the probes pass along the geodesic from one displacement to another.

        They are fewer than the exact check follows (`Paths.check`), which has the last word on a path.
        """
        paths, parts = self.paths, self.paths.parts
        twist = between(D_a, D_b)
        T = D_a @ paths.T_assembled
        for other in paths.near(D_a, twist=twist):
            limit = parts.limit(paths.part, other, paths.tolerance)
            least = _COARSER * parts.tolerances.least_step * parts.smaller_size(paths.part, other)
            T_other_part = self._inverse[other] @ T
            along = adjoint(self._inverse[other], twist)
            points = se3.apply(T_other_part, self.own)
            field = parts.bodies[other].signed_distance
            u, steps = advance_along_screw(field, points, along, limit=limit, least_step=least)
            paths.traced += len(points) + steps
            if np.isfinite(u):
                return False
            # seen from the part, the other moves the opposite way
            T_part_other = se3.inverse(T_other_part)
            points = se3.apply(T_part_other, self.theirs[other])
            field, back = paths.body.signed_distance, -adjoint(T_part_other, along)
            u, steps = advance_along_screw(field, points, back, limit=limit, least_step=least)
            paths.traced += len(points) + steps
            if np.isfinite(u):
                return False
        return True

    def moved(self, D: Float[np.ndarray, "4 4"], motion: Float[np.ndarray, "6"]) -> Float[np.ndarray, "4 4"]:
        """Return the displacement after a motion (v, R ω) about the part's centre from D, followed as a screw."""
        w = motion[3:] / self.paths.body.radius
        center = se3.apply(D, self.paths.center[None])[0]
        return se3.exp(np.concatenate([motion[:3] - se3.hat(w) @ center, w])) @ D

    def motion_to(self, D: Float[np.ndarray, "4 4"], target: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "6"]:
        """Return the motion (v, R ω) about the part's centre that leads from D to the target as a screw."""
        twist = between(D, target)
        center = se3.apply(D, self.paths.center[None])[0]
        return np.concatenate([twist[:3] + se3.hat(twist[3:]) @ center, self.paths.body.radius * twist[3:]])


def admissible(gaps: Gaps, wanted: Float[np.ndarray, "6"], *, rounds: int) -> Float[np.ndarray, "6"]:
    """Return the motion nearest to the wanted one that closes no gap, to first order: a projection on a polyhedron.

    Gaps that are negative are opened. By coordinate ascent on the dual (Hildreth, "A quadratic programming procedure",
    1957), a bounded number of rounds.
    """
    if not len(gaps.rows):
        return wanted.copy()
    return _projected(gaps.rows, gaps.gaps, wanted, rounds)


@njit(cache=True, nogil=True)
def _contacts(
    points, T, T_world, sign, center, radius, margin, allowed, last, rows, gaps, count,
    boxes, links, triangles, normals,
):  # fmt: skip
    # pragma: no cover - compiled
    """Add a row and a gap for each point nearer than the margin, from ``count`` on; return how many there are then.

    ``last`` has for each point the face that was closest the last time: looked at first, it makes the search shorter.
    """
    bound = margin + allowed
    for k in range(points.shape[0]):
        x = T[0, 0] * points[k, 0] + T[0, 1] * points[k, 1] + T[0, 2] * points[k, 2] + T[0, 3]
        y = T[1, 0] * points[k, 0] + T[1, 1] * points[k, 1] + T[1, 2] * points[k, 2] + T[1, 3]
        z = T[2, 0] * points[k, 0] + T[2, 1] * points[k, 1] + T[2, 2] * points[k, 2] + T[2, 3]
        if (
            x < boxes[0, 0] - bound or y < boxes[0, 1] - bound or z < boxes[0, 2] - bound
            or x > boxes[0, 3] + bound or y > boxes[0, 4] + bound or z > boxes[0, 5] + bound
        ):  # fmt: skip
            continue
        within = bound
        if last[k] >= 0:
            within = min(bound, bound_by(x, y, z, triangles[last[k]]))
        d, m, kind = nearest(x, y, z, within, boxes, links, triangles, normals)
        if m < 0:
            continue
        last[k] = m
        nx, ny, nz = gradient(x, y, z, d, m, kind, bound, triangles, normals)
        for i in range(3):
            rows[count, i] = sign * (T_world[i, 0] * nx + T_world[i, 1] * ny + T_world[i, 2] * nz)
        ax = T_world[0, 0] * x + T_world[0, 1] * y + T_world[0, 2] * z + T_world[0, 3] - center[0]
        ay = T_world[1, 0] * x + T_world[1, 1] * y + T_world[1, 2] * z + T_world[1, 3] - center[1]
        az = T_world[2, 0] * x + T_world[2, 1] * y + T_world[2, 2] * z + T_world[2, 3] - center[2]
        nx, ny, nz = rows[count, 0], rows[count, 1], rows[count, 2]
        rows[count, 3] = (ay * nz - az * ny) / radius
        rows[count, 4] = (az * nx - ax * nz) / radius
        rows[count, 5] = (ax * ny - ay * nx) / radius
        gaps[count] = d + allowed
        count += 1
    return count


@njit(cache=True, nogil=True)
def _projected(rows, gaps, wanted, rounds):  # pragma: no cover - compiled
    motion = wanted.copy()
    n = rows.shape[0]
    weights = np.zeros(n)
    norms = np.empty(n)
    for k in range(n):
        norms[k] = 0.0
        for i in range(6):
            norms[k] += rows[k, i] * rows[k, i]
    for _ in range(rounds):
        change = 0.0
        for k in range(n):
            value = gaps[k]
            for i in range(6):
                value += rows[k, i] * motion[i]
            step = max(-weights[k], -value / norms[k])
            if step != 0.0:
                weights[k] += step
                change = max(change, abs(step))
                for i in range(6):
                    motion[i] += step * rows[k, i]
        if change < 1e-9:
            break
    return motion
