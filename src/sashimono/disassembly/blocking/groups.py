"""Subassemblies: parts that leave together, rigidly, where none of them leaves alone.

Along a direction let ``i -> j`` mean that j blocks i. A set that no arrow leaves moves off as one; the
smallest such sets are the sink strongly connected components (Wilson and Latombe 1994, *Geometric
reasoning about mechanical assembly*). The rest of a closed set is closed along the opposite direction,
so of all directions there is one whose sink leaves any given part behind, if any set moves at all.

Where no set goes straight out, one may go a little way as one, and leave by several translations. Those are closed
under the arrows of a short travel. Not the smallest alone: what lies loose in a set is one by itself, and goes along.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from jaxtyping import Float
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from sashimono.disassembly.blocking.relation import Blocking
from sashimono.disassembly.free_travel import passes
from sashimono.disassembly.masks import bits, reached
from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import UNASKED, Separation
from sashimono.plan import MotionClass


@dataclass(frozen=True, kw_only=True, eq=False)
class MovingGroup:
    """Parts that leave the remaining ones together, by one translation."""

    members: int
    """Mask of the parts."""
    direction_index: int
    """Direction in the blocking relation."""
    removal: Removal
    """The translation that takes all of them past the others."""


class GroupStage:
    """Subassemblies. A group frees no part by itself, so `separate` finds nothing; a sequence asks for a group."""

    name = "subassembly"
    motions = MotionClass.TRANSLATIONS

    def __init__(self, blocking: Blocking) -> None:
        self.blocking = blocking

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        return UNASKED

    def can_recall(self, found: Separation) -> bool:
        return False

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        return True


def find_subassembly(
    blocking: Blocking,
    remaining: int,
    *,
    stays: int,
    worth: Callable[[Float[np.ndarray, "3"]], float],
    connected: Callable[[int], bool],
    refused: frozenset[Refusal] = frozenset(),
) -> MovingGroup | None:
    """Return the best set of two or more parts that leaves the remaining ones as one body, or None.

    Parts that hang together are preferred, then the fewest parts, then the direction that is worth most. Every pair
    of a member and a part that stays is traced. A set is returned only if all pairs pass.

    Args:
        blocking: The relation.
        remaining: Mask of the parts that are there.
        stays: A part that must not be among those that move.
        worth: Of a unit direction of removal.
        connected: Whether the parts of a mask hang together.
        refused: Ways out that must not be returned.
    """
    missed: dict[int, dict[int, int]] = {direction_index: {} for direction_index in range(blocking.count_directions)}
    """By direction and part: blockers that the maps miss and tracing found, here and now."""

    def sinks(direction_index: int) -> list[int]:
        def blockers(part: int) -> int:
            mapped = blocking.blockers(part, direction_index, remaining & ~(1 << part))
            return mapped | missed[direction_index].get(part, 0)

        return _sinks(remaining, blockers)

    found = {direction_index: sinks(direction_index) for direction_index in missed}
    while True:
        candidates = [
            (
                not connected(members),
                members.bit_count(),
                -round(worth(blocking.direction(direction_index)), 6),
                members,
                direction_index,
            )
            for direction_index, sinks in found.items()
            for members in sinks
            if members.bit_count() > 1
            and not members >> stays & 1
            and not is_refused(refused, members, direction_index, remaining & ~members)
        ]
        if not candidates:
            return None
        *_, members, direction_index = min(candidates)
        others = remaining & ~members
        stops = [
            (part, other)
            for part in bits(members)
            for other in bits(others)
            if not blocking.passes(part, direction_index, other)
        ]
        if not stops:
            removal = blocking.parts.straight_removal(members, others, blocking.direction(direction_index))
            return MovingGroup(members=members, direction_index=direction_index, removal=removal)
        for part, other in stops:
            for moving, way, stop in ((part, direction_index, other), (other, direction_index ^ 1, part)):
                missed[way][moving] = missed[way].get(moving, 0) | 1 << stop
        for changed in (direction_index, direction_index ^ 1):
            found[changed] = sinks(changed)


@dataclass(frozen=True, kw_only=True)
class LooseConfig:
    """Which sets are loose as one, and how many are asked for translations."""

    travel: float = 0.1
    """How far a part must go past each other one, over the smaller one's smallest extent."""
    max_parts: int = 40
    """Of more remaining parts nothing is asked."""
    max_sets: int = 8
    """Sets asked for translations: each costs a search of two merged bodies."""


def loose_sets(blocking: Blocking, remaining: int, *, stays: int, config: LooseConfig) -> list[int]:
    """Return the sets of two or more parts that go a little way as one, as masks: those with the fewest parts first.

    Every pair of neighbours is traced.

    Args:
        blocking: The relation.
        remaining: Mask of the parts that are there.
        stays: A part that must not be among those that move.
        config: What is loose; of too many parts there is no set.
    """
    parts, there = blocking.parts, bits(remaining)
    if len(there) > config.max_parts:
        return []
    lengths = {(part, other): config.travel * parts.smaller_size(part, other) for part, other in permutations(there, 2)}
    near = {pair: length for pair, length in lengths.items() if parts.boxes_meet(*pair, length)}
    found: set[int] = set()
    for direction_index in range(blocking.count_directions):
        direction = blocking.direction(direction_index)
        stops = dict.fromkeys(there, 0)
        for (part, other), length in near.items():
            if not passes(parts, part, np.zeros(3), direction, other, length=length):
                stops[part] |= 1 << other
        found |= {reached(1 << part, remaining, stops.__getitem__) for part in there}
    out = [members for members in found if members.bit_count() > 1 and not members >> stays & 1]
    return sorted(out, key=lambda members: (members.bit_count(), members))


def _sinks(remaining: int, blockers: Callable[[int], int]) -> list[int]:
    """The smallest sets that no remaining part outside of them blocks, as masks."""
    parts = bits(remaining)
    place = {part: k for k, part in enumerate(parts)}
    arrows = [(place[part], place[other]) for part in parts for other in bits(blockers(part))]
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
