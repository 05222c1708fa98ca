"""What the user wants of the order: the base, and which parts come before which.

Constraints narrow what is chosen; they never make a part free, and removal conditions stay geometric.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter

from sashimono.errors import SashimonoError
from sashimono.selection import matching


@dataclass(frozen=True, kw_only=True)
class OrderConstraints:
    """Wishes in names of parts; patterns (``bolt*``) stand for all parts that match."""

    base: str | None = None
    """The part that everything is put on."""
    before: tuple[tuple[str, str], ...] = ()
    """Pairs (first, later): every part that matches the first is placed before every one that matches the later."""


@dataclass(frozen=True, kw_only=True)
class ResolvedConstraints:
    """The same in part indices, for taking apart."""

    base: int | None
    waits: tuple[int, ...]
    """By part: mask of the parts that must have left before it may leave."""

    def holds_back(self, part: int, remaining: int) -> int:
        """Return the mask of the remaining parts for which this one waits."""
        return self.waits[part] & remaining & ~(1 << part)

    def and_waits(self, waits: Sequence[int]) -> ResolvedConstraints:
        """Return these, and parts that wait for more."""
        return replace(self, waits=tuple(own | more for own, more in zip(self.waits, waits, strict=True)))


def resolve(constraints: OrderConstraints, names: Sequence[str]) -> ResolvedConstraints:
    """Return the constraints in indices of these names.

    Raises SashimonoError, in one line, for a name that no part has, a base that is not one part, a part that would have
    to come before the base, and for wishes that go round in a circle, which is named.
    """
    index = {name: k for k, name in enumerate(names)}
    base = None
    if constraints.base is not None:
        only, *more = matching(names, [constraints.base], "--base")
        if more:
            found = ", ".join([only, *more])
            raise SashimonoError(f"--base {constraints.base} names {1 + len(more)} parts ({found}): name one.")
        base = index[only]
    waits = [0] * len(names)
    for first, later in constraints.before:
        option = f"--before {first}:{later}:"
        for a in matching(names, [first], option):
            for b in matching(names, [later], option):
                if a != b and index[b] == base:
                    raise SashimonoError(f"{option} {b} is the base, and comes before all other parts.")
                if a != b:
                    waits[index[a]] |= 1 << index[b]
    graph = {k: [b for b in range(len(names)) if waits[k] >> b & 1] for k in range(len(names))}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        # the sorter names each node before one that waits for it
        around: list[int] = list(reversed(error.args[1]))
        circle = " before ".join(names[k] for k in around)
        raise SashimonoError(f"--before: no order does it all: {circle}. Take one of these away.") from None
    return ResolvedConstraints(base=base, waits=tuple(waits))
