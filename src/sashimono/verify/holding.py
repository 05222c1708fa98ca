"""What falls or tips, though nobody holds it? The question put the other way round than a planner would.

A motion of the placed parts is looked for in which weights sink and no touching point resists: every force that a
touching point can exert (an edge of its friction cone) does no negative work. By duality there is such a motion exactly
if no forces balance. `sinking` asks it, and shows which parts go.

Weights are volumes: all parts are of one density. Walls that are nearly upright carry no weight by friction, for
nothing shows that they squeeze; unless two fastened parts clamp what is between them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import Fixture, Step, Table
from sashimono.verify.body import SampledBody
from sashimono.verify.bond import Bonds, is_around
from sashimono.verify.config import VerifyConfig
from sashimono.verify.overlap import sampled_depth
from sashimono.verify.sinking import Group, Push, Sinking
from sashimono.verify.structure import members
from sashimono.verify.turning import tables_of

_OPPOSING = -0.87
_FACING = -0.65
_INSET = 0.02
_FLAT = 0.9
"""Cosine between up and a normal from which on one part lies on the other."""
_BEHIND = 0.06
"""How far behind a part's surface its matter is looked for, over the gap at which parts touch."""
_JAM = 0.05
"""How much deeper a part gets that something leaning carries, over the gap at which parts touch."""
_SINKINGS = 6
"""Ways to let a part down, from that gap to where it would have closed, or to the smaller part's smallest extent."""


class _Contact(NamedTuple):
    """Points at which one part can push another, and the directions into the pushed one; world frame."""

    points: Float[np.ndarray, "point 3"]
    normals: Float[np.ndarray, "point 3"]


