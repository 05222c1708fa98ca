"""Static equilibrium of placed parts as a linear program.

Unknown are the forces at the touching points, each in a friction cone linearised by four edges, two of them level and
two along the steepest line. They only push. They must balance the weight of every rigid group: parts that are fastened
to one another. Density and gravity cancel, so that weights are volumes.

Forces that balance one another (a squeeze) are no answer to gravity: a peg pushed up into a hole that fits it exactly
would hang there by a squeeze that nothing causes. So the friction of steep walls has no part along the steepest line,
unless two fastened parts clamp what lies between them.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import Table
from sashimono.stability.component import Block, Component, Group, Wrenches
from sashimono.stability.touching import Touch, Touching


class Statics:
    """The balance of sets of placed parts on one table."""

    def __init__(self, touching: Touching, table: Table) -> None:
        """Take in the touching points of all parts, and the table."""
        self.touching = touching
        self.table = table
        self.config = touching.config
        self.fewest: dict[tuple[object, ...], tuple[tuple[int, ...], bool]] = {}
        """What `fewest_held` found of sets of groups, by all that it depends on."""
        self._alone: dict[tuple[Group, bytes], bool] = {}
        self._balanced: dict[tuple[Group, ...], np.ndarray] = {}
        self._pushes: dict[tuple[Group, Group], tuple[Wrenches, Wrenches] | None] = {}
        self._carries: dict[Group, Wrenches] = {}
        self._masses: dict[Group, tuple[float, Float[np.ndarray, "3"], float]] = {}

    def components(self, placed: Sequence[str], fixed: Collection[str] = ()) -> list[Component]:
        """Return the free groups of these placed parts, by what hangs together; ``fixed`` is in the fixture."""
        groups = self._groups(placed)
        free = {k for k, group in enumerate(groups) if not set(group) & set(fixed)}
        pushes = {}
        roots = _Roots(len(groups))
        owner = {name: k for k, group in enumerate(groups) for name in group}
        for i, group in enumerate(groups):
            around = {owner[other] for name in group for other in self.touching.around(name) if other in owner}
            for j in sorted(k for k in around if k > i):
                # what two fixed groups do to one another concerns nobody
                if (i in free or j in free) and (push := self._push(group, groups[j])) is not None:
                    pushes[i, j] = push
                    if i in free and j in free:
                        roots.join(i, j)
        together: dict[int, list[int]] = {}
        for k in sorted(free):
            together.setdefault(roots.find(k), []).append(k)
        return [self._component(groups, members, pushes) for members in together.values()]

    def _groups(self, placed: Sequence[str]) -> list[Group]:
        """Rigid groups: parts that are fastened to one another, in the order of placing."""
        roots = _Roots(len(placed))
        place = {name: k for k, name in enumerate(placed)}
        for i, name in enumerate(placed):
            for other in self.touching.joined(name):
                if other in place:
                    roots.join(i, place[other])
        groups: dict[int, list[str]] = {}
        for k, name in enumerate(placed):
            groups.setdefault(roots.find(k), []).append(name)
        return [tuple(group) for group in groups.values()]

    def _push(self, first: Group, second: Group) -> tuple[Wrenches, Wrenches] | None:
        """What each unit force between two groups does to the first, and to the second; None if they do not touch."""
        if (first, second) not in self._pushes:
            pairs = [(m, n) for m in range(len(first)) for n in range(len(second))]
            touching = [self.touching.carrying(first[m], second[n], self.table.normal) for m, n in pairs]
            points = np.concatenate([touch.points for touch in touching])
            normals = np.concatenate([touch.normals for touch in touching])
            owners = np.repeat(np.array(pairs), [len(touch.points) for touch in touching], axis=0)
            push = None
            if len(points):
                sides = zip(owners.T, (first, second), strict=True)
                clamped = any(self._clamps(normals, owner, group) for owner, group in sides)
                points, forces = self._edges(Touch(points, normals), clamped)
                push = (self._wrenches(first, points, forces), self._wrenches(second, points, -forces))
            self._pushes[first, second] = push
        return self._pushes[first, second]

    def _carry(self, group: Group) -> Wrenches:
        """What each unit force of the table does to a group."""
        if group not in self._carries:
            touching = [self.touching.on_table(name, self.table) for name in group]
            edges = [self._edges(touch, False) for touch in touching if len(touch.points)]
            wrenches = [self._wrenches(group, points, forces) for points, forces in edges]
            self._carries[group] = np.concatenate([np.zeros((6, 0)), *wrenches], axis=1)
        return self._carries[group]

    def _wrenches(self, group: Group, points: np.ndarray, forces: np.ndarray) -> Wrenches:
        _, center, radius = self._mass(group)
        return np.concatenate([forces, np.cross((points - center) / radius, forces)], axis=1).T

    def _clamps(self, normals: np.ndarray, owners: np.ndarray, group: Group) -> bool:
        """Whether two parts of a group, fastened to each other, push from both sides of what is between them.

        Two walls of a frame do not: they are joined by a third part, and nothing draws them together.
        """
        if len(group) == 1:
            return False
        opposing = normals @ normals.T < -self.config.opposing
        jaws = np.unique(np.stack([owners[each] for each in np.nonzero(opposing)], axis=1), axis=0)
        return any(m != n and self.touching.fastened(group[m], group[n]) for m, n in jaws)

    def _component(
        self,
        groups: Sequence[Group],
        members: Sequence[int],
        pushes: dict[tuple[int, int], tuple[Wrenches, Wrenches]],
    ) -> Component:
        row = {group: k for k, group in enumerate(members)}
        weights = np.array([self._mass(groups[k])[0] for k in members])
        weights = np.maximum(weights, self.config.least_weight * weights.max())
        blocks = []
        for ends, push in pushes.items():
            sides = [(row[k], own) for k, own in zip(ends, push, strict=True) if k in row]
            if sides:
                unit = float(min(weights[k] for k, _ in sides))
                key = tuple(groups[k] for k in ends)
                scaled = tuple(own * (unit / weights[k]) for k, own in sides)
                blocks.append(Block(key, tuple(k for k, _ in sides), scaled, unit))
        for k in members:
            if (carry := self._carry(groups[k])).shape[1]:
                blocks.append(Block((groups[k],), (row[k],), (carry,), float(weights[row[k]])))
        return Component(
            groups=tuple(groups[k] for k in members),
            blocks=tuple(blocks),
            wanted=np.tile(np.concatenate([self.table.normal, np.zeros(3)]), len(members)),
            tolerance=self.config.tolerance,
            alone=self._alone,
            balanced=self._balanced,
        )

    def _mass(self, group: Group) -> tuple[float, Float[np.ndarray, "3"], float]:
        """Volume [m³], centre of mass in the world and radius about it [m] of a rigid group."""
        if group not in self._masses:
            bodies, poses = self.touching.bodies, self.touching.poses
            volumes = np.array([bodies[name].mass_properties.volume for name in group])
            centers = np.array([se3.apply(poses[name], bodies[name].mass_center[None])[0] for name in group])
            center = (volumes[:, None] * centers).sum(axis=0) / volumes.sum()
            reach = [np.linalg.norm(bodies[n].center_world(poses[n]) - center) + bodies[n].radius for n in group]
            self._masses[group] = float(volumes.sum()), center, float(max(reach))
        return self._masses[group]

    def _edges(self, touch: Touch, clamped: bool) -> tuple[np.ndarray, np.ndarray]:
        """Edges of the friction cones: the point and the force of each."""
        up, friction = self.table.normal, self.config.friction
        normals = _upright(touch.normals, up, self.config.upright)
        level = np.cross(up, normals)
        sizes = np.linalg.norm(level, axis=1, keepdims=True)
        any_level = np.eye(3)[int(np.argmin(np.abs(up)))]
        any_level = any_level - (any_level @ up) * up
        level = np.where(sizes > 1e-6, level / np.maximum(sizes, 1e-30), any_level / np.linalg.norm(any_level))
        steepest = np.cross(normals, level)
        weightless = (np.abs(normals @ up) < self.config.steep) & (not clamped)
        along = np.where(weightless[:, None], 0.0, steepest)
        forces = [normals + friction * t for t in (level, -level, along, -along)]
        return np.tile(touch.points, (4, 1)), np.concatenate(forces)


def _upright(normals: np.ndarray, up: np.ndarray, within: float) -> np.ndarray:
    """The normals, those of walls that are upright but for the rounding of their corners turned level.

    Between two walls that lean by a thousandth towards each other a part would hang in a squeeze of a thousand weights.
    """
    along = normals @ up
    wall = (np.abs(along) < within)[:, None]
    turned = normals - along[:, None] * up
    return np.where(wall, turned / np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 0.5), normals)


class _Roots:
    """Sets that are joined: each has the least of its members as its root."""

    def __init__(self, count: int) -> None:
        self._above = list(range(count))

    def find(self, k: int) -> int:
        while self._above[k] != k:
            k = self._above[k]
        return k

    def join(self, i: int, j: int) -> None:
        low, high = sorted((self.find(i), self.find(j)))
        self._above[high] = low
