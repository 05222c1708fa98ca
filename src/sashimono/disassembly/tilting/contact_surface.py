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
from sashimono.geometry.distance.signed_distance import nearest_normal

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
        self._inverse = {k: se3.inverse(parts.poses[k]) for k in paths.others}

    def gaps(self, D: Float[np.ndarray, "4 4"], *, margin: float) -> Gaps:
        """Return the gaps smaller than the margin [m] with the part displaced by D."""
        paths, parts = self.paths, self.paths.parts
        T = D @ paths.T_assembled
        center = se3.apply(D, paths.center[None])[0]
        radius = paths.body.radius
        rows, gaps = [np.zeros((0, 6))], [np.zeros(0)]
        for other in paths.near(D, margin=margin):
            body = parts.bodies[other]
            allowed = parts.limit(paths.part, other, self.leeway * paths.tolerance)
            T_other_part = self._inverse[other] @ T
            for points, T_field_points, T_world_field, field, sign in (
                (self.own, T_other_part, parts.poses[other], body.signed_distance, 1.0),
                (self.theirs[other], se3.inverse(T_other_part), T, paths.body.signed_distance, -1.0),
            ):
                found = np.empty((len(points), 7))
                count = _near(points, T_field_points, margin + allowed, *field.arrays, found)
                paths.traced += len(points)
                if count:
                    found = found[:count]
                    normals = sign * (found[:, 1:4] @ T_world_field[:3, :3].T)
                    arms = se3.apply(T_world_field, found[:, 4:7]) - center
                    rows.append(np.concatenate([normals, np.cross(arms, normals) / radius], axis=1))
                    gaps.append(found[:, 0] + allowed)
        return Gaps(rows=np.concatenate(rows), gaps=np.concatenate(gaps))

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
def _near(points, T, margin, boxes, links, triangles, normals, out):  # pragma: no cover - compiled
    """Signed distance, its gradient and the place of the points nearer than the margin, in the field's frame."""
    count = 0
    for k in range(points.shape[0]):
        x = T[0, 0] * points[k, 0] + T[0, 1] * points[k, 1] + T[0, 2] * points[k, 2] + T[0, 3]
        y = T[1, 0] * points[k, 0] + T[1, 1] * points[k, 1] + T[1, 2] * points[k, 2] + T[1, 3]
        z = T[2, 0] * points[k, 0] + T[2, 1] * points[k, 1] + T[2, 2] * points[k, 2] + T[2, 3]
        if (
            x < boxes[0, 0] - margin or y < boxes[0, 1] - margin or z < boxes[0, 2] - margin
            or x > boxes[0, 3] + margin or y > boxes[0, 4] + margin or z > boxes[0, 5] + margin
        ):  # fmt: skip
            continue
        d, nx, ny, nz = nearest_normal(x, y, z, margin, boxes, links, triangles, normals)
        if np.isfinite(d):
            out[count, 0] = d
            out[count, 1], out[count, 2], out[count, 3] = nx, ny, nz
            out[count, 4], out[count, 5], out[count, 6] = x, y, z
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
