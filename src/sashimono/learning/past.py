"""PAST as printed: which of the remaining parts goes on next, from clouds of them and of the blueprint.

Zhu et al., "Multi-level planning for robotic assembly: from sequence inference to contact selection", section IV-A.
Parts come in frames of their own, so that their poses, the auxiliary task, are not given away. Where the paper is
silent, the readings are those that its sources suggest; each is a field of `PastConfig`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import torch
from torch import Tensor, nn
from torch.nn import functional

from sashimono.learning.batch import Batch, padded
from sashimono.learning.model import Scores, masked_mean, pose_loss, probability_bce, probability_mse


@dataclass(frozen=True, kw_only=True)
class DgcnnConfig:
    """A point cloud encoder (Wang et al., "Dynamic graph CNN for learning on point clouds", 2019)."""

    widths: tuple[int, ...] = (64, 64, 128, 256)
    """Channels after each edge convolution."""
    neighbours: int = 20
    """Nearest points that each point is compared with, itself one of them."""
    dynamic: bool = True
    """Whether neighbours are found again among the features before each layer; otherwise once, by position."""
    norm_edges: bool = True
    """Whether each edge is normalised before the maximum, as published; otherwise the maximum is, which needs products
    by point only and takes a quarter of the time."""


@dataclass(frozen=True, kw_only=True)
class PastConfig:
    """Sizes and readings of PAST."""

    hidden: int = 256
    """Width of the tokens, h."""
    blocks: int = 8
    """Transformer blocks, L."""
    heads: int = 4
    """Attention heads."""
    expansion: int = 4
    """Width of the feed-forward layers, over ``hidden``."""
    dropout: float = 0.1
    """Share of what attention and feed-forward layers add that is left out in training."""
    encoder: DgcnnConfig = DgcnnConfig()
    """One for blueprint and parts."""
    cross: Literal["parallel", "sequential"] = "parallel"
    """Whether parts attend to the blueprint as it was before it attended to them (as printed), or as it is after."""
    probability: Literal["mse", "bce"] = "mse"
    """Loss of the probabilities; the paper's is the mean squared error."""
    auxiliary: Literal["pose", "segmentation", "none"] = "pose"
    """The second task: pose of each part (PAST), blueprint segmentation (Seg-PAST), none (NoAux-PAST)."""
    auxiliary_weight: float = 1.0
    """Weight of the pose loss."""
    pretraining: float = 0.0
    """Share of the training at its beginning that is spent on the second task alone. Seg-PAST's segmentation is only
    trained then."""
    segment_placed: bool = False
    """Whether points of placed parts are a class of their own in segmentation; otherwise they are left out."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PastEncoded:
    """Features before the first block."""

    target: Tensor
    """Of each point of the blueprint (B, Nt, h)."""
    parts: Tensor
    """Of each part (B, M, h)."""


class Dgcnn(nn.Module):
    """Encode clouds (n, points, 6) to features of each point (n, points, out)."""

    def __init__(self, config: DgcnnConfig, out: int) -> None:
        super().__init__()
        self.config = config
        widths = (6, *config.widths)
        self.layers = nn.ModuleList(
            EdgeConv(before, after, norm_edges=config.norm_edges) for before, after in pairwise(widths)
        )
        self.join = nn.Sequential(nn.Linear(sum(config.widths), out), nn.LayerNorm(out), nn.LeakyReLU(0.2))

    def forward(self, cloud: Tensor) -> Tensor:
        neighbours = nearest(cloud[..., :3], self.config.neighbours)
        x, found = cloud, []
        for k, layer in enumerate(self.layers):
            if k and self.config.dynamic:
                neighbours = nearest(x, self.config.neighbours)
            x = layer(x, neighbours)
            found.append(x)
        return self.join(torch.cat(found, dim=-1))


class EdgeConv(nn.Module):
    """The maximum over a point's neighbours j of act(norm(W [x_j - x_i, x_i])).

    W [x_j - x_i, x_i] = A x_j + B x_i, so that products are taken by point, not by edge. Normalised by layer rather
    than by batch: parts and blueprints go through the same layer and differ in their statistics.
    """

    def __init__(self, before: int, after: int, *, norm_edges: bool) -> None:
        super().__init__()
        self.of_neighbour = nn.Linear(before, after, bias=False)
        self.of_self = nn.Linear(before, after)
        self.norm = nn.LayerNorm(after)
        self.norm_edges = norm_edges

    def forward(self, x: Tensor, neighbours: Tensor) -> Tensor:
        own = self.of_self(x)
        if self.norm_edges:
            edges = gathered(self.of_neighbour(x), neighbours)
            return functional.leaky_relu(self.norm(edges + own[:, :, None]), 0.2).amax(dim=2)
        return functional.leaky_relu(self.norm(greatest(self.of_neighbour(x), neighbours) + own), 0.2)


class Attention(nn.Module):
    """Multi-head attention and a feed-forward layer, each normalised first and added to what was there."""

    def __init__(self, config: PastConfig, *, cross: bool) -> None:
        super().__init__()
        h = config.hidden
        self.heads = config.heads
        self.norm_query, self.norm_out = nn.LayerNorm(h), nn.LayerNorm(h)
        if cross:
            self.norm_key = nn.LayerNorm(h)
        self.query, self.key_value, self.out = nn.Linear(h, h), nn.Linear(h, 2 * h), nn.Linear(h, h)
        self.feed_forward = nn.Sequential(
            nn.Linear(h, config.expansion * h),
            nn.GELU(),
            nn.Dropout(config.dropout),
            nn.Linear(config.expansion * h, h),
        )
        self.dropout = nn.Dropout(config.dropout)

    def forward(self, x: Tensor, source: Tensor | None, mask: Tensor | None) -> Tensor:
        """Return ``x`` (n, tokens, h) after it has looked at ``source``, or at itself, where ``mask`` is true."""
        query = self.norm_query(x)
        looked = query if source is None else self.norm_key(source)
        n, count, h = x.shape
        q = self.query(query).view(n, count, self.heads, -1).transpose(1, 2)
        k, v = self.key_value(looked).view(n, looked.shape[1], 2, self.heads, -1).permute(2, 0, 3, 1, 4)
        seen = functional.scaled_dot_product_attention(q, k, v, attn_mask=mask)
        x = x + self.dropout(self.out(seen.transpose(1, 2).reshape(n, count, h)))
        return x + self.dropout(self.feed_forward(self.norm_out(x)))


class Block(nn.Module):
    """Self-attention of blueprint and of parts, then cross-attention both ways.

    In the last block the blueprint looks at the parts only if its features are asked for.
    """

    def __init__(self, config: PastConfig, *, last: bool) -> None:
        super().__init__()
        self.target_self, self.parts_self = Attention(config, cross=False), Attention(config, cross=False)
        self.parts_cross = Attention(config, cross=True)
        self.parallel = config.cross == "parallel"
        self.updates_target = not last or not self.parallel or config.auxiliary == "segmentation"
        if self.updates_target:
            self.target_cross = Attention(config, cross=True)

    def forward(self, target: Tensor, parts: Tensor, remain: Tensor, *, states: int = 1) -> tuple[Tensor, Tensor]:
        """Return both after the block; ``target`` is repeated for so many states once it has looked at itself."""
        target = self.target_self(target, None, None).repeat_interleave(states, dim=0)
        parts = self.parts_self(parts, None, remain)
        after = self.target_cross(target, parts, remain) if self.updates_target else target
        parts = self.parts_cross(parts, target if self.parallel else after, None)
        return after, parts


class Past(nn.Module):
    """The part assembly sequence transformer."""

    def __init__(self, config: PastConfig) -> None:
        super().__init__()
        h = config.hidden
        self.config = config
        self.encoder = Dgcnn(config.encoder, h)
        self.blocks = nn.ModuleList(Block(config, last=k == config.blocks - 1) for k in range(config.blocks))
        self.norm_parts = nn.LayerNorm(h)
        self.probability = mlp(h, h, 1)
        if config.auxiliary == "pose":
            self.pose = mlp(h, h, 6)
        if config.auxiliary == "segmentation":
            self.norm_target = nn.LayerNorm(h)
            self.of_point, self.of_part = nn.Linear(h, h), nn.Linear(h, h)
            self.of_placed = nn.Parameter(torch.zeros(1, 1, h))

    def encode(self, batch: Batch) -> PastEncoded:
        """Return a feature of each point of the blueprints and of each part."""
        assert batch.parts_local is not None, "the batch was made without local frames"
        parts = self.encoder(batch.parts_local).amax(dim=1)
        return PastEncoded(target=self.encoder(batch.target), parts=padded(parts, batch))

    def score(self, encoded: PastEncoded, remaining: Tensor) -> Scores:
        """Return probability and pose of the remaining parts of each state."""
        _, parts = self._refine(encoded, remaining)
        return self._scores(parts)

    def loss(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the loss of the probabilities and, by its weight, that of the second task."""
        config = self.config
        target, parts = self._refine(self.encode(batch), batch.remaining)
        scores = self._scores(parts)
        loss_of = probability_mse if config.probability == "mse" else probability_bce
        terms = {"probability": loss_of(scores.logits, batch)}
        alone = batch.progress < config.pretraining
        if config.auxiliary == "none":
            return terms["probability"], terms
        if config.auxiliary == "pose":
            assert scores.pose is not None
            terms["pose"] = pose_loss(scores.pose, batch)
            weight = config.auxiliary_weight
        else:
            terms["segmentation"] = self._segmentation_loss(target, parts, batch)
            weight = 1.0 if alone else 0.0
        second = terms[config.auxiliary]
        # a term with weight zero stays in the sum: every parameter has a gradient on every device
        return (0.0 if alone else 1.0) * terms["probability"] + weight * second, terms

    def _refine(self, encoded: PastEncoded, remaining: Tensor) -> tuple[Tensor, Tensor]:
        """Return features of points (B, S, Nt, h) and parts (B, S, M, h) after all blocks."""
        states = remaining.shape[1]
        target, parts = encoded.target, encoded.parts.repeat_interleave(states, dim=0)
        remain = remaining.flatten(0, 1)[:, None, None]
        for k, block in enumerate(self.blocks):
            # what the blueprint sees of itself in the first block is the same in all states
            target, parts = block(target, parts, remain, states=states if k == 0 else 1)
        shape = remaining.shape[:2]
        return target.unflatten(0, shape), self.norm_parts(parts).unflatten(0, shape)

    def _scores(self, parts: Tensor) -> Scores:
        pose = self.pose(parts) if self.config.auxiliary == "pose" else None
        return Scores(logits=self.probability(parts)[..., 0], pose=pose)

    def _segmentation_loss(self, target: Tensor, parts: Tensor, batch: Batch) -> Tensor:
        """Return the cross-entropy of the remaining part that each point is of.

        Parts of the same shape cannot be told apart in frames of their own: any of them is right.
        """
        keys = torch.cat([self.of_part(parts), self.of_placed.expand(*parts.shape[:2], 1, -1)], dim=2)
        logits = (self.of_point(self.norm_target(target)) @ keys.transpose(2, 3)).float() / self.config.hidden**0.5
        placed_class = torch.full_like(batch.remaining[..., :1], self.config.segment_placed)
        allowed = torch.cat([batch.remaining, placed_class], dim=2)[:, :, None]
        logs = functional.log_softmax(logits.masked_fill(~allowed, -1e4), dim=-1)
        states, points = batch.remaining.shape[1], batch.target_part.shape[1]
        part = batch.target_part[:, None, :].expand(-1, states, -1)
        remains = batch.remaining.gather(2, part)
        shape = batch.shape_class.gather(1, batch.target_part)
        same = (shape[:, :, None] == batch.shape_class[:, None])[:, None] & batch.remaining[:, :, None]
        is_placed = ~remains[..., None]
        right = torch.cat([same & ~is_placed, is_placed & placed_class[:, :, None].expand(-1, -1, points, -1)], dim=-1)
        found = logs.masked_fill(~right, -1e4).logsumexp(dim=-1)
        return -masked_mean(found, remains | self.config.segment_placed)


