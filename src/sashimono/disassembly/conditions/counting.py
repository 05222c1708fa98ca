"""How many complete removal orders a system has: exactly, without walking all sets of remaining parts.

Parts that do not constrain one another are counted apart and interleaved (a multinomial coefficient);
where all of some parts leave before all others, the two are counted apart and multiplied; what is left
is split by which part leaves first, or which leaves last. Systems equal up to names are solved once.
Series and parallel structure thus costs polynomial work (Möhring 1989); in general counting linear
extensions is #P-complete (Brightwell & Winkler 1991), hence the budget.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial

import numpy as np

from sashimono.disassembly.conditions.lattice import ways_to_empty
from sashimono.disassembly.conditions.systems import (
    System,
    canonical_order,
    components,
    needed_before,
    restricted,
    simplified,
    stages,
)
from sashimono.disassembly.masks import bits


@dataclass(frozen=True, slots=True)
class _Piece:
    """A subsystem under canonical labels, and the label in the parent of each of its parts."""

    system: System
    labels: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class _Branch:
    """Stages that follow one another; the pieces within a stage interleave freely."""

    stages: tuple[tuple[_Piece, ...], ...]


_SINGLE: System = ((0,),)


class OrderCounter:
    """Counts orders of systems and remembers every subsystem; also draws orders with equal chances."""

    def __init__(self, *, max_states: int, table_parts: int) -> None:
        self.max_states = max_states
        self.table_parts = table_parts
        self._root: tuple[System, tuple[_Piece, ...]] = ((), ())
        self._branches: dict[System, tuple[_Branch, ...]] = {}
        self._counts: dict[System, int] = {_SINGLE: 1}

    @property
    def states(self) -> int:
        """How many different subsystems were looked at."""
        return len(self._counts) + len(self._branches.keys() - self._counts.keys()) - 1

    def count(self, system: System) -> int | None:
        """Return how many orders a solvable system has; None if that takes more than ``max_states`` subsystems."""
        root = self._pieces(system)
        pending = [piece.system for piece in root]
        while pending:
            top = pending[-1]
            if top in self._counts:
                pending.pop()
                continue
            if top not in self._branches:
                if self.states >= self.max_states:
                    return None
                if len(top) <= self.table_parts:
                    self._counts[top] = int(ways_to_empty(top)[-1])
                    continue
                self._branches[top] = _branches(top)
            missing = [
                piece.system
                for branch in self._branches[top]
                for stage in branch.stages
                for piece in stage
                if piece.system not in self._counts
            ]
            if missing:
                pending += missing
            else:
                self._counts[top] = sum(self._ways(branch) for branch in self._branches[top])
                pending.pop()
        return self._interleaved(root)

    def draw(self, system: System, rng: np.random.Generator) -> list[int]:
        """Return one order of a counted system, each with the same chance."""
        return self._draw_stage(self._pieces(system), rng)

    def _pieces(self, system: System) -> tuple[_Piece, ...]:
        if self._root[0] != system:
            self._root = (system, _stage(system, list(range(len(system))), 0))
        return self._root[1]

    def _ways(self, branch: _Branch) -> int:
        ways = 1
        for stage in branch.stages:
            ways *= self._interleaved(stage)
        return ways

    def _interleaved(self, stage: tuple[_Piece, ...]) -> int:
        ways = factorial(sum(len(piece.labels) for piece in stage))
        for piece in stage:
            ways = ways // factorial(len(piece.labels)) * self._counts[piece.system]
        return ways

    def _draw_stage(self, stage: tuple[_Piece, ...], rng: np.random.Generator) -> list[int]:
        drawn = [[piece.labels[k] for k in reversed(self._draw_system(piece.system, rng))] for piece in stage]
        turns = np.repeat(np.arange(len(stage)), [len(piece.labels) for piece in stage])
        return [drawn[turn].pop() for turn in rng.permutation(turns)]

    def _draw_system(self, system: System, rng: np.random.Generator) -> list[int]:
        if system == _SINGLE:
            return [0]
        if len(system) <= self.table_parts:
            return _draw_from_table(system, rng)
        pick = random_below(self._counts[system], rng)
        for branch in self._branches[system]:
            pick -= self._ways(branch)
            if pick < 0:
                return [part for stage in branch.stages for part in self._draw_stage(stage, rng)]
        raise AssertionError("the branches make up the whole count")


def _draw_from_table(system: System, rng: np.random.Generator) -> list[int]:
    ways = ways_to_empty(system)
    order, remaining = [], len(ways) - 1
    while remaining:
        pick = random_below(int(ways[remaining]), rng)
        for part in bits(remaining):
            rest = remaining ^ (1 << part)
            if any(not clause & rest for clause in system[part]):
                pick -= int(ways[rest])
                if pick < 0:
                    break
        order.append(part)
        remaining = rest
    return order


def random_below(bound: int, rng: np.random.Generator) -> int:
    """Return an integer from 0 to ``bound - 1``, each with exactly the same chance, however large the bound."""
    size = bound.bit_length()
    while True:
        value = int.from_bytes(rng.bytes((size + 7) // 8), "little") & ((1 << size) - 1)
        if value < bound:
            return value


def _stage(system: System, parts: list[int], later: int) -> tuple[_Piece, ...]:
    """The pieces into which some parts of a system fall, once the others are gone or, if in ``later``, stay."""
    inner = restricted(system, parts, later)
    inner = simplified(inner, needed_before(inner))
    pieces = []
    for group in components(inner):
        members = bits(group)
        if len(members) == 1:
            pieces.append(_Piece(_SINGLE, (parts[members[0]],)))
            continue
        piece = restricted(inner, members, 0)
        order = canonical_order(piece, needed_before(piece))
        pieces.append(_Piece(restricted(piece, order, 0), tuple(parts[members[k]] for k in order)))
    return tuple(pieces)


def _branches(system: System) -> tuple[_Branch, ...]:
    """The ways to go on with a connected system: in series, else by the first part or by the last one."""
    needed = needed_before(system)
    everything = (1 << len(system)) - 1
    series = stages(needed)
    if len(series) > 1:
        parts, later = [], everything
        for stage in series:
            later &= ~stage
            parts.append(_stage(system, bits(stage), later))
        return (_Branch(tuple(parts)),)
    firsts = [part for part, clauses in enumerate(system) if clauses == (0,)]
    not_last = 0
    for mask in needed:
        not_last |= mask
    lasts = bits(everything & ~not_last)
    branches = []
    for part in min(firsts, lasts, key=len):
        single = (_Piece(_SINGLE, (part,)),)
        rest = [k for k in range(len(system)) if k != part]
        if len(firsts) <= len(lasts):
            branches.append(_Branch((single, _stage(system, rest, 0))))
        else:
            branches.append(_Branch((_stage(system, rest, 1 << part), single)))
    return tuple(branches)
