"""Several translations in a row, where no single one frees a part: a motion, or the proof that there is none.

The configuration space comes first: if its flood finds no way out, that is a proof. Where it finds
one, it leads an exact search: best first over displacements, each leg traced to where the part is
stopped, with halts where a flat face of the part comes level with a flat face of an obstacle.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.blocking import Blocking, bits
from sashimono.disassembly.cspace import Flood, Space, SpaceConfig
from sashimono.disassembly.halts import Levels
from sashimono.disassembly.removal import Removal


@dataclass(frozen=True, kw_only=True)
class TranslationConfig:
    """Budgets of the search; they count work, never time."""

    space: SpaceConfig = field(default_factory=SpaceConfig)
    max_expansions: int = 40
    """Displacements expanded."""
    max_directions: int = 12
    """Lines followed from each: the part's own, then the assembly's."""
    least_travel: float = 0.004
    """Displacements nearer than this, relative to the part's smallest extent, are one; under the tolerance."""
    leg_cost: float = 0.3
    """What another leg costs, in steps of the configuration space's lattice."""
    max_spaces: int = 4
    """Configuration spaces kept."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TranslationResult:
    """A removal of several legs, a proof that there is none, or why neither was found."""

    removal: Removal | None
    proven: bool = False
    """Whether no removal by translations exists: the parts in ``blocked_by`` alone prevent it."""
    blocked_by: tuple[int, ...] = ()
    """Without a proof: the parts met."""
    reason: str = ""
    expansions: int = 0


class TranslationSearch:
    """Searches translations of one part at a time; configuration spaces and face levels are kept."""

    def __init__(self, blocking: Blocking, *, config: TranslationConfig) -> None:
        self.blocking = blocking
        self.config = config
        self._levels = Levels(blocking)
        self._spaces: dict[tuple[int, int], Space] = {}

    def search(self, part: int, others: Sequence[int]) -> TranslationResult:
        """Return a removal of the part past the others, or the proof that none exists, or neither."""
        mask = sum(1 << other for other in others)
        found = TranslationResult(removal=None)
        for level in range(len(self.config.space.resolutions)):
            space = self._space(part, level)
            flood = space.flood(mask)
            if flood.blocked:
                return TranslationResult(
                    removal=None,
                    proven=True,
                    blocked_by=flood.proof,
                    reason="proven for translations of this part alone: "
                    "its configuration space has no way out past these parts",
                )
            if level == 0:
                found = _BestFirst(self.blocking, self._levels, part, others, space, flood, self.config).run()
                if found.removal is not None:
                    return found
        return found

    def hit_by(self, part: int, removal: Removal, among: Sequence[int]) -> int:
        """Return the mask of the parts that a removal by translations runs into."""
        mask = 0
        stops = removal.displacements[:, :3, 3]
        for other in among:
            for leg, (start, stop) in enumerate(pairwise(stops)):
                length = np.inf if leg == len(stops) - 2 else float(np.linalg.norm(stop - start))
                direction = (stop - start) / np.linalg.norm(stop - start)
                if np.isfinite(self.blocking.travel(part, start, direction, other, length=length)):
                    mask |= 1 << other
                    break
        return mask

    def _space(self, part: int, level: int) -> Space:
        key = (part, level)
        if key not in self._spaces:
            while len(self._spaces) >= self.config.max_spaces:
                self._spaces.pop(next(iter(self._spaces)))
            config = self.config.space
            self._spaces[key] = Space(self.blocking, part, config.resolutions[level], config=config)
        return self._spaces[key]


class _BestFirst:
    """One search: displacements nearest to the way out of the configuration space first."""

    def __init__(
        self,
        blocking: Blocking,
        levels: Levels,
        part: int,
        others: Sequence[int],
        space: Space,
        flood: Flood,
        config: TranslationConfig,
    ) -> None:
        self.blocking, self.levels, self.part, self.others = blocking, levels, part, list(others)
        self.space, self.steps, self.config = space, flood.steps, config
        self.cell = config.least_travel * float(blocking.sizes[part])
        self.lines = _lines(blocking, part, config.max_directions)
        self.queue: list[tuple[float, int, np.ndarray, list[np.ndarray]]] = []
        self.seen: set[tuple[int, ...]] = set()
        self.met: set[int] = set()
        self.pushed = 0

    def run(self) -> TranslationResult:
        self._push(np.zeros(3), [])
        expansions = 0
        while self.queue and expansions < self.config.max_expansions:
            _, _, offset, path = heapq.heappop(self.queue)
            expansions += 1
            reached: list[tuple[np.ndarray, float, int]] = []
            for line in self.lines:
                for direction in (line, -line):
                    travel, stopper = self._travel(offset, direction)
                    if stopper is None:
                        removal = self._removal(path, direction)
                        return TranslationResult(removal=removal, expansions=expansions)
                    self.met.add(stopper)
                    reached.append((direction, travel, stopper))
            for direction, travel, stopper in reached:
                if travel < self.cell:
                    continue
                for halt in self.levels.halts(self.part, self.others, self.lines, offset, direction, travel):
                    self._push(offset + halt * direction, path)
                # where curved faces meet there is no level: back off to where they touch
                back = travel - self.blocking.limit(self.part, stopper)
                if back > self.cell:
                    self._push(offset + back * direction, path)
        reason = (
            f"translation search ran out of its budget of {expansions} displacements"
            if self.queue
            else f"no way out by translations along the {len(self.lines)} lines tried, and no proof that there is none"
        )
        return TranslationResult(
            removal=None, blocked_by=tuple(sorted(self.met)), reason=reason, expansions=expansions
        )

    def _push(self, place: Float[np.ndarray, "3"], path: list[np.ndarray]) -> None:
        key = tuple(int(x) for x in np.round(place / self.cell))
        if key in self.seen:
            return
        self.seen.add(key)
        self.pushed += 1
        ahead = 0.0 if self.steps is None else self.space.distance(self.steps, place)
        cost = ahead + self.config.leg_cost * len(path)
        heapq.heappush(self.queue, (cost, self.pushed, place, [*path, place]))

    def _travel(
        self, offset: Float[np.ndarray, "3"], direction: Float[np.ndarray, "3"]
    ) -> tuple[float, int | None]:
        """How far the part goes from an offset, and the obstacle that stops it there."""
        shortest, stopper = np.inf, None
        for meeting, other in self.blocking.met(self.part, offset, direction, self.others):
            if meeting >= shortest:
                break
            travel = self.blocking.travel(self.part, offset, direction, other, length=shortest)
            if travel < shortest:
                shortest, stopper = travel, other
                if shortest < self.cell:
                    break
        return shortest, stopper

    def _removal(self, path: list[np.ndarray], direction: Float[np.ndarray, "3"]) -> Removal:
        blocking = self.blocking
        back = blocking.world_bounds_along(self.part, direction)[0] + float(path[-1] @ direction)
        front = max(blocking.world_bounds_along(other, direction)[1] for other in self.others)
        end = path[-1] + (max(front - back, 0.0) + 0.05 * blocking.sizes[self.part]) * direction
        displacements = np.stack([np.eye(4)] * (len(path) + 1))
        displacements[1:-1, :3, 3] = np.array(path[1:]).reshape(-1, 3)
        displacements[-1, :3, 3] = end
        return Removal(displacements=displacements, exit_direction=direction)


def _lines(blocking: Blocking, part: int, most: int) -> Float[np.ndarray, "line 3"]:
    """The part's own lines, then the assembly's, without repeats."""
    kept: list[np.ndarray] = []
    for line in np.concatenate([blocking.part_lines[part], blocking.directions]):
        if len(kept) < most and all(abs(line @ other) < 0.99996 for other in kept):
            kept.append(line)
    return np.array(kept)
