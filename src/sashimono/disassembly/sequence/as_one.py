"""Several parts asked as one part: do they leave the others together, by translations or along a thread?

Physics and tilting are not asked. They take seconds for each set that is held, and what comes apart along the product
tree does not need them; where one part does, it leaves by them alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sashimono.assembly import Assembly
from sashimono.bodies import make_body, merge_parts
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.disassembly.separation import Separation, names_of
from sashimono.plan import Answer


class BodiesAsOne:
    """Asks level 1 about sets of parts as one part each. Made when first asked for: it costs a cascade a set."""

    def __init__(self, cascade: Cascade) -> None:
        self._cascade = cascade
        self._merged: dict[tuple[int, int], Separation] = {}
        self.last: dict[int, Separation] = {}
        """What was said when a set was last asked, by its mask."""

    def separate(self, members: int, remaining: int) -> Separation:
        """Return what is known about these members, as one part, among the remaining parts (a mask)."""
        key = (members, remaining)
        if key not in self._merged:
            self._merged[key] = self._ask(members, bits(remaining & ~members))
        self.last[members] = self._merged[key]
        return self._merged[key]

    def _ask(self, members: int, others: list[int]) -> Separation:
        assembly, parts = self._cascade.assembly, self._cascade.parts
        names = names_of(assembly, bits(members))
        merged = merge_parts([assembly.part(name) for name in names], names[0])
        bodies = {assembly.names[k]: parts.bodies[k] for k in others}
        bodies[merged.name] = make_body(merged, rng=np.random.default_rng(0))
        asked = Assembly(parts=(merged, *(assembly.parts[k] for k in others)))
        cascade = Cascade(asked, bodies, config=self._cascade.config)
        stages = (cascade.directions, cascade.threads, cascade.translations)
        found = cascade.inquire().separate(0, cascade.parts.all_parts, stages=stages)
        if found.answer is not Answer.FREE:
            return replace(found, blocked_by=tuple(others[k - 1] for k in found.blocked_by))
        return Separation(answer=Answer.FREE, removal=found.removal, stage=found.stage)
