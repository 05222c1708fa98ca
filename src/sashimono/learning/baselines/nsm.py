"""Neural shape mating, adapted to several parts and to sequences.

Chen et al., "Neural shape mating: self-supervised object assembly with adversarial shape priors", 2022. A transformer
over the remaining parts gives pose and probability of each. The blueprint only enters through a discriminator, which
tells parts posed by the network from parts in place; that is what the paper says of its adaptation. ``sees_target``
is a more generous one: the blueprint is one more token.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn

from sashimono.learning.batch import Batch, padded, rotation_matrix
from sashimono.learning.model import Scores, masked_mean, pose_loss, probability_mse
from sashimono.learning.past import Dgcnn, DgcnnConfig, mlp


@dataclass(frozen=True, kw_only=True)
class NsmConfig:
    """Sizes and readings of the adapted NSM."""

    hidden: int = 256
    """Width of the tokens."""
    layers: int = 4
    """Transformer layers."""
    heads: int = 4
    """Attention heads."""
    expansion: int = 4
    """Width of the feed-forward layers, over ``hidden``."""
    dropout: float = 0.0
    """Share of what a layer adds that is left out in training."""
    encoder: DgcnnConfig = field(default_factory=lambda: DgcnnConfig(dynamic=False))
    """Of parts. NSM's code finds neighbours once, by position."""
    sees_target: bool = False
    """Whether the blueprint is a token too."""
    pose_weight: float = 1.0
    """Weight of the pose loss."""
    adversary_weight: float = 0.1
    """Weight of the discriminator's loss."""
    adversary_points: int = 512
    """Points that the discriminator sees of a blueprint."""


@dataclass(frozen=True, kw_only=True, eq=False)
class NsmEncoded:
    """Features of the parts, and of the blueprint if it is seen."""

    parts: Tensor
    target: Tensor | None


