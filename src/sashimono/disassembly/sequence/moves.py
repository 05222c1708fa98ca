"""One part of an order placed earlier: what comes between must then get in past it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.masks import bits
from sashimono.disassembly.sequence.constraints import ResolvedConstraints
from sashimono.disassembly.sequence.ways import Candidate, Leaving, Unit, Ways


@dataclass(frozen=True, kw_only=True, eq=False)
class Blocked:
    """Why an order cannot be changed like that."""

    unit: Unit
    """What would no longer come in."""
    by_wish: bool
    """Whether the user wants it to come before the part that is moved; else no way past that is known."""
    by_turn: bool = False
    """Whether the product is turned over between the two."""


def earlier_in(
    order: Candidate,
    later: int,
    own: int,
    *,
    start: int,
    ways: Callable[[Float[np.ndarray, "3"]], Ways],
    wishes: ResolvedConstraints,
) -> Candidate | Blocked:
    """Return the order with one part placed earlier, see `placed_earlier`; both on one table.

    Args:
        order: Its cost is left as it was.
        later: Place of what is moved.
        own: Place after which it leaves then.
        start: Mask of all parts of the order.
        ways: Ways out, by the direction away from the table.
        wishes: What the user wants.
    """
    first = 0 if order.turn is None or later < order.turn.count else order.turn.count
    if order.turn is not None and first == 0 and own >= order.turn.count:
        return Blocked(unit=order.leaving[own].unit, by_wish=False, by_turn=True)
    for gone in order.leaving[:first]:
        start &= ~gone.unit.members
    stop = order.turn.count if order.turn is not None and first == 0 else len(order.leaving)
    leaving = placed_earlier(
        order.leaving[first:stop], later - first, own - first, start=start, ways=ways(order.up_at(later)), wishes=wishes
    )
    if isinstance(leaving, Blocked):
        return leaving
    return replace(order, leaving=(*order.leaving[:first], *leaving, *order.leaving[stop:]))


def placed_earlier(
    leaving: Sequence[Leaving], later: int, own: int, *, start: int, ways: Ways, wishes: ResolvedConstraints
) -> tuple[Leaving, ...] | Blocked:
    """Return an order in which what leaves as number ``later`` leaves just after number ``own``, which follows it now.

    So it is placed just before what it was placed after. Its own motion stays good, for fewer parts are there then.

    Args:
        leaving: The order, of taking apart.
        later: Place of what is moved.
        own: Place after which it leaves then.
        start: Mask of all parts of the order.
        ways: Ways out.
        wishes: What the user wants.
    """
    unit = leaving[later].unit
    remaining = start
    for gone in leaving[:later]:
        remaining &= ~gone.unit.members
    between: list[Leaving] = []
    last = leaving[later - 1].way.direction_index if later else None
    for entry in leaving[later + 1 : own + 1]:
        members = entry.unit.members
        if any(wishes.holds_back(part, remaining & ~members) & unit.members for part in bits(members)):
            return Blocked(unit=entry.unit, by_wish=True)
        way = ways.way(entry.unit, remaining, last)
        if way is None:
            return Blocked(unit=entry.unit, by_wish=False)
        between.append(Leaving(unit=entry.unit, way=way))
        last = way.direction_index
        remaining &= ~members
    way = ways.way(unit, remaining, last) or leaving[later].way
    return (*leaving[:later], *between, Leaving(unit=unit, way=way), *leaving[own + 1 :])
