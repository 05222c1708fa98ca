"""Parts chosen by name or pattern."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase

from sashimono.errors import InputError


def matching(names: Sequence[str], patterns: Sequence[str], option: str, *, what: str = "part") -> tuple[str, ...]:
    """Return the names that are one of these, or match one of these patterns (``*``, ``?``), in their own order.

    Raises InputError, naming the option, for a pattern that no name matches. ``what`` has these names.
    """
    for pattern in patterns:
        if not any(name == pattern or fnmatchcase(name, pattern) for name in names):
            near = get_close_matches(pattern, names, n=3, cutoff=0.4)
            shown = ", ".join(near or names[:8]) + (", ..." if not near and len(names) > 8 else "")
            raise InputError(
                f"{option} {pattern}: no {what} is called so; {'near are' if near else 'there are'} {shown}"
            )
    return tuple(name for name in names if any(name == p or fnmatchcase(name, p) for p in patterns))
