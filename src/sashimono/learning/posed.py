"""`past-posed`: sequence inference from parts in place, by a rule whose terms are learned.

The poses of the parts are given in the problem, so nothing hides them here. For every part, every other part and every
direction that the part might leave along, a network says from their relations (`relations.py`) whether the other is in
the way. A part can leave if along *some* direction *no* part that is there is in the way: a soft OR over directions of
a soft AND over parts, differentiable, so that the exact answers by state train the network end to end. What such a rule
cannot say, a residual adds: it sees the relations to all parts of the state at once.

Since fewer parts never block more, a set of placed parts can be reached exactly if all others leave one after the other
while it stays. A part is right next if it can leave once it is placed, and the set with it can be reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from sashimono.learning.batch import Batch, padded
from sashimono.learning.model import Scores, masked_mean
from sashimono.learning.relations import LINE_FEATURES, PAIR_FEATURES, PATH_FEATURES

STRAIGHT = {
    "entry_spacings": -1.0,
    "entry_length": -1.0,
    "entry_one": 1.0,
    "entry_enclosed": 1.0,
    "travel": -1.0,
    "wall_spacings": -1.0,
    "wall_inside": 1.0,
    "own_spacings": -1.0,
    "own_inside": 1.0,
    "touch_against": 1.0,
}
"""What the residual is told of a state as it is measured, with the sign by which more of it means blocked: the worst
over the parts that are there. The smallest lateral clearance, by which the rule without learning decides, is in it."""

NEVER = -30.0
"""Logit of what cannot be."""


@dataclass(frozen=True, kw_only=True)
class PosedConfig:
    """Sizes of `past-posed`."""

    width: int = 64
    """Features of a relation."""
    depth: int = 2
    """Layers that make them, before and after each look at what surrounds them."""
    looks: int = 1
    """How often a relation takes in what surrounds it: the part's other relations along the same direction and along
    all, and how the other part stands to it."""
    rounds: int = 2
    """Rounds in which parts tell one another what they see in a state; 0: no residual."""
    heads: int = 4
    """Heads of their attention."""
    detour: bool = True
    """Whether a part may also leave by a way that is no straight line."""
    pick: float = 0.5
    """Weight of the loss on which part is surest, beside those on each part."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Encoded:
    """What is known of blueprints before any state is asked about."""

    present: Tensor
    """(B, M)."""
    free: Tensor
    """Logits that j is not in the way of i along direction d (B, M, M, K); large where j is no other part."""
    seen: Tensor
    """Features of the same relation, for the residual (B, M, M, K, h)."""
    pair: Tensor
    """Bias of the residual's attention (B, rounds, heads, M, M)."""
    token: Tensor
    """Features of each part (B, M, h)."""


