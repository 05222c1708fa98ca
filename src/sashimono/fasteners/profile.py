"""A part as a lathe sees it: its cross-sections along an axis, each a circle, a hexagon, or something else.

Screws, nuts, washers and pins are stacks of round and hexagonal sections about one axis. Cross-sections hold for
coarse and fine facets alike, and for ridges of a thread: an outline that bends by 6 or 4 corners shows in the
harmonics of its edges' normals, whatever the number of its points.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np
from jaxtyping import Float
from manifold3d import Error, Manifold
from scipy.spatial import ConvexHull, QhullError

from sashimono.geometry.features.directions import DirectionConfig, frame_along, part_directions
from sashimono.geometry.mesh.solid import to_manifold

Outline = Literal["none", "round", "ridged", "hex", "square", "slot", "cross", "lobes", "other"]
"""What a closed curve is: the outside of a section, or the hole in its middle. "none": there is no hole.

"ridged" is nearly round, as a section through a coarse thread is: a core with a ridge on one side.
"""


@dataclass(frozen=True, kw_only=True)
class ProfileConfig:
    """How sections are cut and read; lengths are over the section's outer radius unless stated."""

    sections: int = 72
    """Most sections along the axis."""
    first_sections: int = 9
    """Sections by which an axis is tried."""
    lines: int = 4
    """Lines of the part's own geometry tried as the axis."""
    step: float = 0.004
    """Levels of vertices nearer than this, over the part's length, are one."""
    corners: float = 0.6
    """Least harmonic (0 to 1) of the edges' normals that makes an outline a hexagon or a square."""
    round: float = 0.86
    """Least area of a round outline over that of its circle: an octagon has 0.90, a hexagon 0.83."""
    ridged: float = 0.58
    """Least such area of a section through a thread, about the axis."""
    centered: float = 0.12
    """Largest distance of a section's middle from the axis; a thread's section may be off by twice that."""
    recess: float = 0.8
    """Least area over that of its convex hull of a hole that is convex; a cross recess has less."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """One cross-section at right angles to the axis."""

    low: float
    """Where it begins along the axis [m]; sections fill the part's length."""
    high: float
    """Where it ends."""
    outer: Outline
    """What its convex hull is."""
    radius: float
    """Largest distance of its outline from the axis [m]."""
    flats: float
    """Across the flats of a hexagon or square, else across the middle [m]."""
    inner: Outline
    """What the hole about the axis is."""
    hole: float
    """Across the flats of that hole, or across the middle of a round one [m]; 0 without one."""
    filled: float
    """Area of material over that of the convex hull."""
    outline_filled: float
    """Area within the outlines, holes filled, over that of the convex hull."""
    pieces: int
    """Outlines that are not holes."""
    around: float
    """Share of the ways out from the axis that meet material."""
    inside: float
    """Distance of the nearest edge from the axis [m]."""

    @property
    def length(self) -> float:
        """Extent along the axis [m]."""
        return self.high - self.low


@dataclass(frozen=True, kw_only=True, eq=False)
class Profile:
    """A part's sections along its axis."""

    axis: Float[np.ndarray, "3"]
    """Unit direction, in the frame of the vertices."""
    point: Float[np.ndarray, "3"]
    """A point on the axis [m]; heights are measured from it."""
    sections: tuple[Section, ...]
    """From the lowest to the highest."""
    turned: float
    """Share of the length whose sections are round, hexagonal or square about the axis."""

    @property
    def length(self) -> float:
        """Extent along the axis [m]."""
        return self.sections[-1].high - self.sections[0].low

    def flipped(self) -> Profile:
        """Return the same profile seen from the other end."""
        sections = tuple(replace(s, low=-s.high, high=-s.low) for s in reversed(self.sections))
        return replace(self, axis=-self.axis, sections=sections)


