"""Proofs on fine lattices: the part is caged near its assembled pose, by as small a window as shows it.

A proof needs only the part of the configuration space that the flood reaches. So the lattice starts narrow and grows
only on the side where the flood comes out. That lets it be as fine as thin walls need.

Where a flood has come out past some obstacles, it comes out past fewer of them: there it need not be done again.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.translation.configuration_space import NESTED, Space, SpaceConfig
from sashimono.disassembly.translation.drawing import KeptSolids

_Key = tuple[int, tuple[int, ...]]
"""Level and window of a lattice."""


class Cages:
    """Proofs for one part at a time. What was asked of it before makes an answer faster."""

    def __init__(self, parts: PlacedParts, *, config: SpaceConfig) -> None:
        self._parts = parts
        self._config = config
        self._part = -1
        self._spaces: dict[_Key, Space] = {}
        self._kept = KeptSolids(most=config.max_kept)
        self._leaks: dict[_Key, list[tuple[int, tuple[int, int]]]] = {}
        """By lattice: past which obstacles (a mask) its flood came out, and on which side."""

    def prove(self, part: int, others: int) -> tuple[int, ...] | None:
        """Return a few of the obstacles (a mask) that let the part nowhere by translations; None without a proof."""
        return self.attempt(part, others).go_on()

    def attempt(self, part: int, others: int) -> Attempt:
        """Return the proof as something to be worked at, and to be put off for a while."""
        if part != self._part:
            self._part = part
            self._spaces.clear()
            self._leaks.clear()
            self._kept = KeptSolids(most=self._config.max_kept)
        return Attempt(self._looks(others))

    def _looks(self, others: int) -> Iterator[tuple[int, tuple[int, ...] | None]]:
        """Look from coarse to fine, from near to far: yield the lattice points of each look, and the proof it found."""
        left = self._config.max_proof_work
        resolutions = self._config.proof_resolutions
        for k in range(len(resolutions)):
            window = np.full((2, 3), self._config.proof_window)
            # a lattice that leaks must not grow until nothing is left for the finer ones
            kept = left - left // (len(resolutions) - k)
            while left > kept:
                space = self._space(k, window)
                work = space.work(others)
                if work > left:
                    break
                left -= work
                leaks = self._leaks.setdefault(_key(k, window), [])
                met = space.within_reach(others)
                rim = next((rim for past, rim in leaks if not met & ~past), None)
                if rim is None:
                    flood = space.flood(others, max_visited=self._config.max_proof_visited)
                    if flood.blocked:
                        yield work, space.smaller_proof(flood.proof, max_visited=self._config.max_proof_visited)
                        return
                    rim = flood.rim
                    if rim is not None:
                        leaks.append((met, rim))
                yield work, None
                if rim is None or space.window[rim] == space.full[rim]:
                    break  # nothing left of the part, out of budget, or really out
                window = window.copy()
                window[rim] *= self._config.proof_growth

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
