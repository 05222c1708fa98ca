"""Products of the file's tree as sets of parts that leave, and are brought, as one.

What a product's own screws join to parts outside of it cannot be put together on a bench of its own: such screws come
later, with the product in place. What is left must hang together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from sashimono.assembly import Assembly, few_words
from sashimono.disassembly.masks import bits, reached
from sashimono.disassembly.sequence.departures import HeldProduct
from sashimono.fasteners.precedence import precedence
from sashimono.fasteners.recognise import Fastener


@dataclass(frozen=True, kw_only=True)
class ProductConfig:
    """Options of planning the file's product tree."""

    enabled: bool = True
    """Whether products are put together by themselves; else all parts are planned side by side."""
    tries: int = 6
    """Most products of which each is taken apart for once, where that makes the order cheaper."""


@dataclass(frozen=True, kw_only=True)
class ProductGroup:
    """A product, as a set of parts to be put together by itself."""

    name: str
    members: int
    """Mask of what is put together."""
    later: tuple[str, ...] = ()
    """Its parts that come after: fasteners that join it to others, and what can be placed only past others."""


@dataclass(frozen=True, kw_only=True)
class Products:
    """The products of an assembly."""

    groups: tuple[ProductGroup, ...] = ()
    """Those that may be put together by themselves, the outer ones first."""
    apart: dict[str, str] = field(default_factory=dict)
    """Why the others are not, by name."""


def product_groups(assembly: Assembly, fasteners: Sequence[Fastener], touching: Callable[[int], int]) -> Products:
    """Return which products of an assembly can be put together by themselves, and why others cannot.

    Args:
        assembly: Its ``products`` are looked at.
        fasteners: What `find_fasteners` found there.
        touching: Returns the mask of the parts that touch one part.
    """
    if not assembly.products:
        return Products()
    index = {name: k for k, name in enumerate(assembly.names)}
    kinds = {f.part: f.kind for f in fasteners}
    before: dict[str, set[str]] = {}
    for first, later in precedence(assembly, fasteners):
        before.setdefault(later, set()).add(first)
    groups: list[ProductGroup] = []
    apart: dict[str, str] = {}
    for product in assembly.products:
        inside = set(product.parts)
        later = [name for name in product.parts if kinds.get(name, "pin") != "pin" and before.get(name, set()) - inside]
        members = sum(1 << index[name] for name in product.parts if name not in later)
        if members.bit_count() < 2:
            first = sorted(before[later[0]] - inside)
            left = few_words([name for name in product.parts if name not in later]) or "nothing"
            why = f"{later[0]} is put on after {few_words(first)}"
            apart[product.name] = f"{left} is left of it without its parts that come later: {why}"
        elif alone := loose_parts(members, touching):
            names = few_words([assembly.names[k] for k in bits(alone)])
            apart[product.name] = f"it does not hang together: {names} touches none of the others"
        elif same := next((group.name for group in groups if group.members == members), None):
            apart[product.name] = f"without what comes later it is the same as {same}"
        else:
            groups.append(ProductGroup(name=product.name, members=members, later=tuple(later)))
    return Products(groups=tuple(groups), apart=apart)


def loose_parts(members: int, touching: Callable[[int], int]) -> int:
    """Return the mask of a smaller piece of parts that do not hang together; 0 if they do."""
    seen = reached(members & -members, members, touching)
    return min((seen, members & ~seen), key=lambda piece: piece.bit_count()) if seen != members else 0


def whole_groups(groups: Sequence[ProductGroup], remaining: int) -> tuple[ProductGroup, ...]:
    """Return the products that are whole among the remaining parts, though not all of these, the outermost only."""
    whole = [g for g in groups if not g.members & ~remaining and g.members != remaining]
    return tuple(g for g in whole if not any(g is not h and g.members & ~h.members == 0 for h in whole))


def cut_down(
    groups: Sequence[ProductGroup],
    held: HeldProduct,
    names: Sequence[str],
    touching: Callable[[int], int],
) -> tuple[ProductGroup, ...] | None:
    """Return the products with a held one cut down to its core; None if nothing is left of it.

    The rest comes later: a key at the end of a shaft, once the cover is on. Products inside lose it too.

    Args:
        groups: Products.
        held: One of these.
        names: Of the parts.
        touching: Returns the mask of the parts that touch one part.
    """
    whole = next(group for group in groups if group.name == held.name)
    out = []
    for group in groups:
        members = group.members
        if not members & ~whole.members:
            members &= held.core
        if members.bit_count() < 2 or loose_parts(members, touching) or members in [other.members for other in out]:
            if group is whole:
                return None
            continue
        later = tuple(names[part] for part in bits(group.members & ~members))
        out.append(replace(group, members=members, later=(*group.later, *later)))
    return tuple(out)


def base_group_waits(groups: Sequence[ProductGroup], base: int, start: int, count: int) -> tuple[int, ...]:
    """Return, by part, the mask of the parts that leave before it because the base is in a product with it.

    That product is put together first, where it stands.

    Args:
        groups: Products.
        base: Position of the base.
        start: Mask of the parts that are there at first.
        count: Number of parts.
    """
    waits = [0] * count
    for group in groups:
        if group.members >> base & 1 and not group.members & ~start:
            for part in bits(group.members):
                waits[part] |= start & ~group.members
    return tuple(waits)
