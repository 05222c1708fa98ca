"""Several parts asked as one part: do they leave the others together, by translations or along a thread?

Physics and tilting are not asked. They take seconds for each set that is held, and what comes apart along the product
tree does not need them; where one part does, it leaves by them alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_body, merge_parts
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_removal
from sashimono.disassembly.separation import Separation, names_of
from sashimono.geometry.body import Body
from sashimono.plan import Answer


class BodiesAsOne:
    """Asks level 1 about sets of parts as one part each. Made when first asked for: it costs a cascade a set."""

    def __init__(self, cascade: Cascade) -> None:
        self._cascade = cascade
        self._merged: dict[tuple[int, int], Separation] = {}
        self._in_two: dict[tuple[int, int], Separation] = {}
        self.last: dict[int, Separation] = {}
        """What was said when a set was last asked, by its mask."""

    def separate(self, members: int, remaining: int) -> Separation:
        """Return what is known about these members, as one part, among the remaining parts (a mask)."""
        key = (members, remaining)
        if key not in self._merged:
            others = bits(remaining & ~members)
            assembly, parts = self._cascade.assembly, self._cascade.parts
            found = self._ask([self._as_one(members), *((assembly.parts[k], parts.bodies[k]) for k in others)])
            self._merged[key] = replace(found, blocked_by=tuple(others[k - 1] for k in found.blocked_by))
        self.last[members] = self._merged[key]
        return self._merged[key]

    def in_two(self, members: int, remaining: int) -> Separation:
        """Return how the remaining parts come apart in two: these members, and the others as one part as well.

        Whichever of the two moves, as of any two parts. What is found holds for each of the parts by itself, too.
        """
        key = (members, remaining)
        if key not in self._in_two:
            others = remaining & ~members
            found = self._ask([self._as_one(members), self._as_one(others)])
            parts = self._cascade.parts
            if found.removal is not None and any(
                hit_by_removal(parts, part, found.removal, bits(others)) for part in bits(members)
            ):
                found = Separation(answer=Answer.UNKNOWN, reason="a way out was found that is too tight for a part")
            self._in_two[key] = found
        return self._in_two[key]

    def _as_one(self, members: int) -> tuple[Part, Body]:
        assembly, parts = self._cascade.assembly, self._cascade.parts
        names = names_of(assembly, bits(members))
        if len(names) == 1:
            return assembly.part(names[0]), parts.bodies[bits(members)[0]]
        merged = merge_parts([assembly.part(name) for name in names], names[0])
        return merged, make_body(merged, rng=np.random.default_rng(0))

    def _ask(self, given: list[tuple[Part, Body]]) -> Separation:
        """What is known about the first of some parts among the others."""
        asked = Assembly(parts=tuple(part for part, _ in given))
        cascade = Cascade(asked, {part.name: body for part, body in given}, config=self._cascade.config)
        stages = (cascade.directions, cascade.threads, cascade.translations)
        found = cascade.inquire().separate(0, cascade.parts.all_parts, stages=stages)
        if found.answer is not Answer.FREE:
            return found
        return Separation(answer=Answer.FREE, removal=found.removal, stage=found.stage)
