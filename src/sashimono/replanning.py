"""A plan that is not complete is planned again, as its reasons suggest: what cannot come apart as one, or not at all.

Parts of several solids are taken apart, as ``--split all`` does. Parts that are caged in another one stay together with
it, as bought. Either is kept if it gives more. The plan's notes say what was tried.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

from sashimono.assembly import Assembly, Kept, few_words
from sashimono.caged import find_caged
from sashimono.errors import SashimonoError
from sashimono.geometry.mesh import measures, topology
from sashimono.io.kept import keep_together
from sashimono.plan import AssemblyPlan

LEAST_GAIN = 1e-3
"""A plan that leaves less is better, if it is less by more than this share."""
MAX_SOLIDS = 60
"""Most parts that ``--split all`` may add, tried by itself: a plug may have a solid for each of its pins."""
MAX_CAGES = 4
"""Most times that parts are looked for that are caged in others: a cage may be caged in turn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Input:
    """What is planned: the parts as they were read, and what of them stays together."""

    apart: Assembly
    kept: tuple[Kept, ...] = ()

    @cached_property
    def assembly(self) -> Assembly:
        """The parts to plan."""
        return keep_together(self.apart, self.kept)


def plan_as_suggested(
    given: Input,
    plan: Callable[[Assembly], AssemblyPlan],
    *,
    split: Callable[[], Input] | None,
    cages: bool,
    note: Callable[[str], None] = lambda remark: None,
) -> tuple[Assembly, AssemblyPlan]:
    """Return the parts and their plan; where that is not complete, the best of what its reasons suggest.

    A plan is better if it is complete, or if what it leaves without a step is less by volume.

    Args:
        given: What is planned.
        plan: Plans an assembly.
        split: Reads the same with every part taken apart into its solids; None: not to be tried.
        cages: Whether parts that are caged in others may stay together with them.
        note: Called with what is tried.
    """
    assembly = given.assembly
    best = given, assembly, plan(assembly)
    several = _parts_of_several_solids(given, best[2]) if split is not None else {}
    if split is not None and several:
        words = few_words([f"{name} is {count} separate solids" for name, count in several.items()])
        best = _better(
            best, plan, partial(_split_further, given, split), f"planned again with --split all: {words}", note
        )
    for _ in range(MAX_CAGES if cages else 0):
        given, assembly, found = best
        caged = find_caged(assembly, found.unsolved)
        if caged:
            tried = f"planned again with caged parts kept together: {few_words([entry.product for entry in caged])}"
            best = _better(best, plan, partial(_kept_too, given, caged), tried, note)
        if best[0] is given:
            break
    return best[1:]


_Best = tuple[Input, Assembly, AssemblyPlan]


def _better(
    best: _Best,
    plan: Callable[[Assembly], AssemblyPlan],
    change: Callable[[], Input],
    remark: str,
    note: Callable[[str], None],
) -> _Best:
    """The changed input planned, if that is better; else what there was. The plan has the remark, and all seconds."""
    given, known, known_plan = best
    note(remark)
    try:
        changed = change()
        changed = replace(changed, apart=replace(changed.apart, notes=(*changed.apart.notes, remark)))
        assembly = changed.assembly
        found = plan(assembly)
    except SashimonoError as error:  # a wish names a part that is not there then, or nothing is left to assemble
        return given, known, replace(known_plan, notes=(*known_plan.notes, f"{remark}: {error}"))
    seconds = dict(Counter(known_plan.timings) + Counter(found.timings))
    if found.status == "complete" or _left(assembly, found) < (1.0 - LEAST_GAIN) * _left(known, known_plan):
        return changed, assembly, replace(found, timings=seconds)
    return given, known, replace(known_plan, timings=seconds, notes=(*known_plan.notes, f"{remark}: no better"))


def _left(assembly: Assembly, plan: AssemblyPlan) -> float:
    """The volume of the parts without a step [m³]."""
    parts = (assembly.part(entry.part) for entry in plan.unsolved)
    return sum(measures.volume(part.vertices_part, part.faces) for part in parts)


def _split_further(given: Input, split: Callable[[], Input]) -> Input:
    """The input with all solids apart; SashimonoError if these are too many to try."""
    apart = split()
    if len(apart.apart) > len(given.apart) + MAX_SOLIDS:
        raise SashimonoError(f"not tried, it has {len(apart.apart)} parts then")
    return apart


def _kept_too(given: Input, caged: Sequence[Kept]) -> Input:
    """The input with these sets of its parts kept together as well."""
    members = {entry.product: _members(entry, given.apart) for entry in given.kept}
    new = [
        replace(entry, members=tuple(n for name in entry.members for n in members.get(name, (name,))))
        for entry in caged
    ]
    swallowed = {n for entry in new for n in _members(entry, given.apart)}
    left = [entry for entry in given.kept if not swallowed >= set(members[entry.product])]
    return replace(given, kept=(*left, *new))


def _members(entry: Kept, assembly: Assembly) -> tuple[str, ...]:
    """The parts of what is kept."""
    return entry.members or next(product.parts for product in assembly.products if product.name == entry.product)


def _parts_of_several_solids(given: Input, plan: AssemblyPlan) -> dict[str, int]:
    """How many solids each part has that is without a step, or in the way of one, if several; what is kept aside."""
    held = {entry.part for entry in plan.unsolved} | {name for entry in plan.unsolved for name in entry.blocked_by}
    held -= {entry.product for entry in given.kept}
    counts = {}
    for part in given.assembly.parts:
        if part.name in held and topology.shells(part.faces).max() > 0:
            count = len(topology.split_solids(part.vertices_part, part.faces))
            if count > 1:
                counts[part.name] = count
    return counts
