"""The paper's disassembly planning (Algorithm 1): breadth first over states, by simulated pushes of single parts.

A state says which parts remain, and how far the one under way has come. As printed, every pair of a state and a
push waits in one queue; a push that leads to a novel, executable state enqueues that state with all of its pushes.
Where the paper is silent: a part under way is pushed on until it is out, so that each part's motion is whole, and
states are novel by the set that remains and the pose of the part under way.

A state's pushes wait in rounds, each with one push of every part. An attempt is not simulated again while all parts
that it touched remain: it would end the same way, to the bit. With several workers, attempts that wait are simulated
ahead. Their outcomes are taken in the order of the queue, or never, so workers change nothing but the
time. On a device of NVIDIA Warp (`batch`), waiting attempts are stepped together by the hundred.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, field
from itertools import islice, zip_longest

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics.batch import BatchConfig, BatchSimulator, Push
from sashimono.disassembly.physics.push import Simulated, simulate
from sashimono.disassembly.physics.search import PhysicsConfig, pushes_at
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.sequence.departures import Departure, DisassemblyResult
from sashimono.plan import Answer

IsExecutable = Callable[[int, int, Removal], bool]
"""Called with (part, mask of the other remaining parts, removal): can a robot do it?"""


_Key = tuple[int, bytes, bytes]


@dataclass(frozen=True, kw_only=True)
class Algorithm1Config:
    """Pushes, budgets and workers of Algorithm 1."""

    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    """The pushes and their simulation; its budget of pushes holds for each part and remaining set."""
    max_attempts: int = 20_000
    """Pushes simulated in all."""
    max_traced: int = 400_000_000
    """Tracing steps (`Paths.traced`) in all, which are most of the work; looked at after each push."""
    workers: int = 1
    """Threads that simulate; changes the time only."""
    batch: int = 4
    """Attempts simulated ahead for each of several workers; changes the time only. When a part leaves, attempts
    simulated ahead are wasted; so no more are simulated ahead than have failed since the last part left."""
    device: str | None = None
    """Warp device on which pushes are stepped in time, many at once (``"cuda:0"``, ``"cpu"``); None: event by event."""
    stepped: BatchConfig = field(default_factory=BatchConfig)
    """Steps and contact model on that device."""
    together: int = 512
    """Waiting attempts stepped together on that device; changes the time only."""
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

    @property
    def key(self) -> _Key:
        """What it does; it does not depend on what else remains."""
        return self.part, self.state.way[-1].tobytes(), self.push.tobytes()


@dataclass(frozen=True, kw_only=True, eq=False)
class _Outcome:
    """What an attempt led to, what that depended on, and what it cost."""

    simulated: Simulated
    remaining: int
    touched: int
    traced: int

    def holds(self, remaining: int) -> bool:
        """Whether it would end the same way with these parts remaining."""
        return not (remaining & ~self.remaining or self.touched & ~remaining)


def plan_disassembly(
    parts: PlacedParts,
    *,
    config: Algorithm1Config,
    is_executable: IsExecutable = lambda part, others, removal: True,
    refused: frozenset[int] = frozenset(),
    progress: Callable[[int], None] = lambda removed: None,
) -> DisassemblyResult:
    """Return the sequence in which the parts leave, as far as Algorithm 1 finds one; the last part is the base.

    Parts in ``refused`` are not pushed.
    """
    search = _Search(parts, config, is_executable, refused)
    for body in parts.bodies:  # cached properties: worked out here, not by several threads at once
        _ = body.signed_distance, body.hull_points
    with ThreadPoolExecutor(config.workers) if config.workers > 1 else nullcontext() as pool:
        best = search.run(pool, progress)
    left = bits(best.remaining)
    base = left[int(np.argmax([parts.bodies[k].mass_properties.volume for k in left]))]
    reason = search.spent or f"Algorithm 1 has no push left that leads to a new state, after {search.attempts}"
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
        self, parts: PlacedParts, config: Algorithm1Config, is_executable: IsExecutable, refused: frozenset[int]
    ) -> None:
        self.parts, self.config = parts, config
        self.is_executable, self.refused = is_executable, refused
        self.attempts = self.traced = 0
        self.in_row = 0
        """Attempts since the last part left."""
        self.queue: deque[_Attempt] = deque()
        self._sets: set[int] = set()
        self._poses: dict[tuple[int, int], list[np.ndarray]] = {}
        self._pushed: dict[tuple[int, int], int] = {}
        self._known: dict[_Key, _Outcome] = {}
        self._ahead: dict[_Key, Future[_Outcome]] = {}
        self._met: dict[int, set[int]] = {}
        self._stepper = (
            None if config.device is None else BatchSimulator(parts, config=config.stepped, device=config.device)
        )

    @property
    def spent(self) -> str:
        """Which budget ran out; empty while none has."""
        for unit, count, most in (
            ("pushes", self.attempts, self.config.max_attempts),
            ("tracing steps", self.traced, self.config.max_traced),
        ):
            if count >= most:
                return f"Algorithm 1 ran out of its budget of {most} {unit}"
        return ""

    def met(self, part: int) -> tuple[int, ...]:
        """The parts that stopped this one in any attempt."""
        return tuple(sorted(self._met.get(part, ())))

    def run(self, pool: Executor | None, progress: Callable[[int], None]) -> _State:
        """Return the state with the fewest parts that was reached."""
        best = _State(remaining=self.parts.all_parts, removals=())
        self._sets.add(best.remaining)
        self.enqueue(best)
        while self.queue and best.remaining.bit_count() > 1 and not self.spent:
            if self._stepper is not None:
                self.step_together(self._stepper)
            elif pool is not None:
                self.simulate_ahead(pool)
            attempt = self.queue.popleft()
            reached = self.take_in(attempt, self.outcome(attempt))
            self.in_row = self.in_row + 1 if reached is None else 0
            if reached is not None and reached.remaining.bit_count() < best.remaining.bit_count():
                best = reached
                progress(len(best.removals))
        self.forget_ahead()
        return best

    def outcome(self, attempt: _Attempt) -> Simulated:
        """What an attempt leads to: recalled, from ahead, or simulated now; counted unless it is recalled."""
        remaining = attempt.state.remaining
        known = self._known.get(attempt.key)
        if known is not None and known.holds(remaining):
            return known.simulated
        early = self._ahead.pop(attempt.key, None)
        found = None if early is None or early.cancel() else early.result()
        if found is None or not found.holds(remaining):
            found = self.simulate(attempt)
        self.attempts += 1
        self.traced += found.traced
        self._known[attempt.key] = found
        return found.simulated

    def simulate_ahead(self, pool: Executor) -> None:
        """Have the attempts that wait first simulated by the workers."""
        for attempt in islice(self.queue, min(self.in_row, self.config.batch * self.config.workers)):
            if self.is_open(attempt):
                self._ahead[attempt.key] = pool.submit(self.simulate, attempt)

    def step_together(self, stepper: BatchSimulator) -> None:
        """If the attempt that waits first is not known, step it and the next ones, on the device."""
        if not self.is_open(self.queue[0]):
            return
        waiting = [attempt for attempt in islice(self.queue, self.config.together) if self.is_open(attempt)]
        pushes = []
        for attempt in waiting:
            others = tuple(bits(attempt.state.remaining & ~(1 << attempt.part)))
            at = attempt.state.way[-1]
            pushes.append(Push(part=attempt.part, others=others, displacement=at, wrench=attempt.push))
        for attempt, simulated in zip(waiting, stepper.simulate(pushes), strict=True):
            remaining = attempt.state.remaining
            outcome: Future[_Outcome] = Future()
            outcome.set_result(_Outcome(simulated=simulated, remaining=remaining, touched=remaining, traced=0))
            self._ahead[attempt.key] = outcome

    def is_open(self, attempt: _Attempt) -> bool:
        """Whether nobody has begun to work out what it leads to."""
        known = self._known.get(attempt.key)
        return attempt.key not in self._ahead and not (known and known.holds(attempt.state.remaining))

    def forget_ahead(self) -> None:
        """Call off what no worker has begun."""
        self._ahead = {key: early for key, early in self._ahead.items() if not early.cancel()}

    def simulate(self, attempt: _Attempt) -> _Outcome:
        """A disassembly attempt."""
        state = attempt.state
        paths = self.paths(state, attempt.part)
        simulated = simulate(paths, state.way[-1], attempt.push, config=self.config.physics.simulate)
        touched = sum(1 << other for other in paths.touched)
        return _Outcome(simulated=simulated, remaining=state.remaining, touched=touched, traced=paths.traced)

    def paths(self, state: _State, part: int) -> Paths:
        others = bits(state.remaining & ~(1 << part))
        return Paths(self.parts, part, others, tolerance=self.parts.tolerances.turning)

    def take_in(self, attempt: _Attempt, outcome: Simulated) -> _State | None:
        """Enqueue the state that an attempt led to if it is novel and executable; return it if a part left."""
        part, state = attempt.part, attempt.state
        self._met.setdefault(part, set()).update(outcome.met)
        if outcome.exit_direction is None:
            self._rest(attempt, outcome)
            return None
        removal = outcome.removal(state.way)
        remaining = state.remaining & ~(1 << part)
        if not remaining or remaining in self._sets or not self.is_executable(part, remaining, removal):
            return None
        self._sets.add(remaining)
        reached = _State(remaining=remaining, removals=(*state.removals, (part, removal)))
        if self.config.monotone:
            self.queue.clear()
            self.forget_ahead()
        self.enqueue(reached)
        return reached

    def _rest(self, attempt: _Attempt, outcome: Simulated) -> None:
        """Enqueue a rest pose of a part under way, if it is new."""
        part, state = attempt.part, attempt.state
        known = self._poses.setdefault((state.remaining, part), [np.eye(4)])
        rest, paths = outcome.displacements[-1], self.paths(state, part)
        if any(paths.distance(rest, pose) <= self.config.physics.novelty * paths.size for pose in known):
            return
        known.append(rest)
        way = np.concatenate([state.way[:-1], outcome.displacements])
        self.enqueue(_State(remaining=state.remaining, removals=state.removals, part=part, way=way))

    def enqueue(self, state: _State) -> None:
        """Put all pushes of a state in the queue, as far as the budget for each part goes, in rounds over the parts."""
        waiting: list[list[_Attempt]] = []
        for part in bits(state.remaining) if state.part is None else [state.part]:
            if part in self.refused:
                continue
            key = (state.remaining, part)
            room = self.config.physics.max_pushes - self._pushed.get(key, 0)
            pushes = pushes_at(self.paths(state, part), state.way[-1], config=self.config.physics)[:room]
            self._pushed[key] = self._pushed.get(key, 0) + len(pushes)
            waiting.append([_Attempt(state=state, part=part, push=push) for push in pushes])
        for together in zip_longest(*waiting):
            self.queue.extend(attempt for attempt in together if attempt is not None)
