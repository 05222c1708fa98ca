"""Sets of parts as bit masks: bit i is the assembly's part i."""

from __future__ import annotations


def bits(mask: int) -> list[int]:
    """Return the positions of the set bits, lowest first."""
    out = []
    while mask:
        low = mask & -mask
        out.append(low.bit_length() - 1)
        mask ^= low
    return out
