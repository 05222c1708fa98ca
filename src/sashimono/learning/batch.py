"""A batch as the models see it: made and augmented on the device, from clouds that lie there.

One random rotation turns a blueprint with all of its parts, normals and pose labels. Everything random follows from one
seed, so that a resumed run sees what an uninterrupted one would have seen.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from sashimono.learning.cloud_cache import CloudCache


@dataclass(frozen=True, kw_only=True)
class BatchConfig:
    """What a batch holds."""

    blueprints: int = 16
    """Blueprints a batch."""
    states: int = 8
    """States of each blueprint; the clouds are encoded once for all of them."""
    part_points: int = 128
    """Points of each part."""
    target_points: int = 256
    """Points of each blueprint."""
    local: bool = False
    """Whether parts are also given in random frames of their own, with their poses as labels."""
    rotate: bool = True
    """Whether each blueprint is turned at random."""
    jitter: float = 0.003
    """Standard deviation of the noise on points, in the unit frame."""
    extras: tuple[str, ...] = ()
    """Names of the cache's added arrays that a batch brings along."""


@dataclass(frozen=True, kw_only=True, eq=False)
class DeviceClouds:
    """A cache's arrays as tensors on one device, and what the host must know to ask for them."""

    device: torch.device
    counts: np.ndarray
    """Parts of each blueprint, on the host."""
    first_part: np.ndarray
    """Where each blueprint's parts begin, on the host."""
    part_points: Tensor
    part_class: Tensor
    blueprint_points: Tensor
    blueprint_part: Tensor
    placed: Tensor
    right: Tensor
    first_state: Tensor
    state_count: Tensor
    state_weight: Tensor
    """Cumulative weights of each blueprint's states, evenly over the numbers of placed parts: (blueprint, most)."""
    part_extras: Mapping[str, Tensor]
    pair_extras: Mapping[str, Tensor]
    first_pair: np.ndarray

    @classmethod
    def of(cls, cache: CloudCache, device: str, *, extras: Collection[str] | None = None) -> DeviceClouds:
        """Return a cache's arrays on a device, with these of the added ones; all of them, if None."""

        def move(array: np.ndarray) -> Tensor:
            return torch.from_numpy(np.asarray(array)).to(device)

        def move_extras(arrays: Mapping[str, np.ndarray]) -> dict[str, Tensor]:
            return {name: move(array) for name, array in arrays.items() if extras is None or name in extras}

        return cls(
            device=torch.device(device),
            counts=cache.counts,
            first_part=cache.first_part,
            part_points=move(cache.part_points),
            part_class=move(cache.part_class).long(),
            blueprint_points=move(cache.blueprint_points),
            blueprint_part=move(cache.blueprint_part),
            placed=move(cache.placed),
            right=move(cache.right),
            first_state=move(cache.first_state[:-1]),
            state_count=move(np.diff(cache.first_state)),
            state_weight=move(_state_weights(cache)),
            part_extras=move_extras(cache.part_extras),
            pair_extras=move_extras(cache.pair_extras),
            first_pair=cache.first_pair,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Batch:
    """B blueprints of at most M parts, P parts in all, S states each.

    Clouds are of valid parts only, concatenated; ``owner`` and ``slot`` say where each belongs, and `padded` puts
    values by part there.
    """

    blueprints: Tensor
    """Indices in the cache (B,)."""
    part_index: Tensor
    """Indices of the parts in the cache (P,)."""
    owner: Tensor
    """Blueprint of each part (P,)."""
    slot: Tensor
    """Index of each part within its blueprint (P,)."""
    present: Tensor
    """Which of the M slots are parts (B, M)."""
    shape_class: Tensor
    """Parts of one blueprint with the same number have the same shape; -1 where there is no part (B, M)."""
    parts: Tensor
    """Points of the parts in place (P, Nr, 6)."""
    target: Tensor
    """Points of the blueprint (B, Nt, 6)."""
    target_part: Tensor
    """Slot of the part that each of them is of (B, Nt)."""
    rotation: Tensor
    """What each blueprint was turned by (B, 3, 3)."""
    parts_local: Tensor | None
    """Points of the parts about their centres, each turned at random (P, Nr, 6); None if not asked for."""
    pose: Tensor | None
    """Pose that brings ``parts_local`` into place: translation, axis times angle (P, 6)."""
    remaining: Tensor
    """Parts not yet placed (B, S, M)."""
    y: Tensor
    """1 for the remaining parts that are right next, else 0 (B, S, M)."""
    part_extras: Mapping[str, Tensor]
    """Added arrays by part (P, ...)."""
    pair_extras: Mapping[str, Tensor]
    """Added arrays by ordered pair of parts (B, M, M, ...), zero where there is no part."""
    progress: float = 1.0
    """Share of the training that is over, for losses that change on the way."""

    @property
    def placed(self) -> Tensor:
        """Parts already placed (B, S, M)."""
        return self.present[:, None] & ~self.remaining


def make_batch(
    clouds: DeviceClouds,
    blueprints: Sequence[int] | np.ndarray,
    *,
    config: BatchConfig,
    seed: int,
    placed: Sequence[Sequence[int]] | np.ndarray | None = None,
    slots: int | None = None,
    progress: float = 1.0,
) -> Batch:
    """Return a batch of these blueprints; the same for the same seed.

    Args:
        clouds: Where the blueprints are.
        blueprints: Their indices.
        config: What the batch holds; without ``rotate`` and ``jitter`` only local frames and slices are random.
        seed: Of slices, rotations, noise and states.
        placed: The states as masks, one row a blueprint. ``y`` is then zero. None: states are drawn from the pool,
            evenly over the numbers of placed parts.
        slots: M; as many as the largest blueprint has parts, if None.
        progress: Share of the training that is over.
    """
    device = clouds.device
    missing = [name for name in config.extras if name not in clouds.part_extras and name not in clouds.pair_extras]
    assert not missing, f"the cache has no {missing[0]}: see sashimono.learning.registry.prepared"
    random = torch.Generator(device).manual_seed(seed)
    chosen = np.asarray(blueprints, dtype=np.int64)
    counts = clouds.counts[chosen]
    most = int(counts.max()) if slots is None else slots
    owner_host = np.repeat(np.arange(len(chosen)), counts)
    slot_host = np.arange(len(owner_host)) - np.repeat(np.cumsum(counts) - counts, counts)
    host = np.stack([owner_host, slot_host, clouds.first_part[chosen][owner_host] + slot_host])
    owner, slot, part_index = torch.from_numpy(host).to(device, non_blocking=True)
    index = torch.from_numpy(chosen).to(device, non_blocking=True)
    present = torch.from_numpy(counts).to(device)[:, None] > torch.arange(most, device=device)

    turn = random_quaternions(len(chosen), random) if config.rotate else _unturned(len(chosen), device)
    rotation = rotations_of(turn)
    parts = _slice(clouds.part_points, part_index, config.part_points, random)[0]
    target, points = _slice(clouds.blueprint_points, index, config.target_points, random)
    center = clouds.part_points[part_index, :, :3].float().mean(dim=1) if config.local else None
    parts_local = pose = None
    if center is not None:
        own = random_quaternions(len(owner), random)
        parts_local = _jittered(_turned(_moved(parts, -center), rotations_of(own)), config.jitter, random)
        moved = (rotation[owner] @ center[..., None])[..., 0]
        pose = torch.cat([moved, axis_angle_between(turn[owner], own)], dim=1)
    remaining, y = _states(clouds, index, present, config.states, placed, random)
    return Batch(
        blueprints=index,
        part_index=part_index,
        owner=owner,
        slot=slot,
        present=present,
        shape_class=torch.full_like(present, -1, dtype=torch.long).index_put(
            (owner, slot), clouds.part_class[part_index]
        ),
        parts=_jittered(_turned(parts, rotation[owner]), config.jitter, random),
        target=_jittered(_turned(target, rotation), config.jitter, random),
        target_part=clouds.blueprint_part[index[:, None], points].long(),
        rotation=rotation,
        parts_local=parts_local,
        pose=pose,
        remaining=remaining,
        y=y,
        part_extras={
            name: clouds.part_extras[name][part_index] for name in config.extras if name in clouds.part_extras
        },
        pair_extras={
            name: _pairs(clouds, name, chosen, counts, most) for name in config.extras if name in clouds.pair_extras
        },
        progress=progress,
    )


def padded(values: Tensor, batch: Batch) -> Tensor:
    """Return values by part (P, ...) at their slots (B, M, ...), zero where there is no part."""
    return values.new_zeros(*batch.present.shape, *values.shape[1:]).index_put((batch.owner, batch.slot), values)


def bits_of(masks: Tensor, slots: int) -> Tensor:
    """Return part sets given as masks (...) as booleans by slot (..., M)."""
    return (masks[..., None] >> torch.arange(slots, device=masks.device) & 1).bool()


def random_quaternions(count: int, random: torch.Generator) -> Tensor:
    """Return unit quaternions (w, x, y, z) of rotations drawn evenly (count, 4)."""
    return functional.normalize(torch.randn(count, 4, generator=random, device=random.device), dim=1)


def rotations_of(quaternions: Tensor) -> Tensor:
    """Return the rotation matrices (n, 3, 3) of unit quaternions (n, 4)."""
    v = quaternions[:, 1:]
    w, (x, y, z) = quaternions[:, 0], v.unbind(1)
    zero = torch.zeros_like(w)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).unflatten(1, (3, 3))
    eye = torch.eye(3, device=v.device, dtype=v.dtype)
    return 2 * (v[:, :, None] * v[:, None] + w[:, None, None] * cross) + (2 * w.square() - 1)[:, None, None] * eye


