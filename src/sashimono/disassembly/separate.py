"""The cascade: can this part leave the remaining ones, and by which motion?

Each stage is asked only what the one before left open. Blocking tries single translations along the
assembly's directions; then the screw of a thread that the part shares with another; then directions
taken from the part's own contacts; then several translations in a row; then pushes simulated with
contact and friction, which turn parts out too. A "no" is remembered with the parts it was found
among, so that larger sets fail free.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.disassembly.blocking import Blocking, BlockingConfig, bits
from sashimono.disassembly.clauses import Clause, RemovalConditions, minimal
from sashimono.disassembly.contacts import ContactNormals, escape_directions, immobile_margin
from sashimono.disassembly.physics import PhysicsConfig, search_physics
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.translation import TranslationConfig, TranslationSearch
from sashimono.disassembly.unscrew import Threads, UnscrewConfig, search_unscrew
from sashimono.geometry.body import Body
from sashimono.plan import Answer


@dataclass(frozen=True, kw_only=True)
class SeparateConfig:
    """Budgets and tolerances of the cascade."""

    blocking: BlockingConfig = field(default_factory=BlockingConfig)
    translation: TranslationConfig = field(default_factory=TranslationConfig)
    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    unscrew: UnscrewConfig = field(default_factory=UnscrewConfig)
    contact_gap: float = 0.01
    """Surfaces nearer than this share of the smaller part's extent touch."""
    proof_gap: float = 0.0025
    """The same, where contacts are to prove that a part is held."""
    escape_samples: int = 2000
    """Directions looked at when a way out is read off the contacts."""
    max_queries: int = 1
    """Sets of obstacles that the later stages are asked about for one part's removal conditions, the largest first:
    1, only all other parts; 0, none. Where more would have been asked, the conditions say that they were cut short."""
    proof_margin: float = 0.1
    """Sine of the angle by which every direction must run into a touching surface to prove that no
    translation exists; covers the spacing of the directions looked at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Separation:
    """What is known about one part among the remaining ones."""

    answer: Answer
    removal: Removal | None = None
    """The witness, where the answer is FREE."""
    signed: int | None = None
    """Its direction in the blocking relation, where it is one of them."""
    stage: str = ""
    """The stage that answered."""
    blocked_by: tuple[int, ...] = ()
    """Parts met, where the answer is not FREE."""
    reason: str = ""


class Cascade:
    """Answers separation questions about one assembly; what it found before only makes it faster."""

    def __init__(self, assembly: Assembly, bodies: Mapping[str, Body], *, config: SeparateConfig) -> None:
        self.assembly = assembly
        self.config = config
        self.blocking = Blocking(assembly, bodies, config=config.blocking)
        self._contacts = ContactNormals(self.blocking, gap=config.proof_gap)
        self._touching = ContactNormals(self.blocking, gap=config.contact_gap)
        self.translations = TranslationSearch(self.blocking, config=config.translation)
        self.threads = Threads(self.blocking, config=config.unscrew)
        self._held: dict[int, list[int]] = {}
        self._failed: dict[int, list[tuple[int, int, Separation]]] = {}
        self._found: dict[int, list[tuple[int, Separation]]] = {}
        self._resting: dict[int, list[tuple[int, Separation]]] = {}

    def single(
        self,
        part: int,
        remaining: int,
        *,
        preference: Callable[[Float[np.ndarray, "3"]], float],
        banned: frozenset[tuple[int, int]] = frozenset(),
    ) -> Separation | None:
        """Return a removal by one translation along a direction of the relation, the most preferred; or None."""
        others = remaining & ~(1 << part)
        table = self.blocking
        order = sorted(range(table.count_signed), key=lambda s: (-round(preference(table.direction(s)), 6), s))
        for signed in order:
            if (1 << part, signed) not in banned and table.is_free(part, signed, others):
                return self._straight(part, others, table.direction(signed), signed=signed, stage="blocking")
        return None

    def unscrewed(self, part: int, remaining: int) -> Separation:
        """Return the removal by the screw of a thread that the part shares with another, if that frees it."""
        others = remaining & ~(1 << part)
        for blockers, separation in self._found.get(part, []):
            if separation.stage == "thread" and not blockers & others:
                return separation
        if not any(held & ~others == 0 for held in self._held.get(part, [])):
            removal = search_unscrew(self.threads, part, bits(others))
            if removal is not None:
                separation = Separation(answer=Answer.FREE, removal=removal, stage="thread")
                absent = self.blocking.all_parts & ~others & ~(1 << part)  # any of these may be in its way
                self._found.setdefault(part, []).append((absent, separation))
                return separation
            self._held.setdefault(part, []).append(others)
        return Separation(answer=Answer.UNKNOWN, stage="thread", reason="no thread found that it leaves by")

    def further(self, part: int, remaining: int) -> Separation:
        """Return what the later stages say of a part that no direction of the relation frees.

        A motion found is remembered with the parts that it would hit, a failure with those that caused
        it: other sets are answered from there.
        """
        others = remaining & ~(1 << part)
        for blockers, separation in self._found.get(part, []):
            if not blockers & others:
                return separation
        for cause, known, separation in self._failed.get(part, []):
            if cause & ~others == 0 and (separation.answer is Answer.PROVEN_BLOCKED or others & ~known == 0):
                return separation
        separation = self._ask_further(part, others)
        if separation.removal is not None:
            absent = bits(self.blocking.all_parts & ~others & ~(1 << part))
            blockers = self.translations.hit_by(part, separation.removal, absent)
            self._found.setdefault(part, []).append((blockers, separation))
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
        found = search_physics(self.blocking, part, bits(others), config=self.config.physics)
        if found.removal is not None:
            separation = Separation(answer=Answer.FREE, removal=found.removal, stage="physics")
            absent = self.blocking.all_parts & ~others & ~(1 << part)  # any of these may be in its way
            self._found.setdefault(part, []).append((absent, separation))
            return separation
        blocked_by = known.blocked_by or found.blocked_by
        separation = replace(known, blocked_by=blocked_by, reason=f"{known.reason}; {found.reason}")
        self._resting.setdefault(part, []).append((others, separation))
        return separation

    def touching(self, part: int) -> int:
        """Return the mask of the parts that touch this one in the assembled pose."""
        mask = 0
        for other in range(len(self.blocking)):
            if other != part and (self.blocking.allowances[part, other] > 0.0 or self._touching.touch(part, other)):
                mask |= 1 << other
        return mask

    def conditions(self) -> RemovalConditions:
        """Return every part's removal conditions, each clause with its witness.

        Single translations first. Then the later stages are asked of the largest sets that no clause
        covers, until each is either covered or known to hold the part (at most ``max_queries`` a part).
        """
        clauses, cut_short = [], []
        for part in range(len(self.blocking)):
            witness = self._single_clauses(part)
            is_complete = self._complete(part, witness)
            if not witness and len(self.blocking) > 1:
                # nothing frees it by translations, whatever is gone: it may turn its way out
                separation = self.pushed(part, self.blocking.all_parts)
                if separation.removal is not None:
                    witness, is_complete = {0: separation.removal}, True
            if not is_complete:
                cut_short.append(part)
            clauses.append(tuple(Clause(blockers=mask, removal=witness[mask]) for mask in minimal(witness)))
        return RemovalConditions(names=self.assembly.names, clauses=tuple(clauses), cut_short=tuple(cut_short))

    def _complete(self, part: int, witness: dict[int, Removal]) -> bool:
        """Add the clauses of the later stages to a part's; return whether these are all, provably.

        For translations; not so where a set was left unasked, or asked and neither freed nor proven.

        A set that holds the part is left behind by dropping one of the parts that cause it: every set
        that does not hold the part lacks one of them, so this comes to all of them, largest first.
        """
        queries = 0
        is_proven = True
        everything = self.blocking.all_parts & ~(1 << part)
        queue = deque([everything])
        seen = {everything}
        while queue:
            others = queue.popleft()
            covering = next((mask for mask in witness if not mask & others), None)
            if covering is not None:
                continue
            if queries == self.config.max_queries:
                return False
            queries += 1
            separation = self.further(part, others | 1 << part)
            if separation.removal is not None:
                absent = bits(everything & ~others)
                witness[self.translations.hit_by(part, separation.removal, absent)] = separation.removal
                continue
            is_proven &= separation.answer is Answer.PROVEN_BLOCKED
            for cause in separation.blocked_by:
                fewer = others & ~(1 << cause)
                if fewer not in seen:
                    seen.add(fewer)
                    queue.append(fewer)
        return is_proven

    def _single_clauses(self, part: int) -> dict[int, Removal]:
        """Blocker masks over all signed directions, traced ones only, dominated ones dropped early."""
        table = self.blocking
        others = table.all_parts & ~(1 << part)
        kept: dict[int, Removal] = {}
        order = sorted(range(table.count_signed), key=lambda s: (sum(m.bit_count() for m in table.masks(part, s)), s))
        for signed in order:
            blocked = table.masks(part, signed)[0]
            for other in bits(table.masks(part, signed)[1]):
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
            kept = {mask: removal for mask, removal in kept.items() if blocked & mask != blocked}
            kept[blocked] = self.straight(part, others & ~blocked, table.direction(signed))
        return kept

    def _ask_further(self, part: int, others: int) -> Separation:
        table, config = self.blocking, self.config
        normals, touching = self._contacts.of(part, others)
        directions, margin = escape_directions(normals, samples=config.escape_samples)
        for direction in directions:
            if all(np.isinf(table.travel(part, np.zeros(3), direction, other)) for other in bits(others)):
                return self._straight(part, others, direction, signed=None, stage="contacts")
        if margin < -config.proof_margin:
            needed = immobile_margin(normals, touching, samples=config.escape_samples, margin=config.proof_margin)
            return Separation(
                answer=Answer.PROVEN_BLOCKED,
                stage="contacts",
                blocked_by=tuple(needed),
                reason="proven for translations of this part alone: every direction runs into a touching surface",
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


def names_of(assembly: Assembly, parts: Iterable[int]) -> tuple[str, ...]:
    """Return the names of parts given by position."""
    return tuple(assembly.names[k] for k in parts)
