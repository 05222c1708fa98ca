"""Where an overlap as assembled is no excuse: a part may not plough on where no overlap was drawn.

CAD has screws in bosses without a hole, and press fits. A pair that overlaps as assembled may go as deep on its way. If
the overlap is shallow, as of a press fit, it may anywhere: the part is pushed along its whole bore. If it is deep, it
may only near to where it is drawn (`PlacedParts.overlap_places`). The check of a plan has the same rule, by code of its
own.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numba import njit

from sashimono.disassembly.placed_parts import OverlapPlace, PlacedParts
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import Screw, adjoint, advance_along_screw, shared_stops
from sashimono.geometry.distance.signed_distance import nearest


def first_astray(
    parts: PlacedParts,
    part: int,
    other: int,
    D: Float[np.ndarray, "4 4"],
    twist: Float[np.ndarray, "6"],
    *,
    enough: float = 0.0,
) -> float:
    """Return the u in [0, 1] at which a part moved by ``exp(u twist) @ D`` is first astray; infinite if it never is.

    It is astray where a probe of either part is deeper in the other than translations may be, and farther from each
    place of their overlap than that is an excuse. D is from the assembled pose; both are in the world frame. Of a u of
    at most ``enough`` no more is told than that: what comes back is between the two.
    """
    places = parts.overlap_places(part, other)
    if not places:
        return np.inf
    a, b = parts.bodies[part], parts.bodies[other]
    tolerance = parts.tolerances.translation * parts.scale(part, other)
    least = parts.tolerances.least_step * parts.smaller_size(part, other)
    fields, far = parts.once(("astray", part, other), lambda: _far_probes(parts, other, places))
    T_part_world = se3.inverse(D @ parts.poses[part])
    seen, back = se3.apply(T_part_world @ parts.poses[other], far), -adjoint(T_part_world, twist)
    # of points on one helix, as `Paths` has it
    cells = np.full(max(len(far), len(a.probes)), 0.25 * parts.tolerances.turning * parts.scale(part, other))
    stops = shared_stops(seen, back, cells[: len(seen)])
    seen_stops = np.ones(len(seen)) if stops is None else stops
    screw, probes = Screw.of(twist), np.ascontiguousarray(se3.apply(D @ parts.poses[part], a.probes))
    frame = np.array([screw.axis, screw.point, screw.shift])
    limits = (tolerance, least, enough)
    T_other_world = np.ascontiguousarray(se3.inverse(parts.poses[other]))
    stops = shared_stops(probes, twist, cells[: len(probes)])
    stops = np.ones(len(probes)) if stops is None else stops
    field = b.signed_distance.arrays
    # the probe that strayed last is followed first: that changes no answer, and makes it come faster
    hint = parts.strayed.get((part, other), 0)
    about = (frame, screw.angle, T_other_world, limits, stops, field)
    moving, probe = _first_astray(probes, hint, *about, *fields.arrays)
    if probe >= 0:
        parts.strayed[part, other] = int(probe)
        if moving <= enough:
            return float(moving)
    seen_stops = np.minimum(seen_stops, moving)
    options = {"limit": tolerance, "least_step": least, "stops": seen_stops}
    return min(advance_along_screw(a.signed_distance, seen, back, **options)[0], float(moving))


def _far_probes(
    parts: PlacedParts, other: int, places: tuple[OverlapPlace, ...]
) -> tuple[_Joined, Float[np.ndarray, "far 3"]]:
    """The places of an overlap, and the probes of the part that stays that are far from them, once and for all."""
    fields, probes = _Joined(places), parts.bodies[other].probes
    return fields, probes[fields.room(se3.apply(parts.poses[other], probes)) < 0.0]


class _Joined:
    """The fields of several places, one after another, for compiled code."""

    def __init__(self, places: tuple[OverlapPlace, ...]) -> None:
        each = [place.field.arrays for place in places]
        counts = np.array([[len(boxes), len(triangles)] for boxes, _, triangles, _ in each])
        starts = np.concatenate([np.zeros((1, 2), np.int64), np.cumsum(counts, axis=0)])
        joined = tuple(np.concatenate(arrays) for arrays in zip(*each, strict=True))
        self.arrays = (joined, starts, np.array([place.reach for place in places]))

    def room(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """How much farther from the overlap each point could be and still be excused [m]."""
        return _rooms(np.ascontiguousarray(points), *self.arrays)


@njit(cache=True, nogil=True)
def _room(x, y, z, joined, starts, reaches):  # pragma: no cover - compiled
    boxes, links, triangles, normals = joined
    room = -np.inf
    for k in range(len(reaches)):
        n, m, t, u = starts[k, 0], starts[k + 1, 0], starts[k, 1], starts[k + 1, 1]
        distance = nearest(x, y, z, np.inf, boxes[n:m], links[n:m], triangles[t:u], normals[t:u])[0]
        room = max(room, reaches[k] - abs(distance))
    return room


@njit(cache=True, nogil=True)
def _rooms(points, joined, starts, reaches):  # pragma: no cover - compiled
    out = np.empty(len(points))
    for k in range(len(points)):
        out[k] = _room(points[k, 0], points[k, 1], points[k, 2], joined, starts, reaches)
    return out


@njit(cache=True, nogil=True)
def _first_astray(
    points, hint, frame, angle, T, limits, stops, field, joined, starts, reaches
):  # pragma: no cover - compiled
    """The u up to 1 at which a moving point is first astray, and which; infinite, and -1, if none is.

    Points are followed from the hint on, until one is astray at no more than ``enough``. A point that has still to go
    to the box, to the tolerance, or out of where the overlap is an excuse, is not astray before it has gone so far.
    """
    boxes, links, triangles, normals = field
    tolerance, least, enough = limits
    axis, center, shift = frame[0], frame[1], frame[2]
    out, found = np.inf, -1
    for n in range(len(points)):
        k = (hint + n) % len(points)
        x, y, z = points[k, 0] - center[0], points[k, 1] - center[1], points[k, 2] - center[2]
        ox, oy, oz = axis[1] * z - axis[2] * y, axis[2] * x - axis[0] * z, axis[0] * y - axis[1] * x
        tx, ty, tz = axis[1] * oz - axis[2] * oy, axis[2] * ox - axis[0] * oz, axis[0] * oy - axis[1] * ox
        squared = shift[0] ** 2 + shift[1] ** 2 + shift[2] ** 2
        speed = np.sqrt(angle * angle * (ox * ox + oy * oy + oz * oz) + squared)
        if speed == 0.0:
            continue
        u = 0.0
        while u < min(1.0, out, stops[k]):
            s, c = np.sin(u * angle), 2.0 * np.sin(0.5 * u * angle) ** 2
            px = points[k, 0] + s * ox + c * tx + u * shift[0]
            py = points[k, 1] + s * oy + c * ty + u * shift[1]
            pz = points[k, 2] + s * oz + c * tz + u * shift[2]
            qx = T[0, 0] * px + T[0, 1] * py + T[0, 2] * pz + T[0, 3]
            qy = T[1, 0] * px + T[1, 1] * py + T[1, 2] * pz + T[1, 3]
            qz = T[2, 0] * px + T[2, 1] * py + T[2, 2] * pz + T[2, 3]
            left = max(boxes[0, 0] - qx, qx - boxes[0, 3], boxes[0, 1] - qy, qy - boxes[0, 4])
            left = max(left, boxes[0, 2] - qz, qz - boxes[0, 5]) + tolerance
            if left < tolerance:
                left = nearest(qx, qy, qz, np.inf, boxes, links, triangles, normals)[0] + tolerance
                if left < least:
                    left = max(left, _room(px, py, pz, joined, starts, reaches))
                if left < 0.0:
                    out, found = u, k
                    break
            u += max(left, least) / speed
        if found >= 0 and out <= enough:
            break
    return out, found