class Posed(nn.Module):
    """The network; see the module's text."""

    def __init__(self, config: PosedConfig) -> None:
        super().__init__()
        self.config = config
        h, seen = config.width, config.width // 2 + len(STRAIGHT)
        self.line = nn.Sequential(nn.Linear(len(LINE_FEATURES), h), nn.GELU(), nn.Linear(h, h))
        self.path = nn.Linear(len(PATH_FEATURES), h)
        self.pair = nn.Linear(2 * len(PAIR_FEATURES), h)
        self.relation = nn.ModuleList(Residual(h) for _ in range(config.depth * (config.looks + 1)))
        self.around = nn.ModuleList(nn.Linear(5 * h, h) for _ in range(config.looks))
        self.free = nn.Linear(h, 1)
        self.detour = nn.Sequential(nn.Linear(2 * h, h), nn.GELU(), nn.Linear(h, 1))
        if config.rounds:
            self.seen = nn.Linear(h, config.width // 2)
            self.bias = nn.Linear(h, config.rounds * config.heads)
            self.token = nn.Linear(h, h)
            self.way = nn.Sequential(nn.Linear(3 * seen + 1, h), nn.GELU(), nn.Linear(h, h))
            self.state = nn.Embedding(2, h)
            self.rounds = nn.ModuleList(Round(h, config.heads) for _ in range(config.rounds))
            last = nn.Linear(h, 2)
            self.adds = nn.Sequential(nn.LayerNorm(h), last)
            nn.init.zeros_(last.weight)
            nn.init.zeros_(last.bias)
        self.scale = nn.Parameter(torch.tensor([1.0, 1.0, 0.0]))

    def encode(self, batch: Batch) -> Encoded:
        """Return what is known before any state is asked about."""
        return self.relate(
            batch.pair_extras["paths"].float(),
            batch.pair_extras["pairs"].float(),
            padded(batch.part_extras["lines"], batch).float(),
            batch.present,
        )

    def relate(self, paths: Tensor, pairs: Tensor, lines: Tensor, present: Tensor) -> Encoded:
        """Return the same from relations (B, M, M, K, F), (B, M, M, G), (B, M, K, H)."""
        both = self.pair(torch.cat([pairs, pairs.transpose(1, 2)], dim=-1))
        line = self.line(lines)
        x = self.path(paths) + both[:, :, :, None] + line[:, :, None]
        other = present[:, None, :] & others(present)
        for n, layer in enumerate(self.relation):
            if n and n % self.config.depth == 0:
                x = x + self.around[n // self.config.depth - 1](surroundings(x, other))
            x = layer(x)
        free = self.free(x)[..., 0]
        most = x.amax(dim=3)
        if self.config.detour:
            around = self.detour(torch.cat([most, x.mean(dim=3)], dim=-1)) - 3.0
            free = torch.cat([free, around], dim=3)
        free = torch.where(other[..., None], free, torch.full_like(free, -NEVER))
        if not self.config.rounds:
            nothing = torch.zeros_like(free[:, None, None, :, :, 0])
            return Encoded(present=present, free=free, seen=x[..., :1], pair=nothing, token=line.amax(dim=2))
        bias = self.bias(most).permute(0, 3, 1, 2)
        bias = torch.where(present[:, None, None, :], bias, torch.full_like(bias, NEVER))
        bias = bias.unflatten(1, (self.config.rounds, self.config.heads))
        mean = (
            torch.where(other[..., None], most, torch.zeros_like(most)).sum(dim=2) / present.sum(dim=1)[:, None, None]
        )
        token = self.token(mean)
        straight = torch.cat(
            [sign * paths[..., PATH_FEATURES.index(name), None] for name, sign in STRAIGHT.items()], dim=-1
        )
        seen = torch.cat([self.seen(x), straight], dim=-1)
        return Encoded(present=present, free=free, seen=seen, pair=bias, token=token + line.amax(dim=2))

    def leaving(self, encoded: Encoded, placed: Tensor) -> tuple[Tensor, Tensor]:
        """Return the logits that each part can leave the placed ones (B, S, M), and of what a residual adds to y.

        A part that is not placed is asked as if it were, beside them.
        """
        B, S, M = placed.shape
        there = placed.to(encoded.free.dtype)
        # -log of the probability that nothing placed is in the way, along each direction
        barred = functional.softplus(-encoded.free)
        ways = torch.einsum("bsj,bijk->bsik", there, barred)
        rule = any_of(ways)
        if not self.config.rounds:
            return rule, torch.zeros_like(rule)
        seen = encoded.seen  # (B, M, M, K, h)
        K = seen.shape[3]
        other = others(placed)
        here = placed[:, :, None, :] & other
        gone = (encoded.present[:, None] & ~placed)[:, :, None, :] & other
        most_here, most_gone = masked_max(seen, here), masked_max(seen, gone)
        way = torch.cat([most_here, most_gone, most_here.amax(dim=3, keepdim=True).expand_as(most_here)], dim=-1)
        way = self.way(torch.cat([way, -(ways[..., :K, None] / 4).clamp(max=2.0)], dim=-1)).amax(dim=3)
        x = (way + encoded.token[:, None] + self.state(placed.long())).flatten(0, 1)
        for n, layer in enumerate(self.rounds):
            x = layer(x, encoded.pair[:, n].repeat_interleave(S, dim=0))
        added = self.adds(x).view(B, S, M, 2)
        return rule + added[..., 0], added[..., 1]

    def score(self, encoded: Encoded, remaining: Tensor) -> Scores:
        """Return the logits that each remaining part is right next."""
        placed = encoded.present[:, None] & ~remaining
        leaving, added = self.leaving(encoded, placed)
        return Scores(logits=self.combine(leaving, added, reached(encoded.free.detach(), encoded.present, placed)))

    def combine(self, leaving: Tensor, added: Tensor, reach: Tensor) -> Tensor:
        """Return the logits of y: a part is right if it can leave and what is left then can be reached."""
        reach = self.scale[1] * reach.clamp(-12, 12) + self.scale[2]
        # the soft minimum: both must hold
        return both_of(self.scale[0] * leaving, reach) + added

    @torch.no_grad()
    def orders(self, encoded: Encoded) -> list[list[int]]:
        """Return an assembly order of each blueprint, base first: taken apart, the surest part first, and turned round.

        Taking apart never dead-ends; putting together does.
        """
        placed = encoded.present.clone()
        counts = encoded.present.sum(dim=1).tolist()
        picks = []
        for _ in range(placed.shape[1]):
            leaving, _ = self.leaving(encoded, placed[:, None])
            pick = leaving[:, 0].masked_fill(~placed, 4 * NEVER).argmax(dim=1)
            placed = placed.scatter(1, pick[:, None], False)
            picks.append(pick)
        table = torch.stack(picks, dim=1).tolist()
        return [row[:count][::-1] for row, count in zip(table, counts, strict=True)]

    def loss(self, batch: Batch) -> tuple[Tensor, dict[str, Tensor]]:
        """Return the loss and its terms: which parts are right next, and which can leave."""
        encoded = self.encode(batch)
        leaving, added = self.leaving(encoded, batch.placed)
        logits = self.combine(leaving, added, reached(encoded.free.detach(), batch.present, batch.placed))
        trained = (batch.present.sum(dim=1) > 2)[:, None, None]
        remaining, placed = trained & batch.remaining, trained & batch.placed
        y = batch.y > 0.5
        can = can_leave(padded(batch.part_extras["clauses"], batch), batch.placed)
        asked = trained & batch.present[:, None] & batch.placed.any(dim=2, keepdim=True)
        terms = {
            "right": masked_mean(binary(logits, y), remaining),
            "leave": masked_mean(binary(leaving, can), asked),
            "pick": picking(logits, y, remaining) + picking(leaving, can, placed),
        }
        return terms["right"] + terms["leave"] + self.config.pick * terms["pick"], terms


class Residual(nn.Module):
    """Two layers whose result is added."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, width), nn.GELU(), nn.Linear(width, width))

    def forward(self, x: Tensor) -> Tensor:
        return x + self.layers(x)


class Round(nn.Module):
    """Attention between the parts of a state, biased by their relations, and two layers."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.heads = heads
        self.before = nn.LayerNorm(width)
        self.query, self.key, self.value = (nn.Linear(width, width) for _ in range(3))
        self.out = nn.Linear(width, width)
        self.then = Residual(width)

    def forward(self, x: Tensor, bias: Tensor) -> Tensor:
        N, M, h = x.shape
        n = self.before(x)
        q, k, v = (f(n).view(N, M, self.heads, -1).transpose(1, 2) for f in (self.query, self.key, self.value))
        weight = torch.softmax(q @ k.transpose(2, 3) / (h // self.heads) ** 0.5 + bias, dim=-1)
        return self.then(x + self.out((weight @ v).transpose(1, 2).reshape(N, M, h)))


def surroundings(x: Tensor, other: Tensor) -> Tensor:
    """Return what surrounds each relation (B, M, M, K, 5h).

    The strongest features of part i along the same direction, and along all; of the relation along all directions, as i
    sees it and as j does; and of part j along all.
    """
    here = x.masked_fill(~other[..., None, None], -4.0)
    along = here.amax(dim=2, keepdim=True)  # (B, M, 1, K, h)
    part = along.amax(dim=3, keepdim=True)  # (B, M, 1, 1, h)
    pair = x.amax(dim=3, keepdim=True)  # (B, M, M, 1, h)
    return torch.cat([v.expand_as(x) for v in (along, part, pair, pair.transpose(1, 2), part.transpose(1, 2))], dim=-1)


def others(parts: Tensor) -> Tensor:
    """Return which of the parts of the last axis are other parts than which (M, M)."""
    k = torch.arange(parts.shape[-1], device=parts.device)
    return k[:, None] != k


def any_of(no: Tensor) -> Tensor:
    """Return the logit that some of the last axis holds, given -log of their probabilities."""
    # logit(p) = log p - log(1 - p); the product of all 1 + odds is e to the sum of softplus of the logits
    odds = functional.softplus(-no - log_of_rest(no)).sum(dim=-1)
    return (odds + log_of_rest(odds)).clamp(NEVER, -NEVER)


def log_of_rest(y: Tensor) -> Tensor:
    """Return log(1 - e^-y), also where the difference would lose its digits."""
    small = torch.log(y.clamp(min=1e-30)) - y / 2.0
    return torch.where(y < 1e-2, small, torch.log(1.0 - torch.exp(-y.clamp(min=1e-2))))


def both_of(a: Tensor, b: Tensor) -> Tensor:
    """Return the logit that two independent things hold, given their logits."""
    # σ(a) σ(b) / (1 - σ(a) σ(b)) = 1 / (e^-a + e^-b + e^-(a+b))
    return -torch.logsumexp(torch.stack([-a, -b, -a - b]), dim=0)


def masked_max(values: Tensor, keep: Tensor) -> Tensor:
    """Return the largest of values (B, M, j, K, h) over the j that are kept (B, S, M, j): (B, S, M, K, h)."""
    return values[:, None].masked_fill(~keep[..., None, None], -4.0).amax(dim=3)


@torch.no_grad()
def reached(free: Tensor, present: Tensor, placed: Tensor) -> Tensor:
    """Return the logit that the placed parts with one more can be reached by taking all apart: (B, S, M).

    The weakest step of the best way: in the algebra of the smallest and the largest, w_j = max over directions of the
    min over other parts l of max(free_jl, w_l) says how surely j leaves while the set stays; repeated until it holds.
    """
    M = placed.shape[2]
    stays = placed[:, :, None] | ~others(present) | ~present[:, None, None]
    # (B, S, i, j): parts that stay never leave; slots without a part were never there
    never = torch.where(present, NEVER, -NEVER).to(free.dtype)[:, None, None].expand(*stays.shape)
    w = never.masked_fill(~stays, NEVER)
    for _ in range(M):
        # j leaves as surely as the worst of the others allows, along the best direction
        worst = torch.full((*w.shape, free.shape[3]), -NEVER, device=free.device)
        for other in range(M):
            worst = torch.minimum(worst, torch.maximum(free[:, None, None, :, other], w[..., other, None, None]))
        last, w = w, torch.where(stays, never, worst.amax(dim=4))
        if torch.equal(w, last):
            break
    return torch.where(stays, -NEVER, w).amin(dim=3)


def can_leave(clauses: Tensor, placed: Tensor) -> Tensor:
    """Return which parts can leave the placed ones (B, S, M), from their clauses as masks (B, M, C), -1 for none."""
    bits = torch.ones((), dtype=torch.long, device=placed.device) << torch.arange(placed.shape[2], device=placed.device)
    there = (placed.long() * bits).sum(dim=2)  # (B, S)
    left = clauses[:, None] & there[:, :, None, None]
    return ((left == 0) & (clauses[:, None] != -1)).any(dim=3)


def binary(logits: Tensor, y: Tensor) -> Tensor:
    """Return the binary cross-entropy, an element each."""
    return functional.binary_cross_entropy_with_logits(logits.float(), y.float(), reduction="none")


def picking(logits: Tensor, right: Tensor, among: Tensor) -> Tensor:
    """Return the mean over states of -log(probability that a part drawn by softmax among those asked is right).

    It is what decoding picks by: of several right parts any will do, so long as none that is wrong is surer.
    """
    some = (right & among).any(dim=2)
    all_of = torch.logsumexp(logits.float().masked_fill(~among, 2 * NEVER), dim=2)
    right_of = torch.logsumexp(logits.float().masked_fill(~(right & among), 2 * NEVER), dim=2)
    return masked_mean(all_of - right_of, some)
