"""All minimal clauses of a part by duality: each "free" gives a clause, each "held" a few parts that hold it.

What a part can leave from is monotone: fewer obstacles never block more. So its minimal clauses (sets of parts to be
gone) are the minimal hitting sets of its minimal cores (sets of parts that hold it). A hitting set of the cores known
so far that covers no known clause is a question: asked without these parts, the answer is a new clause or a new core
(Liffiton et al., "Fast, flexible MUS enumeration", 2016). No set is asked twice, nor one that a core or clause decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from sashimono.disassembly.clauses import minimal


@dataclass(frozen=True, kw_only=True)
class Said:
    """What is said of one set of obstacles."""

    clause: int | None = None
    """Where the part is free: the parts that must be gone for the motion found, none of them among the obstacles."""
    core: int = 0
    """Else: obstacles that hold it by themselves."""
    is_proven: bool = True
    """Whether that is proven, or all that is known is that no motion was found."""


@dataclass(frozen=True, kw_only=True)
class Enumeration:
    """What came of it."""

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
    ask: Callable[[int], Said],
    *,
    max_queries: int,
    max_unproven: int,
    max_undecided: int,
) -> Enumeration:
    """Return the minimal clauses over a mask of other parts, starting from some that are known.

    ``ask`` is given the obstacles. It is asked the largest undecided sets first, at most ``max_queries`` times, and
    until ``max_unproven`` of the answers are neither motion nor proof; of more than ``max_undecided`` undecided sets at
    once, the smallest are given up.
    """
    clauses, cores = minimal(known), []
    undecided = [] if 0 in clauses else [0]
    is_complete, queries, unproven = True, 0, 0
    while undecided:
        if queries == max_queries or unproven == max_unproven:
            is_complete = False
            break
        absent = min(undecided, key=lambda mask: (mask.bit_count(), mask))
        said = ask(everything & ~absent)
        queries += 1
        if said.clause is not None:
            assert said.clause & ~absent == 0, "a clause found must hold for what was asked"
            clauses = minimal([*clauses, said.clause])
            undecided = [mask for mask in undecided if said.clause & ~mask]
            continue
        is_complete &= said.is_proven
        unproven += not said.is_proven
        core = said.core & ~absent or everything & ~absent
        cores.append(core)
        undecided = _hitting(undecided, core, clauses)
        if len(undecided) > max_undecided:
            is_complete = False
            undecided = undecided[:max_undecided]
    return Enumeration(clauses=tuple(clauses), cores=tuple(cores), is_complete=is_complete, queries=queries)


def _hitting(undecided: list[int], core: int, clauses: list[int]) -> list[int]:
    """Extend the sets that miss a core by one of its parts each; drop what is not minimal, or covered by a clause."""
    hit = [mask for mask in undecided if mask & core]
    grown: set[int] = set()
    for mask in undecided:
        rest = 0 if mask & core else core
        while rest:
            more = mask | (rest & -rest)
            rest &= rest - 1
            if not any(clause & ~more == 0 for clause in clauses):
                grown.add(more)
    return minimal([*hit, *grown])
