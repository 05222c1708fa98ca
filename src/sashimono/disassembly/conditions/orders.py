"""All disassembly orders of an assembly at once: counted, drawn, listed one by one, and what they have in common.

Everything rests on finished removal conditions. Reversed, a disassembly order is an assembly order, so
there are as many of the one as of the other. Parts are given by position, part sets as bit masks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.conditions.counting import OrderCounter
from sashimono.disassembly.conditions.systems import needed_before, restricted, stuck_parts
from sashimono.disassembly.masks import bits

Order = tuple[int, ...]
"""Parts in the order in which they leave."""


@dataclass(frozen=True, kw_only=True)
class OrdersConfig:
    """Budgets of the work on orders; they count work, never time."""

    max_states: int = 2_000
    """Subsystems looked at while counting."""
    table_parts: int = 18
    """Subsystems of up to this many parts (at most 20) are counted by a table over all subsets of theirs."""
    max_nodes: int = 100_000
    """Subassemblies in an AND/OR graph."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CountedOrders:
    """How many complete disassembly orders there are, and a way to draw from them."""

    count: int | None
    """Exact; None where the budget ran out, which says nothing about the number."""
    states: int
    """Subsystems that were looked at."""
    reason: str
    """Why there is no count, or why it is zero; empty otherwise."""
    _system: tuple[tuple[int, ...], ...]
    _counter: OrderCounter

    def sample(self, count: int, *, rng: np.random.Generator) -> list[Order]:
        """Return this many complete orders, each drawn independently, every order with exactly the same chance.

        Raises ValueError where there is no count or no order: see `reason`. `random_walk` needs no count, but
        does not draw evenly.
        """
        if not self.count:
            raise ValueError(f"no orders to draw from: {self.reason}")
        return [tuple(self._counter.draw(self._system, rng)) for _ in range(count)]


def count_orders(conditions: RemovalConditions, *, config: OrdersConfig | None = None) -> CountedOrders:
    """Return the exact number of complete disassembly orders, or None and the budget that ran out."""
    config = config or OrdersConfig()
    system = conditions.masks
    counter = OrderCounter(max_states=config.max_states, table_parts=config.table_parts)
    stuck = stuck_parts(system, (1 << len(system)) - 1)
    if stuck:
        count, reason = 0, f"{stuck.bit_count()} parts never come apart"
    else:
        count = counter.count(system)
        reason = f"counting ran out of its budget of {config.max_states} subsystems" if count is None else ""
    return CountedOrders(count=count, states=counter.states, reason=reason, _system=system, _counter=counter)


def iterate_orders(conditions: RemovalConditions) -> Iterator[Order]:
    """Yield every complete disassembly order once, in lexicographic order of part positions.

    Needs no memory beyond one order: by monotony no choice leads to a dead end where complete orders exist.
    """
    remaining = (1 << len(conditions.names)) - 1
    if stuck_parts(conditions.masks, remaining):
        return
    order: list[int] = []
    choices = [conditions.removable(remaining)]
    while choices:
        lowest = choices[-1] & -choices[-1]
        if lowest:
            choices[-1] ^= lowest
            order.append(lowest.bit_length() - 1)
            remaining ^= lowest
            if remaining:
                choices.append(conditions.removable(remaining))
                continue
            yield tuple(order)
        else:
            choices.pop()
        if order:
            remaining |= 1 << order.pop()


def random_walk(conditions: RemovalConditions, *, rng: np.random.Generator) -> Order:
    """Return an order in which each next part is drawn evenly from those that can leave.

    Quick for any number of parts, but *not* uniform: orders through bottlenecks come up more often. It ends
    early where parts never come apart.
    """
    order = []
    remaining = (1 << len(conditions.names)) - 1
    while free := bits(conditions.removable(remaining)):
        part = free[int(rng.integers(len(free)))]
        order.append(part)
        remaining &= ~(1 << part)
    return tuple(order)


@dataclass(frozen=True, kw_only=True)
class Precedence:
    """What holds in every order."""

    leave_before: tuple[int, ...]
    """By part, the mask of the parts that leave before it in every order (so are placed after it)."""
    stuck: int
    """Mask of the parts that never come apart; nothing is said of them."""

    def reduced(self) -> tuple[int, ...]:
        """Return the transitive reduction: by part, only those that no other one of its set implies."""
        out = []
        for mask in self.leave_before:
            implied = 0
            for other in bits(mask):
                implied |= self.leave_before[other]
            out.append(mask & ~implied)
        return tuple(out)


def find_precedence(conditions: RemovalConditions) -> Precedence:
    """Return which parts leave before which in every disassembly order, exactly.

    A part is needed for another if the other cannot be reached while it stays; with removals only ever
    adding freedom, that is the same as leaving before it in every order.
    """
    count = len(conditions.names)
    stuck = stuck_parts(conditions.masks, (1 << count) - 1)
    leaving = [part for part in range(count) if not stuck >> part & 1]
    leave_before = [0] * count
    for part, mask in zip(leaving, needed_before(restricted(conditions.masks, leaving, stuck)), strict=True):
        leave_before[part] = sum(1 << leaving[k] for k in bits(mask))
    return Precedence(leave_before=tuple(leave_before), stuck=stuck)


def conditions_as_dict(conditions: RemovalConditions, *, config: OrdersConfig | None = None) -> dict[str, object]:
    """Return what ``sashimono conditions`` writes.

    ``parts``: names. ``clauses``: by name, lists of blockers. ``orders``: how many complete orders, or null
    with ``orders_reason``. ``precedence``: pairs [a, b], a is placed before b in every order, without those
    that others imply. ``stuck``: parts that never come apart. ``cut_short``: parts that may have more clauses,
    by several translations or turns; with any, ``orders`` is a lower bound.
    """
    names = conditions.names
    counted = count_orders(conditions, config=config)
    precedence = find_precedence(conditions)
    return {
        "parts": list(names),
        "clauses": {
            name: [[names[k] for k in bits(clause.blockers)] for clause in clauses]
            for name, clauses in zip(names, conditions.clauses, strict=True)
        },
        "orders": counted.count,
        "orders_reason": counted.reason,
        "precedence": [
            [names[first], names[second]] for first, mask in enumerate(precedence.reduced()) for second in bits(mask)
        ],
        "stuck": [names[k] for k in bits(precedence.stuck)],
        "cut_short": [names[k] for k in conditions.cut_short],
    }
