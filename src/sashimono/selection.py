"""Parts chosen by name or pattern, and a name for several."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from difflib import get_close_matches
from fnmatch import fnmatchcase
from itertools import chain, count, takewhile

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


def shared_name(names: Iterable[str], taken: Collection[str], otherwise: str) -> str:
    """Return a name for several parts that is not taken: the words that all their names begin with, or another word.

    That one, ``otherwise``, is numbered from 2 where it is taken.
    """
    words = [re.split(r"(?<=[_ .:-])", name) for name in sorted(names)]
    common = list(takewhile(lambda same: len(set(same)) == 1, zip(*words, strict=False)))
    begins = ["".join(same[0] for same in common[:k]).strip("_ .:-") for k in range(len(common), 0, -1)]
    numbered = (f"{otherwise}_{k}" if k > 1 else otherwise for k in count(1))
    tried = chain((name for name in begins if re.search(r"[^\W\d]{2}", name)), numbered)
    return next(name for name in tried if name not in taken)
