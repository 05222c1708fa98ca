"""One search: the units that leave, the tables looked at, the orders that grow, and what they cost."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.sequence.constraints import ResolvedConstraints
from sashimono.disassembly.sequence.cost import Amounts, CostModel, Placing, add
from sashimono.disassembly.sequence.departures import Departure, DisassemblyResult, Turn
from sashimono.disassembly.sequence.holds import Allowance, Balance, Contacts, HoldCounter, table_under
from sashimono.disassembly.sequence.moves import Blocked, earlier_in
from sashimono.disassembly.sequence.products import ProductGroup, base_group_waits
from sashimono.disassembly.sequence.search_config import OrderSearchConfig
from sashimono.disassembly.sequence.ways import Candidate, Leaving, Lines, Unit, Way, Ways, Work, units_of
from sashimono.plan import Answer, Table


@dataclass(frozen=True, kw_only=True, eq=False)
class _State:
    """An order of taking apart as far as it has grown."""

    remaining: int
    surplus: float
    """What it costs more than was expected of those that left."""
    held: int
    """Parts that must be held of those that remain, as far as that is bounded."""
    placing: Placing | None = None
    leaving: Leaving | None = None
    before: _State | None = None
    in_fixture: bool = False
    """Whether a part came from below, so that the base must stand in a fixture."""

    def path(self) -> tuple[Leaving, ...]:
        out = []
        state: _State | None = self
        while state is not None and state.leaving is not None:
            out.append(state.leaving)
            state = state.before
        return tuple(reversed(out))


@dataclass(kw_only=True, eq=False)
class Memory:
    """What was found of one set of parts, and holds for every later search of it, whatever was refused since."""

    by_table: dict[tuple[int, bytes], tuple[HoldCounter, bool]] = field(default_factory=dict)
    balances: dict[bytes, dict[Balance, bool]] = field(default_factory=dict)
    allowance: Allowance
    last: Candidate | None = None
    """The order that was taken last."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchSite:
    """What all searches of one assembly share."""

    cascade: Cascade
    contacts: Contacts
    model: CostModel
    wishes: ResolvedConstraints
    config: OrderSearchConfig
    lines: Lines = field(default_factory=Lines)
    memories: dict[tuple[int, int, bytes | None, tuple[int, ...]], Memory] = field(default_factory=dict)
    """By the parts that were there, those that are stuck, the given up direction, and what leaves as one."""


