"""Putting a product together step by step, as a game: what is seen, what a step is worth, when it is over.

A step names a part and one of its six signed inertia axes. It is right if and only if, by the exact conditions of the
dataset, some complete sequence goes on with this part (``y = 1``: it goes in now, and no later part is shut out), and
the axis is one of those along which it goes in (`sashimono.learning.baselines.ways`). Which steps are right is never
told beforehand: a player learns it by taking them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sashimono.d4pas.states import Masks, can_leave, is_reachable
from sashimono.errors import InputError
from sashimono.learning.baselines.ways import AXES, Ways, add_ways
from sashimono.learning.cloud_cache import CloudCache, Dataset

RIGHT, WRONG, WHOLE = 1.0, -1.0, 5.0
"""Rewards: of a right step, of a wrong one, and of the last right step besides."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bench:
    """Blueprints to put together, with all that is known of them."""

    cache: CloudCache
    rows: np.ndarray
    """Which of the cache's blueprints, ascending."""
    masks: dict[int, Masks]
    """Removal conditions, by row."""
    ways: dict[int, Ways]
    """Ways in by axis, by row."""

    @property
    def most_parts(self) -> int:
        """Parts of the largest blueprint."""
        return int(self.cache.counts[self.rows].max())

    def clouds(self, row: int, points: int, target_points: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the clouds of a blueprint (point, 6) and of its parts in place (part, point, 6), in the unit frame."""
        parts = np.asarray(self.cache.part_points[self.cache.parts_of(row), :points], dtype=np.float32)
        return np.asarray(self.cache.blueprint_points[row, :target_points], dtype=np.float32), parts


def make_bench(cache: CloudCache, data: Dataset, rows: Sequence[int] | np.ndarray, *, workers: int = 1) -> Bench:
    """Return the bench of these blueprints of the cache, without those of two parts. Ways not known yet are found.

    Raises InputError if no blueprint is left.
    """
    kept = np.unique(np.asarray(rows, dtype=np.int64))
    kept = kept[cache.counts[kept] > 2]
    if not len(kept):
        raise InputError("no blueprint of three and more parts among these")
    ways = add_ways(cache, data, kept, workers=workers)
    return Bench(cache=cache, rows=kept, masks={row: data.blueprints[row].masks for row in kept.tolist()}, ways=ways)


def bench_of(
    data: Dataset | str, cache: CloudCache | Path | str, *, split: str, limit: int | None = None, workers: int = 1
) -> Bench:
    """Return the bench of one split.

    Args:
        data: A dataset, its name or its folder.
        cache: Its clouds, or the folder where they are or are to be.
        split: Name of the split.
        limit: Only so many blueprints, over all families.
        workers: Processes that make what is not there yet.
    """
    from sashimono import d4pas
    from sashimono.learning.cloud_cache import make_cache

    found = d4pas.load(data) if isinstance(data, str) else data
    made = cache if isinstance(cache, CloudCache) else make_cache(found, Path(cache), workers=workers)
    return make_bench(made, found, made.split(split, limit=limit), workers=workers)


class Episode:
    """One product under way. Ends when it is whole, or with the wrong step after the last one that may be retried."""

    def __init__(self, masks: Masks, ways: Ways, *, retries: int = 0) -> None:
        self._masks, self._ways = masks, ways
        self.retries = retries
        """Wrong steps that the episode survives: 0 is strict."""
        self.placed = 0
        """Mask of the placed parts."""
        self.order: list[int] = []
        """Parts in the order in which they were placed."""
        self.wrong = 0
        """Wrong steps so far."""
        self.tried = np.zeros((len(masks), AXES), dtype=np.int8)
        """1 for the steps that were wrong since the last part was placed (part, axis)."""

    @property
    def is_whole(self) -> bool:
        """Whether all parts are placed."""
        return len(self.order) == len(self._masks)

    @property
    def is_over(self) -> bool:
        """Whether no step is left."""
        return self.is_whole or self.wrong > self.retries

    def is_right(self, part: int, axis: int) -> bool:
        """Return whether a step would be right; a part that is placed already, or does not exist, is wrong."""
        if part >= len(self._masks) or self.placed >> part & 1:
            return False
        after = self.placed | 1 << part
        if not can_leave(self._masks, part, self.placed) or not is_reachable(self._masks, after):
            return False
        return self._ways.allows(part, axis, self.placed)

    def step(self, part: int, axis: int) -> float:
        """Take a step and return its reward; a wrong one leaves the parts as they are."""
        assert not self.is_over, "the episode is over"
        if not self.is_right(part, axis):
            self.wrong += 1
            if part < len(self._masks):
                self.tried[part, axis] = 1
            return WRONG
        self.placed |= 1 << part
        self.order.append(part)
        self.tried[:] = 0
        return RIGHT + (WHOLE if self.is_whole else 0.0)


def placed_rows(states: np.ndarray, slots: int) -> np.ndarray:
    """Return sets of parts given as masks (...) as 0 and 1 by slot (..., slot) int8."""
    return (np.asarray(states, dtype=np.int64)[..., None] >> np.arange(slots) & 1).astype(np.int8)


def padded_clouds(bench: Bench, row: int, slots: int, points: int, target_points: int) -> dict[str, np.ndarray]:
    """Return what is seen of a blueprint at every step: ``blueprint`` (point, 6), ``parts`` (slot, point, 6) and
    ``axes`` (slot, 6, 3), zero where there is no part."""
    target, clouds = bench.clouds(row, points, target_points)
    parts = np.zeros((slots, points, 6), dtype=np.float32)
    axes = np.zeros((slots, AXES, 3), dtype=np.float32)
    parts[: len(clouds)] = clouds
    axes[: len(clouds)] = bench.ways[row].axes
    return {"blueprint": target, "parts": parts, "axes": axes}
