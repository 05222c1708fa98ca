"""Which meshes have the same shape, up to a rigid motion?

Robust to the pose and to the order of vertices and faces; mirrored ones are different. Two
meshes are compared by integrals first, and only taken as the same after a motion was found that
carries one's vertices onto the other's.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import KDTree

from sashimono.geometry import se3
from sashimono.geometry.mesh import measures


@dataclass(frozen=True, kw_only=True)
class ShapeConfig:
    """When two shapes count as the same."""

    tolerance: float = 1e-4
    """Largest distance between matched vertices, over the shape's radius."""
    attempts: int = 256
    """Most alignments tried for a pair whose vertices come in different order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Shape:
    faces: Int[np.ndarray, "face 3"]
    measures: Float[np.ndarray, "5"]
    """Lengths that a motion leaves alone: from volume, area and principal moments [m]."""
    radius: float
    points: Float[np.ndarray, "vertex 3"]
    """Vertices about the centre of mass."""
    distances: Float[np.ndarray, "vertex"]
    """Distances of the vertices from the centre of mass."""
    center: Float[np.ndarray, "3"]
    """Centre of mass [m]."""


def identical_shapes(
    meshes: Sequence[tuple[np.ndarray, np.ndarray]], config: ShapeConfig | None = None
) -> tuple[tuple[int, ...], ...]:
    """Return the classes of two or more closed meshes (vertices, faces) with the same shape, by index, in order."""
    config = config or ShapeConfig()
    shapes = [_describe(vertices, faces) for vertices, faces in meshes]
    classes: list[list[int]] = []
    # with thousands of parts only those of as many corners and faces and about the same volume are compared
    alike: dict[tuple[int, int], list[tuple[float, int]]] = {}
    for k, shape in enumerate(shapes):
        known = alike.setdefault((len(shape.points), len(shape.faces)), [])
        size, slack = float(shape.measures[0]), 2.0 * config.tolerance * shape.radius
        near = known[bisect_left(known, (size - slack, -1)) : bisect_right(known, (size + slack, len(shapes)))]
        for index in sorted(index for _, index in near):
            if _same(shapes[classes[index][0]], shape, config):
                classes[index].append(k)
                break
        else:
            insort(known, (size, len(classes)))
            classes.append([k])
    return tuple(tuple(members) for members in classes if len(members) > 1)


def rigid_motion(
    first: tuple[np.ndarray, np.ndarray], second: tuple[np.ndarray, np.ndarray], config: ShapeConfig | None = None
) -> Float[np.ndarray, "4 4"] | None:
    """Return a motion that carries a closed mesh (vertices, faces) onto another; None if they differ in shape.

    Of several, as symmetric shapes have them, it is one without rotation if there is such a one.
    """
    config = config or ShapeConfig()
    a, b = _describe(*first), _describe(*second)
    rotation = _match(a, b, config)
    if rotation is None:
        return None
    return se3.make(rotation, b.center - rotation @ a.center)


def _describe(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> _Shape:
    mass = measures.mass_properties(vertices, faces)
    points = vertices - mass.center
    lengths = [np.cbrt(mass.volume), np.sqrt(measures.area(vertices, faces))]
    return _Shape(
        faces=faces,
        measures=np.array([*lengths, *np.sqrt(np.maximum(mass.moments / mass.volume, 0.0))]),
        radius=measures.radius(vertices, mass.center),
        points=points,
        distances=np.linalg.norm(points, axis=1),
        center=mass.center,
    )


def _same(a: _Shape, b: _Shape, config: ShapeConfig) -> bool:
    return _match(a, b, config) is not None


def _match(a: _Shape, b: _Shape, config: ShapeConfig) -> Float[np.ndarray, "3 3"] | None:
    """Return a rotation about the centres that carries a onto b; None if there is none."""
    tolerance = config.tolerance * a.radius
    if len(a.points) != len(b.points) or len(a.faces) != len(b.faces):
        return None
    if np.abs(a.measures - b.measures).max() > tolerance or abs(a.radius - b.radius) > tolerance:
        return None
    if np.abs(np.sort(a.distances) - np.sort(b.distances)).max() > tolerance:
        return None
    if np.array_equal(a.faces, b.faces):
        if np.linalg.norm(a.points - b.points, axis=1).max() <= tolerance:
            return np.eye(3)
        rotation = _rotation_between(a.points, b.points)
        if np.linalg.norm(a.points @ rotation.T - b.points, axis=1).max() <= tolerance:
            return rotation
    return _aligned(a, b, tolerance, config.attempts)


def _rotation_between(a: Float[np.ndarray, "n 3"], b: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation that carries points a best onto points b (Kabsch, 1976)."""
    U, _, Vt = np.linalg.svd(b.T @ a)
    return U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt


