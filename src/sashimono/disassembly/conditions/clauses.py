"""Removal conditions: for each part, the minimal sets of parts whose absence frees it.

For rigid parts removed one at a time fewer obstacles never block more, so the conditions of a part
are a monotone formula in disjunctive normal form: it leaves from the remaining set S if and only if
some clause c has ``c ∩ S = ∅``. Part sets are bit masks.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal


@dataclass(frozen=True, kw_only=True, eq=False)
class Clause:
    """One minimal set of blockers: with all of them gone, the part leaves by the witness."""

    blockers: int
    """Mask of the parts that must be absent."""
    removal: Removal
    """A motion that shows it."""
    stage: str = ""
    """The stage that found it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RemovalConditions:
    """The removal conditions of every part of an assembly."""

    names: tuple[str, ...]
    clauses: tuple[tuple[Clause, ...], ...]
    """By part, fewest blockers first; empty where no motion was found at all."""
    cut_short: tuple[int, ...] = ()
    """Parts for which clauses may be missing: sets of obstacles were left unasked, or the answer was UNKNOWN."""
    reachable_only: bool = False
    """Whether they were only worked out for sets of parts that taking the whole apart can leave."""

    def __repr__(self) -> str:
        short = f", {len(self.cut_short)} may have more" if self.cut_short else ""
        count = sum(map(len, self.clauses))
        return f"RemovalConditions({len(self.names)} parts, {count} clauses{short})"

    def blockers(self, part: str) -> tuple[frozenset[str], ...]:
        """Return the sets of parts, by name, of which one must be gone; KeyError for a name that is not there.

        An empty set means that the part can leave at once; no sets, that no motion was found.
        """
        if part not in self.names:
            raise KeyError(part)
        return tuple(
            frozenset(self.names[k] for k in bits(clause.blockers)) for clause in self.clauses[self.names.index(part)]
        )

    @cached_property
    def masks(self) -> tuple[tuple[int, ...], ...]:
        """By part, the blockers of each clause; for a part without any, all others: it can only stay as the last."""
        everything = (1 << len(self.names)) - 1
        return tuple(
            tuple(clause.blockers for clause in clauses) or (everything & ~(1 << part),)
            for part, clauses in enumerate(self.clauses)
        )

    def clause(self, part: int, remaining: int) -> Clause | None:
        """Return a clause by which this part leaves from the remaining parts, or None."""
        others = remaining & ~(1 << part)
        return next((clause for clause in self.clauses[part] if not clause.blockers & others), None)

    def removable(self, remaining: int) -> int:
        """Return the mask of the parts that can leave from the remaining ones; the last part always can."""
        free = 0
        for part in bits(remaining):
            others = remaining & ~(1 << part)
            for blockers in self.masks[part]:
                if not blockers & others:
                    free |= 1 << part
                    break
        return free


def minimal(masks: Iterable[int]) -> list[int]:
    """Return the masks that contain no other one, smallest first."""
    kept: list[int] = []
    for mask in sorted(set(masks), key=lambda m: (m.bit_count(), m)):
        if not any(small & mask == small for small in kept):
            kept.append(mask)
    return kept
