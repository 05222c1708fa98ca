"""Legs of one part: how far it goes along its lines, each pair of parts traced once for all sets of obstacles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.free_travel import free_travel
from sashimono.disassembly.placed_parts import PlacedParts


class Legs:
    """Free travel of one part from any displacement along given lines; what was traced is kept."""

    def __init__(self, parts: PlacedParts, part: int, lines: Float[np.ndarray, "line 3"]) -> None:
        """Take in the part and the lines; direction ``2 k`` is ``+lines[k]``, ``2 k + 1`` the opposite."""
        self.parts = parts
        self.part = part
        self.lines = lines
        self.directions = np.stack([lines, -lines], axis=1).reshape(-1, 3)
        self._known: dict[tuple[bytes, int, int], tuple[float, float]] = {}

    def travel(
        self,
        offset: Float[np.ndarray, "3"],
        direction_index: int,
        length: float,
        others: Sequence[int],
        *,
        enough: float,
    ) -> tuple[float, int | None]:
        """Return how far the part goes from an offset, up to a length [m], and the obstacle that stops it if one does.

        Of a part stopped before ``enough`` [m], always the same for a part, the travel is 0 and not necessarily the
        first obstacle is found.
        """
        shortest, stopper = length, None
        for box_travel, other in self.parts.parts_ahead(self.part, offset, self.directions[direction_index], others):
            if box_travel >= shortest:
                break
            travel = self._past(offset, direction_index, other, shortest, enough)
            if travel < shortest:
                shortest, stopper = travel, other
                if shortest < enough:
                    break
        return shortest, stopper

    def _past(
        self, offset: Float[np.ndarray, "3"], direction_index: int, other: int, length: float, enough: float
    ) -> float:
        """Travel past one obstacle, infinite beyond the length, 0 if it is no more than enough."""
        key = (offset.tobytes(), direction_index, other)
        travel, looked = self._known.get(key, (np.inf, 0.0))
        if np.isinf(travel) and looked < length:
            direction = self.directions[direction_index]
            travel = free_travel(self.parts, self.part, offset, direction, other, length=length, enough=enough)
            travel = travel if travel > enough else 0.0
            self._known[key] = (travel, length)
        return travel if travel < length else np.inf
