"""How many parts must be held, asked of many sets of placed parts on one table.

Exact answers come from `fewest_held` and cost a linear program or more. While orders are searched, a bound is enough:
the rigid groups that do not balance though all they touch is held. Each such question is about one group and the parts
around it, so that few are asked anew from one set to the next.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from sashimono.disassembly.masks import bits, pieces, reached
from sashimono.plan import Table
from sashimono.stability import Component, Statics, Touching, fewest_held


class Contacts:
    """Which parts touch and which are bonded, as bit masks: the same on every table."""

    def __init__(self, touching: Touching, names: Sequence[str]) -> None:
        self.touching = touching
        self.names = tuple(names)
        count = len(self.names)
        self.touched = [0] * count
        """By part: mask of those that can push it."""
        self.bonded = [0] * count
        """By part: mask of those that are rigidly joined to it."""
        place = {name: k for k, name in enumerate(self.names)}
        for i, name in enumerate(self.names):
            for other in touching.joined(name) & place.keys():
                self.bonded[i] |= 1 << place[other]
            for other in touching.around(name) & place.keys():
                if len(touching.between(name, other).points):
                    self.touched[i] |= 1 << place[other]
        self.attached = [t | b for t, b in zip(self.touched, self.bonded, strict=True)]
        """By part: mask of both."""

    def groups(self, placed: int) -> list[int]:
        """Return the rigid groups of the placed parts, as masks."""
        return pieces(placed, self.bonded.__getitem__)

    def around(self, group: int, placed: int) -> int:
        """Return the mask of the placed parts that touch a group from outside."""
        out = 0
        for part in bits(group):
            out |= self.touched[part]
        return out & placed & ~group


Balance = tuple[int, int, float | None]
"""A rigid group, the parts around it, and the table's offset if the group stands on it."""


class Allowance:
    """How many balances may still be asked, by all tables together."""

    def __init__(self, most: int) -> None:
        self._left = most
        self.refused = 0
        """How often one more was asked for when none was left."""

    def renew(self, most: int) -> None:
        """Allow this many again."""
        self._left = most

    def take(self) -> bool:
        """Return whether one more may be asked, and take it away."""
        if self._left <= 0:
            self.refused += 1
            return False
        self._left -= 1
        return True


class HoldCounter:
    """Counts held parts on one table."""

    def __init__(
        self, contacts: Contacts, table: Table, *, fixed: int, allowance: Allowance, known: dict[Balance, bool]
    ) -> None:
        """Take in the contacts and the table.

        Args:
            contacts: Touching and bonded parts.
            table: On which the parts stand.
            fixed: Mask of those that a fixture holds; 0 if the base stands on the table.
            allowance: Groups whose balance may be asked for the bounds; when they are spent, groups count as balanced.
            known: What was found of groups, shared by all tables with one normal.
        """
        self.contacts = contacts
        self.table = table
        self.fixed = fixed
        self._statics = Statics(contacts.touching, table)
        self._allowance = allowance
        self._stands = known
        self._offset = round(float(table.offset), 9)
        self._on_table = 0
        for k, name in enumerate(contacts.names):
            if len(contacts.touching.on_table(name, table).points):
                self._on_table |= 1 << k
        self._exact: dict[int, int] = {}
        self._bounds: dict[int, int] = {}

    def at_least(self, placed: int) -> int:
        """Return a lower bound of how many of the placed parts (a mask) must be held, as far as the budget goes."""
        if placed in self._bounds:
            return self._bounds[placed]
        refused = self._allowance.refused
        bound = self._bound(placed)
        if self._allowance.refused == refused:  # else it may rise with the next budget
            self._bounds[placed] = bound
        return bound

    def _bound(self, placed: int) -> int:
        groups = self.contacts.groups(placed)
        count, grounded = 0, 0
        for group in groups:
            if group & (self.fixed | self._on_table):
                grounded |= group
            if not group & self.fixed and not self._balances(group, placed):
                count += 1
                grounded |= group
        return count + self._floating(placed, groups, grounded)

    def fewest(self, placed: int) -> int:
        """Return the fewest of the placed parts (a mask) that must be held, as `fewest_held` finds them."""
        if placed not in self._exact:
            names, fixed = self._names(placed), self._names(self.fixed & placed)
            self._exact[placed] = len(fewest_held(self._statics, names, fixed=fixed).held)
        return self._exact[placed]

    def _balances(self, group: int, placed: int) -> bool:
        around = self.contacts.around(group, placed)
        key = (group, around, self._offset if group & self._on_table else None)
        if key not in self._stands:
            if not self._allowance.take():
                return True
            names, held = self._names(group | around), self._names(around)
            components = self._statics.components(names, held)
            self._stands[key] = all(_balances_alone(component) for component in components)
        return self._stands[key]

    def _floating(self, placed: int, groups: Sequence[int], grounded: int) -> int:
        """How many clusters of touching groups are held by nothing: neither table, fixture, nor a held part in them."""
        attached = self.contacts.attached.__getitem__
        return len(pieces(placed & ~reached(grounded, placed, attached), attached))

    def _names(self, mask: int) -> list[str]:
        return [self.contacts.names[k] for k in bits(mask)]


def unsteadiness(touching: Touching, names: Sequence[str], table: Table, *, steady: float) -> float:
    """Return how easily parts that stand on a table as one body tip: 0 for a plate that lies flat, 1 at the brink.

    It falls from 1 to 0 while the angle by which it can be tipped grows from 0 to ``steady`` [rad].
    """
    up = table.normal
    x = np.cross(up, np.eye(3)[int(np.argmin(np.abs(up)))])
    x /= np.linalg.norm(x)
    flat = np.stack([x, np.cross(up, x)], axis=1)
    points = np.concatenate([touching.on_table(name, table).points for name in names]) @ flat
    bodies, poses = touching.bodies, touching.poses
    weights = [bodies[name].mass_properties.volume for name in names]
    centers = [poses[name][:3, :3] @ bodies[name].mass_center + poses[name][:3, 3] for name in names]
    center = np.average(centers, axis=0, weights=weights)
    height = float(center @ up) - table.offset
    if len(points) < 3 or np.linalg.matrix_rank(points - points[0], tol=1e-9) < 2:
        return 1.0
    # each row is a side: inside, normal . x + offset < 0
    sides = ConvexHull(points).equations
    margin = float(-(sides[:, :2] @ (center @ flat) + sides[:, 2]).max())
    return float(np.clip(1.0 - np.arctan2(max(margin, 0.0), max(height, 1e-12)) / steady, 0.0, 1.0))


def _balances_alone(component: Component) -> bool:
    """Whether pushing forces balance one group's weight: the same question as its linear program, by least squares."""
    if component.forces == 0:
        return False
    _, left = nnls(component.wrenches.toarray(), component.wanted)
    return bool(left <= component.tolerance)


def table_under(
    lows: Float[np.ndarray, "part"], standing: float, up: Float[np.ndarray, "3"], gap: float
) -> tuple[Table, bool]:
    """Return the table on which a base stands, and whether it needs a fixture.

    It needs one where another part lies lower. Then the table is far below, as nothing else stands on it.

    Args:
        lows: Lowest point of each part along up [m].
        standing: The same of the base and what stands with it from the beginning [m].
        up: Unit.
        gap: How much lower another part may lie [m].
    """
    low = float(lows.min())
    in_fixture = low < standing - gap
    return Table(normal=up, offset=low - float(np.ptp(lows)) - gap if in_fixture else standing), in_fixture
