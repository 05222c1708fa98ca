"""Do weights sink though touching points push back? A motion in which they do, or forces that rule it out.

No touching force may work against the motion: forces along the edges of friction cones. By duality there is such a
motion exactly if no forces balance the weights. So forces that balance them show that nothing sinks, wherever they come
from: they only have to be added up. A plan places one part at a time. What the forces of the last set leave over is
then the weight of the new part, and new forces among the few groups that carry it do the rest. Where that fails, the
linear program of all groups is solved.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import linprog
from scipy.sparse import csr_array, vstack

_LEAST_WEIGHT = 1e-4
"""No group counts as lighter than that share of the heaviest."""
_FIRST_FORCES = 400
"""Forces that the linear program begins with, beside those of the last set."""
_MORE_FORCES = 200
"""Most forces that join it at a time: those that the motion works against most."""
_ALLOWED = 1e-7
"""Work against a force that counts as none; as HiGHS has it."""
_ENOUGH = 0.01
"""Forces are looked for until that share of the tolerance is left over, or nothing more can be done."""
_CARRYING = 1e-9
"""Share of a group's weight from which on a push carries it."""
_UNBALANCED = 1e-6
"""By what share of its weight more than in the last set is left over of a group, for new forces to be looked for."""


class Group(NamedTuple):
    """Parts that move as one."""

    names: tuple[str, ...]
    volume: float
    """Its weight: all parts are of one density [m³]."""
    center: Float[np.ndarray, "3"]
    """Centre of mass in the world [m]."""
    radius: float
    """Torques count over this distance [m]."""


class Push(NamedTuple):
    """Forces that two parts, or a part and the table, can exert on each other."""

    on: str
    by: str | None
    """None: the table."""
    points: Float[np.ndarray, "force 3"]
    """Where they act in the world [m]."""
    forces: Float[np.ndarray, "force 3"]
    """On the first; the second gets the opposite."""


class _Load(NamedTuple):
    """How strong the forces of a push are, and what they do to the groups on both sides."""

    push: Push
    sides: tuple[Group | None, Group | None]
    strengths: Float[np.ndarray, "force"]
    wrenches: Float[np.ndarray, "2 6"]


class _Answer(NamedTuple):
    """What the linear program of some groups says: how they move, and the forces that resist most."""

    motion: Float[np.ndarray, "group 6"] | None
    """None if the solver gave up."""
    sinks: float
    """What sinks in sum."""
    loads: dict[int, _Load]
    """By push."""


class Sinking:
    """Tells of one set of placed parts after another, on one table, which groups sink."""

    def __init__(self, up: Float[np.ndarray, "3"], tolerance: float) -> None:
        """Take the way up, and how much may sink in sum: groups count alike, and none is faster than 1."""
        self._down = np.concatenate([-up, np.zeros(3)])
        self._tolerance = tolerance
        self._loads: dict[tuple[str, str | None], _Load] = {}
        self._left: dict[tuple[str, ...], float] = {}

    def __call__(self, groups: Sequence[Group], pushes: Sequence[Push]) -> Bool[np.ndarray, "group"]:
        """Return which groups sink in the motion in which most weight sinks. Parts that are in no group stay."""
        if not pushes:
            return np.ones(len(groups), dtype=bool)
        scene = _Scene(groups, pushes, self._down)
        loads = [self._as_before(push, sides) for push, sides in zip(pushes, scene.sides, strict=True)]
        left = scene.left_over(loads)
        if left.sum() > self._tolerance:
            changed = [k for k, group in enumerate(groups) if left[k] > self._left.get(group.names, 0.0) + _UNBALANCED]
            carrying = scene.load_path(changed, loads)
            if len(carrying) < len(groups):
                local = scene.solve(carrying, loads, self._tolerance)
                loads = [local.loads.get(k, load) for k, load in enumerate(loads)]
                left = scene.left_over(loads)
        if left.sum() > self._tolerance:
            answer = scene.solve(range(len(groups)), loads, self._tolerance)
            if answer.motion is None:  # nothing is shown to stand
                return np.ones(len(groups), dtype=bool)
            if answer.sinks > self._tolerance:
                falls = answer.motion @ self._down
                return falls >= min(float(falls.max()), self._tolerance)
            loads = [answer.loads.get(k, load) for k, load in enumerate(loads)]
            left = scene.left_over(loads)
        self._loads = {(load.push.on, load.push.by): load for load in loads}
        self._left = {group.names: float(each) for group, each in zip(groups, left, strict=True)}
        return np.zeros(len(groups), dtype=bool)

    def _as_before(self, push: Push, sides: tuple[Group | None, Group | None]) -> _Load:
        """The push as strong as in the last set; without strength if it was not there."""
        before = self._loads.get((push.on, push.by))
        if before is None or before.push is not push:
            return _load(push, sides, np.zeros(len(push.points)))
        same = all(now is then for now, then in zip(sides, before.sides, strict=True))
        return before if same else _load(push, sides, before.strengths)


