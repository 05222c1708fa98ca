"""Taking a product apart along the file's product tree, where that is possible and does not cost more."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from jaxtyping import Float
from numpy import ndarray

from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.refusal import Refusal
from sashimono.disassembly.sequence.departures import DisassemblyResult, HeldProduct
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.sequence.order import Orderer
from sashimono.disassembly.sequence.products import ProductGroup, Products, cut_down


@dataclass(frozen=True, kw_only=True, eq=False)
class TakenApart:
    """An order of taking apart, and what became of the products."""

    found: DisassemblyResult
    groups: tuple[ProductGroup, ...] = ()
    """The products that leave as one; that with the base in it comes apart last."""
    apart: Mapping[str, str] = field(default_factory=dict)
    """Why the others do not, by name."""


def take_apart_by_products(
    cascade: Cascade,
    orderer: Orderer,
    products: Products,
    *,
    config: SequenceConfig,
    refused: frozenset[Refusal],
    up: Sequence[float] | Float[ndarray, "3"] | None,
    searched: bool,
    progress: Callable[[int], None] = lambda removed: None,
) -> TakenApart:
    """Return the cheapest order found in which as many products as possible leave as one.

    A product is taken apart with all other parts where it cannot leave as one, or where the order costs less that way.

    Args:
        cascade: Level 1.
        orderer: Improves orders and knows what they cost.
        products: What may leave as one.
        config: Taste.
        refused: Ways out that are not to be taken.
        up: Away from the table, where that is given.
        searched: Whether orders are searched for and compared; else the first possible one is taken.
        progress: Called with the number of parts that have left so far.
    """

    def ordered(groups: tuple[ProductGroup, ...]) -> tuple[DisassemblyResult, tuple[ProductGroup, ...], dict[str, str]]:
        held: dict[str, str] = {}
        while True:
            found = find_disassembly(
                cascade, config=config, refused=refused, products=groups, patient=patient, progress=progress
            )
            if not (now := _held_products(found)):
                break
            for entry in now:
                less = cut_down(groups, entry, cascade.assembly.names, cascade.touching)
                if less is None:
                    held[entry.name] = entry.reason
                    less = tuple(group for group in groups if group.name != entry.name)
                lost = {group.name for group in groups} - {group.name for group in less} - {entry.name}
                held |= dict.fromkeys(lost, f"what is left of it comes with {entry.name}, or later")
                groups = less
        if searched:
            found = orderer.improve(found, refused=refused, up=up, products=groups)
        return found, groups, held

    def cost(found: DisassemblyResult, groups: Sequence[ProductGroup]) -> float:
        apart = len(products.groups) - len(groups)
        return round(orderer.search_cost(found, groups) + config.cost.products_apart * apart, 6)

    # what leaves only by physics or tilting among all parts is asked about them along the tree too, and nothing else
    patient: int | None = None
    flat, _, _ = ordered(())
    late = (cascade.physics.name, cascade.tilting.name)
    patient = sum(d.members for d in flat.departures() if d.inside is None and d.separation.stage in late)
    found, groups, apart = ordered(products.groups)
    if not (searched and groups) or found.stuck:
        return TakenApart(found=found, groups=groups, apart=apart)
    least = cost(found, groups)
    if flat.stuck or cost(flat, ()) >= least:
        return TakenApart(found=found, groups=groups, apart=apart)
    for group in groups[: config.products.tries]:
        fewer = tuple(other for other in groups if other is not group)
        tried, left, held = ordered(fewer)
        if (less := cost(tried, left)) < least:
            apart |= {group.name: f"taken apart, the order costs {least - less:.3g} less"} | held
            found, groups, least = tried, left, less
    if groups and (less := cost(flat, ())) < least:
        apart |= {
            group.name: f"with all parts side by side, the order costs {least - less:.3g} less" for group in groups
        }
        found, groups = flat, ()
    return TakenApart(found=found, groups=groups, apart=apart)


def _held_products(found: DisassemblyResult) -> list[HeldProduct]:
    """The products that could not leave as one, here and inside others."""
    inside = [entry for d in found.removals if d.inside is not None for entry in _held_products(d.inside)]
    return [*found.held_products, *inside]