class Nsm(nn.Module):
    """A transformer over remaining parts, with a shape discriminator."""

    def __init__(self, config: NsmConfig) -> None:
        super().__init__()
        h = config.hidden
        self.config = config
        self.encoder = Dgcnn(config.encoder, h)
        self.layers = nn.ModuleList(_Layer(config) for _ in range(config.layers))
        self.norm = nn.LayerNorm(h)
        self.probability, self.pose = mlp(2 * h, h, 1), mlp(2 * h, h, 6)
        self.discriminator = _PointNet(h)
        if config.sees_target:
            self.is_target = nn.Parameter(torch.zeros(h))

    def encode(self, batch: Batch) -> NsmEncoded:
        """Return a feature of each part, and of the blueprint if it is seen."""
        assert batch.parts_local is not None, "the batch was made without local frames"
        parts = padded(self.encoder(batch.parts_local).amax(dim=1), batch)
        seen = self.encoder(batch.target).amax(dim=1) if self.config.sees_target else None
        return NsmEncoded(parts=parts, target=seen)

    def score(self, encoded: NsmEncoded, remaining: Tensor) -> Scores:
        """Return probability and pose of the remaining parts of each state."""
        states, slots = remaining.shape[1:]
        own = encoded.parts.repeat_interleave(states, dim=0)
        remain = remaining.flatten(0, 1)
        tokens = own
        if encoded.target is not None:
            token = (encoded.target + self.is_target).repeat_interleave(states, dim=0)[:, None]
            tokens = torch.cat([own, token.to(own.dtype)], dim=1)
            remain = torch.cat([remain, torch.ones_like(remain[:, :1])], dim=1)
        for layer in self.layers:
            tokens = layer(tokens, remain)
        # as in NSM's code: the feature beside what it correlates with
        both = torch.cat([own, self.norm(tokens[:, :slots])], dim=-1).unflatten(0, remaining.shape[:2])
        return Scores(logits=self.probability(both)[..., 0], pose=self.pose(both))

    def loss(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the losses of probabilities, poses, and of the discriminator against the poses."""
        scores = self.score(self.encode(batch), batch.remaining)
        assert scores.pose is not None
        terms = {
            "probability": probability_mse(scores.logits, batch),
            "pose": pose_loss(scores.pose, batch),
            "adversary": self._adversary_loss(scores.pose[:, 0], batch),
        }
        config = self.config
        loss = terms["probability"] + config.pose_weight * terms["pose"] + config.adversary_weight * terms["adversary"]
        return loss, terms

    def _adversary_loss(self, pose: Tensor, batch: Batch) -> Tensor:
        """Return the least-squares loss of the discriminator, with its gradient turned round for the poses.

        Of each blueprint's first state, which has the most remaining parts. What the discriminator makes small, the
        poses make large: one step trains both.
        """
        assert batch.parts_local is not None
        remains = batch.remaining[batch.owner, 0, batch.slot]
        own = pose[batch.owner, batch.slot].float()
        with torch.autocast(own.device.type, enabled=False):
            turn = rotation_matrix(own[:, 3:]).transpose(1, 2)
            points = batch.parts_local[..., :3] @ turn + own[:, None, :3]
            made = torch.cat([points, batch.parts_local[..., 3:] @ turn], dim=-1)
        rows, keep = _sampled(batch, remains, self.config.adversary_points)
        true = self.discriminator(_picked(batch.parts, rows), keep)
        false = self.discriminator(_picked(_Reverse.apply(made), rows), keep)
        return masked_mean((true - 1).square() + false.square(), keep.any(dim=1))


class _Layer(nn.Module):
    """Self-attention among tokens, normalised first."""

    def __init__(self, config: NsmConfig) -> None:
        super().__init__()
        h = config.hidden
        self.heads = config.heads
        self.before, self.after = nn.LayerNorm(h), nn.LayerNorm(h)
        self.query_key_value, self.out = nn.Linear(h, 3 * h), nn.Linear(h, h)
        self.feed_forward = mlp(h, config.expansion * h, h)
        self.dropout = nn.Dropout(config.dropout)

    def forward(self, x: Tensor, keep: Tensor) -> Tensor:
        n, count, h = x.shape
        q, k, v = self.query_key_value(self.before(x)).view(n, count, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        seen = nn.functional.scaled_dot_product_attention(q, k, v, attn_mask=keep[:, None, None])
        x = x + self.dropout(self.out(seen.transpose(1, 2).reshape(n, count, h)))
        return x + self.dropout(self.feed_forward(self.after(x)))


class _PointNet(nn.Module):
    """A score of each cloud (n, points, 6): a perceptron by point, the maximum over points, a linear layer."""

    def __init__(self, hidden: int) -> None:
        super().__init__()
        self.by_point = nn.Sequential(
            nn.Linear(6, hidden // 2), nn.LeakyReLU(0.2), nn.Linear(hidden // 2, hidden), nn.LeakyReLU(0.2)
        )
        self.out = nn.Linear(hidden, 1)

    def forward(self, cloud: Tensor, keep: Tensor) -> Tensor:
        features = self.by_point(cloud).masked_fill(~keep[..., None], -1e4)
        return self.out(features.amax(dim=1))[:, 0].float()


class _Reverse(torch.autograd.Function):
    """The identity, with its gradient turned round."""

    @staticmethod
    def forward(ctx: Any, x: Tensor) -> Tensor:
        return x.view_as(x)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> Tensor:
        return -gradients[0]


def _sampled(batch: Batch, remains: Tensor, count: int) -> tuple[Tensor, Tensor]:
    """Return which points of the concatenated parts are seen of each blueprint (B, count), and which of them count.

    The slots of a blueprint take turns; points of parts that do not remain do not count.
    """
    slots = batch.present.shape[1]
    first = padded(torch.arange(len(batch.owner), device=remains.device), batch)
    kept = padded(remains, batch)
    turn = torch.arange(count, device=remains.device)
    slot, point = turn % slots, (turn // slots) % batch.parts.shape[1]
    return first[:, slot] * batch.parts.shape[1] + point, kept[:, slot]


def _picked(clouds: Tensor, rows: Tensor) -> Tensor:
    return clouds.reshape(-1, 6)[rows]