class SearchRun:
    """One search: the units, the budgets, the tables looked at."""

    def __init__(
        self,
        site: SearchSite,
        found: DisassemblyResult,
        start: int,
        refused: frozenset[Refusal],
        up: Float[np.ndarray, "3"] | None,
        products: Sequence[ProductGroup],
    ) -> None:
        """Take in what is searched.

        Args:
            site: What all searches of the assembly share.
            found: The greedy disassembly.
            start: Mask of the parts that were there.
            refused: Ways out that are not to be taken.
            up: Away from the table, where that is given.
            products: What leaves as one.
        """
        self._cascade, self._contacts = site.cascade, site.contacts
        self._model, self._config = site.model, site.config
        waits = base_group_waits(products, found.base, start, len(site.cascade.parts))
        self.wishes = site.wishes.and_waits(waits)
        """What the user wants, and that the product with the base in it is put together first."""
        self._found = found
        self._start = start
        self._refused = refused
        self._work = Work(site.cascade, site.config.traced)
        self._up = up
        self._stuck = sum(1 << part for part, _ in found.stuck)
        self._units = units_of(found.base, found.removals, start)
        self._ways: dict[bytes, Ways] = {}
        self._lines = site.lines
        key = (start, self._stuck, None if up is None else up.tobytes(), tuple(each.members for each in products))
        if key not in site.memories:
            site.memories[key] = Memory(allowance=Allowance(self._config.balances))
        self._memory = site.memories[key]
        self._memory.allowance.renew(self._config.balances)

    @property
    def width(self) -> int:
        """How many orders grow side by side."""
        count = len(self._units)
        return max(1, min(self._config.width, self._config.expansions // (count * count)))

    def ways(self, up: Float[np.ndarray, "3"]) -> Ways:
        """Return the ways out for one up direction."""
        key = np.round(up, 9).tobytes()
        if key not in self._ways:
            self._ways[key] = Ways(
                self._cascade,
                self._model.scene,
                up,
                refused=self._refused,
                work=self._work,
                lines=self._lines,
                above=self._model.config.above,
            )
        return self._ways[key]

    def starts(self, top: bool) -> list[Candidate]:
        """Return quick orders for bases and tables, those that cost least first."""
        found: list[Candidate] = []
        bases = self._bases(top)
        most = max(1, 2 * self._config.expansions // (len(self._units) ** 2 * len(bases)))
        for base in bases:
            for normal in self._normals(base)[:most] if self._up is None else [self._up]:
                expected = self.expected(self.greedy(normal))
                found += self.grow(base, normal, expected, width=1, quick=True)
        chosen: list[Candidate] = []
        for order in sorted(found, key=lambda order: round(order.cost, 6)):
            if not any(
                other.base == order.base and float(other.up @ order.up) > self._config.same_table for other in chosen
            ):
                chosen.append(order)
        return chosen

    def expected(self, order: Candidate) -> dict[int, float]:
        """Return, by unit, what it cost in this order to bring it as it was brought there, whatever came around it.

        Which of two units leaves first says little if one of them costs more whenever it leaves. So a search compares
        orders that are not finished by what they cost more than this.
        """
        out: dict[int, float] = {}
        remaining = self._start
        for leaving in order.leaving:
            members = leaving.unit.members
            remaining &= ~members
            placing = Placing(members=members, exit_direction=leaving.way.exit_direction, rest=remaining)
            amounts = self._model.of_placing(placing, 0, order.up)
            out[members] = self._model.total(
                {term: amounts[term] for term in ("not_from_above", "from_below", "slides") if term in amounts}
            )
        return out

    def _bases(self, top: bool) -> list[int]:
        """The greedy base, then those with the highest scores; one alone if the user named it or parts are stuck."""
        first = 1 << self._found.base
        if self._stuck or (top and self.wishes.base is not None):
            return [first]
        scene = self._model.scene
        others = [unit.members for unit in self._units if unit.single and unit.members != first]
        others = [mask for mask in others if not any(w & mask for w in self._waiting_masks())]
        least = self._config.least_base * max(scene.base_score(1 << part) for part in bits(self._start))
        others = [m for m in others if scene.base_score(m) >= least and m.bit_length() - 1 not in scene.fasteners]
        others.sort(key=lambda mask: (-round(scene.base_score(mask), 9), mask))
        return [first, *others[: self._config.bases - 1]]

    def _waiting_masks(self) -> Iterator[int]:
        """Masks of the parts that the user wants to be placed after some other: none of them is a base."""
        for part in bits(self._start):
            yield self.wishes.waits[part] & self._start

    def _normals(self, base: int) -> list[Float[np.ndarray, "3"]]:
        """The file's up first, then the world's axes and the base's own lines, both ways."""
        part = base.bit_length() - 1
        lines = [*np.eye(3)[[2, 1, 0]], *self._cascade.parts.part_lines[part][:3]]
        out = [self._model.scene.up]
        for line in lines:
            for normal in (line, -line):
                if all(float(normal @ other) < 0.999 for other in out):
                    out.append(np.array(normal))
        return out

    def grow(
        self,
        base: int,
        up: Float[np.ndarray, "3"],
        expected: Mapping[int, float],
        *,
        width: int,
        quick: bool = False,
    ) -> list[Candidate]:
        """Return the orders that a beam grows for one base and table, the cheapest first.

        Args:
            base: Mask of one part.
            up: Unit.
            expected: By unit, what it is expected to cost by itself.
            width: Orders that grow side by side.
            quick: Whether the maps alone say what is free. Such an order may not be possible.
        """
        ways = self.ways(up)
        holds, in_fixture = self._holds(base, up)
        beam = [_State(remaining=self._start, surplus=0.0, held=holds.at_least(self._start))]
        standing = base | self._stuck
        while beam[0].remaining != standing:
            grown = sorted(
                (
                    entry
                    for place, state in enumerate(beam)
                    for entry in self._grown(state, place, base, up, ways, expected, quick)
                ),
                key=lambda entry: entry[:4],
            )
            kept: dict[tuple[int, int | None], _State] = {}
            for surplus, place, _, _, placing, leaving in grown[: 8 * width]:
                before = beam[place]
                held = holds.at_least(placing.rest)
                surplus += self._model.total(self._model.of_hands(held, before.held))
                key = (placing.rest, leaving.way.direction_index)
                if key not in kept or surplus < kept[key].surplus - 1e-9:
                    kept[key] = _State(
                        remaining=placing.rest,
                        surplus=surplus,
                        held=held,
                        placing=placing,
                        before=before,
                        leaving=leaving,
                        in_fixture=before.in_fixture or self._is_from_below(placing, up),
                    )
            beam = self._distinct(sorted(kept.values(), key=lambda state: round(state.surplus, 6)))[:width]
            if not beam:
                return []
        first = sum(expected.get(unit.members, 0.0) for unit in self._units if unit.members != base)
        first += self._model.total(
            self._model.of_start(base, base | self._stuck, holds.at_least(base | self._stuck), in_fixture, holds.table)
        )
        return [Candidate(base=base, up=up, leaving=state.path(), cost=first + state.surplus) for state in beam]

    def _distinct(self, states: Sequence[_State]) -> list[_State]:
        """The states, without those that differ from an earlier one only in which of several alike parts have left."""
        seen: set[tuple[int, int | None, float]] = set()
        out = []
        for state in states:
            last = None if state.leaving is None else state.leaving.way.direction_index
            key = (self._model.scene.regardless_of_alike(state.remaining), last, round(state.surplus, 6))
            if key not in seen:
                seen.add(key)
                out.append(state)
        return out

    def polished(self, candidate: Candidate) -> Candidate:
        """Return an order with single parts placed earlier as long as that makes it cheaper and the budget lasts."""
        count = len(candidate.leaving)
        best = self._model.total(self.amounts(candidate, exact=False))
        tries = self._config.moves // max(1, count)
        pairs = [(own, own - by) for by in range(1, count) for own in range(by, count)]
        place, since = 0, 0
        while since < len(pairs) and tries > 0:
            own, later = pairs[place]
            place, since = (place + 1) % len(pairs), since + 1
            changed = earlier_in(candidate, later, own, start=self._start, ways=self.ways, wishes=self.wishes)
            if isinstance(changed, Blocked) or not self._can_be_turned(changed):
                continue
            tries -= 1
            cost = self._model.total(self.amounts(changed, exact=False))
            if cost < best - 1e-6:
                candidate, best, since = changed, cost, 0
        return replace(candidate, cost=best)

    def _grown(
        self,
        state: _State,
        place: int,
        base: int,
        up: Float[np.ndarray, "3"],
        ways: Ways,
        expected: Mapping[int, float],
        quick: bool,
    ) -> Iterator[tuple[float, int, int, int, Placing, Leaving]]:
        """What one more unit's leaving leads to: the surplus, hands aside, what breaks ties, and how it leaves."""
        remaining = state.remaining
        gone = self._start & ~remaining
        last = None if state.leaving is None else state.leaving.way.direction_index
        _, in_fixture = self._holds(base, up)
        for unit in self._units:
            members = unit.members
            if members & ~remaining or members == base or self._holds_back(members, remaining):
                continue
            way = ways.open_way(unit, remaining) if quick else ways.way(unit, remaining, last)
            if way is None:
                continue
            placing = Placing(
                members=members, exit_direction=way.exit_direction, rest=remaining & ~members, after=state.placing
            )
            cost = state.surplus + self._model.total(self._model.of_placing(placing, gone, up))
            cost -= expected.get(members, 0.0)
            if not (in_fixture or state.in_fixture) and self._is_from_below(placing, up):
                cost += self._model.config.fixture
            # of alike parts, those with the higher names go first, so that they are placed in natural order
            yield round(cost, 6), place, self._rank[unit.part], -unit.part, placing, Leaving(unit=unit, way=way)

    def _is_from_below(self, placing: Placing, up: Float[np.ndarray, "3"]) -> bool:
        return float(placing.exit_direction @ up) < -self._model.config.above

    @cached_property
    def _rank(self) -> Sequence[int]:
        """By part: its place when parts are ordered by bulk."""
        bulk = np.round(np.log(np.maximum(self._model.scene.bulk, 1e-30)), 3)
        return np.unique(bulk, return_inverse=True)[1].tolist()

    def _holds_back(self, members: int, remaining: int) -> bool:
        return any(self.wishes.holds_back(part, remaining & ~members) for part in bits(members))

    def _holds(self, base: int, up: Float[np.ndarray, "3"]) -> tuple[HoldCounter, bool]:
        """What counts held parts on the table that a base stands on, and whether it needs a fixture there."""
        key = (base, np.round(up, 9).tobytes())
        by_table = self._memory.by_table
        if key not in by_table:
            scene = self._model.scene
            lows = scene.bounds_along(up)[:, 0]
            inside = np.array([lows[part] for part in bits(self._start)])
            gap = self._config.table_gap * scene.size
            standing = base | self._stuck
            table, in_fixture = table_under(inside, float(min(lows[part] for part in bits(standing))), up, gap)
            by_table[key] = (self._counter(table, standing if in_fixture else 0), in_fixture)
        return by_table[key]

    def _counter(self, table: Table, fixed: int) -> HoldCounter:
        return HoldCounter(
            self._contacts,
            table,
            fixed=fixed,
            allowance=self._memory.allowance,
            known=self._memory.balances.setdefault(np.round(table.normal, 9).tobytes(), {}),
        )

    def _turned_over(self, order: Candidate) -> tuple[int, HoldCounter]:
        """Mask of the parts that are in place when the product is turned over, and what counts held parts from then."""
        assert order.turn is not None
        placed = self._start
        for leaving in order.leaving[: order.turn.count]:
            placed &= ~leaving.unit.members
        up = np.array(order.turn.up)
        key = (-placed, np.round(up, 9).tobytes())  # no base: those are positive
        if key not in self._memory.by_table:
            lows = self._model.scene.bounds_along(up)[:, 0]
            offset = float(min(lows[part] for part in bits(placed)))
            self._memory.by_table[key] = (self._counter(Table(normal=up, offset=offset), 0), False)
        return placed, self._memory.by_table[key][0]

    def _can_be_turned(self, order: Candidate) -> bool:
        """Whether what is placed after the turn comes from above or level, and lies no lower than what stands there."""
        if order.turn is None:
            return True
        up = np.array(order.turn.up)
        after = order.leaving[: order.turn.count]
        if any(float(leaving.way.exit_direction @ up) < -1e-6 for leaving in after):
            return False
        table = self._turned_over(order)[1].table
        lows = self._model.scene.bounds_along(up)[:, 0]
        lowest = min((float(lows[part]) for leaving in after for part in bits(leaving.unit.members)), default=np.inf)
        return lowest >= table.offset - 1e-6 * self._model.scene.size

    def turned(self, order: Candidate) -> list[Candidate]:
        """Return orders like this one in which the product is turned over once, for what does not come from above.

        What comes from above on the other table is placed last, on that: only that, or all else as well that can come
        from above there. The rest keeps its order.
        """
        above = self._model.config.above
        wanted = {e.unit.members for e in order.leaving if float(e.way.exit_direction @ order.up) < above}
        everything = {entry.unit.members for entry in order.leaving}
        others = [n for n in self._normals(order.base) if float(n @ order.up) < self._config.same_table]
        others.sort(key=lambda normal: round(float(normal @ order.up), 6))
        tables = others[: self._config.turned_tables] if wanted else []
        found = [self._turned_to(order, up, last) for up in tables for last in (wanted, everything)]
        return [changed for changed in found if changed is not None]

    def _turned_to(self, order: Candidate, up: Float[np.ndarray, "3"], wanted: Collection[int]) -> Candidate | None:
        """The order in which what is wanted, and comes from above on a table, is placed last on that; None if nothing
        is, or if the rest then cannot come."""
        ways, remaining, last = self.ways(up), self._start, None
        waiting = [entry.unit for entry in order.leaving]
        leaving: list[Leaving] = []
        while entry := self._from_above((u for u in waiting if u.members in wanted), ways, remaining, last, up):
            leaving.append(entry)
            waiting.remove(entry.unit)
            remaining, last = remaining & ~entry.unit.members, entry.way.direction_index
        count, last = len(leaving), None
        while waiting and (entry := self._first_of(waiting, self.ways(order.up), remaining, last)):
            leaving.append(entry)
            waiting.remove(entry.unit)
            remaining, last = remaining & ~entry.unit.members, entry.way.direction_index
        turn = Turn(count=count, up=(float(up[0]), float(up[1]), float(up[2])))
        changed = replace(order, leaving=tuple(leaving), turn=turn)
        if not count or count == len(leaving) or waiting or not self._can_be_turned(changed):
            return None
        return replace(changed, cost=self.cost(changed, exact=False))

    def _from_above(
        self, units: Iterable[Unit], ways: Ways, remaining: int, last: int | None, up: Float[np.ndarray, "3"]
    ) -> Leaving | None:
        """The first of these units that may leave upwards now."""
        for unit in units:
            entry = self._first_of([unit], ways, remaining, last)
            if entry is not None and float(entry.way.exit_direction @ up) >= self._model.config.above:
                return entry
        return None

    def mended(self) -> tuple[Candidate, bool] | None:
        """Return the order that was taken last, as nearly as it can still be taken; and whether it costs hardly more.

        At each place leaves the first of those that left later which still can. None if there was no order, or if
        nothing of it can leave any more.
        """
        known = self._memory.last
        units = {unit.members: unit for unit in self._units}
        if known is None or {units[m] for m in units if m != known.base} != {
            units.get(entry.unit.members) for entry in known.leaving
        }:
            return None
        remaining = self._start
        leaving: list[Leaving] = []
        count = 0 if known.turn is None else known.turn.count
        for stretch in (range(count), range(count, len(known.leaving))):
            waiting = [units[known.leaving[k].unit.members] for k in stretch]
            last = None
            while waiting:
                entry = self._first_of(waiting, self.ways(known.up_at(stretch.start)), remaining, last)
                if entry is None:
                    return None
                leaving.append(entry)
                waiting.remove(entry.unit)
                remaining, last = remaining & ~entry.unit.members, entry.way.direction_index
        order = replace(known, leaving=tuple(leaving))
        if not self._can_be_turned(order):
            return None
        order = self.polished(order)
        return order, order.cost <= known.cost + self._config.mending

    def _first_of(self, units: Sequence[Unit], ways: Ways, remaining: int, last: int | None) -> Leaving | None:
        for unit in units:
            if not self._holds_back(unit.members, remaining):
                way = ways.way(unit, remaining, last)
                if way is not None:
                    return Leaving(unit=unit, way=way)
        return None

    def remember(self, order: Candidate | None) -> None:
        """Keep the order that is taken for the next search, should parts of it be refused."""
        self._memory.last = None if order is None else replace(order, cost=self.cost(order, exact=False))

    def best(self, candidates: Sequence[Candidate], *, may_turn: bool) -> Candidate | None:
        """Return the cheapest of the best few, all held parts counted exactly, and the greedy order among them.

        Args:
            candidates: Orders.
            may_turn: Whether orders like them in which the product is turned over are looked at too.
        """
        ranked = sorted(range(len(candidates)), key=lambda k: (round(candidates[k].cost, 6), k))
        tables: dict[tuple[int, bytes], Candidate] = {}
        for k in ranked:
            tables.setdefault((candidates[k].base, candidates[k].up.tobytes()), candidates[k])
        tried = [self.polished(candidate) for candidate in list(tables.values())[: self._config.exact]]
        base = 1 << self._found.base
        normals = self._normals(base) if self._up is None else [self._up]
        greedy = min(map(self.greedy, normals), key=lambda order: round(self.cost(order, exact=False), 6))
        if may_turn and self._config.turned_tables:
            over = [turned for order in (*tried, *tables.values(), greedy) for turned in self.turned(order)]
            cheapest = min(over, key=lambda order: round(order.cost, 6), default=None)
            tried += [] if cheapest is None else [self.polished(cheapest)]
        compared = [*tried, greedy]
        exact = len(self._units) * len(compared) <= self._config.exact_sets
        scored = [(round(self.cost(order, exact=exact), 6), k, order) for k, order in enumerate(compared)]
        return min(scored, key=lambda entry: entry[:2])[2]

    def greedy(self, up: Float[np.ndarray, "3"]) -> Candidate:
        """Return the order that was found first, for a table."""
        leaving = []
        for unit in self._units:
            removal = None if unit.known is None else unit.known.separation.removal
            if removal is not None:
                leaving.append(Leaving(unit=unit, way=Way(direction_index=None, exit_direction=removal.exit_direction)))
        return Candidate(base=1 << self._found.base, up=up, leaving=tuple(leaving), cost=np.inf)

    def cost(self, candidate: Candidate, *, exact: bool) -> float:
        """Return the cost of an order, the held parts of every step found by linear programs, or bounded."""
        return self._model.total(self.amounts(candidate, exact=exact))

    def amounts(self, candidate: Candidate, *, exact: bool) -> Amounts:
        """Return the terms of an order."""
        holds, in_fixture = self._holds(candidate.base, candidate.up)
        turn = candidate.turn
        placed, on = (0, holds) if turn is None else self._turned_over(candidate)

        def held_of(counter: HoldCounter, parts: int) -> int:
            return counter.fewest(parts) if exact else counter.at_least(parts)

        out: Amounts = {}
        remaining, after, below = self._start, None, in_fixture
        held = held_of(on, remaining)
        for k, leaving in enumerate(candidate.leaving):
            is_turned = turn is not None and k == turn.count
            if is_turned:
                add(out, self._model.of_turn(placed, held, on.table))
                on = holds
                held = held_of(on, remaining)
            up = candidate.up_at(k)
            members = leaving.unit.members
            rest = remaining & ~members
            after = Placing(
                members=members,
                exit_direction=leaving.way.exit_direction,
                rest=rest,
                after=after,
                turned_after=is_turned,
            )
            add(out, self._model.of_placing(after, self._start & ~remaining, up))
            if self._is_from_below(after, up):
                below = True
            held_before = held_of(on, rest)
            add(out, self._model.of_hands(held_before, held))
            remaining, held = rest, held_before
        add(out, self._model.of_start(candidate.base, candidate.base | self._stuck, held, below, holds.table))
        return out

    def result(self, candidate: Candidate) -> DisassemblyResult:
        """Return an order as level 1 says it, with level 1's own answer for every departure."""
        removals = []
        remaining = self._start
        for leaving in candidate.leaving:
            removals.append(self._departure(leaving, remaining))
            remaining &= ~leaving.unit.members
        return replace(
            self._found,
            base=candidate.base.bit_length() - 1,
            removals=tuple(removals),
            up=tuple(float(x) for x in candidate.up),
            turn=candidate.turn,
        )

    def _departure(self, leaving: Leaving, remaining: int) -> Departure:
        unit, s = leaving.unit, leaving.way.direction_index
        if s is None:
            assert unit.known is not None
            return unit.known
        if not unit.single:
            return self._as_one(unit, s, remaining)
        separation = self._cascade.directions.along(
            unit.part, remaining, preference=lambda direction: 0.0, refused=self._refused, among=(s,)
        )
        assert separation is not None, "the relation answers the same question the same way"
        if not is_refused(self._refused, unit.members, s, remaining & ~unit.members, only_turned=True):
            separation = self._cascade.with_thread(unit.part, remaining, separation)
        return Departure(part=unit.part, members=unit.members, separation=separation)

    def _as_one(self, unit: Unit, direction_index: int, remaining: int) -> Departure:
        """The departure of a product along a direction, past what remains."""
        assert unit.known is not None
        parts = self._cascade.parts
        direction = self._cascade.blocking.direction(direction_index)
        removal = parts.straight_removal(unit.members, remaining & ~unit.members, direction)
        separation = Separation(
            answer=Answer.FREE, removal=removal, direction_index=direction_index, stage="subassembly"
        )
        return replace(unit.known, separation=separation)
