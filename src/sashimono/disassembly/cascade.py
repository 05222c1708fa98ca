"""The cascade: can this part leave the remaining ones, and by which motion?

This is the front door of level 1. `Cascade.stages` lists the stages in their order. Each is asked only what the ones
before left open. `Cascade.separate` asks them about one part. A sequence asks each about all parts before the next.
To add a stage, write it in a file of its own (`separation.Stage`) and add a line to `Cascade.stages`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from functools import partial

from sashimono.assembly import Assembly
from sashimono.disassembly.blocking.groups import GroupStage, loose_sets
from sashimono.disassembly.blocking.relation import Blocking
from sashimono.disassembly.blocking.stage import BlockingStage
from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.conditions.find import find_conditions
from sashimono.disassembly.config import SeparateConfig
from sashimono.disassembly.inquiry import Inquiry
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_removal
from sashimono.disassembly.physics.stage import PhysicsStage
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import DeclaredThread, Separation, Stage
from sashimono.disassembly.shared_bodies import SharedBodies
from sashimono.disassembly.threads.declared import declared_removal
from sashimono.disassembly.threads.stage import ThreadStage
from sashimono.disassembly.threads.surface import Threads, search_unscrew
from sashimono.disassembly.tilting.stage import TiltStage
from sashimono.disassembly.translation.contact_normals import ContactNormals
from sashimono.disassembly.translation.search import TranslationSearch
from sashimono.disassembly.translation.simultaneous import SimultaneousGroup, find_simultaneous
from sashimono.disassembly.translation.stage import TranslationStage
from sashimono.geometry.body import Body
from sashimono.plan import Answer

__all__ = ["Cascade", "SeparateConfig"]

_Answers = dict[tuple[str, int, int], list[tuple[int, Separation]]]
"""By stage, part and remaining parts: what was said, each with the tracing steps that were given."""


class Cascade:
    """Answers separation questions about one assembly. A question that was asked before is answered faster.

    The same question has the same answer, whatever was asked before.
    """

    def __init__(
        self,
        assembly: Assembly,
        bodies: Mapping[str, Body],
        *,
        config: SeparateConfig,
        parts: PlacedParts | None = None,
    ) -> None:
        """Take in the parts and their bodies, and where they are at hand, the same parts as placed."""
        self.assembly = assembly
        self.config = config
        self.parts = parts = parts or PlacedParts(assembly, bodies, config=config.parts)
        self.blocking = Blocking(parts, config=config.blocking)
        self.shared = SharedBodies(parts, config=config.shared)
        self._threads = Threads(parts, config=config.unscrew)
        self._touching = ContactNormals(parts, gap=config.contact_gap)
        self.directions = BlockingStage(self.blocking)
        self.threads = ThreadStage(parts, self._threads)
        self.translations = TranslationStage(
            parts,
            ContactNormals(parts, gap=config.proof_gap),
            TranslationSearch(parts, config=config.translation),
            touching=self._touching,
            leaning=config.leaning,
            escape_samples=config.escape_samples,
            proof_margin=config.proof_margin,
        )
        self.groups = GroupStage(self.blocking)
        self.physics = PhysicsStage(parts, config=config.physics)
        self.tilting = TiltStage(parts, config=config.tilt)
        self.stages: tuple[Stage, ...] = (
            self.directions,
            self.threads,
            self.translations,
            self.groups,
            self.physics,
            *((self.tilting,) if config.tilting else ()),
        )
        """In the order in which they are asked: the ones that cost least first. Tilting is there if it is wanted."""
        self._answers: _Answers = {}
        self._turned: dict[tuple[int, int, tuple[float, ...]], Removal | None] = {}
        self._declared: dict[tuple[int, int, tuple[float, ...]], tuple[Removal, DeclaredThread] | None] = {}

    def with_fits(self, fits: Mapping[tuple[int, int], float]) -> Cascade:
        """Return a cascade for the same parts, of which these pairs may go so deep into each other anywhere [m]."""
        bodies = dict(zip(self.assembly.names, self.parts.bodies, strict=True))
        return Cascade(self.assembly, bodies, config=self.config, parts=self.parts.with_fits(fits))

    def separate(self, part: int, remaining: int) -> Separation:
        """Return what all stages know about a part among the remaining ones (a mask)."""
        return self.inquire().separate(part, remaining)

    def inquire(self) -> Inquiry:
        """Return a new inquiry: questions that share a budget, and what follows from their answers."""
        return self._inquiry(self._answers)

    def _inquiry(self, answers: _Answers) -> Inquiry:
        return Inquiry(self.stages, partial(self._ask, answers), max_traced=self.config.max_traced)

    def conditions(self, *, reachable_only: bool = False) -> RemovalConditions:
        """Return every part's removal conditions; see `find_conditions`.

        Tilting is not asked: its "no" proves nothing, and takes seconds for each pair that holds itself.
        """
        asked = tuple(stage for stage in self.stages if stage not in (self.directions, self.tilting))
        with self.translations.search.across_sets():
            return find_conditions(
                self.assembly.names,
                self.directions,
                self._inquiry({}),  # which of several proofs is told depends here on those before: it stays here
                translations=self.translations,
                fewer_holders=self.translations.fewer_holders,
                physics=self.physics,
                for_pairs=asked,
                config=self.config,
                reachable_only=reachable_only,
            )

    def with_thread(self, part: int, remaining: int, separation: Separation) -> Separation:
        """Return a separation by one translation as one by a thread, where the part has one; else as it is.

        Where ridges are drawn into each other, the overlap excuses a pull right through them. So whether there is a
        thread is asked of a part that overlaps another. Where none is drawn, one may be declared.
        """
        if separation.removal is None:
            return separation
        others = remaining & ~(1 << part)
        direction = separation.removal.exit_direction
        key = (part, others, tuple(direction.tolist()))
        if key not in self._turned:
            self._turned[key] = search_unscrew(
                self._threads,
                part,
                self.shared.overlapping(part, others),
                among=bits(others),
                direction=direction,
                max_traced=self.config.max_traced,
            ).removal
        turned = self._turned[key]
        if turned is not None:
            return replace(separation, removal=turned, stage=self.threads.name)
        if not self.config.declare.enabled:
            return separation
        if key not in self._declared:
            self._declared[key] = declared_removal(
                self.shared, self._threads, part, bits(others), separation.removal, config=self.config.declare
            )
        found = self._declared[key]
        if found is None:
            return separation
        return replace(separation, removal=found[0], declared=found[1], stage="declared thread")

    def loose_sets(self, remaining: int, *, stays: int) -> list[int]:
        """Return sets of the remaining parts that go a little way as one; see the function of the same name."""
        return loose_sets(self.blocking, remaining, stays=stays, config=self.config.loose)

    def find_simultaneous(
        self, remaining: int, *, stays: int, allowed: Callable[[Collection[int]], bool]
    ) -> tuple[SimultaneousGroup, ...]:
        """Return sets of the remaining parts that leave the others at once, each by a translation of its own.

        None if none are found. Asked by sequences, where nothing else is left; of no part alone this says anything.
        See the function of the same name.
        """
        config = self.config.simultaneous
        return find_simultaneous(self.parts, self._touching, remaining, stays=stays, allowed=allowed, config=config)

    def touching(self, part: int) -> int:
        """Return the mask of the parts that touch this one in the assembled pose."""
        mask = 0
        for other in range(len(self.parts)):
            if other != part and (self.parts.overlaps[part, other] > 0.0 or self._touching.touch(part, other)):
                mask |= 1 << other
        return mask

    def _ask(self, answers: _Answers, stage: Stage, part: int, remaining: int, max_traced: int) -> Separation:
        """Return what a stage knows about a part. Two parts alone come apart by one relative motion.

        So where they are alone, what frees either frees both, and what is proven of either is proven of both.
        """
        own = self._recall(answers, stage, part, remaining, max_traced)
        if own.answer is not Answer.UNKNOWN or remaining.bit_count() != 2:
            return own
        other = bits(remaining & ~(1 << part))[0]
        theirs = self._recall(answers, stage, other, remaining, max(0, max_traced - own.traced))
        traced, is_cut = own.traced + theirs.traced, own.is_cut or theirs.is_cut
        if theirs.removal is not None:
            removal = theirs.removal.of_the_other()
            hits = hit_by_removal(self.parts, part, removal, bits(self.parts.all_parts & ~remaining))
            return Separation(answer=Answer.FREE, removal=removal, hits=hits, stage=theirs.stage, traced=traced)
        if theirs.proven_for is not None:
            return replace(theirs, blocked_by=(other,), traced=traced)
        return replace(own, traced=traced, is_cut=is_cut)

    def _recall(self, answers: _Answers, stage: Stage, part: int, remaining: int, max_traced: int) -> Separation:
        """Return what a stage says; from memory where, with the steps that are left now, it would say the same."""
        known = answers.setdefault((stage.name, part, remaining), [])
        for given, said in known:
            if given == max_traced or said.traced < min(given, max_traced):
                return said
        said = stage.separate(part, remaining, max_traced=max_traced)
        known.append((max_traced, said))
        return said
