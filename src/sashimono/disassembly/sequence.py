"""A disassembly sequence: which part leaves when, and which one stays as the base.

Removal is monotone (fewer parts never block more), so no removal is ever undone: as long as some
part can leave, taking it is right. What is left to choose is taste: small parts first, upwards,
in runs of the same direction, and so that what remains hangs together.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.blocking import bits
from sashimono.disassembly.separate import Cascade, Separation
from sashimono.plan import Answer

Ban = tuple[int, int]
"""A part and a signed direction (-1: any motion that is not one of them) that later levels refused."""


@dataclass(frozen=True, kw_only=True)
class SequenceConfig:
    """How a part and a direction are chosen among those that are free."""

    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Preferred direction of removal."""
    upward: float = 1.0
    """Worth of a removal straight up, against sideways at 0 and down at minus this."""
    same_direction: float = 0.5
    """Worth of a removal along the last one's direction."""
    connected: float = 2.0
    """Worth of a removal after which the remaining parts still hang together."""
    small_first: float = 1.0
    """Worth of the smallest part's removal, against that of the largest at 0."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DisassemblyResult:
    """How far the parts came apart."""

    base: int
    """The part that stays."""
    removals: tuple[tuple[int, Separation], ...]
    """Parts in the order in which they leave, each with its witness."""
    stuck: tuple[tuple[int, Separation], ...]
    """Parts that could not leave, the base aside, each with what is known."""


def find_disassembly(
    cascade: Cascade,
    *,
    config: SequenceConfig,
    banned: frozenset[Ban] = frozenset(),
    progress: Callable[[int], None] = lambda removed: None,
) -> DisassemblyResult:
    """Return an order in which the parts leave, as far as the cascade finds one."""
    chooser = _Chooser(cascade, config, banned)
    remaining = cascade.blocking.all_parts
    protected = chooser.base_among(remaining)
    removals: list[tuple[int, Separation]] = []
    stuck: list[tuple[int, Separation]] = []
    last: Float[np.ndarray, "3"] | None = None
    while remaining & (remaining - 1):
        choice = chooser.next_single(remaining, protected, last)
        if choice is None and chooser.single_free(protected, remaining):
            # the base itself can go: keep another one instead, the best of those that are left
            protected = chooser.base_among(remaining & ~(1 << protected))
            continue
        if choice is None:
            choice, stuck = chooser.next_further(remaining, protected)
        if choice is None:
            break
        part, separation = choice
        removals.append(choice)
        remaining &= ~(1 << part)
        last = None if separation.removal is None else separation.removal.exit_direction
        progress(len(removals))
    if not remaining & (remaining - 1):
        stuck, protected = [], bits(remaining)[0]
    return DisassemblyResult(
        base=protected,
        removals=tuple(removals),
        stuck=tuple(entry for entry in stuck if entry[0] != protected),
    )


class _Chooser:
    """Ranks what is free; holds the contact graph and the sizes."""

    def __init__(self, cascade: Cascade, config: SequenceConfig, banned: frozenset[Ban]) -> None:
        self.cascade, self.config, self.banned = cascade, config, banned
        table = cascade.blocking
        self.volumes = np.array([body.mass_properties.volume for body in table.bodies])
        boxes = np.array([np.ptp(part.bounds_world, axis=0) for part in cascade.assembly.parts])
        self.bulk = np.prod(boxes + 1e-9 * boxes.max(), axis=1) + self.volumes
        rank = np.argsort(np.argsort(self.bulk, kind="stable"), kind="stable")
        self.smallness = 1.0 - rank / max(1, len(rank) - 1)
        self.neighbours = [cascade.touching(part) for part in range(len(table))]
        self.up = np.array(config.up)

    def base_among(self, remaining: int) -> int:
        """The bulkiest of the best connected parts: bulk times one more than the number of touching parts."""
        parts = bits(remaining)
        scores = [self.bulk[k] * (1 + self.neighbours[k].bit_count()) for k in parts]
        return parts[int(np.argmax(np.round(np.array(scores) / max(scores), 9)))]

    def connected(self, remaining: int) -> bool:
        seen = frontier = remaining & -remaining
        while frontier:
            reached = 0
            for part in bits(frontier):
                reached |= self.neighbours[part]
            frontier = reached & remaining & ~seen
            seen |= frontier
        return seen == remaining

    def preference(self, last: Float[np.ndarray, "3"] | None) -> Callable[[Float[np.ndarray, "3"]], float]:
        def worth(direction: Float[np.ndarray, "3"]) -> float:
            same = 0.0 if last is None else self.config.same_direction * float(direction @ last > 0.9999)
            return self.config.upward * float(direction @ self.up) + same

        return worth

    def single_free(self, part: int, remaining: int) -> bool:
        worth = self.preference(None)
        return self.cascade.single(part, remaining, preference=worth, banned=self.banned) is not None

    def next_single(
        self, remaining: int, protected: int, last: Float[np.ndarray, "3"] | None
    ) -> tuple[int, Separation] | None:
        """The best part that one translation frees; the maps rank, tracing decides."""
        table, worth = self.cascade.blocking, self.preference(last)
        worths = [worth(table.direction(signed)) for signed in range(table.count_signed)]
        ranked = []
        for part in bits(remaining & ~(1 << protected)):
            others = remaining & ~(1 << part)
            free = [
                s
                for s in range(table.count_signed)
                if (part, s) not in self.banned and not table.masks(part, s)[0] & others
            ]
            if free:
                score = max(worths[s] for s in free) + self.config.small_first * self.smallness[part]
                score += self.config.connected * self.connected(others)
                ranked.append((-round(score, 6), part))
        for _, part in sorted(ranked):
            separation = self.cascade.single(part, remaining, preference=worth, banned=self.banned)
            if separation is not None:
                return part, separation
        return None

    def next_further(
        self, remaining: int, protected: int
    ) -> tuple[tuple[int, Separation] | None, list[tuple[int, Separation]]]:
        """A part that the later stages free, the protected one last; else what they say of every part."""
        said: list[tuple[int, Separation]] = []
        parts = sorted(bits(remaining), key=lambda k: (k == protected, self.bulk[k], k))
        # translations of all parts come before physics of any: they cost less
        for ask in (self.cascade.further, self.cascade.pushed):
            said = []
            for part in parts:
                if (part, -1) in self.banned:
                    continue
                separation = ask(part, remaining)
                if separation.answer is Answer.FREE:
                    return (part, separation), []
                said.append((part, separation))
        return None, said
