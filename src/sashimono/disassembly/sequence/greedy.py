"""A disassembly sequence: which part leaves when, and which one stays as the base.

Removal is monotone (fewer parts never block more), so no removal is ever undone. As long as some
part can leave, taking it is right. The rest is a matter of taste: small parts first, upwards,
in runs of the same direction, and so that the remaining parts hang together. Where no part leaves alone,
a subassembly leaves as one body, and is taken apart by itself: the result is a tree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.blocking.groups import find_subassembly
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.separation import UNASKED, Separation, Stage
from sashimono.disassembly.sequence.constraints import OrderConstraints, resolve
from sashimono.disassembly.sequence.cost import OrderCostConfig
from sashimono.disassembly.sequence.departures import Departure, DisassemblyResult
from sashimono.disassembly.sequence.reasons import VerdictConfig, add_reasons
from sashimono.disassembly.sequence.search_config import OrderSearchConfig
from sashimono.plan import Answer


@dataclass(frozen=True, kw_only=True)
class SequenceConfig:
    """How a part and a direction are chosen among those that are free."""

    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Preferred direction of removal, of any length but 0."""
    upward: float = 1.0
    """Worth of a removal straight up, against sideways at 0 and down at minus this."""
    same_direction: float = 0.5
    """Worth of a removal along the last one's direction."""
    connected: float = 2.0
    """Worth of a removal after which the remaining parts still hang together."""
    small_first: float = 1.0
    """Worth of the smallest part's removal, against that of the largest at 0."""
    constraints: OrderConstraints = field(default_factory=OrderConstraints)
    """The base and precedences that the user wants."""
    cost: OrderCostConfig = field(default_factory=OrderCostConfig)
    """What tells one order from a better one."""
    search: OrderSearchConfig = field(default_factory=OrderSearchConfig)
    """How many orders are looked at besides the one that is found first."""
    verdict: VerdictConfig = field(default_factory=VerdictConfig)
    """How what holds the parts that stay is put into words."""


def find_disassembly(
    cascade: Cascade,
    *,
    config: SequenceConfig,
    start: int | None = None,
    refused: frozenset[Refusal] = frozenset(),
    proposed: Sequence[int] = (),
    progress: Callable[[int], None] = lambda removed: None,
) -> DisassemblyResult:
    """Return an order in which the parts leave, as far as the cascade finds one.

    Args:
        cascade: What is asked whether a part can leave.
        config: Taste.
        start: Mask of the parts that are there; all if None.
        refused: Ways out that are not to be taken.
        proposed: Parts in the order in which they may leave, the base last, from elsewhere (a network). The first of
            them that remains is asked before all others; where it cannot leave, taste decides as ever.
        progress: Called with the number of parts that have left so far.
    """
    chooser = _Chooser(cascade, config, refused, proposed)
    return _disassemble(chooser, cascade.parts.all_parts if start is None else start, progress)


def _disassemble(chooser: _Chooser, start: int, progress: Callable[[int], None]) -> DisassemblyResult:
    remaining = start
    protected = chooser.base_among(remaining)
    removals: list[Departure] = []
    said: Mapping[int, Separation] = {}
    last: Float[np.ndarray, "3"] | None = None
    while remaining & (remaining - 1):
        choice, protected, said = chooser.next(remaining, protected, last)
        if choice is None:
            break
        removals.append(choice)
        remaining &= ~choice.members
        removal = choice.separation.removal
        last = None if removal is None else removal.exit_direction
        progress(start.bit_count() - remaining.bit_count())
    if not remaining & (remaining - 1):
        protected, said = bits(remaining)[0], {}
    stuck = [(part, known) for part, known in said.items() if part != protected]
    parts, config = chooser.cascade.parts, chooser.config.verdict
    return DisassemblyResult(
        base=protected, removals=tuple(removals), stuck=add_reasons(parts, remaining, stuck, config=config)
    )


