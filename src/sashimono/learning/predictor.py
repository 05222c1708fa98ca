"""A network as a method that `sashimono.learning.evaluate` can judge."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from sashimono.learning.batch import Batch, BatchConfig, DeviceClouds, make_batch, padded, rotation_matrix
from sashimono.learning.devices import Place


@dataclass(frozen=True, kw_only=True, eq=False)
class Encoded:
    """Encoded blueprints, and the batch that they came from."""

    batch: Batch
    features: Any


@dataclass(frozen=True, kw_only=True, eq=False)
class NetworkPredictor:
    """A model on clouds as they are: not turned, without noise; parts in random frames where the model wants that."""

    model: Any
    """In evaluation mode, on the clouds' device."""
    clouds: DeviceClouds
    batch: BatchConfig
    """What the model was trained with."""
    precision: str = "bf16"
    seed: int = 0
    """Of slices and local frames."""

    @torch.inference_mode()
    def encode(self, blueprints: np.ndarray) -> Encoded:
        """Return the encoded blueprints."""
        config = replace(self.batch, rotate=False, jitter=0.0, states=1)
        nothing = np.zeros((len(blueprints), 1), dtype=np.int64)
        batch = make_batch(self.clouds, blueprints, config=config, seed=self.seed, placed=nothing)
        with self._autocast():
            return Encoded(batch=batch, features=self.model.encode(batch))

    @torch.inference_mode()
    def probabilities(self, encoded: Encoded, placed: np.ndarray) -> np.ndarray:
        """Return the probabilities of states."""
        present = encoded.batch.present.cpu().numpy()
        remaining = ((placed[..., None] >> np.arange(present.shape[1]) & 1) == 0) & present[:, None]
        # a state without remaining parts is asked as the empty one: attention needs something to look at
        asked = np.where(remaining.any(axis=2, keepdims=True), remaining, present[:, None])
        with self._autocast():
            scores = self.model.score(encoded.features, torch.from_numpy(asked).to(self.clouds.device))
        return torch.sigmoid(scores.logits.float()).cpu().numpy() * remaining

    @torch.inference_mode()
    def orders(self, encoded: Encoded) -> list[list[int]] | None:
        """Return the model's own orders, if it makes any."""
        if not hasattr(self.model, "orders"):
            return None
        with self._autocast():
            return self.model.orders(encoded.features)

    @torch.inference_mode()
    def pose_errors(self, encoded: Encoded) -> np.ndarray | None:
        """Return the mean errors of the predicted poses, with nothing placed, if the model predicts any."""
        batch = encoded.batch
        if batch.pose is None:
            return None
        with self._autocast():
            pose = self.model.score(encoded.features, batch.present[:, None]).pose
        if pose is None:
            return None
        wanted, said = padded(batch.pose, batch).cpu(), pose[:, 0].float().cpu()
        distance = (said[..., :3] - wanted[..., :3]).norm(dim=-1)
        between = rotation_matrix(said[..., 3:]).transpose(-1, -2) @ rotation_matrix(wanted[..., 3:])
        cosine = (between.diagonal(dim1=-2, dim2=-1).sum(dim=-1) - 1) / 2
        angle = torch.acos(cosine.clamp(-1, 1))
        present = batch.present.cpu()
        errors = torch.stack([distance, angle], dim=-1) * present[..., None]
        return (errors.sum(dim=1) / present.sum(dim=1, keepdim=True)).numpy()

    def _autocast(self) -> torch.autocast:
        return Place(device=str(self.clouds.device)).autocast(self.precision)
