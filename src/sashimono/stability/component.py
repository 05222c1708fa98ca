"""Whether rigid groups that hang together balance: forces at their touching points against their weights.

One question follows another about nearly the same groups: a plan places one part at a time. So forces that balanced
groups are kept. They are added up again for the next set, and what they leave over, the weight of a new part, goes into
new forces among the few groups that carry it. Where that fails, the linear program of all groups is solved.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog, nnls
from scipy.sparse import csc_array, eye_array, hstack

Group = tuple[str, ...]
"""Parts that are fastened to one another, in the order of placing."""
Wrenches = Float[np.ndarray, "6 force"]
"""What unit forces do to a group: force, and torque about its centre of mass over its radius."""

_FEW_ROWS = 60
"""Balances of so many rows and fewer are told by least squares first."""
_UNBALANCED = 1e-6
"""Share of a group's weight that forces of sets asked before may leave over without new ones being looked for."""
_CARRYING = 1e-9
"""Share of a group's weight from which on another carries it."""
_LITTLE = 0.01
"""Of the tolerance, what new forces among a few groups may leave over."""


class Block(NamedTuple):
    """What pushes one free group or two: the same forces, opposite on the second."""

    key: tuple[Group, ...]
    """The groups that push each other; one, if it is the table that pushes."""
    rows: tuple[int, ...]
    """Which groups of the component: those of them that are free."""
    wrenches: tuple[Wrenches, ...]
    """On each of these, over its weight and radius."""
    unit: float
    """Weight that a unit force is as strong as [m³]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Component:
    """Free rigid groups that hang together by touching, and the linear program of their balance."""

    groups: tuple[Group, ...]
    """Parts by group."""
    blocks: tuple[Block, ...]
    """What pushes them."""
    wanted: Float[np.ndarray, "row"]
    """What the forces must add up to, six rows a group."""
    tolerance: float
    """Imbalance that is accepted, in sum."""
    alone: dict[tuple[Group, bytes], bool] = field(default_factory=dict)
    """Which groups balance while all others are held, as far as that was asked, by what pushes them."""
    balanced: dict[tuple[Group, ...], Float[np.ndarray, "force"]] = field(default_factory=dict)
    """Strengths of the forces by which sets asked before stood [m³], by block."""

    @property
    def forces(self) -> int:
        """How many unit forces there are."""
        return sum(block.wrenches[0].shape[1] for block in self.blocks)

    @cached_property
    def wrenches(self) -> csc_array:
        """(6 a group, forces): what each unit force does to each group, over the group's weight and radius."""
        values, rows, columns, start = [], [], [], 0
        for block in self.blocks:
            for k, own in zip(block.rows, block.wrenches, strict=True):
                row, column = np.indices(own.shape)
                values.append(own.ravel())
                rows.append(6 * k + row.ravel())
                columns.append(start + column.ravel())
            start += block.wrenches[0].shape[1]
        if not values:
            return csc_array((len(self.wanted), 0))
        at = np.concatenate(rows), np.concatenate(columns)
        matrix = csc_array((np.concatenate(values), at), shape=(len(self.wanted), start))
        matrix.eliminate_zeros()
        return matrix

    def imbalance(self, held: Collection[int] = ()) -> Float[np.ndarray, "group"]:
        """Return what stays unbalanced of each group if these are held, least in sum, over weight and radius.

        Held groups take any wrench: nothing of theirs is unbalanced.
        """
        return self._least(held)[0]

    def _least(self, held: Collection[int]) -> tuple[Float[np.ndarray, "group"], Float[np.ndarray, "force"]]:
        """What stays unbalanced, least in sum, and the forces that leave it."""
        rows = len(self.wanted)
        cost = np.ones((len(self.groups), 6))
        cost[list(held)] = 0.0
        cost = cost.reshape(-1)
        forces = self.forces
        # none of the forces costs anything; what they leave over does
        answer = linprog(
            np.concatenate([np.zeros(forces), cost, cost]),
            A_eq=hstack([self.wrenches, eye_array(rows), -eye_array(rows)], format="csc"),
            b_eq=self.wanted,
            method="highs",
        )
        if answer.x is None:  # HiGHS gave up: nothing is shown to stand
            left = np.where(np.isin(np.arange(len(self.groups)), list(held)), 0.0, np.inf)
            return left, np.zeros(forces)
        left = answer.x[forces : forces + rows] + answer.x[forces + rows :]
        return (cost * left).reshape(-1, 6).sum(axis=1), answer.x[:forces]

    def needed(self) -> list[int]:
        """Return the groups that do not balance though all others are held: each of them must be held itself."""
        out = []
        for k, group in enumerate(self.groups):
            own = tuple(
                Block(block.key, (0,), (wrenches,), block.unit)
                for block in self.blocks
                for row, wrenches in zip(block.rows, block.wrenches, strict=True)
                if row == k
            )
            key = (group, np.concatenate([np.zeros((6, 0)), *(block.wrenches[0] for block in own)], axis=1).tobytes())
            if key not in self.alone:
                one = replace(self, groups=(group,), blocks=own, wanted=self.wanted[:6])
                self.alone[key] = one._balance() is not None
            if not self.alone[key]:
                out.append(k)
        return out

    def stands(self, held: Collection[int] = ()) -> bool:
        """Return whether all others balance if these groups are held."""
        if held or not self._stands_as_before():
            forces = self._balance(held)
            if forces is None:
                return False
            if not held:
                self._remember(forces)
        return True

    def _balance(self, held: Collection[int] = ()) -> Float[np.ndarray, "force"] | None:
        """Forces that balance all groups but the held ones; None if there are none.

        Of few groups, the least sum of squares that forces leave over tells nearly always, in a fraction of the time.
        The least sum is no less than its root, and no more than that times the root of the number of rows.
        """
        free = np.repeat(~np.isin(np.arange(len(self.groups)), list(held)), 6)
        if 0 < free.sum() <= _FEW_ROWS:
            try:
                forces, left = nnls(self.wrenches[free].toarray(), self.wanted[free])
            except RuntimeError:  # it gave up: the linear program is asked
                left = np.nan
            if np.sqrt(free.sum()) * left <= self.tolerance:
                return forces
            if left > self.tolerance:
                return None
        unbalanced, forces = self._least(held)
        return forces if unbalanced.sum() <= self.tolerance else None

    def _remember(self, forces: Float[np.ndarray, "force"]) -> None:
        start = 0
        for block in self.blocks:
            end = start + block.wrenches[0].shape[1]
            self.balanced[block.key] = block.unit * forces[start:end]
            start = end

    def _stands_as_before(self) -> bool:
        """Whether forces of sets asked before balance this one too, with new ones among the groups that carry the rest.

        True is exact: forces that balance are added up. False says nothing.
        """
        before = [self._before(block) for block in self.blocks]
        left = self._left_over(before, range(len(before)))
        unbalanced = np.abs(left).sum(axis=1)
        if unbalanced.sum() <= self.tolerance:
            return True
        path = self._load_path(np.flatnonzero(unbalanced > _UNBALANCED).tolist(), before)
        if len(path) == len(self.groups):
            return False
        within = [k for k, block in enumerate(self.blocks) if path.issuperset(block.rows)]
        others = sorted(set(range(len(before))) - set(within))
        place = {k: n for n, k in enumerate(sorted(path))}
        some = replace(
            self,
            groups=tuple(self.groups[k] for k in place),
            blocks=tuple(
                block._replace(rows=tuple(place[k] for k in block.rows))
                for block in map(self.blocks.__getitem__, within)
            ),
            wanted=self._left_over(before, others)[list(place)].reshape(-1),
            tolerance=_LITTLE * self.tolerance,
        )
        forces = some._balance()
        if forces is None:
            return False
        changed = dict(zip(within, np.split(forces, np.cumsum([len(before[k]) for k in within])[:-1]), strict=True))
        after = [changed.get(k, each) for k, each in enumerate(before)]
        if np.abs(self._left_over(after, range(len(after)))).sum() > self.tolerance:
            return False
        some._remember(forces)
        return True

    def _before(self, block: Block) -> Float[np.ndarray, "force"]:
        """How strong a block's forces were, in its own unit."""
        known = self.balanced.get(block.key)
        count = block.wrenches[0].shape[1]
        return np.zeros(count) if known is None or len(known) != count else known / block.unit

    def _left_over(self, strengths: Sequence[np.ndarray], some: Iterable[int]) -> Float[np.ndarray, "group 6"]:
        """What is wanted less what forces of some blocks do."""
        left = self.wanted.reshape(-1, 6).copy()
        for k in some:
            if strengths[k].any():
                for row, wrenches in zip(self.blocks[k].rows, self.blocks[k].wrenches, strict=True):
                    left[row] -= wrenches @ strengths[k]
        return left

    def _load_path(self, changed: Sequence[int], strengths: Sequence[np.ndarray]) -> set[int]:
        """These groups, what they touch, and all that carries those."""
        touching: dict[int, list[int]] = {k: [] for k in range(len(self.groups))}
        carriers: dict[int, list[int]] = {k: [] for k in range(len(self.groups))}
        for block, strong in zip(self.blocks, strengths, strict=True):
            if len(block.rows) == 2:
                for side, (upper, lower) in enumerate((block.rows, block.rows[::-1])):
                    touching[upper].append(lower)
                    up = self.wanted[6 * upper : 6 * upper + 3]
                    if strong.any() and up @ (block.wrenches[side][:3] @ strong) > _CARRYING:
                        carriers[upper].append(lower)
        found = {*changed, *(other for k in changed for other in touching[k])}
        to_do = list(found)
        while to_do:
            more = set(carriers[to_do.pop()]) - found
            found |= more
            to_do += more
        return found