def axis_angle_between(after: Tensor, before: Tensor) -> Tensor:
    """Return the axis times the angle, at most π, of ``after`` times the inverse of ``before``: (n, 3).

    Args:
        after: Unit quaternions (n, 4).
        before: The same.
    """
    a, b = after[:, :1], before[:, :1]
    u, v = after[:, 1:], before[:, 1:]
    w = a * b + (u * v).sum(dim=1, keepdim=True)
    axis = b * u - a * v - torch.linalg.cross(u, v)
    axis, w = torch.where(w < 0, -axis, axis), w.abs()
    sine = axis.norm(dim=1, keepdim=True)
    return axis * torch.where(sine > 1e-7, 2 * torch.atan2(sine, w) / sine.clamp(min=1e-7), torch.full_like(w, 2.0))


def rotation_matrix(vector: Tensor) -> Tensor:
    """Return the rotation matrices (..., 3, 3) of axes times angles (..., 3), by Rodrigues' formula."""
    square = vector.square().sum(dim=-1)[..., None, None]
    small = square < 1e-8
    angle = torch.where(small, torch.ones_like(square), square).sqrt()
    sine = torch.where(small, 1 - square / 6, torch.sin(angle) / angle)
    versine = torch.where(small, 0.5 - square / 24, (1 - torch.cos(angle)) / angle**2)
    zero = torch.zeros_like(vector[..., 0])
    x, y, z = vector.unbind(-1)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=-1).unflatten(-1, (3, 3))
    eye = torch.eye(3, device=vector.device, dtype=vector.dtype)
    # the square of the cross product's matrix, without a matrix product: those are in half precision under autocast
    twice = vector[..., :, None] * vector[..., None, :] - square * eye
    return eye + sine * cross + versine * twice


