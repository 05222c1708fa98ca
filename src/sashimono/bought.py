"""Which products of the file's tree are bought as one thing: bearings, motors, connectors.

They are told by their names, by rolling elements between races, or by balls that level 1 proves cannot leave. Nobody
takes them apart, so that they are planned as one part each.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Kept, Part, Product
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.config import SeparateConfig
from sashimono.errors import InputError
from sashimono.geometry.mesh import measures
from sashimono.plan import Answer
from sashimono.selection import matching

_DESIGNATIONS = {
    "a ball bearing": r"6\d{2,4}[ _-]?(zz|2z|z|2rsr?|2rsh|rs|ddu|dd|llu|llb|vv|uu)|6[02389]\d{1,3}",
    "a linear bearing": r"lm[a-z]{0,3}\d{1,2}l?uu|scs\d{1,2}l?uu",
    "a pillow block": r"(kp|kfl|ucp|ucf|ucfl)\d{2,3}",
    "a linear guide": r"(mgn|mgw|hgr|hgh|hgw|egr|egh|sbr)\d{1,2}[a-z]{0,2}",
    "a stepper motor": r"nema[ _-]?\d{1,2}|28byj([ _-]?48)?",
    "a servo": r"(sg|mg|ds)\d{2,4}[a-z]?|[xm][lmhw]\d{3}",
    "a connector": r"jst|molex|xt\d{2}|rj\d{2}|d[ _-]?sub|usb",
}
"""Standard names, whole words of a name, in lower case."""

_NOUNS = {
    "a bearing": "bearing bearings ballbearing lager kugellager roulement rodamiento cuscinetto",
    "a motor": "motor servomotor gearmotor stepper moteur getriebemotor schrittmotor gearhead",
    "a servo": "servo",
    "a connector": "connector steckverbinder connecteur",
    "an encoder": "encoder",
    "a solenoid": "solenoid",
}
"""What a name says that ends in such a word: a "Motor Mount" is no motor."""


@dataclass(frozen=True, kw_only=True)
class BoughtConfig:
    """What counts as a bearing by its shape."""

    round: float = 0.04
    """How much the extents of a ball, or across a roller, may differ, over their size."""
    ball_volume: tuple[float, float] = (0.85, 1.02)
    """Volume of a ball over that of a sphere of its extent: facets take some away."""
    roller_volume: tuple[float, float] = (0.7, 1.02)
    """The same of a roller, over a cylinder: chamfers and tapers take some away."""
    elements: int = 5
    """Fewest rolling elements of a bearing."""
    circle: float = 0.03
    """How far their middles may be off a circle, over its radius."""
    race: float = 0.4
    """How far a race may reach past the circle of the middles, over the radius of an element."""
    separate: SeparateConfig = field(default_factory=SeparateConfig)
    """How it is asked whether a ball can leave."""


def find_bought(
    assembly: Assembly, *, keep: Sequence[str] = (), config: BoughtConfig | None = None
) -> tuple[Kept, ...]:
    """Return the products of an assembly that stay one part each, and why; the outer one of nested ones.

    Args:
        assembly: As it was read.
        keep: Names of products, or patterns, that the user wants kept together.
        config: What counts as a bearing.

    Raises InputError for a pattern that no product matches.
    """
    config = config or BoughtConfig()
    names = [product.name for product in assembly.products]
    if keep and not names:
        raise InputError(f"--keep {keep[0]}: the file has no products of several parts to keep together. Leave it out.")
    wanted = matching(names, keep, "--keep", what="product") if keep else ()
    found: list[tuple[Product, str]] = []
    for product in assembly.products:
        if any(set(product.parts) < set(outer.parts) for outer, _ in found):
            continue
        if product.name in wanted:
            reason = "wanted: --keep"
        else:
            said = bought_by_name(product.name)
            reason = f"bought: {said} by its name" if said else _by_shape(product, assembly, config)
        if reason:
            found.append((product, reason))
    return tuple(Kept(product=product.name, reason=reason) for product, reason in found)


def bought_by_name(name: str) -> str | None:
    """Return what a name says that is bought as one ("a bearing"); None if it says no such thing."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    parts = [part for part in re.split(r"[^a-z0-9]+", text) if part]
    for said, pattern in _DESIGNATIONS.items():
        one = re.compile(pattern)
        pairs = [f"{a} {b}" for a, b in pairwise(parts)]
        bare = said == "a ball bearing" and len(parts) > 1
        words = [word for word in (*parts, *pairs) if not (bare and word.isdigit())]
        if any(one.fullmatch(word) for word in words):
            return said
    words = [word for word in re.findall(r"[a-z]+", re.sub(r"\([^)]*\)", " ", text)) if word not in ("v", "rev", "mm")]
    for said, nouns in _NOUNS.items():
        if words and words[-1] in nouns.split():
            return said
    return None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Element:
    """A ball or a roller."""

    part: Part
    is_ball: bool
    radius: float
    """[m]"""
    middle: Float[np.ndarray, "3"]
    """World [m]."""


