"""The paper's disassembly planning (Algorithm 1): breadth first over states, by simulated pushes of single parts.

A state says which parts remain, and how far the one under way has come. As printed, every pair of a state and a
push waits in one queue; a push that leads to a novel, executable state enqueues that state with all of its pushes.
Where the paper is silent: a part under way is pushed on until it is out, so that each part's motion is whole, and
states are novel by the set that remains and the pose of the part under way.

Attempts are taken from the queue in batches and simulated side by side. What a batch found is taken in in the order
of the queue, so the number of workers changes nothing but the time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.blocking import Blocking, bits
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics import PhysicsConfig, pushes_at
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separate import Separation
from sashimono.disassembly.sequence import Departure, DisassemblyResult
from sashimono.disassembly.simulate import Simulated, simulate
from sashimono.plan import Answer

IsExecutable = Callable[[int, int, Removal], bool]
"""Called with (part, mask of the other remaining parts, removal): can a robot do it?"""


@dataclass(frozen=True, kw_only=True)
class Algorithm1Config:
    """Pushes, budget and batching of Algorithm 1."""

    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    """The pushes and their simulation; its budget of pushes holds for each part and remaining set."""
    max_attempts: int = 20_000
    """Pushes simulated in all."""
    batch: int = 32
    """Attempts simulated side by side; part of the answer, unlike the number of workers."""
    workers: int = 1
    """Threads that simulate; changes the time only."""
    monotone: bool = True
    """Drop all states in which a part remains that is known to leave. Fewer obstacles never block a motion, so no
    answer is lost; without it the queue grows exponentially with the parts, as printed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _State:
    """Which parts remain, the one under way, and how it and the ones before it came here."""

    remaining: int
    removals: tuple[tuple[int, Removal], ...]
    part: int | None = None
    way: Float[np.ndarray, "waypoint 4 4"] = field(default_factory=lambda: np.eye(4)[None])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Attempt:
    state: _State
    part: int
    push: Float[np.ndarray, "6"]


def plan_disassembly(
    blocking: Blocking,
    *,
    config: Algorithm1Config,
    is_executable: IsExecutable = lambda part, others, removal: True,
    refused: frozenset[int] = frozenset(),
    progress: Callable[[int], None] = lambda removed: None,
) -> DisassemblyResult:
    """Return the sequence in which the parts leave, as far as Algorithm 1 finds one; the last part is the base.

    Parts in ``refused`` are not pushed.
    """
    search = _Search(blocking, config, is_executable, refused)
    for body in blocking.bodies:  # worked out here, not by several threads at once
        assert body.signed_distance is not None
        assert len(body.hull_points)
    with ThreadPoolExecutor(config.workers) if config.workers > 1 else nullcontext() as pool:
        best = search.run(pool, progress)
    left = bits(best.remaining)
    base = left[int(np.argmax([blocking.bodies[k].mass_properties.volume for k in left]))]
    reason = (
        f"Algorithm 1 ran out of its budget of {config.max_attempts} pushes"
        if search.attempts >= config.max_attempts
        else f"Algorithm 1 has no push left that leads to a new state, after {search.attempts}"
    )
    return DisassemblyResult(
        base=base,
        removals=tuple(
            Departure(
                part=part,
                members=1 << part,
                separation=Separation(answer=Answer.FREE, removal=removal, stage="algorithm1"),
            )
            for part, removal in best.removals
        ),
        stuck=tuple(
            (part, Separation(answer=Answer.UNKNOWN, stage="algorithm1", blocked_by=search.met(part), reason=reason))
            for part in left
            if part != base
        ),
    )


