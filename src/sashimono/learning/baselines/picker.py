"""The network that reinforcement learning trains: says of each part and signed axis how likely it is the next step.

A shared point encoder with max pooling gives a feature of each part in place and one of the blueprint; parts look at
each other by attention, knowing which are placed; each axis is scored with its direction. All of it works for any
number of parts. Needs PyTorch only: what was trained is evaluated without Gymnasium.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

SIZES = (5, 8, 13)
"""Numbers of parts at which a batch is cut."""

STATUS = 2
"""Features of a part's status: placed, remaining."""


@dataclass(frozen=True, kw_only=True)
class PpoConfig:
    """Proximal policy optimisation with stable-baselines3."""

    envs: int = 32
    """Environments side by side."""
    rollout: int = 32
    """Steps of each between two updates; each rollout begins with new episodes."""
    episodes: int = 8
    """Episodes in a row with the same blueprint, so that a batch encodes fewer."""
    retries: int = 3
    """Wrong steps that an episode of training survives: with 0, few episodes come past the first parts."""
    batch: int = 256
    """Steps a batch of an update."""
    epochs: int = 4
    """Passes over a rollout."""
    discount: float = 0.99
    smoothing: float = 0.95
    """Of the advantages (lambda)."""
    clip: float = 0.2
    """Largest change of a step's probability that is rewarded, relative."""
    entropy: float = 0.01
    """Weight of the entropy."""
    value: float = 0.5
    """Weight of the value's error."""
    target_kl: float | None = 0.03
    """An update ends when the policy has changed by more than 1.5 times this."""


@dataclass(frozen=True, kw_only=True)
class PickerConfig:
    """Size of the network, and how it is trained."""

    widths: tuple[int, ...] = (32,)
    """Layers of the point encoder."""
    hidden: int = 64
    blocks: int = 2
    """Layers of attention between the parts."""
    heads: int = 4
    ppo: PpoConfig = field(default_factory=PpoConfig)


