"""Screw motions: the geodesics of SE(3) as turn, axis and pitch, and how far points follow one past a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numba import njit

from sashimono.geometry import se3
from sashimono.geometry.distance.signed_distance import SignedDistance, closest_on_triangle, nearest

_NO_TURN = 1e-9


@dataclass(frozen=True, kw_only=True, eq=False)
class Screw:
    """A turn about an axis with a shift along it; without a turn, any shift. Lynch & Park, section 3.3.2."""

    axis: Float[np.ndarray, "3"]
    """Unit direction of the axis; arbitrary without a turn."""
    point: Float[np.ndarray, "3"]
    """A point on the axis [m]."""
    angle: float
    """Turn [rad], not negative."""
    shift: Float[np.ndarray, "3"]
    """Translation [m]; parallel to the axis where there is a turn."""

    @classmethod
    def of(cls, twist: Float[np.ndarray, "6"]) -> Screw:
        """Return the screw motion ``exp(u twist)``, u from 0 to 1, in the frame of the twist."""
        v, w = twist[:3], twist[3:]
        angle = float(np.linalg.norm(w))
        if angle < _NO_TURN:
            return cls(axis=np.array([0.0, 0.0, 1.0]), point=np.zeros(3), angle=0.0, shift=v.copy())
        axis = w / angle
        return cls(axis=axis, point=se3.cross(axis, v) / angle, angle=angle, shift=float(axis @ v) * axis)

    @property
    def pitch(self) -> float:
        """Shift along the axis per turn [m/rad]; infinite for a translation."""
        return float(self.shift @ self.axis) / self.angle if self.angle > 0.0 else np.inf


def adjoint(T: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6"]:
    """Return the same spatial twist seen from another frame: ``T exp(twist) T⁻¹ = exp(adjoint(T, twist))``."""
    w = T[:3, :3] @ twist[3:]
    return np.concatenate([T[:3, :3] @ twist[:3] + se3.cross(T[:3, 3], w), w])


def between(T_a: Float[np.ndarray, "4 4"], T_b: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "6"]:
    """Return the spatial twist of the geodesic from a to b: ``exp(u twist) @ T_a`` is the pose at u."""
    return se3.log(T_b @ se3.inverse(T_a))


def advance_along_screw(
    field: SignedDistance,
    points: Float[np.ndarray, "n 3"],
    twist: Float[np.ndarray, "6"],
    *,
    limit: float,
    least_step: float,
    stops: Float[np.ndarray, "n"] | None = None,
) -> tuple[float, int]:
    """Return the u in [0, 1] at which a point moved by ``exp(u twist)`` is first deeper than ``limit``, and the work.

    u is infinite if no point gets too deep; the work is counted in steps of points near the mesh.

    Sphere tracing along each point's helix, everything in the mesh frame: a point that is d outside cannot be
    deeper than the limit before it has gone d + limit, so only dips shorter than ``least_step`` [m] are jumped. While
    the triangle that was closest stays within the limit, the point is no deeper, and no other is looked at.

    Args:
        field: Of the mesh.
        points: What moves, in the mesh frame [m].
        twist: Spatial, in the mesh frame.
        limit: Allowed depth [m].
        least_step: Shortest step [m].
        stops: Up to which u each point is followed; all the way if None. See `shared_stops`.
    """
    screw = Screw.of(twist)
    points = np.ascontiguousarray(points, dtype=np.float64)
    frame = np.array([screw.axis, screw.point, screw.shift])
    stops = np.ones(len(points)) if stops is None else stops
    travel, steps = _advance_along_screw(points, frame, screw.angle, limit, least_step, stops, *field.arrays)
    return float(travel), int(steps)


def shared_stops(
    points: Float[np.ndarray, "n 3"], twist: Float[np.ndarray, "6"], cells: Float[np.ndarray, "n"]
) -> Float[np.ndarray, "n"] | None:
    """Return up to which u each point has to be followed along a screw, as another comes after it; None: all the way.

    A turn of a thread brings each of its points to where another one was. Of the points on one helix, by radius and by
    height in the thread, each is followed to where the next one begins, the last one to the end.

    Args:
        points: What moves [m].
        twist: Spatial; with a turn of less than half a circle, or without a shift, nothing is shared.
        cells: By point: helices of equal cells that are nearer than this [m] are one.
    """
    screw = Screw.of(twist)
    if screw.angle < np.pi or not len(points):
        return None
    lead = 2.0 * np.pi * abs(screw.pitch)
    if lead < 4.0 * float(cells.max()):
        return None
    first = se3.cross(screw.axis, np.eye(3)[int(np.argmin(np.abs(screw.axis)))])
    first /= np.linalg.norm(first)
    arms = points - screw.point
    x, y, z = arms @ first, arms @ se3.cross(screw.axis, first), arms @ screw.axis
    turned = np.arctan2(y, x)
    height = np.mod(z - screw.pitch * turned, lead)
    at = (z - height) / screw.pitch
    rows = np.floor(np.hypot(x, y) / cells).astype(np.int64)
    columns = np.floor(height / cells).astype(np.int64)
    order = np.lexsort((at, columns, rows, cells))
    same = (cells[order][1:] == cells[order][:-1]) & (rows[order][1:] == rows[order][:-1])
    same &= columns[order][1:] == columns[order][:-1]
    stops = np.ones(len(points))
    stops[order[:-1]] = np.where(same, np.minimum(np.diff(at[order]) / screw.angle, 1.0), 1.0)
    return stops


@njit(cache=True, nogil=True)
def _advance_along_screw(points, frame, angle, limit, least_step, stops, boxes, links, triangles, normals):
    # pragma: no cover - compiled
    axis, center, shift = frame[0], frame[1], frame[2]
    travel = np.inf
    steps = 0
    shift2 = shift[0] ** 2 + shift[1] ** 2 + shift[2] ** 2
    for k in range(points.shape[0]):
        x, y, z = points[k, 0] - center[0], points[k, 1] - center[1], points[k, 2] - center[2]
        # displacement = sin(a) once + (1 - cos(a)) twice + u shift (Rodrigues)
        ox, oy, oz = axis[1] * z - axis[2] * y, axis[2] * x - axis[0] * z, axis[0] * y - axis[1] * x
        tx, ty, tz = axis[1] * oz - axis[2] * oy, axis[2] * ox - axis[0] * oz, axis[0] * oy - axis[1] * ox
        speed = np.sqrt(angle * angle * (ox * ox + oy * oy + oz * oz) + shift2)
        if speed == 0.0:
            continue
        u = 0.0
        closest = -1
        while u <= min(stops[k], travel):
            s = np.sin(u * angle)
            c = 2.0 * np.sin(0.5 * u * angle) ** 2
            px = points[k, 0] + s * ox + c * tx + u * shift[0]
            py = points[k, 1] + s * oy + c * ty + u * shift[1]
            pz = points[k, 2] + s * oz + c * tz + u * shift[2]
            dx = max(boxes[0, 0] - px, 0.0, px - boxes[0, 3])
            dy = max(boxes[0, 1] - py, 0.0, py - boxes[0, 4])
            dz = max(boxes[0, 2] - pz, 0.0, pz - boxes[0, 5])
            outside = np.sqrt(dx * dx + dy * dy + dz * dz)
            if outside > least_step:
                u += (outside + limit) / speed
                continue
            steps += 1
            bound = np.inf
            if closest >= 0:
                qx, qy, qz, _ = closest_on_triangle(px, py, pz, triangles[closest])
                bound = np.sqrt((px - qx) ** 2 + (py - qy) ** 2 + (pz - qz) ** 2)
                if bound <= limit:
                    u += max(limit - bound, least_step) / speed
                    continue
                bound += 1e-6 * bound  # so that it is found again, with its sign, if none is closer
            distance, closest, _ = nearest(px, py, pz, bound, boxes, links, triangles, normals)
            if -distance > limit:
                travel = min(travel, u)
                break
            u += max(limit + distance, least_step) / speed
    return travel, steps
