"""The lattice of remaining sets of a small system, as one table: how many ways each set comes apart."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from jaxtyping import Int
from numba import njit

from sashimono.disassembly.conditions.systems import System

MOST_PARTS = 20
"""20! is the largest factorial within 64 bits."""


@lru_cache(maxsize=16)
def ways_to_empty(system: System) -> Int[np.ndarray, "subset"]:
    """Return, for every set of remaining parts of at most `MOST_PARTS`, how many orders remove them all."""
    assert len(system) <= MOST_PARTS, "larger counts may not fit into 64 bits"
    clauses = np.array([clause for clauses in system for clause in clauses], np.int64)
    start = np.cumsum([0] + [len(clauses) for clauses in system])
    ways = np.zeros(1 << len(system), np.int64)
    _fill(clauses, start, ways)
    ways.setflags(write=False)
    return ways


@njit(cache=True, nogil=True)
def _fill(clauses, start, ways):  # pragma: no cover - compiled
    ways[0] = 1
    for mask in range(1, ways.shape[0]):
        total = 0
        for part in range(start.shape[0] - 1):
            if mask >> part & 1:
                rest = mask ^ (1 << part)
                for k in range(start[part], start[part + 1]):
                    if clauses[k] & rest == 0:
                        total += ways[rest]
                        break
        ways[mask] = total
