"""A disassembly sequence: which part leaves when, and which one stays as the base.

Removal is monotone (fewer parts never block more), so no removal is ever undone. As long as some
part can leave, taking it is right. The rest is a matter of taste: small parts first, upwards,
in runs of the same direction, and so that the remaining parts hang together. Where no part leaves alone,
a subassembly leaves as one body, and is taken apart by itself: the result is a tree. It goes straight out, or where
that fails, by several translations. Where none of these is found, several parts or subassemblies leave at once, each by
a translation of its own.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import takewhile

import numpy as np
from jaxtyping import Float

from sashimono.assembly import few_words
from sashimono.disassembly.blocking.groups import find_subassembly
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits, reached
from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import UNASKED, Separation, Stage
from sashimono.disassembly.sequence.as_one import BodiesAsOne
from sashimono.disassembly.sequence.constraints import OrderConstraints, resolve
from sashimono.disassembly.sequence.cost import OrderCostConfig
from sashimono.disassembly.sequence.departures import Departure, DisassemblyResult, HeldProduct
from sashimono.disassembly.sequence.products import ProductConfig, ProductGroup, whole_groups
from sashimono.disassembly.sequence.reasons import VerdictConfig, add_reasons
from sashimono.disassembly.sequence.search_config import OrderSearchConfig
from sashimono.disassembly.translation.simultaneous import SimultaneousGroup
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
    products: ProductConfig = field(default_factory=ProductConfig)
    """How the file's product tree is used."""
    verdict: VerdictConfig = field(default_factory=VerdictConfig)
    """How what holds the parts that stay is put into words."""