def _state_weights(cache: CloudCache) -> np.ndarray:
    """Return cumulative weights of the states of each blueprint: each number of placed parts weighs the same."""
    most = int(np.diff(cache.first_state).max())
    out = np.ones((len(cache), most), dtype=np.float32)
    for k in range(len(cache)):
        levels = np.bitwise_count(cache.placed[cache.states_of(k)])
        found, where, sizes = np.unique(levels, return_inverse=True, return_counts=True)
        out[k, : len(levels)] = np.cumsum(1.0 / (len(found) * sizes[where]))
        out[k, len(levels) - 1] = 1.0
    return out


def _states(
    clouds: DeviceClouds,
    index: Tensor,
    present: Tensor,
    count: int,
    placed: Sequence[Sequence[int]] | np.ndarray | None,
    random: torch.Generator,
) -> tuple[Tensor, Tensor]:
    slots = present.shape[1]
    if placed is not None:
        given = torch.from_numpy(np.asarray(placed, dtype=np.int64)).to(clouds.device)
        remaining = ~bits_of(given, slots) & present[:, None]
        return remaining, torch.zeros_like(remaining, dtype=torch.float32)
    # systematic sampling: few states are drawn twice, and each has its weight in expectation
    u = torch.rand(len(index), 1, generator=random, device=clouds.device)
    u = (torch.arange(count, device=clouds.device) + u) / count
    rank = torch.searchsorted(clouds.state_weight[index], u, right=True)
    state = clouds.first_state[index][:, None] + torch.minimum(rank, clouds.state_count[index][:, None] - 1)
    remaining = ~bits_of(clouds.placed[state], slots) & present[:, None]
    return remaining, bits_of(clouds.right[state], slots).float()


def _slice(cloud: Tensor, rows: Tensor, count: int, random: torch.Generator) -> tuple[Tensor, Tensor]:
    """Return so many consecutive points of each row from a random start, and which they are."""
    size = cloud.shape[1]
    assert count <= size, f"{count} points asked for of {size}"
    start = torch.randint(size, (len(rows), 1), generator=random, device=random.device)
    points = (start + torch.arange(count, device=random.device)) % size
    return cloud[rows[:, None], points].float(), points


def _unturned(count: int, device: torch.device) -> Tensor:
    return torch.tensor([1.0, 0.0, 0.0, 0.0], device=device).expand(count, 4)


def _turned(cloud: Tensor, rotation: Tensor) -> Tensor:
    turned = cloud.unflatten(-1, (2, 3)) @ rotation.transpose(1, 2)[:, None]
    return turned.flatten(-2)


def _moved(cloud: Tensor, by: Tensor) -> Tensor:
    return torch.cat([cloud[..., :3] + by[:, None], cloud[..., 3:]], dim=-1)


def _jittered(cloud: Tensor, sigma: float, random: torch.Generator) -> Tensor:
    if not sigma:
        return cloud
    noise = torch.randn(*cloud.shape[:-1], 3, generator=random, device=random.device)
    return torch.cat([cloud[..., :3] + sigma * noise, cloud[..., 3:]], dim=-1)


def _pairs(clouds: DeviceClouds, name: str, chosen: np.ndarray, counts: np.ndarray, most: int) -> Tensor:
    """Return an added array by ordered pair, padded: (B, M, M, ...)."""
    k = np.arange(most)
    valid = (k[:, None] < counts[:, None, None]) & (k < counts[:, None, None])
    rows = clouds.first_pair[chosen][:, None, None] + k[:, None] * counts[:, None, None] + k
    host = torch.from_numpy(np.where(valid, rows, 0)).to(clouds.device, non_blocking=True)
    values = clouds.pair_extras[name][host]
    mask = torch.from_numpy(valid).to(clouds.device, non_blocking=True)
    return values * mask.reshape(*mask.shape, *[1] * (values.dim() - 3)).to(values.dtype)
