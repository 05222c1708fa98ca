"""All minimal clauses of a part by duality: each "free" gives a clause, each "held" a few parts that hold it.

What a part can leave from is monotone: fewer obstacles never block more. So its minimal clauses (sets of parts to be
gone) are the minimal hitting sets of its minimal cores (sets of parts that hold it). A hitting set of the cores known
so far that covers no known clause is a question: asked without these parts, the answer is a new clause or a new core
(Liffiton et al., "Fast, flexible MUS enumeration", 2016). No set is asked twice, nor one that a core or clause decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from sashimono.disassembly.conditions.clauses import minimal


@dataclass(frozen=True, kw_only=True)
class SetAnswer:
    """What a stage says of one set of obstacles."""

    clause: int | None = None
    """If the part is free: the parts that must be gone for the motion found. None of them is an obstacle."""
    core: int = 0
    """If it is not: obstacles that hold it by themselves."""
    is_proven: bool = True
    """Whether that is proven, or all that is known is that no motion was found."""


@dataclass(frozen=True, kw_only=True)
class Enumeration:
    """All clauses that were found, and whether they are all there are."""

    clauses: tuple[int, ...]
    """Minimal masks, those known before included."""
    cores: tuple[int, ...]
    """Masks of parts that hold the part, as they were found."""
    is_complete: bool
    """Whether these are all clauses, provably: every set was decided, and every core is proven."""
    queries: int


def enumerate_clauses(
    everything: int,
    known: Iterable[int],
    ask: Callable[[int], SetAnswer],
    *,
    gone_with: Callable[[int], int | None] = lambda absent: absent,
    max_queries: int,
    max_unproven: int,
    max_undecided: int,
) -> Enumeration:
    """Return the minimal clauses over a mask of other parts, starting from some that are known.

    ``ask`` is given the obstacles. It is asked the largest undecided sets first, at most ``max_queries`` times, and
    until ``max_unproven`` of the answers are neither motion nor proof; of more than ``max_undecided`` undecided sets at
    once, the smallest are given up. ``gone_with`` returns what is gone wherever these parts are gone, themselves
    included, or None where they never are all gone: such a set is not asked about.
    """
    clauses, cores = minimal(known), []
    undecided = [] if 0 in clauses else [0]
    is_complete, queries, unproven = True, 0, 0
    while undecided:
        if queries == max_queries or unproven == max_unproven:
            is_complete = False
            break
        least = min(undecided, key=_rank)
        absent = gone_with(least)
        if absent is None or any(not clause & ~absent for clause in clauses):
            undecided.remove(least)
            continue
        said = ask(everything & ~absent)
        queries += 1
        if said.clause is not None:
            assert said.clause & ~absent == 0, "a clause found must hold for what was asked"
            clauses = minimal([*clauses, said.clause])
            undecided = [mask for mask in undecided if mask != least and said.clause & ~mask]
            continue
        is_complete &= said.is_proven
        unproven += not said.is_proven
        core = said.core & ~absent or everything & ~absent
        cores.append(core)
        undecided, is_cut = _hitting(undecided, core, clauses, most=max_undecided)
        is_complete &= not is_cut
    return Enumeration(clauses=tuple(clauses), cores=tuple(cores), is_complete=is_complete, queries=queries)


def _hitting(undecided: list[int], core: int, clauses: list[int], *, most: int) -> tuple[list[int], bool]:
    """Extend the sets that miss a core by one of its parts each; drop what is not minimal, or covered by a clause.

    The smallest sets first, at most so many; and whether there would have been more. Those extended contain none of
    one another, so only a set that hits the core by just the part added can make one of them superfluous.
    """
    hit = [mask for mask in undecided if mask & core]
    by_part: dict[int, list[int]] = {}
    for mask in hit:
        by_part.setdefault(mask & core, []).append(mask)
    out = list(hit)
    for mask in sorted((mask for mask in undecided if not mask & core), key=_rank):
        rest = core
        while rest and len(out) <= len(hit) + most:
            part = rest & -rest
            rest &= rest - 1
            more = mask | part
            covering = (*by_part.get(part, ()), *clauses)
            if not any(other & ~more == 0 for other in covering):
                out.append(more)
    out.sort(key=_rank)
    return out[:most], len(out) > most


def _rank(mask: int) -> tuple[int, int]:
    return mask.bit_count(), mask
