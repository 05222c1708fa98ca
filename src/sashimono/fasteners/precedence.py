"""The precedence that fasteners add to what geometry demands."""

from __future__ import annotations

from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter

from sashimono.assembly import Assembly
from sashimono.fasteners.recognise import Fastener

Pair = tuple[str, str]
"""Two parts: the first is placed before the second."""


def precedence(assembly: Assembly, fasteners: Sequence[Fastener]) -> set[Pair]:
    """Return pairs of part names (before, after): the first is placed before the second, as a fitter would do it.

    - A screw or bolt comes after what it clamps and after what it goes into.
    - A washer comes after what is clamped; on the head's side before the screw, on the nut's side after it.
    - A nut comes after its bolt, after what is clamped, and after the washers on its side.
    - A circlip comes after what it sits on, and after what it holds there.

    Pins and standoffs add none: either of the parts that they join may come first. No pair contradicts another;
    where two fasteners would demand opposite things, neither demand is made. Whether geometry allows it is not asked
    here: see `sashimono.disassembly.conditions.added.with_precedence`.

    Args:
        assembly: Parts in their assembled poses.
        fasteners: What `find_fasteners` found there.
    """
    names = set(assembly.names)
    pairs: set[Pair] = set()
    for f in fasteners:
        if f.kind in ("screw", "bolt"):
            nut_side = [washer for washer, far in f.washers if far]
            head_side = [washer for washer, far in f.washers if not far]
            pairs |= {(part, f.part) for part in (*f.clamps, *f.into, *head_side) if part not in f.nuts}
            pairs |= {(part, washer) for part in f.clamps for washer, _ in f.washers}
            pairs |= {(f.part, after) for after in (*nut_side, *f.nuts)}
            pairs |= {(before, nut) for before in (*f.clamps, *nut_side, *head_side) for nut in f.nuts}
        elif f.kind == "circlip":
            pairs |= {(part, f.part) for part in (*f.clamps, *f.into)}
    pairs = {(a, b) for a, b in pairs if a != b and a in names and b in names}
    return _without_circles({(a, b) for a, b in pairs if (b, a) not in pairs})


def _without_circles(pairs: set[Pair]) -> set[Pair]:
    """The pairs, less those of any circle."""
    while True:
        graph: dict[str, set[str]] = {}
        for before, after in pairs:
            graph.setdefault(after, set()).add(before)
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            circle = set(error.args[1])
            pairs = {(a, b) for a, b in pairs if not (a in circle and b in circle)}
        else:
            return pairs
