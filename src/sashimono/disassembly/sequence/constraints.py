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
    together: tuple[tuple[str, ...], ...] = ()
    """Groups: all parts that match any name of a group are placed one after the other, no other part between them."""


@dataclass(frozen=True, kw_only=True)
class ResolvedConstraints:
    """The same in part indices, for taking apart."""

    base: int | None
    waits: tuple[int, ...]
    """By part: mask of the parts that must have left before it may leave."""
    together: tuple[int, ...] = ()
    """Masks of parts that are placed one after the other, where an order can have that."""

    def holds_back(self, part: int, remaining: int) -> int:
        """Return the mask of the remaining parts for which this one waits."""
        return self.waits[part] & remaining & ~(1 << part)

    def and_waits(self, waits: Sequence[int]) -> ResolvedConstraints:
        """Return these, and parts that wait for more."""
        return replace(self, waits=tuple(own | more for own, more in zip(self.waits, waits, strict=True)))


def resolve(constraints: OrderConstraints, names: Sequence[str]) -> ResolvedConstraints:
    """Return the constraints in indices of these names.

    Raises SashimonoError, in one line, for a name that no part has, a base that is not one part, a part that would have
    to come before the base, for wishes that go round in a circle, which is named, and for a part that must come between
    others that are to follow one another.
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
    together = tuple(_group(group, names) for group in constraints.together)
    for words, group in zip(constraints.together, together, strict=True):
        _refuse_between(words, group, waits, base, names)
    return ResolvedConstraints(base=base, waits=tuple(waits), together=together)


def _group(words: Sequence[str], names: Sequence[str]) -> int:
    """Mask of the parts of one group, at least two."""
    option = f"--together {','.join(words)}:"
    found = dict.fromkeys(name for word in words for name in matching(names, [word], option))
    if len(found) < 2:
        raise SashimonoError(f"{option} names {len(found)} part: name two or more.")
    return sum(1 << names.index(name) for name in found)


def _refuse_between(
    words: Sequence[str], group: int, waits: Sequence[int], base: int | None, names: Sequence[str]
) -> None:
    """Raise SashimonoError for a part outside a group that --before has after one member and before another."""
    option = f"--together {','.join(words)}:"
    after = _closure(waits)
    for k, name in enumerate(names):
        if group >> k & 1:
            continue
        first = next((m for m in range(len(names)) if group >> m & 1 and after[m] >> k & 1), None)
        later = next((m for m in range(len(names)) if group >> m & 1 and after[k] >> m & 1), None)
        if first is None and base is not None and group >> base & 1:
            first = base
        if first is not None and later is not None:
            reason = f"{name} comes after {names[first]} and before {names[later]}"
            raise SashimonoError(f"{option} {reason}, as --before has it. Take one of these away.")


def _closure(waits: Sequence[int]) -> list[int]:
    """By part: mask of all that is placed after it, over any number of wishes; they go round in no circle."""
    out = list(waits)
    for _ in waits:
        grown = list(out)
        for part, mask in enumerate(out):
            for other in range(len(waits)):
                if mask >> other & 1:
                    grown[part] |= out[other]
        if grown == out:
            break
        out = grown
    return out
