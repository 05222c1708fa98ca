"""What a step of training sees: which blueprints, which seed, which learning rate. All follow from its number."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sashimono.learning.config_files import OptimizerConfig

WINDOW = 16
"""Batches over which blueprints are sorted by their number of parts, so that little of a batch is padding."""


def one_cycle(progress: float, config: OptimizerConfig) -> float:
    """Return the learning rate when this share of the training is over: up and down by half cosines."""
    if progress < config.warmup:
        low, high, share = config.start, 1.0, progress / config.warmup
    else:
        low, high, share = config.end, 1.0, 1.0 - (progress - config.warmup) / (1.0 - config.warmup)
    share = min(max(share, 0.0), 1.0)
    return config.rate * (low + (high - low) * 0.5 * (1.0 - math.cos(math.pi * share)))


def step_seed(seed: int, step: int, rank: int) -> int:
    """Return the seed of a step in one process."""
    return int(np.random.SeedSequence([seed, step, rank]).generate_state(1, np.uint64)[0] >> np.uint64(1))


@dataclass(frozen=True, kw_only=True, eq=False)
class BatchOrder:
    """Which blueprints are in which batch: each once an epoch, those of one batch similar in their number of parts."""

    blueprints: np.ndarray
    """Indices to choose from."""
    counts: np.ndarray
    """Parts of each."""
    size: int
    """Blueprints a batch."""
    seed: int

    def batch(self, number: int) -> np.ndarray:
        """Return the blueprints of a batch, by its number from the beginning of the training."""
        per_epoch = max(1, len(self.blueprints) // self.size)
        return _epoch(self, number // per_epoch)[number % per_epoch]


@lru_cache(maxsize=2)
def _epoch(order: BatchOrder, epoch: int) -> np.ndarray:
    rng = np.random.default_rng([order.seed, epoch, 7])
    shuffled = rng.permutation(len(order.blueprints))
    batches = max(1, len(shuffled) // order.size)
    shuffled = np.resize(shuffled, batches * order.size)
    windows = []
    for start in range(0, batches, WINDOW):
        window = shuffled[start * order.size : (start + WINDOW) * order.size]
        windows.append(window[np.argsort(order.counts[window], kind="stable")])
    sorted_batches = order.blueprints[np.concatenate(windows)].reshape(batches, order.size)
    return sorted_batches[rng.permutation(batches)]
