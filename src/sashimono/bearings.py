"""Rolling bearings told by their shape: balls or rollers on a circle, and the two races between which they run.

What makes a bearing is that it turns: all around the circle of the elements' middles, each race is as far from it as an
element is thick. A plate with a pocket for each ball, and pins in holes, are not.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sashimono.assembly import Assembly, Part
from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.features.circle import widest_gap
from sashimono.geometry.features.directions import frame_along
from sashimono.geometry.mesh import measures

Side = Literal["inner", "outer", "below", "above"]
"""On which side of the rolling elements a race is."""

_OPPOSITE: tuple[tuple[Side, Side], ...] = (("inner", "outer"), ("below", "above"))


@dataclass(frozen=True, kw_only=True)
class BearingConfig:
    """What counts as a bearing. Lengths are over the radius of a rolling element unless stated."""

    round: float = 0.04
    """How much the extents of a ball, or across a roller, may differ, over their size."""
    ball_volume: tuple[float, float] = (0.85, 1.02)
    """Volume of a ball over that of a sphere of its extent: facets take some away."""
    roller_volume: tuple[float, float] = (0.7, 1.02)
    """The same of a roller, over a cylinder: chamfers and tapers take some away."""
    convex: float = 0.98
    """Least volume of an element over that of its convex hull: a gear and a bushing have less."""
    elements: int = 5
    """Fewest rolling elements of a bearing."""
    circle: float = 0.03
    """How far their middles may be off a circle, over its radius."""
    spread: float = 2.0
    """Largest angle between neighbours on the circle, over that of elements spread evenly."""
    beyond: float = 0.4
    """How far a race may reach past the circle of the middles."""
    gap: float = 0.3
    """How much nearer or farther than an element's radius the circle may be from a race."""
    groove: float = 0.3
    """How much that distance may change along the circle: facets change it, pockets by more than an element's radius.
    """
    turns: int = 96
    """Points of the circle at which it is measured."""
    thick: float = 3.0
    """How thick a race may be, from the circle on."""
    wide: float = 4.0
    """How wide a race of balls may be, over a ball's diameter: there may be two rows."""
    wide_rollers: float = 3.0
    """How wide a race of rollers may be, over a roller's length."""
    outline: float = 0.05
    """How much the width of a race may change as it turns, over it: a housing is no race."""
    moments: float = 0.03
    """How much the moments of inertia of a race about two axes across may differ, over them."""
    around: float = 0.03
    """How far cages and seals may reach out of the ring between the races' bore and rim, over the rim's radius."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Bearing:
    """Parts that are a bearing together."""

    elements: tuple[str, ...]
    """Balls or rollers, in part order."""
    races: tuple[str, ...]
    """Rings, or washers, in part order."""
    others: tuple[str, ...]
    """Cages, seals and what else is inside, in part order."""
    has_balls: bool
    point: Float[np.ndarray, "3"]
    """On the axis, world [m]."""
    axis: Float[np.ndarray, "3"]
    """World, unit."""
    bounds: Float[np.ndarray, "2 2"]
    """Bore and lower end, rim and upper end: distances from the axis and heights along it from the point [m]."""

    @property
    def parts(self) -> frozenset[str]:
        """All of its parts."""
        return frozenset((*self.elements, *self.races, *self.others))

    @property
    def words(self) -> str:
        """What it is."""
        return bearing_words(len(self.elements), has_balls=self.has_balls)

    def contains(self, part: Part, slack: float) -> bool:
        """Return whether a part lies between bore and rim, and within the width; ``slack`` is over the rim's radius."""
        own = _cylindrical(part.vertices_world, self.point, self.axis)
        far = slack * self.bounds[1, 0]
        return bool((own >= self.bounds[0] - far).all() and (own <= self.bounds[1] + far).all())


def bearing_words(count: int, *, has_balls: bool) -> str:
    """Return what so many balls, or rollers, between races are."""
    return f"a bearing, {count} {'balls' if has_balls else 'rollers'} between races"


@dataclass(frozen=True, kw_only=True, eq=False)
class Element:
    """A ball or a roller."""

    part: Part
    is_ball: bool
    radius: float
    """[m]"""
    length: float
    """Of a roller; a ball's diameter [m]."""
    middle: Float[np.ndarray, "3"]
    """World [m]."""


def find_elements(
    assembly: Assembly, config: BearingConfig, *, among: Collection[str] | None = None
) -> list[list[Element]]:
    """Return the parts that are balls or rollers, those of one shape together, as many as a bearing has at least.

    Only parts of these names are looked at, if names are given.
    """
    out = []
    for names in assembly.identical:
        names = names if among is None else [name for name in names if name in among]
        if len(names) < config.elements:
            continue
        first = as_element(assembly.part(names[0]), config)
        if first is None:
            continue
        alike = []
        for name in names:
            part = assembly.part(name)
            middle = measures.mass_properties(part.vertices_world, part.faces).center
            alike.append(
                Element(part=part, is_ball=first.is_ball, radius=first.radius, length=first.length, middle=middle)
            )
        out.append(alike)
    return out