def part_profile(
    vertices: Float[np.ndarray, "vertex 3"], faces: np.ndarray, *, config: ProfileConfig
) -> Profile | None:
    """Return a closed part's profile about the line of its own geometry about which it is most turned or bored.

    None if no section is round, hexagonal or bored about any line tried, or if the surface bounds no solid.
    """
    solid = to_manifold(vertices, faces)
    if solid.status() != Error.NoError or solid.is_empty():
        return None
    lines, _ = part_directions(vertices, faces, config=DirectionConfig())
    best: tuple[float, np.ndarray] | None = None
    for line in lines[: config.lines]:
        tried = profile_along(solid, vertices, line, most=config.first_sections, config=config)
        if tried is None:
            continue
        bored = sum(s.length for s in tried.sections if s.inner == "round") / tried.length
        score = tried.turned + 0.5 * bored
        if best is None or score > best[0] + 0.02:
            best = score, line
    if best is None or best[0] == 0.0:
        return None
    return profile_along(solid, vertices, best[1], most=config.sections, config=config)


def profile_along(
    solid: Manifold,
    vertices: Float[np.ndarray, "vertex 3"],
    axis: Float[np.ndarray, "3"],
    *,
    most: int,
    config: ProfileConfig,
) -> Profile | None:
    """Return the profile along a direction, its axis through the middle of most sections; None if there are none."""
    frame = frame_along(axis)
    turned = solid.transform(np.column_stack([frame, np.zeros(3)]))
    heights = vertices @ axis
    edges = _levels(heights, most, config.step)
    cuts = [turned.slice(float(0.5 * (a + b))).to_polygons() for a, b in pairwise(edges)]
    middles = [_hull_middle(polygons) for polygons in cuts]
    if all(middle is None for middle in middles):
        return None
    middle = np.median([m for m in middles if m is not None], axis=0)
    sections = []
    for low, high, polygons in zip(edges[:-1], edges[1:], cuts, strict=True):
        section = read_section([p - middle for p in polygons], float(low), float(high), config=config)
        if section is not None:
            sections.append(section)
    if not sections:
        return None
    length = sum(s.length for s in sections)
    share = sum(s.length for s in sections if s.outer in ("round", "hex", "square", "ridged")) / length
    point = frame.T @ np.array([middle[0], middle[1], 0.0])
    return Profile(axis=axis, point=point, sections=tuple(sections), turned=share)


def read_section(
    polygons: Sequence[Float[np.ndarray, "_ 2"]], low: float, high: float, *, config: ProfileConfig
) -> Section | None:
    """Return what a section is, its polygons given about the axis; None if it is empty."""
    hull = _hull(polygons)
    if hull is None:
        return None
    areas = np.array([signed_area(p) for p in polygons])
    radius = float(np.linalg.norm(hull, axis=1).max())
    off = float(np.linalg.norm(_centroid(hull))) / radius
    outer = outline(hull, config) if off <= config.centered else "other"
    if outer == "other" and off <= 2.0 * config.centered and signed_area(hull) >= config.ridged * np.pi * radius**2:
        outer = "ridged" if len(hull) >= 8 else "other"
    nearest, _, inside = free_radius(polygons)
    inner, hole = ("none", 0.0) if inside else _hole(polygons, areas, nearest, config)
    return Section(
        low=low,
        high=high,
        outer=outer,
        radius=radius,
        flats=_across(hull, outer),
        inner=inner,
        hole=hole,
        filled=float(areas.sum() / signed_area(hull)),
        outline_filled=float(areas[areas > 0.0].sum() / signed_area(hull)),
        pieces=int((areas > 1e-4 * signed_area(hull)).sum()),
        around=1.0 if inner != "other" else _around(polygons),
        inside=nearest,
    )


def outline(hull: Float[np.ndarray, "corner 2"], config: ProfileConfig) -> Outline:
    """Return whether a convex outline is round, a hexagon, a square, or something else."""
    shapes: tuple[tuple[int, Outline], ...] = ((6, "hex"), (4, "square"))
    for corners, name in shapes:
        if harmonic(hull, corners) >= config.corners and _regular(hull, corners):
            return name
    reach = np.linalg.norm(hull - _centroid(hull), axis=1).max()
    return "round" if signed_area(hull) >= config.round * np.pi * reach**2 and len(hull) >= 8 else "other"


def harmonic(polygon: Float[np.ndarray, "corner 2"], order: int) -> float:
    """Return how much a polygon's edges face this many evenly spread ways, from 0 to 1, weighed by their length."""
    sides = _following(polygon) - polygon
    lengths = np.linalg.norm(sides, axis=1)
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    return float(abs((lengths * np.exp(1j * order * angles)).sum()) / max(lengths.sum(), 1e-300))


