"""The body that two parts share as assembled: a thread drawn as cylinders, or what a motion ploughs through."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.geometry.features.tube import SharedBody, Tube, TubeConfig, fit_tube, shared_body


@dataclass(frozen=True, kw_only=True)
class SharedConfig:
    """How what two parts share is looked at."""

    tube: TubeConfig = field(default_factory=TubeConfig)
    least_depth: float = 0.015
    """Pairs that overlap less, over the smaller part's smallest extent, share nothing that counts."""
    ploughing: float = 0.08
    """Share of the shared body's surface that, going ahead into the other part, makes a motion plough through it."""


class SharedBodies:
    """The bodies that pairs of parts of one assembly share."""

    def __init__(self, parts: PlacedParts, *, config: SharedConfig) -> None:
        self.parts = parts
        self.config = config
        self._bodies: dict[tuple[int, int], SharedBody | None] = {}
        self._overlapping: dict[int, int] = {}

    def overlapping(self, part: int, others: int) -> list[int]:
        """Return those of the others (a mask) that a part overlaps by more than touching it."""
        if part not in self._overlapping:
            least = self.config.least_depth * np.minimum(self.parts.sizes[part], self.parts.sizes)
            deep = np.flatnonzero(self.parts.overlaps[part] > least)
            self._overlapping[part] = sum(1 << int(other) for other in deep)
        return bits(self._overlapping[part] & others)

    def tube(self, part: int, other: int, axis: Float[np.ndarray, "3"]) -> Tube | None:
        """Return the tube about an axis of this direction that two parts share, world frame; None if it is none."""
        shared = self._between(part, other)
        return None if shared is None else fit_tube(shared, axis, config=self.config.tube)

    def ploughs(self, part: int, others: Sequence[int], direction: Float[np.ndarray, "3"]) -> bool:
        """Return whether a part that leaves along a direction goes through the material of these, which it overlaps.

        The overlap in the assembled pose would excuse it: a pin drawn into solid wood could leave sideways.
        """
        for other in others:
            shared = self._between(part, other)
            # seen from either part, it is the lower one that moves
            sign = 1.0 if part < other else -1.0
            if shared is not None and shared.led(sign * direction) > self.config.ploughing:
                return True
        return False

    def _between(self, part: int, other: int) -> SharedBody | None:
        key = (min(part, other), max(part, other))
        if key not in self._bodies:
            first, second = key
            parts = self.parts
            self._bodies[key] = shared_body(
                parts.bodies[first], parts.bodies[second], parts.poses[first], parts.poses[second]
            )
        return self._bodies[key]
