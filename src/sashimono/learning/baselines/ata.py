"""Assemble-Them-All as a method of sequence inference: the product is taken apart in simulation.

Level 1's Algorithm 1 with pushes along the world's axes and torques about them, on one worker, as the paper describes
the difference from its own (inertia axes, in parallel). States that a known removal makes needless are left out, which
the original, that returns at its first sequence too, does by its queue. The order found is judged by the exact
conditions like any other. Its time is the processor time from meshes to the order, so that several blueprints may be
simulated side by side, on a machine that does other work too.
"""

from __future__ import annotations

import logging
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from types import FrameType
from typing import Any

import numpy as np

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.d4pas.journal import Journal
from sashimono.d4pas.workers import DIED, run_items
from sashimono.disassembly.physics.search import PhysicsConfig
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.geometry.features.directions import DirectionConfig
from sashimono.learning.cloud_cache import CloudCache, Dataset
from sashimono.learning.evaluate import probabilities_of_orders

VERSION = 1
"""Raised whenever the same blueprint would give another order."""

PLANNER = Algorithm1Config(physics=PhysicsConfig(axes="world", slippage_pushes=False), workers=1)
"""Algorithm 1 with the pushes of Assemble-Them-All."""

PARTS = PlacedPartsConfig(directions=DirectionConfig(total=3))
"""The pushes are along the world's axes: the fewest lines of the parts' own will do."""


log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True, eq=False)
class AtaPredictor:
    """The orders that simulation found; none where it was cut short or got stuck."""

    found: dict[int, tuple[list[int], float]]
    """By blueprint of the cache: the order, base part first, empty where there is none; and processor time [s]."""

    def encode(self, blueprints: np.ndarray) -> list[list[int]]:
        """Return the orders of these blueprints."""
        return [self.found[int(row)][0] for row in blueprints]

    def probabilities(self, encoded: list[list[int]], placed: np.ndarray) -> np.ndarray:
        """Return 1 for the first part of the order that is not placed; nothing for a blueprint without an order."""
        return probabilities_of_orders(encoded, placed)

    def orders(self, encoded: list[list[int]]) -> list[list[int]]:
        """Return the orders."""
        return encoded

    def pose_errors(self, encoded: list[list[int]]) -> None:
        """Return None: there are no poses."""
        return None

    def milliseconds(self, blueprints: Sequence[int] | np.ndarray) -> dict[str, float]:
        """Return median, 90 % quantile and mean of the times, failures and runs out of time included."""
        times = [1e3 * self.found[int(row)][1] for row in blueprints]
        if not times:
            return {}
        median, slow = np.quantile(times, [0.5, 0.9])
        return {"median": float(median), "90 %": float(slow), "mean": float(np.mean(times))}


def simulate(
    cache: CloudCache,
    data: Dataset,
    rows: Sequence[int] | np.ndarray,
    *,
    seconds: float,
    workers: int = 1,
    say: Callable[[str], None] = lambda line: None,
) -> AtaPredictor:
    """Return what simulation finds of these blueprints of the cache, each within so much processor time.

    What is found is kept beside the clouds: a run that is killed goes on, and none is simulated twice. A blueprint is
    simulated in a process of its own; one that dies has found nothing.
    """
    journal = Journal(cache.folder / f"ata-{VERSION}-{seconds:g}.jsonl", {"ata": VERSION, "seconds": seconds})
    try:
        wanted = [data.blueprints[int(row)] for row in rows]
        todo = [blueprint for blueprint in wanted if blueprint.id not in journal.done]
        work = partial(_simulated, seconds=seconds)
        for count, (blueprint, entry) in enumerate(run_items(todo, work, workers=workers), start=1):
            if entry is None:
                log.warning("%s: %s", blueprint.id, DIED)
            journal.add(blueprint.id, entry or {"order": [], "seconds": seconds})
            if count % 50 == 0:
                say(f"simulated {count} of {len(todo)} blueprints")
        entries = [journal.done[blueprint.id] for blueprint in wanted]
    finally:
        journal.close()
    found = {int(row): (entry["order"], entry["seconds"]) for row, entry in zip(rows, entries, strict=True)}
    return AtaPredictor(found=found)


def simulated_order(assembly: Assembly, *, seconds: float, planner: Algorithm1Config = PLANNER) -> list[int]:
    """Return an assembly order, base part first; empty where the processor time or a budget ran out, or parts are
    stuck. On the main thread only."""
    with _limited(seconds):
        parts = PlacedParts(assembly, make_bodies(assembly), config=PARTS)
        found = plan_disassembly(parts, config=planner)
        if not found.stuck:
            return [found.base, *(departure.part for departure in reversed(found.removals))]
    return []


def _simulated(blueprint: Any, *, seconds: float) -> dict[str, Any]:
    assembly = blueprint.assembly()
    begun = time.process_time()
    order = simulated_order(assembly, seconds=seconds)
    return {"order": order, "seconds": round(time.process_time() - begun, 4)}


class _OutOfTime(BaseException):
    """Raised by the clock: no handler on the way takes it for a fault."""


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Leave the block when so much processor time has passed."""

    def ring(number: int, frame: FrameType | None) -> Any:
        raise _OutOfTime

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        yield
    except _OutOfTime:
        pass
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
