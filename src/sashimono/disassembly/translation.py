"""Several translations in a row, where no single one frees a part.

Best first over displacements of the part: from each, every direction is followed until it is
stopped, with intermediate halts where a face of the part comes level with a face of an obstacle.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.blocking import Blocking
from sashimono.disassembly.removal import Removal


@dataclass(frozen=True, kw_only=True)
class TranslationConfig:
    """Budget of the search; it counts work, never time."""

    max_expansions: int = 24
    """Displacements expanded."""
    max_directions: int = 12
    """Lines followed from each, the assembly's first ones and the part's own."""
    halts: int = 6
    """Most intermediate halts along one translation."""
    least_travel: float = 0.05
    """Shortest translation worth taking, relative to the part's smallest extent."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TranslationResult:
    """A removal of several legs, or why there is none."""

    removal: Removal | None
    blocked_by: tuple[int, ...] = ()
    reason: str = ""
    expansions: int = 0


def search_translations(
    blocking: Blocking, part: int, others: Sequence[int], *, config: TranslationConfig
) -> TranslationResult:
    """Return a removal of the part past the others by translations along the relation's directions."""
    lines = blocking.directions[: config.max_directions]
    signed = [sign * line for line in lines for sign in (1.0, -1.0)]
    least = config.least_travel * blocking.sizes[part]
    start = np.zeros(3)
    queue: list[tuple[float, int, np.ndarray, list[np.ndarray]]] = [(0.0, 0, start, [start])]
    seen = {_key(start, least)}
    met: set[int] = set()
    pushed = expansions = 0
    while queue and expansions < config.max_expansions:
        _, _, offset, path = heapq.heappop(queue)
        expansions += 1
        for direction in signed:
            travel, stopper = _travel(blocking, part, others, offset, direction, least)
            if stopper is None:
                removal = _removal(blocking, part, others, path, direction)
                return TranslationResult(removal=removal, expansions=expansions)
            met.add(stopper)
            if travel < least:
                continue
            for halt in _halts(blocking, part, others, offset, direction, travel, config.halts):
                place = offset + halt * direction
                key = _key(place, least)
                if key in seen:
                    continue
                seen.add(key)
                pushed += 1
                # short paths first, then those that have come far
                cost = len(path) - 0.5 * float(np.linalg.norm(place)) / _reach(blocking, part)
                heapq.heappush(queue, (cost, pushed, place, [*path, place]))
    reason = (
        f"translation search ran out of its budget of {config.max_expansions} displacements"
        if queue
        else f"no way out by translations along the {len(lines)} directions tried"
    )
    return TranslationResult(removal=None, blocked_by=tuple(sorted(met)), reason=reason, expansions=expansions)


def _travel(
    blocking: Blocking,
    part: int,
    others: Sequence[int],
    offset: Float[np.ndarray, "3"],
    direction: Float[np.ndarray, "3"],
    least: float,
) -> tuple[float, int | None]:
    """How far the part goes from an offset, kept back from the obstacle it meets; and that obstacle."""
    shortest, stopper = np.inf, None
    for other in others:
        travel = blocking.travel(part, offset, direction, other)
        if travel < shortest:
            size = min(blocking.sizes[part], blocking.sizes[other])
            back = (blocking.config.tolerance + blocking.config.least_step) * size + blocking.allowances[part, other]
            shortest, stopper = max(0.0, travel - back), other
            if shortest < least:
                break
    return shortest, stopper


def _halts(
    blocking: Blocking,
    part: int,
    others: Sequence[int],
    offset: Float[np.ndarray, "3"],
    direction: Float[np.ndarray, "3"],
    travel: float,
    most: int,
) -> list[float]:
    """Where to stop along a translation: at its end, and where end faces come level with obstacles'."""
    own = blocking.world_bounds_along(part, direction) + float(offset @ direction)
    levels = []
    for other in others:
        theirs = blocking.world_bounds_along(other, direction)
        levels += [theirs[a] - own[b] for a in range(2) for b in range(2)]
    margin = 0.02 * blocking.sizes[part]
    shifted = np.array(levels)
    shifted = np.concatenate([shifted + margin, shifted - margin])
    inside = np.unique(shifted[(shifted > 0.0) & (shifted < travel)])
    if len(inside) > most:
        inside = inside[np.linspace(0, len(inside) - 1, most).astype(int)]
    return [travel, *(float(t) for t in inside)]


def _removal(
    blocking: Blocking,
    part: int,
    others: Sequence[int],
    path: list[np.ndarray],
    direction: Float[np.ndarray, "3"],
) -> Removal:
    back = blocking.world_bounds_along(part, direction)[0] + float(path[-1] @ direction)
    front = max(blocking.world_bounds_along(other, direction)[1] for other in others)
    end = path[-1] + (max(front - back, 0.0) + 0.05 * blocking.sizes[part]) * direction
    displacements = np.stack([np.eye(4)] * (len(path) + 1))
    displacements[1:-1, :3, 3] = np.array(path[1:]).reshape(-1, 3)
    displacements[-1, :3, 3] = end
    return Removal(displacements=displacements, exit_direction=direction)


def _reach(blocking: Blocking, part: int) -> float:
    return float(np.linalg.norm(np.ptp(blocking.bodies[part].vertices, axis=0)))


def _key(offset: Float[np.ndarray, "3"], cell: float) -> tuple[int, ...]:
    return tuple(int(x) for x in np.round(offset / cell))
