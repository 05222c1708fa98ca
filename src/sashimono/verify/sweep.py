"""Does anything dip too deep along a path? Branch and bound over surface patches and time.

The signed distance s of a moving point changes by no more than the point travels. Looking at one ball of surface
(radius r) in the middle of a stretch of time, with travel t to either end, none of it is ever deeper than ``limit``
if ``s >= r + t - limit``. What that does not settle is cut up, in space or in time, down to single surface samples.
So nothing is jumped between poses, however thin; between samples, the spacing is what limits the check.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int
from numba import njit

from sashimono.geometry import se3
from sashimono.verify.body import BallTree, counted
from sashimono.verify.helices import Helices, find_helices
from sashimono.verify.helix_sweep import sweep_helices
from sashimono.verify.target import Target, signed_distance

Ease = Callable[[Int[np.ndarray, "n"], Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]], Float[np.ndarray, "n"]]
"""Given the balls' nodes, their centres in the target's frame and their signed distances: the distances that count.
These, too, must not change by more than a point travels."""

_CHUNK = 40_000
_MAX_PIECES = 16
_NO_ROTATION = 1e-8


@dataclass(frozen=True, kw_only=True, eq=False)
class Screws:
    """A path of geodesics seen from a frame: ``after @ screw(u) @ before``, one row a stretch."""

    before: Float[np.ndarray, "stretch 4 4"]
    after: Float[np.ndarray, "stretch 4 4"]
    axis: Float[np.ndarray, "stretch 3"]
    point: Float[np.ndarray, "stretch 3"]
    angle: Float[np.ndarray, "stretch"]
    shift: Float[np.ndarray, "stretch 3"]

    @classmethod
    def between(cls, poses: Float[np.ndarray, "pose 4 4"]) -> Screws:
        """Return the geodesics through the poses, mapping body points to the world; a single pose stands still."""
        starts = poses[:-1] if len(poses) > 1 else poses
        twists = np.array([se3.log(se3.inverse(a) @ b) for a, b in pairwise(poses)])
        twists = twists.reshape(-1, 6) if len(poses) > 1 else np.zeros((1, 6))
        v, w = twists[:, :3], twists[:, 3:]
        angle = np.linalg.norm(w, axis=1)
        turns = angle > _NO_ROTATION
        safe = np.where(turns, angle, 1.0)
        axis = np.where(turns[:, None], w / safe[:, None], [0.0, 0.0, 1.0])
        point = np.where(turns[:, None], np.cross(axis, v) / safe[:, None], 0.0)
        along = np.einsum("ij,ij->i", axis, v)[:, None] * axis
        return cls(
            before=np.broadcast_to(np.eye(4), starts.shape),
            after=starts,
            axis=axis,
            point=point,
            angle=np.where(turns, angle, 0.0),
            shift=np.where(turns[:, None], along, v),
        )

    def seen_from(self, T_world_fixed: Float[np.ndarray, "4 4"]) -> Screws:
        """Return the path of the moving body's points in the frame of a fixed body."""
        return replace(self, after=se3.inverse(T_world_fixed) @ self.after)

    def reversed_for(self, T_world_fixed: Float[np.ndarray, "4 4"]) -> Screws:
        """Return the path of a fixed body's points in the moving body's frame."""
        before = np.array([se3.inverse(T) @ T_world_fixed for T in self.after])
        after = np.broadcast_to(np.eye(4), before.shape)
        return Screws(
            before=before, after=after, axis=self.axis, point=self.point, angle=-self.angle, shift=-self.shift
        )

    def until(self, time: float) -> Screws:
        """Return the path from its start to this time, in stretches."""
        whole = min(int(time), len(self.angle) - 1)
        rows = {entry.name: np.array(getattr(self, entry.name)[: whole + 1]) for entry in fields(self)}
        rows["angle"][whole] *= time - whole
        rows["shift"][whole] *= time - whole
        return Screws(**rows)

    def since(self, stretch: int) -> Screws:
        """Return the path from the beginning of this stretch on."""
        return Screws(**{entry.name: getattr(self, entry.name)[stretch:] for entry in fields(self)})

    def pose_at(self, time: float) -> Float[np.ndarray, "4 4"]:
        """Return the pose at this time, in stretches."""
        stretch = min(int(time), len(self.angle) - 1)
        return self.pose(stretch, time - stretch)

    def pose(self, stretch: int, u: float) -> Float[np.ndarray, "4 4"]:
        """Return the pose at u in [0, 1] of a stretch."""
        corners = np.vstack([np.zeros(3), np.eye(3)])
        moved, _ = self.locate(corners, np.zeros(4), np.full(4, stretch), np.full(4, u))
        return se3.make((moved[1:] - moved[0]).T, moved[0])

    def helices(self, size: float) -> Helices | None:
        """Return the threads that the path follows, in the target's frame; None if it follows none.

        Args:
            size: Of what moves [m].
        """
        rotation = self.after[:, :3, :3]
        axis = np.einsum("nij,nj->ni", rotation, self.axis)
        point = np.einsum("nij,nj->ni", rotation, self.point) + self.after[:, :3, 3]
        return find_helices(axis, point, self.angle, np.einsum("nij,nj->ni", rotation, self.shift), size)

    def swept_boxes(
        self, center: Float[np.ndarray, "3"], radius: float
    ) -> tuple[Float[np.ndarray, "stretch 3"], Float[np.ndarray, "stretch 3"]]:
        """Return least and greatest corner of a box that a ball of the moving body does not leave, by stretch [m].

        An arc of angle a about an axis at distance r leaves its chord by no more than r (1 - cos(a / 2)).
        """
        count = len(self.angle)
        points, every = np.tile(center, (count, 1)), np.arange(count)
        starts, _ = self.locate(points, np.zeros(count), every, np.zeros(count))
        ends, _ = self.locate(points, np.zeros(count), every, np.ones(count))
        about = np.einsum("nij,nj->ni", self.before[:, :3, :3], points) + self.before[:, :3, 3] - self.point
        lever = np.linalg.norm(np.cross(self.axis, about), axis=1)
        bulge = lever * (1.0 - np.cos(0.5 * np.minimum(np.abs(self.angle), 2.0 * np.pi)))
        room = (radius + bulge)[:, None]
        return np.minimum(starts, ends) - room, np.maximum(starts, ends) + room

    def locate(
        self,
        points: Float[np.ndarray, "n 3"],
        radii: Float[np.ndarray, "n"],
        stretch: Int[np.ndarray, "n"],
        u: Float[np.ndarray, "n"],
    ) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
        """Return where each point is, and how fast the ball around it moves at most [m per unit of u]."""
        return _locate(points, radii, np.arange(len(points)), stretch, u, *self._arrays)

    def locate_balls(self, tree: BallTree, items: _Items) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n"]]:
        """Return the same for balls of a tree."""
        return _locate(tree.centers, tree.radii, items.node, items.stretch, items.u, *self._arrays)

    @cached_property
    def _arrays(self) -> tuple[np.ndarray, ...]:
        every = (self.before, self.after, self.axis, self.point, self.angle, self.shift)
        return tuple(np.ascontiguousarray(values) for values in every)


