"""A refusal: a way out that a later level refused, and that is not to be proposed again."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Parts that leave together, and the way by which they may not."""

    members: int
    """Mask of the parts that move."""
    direction_index: int | None
    """Direction in the blocking relation; None: every motion that is not one of its directions."""
    only_turned: bool = False
    """Whether only the turn of a declared thread along the direction is refused; the straight pull is not."""