def find_disassembly(
    cascade: Cascade,
    *,
    config: SequenceConfig,
    start: int | None = None,
    refused: frozenset[Refusal] = frozenset(),
    proposed: Sequence[int] = (),
    products: Sequence[ProductGroup] = (),
    patient: int | None = None,
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
        products: Sets of parts that leave as one, the outer ones first. One that cannot is left with all its parts.
        patient: Mask of the parts of which physics and tilting are asked; all if None.
        progress: Called with the number of parts that have left so far.
    """
    chooser = _Chooser(cascade, config, refused, proposed, products, patient)
    return _disassemble(chooser, cascade.parts.all_parts if start is None else start, progress)


def _disassemble(chooser: _Chooser, start: int, progress: Callable[[int], None]) -> DisassemblyResult:
    remaining = start
    protected = chooser.base_among(remaining)
    removals: list[Departure] = []
    said: Mapping[int, Separation] = {}
    last: Float[np.ndarray, "3"] | None = None
    while remaining & (remaining - 1):
        choice, protected, said = chooser.next(remaining, protected, last)
        leaving = chooser.simultaneous(remaining, protected) if choice is None else (choice,)
        if not leaving:
            break
        removals += leaving
        for departure in leaving:
            remaining &= ~departure.members
        removal = leaving[-1].separation.removal
        last = None if removal is None else removal.exit_direction
        progress(start.bit_count() - remaining.bit_count())
    held: tuple[HeldProduct, ...] = ()
    if not remaining & (remaining - 1):
        protected, said = bits(remaining)[0], {}
    else:
        held = tuple(chooser.held(group, remaining, protected) for group in chooser.units(remaining))
    stuck = [(part, known) for part, known in said.items() if part != protected]
    parts, config = chooser.cascade.parts, chooser.config.verdict
    return DisassemblyResult(
        base=protected,
        removals=tuple(removals),
        stuck=add_reasons(parts, remaining, stuck, config=config),
        held_products=held,
    )


REFUSED = Separation(
    answer=Answer.UNKNOWN,
    reason="the ways out that were found were refused later: no motion there, or refuted by the check",
)
"""What is known of a part whose motions, found by the later stages, a later level refused."""


class _Chooser:
    """Ranks what is free; holds the contact graph and the sizes."""

    def __init__(
        self,
        cascade: Cascade,
        config: SequenceConfig,
        refused: frozenset[Refusal],
        proposed: Sequence[int],
        products: Sequence[ProductGroup],
        patient: int | None,
    ) -> None:
        self.cascade, self.config, self.refused, self.proposed = cascade, config, refused, proposed
        self.products = products
        self.patient = cascade.parts.all_parts if patient is None else patient
        self.bodies_as_one = BodiesAsOne(cascade)
        self.inquiry = cascade.inquire()
        self.later_stages = tuple(stage for stage in cascade.stages if stage is not cascade.directions)
        """Those that are asked about one part after another; single translations are ranked over all parts."""
        parts = cascade.parts
        self.volumes = np.array([body.mass_properties.volume for body in parts.bodies])
        boxes = np.ptp(parts.boxes, axis=1)
        self.bulk = np.prod(boxes + 1e-9 * boxes.max(), axis=1) + self.volumes
        rank = np.argsort(np.argsort(self.bulk, kind="stable"), kind="stable")
        self.smallness = 1.0 - rank / max(1, len(rank) - 1)
        self._open: dict[int, tuple[int, int, list[int]]] = {}
        """By part: the others that were asked about, one of them in the way along each direction that is not open, and
        the directions that are."""
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

    def units(self, remaining: int) -> tuple[ProductGroup, ...]:
        """The products that leave as one of these parts."""
        return whole_groups(self.products, remaining)

    def free_parts(self, remaining: int) -> int:
        """Mask of the remaining parts that are in no product."""
        for group in self.units(remaining):
            remaining &= ~group.members
        return remaining

    def held(self, group: ProductGroup, remaining: int, protected: int) -> HeldProduct:
        """What is known of a product that could not leave as one, as far as that was asked."""
        core = self.core(group, remaining, protected)
        said = self.bodies_as_one.last.get(group.members)
        if said is None:
            return HeldProduct(name=group.name, core=core, reason="what it stands in the way of does not leave")
        names = few_words([self.cascade.assembly.names[k] for k in said.blocked_by])
        words = [f"it does not leave as one{f', past {names}' if names else ''}", said.reason]
        return HeldProduct(name=group.name, core=core, reason=": ".join(word for word in words if word))

    def core(self, group: ProductGroup, remaining: int, protected: int) -> int:
        """What is left of a held product once some of its parts have left alone, so that it or another part can leave.

        A key at the end of a shaft holds the cover, and is left for later.
        """
        members = group.members
        while members.bit_count() > 2:
            parts = sorted(bits(members & ~(1 << protected)), key=lambda k: (self.bulk[k], k))
            first = next((k for k in parts if self.leaves_by_one_translation(k, remaining)), None)
            if first is None:
                return 0
            members &= ~(1 << first)
            remaining &= ~(1 << first)
            rest = replace(group, members=members)
            others = bits(self.free_parts(remaining) & ~members & ~(1 << protected))
            is_out = not members >> protected & 1 and self.product_ways(rest, remaining, None, most=1)
            if is_out or any(self.leaves_by_one_translation(k, remaining) for k in others):
                return members
        return 0

    def connected(self, remaining: int) -> bool:
        return reached(remaining & -remaining, remaining, self.neighbours.__getitem__) == remaining

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
        choice = choice or self.next_product(remaining, protected, last)
        if choice is None and protected != self.wishes.base and (own := self.leaving_with(protected, remaining)):
            # the base itself can go: keep another one instead, the best of those that are left
            return self.next(remaining, self.base_among(remaining & ~own), last)
        for stage in self.later_stages:
            if choice is not None:
                break
            if stage is self.cascade.groups:
                choice = self.next_subassembly(remaining, protected)
            else:
                choice = self.next_by_stage(stage, remaining, protected, said)
        choice = choice or self.next_product_by_search(remaining, protected)
        return choice or self.next_subassembly_by_search(remaining, protected), protected, said

    def leaving_with(self, part: int, remaining: int) -> int:
        """Mask of the part, or of the product that it is in, if one translation takes that out; else 0."""
        for group in self.units(remaining):
            if group.members >> part & 1:
                return group.members if self.product_ways(group, remaining, None, most=1) else 0
        return 1 << part if self.leaves_by_one_translation(part, remaining) else 0

    def next_product(self, remaining: int, protected: int, last: Float[np.ndarray, "3"] | None) -> Departure | None:
        """The best product that one translation takes out as one, and its best direction."""
        ranked = [
            (rank, group.members, s, group)
            for group in self.units(remaining)
            if not group.members >> protected & 1 and not self.is_held_back(group.members, remaining & ~group.members)
            for rank, s in self.product_ways(group, remaining, last, most=1)
        ]
        if not ranked:
            return None
        _, members, s, group = min(ranked, key=lambda entry: entry[:3])
        others = remaining & ~members
        removal = self.cascade.parts.straight_removal(members, others, self.cascade.blocking.direction(s))
        separation = Separation(answer=Answer.FREE, removal=removal, direction_index=s, stage="subassembly")
        return self.as_one(members, separation, product=group.name)

    def product_ways(
        self, group: ProductGroup, remaining: int, last: Float[np.ndarray, "3"] | None, *, most: int
    ) -> list[tuple[tuple[bool, float], int]]:
        """The best directions along which a product leaves as one, each with its rank."""
        blocking, worth = self.cascade.blocking, self.preference(last)
        members = bits(group.members)
        others = remaining & ~group.members
        rest = self.config.small_first * min(self.smallness[part] for part in members)
        rest += self.config.connected * self.connected(others)
        ways = []
        for s in range(blocking.count_directions):
            if is_refused(self.refused, group.members, s, others):
                continue
            if any(blocking.masks(part, s)[0] & others for part in members):
                continue
            ploughs = any(
                self.cascade.shared.ploughs(part, overlapped, blocking.direction(s))
                for part in members
                if (overlapped := self.cascade.shared.overlapping(part, others))
            )
            ways.append(((ploughs, -round(worth(blocking.direction(s)) + rest, 6)), s))
        found = []
        for rank, s in sorted(ways):
            if len(found) < most and all(blocking.is_free(part, s, others) for part in members):
                found.append((rank, s))
        return found

    def next_product_by_search(self, remaining: int, protected: int) -> Departure | None:
        """A product that leaves as one by any motion, asked of it as one part."""
        for group in sorted(
            self.units(remaining), key=lambda group: (self.bulk[bits(group.members)].sum(), group.name)
        ):
            if group.members >> protected & 1 or not self.may_leave_as_one(group.members, remaining):
                continue
            separation = self.bodies_as_one.separate(group.members, remaining)
            if separation.answer is Answer.FREE:
                return self.as_one(group.members, separation, product=group.name)
        return None

    def next_subassembly_by_search(self, remaining: int, protected: int) -> Departure | None:
        """A set of parts that leaves as one by several translations: of those that are loose as one, the smallest."""
        left = self.cascade.config.loose.max_sets
        for members in self.cascade.loose_sets(remaining, stays=protected):
            if not left:
                break
            if self.splits_a_product(members, remaining) or not self.may_leave_as_one(members, remaining):
                continue
            left -= 1
            separation = self.bodies_as_one.in_two(members, remaining)
            removal = separation.removal
            if removal is not None and not self._is_refused_way(members, remaining, removal):
                return self.as_one(members, separation)
        return None

    def may_leave_as_one(self, members: int, remaining: int) -> bool:
        """Whether some parts may leave together by what a search finds: nothing refused that, no wish is against it."""
        others = remaining & ~members
        return not is_refused(self.refused, members, None, others) and not self.is_held_back(members, others)

    def _is_refused_way(self, members: int, remaining: int, removal: Removal) -> bool:
        """Whether a way out that was found is one translation, and that was refused as such before."""
        if len(removal.displacements) > 2:
            return False
        blocking = self.cascade.blocking
        return any(
            is_refused(self.refused, members, s, remaining & ~members)
            for s in range(blocking.count_directions)
            if blocking.direction(s) @ removal.exit_direction > 0.9999
        )

    def is_held_back(self, members: int, others: int) -> bool:
        """Whether the user's precedence keeps one of some parts while these others are there."""
        return any(self.wishes.holds_back(part, others) for part in bits(members))

    def as_one(self, members: int, separation: Separation, *, product: str | None = None) -> Departure:
        """The departure of several parts as one, with how they come apart by themselves."""
        inside = _disassemble(self, members, lambda removed: None)
        return Departure(part=inside.base, members=members, separation=separation, inside=inside, product=product)

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
        ranked: list[tuple[bool, float, int]] = []
        open_to: dict[tuple[bool, int], tuple[float, list[int]]] = {}
        for part in bits(self.free_parts(remaining) & ~(1 << protected)):
            if self.wishes.holds_back(part, remaining):
                continue
            others = remaining & ~(1 << part)
            open_ways = self._open_ways(part, others)
            rest = self.config.small_first * self.smallness[part] + self.config.connected * self.connected(others)
            for ploughs, ways in self._by_ploughing(part, others, open_ways):
                if ways:
                    open_to[ploughs, part] = rest, ways
                    ranked.append((ploughs, -round(max(worths[s] for s in ways) + rest, 6), part))
        heapq.heapify(ranked)
        # the ways of a part are put in order once its best one comes; the last is the next to be tried
        left: dict[tuple[bool, int], list[tuple[float, int]]] = {}
        while ranked:
            ploughs, _, part = heapq.heappop(ranked)
            if (ploughs, part) not in left:
                rest, ways = open_to[ploughs, part]
                left[ploughs, part] = sorted(((-round(worths[s] + rest, 6), s) for s in ways), reverse=True)
            _, direction_index = left[ploughs, part].pop()
            separation = self.cascade.directions.along(
                part, remaining, preference=worth, refused=self.refused, among=(direction_index,)
            )
            if separation is None and left[ploughs, part]:
                heapq.heappush(ranked, (ploughs, left[ploughs, part][-1][0], part))
            if separation is not None:
                others = remaining & ~(1 << part)
                if not is_refused(self.refused, 1 << part, direction_index, others, only_turned=True):
                    separation = self.cascade.with_thread(part, remaining, separation)
                return Departure(part=part, members=1 << part, separation=separation)
        return None

    def _open_ways(self, part: int, others: int) -> list[int]:
        """The directions along which, by the coarse maps, none of these others is in the way."""
        asked, watched, ways = self._open.get(part, (0, 0, []))
        if not asked or others & ~asked or watched & ~others:
            blocking, watched, ways = self.cascade.blocking, 0, []
            for s in range(blocking.count_directions):
                blocked = blocking.mapped_blockers(part, s) & others
                watched |= blocked & -blocked
                if not blocked:
                    ways.append(s)
            self._open[part] = others, watched, ways
        return ways

    def _by_ploughing(self, part: int, others: int, open_ways: list[int]) -> Iterator[tuple[bool, list[int]]]:
        """Yield the open directions that do not plough through what the part overlaps, then those that do."""
        blocking, shared = self.cascade.blocking, self.cascade.shared
        overlapped = shared.overlapping(part, others)
        if not overlapped:
            yield False, open_ways
            return
        through = {s: shared.ploughs(part, overlapped, blocking.direction(s)) for s in open_ways}
        for ploughs in (False, True):
            yield ploughs, [s for s in open_ways if through[s] == ploughs]

    def next_by_stage(
        self, stage: Stage, remaining: int, protected: int, said: dict[int, Separation]
    ) -> Departure | None:
        """A part that a later stage frees, the protected one last; else None, and ``said`` knows more of every part."""
        for part in sorted(bits(self.free_parts(remaining)), key=lambda k: (k == protected, self.bulk[k], k)):
            if self._is_refused(part, remaining):
                said[part] = REFUSED
                continue
            if part == self.wishes.base:
                continue
            if stage in (self.cascade.physics, self.cascade.tilting) and not self.patient >> part & 1:
                continue
            if waits := self.wishes.holds_back(part, remaining):
                said[part] = self._waiting(bits(waits))
                continue
            known = said.get(part, UNASKED)
            if known.rules_out(stage):
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
        if found is None or self.splits_a_product(found.members, remaining):
            return None
        if self.is_held_back(found.members, remaining & ~found.members):
            return None
        separation = Separation(
            answer=Answer.FREE, removal=found.removal, direction_index=found.direction_index, stage="subassembly"
        )
        return self.as_one(found.members, separation)

    def splits_a_product(self, members: int, remaining: int) -> bool:
        """Whether some parts are only a part of a product that leaves as one of the remaining ones."""
        return any(unit.members & members not in (0, unit.members) for unit in self.units(remaining))

    def simultaneous(self, remaining: int, protected: int) -> tuple[Departure, ...]:
        """Sets of parts that leave at once, each by a translation of its own; none if none are found."""

        def allowed(groups: Collection[int]) -> bool:
            moving = sum(groups)
            others = remaining & ~moving
            splits = any(self.splits_a_product(mask, remaining) for mask in groups)
            # at the same time is not earlier
            waits = any(self.is_held_back(mask, remaining & ~mask) for mask in groups)
            refused = any(is_refused(self.refused, m, None, others, simultaneous=moving & ~m) for m in groups)
            return not splits and not waits and not refused

        found = self.cascade.find_simultaneous(remaining, stays=protected, allowed=allowed)
        if len(found) == 1 and self._is_refused_way(found[0].members, remaining, found[0].removal):
            return ()
        moving = sum(group.members for group in found)
        products = {unit.members: unit.name for unit in self.units(remaining)}
        return tuple(
            replace(self._leaving(group), simultaneous=moving & ~group.members, product=products.get(group.members))
            for group in found
        )

    def _leaving(self, group: SimultaneousGroup) -> Departure:
        members = group.members
        separation = Separation(answer=Answer.FREE, removal=group.removal, stage="simultaneous")
        if members & (members - 1):
            return self.as_one(members, separation)
        return Departure(part=bits(members)[0], members=members, separation=separation)
