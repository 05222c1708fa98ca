"""Systems of removal conditions as plain values: what is needed for what, and how they fall apart.

A system is a tuple over its parts 0, 1, ...; each entry is that part's clauses as bit masks of blockers.
A part may leave when some clause has no blocker left; an empty clause frees it at once. Every function
here keeps the set of complete removal orders as it is, or says how the set is made up of smaller ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from sashimono.disassembly.conditions.clauses import minimal
from sashimono.disassembly.masks import bits

System = tuple[tuple[int, ...], ...]
"""By part, the masks of its clauses."""


def stuck_parts(system: System, remaining: int) -> int:
    """Return the mask of the parts that are still there after all that can leave have left.

    By monotony the greedy order does not matter, and no part outside this set needs one within it.
    """
    return _after_leaving(system, remaining, 0)


def remainder(system: System, kept: int) -> int:
    """Return the parts that are left when, of the whole system, all leave that can but these (a mask).

    It is the smallest set with them that taking apart can reach: they can be left by themselves exactly if it is no
    larger than they are.
    """
    return _after_leaving(system, (1 << len(system)) - 1, kept)


def _after_leaving(system: System, remaining: int, kept: int) -> int:
    waiting = bits(remaining & ~kept)
    while True:
        still = []
        for part in waiting:
            others = remaining & ~(1 << part)
            if any(not clause & others for clause in system[part]):
                remaining = others
            else:
                still.append(part)
        if len(still) == len(waiting):
            return remaining
        waiting = still


def needed_before(system: System) -> list[int]:
    """Return, for each part of a solvable system, the mask of the parts that leave before it in every order.

    N(i), the parts without whose leaving part i cannot leave, is the greatest solution of
    N(i) = ∩ over clauses c of i of ∪ over j in c of ({j} ∪ N(j)): the dominators of an AND/OR graph.
    """
    everything = (1 << len(system)) - 1
    needed = [everything] * len(system)
    members = [[bits(clause) for clause in clauses] for clauses in system]
    changed = True
    while changed:
        changed = False
        for part, clauses in enumerate(members):
            common = needed[part]
            if not common:
                continue
            for clause, mask in zip(clauses, system[part], strict=True):
                reach = mask
                for other in clause:
                    reach |= needed[other]
                common &= reach
            if common != needed[part]:
                needed[part] = common
                changed = True
    return needed


def simplified(system: System, needed: Sequence[int]) -> System:
    """Return a system with the same orders and smaller clauses.

    A clause with a part that can only leave later never helps; a blocker is implied by one that needs it.
    """
    out = []
    for part, clauses in enumerate(system):
        kept = []
        for clause in clauses:
            members = bits(clause)
            if any(needed[other] >> part & 1 for other in members):
                continue
            implied = 0
            for other in members:
                implied |= needed[other]
            kept.append(clause & ~implied)
        out.append(tuple(minimal(kept)))
    return tuple(out)


def restricted(system: System, parts: Sequence[int], later: int) -> System:
    """Return the system of some parts, relabelled in this order; all others are gone, but those in ``later`` stay."""
    mask = sum(1 << part for part in parts)
    label = {part: k for k, part in enumerate(parts)}
    out = []
    for part in parts:
        clauses = minimal(clause & mask for clause in system[part] if not clause & later)
        out.append(tuple(sum(1 << label[k] for k in bits(clause)) for clause in clauses))
    return tuple(out)


def stages(needed: Sequence[int]) -> list[int]:
    """Return masks of parts such that in every order all of one leave before any of the next: the series cuts."""
    order = sorted(range(len(needed)), key=lambda k: needed[k].bit_count())
    everything = (1 << len(needed)) - 1
    common = [everything] * (len(needed) + 1)
    for k in range(len(order) - 1, -1, -1):
        common[k] = common[k + 1] & needed[order[k]]
    out, before, stage = [], 0, 0
    for k, part in enumerate(order):
        stage |= 1 << part
        if not (before | stage) & ~common[k + 1]:
            out.append(stage)
            before, stage = before | stage, 0
    return out


def components(system: System) -> list[int]:
    """Return masks of parts that do not constrain one another, by lowest part."""
    groups: list[int] = []
    for part, clauses in enumerate(system):
        touched = 1 << part
        for clause in clauses:
            touched |= clause
        apart = []
        for group in groups:
            if group & touched:
                touched |= group
            else:
                apart.append(group)
        groups = [*apart, touched]
    return sorted(groups, key=lambda group: group & -group)


def canonical_order(system: System, needed: Sequence[int]) -> list[int]:
    """Return the parts in an order that depends little on how they were numbered.

    Colour refinement over the clauses, then one part of the first ambiguous colour is singled out, and so
    on. Systems that agree after relabelling are the same up to names; that some equal ones may not agree
    costs time, never correctness.
    """
    count = len(system)
    members = [[bits(clause) for clause in clauses] for clauses in system]
    after = [0] * count
    for mask in needed:
        for other in bits(mask):
            after[other] += 1
    color = _ranks([(needed[k].bit_count(), after[k], *sorted(map(len, members[k]))) for k in range(count)])
    color = _refined(color, members)
    while len(set(color)) < count:
        sizes: dict[int, int] = {}
        for value in color:
            sizes[value] = sizes.get(value, 0) + 1
        tied = min(value for value, size in sizes.items() if size > 1)
        single = color.index(tied)
        color = _refined(_ranks([(value, k != single) for k, value in enumerate(color)]), members)
    return sorted(range(count), key=color.__getitem__)


def _refined(color: list[int], members: list[list[list[int]]]) -> list[int]:
    """Tell parts apart by the colours within their clauses and by the clauses that they are in, until that ends."""
    owners = [part for part, clauses in enumerate(members) for _ in clauses]
    flat = [clause for clauses in members for clause in clauses]
    while True:
        kinds = _ranks([(color[k], sorted([color[m] for m in clause])) for k, clause in zip(owners, flat, strict=True)])
        own: list[list[int]] = [[] for _ in color]
        used: list[list[int]] = [[] for _ in color]
        for kind, owner, clause in zip(kinds, owners, flat, strict=True):
            own[owner].append(kind)
            for k in clause:
                used[k].append(kind)
        following = _ranks([(c, sorted(o), sorted(u)) for c, o, u in zip(color, own, used, strict=True)])
        if max(following) == max(color):
            return following
        color = following


def _ranks(values: list) -> list[int]:
    """Return the rank of each value among the distinct ones."""
    order = sorted(range(len(values)), key=values.__getitem__)
    out = [0] * len(values)
    rank = 0
    for before, k in pairwise(order):
        rank += values[k] != values[before]
        out[k] = rank
    return out