def as_element(part: Part, config: BearingConfig) -> Element | None:
    """Return the part as a rolling element; None if it is none."""
    mass = measures.mass_properties(part.vertices_world, part.faces)
    edges = np.sort(np.ptp(part.vertices_part, axis=0))
    element = None
    if edges[2] - edges[0] <= config.round * edges[2] and _is_within(
        mass.volume / (np.pi / 6.0 * float(np.mean(edges)) ** 3), config.ball_volume
    ):
        radius = float(edges[0]) / 2.0
        element = Element(part=part, is_ball=True, radius=radius, length=2.0 * radius, middle=mass.center)
    else:
        edges = np.sort(measures.inertia_extents(part.vertices_part, part.faces))
        for a, b, length in ((edges[0], edges[1], edges[2]), (edges[1], edges[2], edges[0])):
            if b - a <= config.round * b and _is_within(
                mass.volume / (np.pi / 4.0 * a * b * length), config.roller_volume
            ):
                element = Element(
                    part=part, is_ball=False, radius=float(a) / 2.0, length=float(length), middle=mass.center
                )
                break
    if element is None:
        return None
    try:
        hull = ConvexHull(part.vertices_part).volume
    except QhullError:
        return None
    return element if mass.volume >= config.convex * hull else None


def find_bearings(assembly: Assembly, *, config: BearingConfig | None = None) -> tuple[Bearing, ...]:
    """Return the bearings among the parts of an assembly, whatever its product tree says, in part order.

    A bearing has five or more equal balls or rollers on a circle, a ring inside and one outside of them (or, of balls,
    a washer on either side), and what lies between the bore and the rim of these. Elements that run on a shaft or in a
    housing are none: nobody buys these together.
    """
    config = config or BearingConfig()
    alike = find_elements(assembly, config)
    rolling = {element.part.name for elements in alike for element in elements}
    others = [part for part in assembly.parts if part.name not in rolling] if alike else []
    rings = [ring for part in others if (ring := _ring(part, config)) is not None]
    rows = [row for ring, elements in product(rings, alike) for row in _rows(ring, elements, config)]
    out: list[tuple[set[str], list[_Row]]] = []
    for first, second in product(rows, rows):
        if (first.side, second.side) in _OPPOSITE and first.names == second.names and first.is_about(second, config):
            names, run = {*first.names, first.ring.part.name, second.ring.part.name}, [first, second]
            for other in [other for other in out if other[0] & names]:  # rows that share a race
                out.remove(other)
                names, run = names | other[0], [*other[1], *run]
            out.append((names, run))
    order = {name: k for k, name in enumerate(assembly.names)}
    found = [_bearing(assembly, run, config) for _, run in out]
    return tuple(sorted(found, key=lambda bearing: min(order[name] for name in bearing.parts)))


def is_between(elements: Sequence[Element], others: Sequence[Part], config: BearingConfig) -> bool:
    """Return whether elements lie on a circle with one part inside of it and one outside, or, of balls, on either side.

    It says less than `find_bearings`: a shaft and a housing may be these parts.
    """
    middles = np.array([element.middle for element in elements])
    center = middles.mean(axis=0)
    axis = np.linalg.svd(middles - center)[2][2]
    around = np.linalg.norm(middles - center, axis=1)
    circle = float(around.mean())
    flat = np.abs((middles - center) @ axis).max()
    if max(np.ptp(around), flat) > config.circle * circle:
        return False
    reach = config.beyond * elements[0].radius
    inner = outer = below = above = False
    for part in others:
        radii, along = _cylindrical(part.vertices_world, center, axis).T
        near = float(radii.max()) > circle - 3.0 * elements[0].radius
        inner = inner or (bool(radii.max() <= circle + reach) and near)
        outer = outer or bool(radii.min() >= circle - reach)
        spans = bool(radii.min() < circle < radii.max())
        below = below or (spans and bool(along.max() <= reach))
        above = above or (spans and bool(along.min() >= -reach))
    return (inner and outer) or (below and above and elements[0].is_ball)


@dataclass(frozen=True, eq=False)
class _Ring:
    """A part with a bore, as wide in every direction across its axis."""

    part: Part
    point: Float[np.ndarray, "3"]
    """Its centre of mass, which is on its axis; world [m]."""
    axis: Float[np.ndarray, "3"]
    """World, unit."""

    @cached_property
    def cylindrical(self) -> Float[np.ndarray, "vertex 2"]:
        """Distance of each vertex from the axis, and its height along it [m]."""
        return _cylindrical(self.part.vertices_world, self.point, self.axis)

    @cached_property
    def distance(self) -> SignedDistance:
        """From its surface."""
        return SignedDistance(self.part.vertices_world, self.part.faces)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Row:
    """Rolling elements on a circle along a race."""

    ring: _Ring
    side: Side
    """Where the race is."""
    names: frozenset[str]
    """The elements."""
    has_balls: bool
    radius: float
    """Of the circle [m]."""

    def is_about(self, other: _Row, config: BearingConfig) -> bool:
        """Whether the other race has the same axis."""
        line = self.ring.point - other.ring.point
        off = float(np.linalg.norm(line - (line @ self.ring.axis) * self.ring.axis))
        return off <= config.circle * self.radius and abs(float(self.ring.axis @ other.ring.axis)) > 0.999


