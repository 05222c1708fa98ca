"""How deep do two bodies overlap in one pose? A second route: the exact intersection body.

Samples along a path can miss a slim part in a thin sheet; the boolean intersection cannot, in the poses where it is
taken. The overlap that a pair has in the assembled pose is measured here too: it may reach as deep on its way.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import manifold3d
import numpy as np
from jaxtyping import Float, Int

from sashimono.geometry import se3
from sashimono.verify.body import BallTree, SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.surface import Surface, box_distance
from sashimono.verify.sweep import Ease

_ACCURACY = 0.004
"""To which the depth is found, over the smaller body's smallest extent: a fifth of what a plan may add."""
_POINTS = 6_000
"""Most points looked at for the depth in one pose; with that many, the deepest found is what is said."""
_POINTS_ASSEMBLED = 30_000
"""The same for the assembled pose, once a pair: what is missed there would count against every motion."""
_BATCH = 256
"""Triangles halved at once, the most promising."""


@dataclass(frozen=True, kw_only=True)
class MeasuredOverlap:
    """The intersection of two bodies in one pose."""

    volume: float
    """[m³]; 0 where the bodies do not overlap, or where no boolean could be taken."""
    depth: float
    """Deepest point of one inside the other [m]."""
    exact: bool
    """Whether both meshes allowed a boolean."""


def intersection(
    moving: SampledBody,
    fixed: SampledBody,
    T_fixed_moving: Float[np.ndarray, "4 4"],
    *,
    most_points: int = _POINTS,
    enough: float = 0.0,
    excuse: Excuse | None = None,
    tolerance: float = 0.0,
) -> MeasuredOverlap:
    """Return the intersection body's volume and how deep its surface lies in either of the two.

    A depth of ``enough`` [m] and less need not be the greatest there is; the greatest is no more than that either.
    With an excuse, the depth is what that leaves.
    """
    if moving.solid is None or fixed.solid is None:
        return MeasuredOverlap(volume=0.0, depth=0.0, exact=False)
    common = moving.solid.transform(np.ascontiguousarray(T_fixed_moving[:3])) ^ fixed.solid
    volume = float(common.volume())
    if common.is_empty() or volume <= 0.0:
        return MeasuredOverlap(volume=0.0, depth=0.0, exact=True)
    T_moving_fixed = se3.inverse(T_fixed_moving)

    def depth(points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        # each point lies on one surface and within the other body: the greater distance, whatever its sign, counts
        depths = np.maximum(moving.gap(se3.apply(T_moving_fixed, points)), fixed.gap(points))
        return depths if excuse is None else -excuse.eased(points, -depths, tolerance)

    def most(triangles: Float[np.ndarray, "triangle 3 3"]) -> Float[np.ndarray, "triangle"]:
        # an excuse only takes off
        seen = se3.apply(T_moving_fixed, triangles.reshape(-1, 3)).reshape(triangles.shape)
        return np.maximum(moving.greatest_gap(seen), fixed.greatest_gap(triangles))

    surface = common.to_mesh64()
    points = np.asarray(surface.vert_properties)[:, :3]
    triangles = np.asarray(surface.tri_verts).astype(np.int64)
    accuracy = _ACCURACY * min(moving.smallest_extent, fixed.smallest_extent)
    greatest = _greatest(depth, most, points, triangles, accuracy, most_points, enough)
    return MeasuredOverlap(volume=volume, depth=greatest, exact=True)


def _greatest(
    depth: Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, "n"]],
    most: Callable[[Float[np.ndarray, "triangle 3 3"]], Float[np.ndarray, "triangle"]],
    points: Float[np.ndarray, "n 3"],
    triangles: Int[np.ndarray, "triangle 3"],
    accuracy: float,
    most_points: int,
    enough: float,
) -> float:
    """Return the greatest depth over some triangles, of which ``most`` gives upper bounds.

    Depth changes by no more than the way from a point to the next, and no point is farther from its triangle's nearest
    corner than the longest edge over √3. So triangles are halved, at that edge, only while they may hold a depth
    greater than ``enough``, and by ``accuracy`` than the greatest seen, the most promising first.
    """
    depths = depth(points)
    corners, at_corners = points[triangles], depths[triangles]
    bounds = np.minimum(_by_way(corners, at_corners), most(corners))
    found, looked = float(depths.max()), len(points)
    while looked < most_points:
        open_ = np.flatnonzero(bounds > max(found + accuracy, enough))
        if not len(open_):
            break
        order = open_[np.argsort(-bounds[open_], kind="stable")]
        now, later = order[:_BATCH], order[_BATCH:]
        edges = np.linalg.norm(np.roll(corners[now], -1, axis=1) - corners[now], axis=2)
        turned = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3  # the longest edge first
        a, b, c = np.moveaxis(np.take_along_axis(corners[now], turned[:, :, None], axis=1), 1, 0)
        at_a, at_b, at_c = np.take_along_axis(at_corners[now], turned, axis=1).T
        middles = 0.5 * (a + b)
        at_middles = depth(middles)
        looked += len(middles)
        found = max(found, float(at_middles.max()))
        halves = np.concatenate([np.stack([a, middles, c], axis=1), np.stack([middles, b, c], axis=1)])
        at_halves = np.concatenate(
            [np.stack([at_a, at_middles, at_c], axis=1), np.stack([at_middles, at_b, at_c], axis=1)]
        )
        of_halves = np.minimum(np.tile(bounds[now], 2), np.minimum(_by_way(halves, at_halves), most(halves)))
        corners = np.concatenate([corners[later], halves])
        at_corners = np.concatenate([at_corners[later], at_halves])
        bounds = np.concatenate([bounds[later], of_halves])
    return found


