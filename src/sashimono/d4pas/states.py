"""States of an assembly under construction, and which next parts are right in each: bit operations on the conditions.

Part sets are bit masks. With A the placed parts, part i is right (y = 1) if it can leave from A ∪ {i} and A ∪ {i} can
be reached by taking the full product apart: then some complete sequence goes on with i. Taking apart never
dead-ends, since fewer parts never block more; putting together does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sashimono.disassembly.conditions.systems import remainder

Masks = tuple[tuple[int, ...], ...]
"""By part, the blockers of each clause: the part may leave when all of one clause are gone."""


def can_leave(masks: Masks, part: int, others: int) -> bool:
    """Return whether a part can leave while these others are there."""
    return any(not clause & others for clause in masks[part])


def is_reachable(masks: Masks, target: int) -> bool:
    """Return whether exactly these parts can be left over by taking the full product apart."""
    return remainder(masks, target) == target


def insertable(masks: Masks, placed: int) -> int:
    """Return the parts that can be put to the placed ones now, wherever that leads."""
    return sum(1 << part for part in range(len(masks)) if not placed >> part & 1 and can_leave(masks, part, placed))


def right_next(masks: Masks, placed: int) -> int:
    """Return the parts with which some complete sequence goes on from the placed ones (y = 1)."""
    now = insertable(masks, placed)
    return sum(1 << part for part in range(len(masks)) if now >> part & 1 and is_reachable(masks, placed | 1 << part))


def random_state(masks: Masks, count: int, rng: np.random.Generator) -> int:
    """Return a reachable state with this many placed parts, by taking parts out at random.

    Each next part is drawn evenly from those that can leave. ``count`` parts are left if the product comes apart.
    """
    remaining = (1 << len(masks)) - 1
    for _ in range(len(masks) - count):
        free = [
            part
            for part in range(len(masks))
            if remaining >> part & 1 and can_leave(masks, part, remaining & ~(1 << part))
        ]
        if not free:
            break
        remaining &= ~(1 << free[int(rng.integers(len(free)))])
    return remaining


def all_states(masks: Masks, *, limit: int) -> dict[int, int] | None:
    """Return every reachable set of placed parts with its right next parts; None if there are more than ``limit``."""
    full = (1 << len(masks)) - 1
    right: dict[int, int] = {full: 0}
    frontier = [full]
    while frontier:
        following = []
        for state in frontier:
            for part in range(len(masks)):
                rest = state & ~(1 << part)
                if rest != state and can_leave(masks, part, rest):
                    if rest not in right:
                        if len(right) >= limit:
                            return None
                        right[rest] = 0
                        following.append(rest)
                    right[rest] |= 1 << part
        frontier = following
    return right


def is_right_order(masks: Masks, order: Sequence[int]) -> bool:
    """Return whether an assembly order (base first) can be carried out: each part can leave what was placed before."""
    placed = 0
    for part in order:
        if not can_leave(masks, part, placed):
            return False
        placed |= 1 << part
    return placed == (1 << len(masks)) - 1
