"""Removal conditions of every part: which stages are asked about which sets of obstacles.

Single translations come first: the relation gives all of their clauses at once. Then the stage of translations is
asked about the largest sets that neither a clause nor a proof decides (at most ``max_queries`` a part). A part that
another one holds by itself even when all else is gone may turn its way out. All stages are asked about such a pair.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol, runtime_checkable

from sashimono.disassembly.blocking.relation import Blocking
from sashimono.disassembly.blocking.stage import BlockingStage
from sashimono.disassembly.conditions.clauses import Clause, RemovalConditions, minimal
from sashimono.disassembly.conditions.enumeration import SetAnswer, enumerate_clauses
from sashimono.disassembly.conditions.systems import remainder
from sashimono.disassembly.config import SeparateConfig
from sashimono.disassembly.inquiry import Inquiry
from sashimono.disassembly.masks import bits
from sashimono.disassembly.physics.stage import PhysicsStage
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import Separation, Stage


@runtime_checkable
class FewerHolders(Protocol):
    """As `TranslationStage.fewer_holders`."""

    def __call__(self, part: int, holders: int, *, frees: Callable[[int], bool]) -> int: ...


def find_conditions(
    names: tuple[str, ...],
    directions: BlockingStage,
    inquiry: Inquiry,
    *,
    translations: Stage,
    fewer_holders: FewerHolders,
    physics: PhysicsStage,
    for_pairs: Sequence[Stage],
    config: SeparateConfig,
    reachable_only: bool,
) -> RemovalConditions:
    """Return every part's removal conditions, each clause with its witness.

    Args:
        names: The parts' names.
        directions: The stage of single translations.
        inquiry: What asks all stages.
        translations: The stage whose proofs decide sets of obstacles.
        fewer_holders: Makes the sets that these proofs name smaller: a smaller one decides more sets.
        physics: The stage that says which parts a motion hits.
        for_pairs: The stages that are asked about a part that another one holds even when all else is gone.
        config: Budgets.
        reachable_only: Ask only about sets that taking the whole apart can leave: orders and next parts are as exact,
            for a fraction of the work.
    """
    search = _Search(directions.blocking, inquiry, translations, fewer_holders, physics, for_pairs, config)
    parts = range(len(directions.blocking))
    found = [blocking_clauses(directions.blocking, part) for part in parts]
    while True:
        known = [frozenset(minimal(clauses)) for clauses in found]
        complete = [search.complete(part, found, reachable_only=reachable_only) for part in parts]
        # a clause found late makes more sets reachable: ask again, what was said is remembered
        if not reachable_only or known == [frozenset(minimal(clauses)) for clauses in found]:
            break
    return RemovalConditions(
        names=names,
        clauses=tuple(tuple(clauses[mask] for mask in minimal(clauses)) for clauses in found),
        cut_short=tuple(part for part in parts if not complete[part]),
        reachable_only=reachable_only,
    )


class _Search:
    """One run: whom it asks, and the motions that took one part of a pair off the other."""

    def __init__(
        self,
        blocking: Blocking,
        inquiry: Inquiry,
        translations: Stage,
        fewer_holders: FewerHolders,
        physics: PhysicsStage,
        for_pairs: Sequence[Stage],
        config: SeparateConfig,
    ) -> None:
        self.blocking, self.inquiry, self.config = blocking, inquiry, config
        self.translations, self.fewer_holders, self.physics = translations, fewer_holders, physics
        self.for_pairs = tuple(for_pairs)
        self._relative_motions: dict[tuple[int, int], Removal] = {}

    def complete(self, part: int, found: list[dict[int, Clause]], *, reachable_only: bool) -> bool:
        """Add the clauses of the later stages to a part's; return whether these are all, provably, by translations."""
        clauses = found[part]

        def frees(obstacles: int) -> bool:
            return any(not clause & obstacles for clause in clauses)

        def ask(others: int) -> SetAnswer:
            separation = self.inquiry.ask(self.translations, part, others | 1 << part)
            if separation.removal is not None:
                _add(clauses, separation)
                return SetAnswer(clause=separation.hits)
            core = sum(1 << k for k in separation.blocked_by)
            is_proven = separation.proven_for is not None
            if is_proven:
                core = self.fewer_holders(part, core, frees=frees)
            elif frees(core):
                core = others  # these alone do not hold it: all that is known is that no motion past all was found
            return SetAnswer(core=core, is_proven=is_proven)

        config = self.config
        everything = self.blocking.parts.all_parts & ~(1 << part)
        while True:
            enumerated = enumerate_clauses(
                everything,
                clauses,
                ask,
                gone_with=_Reached(found, part).gone_with if reachable_only else lambda absent: absent,
                max_queries=config.max_queries,
                max_unproven=config.max_unproven,
                max_undecided=config.max_undecided,
            )
            known = len(clauses)
            for core in enumerated.cores:
                if core.bit_count() == 1:
                    self._separate_pair(part, core, clauses)
            # a part that turns out may leave sets in which no translation, and no proof, was found
            if enumerated.is_complete or len(clauses) == known:
                return enumerated.is_complete

    def _separate_pair(self, part: int, holder: int, clauses: dict[int, Clause]) -> None:
        """Add the clauses by which a part turns off one that holds it: of both alone, then of all parts."""
        other = holder.bit_length() - 1
        if (other, part) in self._relative_motions:  # the two come apart by one relative motion, whichever moves
            removal = self._relative_motions[other, part].of_the_other()
            self.inquiry.remember(part, self.physics.witness(part, holder, removal))
        for remaining in (holder | 1 << part, self.blocking.parts.all_parts):
            if any(not mask & remaining for mask in clauses):
                return
            # single translations are in the clauses already
            separation = self.inquiry.separate(part, remaining, stages=self.for_pairs)
            if separation.removal is None:
                return
            _add(clauses, separation)
            self._relative_motions.setdefault((part, other), separation.removal)


