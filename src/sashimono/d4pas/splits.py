"""Splits: by family, then by groups of near-duplicates, so that no test blueprint has a twin in training."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import KDTree

TRAIN, VAL, TEST, UNSEEN, REAL = "train", "val", "test", "unseen-families", "real"
SPLITS = (TRAIN, VAL, TEST, UNSEEN, REAL)


@dataclass(frozen=True, kw_only=True)
class SplitConfig:
    """How many blueprints go where."""

    test: int = 500
    """Blueprints of three or more parts in the test split, over all families but the unseen ones."""
    val: int = 500
    unseen: tuple[str, ...] = ()
    """Families that are never trained on."""
    most_share: float = 0.2
    """Of one family, test and val each get no more than this."""
    near: float = 0.02
    """Blueprints whose descriptors are nearer than this (root mean square over the numbers) are near-duplicates."""


def assign_splits(blueprints: Sequence[Mapping[str, Any]], *, config: SplitConfig) -> list[str]:
    """Return the split of each blueprint row. It depends on the rows and the configuration alone.

    Two-part blueprints go where the product went that they are taken from: it has their family and seed. Groups of
    near-duplicates stay together; each group's place is drawn by a hash of its ids.
    """
    out = [TRAIN] * len(blueprints)
    by_family: dict[str, list[int]] = {}
    for k, row in enumerate(blueprints):
        if row["family"] in config.unseen:
            out[k] = UNSEEN
        elif row["n_parts"] > 2:
            by_family.setdefault(row["family"], []).append(k)
    total = sum(len(members) for members in by_family.values())
    of_product = {(row["family"], row["seed"]): k for k, row in enumerate(blueprints) if row["n_parts"] > 2}
    for members in by_family.values():
        share = len(members) / max(1, total)
        quotas = {
            split: min(round(count * share), round(config.most_share * len(members)))
            for split, count in ((TEST, config.test), (VAL, config.val))
        }
        groups = near_duplicates([blueprints[k]["descriptor"] for k in members], near=config.near)
        groups = sorted(groups, key=lambda group: _draw([blueprints[members[k]]["id"] for k in group]))
        for split, quota in quotas.items():
            for group in groups:
                if quota >= len(group) and out[members[group[0]]] == TRAIN:
                    quota -= len(group)
                    for k in group:
                        out[members[k]] = split
    for k, row in enumerate(blueprints):
        if row["n_parts"] == 2 and out[k] == TRAIN:
            out[k] = out[of_product.get((row["family"], row["seed"]), k)]
    return out


def near_duplicates(descriptors: Sequence[Sequence[float]], *, near: float) -> list[list[int]]:
    """Return groups of descriptors of which each has another one of its group near it; most have one member."""
    points = np.asarray(descriptors, dtype=np.float64)
    root = list(range(len(points)))

    def find(k: int) -> int:
        while root[k] != k:
            root[k] = root[root[k]]
            k = root[k]
        return k

    for a, b in KDTree(points).query_pairs(near * np.sqrt(points.shape[1])):
        root[max(find(a), find(b))] = min(find(a), find(b))
    groups: dict[int, list[int]] = {}
    for k in range(len(points)):
        groups.setdefault(find(k), []).append(k)
    return list(groups.values())


def _draw(ids: list[str]) -> bytes:
    return hashlib.sha256("/".join(sorted(ids)).encode()).digest()
