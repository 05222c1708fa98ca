"""What of an input is bought as one thing: bearings, motors, connectors.

Products of the file's tree are told by their names, by rolling elements between races, or by balls that level 1 proves
cannot leave; bearings that are no product of their own, by their shape. Nobody takes these apart, so that they are
planned as one part each.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from sashimono.assembly import Assembly, Kept, Product
from sashimono.bearings import (
    Bearing,
    BearingConfig,
    as_element,
    bearing_words,
    find_bearings,
    find_elements,
    is_between,
)
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.config import SeparateConfig
from sashimono.errors import InputError
from sashimono.plan import Answer
from sashimono.selection import matching, shared_name

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
    """What counts as bought."""

    bearing: BearingConfig = field(default_factory=BearingConfig)
    """What counts as a bearing by its shape."""
    product: float = 0.2
    """How far a part may reach out of the bearing whose product it belongs to, over the rim's radius: a set screw."""
    separate: SeparateConfig = field(default_factory=SeparateConfig)
    """How it is asked whether a ball can leave."""


def find_bought(
    assembly: Assembly, *, keep: Sequence[str] = (), config: BoughtConfig | None = None
) -> tuple[Kept, ...]:
    """Return what stays one part, and why: products, the outer one of nested ones, and bearings that are no product.

    Args:
        assembly: As it was read.
        keep: Names of products, or patterns, that the user wants kept together.
        config: What counts as a bearing.

    Raises InputError for a pattern that no product matches.
    """
    config = config or BoughtConfig()
    bearings = find_bearings(assembly, config=config.bearing)
    names = [product.name for product in assembly.products]
    own: list[str] = []
    for bearing in bearings:
        own.append(shared_name(bearing.parts, {*assembly.names, *names, *own}, "bearing"))
    names += own
    if keep and not names:
        raise InputError(f"--keep {keep[0]}: the file has no products of several parts to keep together. Leave it out.")
    wanted = matching(names, keep, "--keep", what="product") if keep else ()
    products: dict[str, str] = {}
    """Why each of them is kept, by name."""
    taken: list[frozenset[str]] = []
    """The parts of what is kept."""
    for product in assembly.products:
        said = bought_by_name(product.name)
        if (product.name in wanted or said) and not any(outer >= set(product.parts) for outer in taken):
            products[product.name] = "wanted: --keep" if product.name in wanted else f"bought: {said} by its name"
            taken.append(frozenset(product.parts))
    sets = []
    for name, bearing in zip(own, bearings, strict=True):
        product = _product_of(bearing, assembly, config)
        parts = bearing.parts if product is None else frozenset(product.parts)
        if any(parts & other for other in taken):
            continue
        if product is not None:
            products[product.name] = f"bought: {bearing.words}"
        elif all(parts >= set(p.parts) or parts <= set(p.parts) or not parts & set(p.parts) for p in assembly.products):
            members = tuple(member for member in assembly.names if member in parts)
            sets.append(Kept(product=name, reason=f"bought: {bearing.words}", members=members))
        else:
            continue
        taken.append(parts)
    for product in reversed(assembly.products):  # the inner ones first: what a bearing is in is no bearing
        if not any(set(product.parts) & other for other in taken) and (reason := _by_shape(product, assembly, config)):
            products[product.name] = reason
            taken.append(frozenset(product.parts))
    kept = [Kept(product=p.name, reason=products[p.name]) for p in assembly.products if p.name in products]
    return (*kept, *sets)


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


def _product_of(bearing: Bearing, assembly: Assembly, config: BoughtConfig) -> Product | None:
    """The outermost product that is nothing but this bearing; None if there is none."""
    core = {*bearing.elements, *bearing.races}
    for product in assembly.products:
        rest = set(product.parts) - bearing.parts
        if core <= set(product.parts) and all(bearing.contains(assembly.part(n), config.product) for n in rest):
            return product
    return None


def _by_shape(product: Product, assembly: Assembly, config: BoughtConfig) -> str:
    """Why a product is bought by its shape, or "": by elements between any parts, or by a caged ball."""
    for alike in find_elements(assembly, config.bearing, among=product.parts):
        others = [assembly.part(name) for name in product.parts if name not in {e.part.name for e in alike}]
        if is_between(alike, others, config.bearing):
            return f"bought: {bearing_words(len(alike), has_balls=alike[0].is_ball)}"
    elements = (as_element(assembly.part(name), config.bearing) for name in product.parts)
    ball = next((element.part.name for element in elements if element is not None and element.is_ball), None)
    if ball is not None and _is_caged(ball, product, assembly, config):
        return f"bought: {ball} is a ball that provably cannot leave the rest"
    return ""


def _is_caged(name: str, product: Product, assembly: Assembly, config: BoughtConfig) -> bool:
    """Whether level 1 proves that a part cannot leave the rest of its product by translations."""
    alone = Assembly(parts=tuple(assembly.part(member) for member in product.parts))
    cascade = Cascade(alone, make_bodies(alone), config=config.separate)
    stages = (cascade.directions, cascade.translations)
    found = cascade.inquire().separate(alone.index(name), cascade.parts.all_parts, stages=stages)
    return found.answer is Answer.PROVEN_BLOCKED
