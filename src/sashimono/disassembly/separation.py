"""A separation is what is known about one part among the remaining ones. A stage is one way to find it out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.disassembly.removal import Removal
from sashimono.plan import Answer, MotionClass


@dataclass(frozen=True, kw_only=True, eq=False)
class DeclaredThread:
    """A thread that the CAD does not show."""

    axis: Float[np.ndarray, "3"]
    """Unit, world frame: the way out."""
    point: Float[np.ndarray, "3"]
    """A point on the axis [m]."""
    pitch: float
    """Shift along the axis per right-hand turn [m]."""
    other: int
    """The part in which it turns."""
    stretches: int
    """The removal begins with so many stretches along the thread."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Separation:
    """What is known about one part among the remaining ones."""

    answer: Answer
    removal: Removal | None = None
    """The witness, where the answer is FREE."""
    hits: int = 0
    """Parts that were not among the obstacles and that it would run into (a mask)."""
    direction_index: int | None = None
    """Its direction in the blocking relation, where it is one of them."""
    declared: DeclaredThread | None = None
    """The thread by which it is turned out, where one was declared."""
    stage: str = ""
    """The stage that answered."""
    proven_for: MotionClass | None = None
    """The motions that are proven not to exist; given with PROVEN_BLOCKED, and only with it."""
    blocked_by: tuple[int, ...] = ()
    """Parts met, where the answer is not FREE."""
    reason: str = ""
    traced: int = 0
    """Tracing steps that the answer took."""
    is_held: bool = False
    """Whether what holds the part leaves it one motion, which leads nowhere: motions of any kind need not be asked."""
    is_cut: bool = False
    """Whether the tracing steps that were left ran out: with more, the answer might be another."""

    def __post_init__(self) -> None:
        assert (self.answer is Answer.FREE) == (self.removal is not None), "free, and only then, with a witness"
        assert (self.answer is Answer.PROVEN_BLOCKED) == (self.proven_for is not None), "a proof is of some motions"

    def rules_out(self, stage: Stage) -> bool:
        """Return whether a stage need not be asked: its motions are proven not to exist, or the part is held."""
        return self.proven_for is stage.motions or (self.is_held and stage.motions is MotionClass.ALL)

    def and_then(self, later: Separation) -> Separation:
        """Return what is known after a later stage: its motion if it found one, else the proof and what both say."""
        if later.answer is Answer.FREE:
            return later
        proof = later if self.proven_for is None and later.proven_for is not None else self
        return replace(
            proof,
            stage=proof.stage if proof.proven_for is not None else later.stage or self.stage,
            blocked_by=self.blocked_by or later.blocked_by,
            reason="; ".join(words for words in (self.reason, later.reason) if words),
            traced=self.traced + later.traced,
            is_held=self.is_held or later.is_held,
            is_cut=self.is_cut or later.is_cut,
        )


UNASKED = Separation(answer=Answer.UNKNOWN)
"""What is known before any stage was asked."""


@runtime_checkable
class Stage(Protocol):
    """One way to find out whether a part can leave.

    Its answer depends on the question alone, never on what was asked before.
    """

    @property
    def name(self) -> str: ...

    @property
    def motions(self) -> MotionClass:
        """The motions that it looks for."""
        ...

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        """Return what it finds about a part among the remaining ones (a mask), in at most so many tracing steps."""
        ...

    def can_recall(self, found: Separation) -> bool:
        """Return whether a motion that was found before, by any stage, may answer in place of this one."""
        ...

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        """Return whether what it said of the obstacles ``asked``, no motion, holds for other obstacles too."""
        ...


def names_of(assembly: Assembly, parts: Iterable[int]) -> tuple[str, ...]:
    """Return the names of parts given by position."""
    return tuple(assembly.names[k] for k in parts)
