"""Free travel: how far a part goes straight before it is deeper in another one than tolerated.

CAD has screws in bosses without a hole. Such a pair may overlap as deep on its way as assembled, but only until the
two have parted. From there on the overlap excuses nothing: else a screw could leave through a wall no thicker than
the hole that was left out.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.straying import first_astray
from sashimono.geometry import se3
from sashimono.geometry.body import Body, DeepestProbe
from sashimono.geometry.distance.advancement import advance_straight

_MOST_HINTS = 6
"""Probes that are asked first, of each pair."""


def free_travel(
    parts: PlacedParts,
    part: int,
    offset: Float[np.ndarray, "3"],
    direction: Float[np.ndarray, "3"],
    other: int,
    *,
    length: float = np.inf,
    tolerance: float | None = None,
    enough: float = 0.0,
) -> float:
    """Return how far a part goes along a direction before it is too deep in another one [m]; infinite if it passes.

    Too deep is more than the pair overlaps as assembled, plus the tolerance; and, where that overlap is deep, more than
    the tolerance anywhere but near to it (`first_astray`).

    Args:
        parts: The placed parts.
        part: The part that moves.
        offset: Where it starts, from its assembled position [m].
        direction: A unit vector.
        other: The part that stays.
        length: How far it is to go [m]; it passes if it gets so far.
        tolerance: A depth [m]; that of translations if None.
        enough: Of a travel of at most this [m] no more is told than that: what comes back is between the two.
    """
    a, b = parts.bodies[part], parts.bodies[other]
    T_b_a = se3.inverse(parts.poses[other]) @ se3.make(None, offset) @ parts.poses[part]
    step = parts.tolerances.least_step * parts.smaller_size(part, other)
    along_b = parts.poses[other][:3, :3].T @ direction
    length = min(length, _travel_past_box(a, b, T_b_a, along_b))
    if length <= 0.0:
        return np.inf
    bare = parts.bare(part, other) if tolerance is None else tolerance
    limit = parts.limit(part, other, parts.tolerances.translation)
    if tolerance is not None:
        limit = tolerance + float(parts.overlaps[part, other])
    options = {"least_step": step, "enough": enough}
    hints = parts.stoppers.setdefault((part, other), [])
    travel = _advance_both(a, b, T_b_a, along_b, length=length, limit=limit, hints=hints, **options)
    if (np.isfinite(travel) and travel <= enough) or parts.overlaps[part, other] <= bare:
        return travel
    # a deep overlap is no excuse far from it
    length = min(length, travel)
    along = np.concatenate([length * direction, np.zeros(3)])
    astray = first_astray(parts, part, other, se3.make(None, offset), along, enough=enough / length)
    if np.isfinite(astray):
        length = travel = astray * length
        if travel <= enough:
            return travel
    # once the two have parted, the bare tolerance holds
    deepest = None if offset.any() else parts.deepest_assembled(part, other)
    parted = parting_travel(a, b, T_b_a, along_b, length=length, tolerance=bare, least_step=step, deepest=deepest)
    T_b_a = se3.make(None, parted * along_b) @ T_b_a
    options["enough"] = max(enough - parted, 0.0)
    rest = _advance_both(a, b, T_b_a, along_b, length=length - parted, limit=bare, hints=[], **options)
    return min(travel, parted + rest)


def passes(
    parts: PlacedParts,
    part: int,
    offset: Float[np.ndarray, "3"],
    direction: Float[np.ndarray, "3"],
    other: int,
    *,
    length: float = np.inf,
    tolerance: float | None = None,
) -> bool:
    """Return whether a part goes so far along a direction past another one; see `free_travel`, of which it is less."""
    travel = free_travel(parts, part, offset, direction, other, length=length, tolerance=tolerance, enough=np.inf)
    return bool(np.isinf(travel))


def parting_travel(
    moving: Body,
    fixed: Body,
    T_fixed_moving: Float[np.ndarray, "4 4"],
    direction_fixed: Float[np.ndarray, "3"],
    *,
    length: float,
    tolerance: float,
    least_step: float,
    deepest: DeepestProbe | None = None,
) -> float:
    """Return how far the moving body goes before the two are first less than ``tolerance`` deep in each other [m].

    A depth of d cannot vanish within d - tolerance, so that much is skipped at once; and as long as one probe is deep,
    no other is asked.

    Args:
        moving: The body that moves.
        fixed: The body that stays.
        T_fixed_moving: Where the moving body starts.
        direction_fixed: A unit vector in the fixed body's frame.
        length: The most that is returned [m].
        tolerance: Depth [m].
        least_step: Shortest step [m].
        deepest: The deepest probe where it starts, if that is known.
    """
    travel = 0.0
    while travel < length:
        if deepest is None or travel > 0.0:
            deepest = DeepestProbe(moving, fixed, se3.make(None, travel * direction_fixed) @ T_fixed_moving)
        depth = deepest.depth
        if depth <= tolerance:
            return travel
        while depth > tolerance and travel < length:
            travel += max(depth - tolerance, least_step)
            depth = deepest.depth_at(se3.make(None, travel * direction_fixed) @ T_fixed_moving)
    return length


def _travel_past_box(a: Body, b: Body, T_b_a: Float[np.ndarray, "4 4"], along_b: Float[np.ndarray, "3"]) -> float:
    """Return how far a must go along the direction until all of it is past all of b, as seen along it [m]."""
    back = float((se3.apply(T_b_a, a.vertices) @ along_b).min())
    front = float((b.vertices @ along_b).max())
    return front - back


def _advance_both(
    a: Body,
    b: Body,
    T_b_a: Float[np.ndarray, "4 4"],
    along_b: Float[np.ndarray, "3"],
    *,
    length: float,
    limit: float,
    least_step: float,
    enough: float,
    hints: list[tuple[bool, int]],
) -> float:
    """Return how far a goes in b's frame before a probe of either is too deep in the other; infinite if it passes.

    What stops it before ``enough`` is noted in ``hints``, and asked first the next time: it makes a no come faster.
    """
    options = {"limit": limit, "least_step": least_step, "enough": enough}
    T_a_b = se3.inverse(T_b_a)
    sides = {True: (a, b, T_b_a, along_b), False: (b, a, T_a_b, -(T_a_b[:3, :3] @ along_b))}
    for hint in hints if enough > 0.0 else ():
        moving, fixed, T, along = sides[hint[0]]
        points = se3.apply(T, moving.probes[hint[1] : hint[1] + 1])
        travel, _ = advance_straight(fixed.signed_distance, points, along, length=length, **options)
        if np.isfinite(travel) and travel <= enough:
            hints.remove(hint)
            hints.insert(0, hint)
            return travel
    shortest = np.inf
    for side, (moving, fixed, T, along) in sides.items():
        points = se3.apply(T, moving.probes)
        far = min(length, shortest)
        travel, stopper = advance_straight(fixed.signed_distance, points, along, length=far, **options)
        shortest = min(shortest, travel)
        if np.isfinite(shortest) and shortest <= enough:
            if enough > 0.0:
                hints.insert(0, (side, stopper))
                del hints[_MOST_HINTS:]
            break
    return shortest
