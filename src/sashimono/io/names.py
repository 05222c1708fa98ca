"""Names of parts: the first that says something, each only once."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

_MEANINGLESS = re.compile(
    r"\s*|=>\[.*\]|NAUO\d*|(solid|compound|compsolid|shell|mesh|node|geometry)[ _.]?\d*", re.IGNORECASE
)


def says_nothing(name: str) -> bool:
    """Return whether a name says nothing of the thing: empty, a converter's number, or "SOLID"."""
    return _MEANINGLESS.fullmatch(name.strip()) is not None


def choose_name(candidates: Sequence[str]) -> str:
    """Return the first name that says something; "part" if none does. A converter's number or "SOLID" says nothing."""
    for name in candidates:
        clean = " ".join("".join(c if c.isprintable() else " " for c in name).split())
        if not _MEANINGLESS.fullmatch(clean):
            return clean
    return "part"


def unique_names(names: Sequence[str]) -> list[str]:
    """Return the names with repeated ones numbered from 1 in order; no number collides with a name that is there."""
    counts = Counter(names)
    taken = {name for name in names if counts[name] == 1}
    numbers: dict[str, int] = {}
    out = []
    for name in names:
        if counts[name] == 1:
            out.append(name)
            continue
        k = numbers.get(name, 0) + 1
        while f"{name}_{k}" in taken:
            k += 1
        numbers[name] = k
        taken.add(f"{name}_{k}")
        out.append(f"{name}_{k}")
    return out