def blocking_clauses(blocking: Blocking, part: int) -> dict[int, Clause]:
    """Return the clauses of single translations, traced. Directions that need more parts gone are dropped early."""
    others = blocking.parts.all_parts & ~(1 << part)
    kept: dict[int, int] = {}
    masks = [blocking.masks(part, direction_index) for direction_index in range(blocking.count_directions)]
    order = sorted(range(len(masks)), key=lambda s: (masks[s][0].bit_count() + masks[s][1].bit_count(), s))
    for direction_index in order:
        blocked, unclear = blocking.masks(part, direction_index)
        for other in bits(unclear):
            if any(mask & blocked == mask for mask in kept):
                break
            if blocking.is_blocked_by(part, direction_index, other):
                blocked |= 1 << other
        for other in bits(others & ~blocked):
            if any(mask & blocked == mask for mask in kept):
                break
            if not blocking.passes(part, direction_index, other):
                blocked |= 1 << other
        if any(mask & blocked == mask for mask in kept):
            continue
        kept = {mask: by for mask, by in kept.items() if blocked & mask != blocked}
        kept[blocked] = direction_index
    return {
        mask: Clause(
            blockers=mask,
            removal=blocking.parts.straight_removal(1 << part, others & ~mask, blocking.direction(by)),
            stage="blocking",
        )
        for mask, by in kept.items()
    }


class _Reached:
    """What is gone in the sets with one part that taking the whole apart, by the clauses found so far, can leave."""

    def __init__(self, found: Sequence[Iterable[int]], part: int) -> None:
        count = len(found)
        everything = (1 << count) - 1
        system = tuple(tuple(minimal(clauses)) or (everything & ~(1 << other),) for other, clauses in enumerate(found))
        self._least = remainder(system, 1 << part)
        self._least_with = [remainder(system, 1 << part | 1 << other) for other in range(count)]
        self._part = part

    def gone_with(self, absent: int) -> int | None:
        """Return the parts that are gone wherever these are gone and the part is not; None if that is nowhere."""
        if absent & self._least:
            return None
        for other, least in enumerate(self._least_with):
            if other != self._part and absent & least:
                absent |= 1 << other
        return absent


def _add(clauses: dict[int, Clause], separation: Separation) -> None:
    assert separation.removal is not None, "a clause has a witness"
    clauses[separation.hits] = Clause(blockers=separation.hits, removal=separation.removal, stage=separation.stage)
