"""Assemble-Them-All as a method of sequence inference: the product is taken apart in simulation when it is asked for.

Level 1's Algorithm 1 with pushes along the world's axes and torques about them, on one worker, as the paper describes
the difference from its own (inertia axes, in parallel). States that a known removal makes needless are left out, which
the original, that returns at its first sequence too, does by its queue. The order found is judged by the exact
conditions like any other. Its time is the wall time from meshes to the order.
"""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from types import FrameType
from typing import Any

import numpy as np

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.physics.search import PhysicsConfig
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.errors import InputError
from sashimono.geometry.features.directions import DirectionConfig
from sashimono.learning.cloud_cache import Dataset
from sashimono.learning.evaluate import probabilities_of_orders

PLANNER = Algorithm1Config(physics=PhysicsConfig(axes="world", slippage_pushes=False), workers=1)
"""Algorithm 1 with the pushes of Assemble-Them-All."""

PARTS = PlacedPartsConfig(directions=DirectionConfig(total=3))
"""The pushes are along the world's axes: the fewest lines of the parts' own will do."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AtaPredictor:
    """The order that simulation finds within so many seconds; cut short where it finds none."""

    data: Dataset
    seconds: float
    """Most wall time of one blueprint. What is not done by then has failed, and stays in the denominator."""
    planner: Algorithm1Config = PLANNER
    _known: dict[int, tuple[list[int], float]] = field(default_factory=dict)

    def encode(self, blueprints: np.ndarray) -> list[list[int]]:
        """Return the orders, base part first; each blueprint is simulated once. On the main thread only: InputError."""
        for row in blueprints.tolist():
            if row not in self._known:
                assembly = self.data.blueprints[row].assembly()
                begun = time.perf_counter()
                order = self.order(assembly)
                self._known[row] = order, time.perf_counter() - begun
        return [self._known[row][0] for row in blueprints.tolist()]

    def order(self, assembly: Assembly) -> list[int]:
        """Return an assembly order, base part first; empty where the time or a budget ran out, or parts are stuck."""
        with _limited(self.seconds):
            parts = PlacedParts(assembly, make_bodies(assembly), config=PARTS)
            found = plan_disassembly(parts, config=self.planner)
            if not found.stuck:
                return [found.base, *(departure.part for departure in reversed(found.removals))]
        return []

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
        """Return median, 90 % quantile and mean of the wall times, failures and runs out of time included."""
        times = [1e3 * self._known[int(row)][1] for row in blueprints]
        if not times:
            return {}
        median, slow = np.quantile(times, [0.5, 0.9])
        return {"median": float(median), "90 %": float(slow), "mean": float(np.mean(times))}


class _OutOfTime(BaseException):
    """Raised by the clock: no handler on the way takes it for a fault."""


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Leave the block when the time is up."""
    if threading.current_thread() is not threading.main_thread():
        raise InputError("a limit in seconds needs the main thread")

    def ring(number: int, frame: FrameType | None) -> Any:
        raise _OutOfTime

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    except _OutOfTime:
        pass
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