def free_radius(polygons: Sequence[Float[np.ndarray, "_ 2"]]) -> tuple[float, float, bool]:
    """Return the distances from the axis to the nearest edge and the farthest corner near it, and whether it is inside.

    The second one is of the polygon that has the nearest edge: of a round hole, its radius.
    """
    best = (np.inf, np.inf)
    inside = False
    for polygon in polygons:
        starts, ends = polygon, _following(polygon)
        sides = ends - starts
        squared = np.maximum((sides**2).sum(axis=1), 1e-300)
        along = np.clip(-(starts * sides).sum(axis=1) / squared, 0.0, 1.0)
        distance = float(np.linalg.norm(starts + along[:, None] * sides, axis=1).min())
        if distance < best[0]:
            best = (distance, float(np.linalg.norm(starts, axis=1).max()))
        inside ^= _contains_origin(polygon)
    return *best, inside


def _levels(heights: Float[np.ndarray, "vertex"], most: int, step: float) -> Float[np.ndarray, "level"]:
    """Heights between which a part is cut: those of its vertices where they are few, else evenly spread."""
    low, high = float(heights.min()), float(heights.max())
    ordered = np.unique(heights)
    kept = ordered[np.concatenate([[True], np.diff(ordered) > step * (high - low)])]
    kept[-1] = high
    if 2 <= len(kept) <= most + 1:
        # a long stretch without vertices may still bend, if its sides do: cut it a few times
        parts = np.maximum(1, np.ceil(np.diff(kept) / (high - low) * min(8, most / len(kept))).astype(int))
        pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(kept[:-1], kept[1:], parts, strict=True)]
        return np.concatenate([*pieces, [high]])
    return np.linspace(low, high, most + 1)


def _hull(polygons: Sequence[Float[np.ndarray, "_ 2"]]) -> Float[np.ndarray, "corner 2"] | None:
    if not polygons:
        return None
    points = np.concatenate(polygons)
    try:
        hull = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return None
    return hull if signed_area(hull) > 0.0 else None


def _hull_middle(polygons: Sequence[Float[np.ndarray, "_ 2"]]) -> Float[np.ndarray, "2"] | None:
    hull = _hull(polygons)
    return None if hull is None else _centroid(hull)


def _hole(
    polygons: Sequence[Float[np.ndarray, "_ 2"]],
    areas: Float[np.ndarray, "polygon"],
    nearest: float,
    config: ProfileConfig,
) -> tuple[Outline, float]:
    """What the hole about the axis is, and its size [m]; ``nearest`` is the distance of the nearest edge."""
    around = [k for k, p in enumerate(polygons) if areas[k] < 0.0 and _contains_origin(p)]
    if not around:
        # open to the side: a slot across the head
        return ("slot", 2.0 * nearest) if len(polygons) == 2 else ("other", 0.0)
    hole = polygons[min(around, key=lambda k: abs(areas[k]))][::-1]
    hull = _hull([hole])
    if hull is None:
        return "other", 0.0
    if signed_area(hole) < config.recess * signed_area(hull):
        return "cross", 2.0 * float(np.linalg.norm(hull, axis=1).max())
    reach = float(np.linalg.norm(hull, axis=1).max())
    if float(np.linalg.norm(_centroid(hull))) > 1.5 * config.centered * reach:
        return "other", 0.0
    kind = outline(hull, config)
    if kind == "round" and signed_area(hole) < 0.985 * signed_area(hull) and harmonic_radius(hole, 6) > 0.03:
        return "lobes", 2.0 * reach
    if kind == "other" and signed_area(hull) < 0.5 * np.pi * reach**2:
        return "slot", 2.0 * free_radius([hole])[0]
    return kind, _across(hull, kind)


def _around(polygons: Sequence[Float[np.ndarray, "_ 2"]]) -> float:
    """The share of 72 rays from the axis that cross an outline."""
    starts = np.concatenate(polygons)
    ends = np.concatenate([_following(p) for p in polygons])
    angles = 2.0 * np.pi * (np.arange(72) + 0.5) / 72.0
    ways = np.column_stack([np.cos(angles), np.sin(angles)])
    a, b = ways @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ starts.T, ways @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ ends.T
    with np.errstate(divide="ignore", invalid="ignore"):
        share = a / (a - b)
        ahead = (ways @ starts.T) * (1.0 - share) + (ways @ ends.T) * share
    return float((((a > 0.0) != (b > 0.0)) & (ahead > 0.0)).any(axis=1).mean())


