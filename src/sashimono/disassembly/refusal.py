"""A refusal: a way out that a later level refused, and that is not to be proposed again."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Refusal:
    """Parts that leave together, and the way by which they may not."""

    members: int
    """Mask of the parts that move."""
    direction_index: int | None
    """Direction in the blocking relation; None: every motion that is not one of its directions."""
    only_turned: bool = False
    """Whether only the turn of a thread along the direction is refused; the straight pull is not."""
    simultaneous: int = 0
    """Mask of the parts that leave at the same time by motions of their own; 0: none do."""
    among: int = 0
    """Mask of the parts that stood in the way: the way is refused while all of them are there; 0: always."""


def is_refused(
    refused: Collection[Refusal],
    members: int,
    direction_index: int | None,
    others: int,
    *,
    only_turned: bool = False,
    simultaneous: int = 0,
) -> bool:
    """Return whether these parts may not leave like that past these others (masks)."""
    return any(
        each.members == members
        and each.direction_index == direction_index
        and each.only_turned == only_turned
        and each.simultaneous == simultaneous
        and not each.among & ~others
        for each in refused
    )
