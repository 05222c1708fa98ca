"""Dynamic graph learning of part assembly, adapted to sequences.

Huang et al., "Generative 3D part assembly via dynamic graph learning", 2020. Parts are the nodes of a full graph whose
edges are weighed anew from the poses predicted so far. As the paper adapts it, a global node stands for the blueprint
(Battaglia et al., 2018): linked with every part both ways, always with weight 1. A head beside that of the pose gives
the probability; both are trained after each iteration.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

import torch
from torch import Tensor, nn

from sashimono.learning.batch import Batch, padded
from sashimono.learning.model import Scores, pose_loss, probability_mse
from sashimono.learning.past import Dgcnn, DgcnnConfig, mlp


@dataclass(frozen=True, kw_only=True)
class DglConfig:
    """Sizes and readings of the adapted DGL."""

    hidden: int = 256
    """Width of the nodes."""
    iterations: int = 5
    """Rounds of messages, each with weights of its own."""
    encoder: Literal["pointnet", "dgcnn"] = "pointnet"
    """Of parts and blueprint: DGL's own, or the one of PAST, which is more generous."""
    pointnet: tuple[int, ...] = (64, 64, 64, 128, 1024)
    """Widths of the PointNet."""
    dgcnn: DgcnnConfig = field(default_factory=DgcnnConfig)
    """The other encoder."""
    pose_weight: float = 1.0
    """Weight of the pose loss."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DglEncoded:
    """Features of the nodes."""

    parts: Tensor
    """(B, M, h)."""
    target: Tensor
    """(B, h)."""


class Dgl(nn.Module):
    """Messages among parts and with the blueprint."""

    def __init__(self, config: DglConfig) -> None:
        super().__init__()
        h = config.hidden
        self.config = config
        self.encoder = _PointNet(config.pointnet, h) if config.encoder == "pointnet" else Dgcnn(config.dgcnn, h)
        self.rounds = nn.ModuleList(
            _Round(h, first=k == 0, last=k == config.iterations - 1) for k in range(config.iterations)
        )

    def encode(self, batch: Batch) -> DglEncoded:
        """Return a feature of each part and of the blueprint."""
        assert batch.parts_local is not None, "the batch was made without local frames"
        parts = self.encoder(batch.parts_local).amax(dim=1)
        return DglEncoded(parts=padded(parts, batch), target=self.encoder(batch.target).amax(dim=1))

    def score(self, encoded: DglEncoded, remaining: Tensor) -> Scores:
        """Return probability and pose of the remaining parts of each state, after the last iteration."""
        return self._rounds(encoded, remaining)[-1]

    def loss(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the losses of probabilities and poses, means over the iterations."""
        found = self._rounds(self.encode(batch), batch.remaining)
        probability = torch.stack([probability_mse(scores.logits, batch) for scores in found]).mean()
        pose = torch.stack([pose_loss(scores.pose, batch) for scores in found if scores.pose is not None]).mean()
        return probability + self.config.pose_weight * pose, {"probability": probability, "pose": pose}

    def _rounds(self, encoded: DglEncoded, remaining: Tensor) -> list[Scores]:
        states = remaining.shape[1]
        local = encoded.parts.repeat_interleave(states, dim=0)
        target = encoded.target.repeat_interleave(states, dim=0)
        remain = remaining.flatten(0, 1)
        node, pose, found = local, None, []
        for each in self.rounds:
            node, target, pose, logits = each(local, node, target, pose, remain)
            shape = remaining.shape[:2]
            found.append(Scores(logits=logits.unflatten(0, shape), pose=pose.unflatten(0, shape)))
        return found


class _Round(nn.Module):
    """One iteration: weights of the edges, messages, nodes, poses, probabilities."""

    def __init__(self, h: int, *, first: bool, last: bool) -> None:
        super().__init__()
        self.of_receiver, self.of_sender = nn.Linear(h, 2 * h), nn.Linear(h, 2 * h, bias=False)
        self.edge = nn.Sequential(nn.ReLU(), nn.Linear(2 * h, h), nn.ReLU())
        self.node = nn.Sequential(nn.Linear(3 * h, 2 * h), nn.ReLU(), nn.Linear(2 * h, h))
        self.from_target = nn.Sequential(nn.Linear(2 * h, h), nn.ReLU())
        self.last = last
        if not last:
            self.to_target = nn.Sequential(nn.Linear(2 * h, h), nn.ReLU())
            self.target = nn.Sequential(nn.Linear(2 * h, 2 * h), nn.ReLU(), nn.Linear(2 * h, h))
        self.pose, self.probability = mlp(2 * h + 6, 2 * h, 6), mlp(2 * h + 6, 2 * h, 1)
        if not first:
            self.embed = nn.Sequential(nn.Linear(6, h // 2), nn.ReLU(), nn.Linear(h // 2, h // 2))
            self.relation = mlp(h, h // 2, 1)

    def forward(
        self, local: Tensor, node: Tensor, target: Tensor, pose: Tensor | None, remain: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        n, slots, _ = node.shape
        weight = (remain[:, None] & remain[:, :, None] & ~torch.eye(slots, dtype=torch.bool, device=node.device)).to(
            node.dtype
        )
        if pose is not None:  # otherwise the graph is full
            of_pose = self.embed(pose)
            pair = torch.cat(
                [
                    of_pose[:, :, None].expand(-1, -1, slots, -1),
                    of_pose[:, None].expand(-1, slots, -1, -1),
                ],
                dim=-1,
            )
            weight = weight * torch.sigmoid(self.relation(pair)[..., 0])
        messages = self.edge(self.of_receiver(node)[:, :, None] + self.of_sender(node)[:, None])
        gathered = (weight[..., None] * messages).sum(dim=2) / (weight.sum(dim=2)[..., None] + 1e-6)
        wide = target[:, None].expand(-1, slots, -1)
        told = self.from_target(torch.cat([node, wide], dim=-1))
        if not self.last:
            heard = self.to_target(torch.cat([node, wide], dim=-1))
            kept = remain[..., None].to(node.dtype)
            mean = (heard * kept).sum(dim=1) / kept.sum(dim=1).clamp(min=1)
            target = self.target(torch.cat([target, mean], dim=-1))
        node = self.node(torch.cat([node, gathered, told], dim=-1))
        last = node.new_zeros(n, slots, 6) if pose is None else pose
        state = torch.cat([local, node, last], dim=-1)
        return node, target, self.pose(state), self.probability(state)[..., 0]


class _PointNet(nn.Module):
    """A perceptron by point (Qi et al., 2017); the caller takes the maximum over points."""

    def __init__(self, widths: tuple[int, ...], out: int) -> None:
        super().__init__()
        sizes = (6, *widths)
        layers: list[nn.Module] = []
        for before, after in pairwise(sizes):
            layers += [nn.Linear(before, after), nn.LayerNorm(after), nn.ReLU()]
        self.layers = nn.Sequential(*layers, nn.Linear(sizes[-1], out))

    def forward(self, cloud: Tensor) -> Tensor:
        return self.layers(cloud)