class PlacedParts:
    """Parts at their assembled poses: which touch, which are fastened, and which fall."""

    def __init__(
        self,
        bodies: Mapping[str, SampledBody],
        poses: Mapping[str, Float[np.ndarray, "4 4"]],
        config: VerifyConfig,
        screwed: Collection[frozenset[str]] = (),
        stated: Bonds | None = None,
    ) -> None:
        """Take in all parts.

        Args:
            bodies: By name.
            poses: Assembled.
            config: Options.
            screwed: Pairs that a declared thread fastens.
            stated: Pairs that the plan says are screwed together, or fit closely. They are fastened if they touch so.
        """
        self._bodies = bodies
        self._poses = poses
        self._config = config
        self._screwed = frozenset(screwed)
        self._stated = stated or {}
        self._bonded: dict[frozenset[str], bool] = {}
        self._contacts: dict[tuple[str, str], _Contact] = {}
        self._jamming: dict[tuple[str, str, bytes], bool] = {}
        self._depths: dict[frozenset[str], float] = {}
        self._boxes: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._skins: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._joined: dict[str, frozenset[str]] = {}
        self._neighbours: dict[str, frozenset[str]] = {}
        self._groups: dict[tuple[str, ...], Group] = {}
        self._pushes: dict[tuple[str, str | None, bool, bytes, float], Push] = {}
        self._sinking: dict[tuple[bytes, float], Sinking] = {}

    def hold_problems(
        self, steps: Sequence[Step], table: Table | None, fixture: Fixture | None
    ) -> list[tuple[str, ...]]:
        """Return for each of these steps, which follow one another, what nobody holds.

        The first ones are done on the given table. A fixture holds nothing any more once the product is turned over.
        Nothing is said of a step that does not say how many hands it takes.
        """
        fixed = () if fixture is None else fixture.parts
        problems = []
        before: tuple[str, ...] = ()
        for k, (step, on) in enumerate(zip(steps, tables_of(steps, table), strict=True)):
            # what is inserted at the same time is let go at the same time
            brought = [each for each in steps if each is step or each.part in step.simultaneous]
            placed = (*step.fixed, *(name for each in brought for name in members(each)))
            if step.table is not None:
                before, fixed = step.held_before, ()
            if on is None or step.hands is None:
                problems.append(())
                continue
            found = []
            if step.table is not None:
                loose = self.falling(step.fixed, before, on)
                found += [f"{name} floats or tips once it is turned over, and is not held" for name in loose]
            found += [f"{name!r} is held, but not in place" for name in step.held if name not in placed]
            at_rest = {each.part for each in steps if len(each.motion.T_world_part) == 1}
            found += [f"{name!r} is in the fixture, but brought later" for name in fixed if name not in at_rest]
            hands = max(len(before) + (len(step.motion.T_world_part) > 1) + len(step.simultaneous), len(step.held))
            if step.hands != hands:
                found.append(f"takes {hands} hands, not {step.hands}")
            falling = self.falling(placed, {*step.held, *fixed}, on)
            found += [f"{name} floats or tips, and is not held" for name in falling]
            problems.append(tuple(found))
            if not any(each.part in step.simultaneous for each in steps[k + 1 :]):
                before = step.held
        return problems

    def falling(self, placed: Sequence[str], held: Collection[str], table: Table) -> list[str]:
        """Return the parts that sink in the motion in which most weight sinks, if any does."""
        groups = self._fastened_groups(placed)
        loose = [group for group in groups if not set(group) & set(held)]
        if not loose:
            return []
        free = {name for group in loose for name in group}
        owner = {name: k for k, group in enumerate(groups) for name in group}
        clamping = self._clamping(groups)
        pushes = []
        before: set[str] = set()
        for first in placed:
            # in an order of their own, so that the same parts give the same program
            for second in (*sorted(self._near(first) & before), None):
                if (second is None or owner[first] != owner[second]) and not free.isdisjoint((first, second)):
                    clamped = second is not None and frozenset((owner[first], owner[second])) in clamping
                    pushes.append(self._push(first, second, table, clamped))
            before.add(first)
        key = (table.normal.tobytes(), table.offset)
        if key not in self._sinking:
            self._sinking[key] = Sinking(table.normal, self._config.hold_tolerance)
        sinking = self._sinking[key]([self._group(each) for each in loose], [p for p in pushes if len(p.points)])
        return [name for k, group in enumerate(loose) if sinking[k] for name in group]

    def _push(self, first: str, second: str | None, table: Table, clamped: bool) -> Push:
        key = (first, second, clamped, table.normal.tobytes(), table.offset)
        if key not in self._pushes:
            contact = self._on_table(first, table) if second is None else self._wedged(first, second, table.normal)
            forces = self._forces(contact, table.normal, clamped) if len(contact.points) else contact
            self._pushes[key] = Push(first, second, *forces)
        return self._pushes[key]

    def _forces(self, contact: _Contact, up: np.ndarray, clamped: bool) -> tuple[np.ndarray, np.ndarray]:
        """Points and edges of the friction cones about the normals, some of them level; on steep walls, only those."""
        points, normals = contact
        lean = normals @ up
        # what leans no more than corners are rounded by is no wedge
        level = normals - np.outer(lean, up)
        level /= np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 0.5)
        normals = np.where((np.abs(lean) < self._config.hold_upright)[:, None], level, normals)
        across = np.cross(normals, up)
        flat = np.linalg.norm(across, axis=1) < 1e-6
        across[flat] = np.cross(normals[flat], np.eye(3)[int(np.abs(up).argmin())])
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        steepest = np.cross(normals, across)
        angles = 2.0 * np.pi * np.arange(self._config.hold_edges) / self._config.hold_edges
        wall = (np.abs(normals @ up) < self._config.hold_steep) & (not clamped)
        around = [np.cos(angle) * across + np.sin(angle) * steepest for angle in angles]
        sidewards = [np.sign(np.cos(angle)) * across for angle in angles]
        forces = [
            normals + self._config.hold_friction * np.where(wall[:, None], sideways, full)
            for full, sideways in zip(around, sidewards, strict=True)
        ]
        return np.tile(points, (len(forces), 1)), np.concatenate(forces)

    def _fastened_groups(self, placed: Sequence[str]) -> list[tuple[str, ...]]:
        """Parts that are fastened to one another, directly or through others; in the order of placing."""
        order = {name: k for k, name in enumerate(placed)}
        groups: list[tuple[str, ...]] = []
        seen: set[str] = set()
        for name in placed:
            if name in seen:
                continue
            group, to_do = {name}, [name]
            while to_do:
                more = {other for other in self._fastened_to(to_do.pop()) if other in order} - group
                group |= more
                to_do += more
            seen |= group
            groups.append(tuple(sorted(group, key=order.__getitem__)))
        return groups

    def _fastened_to(self, name: str) -> frozenset[str]:
        """All parts that are fastened to one."""
        if name not in self._joined:
            others = (other for other in self._bodies if other != name)
            self._joined[name] = frozenset(other for other in others if self._fastened(name, other))
        return self._joined[name]

    def _near(self, name: str) -> frozenset[str]:
        """All parts whose boxes are near enough to one's for the two to push one another."""
        if name not in self._neighbours:
            others = (other for other in self._bodies if other != name)
            self._neighbours[name] = frozenset(
                other for other in others if self._boxes_meet(name, other, self._gap(name, other))
            )
        return self._neighbours[name]

    def _gap(self, first: str, second: str) -> float:
        """Gap up to which two parts count as touching [m]."""
        extents = self._bodies[first].smallest_extent, self._bodies[second].smallest_extent
        return self._config.hold_gap * min(extents)

    def _fastened(self, first: str, second: str) -> bool:
        key = frozenset((first, second))
        if key not in self._depths:
            T = se3.inverse(self._poses[second]) @ self._poses[first]
            a, b = self._bodies[first], self._bodies[second]
            meet = self._boxes_meet(first, second, 0.0)
            self._depths[key] = sampled_depth(a, b, T) / min(a.smallest_extent, b.smallest_extent) if meet else 0.0
        return key in self._screwed or self._depths[key] > self._config.hold_fastened or self._is_bonded(first, second)

    def _is_bonded(self, first: str, second: str) -> bool:
        """Whether the plan says that the two are screwed together, or fit closely, and they touch like that."""
        key = frozenset((first, second))
        if key not in self._stated:
            return False
        if key not in self._bonded:
            bond, config = self._stated[key], self._config
            least = min(self._bodies[name].smallest_extent for name in key)
            gap = least * (config.hold_fit_gap if bond.close else config.hold_gap)
            meetings = [self._meeting(first, second, gap), self._meeting(second, first, gap)]
            points, normals = (np.concatenate(each) for each in zip(*meetings, strict=True))
            self._bonded[key] = len(points) > 0 and is_around(points, normals, bond)
        return self._bonded[key]

    def _clamping(self, groups: Sequence[Sequence[str]]) -> set[frozenset[int]]:
        """Pairs of groups of which two parts of one, fastened to each other, push on the other from opposite sides."""
        found: set[frozenset[int]] = set()
        near = [frozenset[str]().union(*map(self._near, group)) for group in groups]
        for a, clamp in enumerate(groups):
            jaws = [pair for pair in combinations(clamp, 2) if pair[1] in self._fastened_to(pair[0])]
            for b, between in enumerate(groups) if jaws else ():
                if a != b and any(self._squeezes(pair, between) for pair in jaws if near[b].issuperset(pair)):
                    found.add(frozenset((a, b)))
        return found

    def _squeezes(self, jaws: tuple[str, str], between: Sequence[str]) -> bool:
        """Whether two parts push on what is between them from opposite sides."""
        one, other = (np.concatenate([self._contact(name, jaw).normals for name in between]) for jaw in jaws)
        return bool((one @ other.T < _OPPOSING).any())

    def _group(self, names: tuple[str, ...]) -> Group:
        if names not in self._groups:
            volumes, centers = [], []
            for name in names:
                volumes.append(self._bodies[name].volume)
                centers.append(se3.apply(self._poses[name], self._bodies[name].center_of_mass[None])[0])
            center = np.average(centers, axis=0, weights=volumes)
            far = [np.linalg.norm(self._vertices(name) - center, axis=1).max() for name in names]
            self._groups[names] = Group(names, float(sum(volumes)), center, float(max(far)))
        return self._groups[names]

    def _vertices(self, name: str) -> Float[np.ndarray, "vertex 3"]:
        return se3.apply(self._poses[name], self._bodies[name].vertices)

    def _boxes_meet(self, first: str, second: str, gap: float) -> bool:
        (low_a, high_a), (low_b, high_b) = self._box(first), self._box(second)
        return bool((low_a <= high_b + gap).all() and (low_b <= high_a + gap).all())

    def _box(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        if name not in self._boxes:
            points = self._vertices(name)
            self._boxes[name] = (points.min(axis=0), points.max(axis=0))
        return self._boxes[name]

    def _on_table(self, name: str, table: Table) -> _Contact:
        points = self._vertices(name)
        height = points @ table.normal - table.offset
        points = points[np.abs(height) <= self._config.hold_table_gap * self._bodies[name].smallest_extent]
        points = _far_apart(points, np.zeros_like(points), 2 * self._config.hold_points)[0]
        return _Contact(points, np.tile(table.normal, (len(points), 1)))

    def _contact(self, first: str, second: str) -> _Contact:
        """Where the second part can push the first."""
        if (first, second) not in self._contacts:
            gap = self._gap(first, second)
            points, normals = np.zeros((0, 3)), np.zeros((0, 3))
            if self._boxes_meet(first, second, gap):
                on_first, back = self._meeting(first, second, gap)
                on_second, into_second = self._meeting(second, first, gap)
                points = np.concatenate([on_first, on_second])
                normals = np.concatenate([back, -into_second])
                points, normals = _far_apart(points, normals, self._config.hold_points)
            self._contacts[first, second] = _Contact(points, normals)
            self._contacts[second, first] = _Contact(points, -normals)
        return self._contacts[first, second]

    def _wedged(self, first: str, second: str, up: np.ndarray) -> _Contact:
        """Where the second part can push the first; what leans, and lets the upper part sink past, pushes level."""
        points, normals = self._contact(first, second)
        lean = normals @ up
        for upper, lower, side in ((first, second, lean), (second, first, -lean)):
            leaning = (side > self._config.hold_upright) & (side < _FLAT)
            if (
                leaning.any()
                and not (side >= _FLAT).any()
                and not self._jams(upper, lower, up, float(side[leaning].min()))
            ):
                level = normals - np.outer(lean, up)
                level /= np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
                normals = np.where(leaning[:, None], level, normals)
        return _Contact(points, normals)

    def _jams(self, upper: str, lower: str, up: np.ndarray, lean: float) -> bool:
        """Whether the upper of two parts, let down until all that leans has met, is deeper in the lower than before."""
        key = (upper, lower, up.tobytes())
        if key not in self._jamming:
            a, b = self._bodies[upper], self._bodies[lower]
            gap = self._gap(upper, lower)
            T = se3.inverse(self._poses[lower])
            deep = sampled_depth(a, b, T @ self._poses[upper]) + _JAM * gap
            sunk = self._poses[upper].copy()
            self._jamming[key] = False
            for way in np.geomspace(
                gap, max(gap, min(1.5 * gap / lean, a.smallest_extent, b.smallest_extent)), _SINKINGS
            ):
                sunk[:3, 3] = self._poses[upper][:3, 3] - way * up
                if sampled_depth(a, b, T @ sunk) > deep:
                    self._jamming[key] = True
                    break
        return self._jamming[key]

    def _meeting(self, name: str, other: str, gap: float) -> tuple[np.ndarray, np.ndarray]:
        """Points of one part's surface on the other's, and the other's outward normals there, in the world."""
        points, normals = self._skin(name)
        target, T = self._bodies[other], self._poses[other]
        seen = se3.apply(se3.inverse(T), points)
        near = target.box_distance(seen) <= gap
        points, normals, seen = points[near], normals[near], seen[near]
        if not len(points):
            return points, normals
        away = target.distance(seen)
        meet = np.abs(away) <= gap
        points, normals, seen, away = points[meet], normals[meet], seen[meet], away[meet]
        if not len(points):
            return points, normals
        outward = target.nearest_normal(seen) @ T[:3, :3].T
        against = -(outward * normals).sum(axis=1)
        facing = against > -_FACING
        points, normals, seen, away = points[facing], normals[facing], seen[facing], away[facing]
        # where only edges meet, the other's matter does not lie behind its surface, seen along the part's own normal
        way = np.maximum(away, 0.0) / against[facing] + _BEHIND * gap
        behind = target.distance(seen + way[:, None] * (normals @ T[:3, :3]))
        solid = behind < np.minimum(away, 0.0) - 0.2 * _BEHIND * gap
        return points[solid], outward[facing][solid]

    def _skin(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Points of a part's faces with the faces' normals, in the world: near their corners, and between."""
        if name not in self._skins:
            body, T = self._bodies[name], self._poses[name]
            triangles = body.vertices[body.faces]
            normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
            lengths = np.linalg.norm(normals, axis=1)
            triangles, normals = triangles[lengths > 0.0], normals[lengths > 0.0] / lengths[lengths > 0.0, None]
            middles = triangles.mean(axis=1, keepdims=True)
            corners = (1.0 - _INSET) * triangles + _INSET * middles
            points = np.concatenate([corners, middles], axis=1).reshape(-1, 3)
            between = body.tree.centers[body.tree.between]
            points = np.concatenate([points, between])
            normals = np.concatenate([np.repeat(normals, 4, axis=0), body.nearest_normal(between)])
            self._skins[name] = (se3.apply(T, points), normals @ T[:3, :3].T)
        return self._skins[name]


def _far_apart(points: np.ndarray, normals: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """At most so many of the points: the outermost along directions spread over the sphere, each of its normal's kind.

    The outermost bound what a force anywhere between them can do.
    """
    if len(points) <= count:
        return points, normals
    kinds = np.unique(np.round(normals), axis=0, return_inverse=True)[1].reshape(-1)
    directions = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    chosen: list[int] = []
    for direction in directions:
        for kind in range(int(kinds.max()) + 1):
            rows = np.nonzero(kinds == kind)[0]
            chosen.append(int(rows[(points[rows] @ direction).argmax()]))
    kept = sorted(set(chosen))
    return points[kept], normals[kept]
