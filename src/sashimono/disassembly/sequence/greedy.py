"""A disassembly sequence: which part leaves when, and which one stays as the base.

Removal is monotone (fewer parts never block more), so no removal is ever undone: as long as some
part can leave, taking it is right. What is left to choose is taste: small parts first, upwards,
in runs of the same direction, and so that what remains hangs together. Where no part leaves alone,
a subassembly leaves as one body, and is taken apart by itself: the result is a tree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.sequence.reasons import VerdictConfig, worded
from sashimono.disassembly.sequence.subassembly import find_subassembly
from sashimono.plan import Answer

Ban = tuple[int, int]
"""Parts that leave together (a mask) and a signed direction that later levels refused; -1: any motion that is not
one of them; -2 - s: a declared thread along s, but not the straight pull."""


@dataclass(frozen=True, kw_only=True)
class SequenceConfig:
    """How a part and a direction are chosen among those that are free."""

    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Preferred direction of removal."""
    upward: float = 1.0
    """Worth of a removal straight up, against sideways at 0 and down at minus this."""
    same_direction: float = 0.5
    """Worth of a removal along the last one's direction."""
    connected: float = 2.0
    """Worth of a removal after which the remaining parts still hang together."""
    small_first: float = 1.0
    """Worth of the smallest part's removal, against that of the largest at 0."""
    verdict: VerdictConfig = field(default_factory=VerdictConfig)
    """How what holds the parts that stay is put into words."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Departure:
    """One part, or several that move as one body, leaving those that remain."""

    part: int
    """The part, or the one of them that stays when they are taken apart; its name stands for all."""
    members: int
    """Mask of all that move."""
    separation: Separation
    """With the witness."""
    inside: DisassemblyResult | None = None
    """How a subassembly comes apart by itself; None for a single part."""

    @property
    def ban(self) -> Ban:
        """What is to be refused if this departure does not hold."""
        return (self.members, -1 if self.separation.signed is None else self.separation.signed)

    @property
    def path_ban(self) -> Ban:
        """What is to be refused if its path does not hold: of a declared thread the turn, but not the straight pull."""
        if self.separation.declared is None or self.separation.signed is None:
            return self.ban
        return (self.members, -2 - self.separation.signed)


@dataclass(frozen=True, kw_only=True, eq=False)
class DisassemblyResult:
    """How far the parts came apart."""

    base: int
    """The part that stays."""
    removals: tuple[Departure, ...]
    """What leaves, in order."""
    stuck: tuple[tuple[int, Separation], ...]
    """Parts that could not leave, the base and what is inside subassemblies aside, each with what is known."""

    def departures(self) -> Iterator[Departure]:
        """Yield every departure, those inside subassemblies included."""
        for departure in self.removals:
            yield departure
            if departure.inside is not None:
                yield from departure.inside.departures()


def find_disassembly(
    cascade: Cascade,
    *,
    config: SequenceConfig,
    start: int | None = None,
    banned: frozenset[Ban] = frozenset(),
    proposed: Sequence[int] = (),
    progress: Callable[[int], None] = lambda removed: None,
) -> DisassemblyResult:
    """Return an order in which the parts leave, as far as the cascade finds one.

    Args:
        cascade: What is asked whether a part can leave.
        config: Taste.
        start: Mask of the parts that are there; all if None.
        banned: Departures that are not to be taken.
        proposed: Parts in the order in which they may leave, the base last, from elsewhere (a network). The first of
            them that remains is asked before all others; where it cannot leave, taste decides as ever.
        progress: Called with the number of parts that have left so far.
    """
    return _disassemble(
        _Chooser(cascade, config, banned, proposed), cascade.blocking.all_parts if start is None else start, progress
    )


def _disassemble(chooser: _Chooser, start: int, progress: Callable[[int], None]) -> DisassemblyResult:
    remaining = start
    protected = chooser.base_among(remaining)
    removals: list[Departure] = []
    stuck: list[tuple[int, Separation]] = []
    last: Float[np.ndarray, "3"] | None = None
    while remaining & (remaining - 1):
        choice = chooser.next_proposed(remaining, protected, last)
        if choice is None:
            choice = chooser.next_single(remaining, protected, last)
        if choice is None and chooser.single_free(protected, remaining):
            # the base itself can go: keep another one instead, the best of those that are left
            protected = chooser.base_among(remaining & ~(1 << protected))
            continue
        # threads, translations of all parts, then of groups, come before physics of any: they cost less
        if choice is None:
            choice, _ = chooser.next_further(remaining, protected, chooser.cascade.unscrewed)
        if choice is None:
            choice, stuck = chooser.next_further(remaining, protected, chooser.cascade.further)
        if choice is None:
            choice = chooser.next_subassembly(remaining, protected)
        if choice is None:
            choice, stuck = chooser.next_further(remaining, protected, chooser.cascade.pushed)
        if choice is None:
            break
        stuck = []
        removals.append(choice)
        remaining &= ~choice.members
        removal = choice.separation.removal
        last = None if removal is None else removal.exit_direction
        progress(start.bit_count() - remaining.bit_count())
    if not remaining & (remaining - 1):
        protected = bits(remaining)[0]
    stuck = [entry for entry in stuck if entry[0] != protected]
    table, config = chooser.cascade.blocking, chooser.config.verdict
    return DisassemblyResult(
        base=protected, removals=tuple(removals), stuck=worded(table, remaining, stuck, config=config)
    )


REFUSED = Separation(
    answer=Answer.UNKNOWN,
    reason="the ways out that were found were refused later: no motion there, or refuted by the check",
)
"""What is said of a part of which later levels refused what the later stages found."""


class _Chooser:
    """Ranks what is free; holds the contact graph and the sizes."""

    def __init__(
        self, cascade: Cascade, config: SequenceConfig, banned: frozenset[Ban], proposed: Sequence[int]
    ) -> None:
        self.cascade, self.config, self.banned, self.proposed = cascade, config, banned, proposed
        table = cascade.blocking
        self.volumes = np.array([body.mass_properties.volume for body in table.bodies])
        boxes = np.array([np.ptp(part.bounds_world, axis=0) for part in cascade.assembly.parts])
        self.bulk = np.prod(boxes + 1e-9 * boxes.max(), axis=1) + self.volumes
        rank = np.argsort(np.argsort(self.bulk, kind="stable"), kind="stable")
        self.smallness = 1.0 - rank / max(1, len(rank) - 1)
        self.neighbours = [cascade.touching(part) for part in range(len(table))]
        self.up = np.array(config.up)

    def base_among(self, remaining: int) -> int:
        """The bulkiest of the best connected parts: bulk times one more than the number of touching parts.

        Where an order was proposed, its last part.
        """
        for part in reversed(self.proposed):
            if remaining >> part & 1:
                return part
        parts = bits(remaining)
        scores = [self.bulk[k] * (1 + self.neighbours[k].bit_count()) for k in parts]
        return parts[int(np.argmax(np.round(np.array(scores) / max(scores), 9)))]

    def connected(self, remaining: int) -> bool:
        seen = frontier = remaining & -remaining
        while frontier:
            reached = 0
            for part in bits(frontier):
                reached |= self.neighbours[part]
            frontier = reached & remaining & ~seen
            seen |= frontier
        return seen == remaining

    def preference(self, last: Float[np.ndarray, "3"] | None) -> Callable[[Float[np.ndarray, "3"]], float]:
        def worth(direction: Float[np.ndarray, "3"]) -> float:
            same = 0.0 if last is None else self.config.same_direction * float(direction @ last > 0.9999)
            return self.config.upward * float(direction @ self.up) + same

        return worth

    def single_free(self, part: int, remaining: int) -> bool:
        worth = self.preference(None)
        return self.cascade.single(part, remaining, preference=worth, banned=self.banned) is not None

    def next_proposed(self, remaining: int, protected: int, last: Float[np.ndarray, "3"] | None) -> Departure | None:
        """The first part of the proposed order that remains, if it can leave."""
        part = next((k for k in self.proposed if remaining >> k & 1 and k != protected), None)
        if part is None:
            return None
        worth = self.preference(last)
        separation = self.cascade.single(part, remaining, preference=worth, banned=self.banned)
        for ask in (self.cascade.unscrewed, self.cascade.further):
            if separation is None and (1 << part, -1) not in self.banned:
                found = ask(part, remaining)
                separation = found if found.answer is Answer.FREE else None
        return None if separation is None else Departure(part=part, members=1 << part, separation=separation)

    def next_single(self, remaining: int, protected: int, last: Float[np.ndarray, "3"] | None) -> Departure | None:
        """The best part that one translation frees; the maps rank, tracing decides.

        Who can leave without ploughing through what he overlaps goes first, and that way.
        """
        table, worth = self.cascade.blocking, self.preference(last)
        worths = [worth(table.direction(signed)) for signed in range(table.count_signed)]
        ranked = []
        for part in bits(remaining & ~(1 << protected)):
            others = remaining & ~(1 << part)
            free = [
                s
                for s in range(table.count_signed)
                if (1 << part, s) not in self.banned and not table.masks(part, s)[0] & others
            ]
            rest = self.config.small_first * self.smallness[part] + self.config.connected * self.connected(others)
            for ploughs, signed in self._by_ploughing(part, others, free):
                ranked.append((ploughs, -round(max(worths[s] for s in signed) + rest, 6), part, signed))
        for _, _, part, signed in sorted(ranked):
            separation = self.cascade.single(part, remaining, preference=worth, banned=self.banned, among=signed)
            if separation is not None:
                if (1 << part, -2 - (separation.signed or 0)) not in self.banned:
                    separation = self.cascade.turned(part, remaining, separation)
                return Departure(part=part, members=1 << part, separation=separation)
        return None

    def _by_ploughing(self, part: int, others: int, free: list[int]) -> Iterator[tuple[bool, list[int]]]:
        """Yield the free directions that do not plough through what the part overlaps, then those that do."""
        table, shared = self.cascade.blocking, self.cascade.shared
        overlapped = shared.overlapping(part, bits(others))
        through = {s: bool(overlapped) and shared.ploughs(part, overlapped, table.direction(s)) for s in free}
        for ploughs in (False, True):
            signed = [s for s in free if through[s] == ploughs]
            if signed:
                yield ploughs, signed

    def next_further(
        self, remaining: int, protected: int, ask: Callable[[int, int], Separation]
    ) -> tuple[Departure | None, list[tuple[int, Separation]]]:
        """A part that a later stage frees, the protected one last; else what it says of every part."""
        said: list[tuple[int, Separation]] = []
        parts = sorted(bits(remaining), key=lambda k: (k == protected, self.bulk[k], k))
        for part in parts:
            if (1 << part, -1) in self.banned:
                said.append((part, REFUSED))
                continue
            separation = ask(part, remaining)
            if separation.answer is Answer.FREE:
                return Departure(part=part, members=1 << part, separation=separation), []
            said.append((part, separation))
        return None, said

    def next_subassembly(self, remaining: int, protected: int) -> Departure | None:
        """The best set of parts that leaves as one body, with how it comes apart by itself."""
        table = self.cascade.blocking
        found = find_subassembly(
            table,
            remaining,
            stays=protected,
            worth=self.preference(None),
            connected=self.connected,
            banned=self.banned,
        )
        if found is None:
            return None
        inside = _disassemble(self, found.members, lambda removed: None)
        separation = Separation(answer=Answer.FREE, removal=found.removal, signed=found.signed, stage="subassembly")
        return Departure(part=inside.base, members=found.members, separation=separation, inside=inside)