def _aligned(a: _Shape, b: _Shape, tolerance: float, attempts: int) -> Float[np.ndarray, "3 3"] | None:
    """Return a rotation that carries the vertices and faces' centres of a onto those of b; None if none is found."""
    tree = KDTree(b.points)
    centers_a, centers_b = (s.points[s.faces].mean(axis=1) for s in (a, b))
    center_tree = KDTree(centers_b)
    few = a.points[np.unique(np.linspace(0, len(a.points) - 1, 24).astype(int))]
    for k, rotation in enumerate(chain([np.eye(3)], _candidate_rotations(a, b, tolerance))):
        if k > attempts:
            return None
        if tree.query(few @ rotation.T, distance_upper_bound=4.0 * tolerance)[0].max() > 4.0 * tolerance:
            continue
        gap, match = map(np.asarray, tree.query(a.points @ rotation.T))
        if gap.max() > 4.0 * tolerance or len(np.unique(match)) != len(a.points):
            continue
        rotation = _rotation_between(a.points, b.points[match])
        if np.linalg.norm(a.points @ rotation.T - b.points[match], axis=1).max() > tolerance:
            continue
        if center_tree.query(centers_a @ rotation.T)[0].max() <= tolerance:
            return rotation
    return None


def _candidate_rotations(a: _Shape, b: _Shape, tolerance: float) -> Iterator[Float[np.ndarray, "3 3"]]:
    """Yield rotations that carry two telling vertices of a onto vertices of b at the same distances.

    The first vertex is of the rarest distance from the centre, the second of the rarest pair of
    distances to the centre and to the first, so that few pairs of b can match.
    """
    far = a.distances > 0.2 * a.radius
    first = _rarest(a.distances[:, None], far, tolerance)
    to_first = np.linalg.norm(a.points - a.points[first], axis=1)
    sine = np.linalg.norm(np.cross(a.points, a.points[first]), axis=1) / (a.radius * a.distances[first])
    second = _rarest(np.column_stack([a.distances, to_first]), far & (sine > 0.1), tolerance)
    frame_a = _frame(a.points[first], a.points[second])
    for p in np.flatnonzero(np.abs(b.distances - a.distances[first]) <= 2.0 * tolerance):
        gap = np.linalg.norm(b.points - b.points[p], axis=1)
        near = (np.abs(gap - to_first[second]) <= 4.0 * tolerance) & (
            np.abs(b.distances - a.distances[second]) <= 2.0 * tolerance
        )
        for q in np.flatnonzero(near):
            yield _frame(b.points[p], b.points[q]) @ frame_a.T


def _rarest(values: Float[np.ndarray, "vertex k"], allowed: np.ndarray, tolerance: float) -> int:
    """Return the allowed row with the fewest others near it; the first such."""
    tree = KDTree(values)
    rows = np.flatnonzero(allowed) if allowed.any() else np.arange(len(values))
    counts = tree.query_ball_point(values[rows], 2.0 * tolerance, return_length=True)
    return int(rows[np.argmin(counts)])


def _frame(p: Float[np.ndarray, "3"], q: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return a right-handed frame as columns: x along p, y towards q."""
    x = p / np.linalg.norm(p)
    z = np.cross(x, q)
    length = np.linalg.norm(z)
    z = z / length if length > 0.0 else np.cross(x, np.eye(3)[int(np.argmin(np.abs(x)))])
    z /= np.linalg.norm(z)
    return np.column_stack([x, np.cross(z, x), z])
