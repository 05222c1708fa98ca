"""What `past-posed` needs beside the clouds, added to a cache once: relations of parts, and their clauses."""

from __future__ import annotations

import logging
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from sashimono.d4pas.states import Masks
from sashimono.learning.cloud_cache import CloudCache, Dataset
from sashimono.learning.relations import (
    LINE_FEATURES,
    PAIR_FEATURES,
    PATH_FEATURES,
    VERSION,
    RelationConfig,
    find_relations,
)

EXTRAS = ("paths", "pairs", "lines", "clauses")
"""Names of what is added: what a batch of `past-posed` brings along."""

MOST_CLAUSES = 24
"""Clauses kept of a part, those of fewest blockers."""

log = logging.getLogger(__name__)


def add_relations(
    cache: CloudCache, data: Dataset, *, config: RelationConfig | None = None, workers: int = 1
) -> CloudCache:
    """Return the cache with relations and clauses; measured now if they are not there. Workers are threads.

    The dataset is the one that the cache was made from.
    """
    config = config or RelationConfig()
    mark, said = cache.folder / "relations.txt", f"{VERSION} {config}\n"
    if mark.exists() and mark.read_text(encoding="utf-8") == said:
        return cache
    parts, pairs, K = int(cache.first_part[-1]), int(cache.first_pair[-1]), config.directions
    lines = np.zeros((parts, K, len(LINE_FEATURES)), np.float16)
    between = np.zeros((pairs, len(PAIR_FEATURES)), np.float16)
    paths = np.zeros((pairs, K, len(PATH_FEATURES)), np.float16)

    def measure(k: int) -> None:
        found = find_relations(np.asarray(cache.part_points[cache.parts_of(k)]), config=config)
        here = slice(int(cache.first_pair[k]), int(cache.first_pair[k + 1]))
        paths[here] = found.paths.reshape(-1, *found.paths.shape[2:])
        between[here] = found.pairs.reshape(-1, found.pairs.shape[2])
        lines[cache.parts_of(k)] = found.lines

    with ThreadPoolExecutor(workers) as pool:
        for done, _ in enumerate(pool.map(measure, range(len(cache))), start=1):
            if done % 1000 == 0:
                log.info("relations of %d of %d blueprints", done, len(cache))
    for blueprint, name in zip(data.blueprints, cache.ids, strict=True):
        assert blueprint.id == name, "the dataset is not the cache's"
    cache.add_part_extra("lines", lines)
    cache.add_part_extra("clauses", np.concatenate([clause_table(blueprint.masks) for blueprint in data.blueprints]))
    cache.add_pair_extra("pairs", between)
    cache = cache.add_pair_extra("paths", paths)
    mark.write_text(said, encoding="utf-8")
    return cache


def clause_table(masks: Masks) -> np.ndarray:
    """Return the clauses of each part as masks (part, clause), -1 where there is none."""
    out = np.full((len(masks), MOST_CLAUSES), -1, np.int64)
    for part, clauses in enumerate(masks):
        kept = sorted(clauses, key=lambda clause: (clause.bit_count(), clause))[:MOST_CLAUSES]
        out[part, : len(kept)] = kept
    return out