class Picker(nn.Module):
    """Scores of steps, and the value of a state, from what the environment shows."""

    def __init__(self, config: PickerConfig) -> None:
        super().__init__()
        self.config = config
        h = config.hidden
        sizes = [9, *config.widths, h]
        layers: list[nn.Module] = []
        for a, b in pairwise(sizes):
            layers += [nn.Linear(a, b), nn.ReLU()]
        self.points = nn.Sequential(*layers[:-1])
        self.part = nn.Linear(2 * h + 9, h)
        self.status = nn.Linear(STATUS, h, bias=False)
        layer = nn.TransformerEncoderLayer(
            h, config.heads, 2 * h, dropout=0.0, activation="relu", batch_first=True, norm_first=True
        )
        self.blocks = nn.TransformerEncoder(layer, config.blocks, nn.LayerNorm(h), enable_nested_tensor=False)
        self.axis_part = nn.Linear(h, h)
        self.axis = nn.Linear(3, h, bias=False)
        self.last = nn.Linear(h, 1)
        self.value = nn.Sequential(nn.Linear(2 * h, h), nn.ReLU(), nn.Linear(h, 1))
        with torch.no_grad():  # begin with nearly even choices
            self.last.weight.mul_(0.1)

    def encode(self, seen: Mapping[str, Tensor]) -> Tensor:
        """Return features of the parts (B, M, h); nothing in them depends on the state.

        Args:
            seen: ``blueprint`` (B, point, 6), ``parts`` (B, M, point, 6), ``axes`` (B, M, 6, 3), ``present`` (B, M).
        """
        present = seen["present"].bool()
        whole = self._pooled(seen["blueprint"])
        owner = present.nonzero()[:, 0]
        own = self._pooled(seen["parts"][present])
        lines = seen["axes"][present][:, ::2].flatten(1)
        tokens = self.part(torch.cat([own, whole[owner], lines], dim=1))
        return tokens.new_zeros(*present.shape, tokens.shape[1]).masked_scatter(present[..., None], tokens)

    def score(
        self, tokens: Tensor, axes: Tensor, placed: Tensor, remaining: Tensor, tried: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Return logits of the steps (B, M, 6) and values of the states (B,).

        Steps that cannot be meant are out, at -1e9: with no part, with a placed one, and those just found wrong. All
        others are in, right or wrong.

        Args:
            tokens: From `encode` (B, M, h).
            axes: Directions (B, M, 6, 3).
            placed: Parts that are placed (B, M).
            remaining: Parts that are not (B, M).
            tried: Steps found wrong since the last part was placed (B, M, 6).
        """
        placed, remaining = placed.bool(), remaining.bool()
        present = placed | remaining
        x = tokens + self.status(torch.stack([placed, remaining], dim=-1).to(tokens.dtype))
        x = self.blocks(x, src_key_padding_mask=~present) * present[..., None]
        logits = self.last(functional.relu(self.axis_part(x)[..., None, :] + self.axis(axes)))[..., 0]
        logits = logits.masked_fill(~remaining[..., None] | tried.bool(), -1e9)
        mean = x.sum(dim=1) / present.sum(dim=1, keepdim=True).clamp(min=1)
        left = (x * remaining[..., None]).sum(dim=1) / remaining.sum(dim=1, keepdim=True).clamp(min=1)
        return logits, self.value(torch.cat([mean, left], dim=1))[:, 0]

    def forward(self, seen: Mapping[str, Tensor]) -> tuple[Tensor, Tensor]:
        """Return logits (B, M, 6) and values (B,) of observations, each blueprint among them encoded once.

        Observations are taken together by their number of parts, so that little of the work is for empty slots.
        """
        counts = (seen["placed"] + seen["remaining"]).sum(dim=1).long()
        logits = seen["axes"].new_full(seen["axes"].shape[:3], -1e9, dtype=torch.float32)
        value = logits.new_zeros(len(counts))
        for low, high in pairwise((0, *SIZES, max(int(counts.max()), SIZES[-1]))):
            rows = ((counts > low) & (counts <= high)).nonzero()[:, 0]
            if len(rows):
                most = int(counts[rows].max())  # parts come first: the other slots are empty in all of these
                own, value_own = self._alike({name: array[rows] for name, array in seen.items()}, most)
                logits = logits.index_put((rows[:, None], torch.arange(most, device=rows.device)), own)
                value = value.index_put((rows,), value_own)
        return logits, value

    def _alike(self, seen: Mapping[str, Tensor], most: int) -> tuple[Tensor, Tensor]:
        """Return logits (B, most, 6) and values (B,) of observations of at most so many parts."""
        present, axes = (seen["placed"] + seen["remaining"])[:, :most].bool(), seen["axes"][:, :most].float()
        first, which = _distinct(torch.cat([seen["blueprint"][:, :2].flatten(1), present.to(axes.dtype)], dim=1))
        once = {
            "blueprint": seen["blueprint"][first].float(),
            "parts": seen["parts"][first, :most].float(),
            "axes": axes[first],
            "present": present[first],
        }
        cut = [seen[name][:, :most] for name in ("placed", "remaining", "tried")]
        return self.score(self.encode(once)[which], axes, *cut)

    def _pooled(self, cloud: Tensor) -> Tensor:
        about = cloud[..., :3] - cloud[..., :3].mean(dim=-2, keepdim=True)
        return self.points(torch.cat([cloud, about], dim=-1)).amax(dim=-2)


def _distinct(rows: Tensor) -> tuple[Tensor, Tensor]:
    """Return where each distinct row is met first, and which of them each row is."""
    _, which = torch.unique(rows, dim=0, return_inverse=True)
    count = int(which.max()) + 1
    index = torch.arange(len(rows), device=rows.device)
    first = torch.full((count,), len(rows), device=rows.device).scatter_reduce_(0, which, index, "amin")
    return first, which


def as_observation(arrays: Mapping[str, Any], device: torch.device | str = "cpu") -> dict[str, Tensor]:
    """Return arrays as tensors on a device."""
    return {name: torch.as_tensor(array).to(device) for name, array in arrays.items()}
