"""The product tree: which parts the file's own structure puts together."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from sashimono.assembly import Product
from sashimono.io.names import choose_name, says_nothing, unique_names
from sashimono.io.raw import Occurrence

_INSTANCE = re.compile(r"\s*(:\d+|<\d+>)$")
"""How CAD programs number the uses of a product: "hemera v8:1", "gears <2>"."""


def find_products(above: Mapping[str, Sequence[Occurrence]]) -> tuple[Product, ...]:
    """Return the nested products of at least two parts, but not of all, the outer ones first.

    A product that holds nothing but another one is the same as that. Names are cleared of the numbers that CAD programs
    give to uses, and are unique among products and parts.

    Args:
        above: By part, in order: the uses of products around it, the outermost first.
    """
    parts: dict[int, list[str]] = {}
    said: dict[int, str] = {}
    for name, around in above.items():
        for use in around:
            parts.setdefault(use.number, []).append(name)
            said[use.number] = use.name
    names: dict[tuple[str, ...], list[str]] = {}
    for number, members in parts.items():
        if 1 < len(members) < len(above):
            names.setdefault(tuple(members), []).append(_INSTANCE.sub("", said[number]))
    place = {name: k for k, name in enumerate(above)}
    sets = sorted(names, key=lambda members: (-len(members), place[members[0]]))
    chosen = unique_names([choose_name([n for n in names[m] if not says_nothing(n)] or ["product"]) for m in sets])
    return tuple(
        Product(name=_unlike(name, set(above)), parts=members) for name, members in zip(chosen, sets, strict=True)
    )


def _unlike(name: str, taken: set[str]) -> str:
    while name in taken:
        name = f"{name}_product"
    return name