def _by_shape(product: Product, assembly: Assembly, config: BoughtConfig) -> str:
    """Why a product is bought by its shape, or ""."""
    classes = [tuple(name for name in names if name in product.parts) for names in assembly.identical]
    alike = [[element for name in names if (element := _element(assembly.part(name), config))] for names in classes]
    for elements in alike:
        if len(elements) >= config.elements:
            others = [assembly.part(name) for name in product.parts if name not in {e.part.name for e in elements}]
            if _between_races(elements, others, config):
                kind = "balls" if elements[0].is_ball else "rollers"
                return f"bought: a bearing, {len(elements)} {kind} between races"
    balls = [e for name in product.parts if (e := _element(assembly.part(name), config)) is not None and e.is_ball]
    if balls and _is_caged(balls[0].part.name, product, assembly, config):
        return f"bought: {balls[0].part.name} is a ball that provably cannot leave the rest"
    return ""


def _element(part: Part, config: BoughtConfig) -> _Element | None:
    """The part as a rolling element; None if it is none."""
    mass = measures.mass_properties(part.vertices_world, part.faces)
    edges = np.sort(np.ptp(part.vertices_part, axis=0))
    if edges[2] - edges[0] > config.round * edges[2] or not _is_within(
        mass.volume / (np.pi / 6.0 * float(np.mean(edges)) ** 3), config.ball_volume
    ):
        edges = np.sort(measures.inertia_extents(part.vertices_part, part.faces))
        across = [(edges[0], edges[1], edges[2]), (edges[1], edges[2], edges[0])]
        for a, b, length in across:
            if b - a <= config.round * b and _is_within(
                mass.volume / (np.pi / 4.0 * a * b * length), config.roller_volume
            ):
                return _Element(part=part, is_ball=False, radius=float(a) / 2.0, middle=mass.center)
        return None
    return _Element(part=part, is_ball=True, radius=float(edges[0]) / 2.0, middle=mass.center)


def _is_within(value: float, limits: tuple[float, float]) -> bool:
    return bool(limits[0] <= value <= limits[1])


def _between_races(elements: Sequence[_Element], others: Sequence[Part], config: BoughtConfig) -> bool:
    """Whether rolling elements lie on a circle, with one part inside of it and one outside, or one on either side."""
    middles = np.array([element.middle for element in elements])
    center = middles.mean(axis=0)
    axis = np.linalg.svd(middles - center)[2][2]
    around = np.linalg.norm(middles - center, axis=1)
    circle = float(around.mean())
    flat = np.abs((middles - center) @ axis).max()
    if max(np.ptp(around), flat) > config.circle * circle:
        return False
    reach = config.race * elements[0].radius
    inner = outer = below = above = False
    for part in others:
        offset = part.vertices_world - center
        along = offset @ axis
        radii = np.linalg.norm(offset - along[:, None] * axis, axis=1)
        near = float(radii.max()) > circle - 3.0 * elements[0].radius
        inner = inner or (bool(radii.max() <= circle + reach) and near)
        outer = outer or bool(radii.min() >= circle - reach)
        spans = bool(radii.min() < circle < radii.max())
        below = below or (spans and bool(along.max() <= reach))
        above = above or (spans and bool(along.min() >= -reach))
    return (inner and outer) or (below and above and elements[0].is_ball)


def _is_caged(name: str, product: Product, assembly: Assembly, config: BoughtConfig) -> bool:
    """Whether level 1 proves that a part cannot leave the rest of its product by translations."""
    alone = Assembly(parts=tuple(assembly.part(member) for member in product.parts))
    cascade = Cascade(alone, make_bodies(alone), config=config.separate)
    stages = (cascade.directions, cascade.translations)
    found = cascade.inquire().separate(alone.index(name), cascade.parts.all_parts, stages=stages)
    return found.answer is Answer.PROVEN_BLOCKED