def _by_way(
    corners: Float[np.ndarray, "triangle 3 3"], at_corners: Float[np.ndarray, "triangle 3"]
) -> Float[np.ndarray, "triangle"]:
    """Upper bounds of the depth in triangles, by the way from the deepest corner."""
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return at_corners.max(axis=1) + edges.max(axis=1) / np.sqrt(3.0)


def sampled_depth(moving: SampledBody, fixed: SampledBody, T_fixed_moving: Float[np.ndarray, "4 4"]) -> float:
    """Return how deep the deepest surface sample of one lies inside the other [m], both ways; 0 if none does."""
    return DeepestSample(moving, fixed, T_fixed_moving).depth


class DeepestSample:
    """The deepest surface sample of two bodies in each other in one pose, to be looked at in others."""

    def __init__(self, moving: SampledBody, fixed: SampledBody, T_fixed_moving: Float[np.ndarray, "4 4"]) -> None:
        self.depth = 0.0
        """How deep it is [m]; 0 if none is inside."""
        self._point, self._target, self._is_fixed = moving.tree.leaves[:1], fixed, False
        for points, target, is_fixed in ((moving.tree.leaves, fixed, False), (fixed.tree.leaves, moving, True)):
            seen = se3.apply(se3.inverse(T_fixed_moving) if is_fixed else T_fixed_moving, points)
            near = np.flatnonzero(target.box_distance(seen) <= 0.0)
            if len(near):
                distances = target.distance(seen[near])
                k = int(np.argmin(distances))
                if -distances[k] > self.depth:
                    self.depth = -float(distances[k])
                    self._point, self._target, self._is_fixed = points[near[k : k + 1]], target, is_fixed

    def depth_at(self, T_fixed_moving: Float[np.ndarray, "4 4"]) -> float:
        """Return how deep that sample is in another pose [m], negative outside; the two overlap as deep at least."""
        T = se3.inverse(T_fixed_moving) if self._is_fixed else T_fixed_moving
        return -float(self._target.distance(se3.apply(T, self._point))[0])


@dataclass(frozen=True, kw_only=True, eq=False)
class Excuse:
    """How deep a pair overlaps as assembled. It may go as deep on its way, a deep overlap only near to where it is."""

    depth: float
    """Depth in the assembled pose [m]."""
    places: tuple[OverlapPlace, ...] = ()
    """Where it is, and how far from there it excuses anything; without any, everywhere."""

    def eased(
        self, points: Float[np.ndarray, "n 3"], distances: Float[np.ndarray, "n"], tolerance: float
    ) -> Float[np.ndarray, "n"]:
        """Return signed distances with the excuse taken off, so that what holds is no less than ``-tolerance``.

        Args:
            points: In the fixed part's frame [m].
            distances: Their signed distances to the other surface [m].
            tolerance: Depth that needs no excuse [m].
        """
        return self._off(distances, self._room(points, distances + tolerance), tolerance)

    def ease_moving(self, tolerance: float) -> Ease:
        """Return the same for points of the moving part, as a sweep asks for it."""
        return lambda node, points, distances: self.eased(points, distances, tolerance)

    def ease_fixed(self, tree: BallTree, tolerance: float) -> Ease:
        """Return the same for points of the fixed part, which stay where they are."""
        room = self._room(tree.centers, np.full(len(tree.centers), -np.inf))
        return lambda node, points, distances: self._off(distances, room[node], tolerance)

    def _room(self, points: np.ndarray, least: np.ndarray) -> Float[np.ndarray, "n"]:
        """How much farther from the overlap a point could be and still be excused, where that is more than least."""
        if not self.places:
            return np.full(len(points), np.inf)
        room = least.copy()
        for place in self.places:
            near = np.flatnonzero(place.reach - place.box_distance(points) > room)
            room[near] = np.maximum(room[near], place.reach - place.distance(points[near]))
        return room

    def _off(self, distances: np.ndarray, room: np.ndarray, tolerance: float) -> Float[np.ndarray, "n"]:
        return np.maximum(distances, np.minimum(distances + self.depth, room - tolerance))