class _Scene:
    """One set of groups, and what pushes them."""

    def __init__(self, groups: Sequence[Group], pushes: Sequence[Push], down: np.ndarray) -> None:
        self._groups = groups
        self._pushes = pushes
        self._down = down
        heaviest = max(group.volume for group in groups)
        self._weights = np.array([max(group.volume, _LEAST_WEIGHT * heaviest) for group in groups])
        place = {name: k for k, group in enumerate(groups) for name in group.names}
        owners = [(place.get(push.on, -1), -1 if push.by is None else place.get(push.by, -1)) for push in pushes]
        self._sides: Int[np.ndarray, "push 2"] = np.array(owners)
        self.sides = [(None if i < 0 else groups[i], None if j < 0 else groups[j]) for i, j in owners]
        """The groups on both sides of each push; None for what does not move."""

    def left_over(self, loads: Sequence[_Load]) -> Float[np.ndarray, "group"]:
        """Return how much of each group's weight these forces leave unbalanced, wrenches in sum, over the weight.

        In no motion does more sink than is left of all groups together, for no speed is above 1.
        """
        return np.abs(self._unbalanced(loads, range(len(loads)))).sum(axis=1)

    def _unbalanced(self, loads: Sequence[_Load], some: Collection[int]) -> Float[np.ndarray, "group 6"]:
        """What weight and some of the loads do to each group, over its weight."""
        total = self._weights[:, None] * self._down
        chosen = list(some)
        if chosen:
            wrenches = np.stack([loads[k].wrenches for k in chosen])
            for side in (0, 1):
                rows = self._sides[chosen, side]
                np.add.at(total, rows[rows >= 0], wrenches[rows >= 0, side])
        return total / self._weights[:, None]

    def load_path(self, changed: Sequence[int], loads: Sequence[_Load]) -> list[int]:
        """Return these groups, what they touch, and all that carries those."""
        touching: dict[int, list[int]] = {k: [] for k in range(len(self._groups))}
        carriers: dict[int, list[int]] = {k: [] for k in range(len(self._groups))}
        for (i, j), load in zip(self._sides.tolist(), loads, strict=True):
            if i < 0 or j < 0:
                continue
            for side, (upper, lower) in enumerate(((i, j), (j, i))):
                touching[upper].append(lower)
                if -(load.wrenches[side] @ self._down) > _CARRYING * self._weights[upper]:
                    carriers[upper].append(lower)
        found = {*changed, *(other for k in changed for other in touching[k])}
        to_do = list(found)
        while to_do:
            for lower in carriers[to_do.pop()]:
                if lower not in found:
                    found.add(lower)
                    to_do.append(lower)
        return sorted(found)

    def solve(self, some: Sequence[int], loads: Sequence[_Load], tolerance: float) -> _Answer:
        """Maximise what sinks of some groups while the others neither move nor push differently."""
        place = {group: k for k, group in enumerate(some)}
        inside = np.isin(self._sides, list(some))
        within = np.flatnonzero(inside.any(axis=1) & (inside | (self._sides < 0)).all(axis=1)).tolist()
        others = sorted(set(range(len(loads))) - set(within))
        gain = self._unbalanced(loads, others)[list(some)].reshape(-1)
        if not within:
            return _Answer(np.sign(gain).reshape(-1, 6), float(np.abs(gain).sum()), {})
        units = np.array([self._weights[[s for s in self._sides[k] if s >= 0]].min() for k in within])
        work = [self._work(k, unit, place) for k, unit in zip(within, units, strict=True)]
        resisted = -vstack(work, format="csr")
        # few forces decide: those that the motion allowed by the others works against join them, until there is none
        used = np.concatenate([loads[k].strengths > 0.0 for k in within])
        used[:: max(1, len(used) // _FIRST_FORCES)] = True
        while True:
            chosen = np.flatnonzero(used)
            answer = linprog(
                -gain, A_ub=resisted[chosen], b_ub=np.zeros(len(chosen)), bounds=(-1.0, 1.0), method="highs"
            )
            if answer.x is None:  # HiGHS gave up
                return _Answer(None, np.inf, {})
            against = np.where(used, 0.0, resisted @ answer.x)
            worst = np.argsort(-against, kind="stable")[:_MORE_FORCES]
            worst = worst[against[worst] > _ALLOWED]
            if -answer.fun <= tolerance * _ENOUGH or not len(worst):
                break
            used[worst] = True
        strengths = np.zeros(len(used))
        strengths[chosen] = np.maximum(-answer.ineqlin.marginals, 0.0)
        ends = np.cumsum([len(self._pushes[k].points) for k in within])[:-1]
        found = {
            k: _load(self._pushes[k], self.sides[k], unit * own)
            for k, unit, own in zip(within, units, np.split(strengths, ends), strict=True)
        }
        return _Answer(answer.x.reshape(-1, 6), float(-answer.fun), found)

    def _work(self, k: int, unit: float, place: Mapping[int, int]) -> csr_array:
        """Work of the forces of a push, one a row, per unit of motion of each of some groups.

        Forces are in units of the lighter side's weight, and motions count in units in which all weigh the same.
        """
        push = self._pushes[k]
        values, columns = [], []
        for i, sign in zip(self._sides[k].tolist(), (1.0, -1.0), strict=True):
            if i in place:
                values.append(sign * unit / self._weights[i] * _wrenches(push, self._groups[i]))
                columns.append(6 * place[i] + np.arange(6))
        wide = 6 * len(columns)
        places = np.tile(np.concatenate(columns), len(push.points))
        entries = (np.concatenate(values, axis=1).ravel(), places, wide * np.arange(len(push.points) + 1))
        return csr_array(entries, shape=(len(push.points), 6 * len(place)))


def _load(push: Push, sides: tuple[Group | None, Group | None], strengths: np.ndarray) -> _Load:
    wrenches = np.zeros((2, 6))
    some = np.flatnonzero(strengths)
    if len(some):
        acting = Push(push.on, push.by, push.points[some], push.forces[some])
        for side, (group, sign) in enumerate(zip(sides, (1.0, -1.0), strict=True)):
            if group is not None:
                wrenches[side] = sign * strengths[some] @ _wrenches(acting, group)
    return _Load(push, sides, strengths, wrenches)


def _wrenches(push: Push, group: Group) -> Float[np.ndarray, "force 6"]:
    """Force, and torque about the group's centre of mass over its radius, of each force of a push."""
    return np.concatenate([push.forces, np.cross(push.points - group.center, push.forces) / group.radius], axis=1)
