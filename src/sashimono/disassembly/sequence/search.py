"""The order that costs least, of a work-bounded search over ways out that level 1 answers for.

The greedy order comes first: it says what comes apart at all. Then, for a few bases and tables, orders of taking apart
grow part by part, the cheapest of them kept (a beam). No set of parts is a dead end while the base is that of the
greedy order: whichever of its parts left first is free of what remains, for fewer parts never block more. The best few
are counted again with all held parts by linear programs, the greedy order among them: the result is never dearer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.refusal import Refusal
from sashimono.disassembly.sequence.alternatives import Alternatives
from sashimono.disassembly.sequence.constraints import ResolvedConstraints
from sashimono.disassembly.sequence.cost import START_TERMS, CostModel
from sashimono.disassembly.sequence.departures import Departure, DisassemblyResult, Turn
from sashimono.disassembly.sequence.holds import Contacts
from sashimono.disassembly.sequence.products import ProductGroup
from sashimono.disassembly.sequence.search_config import OrderSearchConfig
from sashimono.disassembly.sequence.search_run import SearchRun, SearchSite
from sashimono.disassembly.sequence.ways import Candidate
from sashimono.plan import Alternative


class OrderSearch:
    """Searches orders of one assembly. What it has found once it does not ask again."""

    def __init__(
        self,
        cascade: Cascade,
        contacts: Contacts,
        model: CostModel,
        wishes: ResolvedConstraints,
        *,
        config: OrderSearchConfig,
    ) -> None:
        self._site = SearchSite(cascade=cascade, contacts=contacts, model=model, wishes=wishes, config=config)

    def improve(
        self,
        found: DisassemblyResult,
        *,
        start: int,
        refused: frozenset[Refusal] = frozenset(),
        up: Float[np.ndarray, "3"] | None = None,
        products: Sequence[ProductGroup] = (),
        top: bool = True,
    ) -> DisassemblyResult:
        """Return a disassembly of the same parts that costs least of those looked at, with the table it is for.

        Args:
            found: The greedy one, which takes none of the ways that are refused.
            start: Mask of the parts that were there.
            refused: Ways out that are not to be taken.
            up: Away from the table, where that is given; else the search chooses.
            products: What leaves as one; that with the base in it comes apart last.
            top: Whether this is the whole product, of which the user may have named the base.
        """
        removals = tuple(self._inside(departure, refused, products) for departure in found.removals)
        found = replace(found, removals=removals)
        if not removals or any(departure.simultaneous for departure in removals):
            return found  # an order grows part by part, and some of these leave only together
        run = SearchRun(self._site, found, start, refused, up, products)
        may_turn = top and up is None
        mended = run.mended()
        if mended is None or not mended[1]:
            candidates: list[Candidate] = [] if mended is None else [mended[0]]
            alive, dead = 0, 0
            for first in run.starts(top):
                if alive == self._site.config.starts:
                    break
                if dead >> first.base.bit_length() - 1 & 1:
                    continue
                grown = run.grow(first.base, first.up, run.expected(first), width=run.width)
                alive += bool(grown)
                # what level 1 saw leave only without it may be held by another base, on whatever table
                dead |= 0 if grown else first.base
                candidates += grown
            best = run.best(candidates, may_turn=may_turn)
        else:
            best = run.best([mended[0]], may_turn=False)
        run.remember(best)
        return found if best is None else run.result(best)

    def alternatives(
        self,
        found: DisassemblyResult,
        *,
        start: int,
        refused: frozenset[Refusal],
        up: Float[np.ndarray, "3"],
        turn: Turn | None = None,
        products: Sequence[ProductGroup] = (),
    ) -> dict[int, tuple[Alternative, ...]]:
        """Return what else could have come in place of each departure, by its part; inside subassemblies aside.

        Args:
            found: The disassembly that was taken.
            start: Mask of the parts that were there.
            refused: Ways out that are not to be taken.
            up: Away from the table that it begins on, unit.
            turn: Where the product is turned over.
            products: What leaves as one.
        """
        if any(departure.simultaneous for departure in found.removals):
            return {}
        run = SearchRun(self._site, found, start, refused, up, products)
        order = replace(run.greedy(up), turn=turn)
        asked = Alternatives(
            order,
            start,
            run.ways,
            self._site.model,
            run.wishes,
            lambda candidate: run.amounts(candidate, exact=False),
            most=self._site.config.explained,
        )
        count = len(order.leaving)
        return {order.leaving[count - 1 - k].unit.part: asked.of_step(k) for k in range(count)}

    def cost(
        self, found: DisassemblyResult, *, start: int, products: Sequence[ProductGroup] = (), top: bool = True
    ) -> float:
        """Return what an order costs that `improve` returned, held parts as far as they are bounded.

        Of what is inside subassemblies, bases and tables do not count, as in the cost of a plan.
        """
        model = self._site.model
        up = model.scene.up if found.up is None else np.array(found.up)
        run = SearchRun(self._site, found, start, frozenset(), up, products)
        amounts = run.amounts(replace(run.greedy(up), turn=found.turn), exact=False)
        if not top:
            amounts = {term: amount for term, amount in amounts.items() if term not in START_TERMS}
        below = (d for d in found.removals if d.inside is not None and d.inside.removals)
        return model.total(amounts) + sum(
            self.cost(d.inside, start=d.members, products=products, top=False) for d in below if d.inside is not None
        )

    def _inside(self, departure: Departure, refused: frozenset[Refusal], products: Sequence[ProductGroup]) -> Departure:
        """The departure, what it moves being put together by the cheapest order too."""
        if departure.inside is None:
            return departure
        inside = self.improve(departure.inside, start=departure.members, refused=refused, products=products, top=False)
        return replace(departure, inside=inside, part=inside.base)