class OverlapPlace:
    """One connected piece of a pair's intersection body."""

    def __init__(self, piece: manifold3d.Manifold, least: float) -> None:
        mesh = piece.to_mesh64()
        vertices = np.ascontiguousarray(np.asarray(mesh.vert_properties)[:, :3])
        self._surface = Surface(vertices, np.asarray(mesh.tri_verts).astype(np.int64))
        self._low, self._high = vertices.min(axis=0), vertices.max(axis=0)
        self.reach = max(least, float(np.linalg.norm(np.ptp(vertices, axis=0))))
        """How far from it this piece excuses anything [m]: as far as it is large."""

    def box_distance(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Return the distance of each point to the piece's box [m]: no more than to the piece."""
        return box_distance(points, self._low, self._high)

    def distance(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n"]:
        """Return the distance of each point to the piece's surface [m], also from inside."""
        return self._surface.gap(points)


@dataclass(frozen=True, eq=False)
class AssembledOverlaps:
    """Depth at which pairs overlap in the assembled pose, measured when first asked for."""

    bodies: dict[str, SampledBody]
    poses: dict[str, Float[np.ndarray, "4 4"]]
    config: VerifyConfig
    _known: dict[frozenset[str], float] = field(default_factory=dict)
    _excuses: dict[tuple[str, str], Excuse] = field(default_factory=dict)

    def depth(self, moving: str, fixed: str) -> float:
        """Return the pair's depth in the assembled pose [m]."""
        key = frozenset((moving, fixed))
        if key not in self._known:
            T = self._seen(moving, fixed)
            exact = intersection(self.bodies[moving], self.bodies[fixed], T, most_points=_POINTS_ASSEMBLED)
            # samples can err on a surface that meets itself, and would then excuse what is no overlap
            sampled = 0.0 if exact.exact else sampled_depth(self.bodies[moving], self.bodies[fixed], T)
            self._known[key] = max(exact.depth, sampled)
        return self._known[key]

    def excuse(self, moving: str, fixed: str) -> Excuse:
        """Return how deep, and how far from where they overlap as assembled, a part may go into a fixed one.

        A press fit is pushed along its whole bore: an overlap that is shallow beside both parts and their walls
        excuses as much all along. A deep one, a screw sunk into solid material, excuses nothing farther off than it is
        large. Where no boolean can be taken, it is not known where the overlap is, and its depth alone counts.
        """
        key = (moving, fixed)
        if key not in self._excuses:
            self._excuses[key] = self._excuse(moving, fixed)
        return self._excuses[key]

    def _excuse(self, moving: str, fixed: str) -> Excuse:
        depth, first, second = self.depth(moving, fixed), self.bodies[moving], self.bodies[fixed]
        near = self.config.relative_excuse * min(first.smallest_extent, second.smallest_extent)
        shallow = min(near, self.config.relative_wall * min(first.wall, second.wall))
        if depth <= shallow or first.solid is None or second.solid is None:
            return Excuse(depth=depth)
        common = first.solid.transform(np.ascontiguousarray(self._seen(moving, fixed)[:3])) ^ second.solid
        least = max(near, 2.0 * depth)
        return Excuse(depth=depth, places=tuple(OverlapPlace(piece, least) for piece in common.decompose()))

    def _seen(self, moving: str, fixed: str) -> Float[np.ndarray, "4 4"]:
        return se3.inverse(self.poses[fixed]) @ self.poses[moving]
