"""Removal conditions: for each part, the minimal sets of parts whose absence frees it.

For rigid parts removed one at a time fewer obstacles never block more, so the conditions of a part
are a monotone formula in disjunctive normal form: it leaves from the remaining set S if and only if
some clause c has ``c ∩ S = ∅``. Part sets are bit masks.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from sashimono.disassembly.blocking import bits
from sashimono.disassembly.removal import Removal


@dataclass(frozen=True, kw_only=True, eq=False)
class Clause:
    """One minimal set of blockers: with all of them gone, the part leaves by the witness."""

    blockers: int
    """Mask of the parts that must be absent."""
    removal: Removal
    """A motion that shows it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RemovalConditions:
    """The removal conditions of every part of an assembly."""

    names: tuple[str, ...]
    clauses: tuple[tuple[Clause, ...], ...]
    """By part, fewest blockers first; empty where no motion was found at all."""
    cut_short: tuple[int, ...] = ()
    """Parts for which clauses may be missing: sets of obstacles were left unasked, or the answer was UNKNOWN."""

    def clause(self, part: int, remaining: int) -> Clause | None:
        """Return a clause by which this part leaves from the remaining parts, or None."""
        others = remaining & ~(1 << part)
        return next((clause for clause in self.clauses[part] if not clause.blockers & others), None)

    def removable(self, remaining: int) -> int:
        """Return the mask of the parts that can leave from the remaining ones; the last part always can."""
        if remaining & (remaining - 1) == 0:
            return remaining
        return sum(1 << part for part in bits(remaining) if self.clause(part, remaining) is not None)

    def count_orders(self, *, max_states: int = 200_000) -> int | None:
        """Return how many complete disassembly orders there are, exactly, or None past ``max_states`` sets.

        Walks the lattice of reachable remaining sets layer by layer: orders are counted, not listed.
        """
        ways = {(1 << len(self.names)) - 1: 1}
        visited = 0
        for _ in self.names:
            following: dict[int, int] = {}
            for remaining, count in ways.items():
                for part in bits(self.removable(remaining)):
                    rest = remaining & ~(1 << part)
                    following[rest] = following.get(rest, 0) + count
            visited += len(following)
            if visited > max_states:
                return None
            ways = following
        return ways.get(0, 0)

    def as_dict(self, *, max_states: int = 200_000) -> dict[str, object]:
        """Return the ``sashimono conditions`` form: ``{"parts", "clauses", "orders"}``; orders may be None."""
        named = {
            name: [[self.names[k] for k in bits(clause.blockers)] for clause in clauses]
            for name, clauses in zip(self.names, self.clauses, strict=True)
        }
        return {"parts": list(self.names), "clauses": named, "orders": self.count_orders(max_states=max_states)}


def minimal(masks: Iterable[int]) -> list[int]:
    """Return the masks that contain no other one, smallest first."""
    kept: list[int] = []
    for mask in sorted(set(masks), key=lambda m: (m.bit_count(), m)):
        if not any(small & mask == small for small in kept):
            kept.append(mask)
    return kept
