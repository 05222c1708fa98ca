"""What every model of sequence inference offers, and the losses that several of them share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor
from torch.nn import functional

from sashimono.learning.batch import Batch, padded


@dataclass(frozen=True, kw_only=True, eq=False)
class Scores:
    """What a model says of each part in each state."""

    logits: Tensor
    """Of the probability that a part is right next (B, S, M); meaningless for parts that do not remain."""
    pose: Tensor | None = None
    """Predicted pose of each part: translation, axis times angle (B, S, M, 6)."""


class SequenceModel(Protocol):
    """A network that says which parts may be placed next. Also a `torch.nn.Module`.

    Clouds are encoded once a blueprint; states are scored from that as often as needed. A model that decodes orders in
    its own way also has ``orders(encoded) -> list[list[int]]``: an assembly order of each blueprint.
    """

    def encode(self, batch: Batch) -> Any:
        """Return features of the blueprints and their parts; nothing in them depends on the states."""
        ...

    def score(self, encoded: Any, remaining: Tensor) -> Scores:
        """Return what the model says of states, given by their remaining parts (B, S, M)."""
        ...

    def loss(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """Return what training makes small, and its terms by name, for the log."""
        ...


def probability_mse(logits: Tensor, batch: Batch) -> Tensor:
    """Return the paper's loss: mean squared error of the probabilities of remaining parts."""
    keep = trained_states(batch)
    return masked_mean((torch.sigmoid(logits.float()) - batch.y) ** 2, keep)


def probability_bce(logits: Tensor, batch: Batch) -> Tensor:
    """Return the binary cross-entropy of the probabilities of remaining parts."""
    loss = functional.binary_cross_entropy_with_logits(logits.float(), batch.y, reduction="none")
    return masked_mean(loss, trained_states(batch))


def trained_states(batch: Batch) -> Tensor:
    """Return the remaining parts that sequence inference is trained on (B, S, M): none of two-part blueprints."""
    return batch.remaining & (batch.present.sum(dim=1) > 2)[:, None, None]


def pose_loss(pose: Tensor, batch: Batch) -> Tensor:
    """Return the paper's pose loss, over the remaining parts: distance of translations plus that of axis-angles."""
    assert batch.pose is not None, "the batch was made without local frames"
    wanted = padded(batch.pose, batch)[:, None]
    error = pose.float() - wanted
    # a root of zero has no gradient
    lengths = (error.unflatten(-1, (2, 3)).square().sum(dim=-1) + 1e-12).sqrt().sum(dim=-1)
    return masked_mean(lengths, batch.remaining)


def masked_mean(values: Tensor, keep: Tensor) -> Tensor:
    """Return the mean of the values that are kept; 0 if none is."""
    kept = keep.to(values.dtype)
    return (values * kept).sum() / kept.sum().clamp(min=1)


def parameter_count(model: torch.nn.Module) -> int:
    """Return the number of trained parameters."""
    return sum(p.numel() for p in model.parameters() if p.requires_grad)
