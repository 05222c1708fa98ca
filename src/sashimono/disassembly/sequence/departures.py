"""What comes of a disassembly: which parts left, by which motions, and what is known of those that stayed."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from sashimono.disassembly.refusal import Refusal, is_refused
from sashimono.disassembly.separation import Separation


@dataclass(frozen=True, kw_only=True, eq=False)
class Departure:
    """One part, or several that move as one body, leaving those that remain."""

    part: int
    """The part, or the one of them that stays when they are taken apart; its name stands for all."""
    members: int
    """Mask of all that move."""
    separation: Separation
    """With the witness."""
    inside: DisassemblyResult | None = None
    """How a subassembly comes apart by itself; None for a single part."""
    product: str | None = None
    """The product of the file's tree that it is, if it leaves as one for that."""
    simultaneous: int = 0
    """Mask of the parts of the departures next to it that happen at the same time; 0: none do."""

    @property
    def refusal(self) -> Refusal:
        """What is to be refused if this departure does not hold."""
        return Refusal(
            members=self.members,
            direction_index=self.separation.direction_index,
            simultaneous=self.simultaneous,
        )

    @property
    def path_refusal(self) -> Refusal:
        """What is to be refused if its path does not hold: of a thread the turn, but not the straight pull."""
        return replace(self.refusal, only_turned=self._is_turned)

    @property
    def _is_turned(self) -> bool:
        """Whether it is turned by a thread where one translation would do."""
        separation = self.separation
        if separation.direction_index is None or separation.removal is None:
            return False
        return bool(np.abs(separation.removal.displacements[:, :3, :3] - np.eye(3)).max() > 1e-9)

    def avoids(self, refused: Collection[Refusal], others: int) -> bool:
        """Return whether none of these refusals is about this departure past these others (a mask), insides aside."""
        s = self.separation.direction_index
        if self._is_turned and is_refused(refused, self.members, s, others, only_turned=True):
            return False
        return not is_refused(refused, self.members, s, others & ~self.simultaneous, simultaneous=self.simultaneous)


@dataclass(frozen=True, kw_only=True)
class Turn:
    """The product is turned over once."""

    count: int
    """How many parts leave, the first ones, before it is: so many are placed after it was turned over in assembly."""
    up: tuple[float, float, float]
    """Away from the table on which they are placed, unit."""


@dataclass(frozen=True, kw_only=True)
class HeldProduct:
    """A product that was to leave as one and could not."""

    name: str
    core: int
    """Mask of what is left of it once so many of its own parts have left that something else can; 0 for nothing."""
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class DisassemblyResult:
    """How far the parts came apart."""

    base: int
    """The part that stays."""
    removals: tuple[Departure, ...]
    """What leaves, in order."""
    stuck: tuple[tuple[int, Separation], ...]
    """Parts that could not leave, the base and what is inside subassemblies aside, each with what is known."""
    up: tuple[float, float, float] | None = None
    """Away from the table that the order is for; None: any."""
    turn: Turn | None = None
    """Where the product is turned over from that table to another; None: it is not."""
    held_products: tuple[HeldProduct, ...] = ()
    """Products that were to leave as one and could not."""

    def avoids(self, refused: Collection[Refusal], start: int) -> bool:
        """Return whether none of these refusals is about any of its departures, those inside subassemblies included.

        Args:
            refused: Ways out that are not to be taken.
            start: Mask of the parts that were there.
        """
        remaining = start
        for departure in self.removals:
            remaining &= ~departure.members
            if not departure.avoids(refused, remaining):
                return False
            if departure.inside is not None and not departure.inside.avoids(refused, departure.members):
                return False
        return True

    def levels(self) -> Iterator[DisassemblyResult]:
        """Yield how far the parts came apart, and those inside each subassembly by themselves."""
        yield self
        for departure in self.departures():
            if departure.inside is not None:
                yield departure.inside

    def departures(self) -> Iterator[Departure]:
        """Yield every departure, those inside subassemblies included."""
        for departure in self.removals:
            yield departure
            if departure.inside is not None:
                yield from departure.inside.departures()