def mlp(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    """Return a perceptron with one hidden layer."""
    return nn.Sequential(nn.Linear(inputs, hidden), nn.GELU(), nn.Linear(hidden, outputs))


def nearest(x: Tensor, count: int) -> Tensor:
    """Return the indices of so many nearest points to each, itself one of them: (n, points, count)."""
    with torch.no_grad(), torch.autocast(x.device.type, enabled=False):
        x = x.float()
        # without the term that is the same for all candidates of a point
        distance = torch.baddbmm(x.square().sum(dim=-1)[:, None], x, x.transpose(1, 2), alpha=-2)
        return distance.topk(min(count, x.shape[1]), largest=False, sorted=False).indices


def gathered(x: Tensor, neighbours: Tensor) -> Tensor:
    """Return the features (n, points, c) of each point's neighbours: (n, points, count, c)."""
    rows = _rows(neighbours)
    return x.reshape(-1, x.shape[-1]).index_select(0, rows.flatten()).view(*rows.shape, -1)


def greatest(x: Tensor, neighbours: Tensor) -> Tensor:
    """Return the largest of each feature (n, points, c) over each point's neighbours: (n, points, c)."""
    return _Greatest.apply(x, _rows(neighbours))  # type: ignore[no-any-return]


def _rows(neighbours: Tensor) -> Tensor:
    """Return neighbours as indices over the points of all clouds together."""
    n, points, _ = neighbours.shape
    return neighbours + points * torch.arange(n, device=neighbours.device)[:, None, None]


class _Greatest(torch.autograd.Function):
    """`greatest`, that sends each gradient to the one neighbour it came from, instead of to all of the edges."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, rows: Tensor) -> Tensor:
        flat = x.reshape(-1, x.shape[-1])
        found, where = flat.index_select(0, rows.flatten()).view(*rows.shape, -1).max(dim=2)
        ctx.save_for_backward(rows.gather(2, where))
        return found

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:  # pyright: ignore[reportIncompatibleMethodOverride]
        (source,) = ctx.saved_tensors
        c = gradient.shape[-1]
        out = torch.zeros(gradient.shape, dtype=torch.float32, device=gradient.device).view(-1, c)
        out.scatter_add_(0, source.view(-1, c), gradient.reshape(-1, c).float())
        return out.view(gradient.shape).to(gradient.dtype), None
