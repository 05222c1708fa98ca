"""What a trained `Picker` reaches, as methods that `sashimono.learning.evaluate` can judge.

One policy gives three rows. By its parts alone: its order, judged as every other method's. In the strict game: part and
axis of every step must be right. With retries: a wrong step is found out by trying it, and the next best is tried.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from sashimono.learning.baselines.episode import Bench, Episode, padded_clouds, placed_rows
from sashimono.learning.baselines.picker import Picker, as_observation
from sashimono.learning.baselines.ways import AXES
from sashimono.learning.batch import BatchConfig
from sashimono.learning.evaluate import Predictor

RETRIES = 3
"""Wrong steps of an episode that the row with retries survives."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Played:
    """Encoded blueprints."""

    rows: np.ndarray
    tokens: Tensor
    axes: Tensor
    present: Tensor


@dataclass(frozen=True, kw_only=True, eq=False)
class PickerPredictor:
    """A policy. A part's probability is that of its six steps together; the most probable step is taken."""

    model: Picker
    """In evaluation mode."""
    bench: Bench
    """All blueprints that may be asked for."""
    batch: BatchConfig
    """What the policy was trained with."""
    retries: int | None = None
    """None: parts alone. Otherwise episodes are played, and end with the wrong step after so many."""
    device: str = "cpu"

    @torch.inference_mode()
    def encode(self, blueprints: np.ndarray) -> Played:
        """Return the encoded blueprints."""
        counts = self.bench.cache.counts[blueprints]
        slots = int(counts.max())
        seen = [
            padded_clouds(self.bench, row, slots, self.batch.part_points, self.batch.target_points)
            for row in blueprints.tolist()
        ]
        stacked = {name: np.stack([each[name] for each in seen]) for name in seen[0]}
        stacked["present"] = np.arange(slots) < counts[:, None]
        tensors = as_observation(stacked, self.device)
        return Played(
            rows=blueprints, tokens=self.model.encode(tensors), axes=tensors["axes"], present=tensors["present"]
        )

    def probabilities(self, encoded: Played, placed: np.ndarray) -> np.ndarray:
        """Return the probability of each part (B, S, M) in states given as masks (B, S)."""
        states = placed.shape[1]
        tried = np.zeros((placed.size, encoded.present.shape[1], AXES), dtype=np.int8)
        rows = np.repeat(np.arange(len(placed)), states)
        steps = self._steps(encoded, rows, placed.reshape(-1), tried)
        return steps.sum(axis=2).reshape(*placed.shape, -1)

    def orders(self, encoded: Played) -> list[list[int]] | None:
        """Return the parts in the order in which the episodes placed them, cut short where they were not completed."""
        if self.retries is None:
            return None
        slots = encoded.present.shape[1]
        games = [
            Episode(self.bench.masks[row], self.bench.ways[row], retries=self.retries) for row in encoded.rows.tolist()
        ]
        while under_way := [k for k, game in enumerate(games) if not game.is_over]:
            placed = np.array([games[k].placed for k in under_way], dtype=np.int64)
            tried = np.zeros((len(under_way), slots, AXES), dtype=np.int8)
            for mine, k in zip(tried, under_way, strict=True):
                mine[: len(games[k].tried)] = games[k].tried
            steps = self._steps(encoded, np.array(under_way), placed, tried)
            for k, each in zip(under_way, steps, strict=True):
                part, axis = divmod(int(each.argmax()), AXES)
                games[k].step(part, axis)
        return [game.order for game in games]

    def pose_errors(self, encoded: Played) -> None:
        """Return None: there are no poses."""
        return None

    @torch.inference_mode()
    def _steps(self, encoded: Played, rows: np.ndarray, placed: np.ndarray, tried: np.ndarray) -> np.ndarray:
        """Return the probabilities of the steps (N, M, 6) in states of these encoded blueprints; 0 for placed parts."""
        index = torch.from_numpy(rows).to(self.device)
        present = encoded.present[index]
        is_placed = torch.from_numpy(placed_rows(placed, present.shape[1])).to(self.device).bool() & present
        remaining = present & ~is_placed
        logits, _ = self.model.score(
            encoded.tokens[index], encoded.axes[index], is_placed, remaining, torch.from_numpy(tried).to(self.device)
        )
        steps = torch.softmax(logits.flatten(1).float(), dim=1).unflatten(1, logits.shape[1:])
        return (steps * remaining[..., None]).cpu().numpy()


def playing_rows(name: str, model: Picker, bench: Bench, batch: BatchConfig, device: str) -> Mapping[str, Predictor]:
    """Return a policy's three methods: by its parts alone, in the strict game (``-axes``), with ``-retries``."""
    kinds = {name: None, f"{name}-axes": 0, f"{name}-retries": RETRIES}
    return {
        title: PickerPredictor(model=model, bench=bench, batch=batch, retries=retries, device=device)
        for title, retries in kinds.items()
    }
