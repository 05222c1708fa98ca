"""Precedence from elsewhere, on top of removal conditions: what fasteners or the user demand.

Removal conditions are geometry. A demand that a part is placed before another is one more blocker of the first: it
leaves only once the other has left. So all that holds of conditions holds of these, exact counting included.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.conditions.orders import OrdersConfig, count_orders, find_precedence
from sashimono.disassembly.masks import bits


def with_precedence(conditions: RemovalConditions, pairs: Iterable[tuple[str, str]]) -> RemovalConditions:
    """Return the conditions with these pairs (before, after) demanded: the first is placed before the second.

    A clause of the first part gets the second as one more blocker. Clauses that then contain another are dropped.
    Raises KeyError for a name that is not there.
    """
    index = {name: k for k, name in enumerate(conditions.names)}
    later = [0] * len(index)
    for before, after in pairs:
        later[index[before]] |= 1 << index[after]
    clauses = []
    for mask, own in zip(later, conditions.clauses, strict=True):
        kept = []
        for clause in sorted(own, key=lambda c: ((c.blockers | mask).bit_count(), c.blockers | mask)):
            blockers = clause.blockers | mask
            if not any(other.blockers & blockers == other.blockers for other in kept):
                kept.append(replace(clause, blockers=blockers))
        clauses.append(tuple(kept))
    return replace(conditions, clauses=tuple(clauses))


def added_as_dict(
    conditions: RemovalConditions, pairs: Iterable[tuple[str, str]], *, config: OrdersConfig | None = None
) -> dict[str, object]:
    """Return what these pairs add to conditions.

    ``precedence``: the pairs [before, after] that geometry alone does not imply, in part order. ``orders``: how many
    complete orders remain with all of them, or null with ``orders_reason``. ``stuck``: parts that never come apart
    then, though by geometry they do; with any, the pairs contradict geometry.
    """
    names = conditions.names
    index = {name: k for k, name in enumerate(names)}
    pairs = sorted(pairs, key=lambda pair: (index[pair[0]], index[pair[1]]))
    geometric = find_precedence(conditions)
    constrained = with_precedence(conditions, pairs)
    counted = count_orders(constrained, config=config)
    stuck = find_precedence(constrained).stuck & ~geometric.stuck
    return {
        "precedence": [[a, b] for a, b in pairs if not geometric.leave_before[index[a]] >> index[b] & 1],
        "orders": counted.count,
        "orders_reason": counted.reason,
        "stuck": [names[k] for k in bits(stuck)],
    }
