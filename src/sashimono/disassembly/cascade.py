"""The cascade: can this part leave the remaining ones, and by which motion?

Each stage is asked only what the one before left open. Blocking tries single translations along the
assembly's directions; then the screw of a thread that the part shares with another; then directions taken
from the part's own contacts; then several translations in a row; then pushes simulated with contact and
friction, which turn parts out too. A "no" is remembered with the parts it was found among, so that
larger sets fail free.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.disassembly.blocking.relation import Blocking, BlockingConfig
from sashimono.disassembly.blocking.shared import SharedBodies, SharedConfig
from sashimono.disassembly.conditions.clauses import Clause, RemovalConditions, minimal
from sashimono.disassembly.conditions.enumeration import Said, enumerate_clauses
from sashimono.disassembly.conditions.systems import remainder
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_path
from sashimono.disassembly.physics.search import PhysicsConfig, search_physics
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.threads.declared import DeclareConfig, DeclaredThread, declared_removal
from sashimono.disassembly.threads.surface import Threads, UnscrewConfig, search_unscrew
from sashimono.disassembly.translation.contact_normals import ContactNormals, escape_directions, immobile_margin
from sashimono.disassembly.translation.search import TranslationConfig, TranslationSearch
from sashimono.geometry.body import Body
from sashimono.plan import Answer


@dataclass(frozen=True, kw_only=True)
class SeparateConfig:
    """Budgets and tolerances of the cascade."""

    blocking: BlockingConfig = field(default_factory=BlockingConfig)
    translation: TranslationConfig = field(default_factory=TranslationConfig)
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    unscrew: UnscrewConfig = field(default_factory=UnscrewConfig)
    max_traced: int = 40_000_000
    """Tracing steps that threads and physics may take for one assembly in all, about half a minute."""
    shared: SharedConfig = field(default_factory=SharedConfig)
    declare: DeclareConfig = field(default_factory=DeclareConfig)
    contact_gap: float = 0.01
    """Surfaces nearer than this share of the smaller part's extent touch."""
    proof_gap: float = 0.0025
    """The same, where contacts are to tell which parts hold one."""
    escape_samples: int = 2000
    """Directions looked at when a way out is read off the contacts."""
    max_queries: int = 64
    """Sets of obstacles that the later stages are asked about for one part's removal conditions, the largest first:
    1, only all other parts; 0, none. Where more would have been asked, the conditions say that they were cut short."""
    max_unproven: int = 4
    """The same for sets of which neither a motion nor a proof is found: each costs a whole search."""
    max_undecided: int = 1000
    """Sets of obstacles waiting to be asked, for one part, at once; beyond, too, they are cut short."""
    proof_margin: float = 0.1
    """Sine of the angle by which every direction must run into a touching surface for a proof that the touching
    parts allow no translation to be looked for first; covers the spacing of the directions looked at."""