def harmonic_radius(polygon: Float[np.ndarray, "corner 2"], order: int) -> float:
    """Return how much a polygon's distance from the axis waves this many times around, over its mean."""
    starts, ends = polygon, _following(polygon)
    share = (np.arange(8) / 8.0)[:, None, None]
    points = (starts + share * (ends - starts)).reshape(-1, 2)
    angles, radii = np.arctan2(points[:, 1], points[:, 0]), np.linalg.norm(points, axis=1)
    grid = np.linspace(-np.pi, np.pi, 144, endpoint=False)
    spread = np.interp(grid, np.sort(angles), radii[np.argsort(angles)], period=2.0 * np.pi)
    return float(2.0 * abs((spread * np.exp(1j * order * grid)).mean()) / spread.mean())


def _regular(hull: Float[np.ndarray, "corner 2"], corners: int) -> bool:
    """Whether flats face all the ways of a regular polygon, equally far from the middle."""
    middle = _centroid(hull)
    sides = _following(hull) - hull
    lengths = np.linalg.norm(sides, axis=1)
    phase = float(np.angle((lengths * np.exp(1j * corners * np.arctan2(sides[:, 1], sides[:, 0]))).sum())) / corners
    angles = np.arctan2(sides[:, 1], sides[:, 0]) - phase
    facing = np.round(angles / (2.0 * np.pi / corners)).astype(int) % corners
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.maximum(lengths, 1e-300)[:, None]
    distances = ((hull - middle) * normals).sum(axis=1)
    flats = [distances[facing == k].max(initial=0.0) for k in range(corners)]
    spans = [lengths[facing == k].sum() for k in range(corners)]
    return bool(min(flats) > 0.93 * max(flats) and min(spans) > 0.5 * max(spans))


def _across(hull: Float[np.ndarray, "corner 2"], kind: Outline) -> float:
    """Across the flats of a hexagon or square; else the diameter [m]."""
    middle = _centroid(hull)
    if kind not in ("hex", "square"):
        return 2.0 * float(np.linalg.norm(hull - middle, axis=1).max())
    sides = _following(hull) - hull
    lengths = np.linalg.norm(sides, axis=1)
    good = lengths > 0.2 * lengths.max()
    normals = np.column_stack([sides[:, 1], -sides[:, 0]])[good] / lengths[good, None]
    return 2.0 * float(np.average(((hull[good] - middle) * normals).sum(axis=1), weights=lengths[good]))


def _following(polygon: Float[np.ndarray, "corner 2"]) -> Float[np.ndarray, "corner 2"]:
    """The corner after each."""
    return np.concatenate([polygon[1:], polygon[:1]])


def signed_area(polygon: Float[np.ndarray, "corner 2"]) -> float:
    """Return a polygon's area, negative where it runs clockwise: a hole."""
    following = _following(polygon)
    return 0.5 * float((polygon[:, 0] * following[:, 1] - polygon[:, 1] * following[:, 0]).sum())


def _centroid(polygon: Float[np.ndarray, "corner 2"]) -> Float[np.ndarray, "2"]:
    origin = polygon.mean(axis=0)
    p = polygon - origin
    q = _following(p)
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    total = cross.sum()
    return origin if total == 0.0 else origin + (cross[:, None] * (p + q)).sum(axis=0) / (3.0 * total)


def contains_origin(polygons: Sequence[Float[np.ndarray, "_ 2"]]) -> bool:
    """Return whether the origin is in material: inside an odd number of outlines and holes."""
    return sum(_contains_origin(polygon) for polygon in polygons) % 2 == 1


def _contains_origin(polygon: Float[np.ndarray, "corner 2"]) -> bool:
    """Whether the origin is inside, by crossings of the ray along x."""
    if (polygon.min(axis=0) > 0.0).any() or (polygon.max(axis=0) < 0.0).any():
        return False
    a, b = polygon, _following(polygon)
    cross = (a[:, 1] > 0.0) != (b[:, 1] > 0.0)
    a, b = a[cross], b[cross]
    x = a[:, 0] - a[:, 1] * (b[:, 0] - a[:, 0]) / (b[:, 1] - a[:, 1])
    return bool((x > 0.0).sum() % 2 == 1)