def _ring(part: Part, config: BearingConfig) -> _Ring | None:
    """The part as something round with a bore; None if it is nothing of the kind."""
    mass = measures.mass_properties(part.vertices_world, part.faces)
    moments = mass.moments
    equal = [(abs(moments[a] - moments[b]), other) for a, b, other in ((0, 1, 2), (1, 2, 0))]
    off, odd = min(equal)
    if off > config.moments * moments[2]:
        return None
    ring = _Ring(part, mass.center, mass.axes[:, odd])
    if ring.cylindrical[:, 0].max() <= 0.0 or ring.distance.query(mass.center[None])[0] <= 0.0:
        return None
    angles = np.linspace(0.0, np.pi, 16, endpoint=False)
    across = frame_along(ring.axis)[:2]
    flat = (part.vertices_world - mass.center) @ across.T
    widths = np.ptp(flat @ np.array([np.cos(angles), np.sin(angles)]), axis=0)
    return ring if np.ptp(widths) <= config.outline * widths.max() else None


def _rows(ring: _Ring, elements: Sequence[Element], config: BearingConfig) -> Iterator[_Row]:
    """The circles of elements that run along a ring, as a race of theirs."""
    around = _cylindrical(np.array([element.middle for element in elements]), ring.point, ring.axis)
    left = np.ones(len(elements), dtype=bool)
    for k in range(len(elements)):
        near = left & (np.abs(around - around[k]) <= config.circle * around[k, 0]).all(axis=1)
        left &= ~near
        if near.sum() < config.elements:
            continue
        chosen = [element for element, is_near in zip(elements, near, strict=True) if is_near]
        radius, height = (float(value) for value in around[near].mean(axis=0))
        side = _side(ring, radius, height, elements[0], config)
        if side is None or not _is_spread(chosen, ring, config):
            continue
        angles = np.linspace(0.0, 2.0 * np.pi, config.turns, endpoint=False)
        circle = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(config.turns, height)])
        away = ring.distance.query(ring.point + circle @ frame_along(ring.axis)) / elements[0].radius
        if np.ptp(away) <= config.groove and np.abs(away - 1.0).max() <= config.gap:
            names = frozenset(element.part.name for element in chosen)
            yield _Row(ring=ring, side=side, names=names, has_balls=elements[0].is_ball, radius=radius)


def _side(ring: _Ring, radius: float, height: float, element: Element, config: BearingConfig) -> Side | None:
    """On which side of a circle of elements a ring is; None if on none, or if it is more than a race."""
    low, high = ring.cylindrical.min(axis=0), ring.cylindrical.max(axis=0)
    reach, thick = config.beyond * element.radius, config.thick * element.radius
    if high[1] - low[1] > (config.wide if element.is_ball else config.wide_rollers) * element.length:
        return None
    if low[1] <= height <= high[1]:
        if high[0] <= radius + reach and radius - low[0] <= thick:
            return "inner"
        if low[0] >= radius - reach and high[0] - radius <= thick:
            return "outer"
    if element.is_ball and low[0] < radius < high[0] and max(radius - low[0], high[0] - radius) <= thick:
        if high[1] <= height + reach:
            return "below"
        if low[1] >= height - reach:
            return "above"
    return None


def _is_spread(elements: Sequence[Element], ring: _Ring, config: BearingConfig) -> bool:
    """Whether the elements are spread all around the axis."""
    x, y = frame_along(ring.axis)[:2] @ (np.array([element.middle for element in elements]) - ring.point).T
    return widest_gap(np.arctan2(y, x)) <= config.spread * 2.0 * np.pi / len(elements)


def _bearing(assembly: Assembly, run: Sequence[_Row], config: BearingConfig) -> Bearing:
    """The bearing with these rows, each once for each of its races."""
    point, axis = run[0].ring.point, run[0].ring.axis
    elements = {name for row in run for name in row.names}
    races = {row.ring.part.name for row in run}
    reach = np.concatenate([_cylindrical(row.ring.part.vertices_world, point, axis) for row in run])
    bare = Bearing(
        elements=tuple(name for name in assembly.names if name in elements),
        races=tuple(name for name in assembly.names if name in races),
        others=(),
        has_balls=run[0].has_balls,
        point=point,
        axis=axis,
        bounds=np.array([reach.min(axis=0), reach.max(axis=0)]),
    )
    left = [part for part in assembly.parts if part.name not in bare.parts]
    return replace(bare, others=tuple(part.name for part in left if bare.contains(part, config.around)))


def _cylindrical(
    points: Float[np.ndarray, "n 3"], point: Float[np.ndarray, "3"], axis: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "n 2"]:
    """Distance of each point from an axis, and its height along it [m]."""
    offset = points - point
    along = offset @ axis
    return np.column_stack([np.linalg.norm(offset - along[:, None] * axis, axis=1), along])


def _is_within(value: float, limits: tuple[float, float]) -> bool:
    return bool(limits[0] <= value <= limits[1])