@njit(cache=True, nogil=True)
def _locate(points, radii, index, stretch, u, before, after, axis, point, angle, shift):  # pragma: no cover - compiled
    """What `Screws.locate` returns of the points at an index.

    Rodrigues as a displacement, so that a far axis (a slight turn over a long way) loses no digits.
    """
    moved, speed = np.empty((len(index), 3)), np.empty(len(index))
    for k in range(len(index)):
        i, j = index[k], stretch[k]
        T, a, c, d = before[j], axis[j], point[j], shift[j]
        x = T[0, 0] * points[i, 0] + T[0, 1] * points[i, 1] + T[0, 2] * points[i, 2] + T[0, 3]
        y = T[1, 0] * points[i, 0] + T[1, 1] * points[i, 1] + T[1, 2] * points[i, 2] + T[1, 3]
        z = T[2, 0] * points[i, 0] + T[2, 1] * points[i, 1] + T[2, 2] * points[i, 2] + T[2, 3]
        squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
        if angle[j] != 0.0:
            rx, ry, rz = x - c[0], y - c[1], z - c[2]
            ox, oy, oz = a[1] * rz - a[2] * ry, a[2] * rx - a[0] * rz, a[0] * ry - a[1] * rx
            half = 0.5 * u[k] * angle[j]
            sine, versine = np.sin(2.0 * half), 2.0 * np.sin(half) ** 2
            x += sine * ox + versine * (a[1] * oz - a[2] * oy)
            y += sine * oy + versine * (a[2] * ox - a[0] * oz)
            z += sine * oz + versine * (a[0] * oy - a[1] * ox)
            squared += (angle[j] * (np.sqrt(ox * ox + oy * oy + oz * oz) + radii[i])) ** 2
        x += u[k] * d[0]
        y += u[k] * d[1]
        z += u[k] * d[2]
        T = after[j]
        moved[k, 0] = T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3]
        moved[k, 1] = T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3]
        moved[k, 2] = T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3]
        speed[k] = np.sqrt(squared)
    return moved, speed


