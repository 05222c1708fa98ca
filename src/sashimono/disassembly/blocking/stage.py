"""The first stage: one translation along a direction of the blocking relation."""

from __future__ import annotations

from collections.abc import Callable, Collection

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.blocking.relation import Blocking
from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.separation import Separation
from sashimono.plan import Answer, MotionClass


class BlockingStage:
    """Single translations. Nothing needs to be remembered: the relation has every answer."""

    name = "blocking"
    motions = MotionClass.TRANSLATIONS

    def __init__(self, blocking: Blocking) -> None:
        self.blocking = blocking

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        """Return the removal by one translation that leads up the most; UNKNOWN where no direction is free."""
        found = self.along(part, remaining, preference=lambda direction: float(direction[2]))
        return found or Separation(answer=Answer.UNKNOWN, stage=self.name)

    def along(
        self,
        part: int,
        remaining: int,
        *,
        preference: Callable[[Float[np.ndarray, "3"]], float],
        refused: frozenset[Refusal] = frozenset(),
        among: Collection[int] | None = None,
    ) -> Separation | None:
        """Return a removal by one translation along a direction of the relation, the most preferred; or None.

        Args:
            part: The part.
            remaining: Mask of the parts that are there.
            preference: Of a unit direction; the highest is tried first.
            refused: Ways out that must not be returned.
            among: The direction indices to ask about; all if None.
        """
        others = remaining & ~(1 << part)
        blocking = self.blocking
        asked = range(blocking.count_directions) if among is None else among
        for direction_index in sorted(asked, key=lambda s: (-round(preference(blocking.direction(s)), 6), s)):
            if is_refused(refused, 1 << part, direction_index, others):
                continue
            if blocking.is_free(part, direction_index, others):
                removal = blocking.parts.straight_removal(1 << part, others, blocking.direction(direction_index))
                return Separation(answer=Answer.FREE, removal=removal, direction_index=direction_index, stage=self.name)
        return None

    def can_recall(self, found: Separation) -> bool:
        return False

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        return False
