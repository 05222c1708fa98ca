"""Proofs on fine lattices: the part is caged near its assembled pose, by as small a window as shows it.

A proof needs only the part of the configuration space that the flood reaches. So the lattice starts narrow and grows
only on the side where the flood comes out. That lets it be as fine as thin walls need.

Where a flood has come out past some obstacles, it comes out past fewer of them: there it need not be done again. Where
one has not, others may hold the part as well in place of one of its obstacles: all the rings above one on a post do.
Then which of several proofs is told depends on what was asked before of the same part. So it is done only
`across_sets`: where many sets of obstacles of one part are asked about in a fixed order.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.translation.configuration_space import NESTED, Space, SpaceConfig
from sashimono.disassembly.translation.drawing import KeptSolids

_Key = tuple[int, tuple[int, ...]]
"""Level and window of a lattice."""


class Cages:
    """Proofs for one part at a time. Lattices and floods of it are kept."""

    def __init__(self, parts: PlacedParts, *, config: SpaceConfig) -> None:
        self._parts = parts
        self._config = config
        self._part = -1
        self._is_across_sets = False
        self._spaces: dict[_Key, Space] = {}
        self._kept = KeptSolids(most=config.max_kept)
        self._leaks: dict[_Key, list[tuple[int, tuple[int, int]]]] = {}
        """By lattice: past which obstacles (a mask) its flood came out, and on which side."""
        self._swapped: set[int] = set()
        """Sets of obstacles (masks) that hold the part, told by a proof with another one in place of one of them."""
        self._windows: dict[int, np.ndarray] = {}
        """By level: the window of the last proof."""
        self._never: int = 0
        """Parts (a mask) in whose place no other was found to hold it."""

    @contextmanager
    def across_sets(self) -> Iterator[None]:
        """Within this context, let what was told of some obstacles make answers about others faster."""
        self._part, self._is_across_sets = -1, True
        try:
            yield
        finally:
            self._part, self._is_across_sets = -1, False

    def prove(self, part: int, others: int) -> tuple[int, ...] | None:
        """Return a few of the obstacles (a mask) that let the part nowhere by translations; None without a proof."""
        return self.attempt(part, others).go_on()

    def attempt(self, part: int, others: int) -> Attempt:
        """Return the proof as something to be worked at, and to be put off for a while."""
        if part != self._part:
            self._part = part
            self._spaces.clear()
            self._leaks.clear()
            self._swapped.clear()
            self._windows.clear()
            self._never = 0
            self._kept = KeptSolids(most=self._config.max_kept)
        return Attempt(self._looks(others))

    def _looks(self, others: int) -> Iterator[tuple[int, tuple[int, ...] | None]]:
        """Look from coarse to fine, from near to far: yield the lattice points of each look, and the proof it found.

        Across sets, before that where the last proofs were found: that may make an answer faster, and a proof of one
        that was none.
        """
        if known := [proof for proof in self._swapped if not proof & ~others]:
            yield 0, tuple(bits(min(known, key=lambda proof: (proof.bit_count(), proof))))
            return
        for k, window in list(self._windows.items()):
            work, proof, _ = self._look(k, window, others)
            yield work, proof
            if proof is not None:
                return
        left = self._config.max_proof_work
        resolutions = self._config.proof_resolutions
        for k in range(len(resolutions)):
            window = np.full((2, 3), self._config.proof_window)
            # a lattice that leaks must not grow until nothing is left for the finer ones
            kept = left - left // (len(resolutions) - k)
            while left > kept:
                work, proof, rim = self._look(k, window, others, most=left)
                if work > left:
                    break
                left -= work
                yield work, proof
                if proof is not None:
                    return
                if rim is None:
                    break  # nothing left of the part, out of budget, or really out
                window = window.copy()
                window[rim] *= self._config.proof_growth

    def _look(
        self, level: int, window: np.ndarray, others: int, *, most: float = np.inf
    ) -> tuple[int, tuple[int, ...] | None, tuple[int, int] | None]:
        """Return the lattice points of a look, and the proof it found or the side on which a wider one may tell more.

        Of more lattice points than so many it does not look.
        """
        space = self._space(level, window)
        work = space.work(others)
        if work > most:
            return work, None, None
        leaks = self._leaks.setdefault(_key(level, window), [])
        met = space.within_reach(others)
        rim = next((rim for past, rim in leaks if met == past or (self._is_across_sets and not met & ~past)), None)
        if rim is None:
            flood = space.flood(others, max_visited=self._config.max_proof_visited)
            if flood.blocked:
                proof = space.smaller_proof(flood.proof, max_visited=self._config.max_proof_visited)
                self.swap(space, proof, others)
                if self._is_across_sets:
                    self._windows[level] = window
                return work, proof, None
            rim = flood.rim
            if rim is not None:
                leaks.append((met, rim))
        may_grow = rim is not None and space.window[rim] < space.full[rim]
        return work, None, rim if may_grow else None

    def swap(self, space: Space, proof: tuple[int, ...], others: int) -> None:
        """Note, across sets, what else would hold the part asked about last in place of one of a proof's obstacles.

        Looked at are the obstacles asked about (a mask), and those noted before: fewer may do with them as well.
        """
        if not self._is_across_sets:
            return
        among = others
        for noted in self._swapped:
            among |= noted
        for other in proof:
            if not self._never >> other & 1:
                rest = sum(1 << part for part in proof if part != other)
                found = space.swapped(proof, other, among=among & ~(rest | 1 << other))
                self._swapped.update(rest | 1 << part for part in bits(found))
                self._never |= 0 if found else 1 << other

    def _space(self, level: int, window: np.ndarray) -> Space:
        """The lattice of one level, and before it those of the coarser ones that it builds on."""
        key = _key(level, window)
        if key not in self._spaces:
            parent = None if level == 0 else self._space(level - 1, (window + NESTED // 2) // NESTED)
            while len(self._spaces) >= self._config.max_proof_spaces:
                self._spaces.pop(next(iter(self._spaces)))
            resolution = self._config.proof_resolutions[level]
            self._spaces[key] = Space(
                self._parts, self._part, resolution, config=self._config, window=window, parent=parent, kept=self._kept
            )
        return self._spaces[key]


def _key(level: int, window: np.ndarray) -> _Key:
    return level, tuple(window.ravel().tolist())


class Attempt:
    """One proof that is worked at in portions."""

    def __init__(self, looks: Iterator[tuple[int, tuple[int, ...] | None]]) -> None:
        self._looks = looks

    def go_on(self, *, work: int | None = None) -> tuple[int, ...] | None:
        """Return the obstacles that hold the part, or None if so much more work (lattice points) shows nothing.

        Without a limit, till the end of the budget.
        """
        for done, proof in self._looks:
            if proof is not None:
                return proof
            if work is not None:
                work -= done
                if work <= 0:
                    break
        return None