class _Search:
    """The queue and what was seen."""

    def __init__(
        self, blocking: Blocking, config: Algorithm1Config, is_executable: IsExecutable, refused: frozenset[int]
    ) -> None:
        self.blocking, self.config = blocking, config
        self.is_executable, self.refused = is_executable, refused
        self.attempts = 0
        self.queue: deque[_Attempt] = deque()
        self._sets: set[int] = set()
        self._poses: dict[tuple[int, int], list[np.ndarray]] = {}
        self._spent: dict[tuple[int, int], int] = {}
        self._met: dict[int, set[int]] = {}

    def met(self, part: int) -> tuple[int, ...]:
        """The parts that stopped this one in any attempt."""
        return tuple(sorted(self._met.get(part, ())))

    def run(self, pool: Executor | None, progress: Callable[[int], None]) -> _State:
        """Return the state with the fewest parts that was reached."""
        best = _State(remaining=self.blocking.all_parts, removals=())
        self._sets.add(best.remaining)
        self.enqueue(best)
        while self.queue and self.attempts < self.config.max_attempts:
            size = min(self.config.batch, self.config.max_attempts - self.attempts, len(self.queue))
            batch = [self.queue.popleft() for _ in range(size)]
            self.attempts += size
            outcomes = map(self.simulate, batch) if pool is None else pool.map(self.simulate, batch)
            for attempt, outcome in zip(batch, list(outcomes), strict=True):
                reached = self.take_in(attempt, outcome, best)
                if reached is not None and reached.remaining.bit_count() < best.remaining.bit_count():
                    best = reached
                    progress(len(best.removals))
            if best.remaining.bit_count() == 1:
                break
        return best

    def simulate(self, attempt: _Attempt) -> Simulated:
        """A disassembly attempt."""
        return simulate(self.paths(attempt), attempt.state.way[-1], attempt.push, config=self.config.physics.simulate)

    def paths(self, attempt: _Attempt) -> Paths:
        others = bits(attempt.state.remaining & ~(1 << attempt.part))
        return Paths(self.blocking, attempt.part, others, tolerance=self.config.physics.tolerance)

    def take_in(self, attempt: _Attempt, outcome: Simulated, best: _State) -> _State | None:
        """Enqueue the state that an attempt led to if it is novel and executable; return it if a part left."""
        part, state = attempt.part, attempt.state
        self._met.setdefault(part, set()).update(outcome.met)
        if outcome.exit_direction is None:
            self._rest(attempt, outcome)
            return None
        base = state
        if self.config.monotone:
            if not best.remaining >> part & 1:
                return None
            base = best  # what left since the attempt was made is no obstacle
        removal = outcome.removal(state.way)
        remaining = base.remaining & ~(1 << part)
        if not remaining or remaining in self._sets or not self.is_executable(part, remaining, removal):
            return None
        self._sets.add(remaining)
        reached = _State(remaining=remaining, removals=(*base.removals, (part, removal)))
        if self.config.monotone:
            self.queue.clear()
        self.enqueue(reached)
        return reached

    def _rest(self, attempt: _Attempt, outcome: Simulated) -> None:
        """Enqueue a rest pose of a part under way, if it is new."""
        part, state = attempt.part, attempt.state
        known = self._poses.setdefault((state.remaining, part), [np.eye(4)])
        rest, paths = outcome.displacements[-1], self.paths(attempt)
        if any(paths.distance(rest, pose) <= self.config.physics.novelty * paths.size for pose in known):
            return
        known.append(rest)
        way = np.concatenate([state.way[:-1], outcome.displacements])
        self.enqueue(_State(remaining=state.remaining, removals=state.removals, part=part, way=way))

    def enqueue(self, state: _State) -> None:
        """Put all pushes of a state in the queue, as far as the budget for each part goes."""
        parts = bits(state.remaining) if state.part is None else [state.part]
        for part in parts:
            if part in self.refused:
                continue
            key = (state.remaining, part)
            waiting = _Attempt(state=state, part=part, push=np.zeros(6))
            pushes = pushes_at(self.paths(waiting), state.way[-1], config=self.config.physics)
            room = self.config.physics.max_pushes - self._spent.get(key, 0)
            self._spent[key] = self._spent.get(key, 0) + min(room, len(pushes))
            self.queue.extend(_Attempt(state=state, part=part, push=push) for push in pushes[:room])