class Cascade:
    """Answers separation questions about one assembly, faster where it found something before.

    Threads and physics share one budget of tracing steps: of questions that need them, late ones may end UNKNOWN
    for those asked before. The same questions in the same order have the same answers.
    """

    def __init__(self, assembly: Assembly, bodies: Mapping[str, Body], *, config: SeparateConfig) -> None:
        self.assembly = assembly
        self.config = config
        self.blocking = Blocking(assembly, bodies, config=config.blocking)
        self._contacts = ContactNormals(self.blocking, gap=config.proof_gap)
        self._touching = ContactNormals(self.blocking, gap=config.contact_gap)
        self.translations = TranslationSearch(self.blocking, config=config.translation)
        self.threads = Threads(self.blocking, config=config.unscrew)
        self.traced = 0
        """Tracing steps that threads and physics took so far."""
        self.shared = SharedBodies(self.blocking, config=config.shared)
        self._held: dict[int, list[int]] = {}
        self._failed: dict[int, list[tuple[int, int, Separation]]] = {}
        self._found: dict[int, list[Separation]] = {}
        self._turned: dict[tuple[int, int], Removal] = {}
        self._resting: dict[int, list[tuple[int, Separation]]] = {}
        self._declared: dict[tuple[int, int, tuple[float, ...]], tuple[Removal, DeclaredThread] | None] = {}

    def single(
        self,
        part: int,
        remaining: int,
        *,
        preference: Callable[[Float[np.ndarray, "3"]], float],
        banned: frozenset[tuple[int, int]] = frozenset(),
        among: Collection[int] | None = None,
    ) -> Separation | None:
        """Return a removal by one translation along a direction of the relation, the most preferred; or None.

        ``among``: the signed directions that are asked for; all if None.
        """
        others = remaining & ~(1 << part)
        table = self.blocking
        asked = range(table.count_signed) if among is None else among
        order = sorted(asked, key=lambda s: (-round(preference(table.direction(s)), 6), s))
        for signed in order:
            if (1 << part, signed) not in banned and table.is_free(part, signed, others):
                return self._straight(part, others, table.direction(signed), signed=signed, stage="blocking")
        return None

    def turned(self, part: int, remaining: int, separation: Separation) -> Separation:
        """Return a separation by one translation as one by a declared thread, where the part has one; else as it is."""
        if not self.config.declare.enabled or separation.removal is None:
            return separation
        others = remaining & ~(1 << part)
        key = (part, others, tuple(separation.removal.exit_direction.tolist()))
        if key not in self._declared:
            self._declared[key] = declared_removal(
                self.shared, self.threads, part, bits(others), separation.removal, config=self.config.declare
            )
        found = self._declared[key]
        if found is None:
            return separation
        return replace(separation, removal=found[0], declared=found[1], stage="declared thread")

    def unscrewed(self, part: int, remaining: int) -> Separation:
        """Return the removal by the screw of a thread that the part shares with another, if that frees it."""
        others = remaining & ~(1 << part)
        for separation in self._found.get(part, []):
            if separation.stage == "thread" and not separation.hits & others:
                return separation
        if not any(held & ~others == 0 for held in self._held.get(part, [])):
            left = max(0, self.config.max_traced - self.traced)
            removal, traced = search_unscrew(self.threads, part, bits(others), max_traced=left)
            self.traced += traced
            if removal is not None:
                return self._remembered(part, others, removal, stage="thread")
            if traced >= left:
                reason = f"threads ended where the assembly's {self.config.max_traced} tracing steps were spent"
                return Separation(answer=Answer.UNKNOWN, stage="thread", reason=reason)
            self._held.setdefault(part, []).append(others)
        return Separation(answer=Answer.UNKNOWN, stage="thread", reason="no thread found that it leaves by")

    def further(self, part: int, remaining: int) -> Separation:
        """Return what the later stages say of a part that no direction of the relation frees.

        A motion found is remembered with the parts that it would hit, a failure with those that caused
        it: other sets are answered from there.
        """
        others = remaining & ~(1 << part)
        for separation in self._found.get(part, []):
            if not separation.hits & others:
                return separation
        for cause, known, separation in self._failed.get(part, []):
            if cause & ~others == 0 and (separation.answer is Answer.PROVEN_BLOCKED or others & ~known == 0):
                return separation
        separation = self._ask_further(part, others)
        if separation.removal is not None:
            absent = bits(self.blocking.all_parts & ~others & ~(1 << part))
            separation = replace(separation, hits=self.translations.hit_by(part, separation.removal, absent))
            self._found.setdefault(part, []).append(separation)
        else:
            cause = sum(1 << k for k in separation.blocked_by)
            self._failed.setdefault(part, []).append((cause, others, separation))
        return separation

    def pushed(self, part: int, remaining: int) -> Separation:
        """Return what physics says of a part that no translation frees; where it finds nothing, both reasons."""
        others = remaining & ~(1 << part)
        known = self.unscrewed(part, remaining)
        if known.answer is Answer.FREE:
            return known
        known = self.further(part, remaining)
        if known.answer is Answer.FREE:
            return known
        for stuck, separation in self._resting.get(part, []):
            if stuck & ~others == 0:
                return separation
        left = max(0, self.config.max_traced - self.traced)
        config = replace(self.config.physics, max_traced=min(left, self.config.physics.max_traced))
        found = search_physics(self.blocking, part, bits(others), config=config)
        self.traced += found.traced
        if found.removal is not None:
            return self._remembered(part, others, found.removal, stage="physics")
        reason = found.reason
        if found.traced >= left:
            reason = f"physics ended where the assembly's {self.config.max_traced} tracing steps were spent"
        blocked_by = known.blocked_by or found.blocked_by
        separation = replace(known, blocked_by=blocked_by, reason=f"{known.reason}; {reason}")
        self._resting.setdefault(part, []).append((others, separation))
        return separation

    def _remembered(self, part: int, others: int, removal: Removal, *, stage: str) -> Separation:
        """A motion that frees a part, with those of the absent parts that it would hit; kept for other sets."""
        absent = bits(self.blocking.all_parts & ~others & ~(1 << part))
        hits = hit_by_path(self.blocking, part, removal, absent, tolerance=self.config.physics.tolerance)
        separation = Separation(answer=Answer.FREE, removal=removal, hits=hits, stage=stage)
        self._found.setdefault(part, []).append(separation)
        return separation

    def touching(self, part: int) -> int:
        """Return the mask of the parts that touch this one in the assembled pose."""
        mask = 0
        for other in range(len(self.blocking)):
            if other != part and (self.blocking.allowances[part, other] > 0.0 or self._touching.touch(part, other)):
                mask |= 1 << other
        return mask

    def conditions(self, *, reachable_only: bool = False) -> RemovalConditions:
        """Return every part's removal conditions, each clause with its witness.

        Single translations first. Then the later stages are asked of the largest sets that neither a clause nor a
        proof decides (at most ``max_queries`` a part). A part that another one holds by itself, whatever else is
        gone, may turn its way out: physics is asked of such a pair. With ``reachable_only``, only sets that taking
        the whole apart can leave are asked about: orders and next parts are as exact, for a fraction of the work.
        """
        parts = range(len(self.blocking))
        found = [self._single_clauses(part) for part in parts]
        while True:
            known = [frozenset(minimal(clauses)) for clauses in found]
            complete = [self._complete(part, found, reachable_only=reachable_only) for part in parts]
            # a clause found late makes more sets reachable: ask again, what was said is remembered
            if not reachable_only or known == [frozenset(minimal(clauses)) for clauses in found]:
                break
        return RemovalConditions(
            names=self.assembly.names,
            clauses=tuple(tuple(clauses[mask] for mask in minimal(clauses)) for clauses in found),
            cut_short=tuple(part for part in parts if not complete[part]),
            reachable_only=reachable_only,
        )

    def _complete(self, part: int, found: list[dict[int, Clause]], *, reachable_only: bool) -> bool:
        """Add the clauses of the later stages to a part's; return whether these are all, provably, by translations."""
        clauses = found[part]

        def ask(others: int) -> Said:
            separation = self.further(part, others | 1 << part)
            if separation.removal is not None:
                _add(clauses, separation)
                return Said(clause=separation.hits)
            core = sum(1 << k for k in separation.blocked_by)
            return Said(core=core, is_proven=separation.answer is Answer.PROVEN_BLOCKED)

        config = self.config
        everything = self.blocking.all_parts & ~(1 << part)
        enumerated = enumerate_clauses(
            everything,
            clauses,
            ask,
            gone_with=_Reached(found, part).gone_with if reachable_only else lambda absent: absent,
            max_queries=config.max_queries,
            max_unproven=config.max_unproven,
            max_undecided=config.max_undecided,
        )
        for core in enumerated.cores:
            if core.bit_count() == 1:
                self._turn_out(part, core, clauses)
        return enumerated.is_complete

    def _turn_out(self, part: int, holder: int, clauses: dict[int, Clause]) -> None:
        """Add the clauses by which physics frees a part from one that holds it: of both alone, then of all parts."""
        other = holder.bit_length() - 1
        if (other, part) in self._turned:  # the two come apart by one relative motion, whichever moves
            self._remembered(part, holder, self._turned[other, part].of_the_other(), stage="physics")
        for remaining in (holder | 1 << part, self.blocking.all_parts):
            if any(not mask & remaining for mask in clauses):
                return
            separation = self.pushed(part, remaining)
            if separation.removal is None:
                return
            _add(clauses, separation)
            self._turned.setdefault((part, other), separation.removal)

    def _single_clauses(self, part: int) -> dict[int, Clause]:
        """Blocker masks over all signed directions, traced ones only, dominated ones dropped early."""
        table = self.blocking
        others = table.all_parts & ~(1 << part)
        kept: dict[int, int] = {}
        masks = [table.masks(part, signed) for signed in range(table.count_signed)]
        order = sorted(range(len(masks)), key=lambda s: (masks[s][0].bit_count() + masks[s][1].bit_count(), s))
        for signed in order:
            blocked, unclear = table.masks(part, signed)
            for other in bits(unclear):
                if any(mask & blocked == mask for mask in kept):
                    break
                if table.is_blocked_by(part, signed, other):
                    blocked |= 1 << other
            for other in bits(others & ~blocked):
                if any(mask & blocked == mask for mask in kept):
                    break
                if not table.passes(part, signed, other):
                    blocked |= 1 << other
            if any(mask & blocked == mask for mask in kept):
                continue
            kept = {mask: by for mask, by in kept.items() if blocked & mask != blocked}
            kept[blocked] = signed
        return {
            mask: Clause(
                blockers=mask, removal=self.straight(part, others & ~mask, table.direction(by)), stage="blocking"
            )
            for mask, by in kept.items()
        }

    def _ask_further(self, part: int, others: int) -> Separation:
        table, config = self.blocking, self.config
        contacts = self._contacts.of(part, others, samples=config.escape_samples)
        directions, margin = escape_directions(contacts, samples=config.escape_samples)
        for direction in directions:
            if all(np.isinf(table.travel(part, np.zeros(3), direction, other)) for other in bits(others)):
                return self._straight(part, others, direction, signed=None, stage="contacts")
        if margin < -config.proof_margin:
            # a ridge lower than the tolerance touches too: this is a hint where a proof is to be had
            needed = immobile_margin(contacts, margin=config.proof_margin)
            caged = self.translations.caged(part, needed)
            if caged.proven:
                return Separation(
                    answer=Answer.PROVEN_BLOCKED, stage="contacts", blocked_by=caged.blocked_by, reason=caged.reason
                )
        found = self.translations.search(part, bits(others))
        if found.removal is not None:
            return Separation(answer=Answer.FREE, removal=found.removal, stage="translation")
        return Separation(
            answer=Answer.PROVEN_BLOCKED if found.proven else Answer.UNKNOWN,
            stage="translation",
            blocked_by=found.blocked_by,
            reason=found.reason,
        )

    def straight(self, part: int, others: int, direction: Float[np.ndarray, "3"]) -> Removal:
        """Return the translation along a direction that takes the part's box past those of the others."""
        table = self.blocking
        back = table.world_bounds_along(part, direction)[0]
        front = max((table.world_bounds_along(k, direction)[1] for k in bits(others)), default=back)
        clearance = 0.05 * table.sizes[part]
        return Removal.straight(direction, max(front - back, 0.0) + clearance)

    def _straight(
        self, part: int, others: int, direction: Float[np.ndarray, "3"], *, signed: int | None, stage: str
    ) -> Separation:
        removal = self.straight(part, others, direction)
        return Separation(answer=Answer.FREE, removal=removal, signed=signed, stage=stage)


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
