"""The fewest parts that must be held for a partial assembly to stand."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sashimono.stability.component import Component
from sashimono.stability.config import StabilityConfig
from sashimono.stability.statics import Statics


@dataclass(frozen=True, kw_only=True)
class Holding:
    """What must be held."""

    held: tuple[str, ...]
    """One part of each held group, in the order of placing. Whatever is fastened to it comes along."""
    fewest: bool
    """Whether no fewer would do; else the budget ran out, and the number is an upper bound."""


def fewest_held(
    statics: Statics, placed: Sequence[str], *, fixed: Collection[str] = (), preferred: Sequence[str] = ()
) -> Holding:
    """Return the fewest parts that must be held; a held part takes any wrench.

    Args:
        statics: The balance of all parts on their table.
        placed: Parts in place, in the order of placing.
        fixed: Those that a fixture holds.
        preferred: Parts that are tried first: those that are held already, the one in a hand.
    """
    held: list[str] = []
    fewest = True
    for component in statics.components(placed, fixed):
        wanted = tuple(any(name in preferred for name in group) for group in component.groups)
        key = component.groups, tuple(block.key for block in component.blocks), wanted
        if key not in statics.fewest:
            statics.fewest[key] = _fewest(component, wanted, statics.config)
        groups, exact = statics.fewest[key]
        fewest = fewest and exact
        held += [_named(component.groups[k], preferred) for k in groups]
    order = {name: k for k, name in enumerate(placed)}
    return Holding(held=tuple(sorted(held, key=order.__getitem__)), fewest=fewest)


def _named(group: Sequence[str], preferred: Sequence[str]) -> str:
    return next((name for name in preferred if name in group), group[0])


def _fewest(component: Component, wanted: Sequence[bool], config: StabilityConfig) -> tuple[tuple[int, ...], bool]:
    """Groups to hold, and whether these are the fewest: what must be held anyway, and one more, two more, ..."""
    count = len(component.groups)
    if component.forces == 0:  # touches nothing
        return tuple(range(count)), True
    if component.stands():
        return (), True
    needed = component.needed()
    if needed and component.stands(needed):
        return tuple(needed), True
    left = component.imbalance()
    # first what is in a hand anyway, then what is least balanced
    order = sorted(
        (k for k in range(count) if k not in needed), key=lambda k: (not wanted[k], -round(float(left[k]), 6), k)
    )
    programs = 1 if needed else 0
    for size in range(1, count - len(needed)):
        for more in combinations(order, size):
            if programs >= config.max_programs:
                return _few(component, needed), False
            programs += 1
            if component.stands((*needed, *more)):
                return (*needed, *more), True
    return tuple(range(count)), True


def _few(component: Component, needed: Sequence[int]) -> tuple[int, ...]:
    """Hold, again and again, what is least balanced; then let go of what need not be held."""
    held = list(needed)
    while (left := component.imbalance(held)).sum() > component.tolerance:
        free = [k for k in range(len(left)) if k not in held]
        held.append(free[int(np.argmax(left[free]))])
    for k in held[len(needed) :]:
        without = [other for other in held if other != k]
        if component.stands(without):
            held = without
    return tuple(held)
