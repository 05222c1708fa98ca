"""What else could have come at each step, and why it did not: the order's own neighbours, counted by the same cost.

A part that is placed later could always come earlier as far as its own motion goes: fewer parts never block more. What
may stand against it are the parts between, which must then be brought past it; the user's wishes; and the cost.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.sequence.constraints import ResolvedConstraints
from sashimono.disassembly.sequence.cost import Amounts, CostModel
from sashimono.disassembly.sequence.moves import Blocked, earlier_in
from sashimono.disassembly.sequence.ways import Candidate, Unit, Ways
from sashimono.plan import Alternative

WORDS = {
    "held": "held parts",
    "hands_missing": "hands missing",
    "not_from_above": "not from above",
    "from_below": "from below",
    "direction_changes": "changes of direction",
    "interrupted_runs": "interrupted runs",
    "fasteners_late": "fasteners later than needed",
    "fasteners_out_of_turn": "fasteners out of turn",
    "slides": "slides",
    "apart": "parts that touch nothing",
    "base": "base",
    "unsteady": "unsteady base",
    "fixture": "fixture",
    "turned": "table turned",
    "turn_overs": "turn-overs",
    "turned_loose": "loose parts turned over",
    "parted": "parts between those wanted together",
    "products_apart": "products taken apart",
    "tools_blocked": "tools without room",
}
"""The terms of the cost, in words."""


class Alternatives:
    """Asks of one order what else could have come."""

    def __init__(
        self,
        candidate: Candidate,
        start: int,
        ways: Callable[[Float[np.ndarray, "3"]], Ways],
        model: CostModel,
        wishes: ResolvedConstraints,
        amounts: Callable[[Candidate], Amounts],
        *,
        most: int,
    ) -> None:
        """Take in an order.

        Args:
            candidate: The order, of taking apart.
            start: Mask of all its parts.
            ways: Ways out, by the direction away from the table.
            model: The cost.
            wishes: What the user wants.
            amounts: Counts the terms of an order.
            most: Later parts looked at for each step: the next ones.
        """
        self._candidate = candidate
        self._start = start
        self._ways = ways
        self._model = model
        self._wishes = wishes
        self._amounts = amounts
        self._most = most
        self._own = amounts(candidate)

    def of_step(self, place: int) -> tuple[Alternative, ...]:
        """Return the alternatives to what is placed as the ``place``-th of the moving parts, from 0, in assembly."""
        leaving = self._candidate.leaving
        own = len(leaving) - 1 - place
        alike = self._model.scene.alike_to(leaving[own].unit.members)
        out = []
        for later in range(own - 1, max(-1, own - 1 - self._most), -1):
            if not leaving[later].unit.members & alike:
                out.append(self._instead(own, later))
        return tuple(out)

    def _instead(self, own: int, later: int) -> Alternative:
        """The order in which what leaves as number ``later`` leaves just after number ``own``."""
        leaving = self._candidate.leaving
        name = self._name(leaving[later].unit)
        order = earlier_in(self._candidate, later, own, start=self._start, ways=self._ways, wishes=self._wishes)
        if isinstance(order, Blocked):
            other = self._name(order.unit)
            if order.by_turn:
                reason = "it is placed once the product has been turned over"
            elif order.by_wish:
                reason = f"--before has {other} placed earlier"
            else:
                reason = f"with it in place no way is known by which {other} gets in"
            return Alternative(part=name, possible=False, more=None, reason=reason)
        amounts = self._amounts(order)
        more = round(self._model.total(amounts) - self._model.total(self._own), 6)
        return Alternative(part=name, possible=True, more=more, reason=self._difference(amounts))

    def _difference(self, amounts: Mapping[str, float]) -> str:
        weights = self._model.config.weights
        changes = {term: amounts.get(term, 0.0) - self._own.get(term, 0.0) for term in WORDS}
        ranked = sorted(WORDS, key=lambda term: (-round(weights[term] * changes[term], 6), term))
        words = [f"{WORDS[term]} {changes[term]:+.3g}" for term in ranked if abs(changes[term]) > 1e-6]
        return ", ".join(words) or "costs the same"

    def _name(self, unit: Unit) -> str:
        return self._model.scene.names[unit.part]