@dataclass(frozen=True, kw_only=True, eq=False)
class Sweep:
    """What a sweep found."""

    holds: bool
    """No sample goes deeper than the limit, at any time."""
    exhausted: bool
    """It does not hold only because the queries ran out."""
    depth: float
    """Deepest sample looked at [m], negative if all stayed outside; what an excuse took off is in it."""
    at: float
    """Where on the path, in stretches."""
    queries: int
    near: Float[np.ndarray, "time"]
    """Times at which a stretch of surface between samples could not be cleared, in stretches; sorted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Items:
    """Balls in stretches of time: from ``u - half`` to ``u + half``."""

    node: np.ndarray
    stretch: np.ndarray
    u: np.ndarray
    half: np.ndarray

    def take(self, index: np.ndarray) -> _Items:
        return _Items(node=self.node[index], stretch=self.stretch[index], u=self.u[index], half=self.half[index])

    def in_space(self, tree: BallTree) -> _Items:
        rows, within = counted(tree.child_count[self.node])
        child = tree.first_child[self.node[rows]] + within
        return _Items(node=child, stretch=self.stretch[rows], u=self.u[rows], half=self.half[rows])

    def in_time(self, pieces: np.ndarray) -> _Items:
        rows, within = counted(pieces)
        half = self.half[rows] / pieces[rows]
        u = self.u[rows] - self.half[rows] + (2 * within + 1) * half
        return _Items(node=self.node[rows], stretch=self.stretch[rows], u=u, half=half)


def sweep(
    tree: BallTree,
    target: Target,
    path: Screws,
    *,
    limit: float,
    resolution: float,
    coarse: float,
    max_queries: int,
    ease: Ease | None = None,
) -> Sweep:
    """Return whether the samples of a tree stay less than ``limit`` deep in the target all along the path.

    With ``ease``, what counts are the distances that it returns. Stops at the first look that finds a deeper one.
    ``resolution`` is the travel [m] to either side below which a vertex that is within the limit is not looked at
    again. Samples between vertices stand for the surface around them anyway: for these it is half of their ball's
    radius, at most ``coarse`` [m], a fraction of the thinner wall.
    """
    stretches = np.arange(len(path.angle))
    still = not (path.angle.any() or path.shift.any())
    start = np.full(len(stretches), 0.0 if still else 0.5)
    whole = _Items(node=np.full(len(stretches), tree.root), stretch=stretches, u=start, half=start.copy())
    search = _Search(tree, target, path, limit, (resolution, coarse), max_queries, ease)
    helices = path.helices(2.0 * float(tree.radii[tree.root])) if ease is None else None
    if helices is None:
        return search.run([whole])
    found = search.run([whole.take(np.flatnonzero(helices.run < 0))])
    leaves = tree.first_child < 0
    for run in range(len(helices.pitch)):
        if not found.holds:
            break
        first = np.full(int(leaves.sum()), int(np.flatnonzero(helices.run == run)[0]))
        starts, _ = path.locate(tree.leaves, tree.radii[leaves], first, np.zeros(len(first)))
        options = {"limit": limit, "resolution": resolution, "max_queries": max_queries - found.queries}
        thread = sweep_helices(helices, run, starts, tree.radii[leaves], target, **options)
        found = Sweep(
            holds=thread.holds,
            exhausted=thread.exhausted,
            depth=max(found.depth, thread.depth),
            at=float(helices.times(run, np.array([thread.at]))[0]) if thread.depth > found.depth else found.at,
            queries=found.queries + thread.queries,
            near=np.union1d(found.near, np.round(helices.times(run, thread.near), 3)),
        )
    return found


@dataclass(eq=False)
class _Search:
    """Branch and bound over the balls of a tree and the stretches of a path."""

    tree: BallTree
    target: Target
    path: Screws
    limit: float
    resolutions: tuple[float, float]
    max_queries: int
    ease: Ease | None

    def run(self, stack: list[_Items]) -> Sweep:
        """Return what becomes of these."""
        stack, limit, queries = list(stack), self.limit, 0
        depth, at, beyond, near = -np.inf, 0.0, -np.inf, []
        while stack:
            items = _joined(stack)
            if len(items.node) > _CHUNK:
                stack.append(items.take(np.arange(_CHUNK, len(items.node))))
                items = items.take(np.arange(_CHUNK))
            queries += len(items.node)
            open_, s, travel, raw = _look(self.tree, self.target, self.path, items, limit, self.ease)
            leaf = self.tree.first_child[open_.node] < 0
            if leaf.any():
                deepest = int(np.argmin(np.where(leaf, s, np.inf)))
                if -s[deepest] > beyond:
                    beyond, at = float(-s[deepest]), float(open_.stretch[deepest] + open_.u[deepest])
                depth = (
                    max(depth, float(-np.where(leaf, raw, np.inf).min())) if beyond <= limit else float(-raw[deepest])
                )
                near.append(np.unique(np.round((open_.stretch + open_.u)[leaf], 3)))
            if beyond > limit or queries > self.max_queries:
                break
            stack.extend(_cut(self.tree, open_, s, travel, leaf, limit, self.resolutions))
        else:
            return Sweep(holds=True, exhausted=False, depth=depth, at=at, queries=queries, near=_sorted(near))
        return Sweep(holds=False, exhausted=beyond <= limit, depth=depth, at=at, queries=queries, near=_sorted(near))


def _joined(stack: list[_Items]) -> _Items:
    """Take the last items off the stack, as many as fit in a chunk: a look at many costs little more."""
    taken = [stack.pop()]
    count = len(taken[0].node)
    while stack and count + len(stack[-1].node) <= _CHUNK:
        taken.append(stack.pop())
        count += len(taken[-1].node)
    if len(taken) == 1:
        return taken[0]
    node, stretch, u, half = (
        np.concatenate([getattr(items, name) for items in taken]) for name in ("node", "stretch", "u", "half")
    )
    return _Items(node=node, stretch=stretch, u=u, half=half)


def _sorted(times: list[np.ndarray]) -> np.ndarray:
    return np.unique(np.concatenate(times)) if times else np.empty(0)


def _look(
    tree: BallTree, target: Target, path: Screws, items: _Items, limit: float, ease: Ease | None
) -> tuple[_Items, Float[np.ndarray, "n"], Float[np.ndarray, "n"], Float[np.ndarray, "n"]]:
    """Return the items that one look leaves open: the distance that counts, travel to either end, the distance."""
    radii = tree.radii[items.node]
    points, speed = path.locate_balls(tree, items)
    travel = speed * items.half
    need = radii + travel - limit
    close = np.flatnonzero(target.box_distance(points) < need)
    s = signed_distance(target, points[close], need[close], limit)
    raw, unsettled = s, s < need[close]
    if ease is not None and unsettled.any():
        s = s.copy()
        s[unsettled] = ease(items.node[close[unsettled]], points[close[unsettled]], s[unsettled])
        unsettled = s < need[close]
    close = close[unsettled]
    return items.take(close), s[unsettled], travel[close], raw[unsettled]


def _cut(
    tree: BallTree,
    items: _Items,
    s: np.ndarray,
    travel: np.ndarray,
    leaf: np.ndarray,
    limit: float,
    resolutions: tuple[float, float],
) -> list[_Items]:
    """Return smaller items for those not settled; samples that are settled as points, or finely enough, end here."""
    radii = tree.radii[items.node]
    margin = s + limit
    resolution = np.where(tree.between[items.node], np.minimum(0.5 * radii, resolutions[1]), 0.0)
    resolution = np.maximum(resolution, resolutions[0])
    inner = ~leaf
    in_space = np.flatnonzero(inner & (travel <= radii))
    in_time = np.flatnonzero((inner & (travel > radii)) | (leaf & (travel > margin) & (travel > resolution)))
    aim = np.where(leaf, np.maximum(margin, resolution), np.maximum(margin - radii, radii))[in_time]
    pieces = np.clip(np.ceil(travel[in_time] / aim), 2, _MAX_PIECES).astype(np.int64)
    out = []
    if len(in_space):
        out.append(items.take(in_space).in_space(tree))
    if len(in_time):
        out.append(items.take(in_time).in_time(pieces))
    return out
