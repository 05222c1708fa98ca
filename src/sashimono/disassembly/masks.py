"""Sets of parts as bit masks: bit i is the assembly's part i."""

from __future__ import annotations

from collections.abc import Callable


def bits(mask: int) -> list[int]:
    """Return the positions of the set bits, lowest first."""
    out = []
    while mask:
        low = mask & -mask
        out.append(low.bit_length() - 1)
        mask ^= low
    return out


def reached(start: int, within: int, joined: Callable[[int], int]) -> int:
    """Return the parts of a start, and those within a set that hang together with them.

    ``joined`` returns the mask of the parts that a part is joined to.
    """
    seen = frontier = start
    while frontier:
        found = 0
        for part in bits(frontier):
            found |= joined(part)
        frontier = found & within & ~seen
        seen |= frontier
    return seen


def pieces(parts: int, joined: Callable[[int], int]) -> list[int]:
    """Return the sets of parts that hang together, by their first part."""
    out = []
    while parts:
        out.append(reached(parts & -parts, parts, joined))
        parts &= ~out[-1]
    return out
