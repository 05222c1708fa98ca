"""Several translations in a row, where no single one frees a part: a motion, or the proof that there is none.

The configuration space comes first. If its flood finds no way out, that is a proof. If it finds one, it leads an
exact search, best first over displacements. Each leg is traced to where the part is stopped. A leg may also end where
a flat face of the part comes level with a flat face of an obstacle.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from sashimono.disassembly.free_travel import passes
from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.translation.caging import Cages
from sashimono.disassembly.translation.configuration_space import Flood, Space, SpaceConfig
from sashimono.disassembly.translation.face_levels import FaceLevels, level_travels
from sashimono.disassembly.translation.legs import Legs
from sashimono.geometry import se3
from sashimono.geometry.overlap import intersection_depth

ROOM = -1
"""The level of the lattice that shows where there is room."""


@dataclass(frozen=True, kw_only=True)
class TranslationConfig:
    """Budgets of the search; they count work, never time."""

    space: SpaceConfig = field(default_factory=SpaceConfig)
    first_proof_work: int = 500_000
    """Lattice points looked at for a proof before a way out is looked for; the rest, if none is found."""
    max_legs: int = 50
    """Legs traced on each lattice; those that are stopped at once do not count."""
    max_traces: int = 120
    """The same with those that are stopped at once."""
    max_branches: int = 12
    """Legs queued from one displacement along one direction."""
    max_level_travels: int = 64
    """Face levels looked at on one leg."""
    face_levels: int = 16
    """Faces of one part across one line, the largest, whose levels count, besides its ends."""
    grain: float = 1e-5
    """Face levels nearer than this, relative to the part's smallest extent, are one."""
    max_directions: int = 12
    """Lines followed from each: the part's own, then the assembly's."""
    least_travel: float = 0.004
    """Displacements nearer than this, relative to the part's smallest extent, are one; under the tolerance."""
    least_leg: float = 0.03
    """Shortest leg, relative to the part's smallest extent."""
    leg_cost: float = 0.3
    """What another leg costs, in steps of the configuration space's lattice."""
    max_spaces: int = 8
    """Configuration spaces kept."""
    room_looks: int = 12
    """Places along each traced leg from which a way out is looked for where there is room."""
    booleans: int = 8
    """Poses on each leg of a way out in which the bodies shared with each obstacle are looked at: samples of large
    plain faces are too far apart to see a thin wall."""
    boolean_points: int = 1000
    """Points of each shared body that are looked at."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TranslationResult:
    """A removal of several legs, a proof that there is none, or why neither was found."""

    removal: Removal | None
    proven: bool = False
    """Whether no removal by translations exists: the parts in ``blocked_by`` alone prevent it."""
    blocked_by: tuple[int, ...] = ()
    """Without a proof: the parts met."""
    reason: str = ""
    legs: int = 0
    """Legs traced."""


class TranslationSearch:
    """Searches translations of one part at a time; configuration spaces and face levels are kept."""

    def __init__(self, parts: PlacedParts, *, config: TranslationConfig) -> None:
        self.parts = parts
        self.config = config
        self._levels = FaceLevels(parts, most=config.face_levels, grain=config.grain)
        self._spaces: dict[tuple[int, int], Space] = {}
        self._cages = Cages(parts, config=config.space)
        self._legs: Legs | None = None

    def across_sets(self) -> AbstractContextManager[None]:
        """Return a context for many sets of obstacles of one part; see `Cages.across_sets`."""
        return self._cages.across_sets()

    def search(self, part: int, others: Sequence[int]) -> TranslationResult:
        """Return a removal of the part past the others, or the proof that none exists, or neither."""
        # a proof costs least near the assembled pose, and most parts that are held are held there
        mask = sum(1 << other for other in others)
        attempt = self._cages.attempt(part, mask)
        if (proof := attempt.go_on(work=self.config.first_proof_work)) is not None:
            return _proven(proof)
        led = []
        for level in range(len(self.config.space.resolutions)):
            space = self._space(part, level)
            flood = space.flood(mask)
            if flood.blocked:
                proof = space.smaller_proof(flood.proof)
                self._cages.swap(space, proof, mask)
                return _proven(proof)
            led.append((space, flood))
        found = self._led(part, others, led)
        if found.removal is None and (proof := attempt.go_on()) is not None:
            return _proven(proof)
        return found

    def caged(self, part: int, others: Sequence[int]) -> TranslationResult:
        """Return the proof on fine lattices that the others let the part nowhere by translations, or nothing."""
        proof = self._cages.prove(part, sum(1 << other for other in others))
        return TranslationResult(removal=None) if proof is None else _proven(proof)

    def _led(self, part: int, others: Sequence[int], led: list[tuple[Space, Flood]]) -> TranslationResult:
        found = TranslationResult(removal=None)
        for space, flood in (led[-1], led[0]):  # the finest lattice is the most faithful, the coarsest sees farthest
            legs, room = self._legs_of(part), self._space(part, ROOM)
            found = _BestFirst(legs, self._levels, others, space, flood, room, self.config).run()
            if found.removal is not None:
                break
        return found

    def _legs_of(self, part: int) -> Legs:
        if self._legs is None or self._legs.part != part:
            self._legs = Legs(self.parts, part, _lines(self.parts, part, self.config.max_directions))
        return self._legs

    def _space(self, part: int, level: int) -> Space:
        key = (part, level)
        if key not in self._spaces:
            while len(self._spaces) >= self.config.max_spaces:
                self._spaces.pop(next(iter(self._spaces)))
            config, grown = self.config.space, level == ROOM
            resolution = config.room_resolution if grown else config.resolutions[level]
            self._spaces[key] = Space(self.parts, part, resolution, config=config, grown=grown)
        return self._spaces[key]


class _BestFirst:
    """One search: legs that end nearest to the way out of the configuration space first.

    How near is guessed in two ways, whose turns alternate: straight through walls, which leads out of puzzles, and
    around them, which leads along corridors. A leg is traced only when its turn comes; until then the lattice bounds
    how long it can be.
    """

    def __init__(
        self,
        legs: Legs,
        levels: FaceLevels,
        others: Sequence[int],
        space: Space,
        flood: Flood,
        room: Space,
        config: TranslationConfig,
    ) -> None:
        self.legs = legs
        self.parts, self.part, self.others = legs.parts, legs.part, list(others)
        parts, part = self.parts, self.part
        self.space, self.flood, self.room, self.config = space, flood, room, config
        self.tried: set[tuple[int, ...]] = set()
        self.boxes = parts.boxes_in(np.eye(3))
        self.mask = sum(1 << other for other in others)
        self.cell = config.least_travel * float(parts.sizes[part])
        self.least = config.least_leg * float(parts.sizes[part])
        self.lines, self.directions = legs.lines, legs.directions
        self.differences = levels.differences(part, others, self.lines)
        self.queues: tuple[list[tuple[float, int]], ...] = ([], [])
        """By guess: cost and number of each leg."""
        self.waiting: dict[int, tuple[list[np.ndarray], int, float]] = {}
        """By number, legs that are not taken yet: the path to their start, direction, length."""
        self.seen: set[tuple[int, ...]] = set()
        self.reach: dict[tuple[tuple[int, ...], int], float] = {}
        self.met: set[int] = set()
        self.queued_count = 0

    def run(self) -> TranslationResult:
        """Return the first way out, or that there is none, or that the budget ran out."""
        removal = self._through_room([np.zeros(3)], np.zeros(3), 0.0)
        if removal is not None:
            return TranslationResult(removal=removal)
        self._expand([np.zeros(3)])
        traced = looked = 0
        while self.waiting and traced < self.config.max_legs and looked < self.config.max_traces:
            path, direction_index, length = self._take(looked % len(self.queues))
            direction = self.directions[direction_index]
            key = (self._key(path[-1]), direction_index)
            end = path[-1] + (length if np.isfinite(length) else 0.0) * direction
            if length > self.reach.get(key, np.inf) or (np.isfinite(length) and self._key(end) in self.seen):
                continue
            travel, stopper = self.legs.travel(path[-1], direction_index, length, self.others, enough=self.cell)
            traced += int(travel > self.least)
            looked += 1
            if stopper is None and np.isinf(length):
                removal = self._removal(path, direction)
                if self._holds(removal):
                    return TranslationResult(removal=removal, legs=traced)
                continue
            removal = self._through_room(path, direction, travel)
            if removal is not None:
                return TranslationResult(removal=removal, legs=traced)
            if stopper is None:
                self._expand([*path, end])
                continue
            self.met.add(stopper)
            self.reach[key] = travel
            # where curved faces meet there is no level: back off to where they touch
            back = travel - self.parts.limit(self.part, stopper, self.parts.tolerances.translation)
            if back > self.least:
                self._push(path, np.array([direction_index]), np.array([back]), np.array([False]))
        reason = (
            f"translation search ran out of its budget of {traced} legs"
            if self.waiting
            else f"no way out by translations along the {len(self.lines)} lines tried, and no proof that there is none"
        )
        return TranslationResult(removal=None, blocked_by=tuple(sorted(self.met)), reason=reason, legs=traced)

    def _through_room(self, path: list[np.ndarray], direction: Float[np.ndarray, "3"], travel: float) -> Removal | None:
        """Return the removal that leaves a traced leg where there is room, if from there a way leads out."""
        steps = self.config.room_looks
        parts_of_it = np.arange(1, steps + 1) / steps if travel > self.least else np.ones(1)
        places = path[-1] + parts_of_it[:, None] * (travel * direction)
        for cell, here in zip(self.room.cells(places), places, strict=True):
            way = [] if cell in self.tried else self.room.way(self.mask, here, self.tried)
            if not way:
                continue
            stops = [*path, *([here] if travel > 0.0 else []), *way[1:]]
            legs = [(start, stop - start) for start, stop in pairwise(stops)][len(path) - 1 :]
            lengths = [float(np.linalg.norm(leg)) for _, leg in legs]
            if any(
                self._is_stopped(start, leg / length, np.inf if k == len(legs) - 1 else length)
                for k, ((start, leg), length) in enumerate(zip(legs, lengths, strict=True))
            ):
                continue
            removal = self._removal(stops[:-1], legs[-1][1] / lengths[-1])
            if self._holds(removal):
                return removal
        return None

    def _is_stopped(self, offset: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"], length: float) -> bool:
        parts, part = self.parts, self.part
        return any(
            box_travel < length and not passes(parts, part, offset, direction, other, length=length)
            for box_travel, other in parts.parts_ahead(part, offset, direction, self.others)
        )

    def _expand(self, path: list[np.ndarray]) -> None:
        """Queue the most promising legs that start at the end of a path."""
        here = path[-1]
        self.seen.add(self._key(here))
        signs, lengths, exits = [np.zeros(0, int)], [np.zeros(0)], [np.zeros(0, bool)]
        for direction_index, direction in enumerate(self.directions):
            travel, stoppers = self.space.travel(self.mask, here, direction)
            self.met.update(bits(stoppers))
            ends = level_travels(self.differences, self.lines, here, direction, travel, self.config.max_level_travels)
            ends = np.append(ends[ends > self.least], np.inf)
            signs.append(np.full(len(ends), direction_index))
            lengths.append(ends)
            exits.append(np.full(len(ends), not stoppers))
        self._push(path, np.concatenate(signs), np.concatenate(lengths), np.concatenate(exits))

    def _push(
        self,
        path: list[np.ndarray],
        direction_index: Int[np.ndarray, "leg"],
        lengths: Float[np.ndarray, "leg"],
        is_open: Bool[np.ndarray, "leg"],
    ) -> None:
        """Queue legs; infinite ones, where the lattice leaves their line open, are ways out."""
        ends = path[-1] + np.where(np.isfinite(lengths), lengths, 0.0)[:, None] * self.directions[direction_index]
        guesses = self.space.distances(self.flood, ends)
        guesses[:, np.isinf(lengths) & is_open] = 0.0
        places = np.round(ends / self.cell).astype(int).tolist()
        numbers: dict[int, int] = {}
        for queue, steps in zip(self.queues, guesses, strict=True):
            queued = np.zeros(len(self.directions), dtype=int)
            for k in np.argsort(np.round(steps, 6), kind="stable").tolist():
                is_known = np.isfinite(lengths[k]) and tuple(places[k]) in self.seen
                if is_known or queued[direction_index[k]] == self.config.max_branches:
                    continue
                queued[direction_index[k]] += 1
                if k not in numbers:
                    self.queued_count += 1
                    numbers[k] = self.queued_count
                    self.waiting[numbers[k]] = path, int(direction_index[k]), float(lengths[k])
                heapq.heappush(queue, (float(steps[k]) + self.config.leg_cost * len(path), numbers[k]))

    def _take(self, turn: int) -> tuple[list[np.ndarray], int, float]:
        """Take the leg that is best by the guess whose turn it is, or by the other one if that has none."""
        for queue in (self.queues[turn], *self.queues):
            while queue:
                _, number = heapq.heappop(queue)
                if number in self.waiting:
                    return self.waiting.pop(number)
        raise AssertionError("every leg that waits is in a queue")

    def _key(self, place: Float[np.ndarray, "3"]) -> tuple[int, ...]:
        return tuple(np.round(place / self.cell).astype(int).tolist())

    def _holds(self, removal: Removal) -> bool:
        """Return whether the exact bodies, in some poses of each leg, go no deeper than a plan may."""
        parts = self.parts
        for start, stop in pairwise(removal.displacements[:, :3, 3]):
            for u in (np.arange(self.config.booleans) + 0.5) / self.config.booleans:
                offset = (1.0 - u) * start + u * stop
                for other in self._around(offset):
                    T = se3.inverse(parts.poses[other]) @ se3.make(None, offset) @ parts.poses[self.part]
                    depth = intersection_depth(
                        parts.bodies[self.part], parts.bodies[other], T, max_points=self.config.boolean_points
                    )
                    if depth is not None and depth > self._tolerated(other):
                        self.met.add(other)
                        return False
        return True

    def _around(self, offset: Float[np.ndarray, "3"]) -> list[int]:
        """The obstacles whose boxes the part's box meets at an offset."""
        low, high = self.boxes[self.part] + offset
        boxes = self.boxes[self.others]
        meets = ((boxes[:, 0] < high) & (boxes[:, 1] > low)).all(axis=1)
        return [other for other, is_near in zip(self.others, meets, strict=True) if is_near]

    def _tolerated(self, other: int) -> float:
        """The depth that a plan may have [m]."""
        return self.parts.limit(self.part, other, self.parts.tolerances.plan)

    def _removal(self, path: list[np.ndarray], direction: Float[np.ndarray, "3"]) -> Removal:
        parts = self.parts
        back = parts.bounds_along(self.part, direction)[0] + float(path[-1] @ direction)
        front = max(parts.bounds_along(other, direction)[1] for other in self.others)
        end = path[-1] + (max(front - back, 0.0) + 0.05 * parts.sizes[self.part]) * direction
        displacements = np.stack([np.eye(4)] * (len(path) + 1))
        displacements[1:-1, :3, 3] = np.array(path[1:]).reshape(-1, 3)
        displacements[-1, :3, 3] = end
        return Removal(displacements=displacements, exit_direction=direction)


def _proven(parts: tuple[int, ...]) -> TranslationResult:
    return TranslationResult(
        removal=None,
        proven=True,
        blocked_by=parts,
        reason="proven for translations of this part alone: its configuration space has no way out past these parts",
    )


def _lines(parts: PlacedParts, part: int, most: int) -> Float[np.ndarray, "line 3"]:
    """The part's own lines, then those of all parts, without repeats."""
    kept: list[np.ndarray] = []
    for line in np.concatenate([parts.part_lines[part], parts.common_lines]):
        if len(kept) < most and all(abs(line @ other) < 0.99996 for other in kept):
            kept.append(line)
    return np.array(kept)
