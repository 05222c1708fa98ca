"""Ways out for parts in sets that the greedy order never saw: which direction, of those that are free, a fitter takes.

Removal is monotone: what was found with more parts there stays valid with fewer. So every departure of the order that
was found first is good for all sets of parts that were then still there; besides, straight lines are asked of the
blocking relation, which is exact for every set.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.sequence.departures import Departure, Turn
from sashimono.disassembly.sequence.scene import OrderScene


@dataclass(frozen=True, kw_only=True, eq=False)
class Unit:
    """A part, or a subassembly that leaves as one: what a search moves."""

    members: int
    known: Departure | None
    """As it left in the order that was found first; None for the part that was the base there."""
    others: int = 0
    """Mask of what was there then."""

    @property
    def single(self) -> bool:
        """Whether it is one part."""
        return self.members & (self.members - 1) == 0

    @property
    def is_movable(self) -> bool:
        """Whether it may leave along any straight line: a part, or a product; a set that only moves as one may not."""
        return self.single or (self.known is not None and self.known.product is not None)

    @property
    def part(self) -> int:
        """Its position, of a single part; else that of the part whose name stands for all."""
        return self.members.bit_length() - 1 if self.single or self.known is None else self.known.part


@dataclass(frozen=True, kw_only=True, eq=False)
class Way:
    """How a unit leaves."""

    direction_index: int | None
    """Direction in the blocking relation; None: as it left in the order that was found first."""
    exit_direction: Float[np.ndarray, "3"]
    """Unit, world."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Leaving:
    """One unit that leaves, and how."""

    unit: Unit
    way: Way


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A whole order of taking apart, for one base and table."""

    base: int
    """Mask of what stays."""
    up: Float[np.ndarray, "3"]
    leaving: tuple[Leaving, ...]
    cost: float
    """With held parts as far as they are bounded."""
    turn: Turn | None = None
    """Where the product is turned over."""

    def up_at(self, k: int) -> Float[np.ndarray, "3"]:
        """Return away from the table on which what leaves as number ``k`` is placed."""
        return self.up if self.turn is None or k >= self.turn.count else np.array(self.turn.up)


class Lines:
    """What was found of straight lines past any set of parts: the same for every table, order and refusal."""

    def __init__(self) -> None:
        self.ploughs: dict[tuple[int, int, int], bool] = {}
        """By part, other part and direction: whether it goes through what the two share."""


class Ways:
    """Ways out along straight lines and by what is known, for one up direction. A question is answered once."""

    def __init__(
        self,
        cascade: Cascade,
        scene: OrderScene,
        up: Float[np.ndarray, "3"],
        *,
        refused: frozenset[Refusal],
        work: Work,
        lines: Lines,
        above: float,
    ) -> None:
        """Take in the parts.

        Args:
            cascade: Level 1.
            scene: Fasteners.
            up: Unit.
            refused: Ways out that are not to be taken.
            work: Counts tracing, shared by all that search the same assembly.
            lines: What is known of straight lines, shared likewise.
            above: Least cosine of a way out that counts as up.
        """
        self._cascade = cascade
        self._scene = scene
        self._up = up
        self._refused = refused
        self._work = work
        self._above = above
        blocking = cascade.blocking
        self.directions = [blocking.direction(s) for s in range(blocking.count_directions)]
        self._ranked: dict[int, list[tuple[tuple[int, int], int, int]]] = {}
        self._best: dict[tuple[int, int], tuple[int, tuple[int, int]] | None] = {}
        self._lines = lines

    def way(self, unit: Unit, remaining: int, last: int | None) -> Way | None:
        """Return the best way by which a unit leaves the remaining parts, or None if none is known.

        Of equally good ones that along the last direction.
        """
        if unit.is_movable:
            found = self._straight(unit, remaining, last)
            if found is not None:
                return Way(direction_index=found, exit_direction=self.directions[found])
        return self._known(unit, remaining & ~unit.members)

    def open_way(self, unit: Unit, remaining: int) -> Way | None:
        """Return the best way that no map contradicts: quick, for a first look; it may not be free."""
        others = remaining & ~unit.members
        if unit.is_movable:
            for _, s, blockers in self._ranking(unit.members):
                if not blockers & others and not is_refused(self._refused, unit.members, s, others):
                    return Way(direction_index=s, exit_direction=self.directions[s])
        return self._known(unit, others)

    def is_free(self, part: int, direction_index: int, others: int) -> bool:
        """Return whether a part leaves along a direction past these others, by level 1's own relation.

        What would take more tracing than is left counts as not free.
        """
        blocking = self._cascade.blocking
        known = blocking.known(part, direction_index, others)
        if known is not None:
            return known
        return self._work.allows(part, direction_index, others) and blocking.is_free(part, direction_index, others)

    def _known(self, unit: Unit, others: int) -> Way | None:
        """The way in which a unit left in the order that was found first, if it is good for these others."""
        removal = None if unit.known is None else unit.known.separation.removal
        if removal is None or not self._still_holds(unit, others):
            return None
        return Way(direction_index=None, exit_direction=removal.exit_direction)

    def _still_holds(self, unit: Unit, others: int) -> bool:
        """Whether the way that is known leads out past these others: all were there, or it would not meet them."""
        assert unit.known is not None
        if is_refused(self._refused, unit.members, unit.known.separation.direction_index, others):
            return False
        more = others & ~unit.others
        if not more:
            return True
        separation = unit.known.separation
        stage = next((s for s in self._cascade.stages if s.name == separation.stage), None)
        return stage is not None and unit.single and stage.can_recall(separation) and not separation.hits & others

    def _straight(self, unit: Unit, remaining: int, last: int | None) -> int | None:
        members = unit.members
        others = remaining & ~members
        key = (members, others)
        if key not in self._best:
            self._best[key] = self._find(unit, others)
        best = self._best[key]
        if best is None or last is None or best[0] == last:
            return None if best is None else best[0]
        rank = next((r for r, s, _ in self._ranking(members) if s == last), None)
        alike = rank == best[1] and self._leaves(members, last, others)
        alike = alike and not self._is_ploughing(members, last, others)
        return last if alike else best[0]

    def _find(self, unit: Unit, others: int) -> tuple[int, tuple[int, int]] | None:
        """The best direction that is free, those that plough through an overlap last.

        A direction that is no axis of the part is asked only where it is not known how else the part leaves.
        """
        members, parts, ploughing = unit.members, bits(unit.members), None
        is_known = self._known(unit, others) is not None
        known_blockers = self._cascade.blocking.known_blockers
        for rank, s, blockers in self._ranking(members):
            if blockers & others or (rank[1] and is_known) or _union(known_blockers, parts, s) & others:
                continue
            if self._is_ploughing(members, s, others):
                if ploughing is None and self._leaves(members, s, others):
                    ploughing = (s, rank)
                continue
            if self._leaves(members, s, others):
                return s, rank
        return ploughing

    def _leaves(self, members: int, direction_index: int, others: int) -> bool:
        """Whether all of these leave along a direction past the others."""
        if is_refused(self._refused, members, direction_index, others):
            return False
        return all(self.is_free(part, direction_index, others) for part in bits(members))

    def _is_ploughing(self, members: int, direction_index: int, others: int) -> bool:
        shared = self._cascade.shared
        ploughs = self._lines.ploughs
        for part in bits(members):
            for other in shared.overlapping(part, others):
                key = (part, other, direction_index)
                if key not in ploughs:
                    ploughs[key] = shared.ploughs(part, [other], self.directions[direction_index])
                if ploughs[key]:
                    return True
        return False

    def _ranking(self, members: int) -> list[tuple[tuple[int, int], int, int]]:
        """The directions that a part, or a product, may take, best first, each with a rank that equally good ones
        share, and the mask of the parts that block it by the coarse maps.

        First a fastener's own axis. Then up, sideways, down; in each, the axes of the part's own faces and holes before
        all others, and the steeper before the flatter.
        """
        if members not in self._ranked:
            parts = bits(members)
            own = np.concatenate([self._scene.own_lines(part) for part in parts])
            fastener = self._scene.fasteners.get(parts[0]) if len(parts) == 1 else None
            found = []
            for s, direction in enumerate(self.directions):
                along = float(direction @ self._up)
                level = 0 if along >= self._above else 2 if along <= -self._above else 1
                is_own = len(own) > 0 and float(np.abs(own @ direction).max()) > 0.99996
                feature = 0 if is_own or abs(along) > 0.99996 else 1
                if fastener is not None:
                    turned = float(direction @ fastener.axis)
                    sided = fastener.kind in ("screw", "bolt", "nut")
                    if turned < -0.9998 or (not sided and turned > 0.9998):
                        level = -1
                # sideways and down, the axis that is level, or straight down, is not worse than one that leans up
                lean = -along if level <= 0 else abs(along) if level == 1 else along
                found.append(((level, feature), round(lean, 6), s))
            by_maps = self._cascade.blocking.mapped_blockers
            self._ranked[members] = [(rank, s, _union(by_maps, parts, s)) for rank, _, s in sorted(found)]
        return self._ranked[members]


def _union(blockers: Callable[[int, int], int], parts: Sequence[int], direction_index: int) -> int:
    """Mask of what blocks any of these parts along a direction."""
    mask = 0
    for part in parts:
        mask |= blockers(part, direction_index)
    return mask


class Work:
    """Counts the pairs of parts that a search has traced anew, by the points of both."""

    def __init__(self, cascade: Cascade, most: float) -> None:
        self._cascade = cascade
        self._left = most
        self._points = [len(body.probes) for body in cascade.parts.bodies]
        self._asked: dict[tuple[int, int], int] = {}
        self._ahead: dict[tuple[int, int], int] = {}
        self._refused: dict[tuple[int, int], int] = {}
        """By part and direction: parts (a mask) past which tracing it was more than was left."""

    def allows(self, part: int, direction_index: int, others: int) -> bool:
        """Return whether the rest allows tracing a part past these others, and take that away."""
        key = (part, direction_index)
        if key not in self._ahead:
            direction = self._cascade.blocking.direction(direction_index)
            everyone = bits(self._cascade.parts.all_parts & ~(1 << part))
            found = self._cascade.parts.parts_ahead(part, np.zeros(3), direction, everyone)
            self._ahead[key] = sum(1 << other for _, other in found)
        new = others & self._ahead[key] & ~self._asked.get(key, 0)
        if not new:
            return True
        if (refused := self._refused.get(key, 0)) and not refused & ~new:
            return False  # no more is left since, and no less is asked
        cost = sum(self._points[part] + self._points[other] for other in bits(new))
        if cost > self._left:
            self._refused[key] = new
            return False
        self._left -= cost
        self._asked[key] = self._asked.get(key, 0) | new
        return True


def units_of(base: int, removals: Sequence[Departure], start: int) -> list[Unit]:
    """Return what a search may move: the departures of the order that was found, and its base (a position)."""
    out = []
    remaining = start
    for departure in removals:
        remaining &= ~departure.members
        out.append(Unit(members=departure.members, known=departure, others=remaining))
    return [*out, Unit(members=1 << base, known=None)]