REFUSED = Separation(
    answer=Answer.UNKNOWN,
    reason="the ways out that were found were refused later: no motion there, or refuted by the check",
)
"""What is known of a part whose motions, found by the later stages, a later level refused."""


class _Chooser:
    """Ranks what is free; holds the contact graph and the sizes."""

    def __init__(
        self, cascade: Cascade, config: SequenceConfig, refused: frozenset[Refusal], proposed: Sequence[int]
    ) -> None:
        self.cascade, self.config, self.refused, self.proposed = cascade, config, refused, proposed
        self.inquiry = cascade.inquire()
        self.later_stages = tuple(stage for stage in cascade.stages if stage is not cascade.directions)
        """Those that are asked about one part after another; single translations are ranked over all parts."""
        parts = cascade.parts
        self.volumes = np.array([body.mass_properties.volume for body in parts.bodies])
        boxes = np.ptp(parts.boxes, axis=1)
        self.bulk = np.prod(boxes + 1e-9 * boxes.max(), axis=1) + self.volumes
        rank = np.argsort(np.argsort(self.bulk, kind="stable"), kind="stable")
        self.smallness = 1.0 - rank / max(1, len(rank) - 1)
        self.neighbours = [cascade.touching(part) for part in range(len(parts))]
        self.up = np.array(config.up) / np.linalg.norm(config.up)
        self.wishes = resolve(config.constraints, cascade.assembly.names)

    def base_among(self, remaining: int) -> int:
        """The bulkiest of the best connected parts: bulk times one more than the number of touching parts.

        Where the user named one, that; where an order was proposed, its last part.
        """
        if self.wishes.base is not None and remaining >> self.wishes.base & 1:
            return self.wishes.base
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

    def leaves_by_one_translation(self, part: int, remaining: int) -> bool:
        worth = self.preference(None)
        return self.cascade.directions.along(part, remaining, preference=worth, refused=self.refused) is not None

    def next(
        self, remaining: int, protected: int, last: Float[np.ndarray, "3"] | None
    ) -> tuple[Departure | None, int, Mapping[int, Separation]]:
        """The best departure by the first stage that finds one, the base, and what is known of the parts until then.

        All parts are asked about by one stage before any is by the next, which costs more.
        """
        said: dict[int, Separation] = {}
        choice = self.next_proposed(remaining, protected, last) or self.next_by_one_translation(
            remaining, protected, last
        )
        if choice is None and protected != self.wishes.base and self.leaves_by_one_translation(protected, remaining):
            # the base itself can go: keep another one instead, the best of those that are left
            return self.next(remaining, self.base_among(remaining & ~(1 << protected)), last)
        for stage in self.later_stages:
            if choice is not None:
                break
            if stage is self.cascade.groups:
                choice = self.next_subassembly(remaining, protected)
            else:
                choice = self.next_by_stage(stage, remaining, protected, said)
        return choice, protected, said

    def next_proposed(self, remaining: int, protected: int, last: Float[np.ndarray, "3"] | None) -> Departure | None:
        """The first part of the proposed order that remains, if it can leave."""
        part = next((k for k in self.proposed if remaining >> k & 1 and k != protected), None)
        if part is None or self.wishes.holds_back(part, remaining):
            return None
        worth = self.preference(last)
        separation = self.cascade.directions.along(part, remaining, preference=worth, refused=self.refused)
        before_groups = takewhile(lambda stage: stage is not self.cascade.groups, self.later_stages)
        for stage in before_groups:
            if separation is None and not self._is_refused(part, remaining):
                found = self.inquiry.ask(stage, part, remaining)
                separation = found if found.answer is Answer.FREE else None
        return None if separation is None else Departure(part=part, members=1 << part, separation=separation)

    def _is_refused(self, part: int, remaining: int) -> bool:
        """Whether what the later stages found for a part was refused."""
        return is_refused(self.refused, 1 << part, None, remaining & ~(1 << part))

    def next_by_one_translation(
        self, remaining: int, protected: int, last: Float[np.ndarray, "3"] | None
    ) -> Departure | None:
        """The best part and direction of those that one translation frees, by what tracing says of them.

        Parts that leave without ploughing through what they overlap go first, and in such a direction. Candidates that
        the maps leave open are traced, the best first, until one passes.
        """
        blocking, worth = self.cascade.blocking, self.preference(last)
        worths = [worth(blocking.direction(direction_index)) for direction_index in range(blocking.count_directions)]
        ranked = []
        for part in bits(remaining & ~(1 << protected)):
            if self.wishes.holds_back(part, remaining):
                continue
            others = remaining & ~(1 << part)
            open_ways = [s for s in range(blocking.count_directions) if not blocking.masks(part, s)[0] & others]
            rest = self.config.small_first * self.smallness[part] + self.config.connected * self.connected(others)
            for ploughs, direction_index in self._by_ploughing(part, others, open_ways):
                ranked += [(ploughs, -round(worths[s] + rest, 6), part, s) for s in direction_index]
        for _, _, part, direction_index in sorted(ranked):
            separation = self.cascade.directions.along(
                part, remaining, preference=worth, refused=self.refused, among=(direction_index,)
            )
            if separation is not None:
                others = remaining & ~(1 << part)
                if not is_refused(self.refused, 1 << part, direction_index, others, only_turned=True):
                    separation = self.cascade.with_declared_thread(part, remaining, separation)
                return Departure(part=part, members=1 << part, separation=separation)
        return None

    def _by_ploughing(self, part: int, others: int, open_ways: list[int]) -> Iterator[tuple[bool, list[int]]]:
        """Yield the open directions that do not plough through what the part overlaps, then those that do."""
        blocking, shared = self.cascade.blocking, self.cascade.shared
        overlapped = shared.overlapping(part, bits(others))
        through = {s: bool(overlapped) and shared.ploughs(part, overlapped, blocking.direction(s)) for s in open_ways}
        for ploughs in (False, True):
            yield ploughs, [s for s in open_ways if through[s] == ploughs]

    def next_by_stage(
        self, stage: Stage, remaining: int, protected: int, said: dict[int, Separation]
    ) -> Departure | None:
        """A part that a later stage frees, the protected one last; else None, and ``said`` knows more of every part."""
        for part in sorted(bits(remaining), key=lambda k: (k == protected, self.bulk[k], k)):
            if self._is_refused(part, remaining):
                said[part] = REFUSED
                continue
            if part == self.wishes.base:
                continue
            if waits := self.wishes.holds_back(part, remaining):
                said[part] = self._waiting(bits(waits))
                continue
            known = said.get(part, UNASKED)
            if known.proven_for is stage.motions:
                continue
            separation = self.inquiry.ask(stage, part, remaining)
            if separation.answer is Answer.FREE:
                return Departure(part=part, members=1 << part, separation=separation)
            said[part] = known.and_then(separation)
        return None

    def _waiting(self, first: Sequence[int]) -> Separation:
        """What is said of a part that the user's precedence keeps, while the parts it waits for cannot leave."""
        names = ", ".join(self.cascade.assembly.names[k] for k in first)
        return Separation(
            answer=Answer.UNKNOWN,
            blocked_by=tuple(first),
            reason=f"--before has it placed earlier than {names}, and what is to leave first cannot",
        )

    def next_subassembly(self, remaining: int, protected: int) -> Departure | None:
        """The best set of parts that leaves as one body, with how it comes apart by itself."""
        blocking = self.cascade.blocking
        found = find_subassembly(
            blocking,
            remaining,
            stays=protected,
            worth=self.preference(None),
            connected=self.connected,
            refused=self.refused,
        )
        if found is None or any(
            self.wishes.holds_back(part, remaining & ~found.members) for part in bits(found.members)
        ):
            return None
        inside = _disassemble(self, found.members, lambda removed: None)
        separation = Separation(
            answer=Answer.FREE, removal=found.removal, direction_index=found.direction_index, stage="subassembly"
        )
        return Departure(part=inside.base, members=found.members, separation=separation, inside=inside)
