"""Subassemblies: parts that leave together, rigidly, where none of them leaves alone.

Along a direction let ``i -> j`` mean that j blocks i. A set that no arrow leaves moves off as one; the
smallest such sets are the sink strongly connected components (Wilson and Latombe 1994, *Geometric
reasoning about mechanical assembly*). The rest of a closed set is closed along the opposite direction,
so of all directions there is one whose sink leaves any given part behind, if any set moves at all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from sashimono.disassembly.blocking.relation import Blocking
from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal


@dataclass(frozen=True, kw_only=True, eq=False)
class Subassembly:
    """Parts that leave the remaining ones together, by one translation."""

    members: int
    """Mask of the parts."""
    signed: int
    """Direction in the blocking relation."""
    removal: Removal
    """The translation that takes all of them past the others."""


def find_subassembly(
    blocking: Blocking,
    remaining: int,
    *,
    stays: int,
    worth: Callable[[Float[np.ndarray, "3"]], float],
    connected: Callable[[int], bool],
    banned: frozenset[tuple[int, int]] = frozenset(),
) -> Subassembly | None:
    """Return the best set of two or more parts that leaves the remaining ones as one body, or None.

    Parts that hang together rather than not, then the fewest, then the direction worth most. Every pair
    of a member and a part that stays is traced: a set is given only if all of them pass.

    Args:
        blocking: The relation.
        remaining: Mask of the parts that are there.
        stays: A part that must not be among those that move.
        worth: Of a unit direction of removal.
        connected: Whether the parts of a mask hang together.
        banned: Pairs of a set of parts (a mask) and a signed direction not to be given.
    """
    found = {signed: _sinks(blocking, signed, remaining) for signed in range(blocking.count_signed)}
    while True:
        candidates = [
            (not connected(members), members.bit_count(), -round(worth(blocking.direction(signed)), 6), members, signed)
            for signed, sinks in found.items()
            for members in sinks
            if members.bit_count() > 1 and not members >> stays & 1 and (members, signed) not in banned
        ]
        if not candidates:
            return None
        *_, members, signed = min(candidates)
        if _passes(blocking, signed, members, remaining & ~members):
            removal = _straight(blocking, signed, members, remaining & ~members)
            return Subassembly(members=members, signed=signed, removal=removal)
        # tracing found a blocker that the maps had missed: the relation knows it now, both ways
        for changed in (signed, signed ^ 1):
            found[changed] = _sinks(blocking, changed, remaining)


def _sinks(blocking: Blocking, signed: int, remaining: int) -> list[int]:
    """The smallest sets that no remaining part outside of them blocks along a signed direction, as masks."""
    parts = bits(remaining)
    place = {part: k for k, part in enumerate(parts)}
    arrows = [
        (place[part], place[other])
        for part in parts
        for other in bits(blocking.blockers(part, signed, remaining & ~(1 << part)))
    ]
    rows, columns = np.array(arrows, dtype=np.int64).reshape(-1, 2).T
    graph = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(len(parts), len(parts)))
    count, label = connected_components(graph, directed=True, connection="strong")
    left = {int(label[a]) for a, b in zip(rows, columns, strict=True) if label[a] != label[b]}
    if count == 1:
        return []
    return [
        sum(1 << part for part, of in zip(parts, label, strict=True) if of == component)
        for component in range(count)
        if component not in left
    ]


def _passes(blocking: Blocking, signed: int, members: int, others: int) -> bool:
    return all(blocking.passes(part, signed, other) for part in bits(members) for other in bits(others))


def _straight(blocking: Blocking, signed: int, members: int, others: int) -> Removal:
    """The translation that takes the members' common box past those of the others."""
    direction = blocking.direction(signed)
    back = min(blocking.world_bounds_along(part, direction)[0] for part in bits(members))
    front = max(blocking.world_bounds_along(part, direction)[1] for part in bits(others))
    clearance = 0.05 * min(blocking.sizes[part] for part in bits(members))
    return Removal.straight(direction, max(front - back, 0.0) + clearance)
