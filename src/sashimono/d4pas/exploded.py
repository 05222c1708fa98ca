"""An exploded view of an order: each part drawn back along its insertion until it is clear of those before it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly


def explosion(
    assembly: Assembly, order: Sequence[int], ways_out: Mapping[int, Float[np.ndarray, "3"]], *, share: float = 1.0
) -> Float[np.ndarray, "part 3"]:
    """Return how far each part is displaced [m].

    Args:
        assembly: The parts.
        order: Assembly order, base first.
        ways_out: By part, the direction in which it leaves; parts without one go away from the middle.
        share: Of the way that clears all parts before it.
    """
    low, high = assembly.bounds_world
    gap = 0.02 * float(np.linalg.norm(high - low))
    offsets = np.zeros((len(assembly), 3))
    placed: list[np.ndarray] = []
    for part in order:
        box = assembly.parts[part].bounds_world
        if placed:
            way = np.asarray(ways_out.get(part, box.mean(axis=0) - 0.5 * (low + high)), dtype=np.float64)
            length = float(np.linalg.norm(way))
            way = way / length if length > 1e-12 else np.array([0.0, 0.0, 1.0])
            # parts keep a gap along the way only, so that neighbours side by side stay level
            along = gap * np.abs(way)
            others = np.array(placed) + np.array([-along, along])
            shrunk = box + np.array([[1.0], [-1.0]]) * 0.01 * (box[1] - box[0])
            offsets[part] = way * _clearing_travel(shrunk, way, others)
        placed.append(box + offsets[part])
    return share * offsets


def ways_out(steps: Sequence[Mapping[str, Any]]) -> dict[int, Float[np.ndarray, "3"]]:
    """Return the directions in which parts leave, from rows of the table of steps."""
    out = {}
    for row in steps:
        places = np.array(row["waypoints"], dtype=np.float64)[:, :3]
        if len(places) > 1:
            out[int(row["part"])] = places[0] - places[-1]
    return out


def _clearing_travel(
    box: Float[np.ndarray, "2 3"], way: Float[np.ndarray, "3"], others: Float[np.ndarray, "other 2 3"]
) -> float:
    """Return the shortest travel along the unit vector ``way`` after which the box meets none of the others again."""
    with np.errstate(divide="ignore", invalid="ignore"):
        touch, leave = (others[:, 0] - box[1]) / way, (others[:, 1] - box[0]) / way
    apart = (others[:, 0] >= box[1]) | (others[:, 1] <= box[0])
    still = np.abs(way) < 1e-12
    first = np.where(still, np.where(apart, np.inf, -np.inf), np.minimum(touch, leave)).max(axis=1)
    last = np.where(still, np.where(apart, -np.inf, np.inf), np.maximum(touch, leave)).min(axis=1)
    meets = last > np.maximum(first, 0.0)
    return float(last[meets].max()) if meets.any() else 0.0
