"""A separation: what is known about one part among the remaining ones."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from sashimono.assembly import Assembly
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.threads.declared import DeclaredThread
from sashimono.plan import Answer


@dataclass(frozen=True, kw_only=True, eq=False)
class Separation:
    """What is known about one part among the remaining ones."""

    answer: Answer
    removal: Removal | None = None
    """The witness, where the answer is FREE."""
    hits: int = 0
    """Parts that were not among the obstacles and that it would run into (a mask)."""
    signed: int | None = None
    """Its direction in the blocking relation, where it is one of them."""
    declared: DeclaredThread | None = None
    """The thread by which it is turned out, where one was declared."""
    stage: str = ""
    """The stage that answered."""
    blocked_by: tuple[int, ...] = ()
    """Parts met, where the answer is not FREE."""
    reason: str = ""


def names_of(assembly: Assembly, parts: Iterable[int]) -> tuple[str, ...]:
    """Return the names of parts given by position."""
    return tuple(assembly.names[k] for k in parts)
