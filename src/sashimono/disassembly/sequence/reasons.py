"""Why parts could not leave, in words: what was tried, and what is in the way, as measured.

Parts that hold one another get one reason together. No part of a ball bearing leaves alone, and it helps nobody to
say so of every ball.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from sashimono.assembly import millimetres
from sashimono.disassembly.free_travel import passes
from sashimono.disassembly.masks import bits
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.separation import Separation
from sashimono.geometry.features.directions import direction_name
from sashimono.geometry.mesh import topology


@dataclass(frozen=True, kw_only=True)
class VerdictConfig:
    """How closely what is in the way is measured, and who shares a reason."""

    accuracy: float = 0.02
    """To which the depth is found, over itself."""
    most: float = 1.0
    """Depth, over the smaller part's smallest extent, that counts as a wall and no fit: from there on none is named."""
    interlocked: int = 4
    """From so many parts on that hold one another, all share one reason."""
    named: int = 3
    """Parts of them that are named."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Interference:
    """The least that must give way for a part to leave along a straight line."""

    direction: Float[np.ndarray, "3"]
    """Unit vector, world frame."""
    depth: float
    """How much deeper it goes on its way than the two overlap as assembled [m]."""
    tolerance: float
    """How much deeper it may go [m]."""
    other: int
    """The part into which it goes deepest."""


def least_interference(
    parts: PlacedParts, part: int, others: Sequence[int], *, config: VerdictConfig
) -> Interference | None:
    """Return the straight line, of the part's own and the world's, along which least is in the way of a part.

    None if every one is blocked by as much as a part is thick: then there is no fit to speak of.
    """
    best: Interference | None = None
    lines = [*parts.part_lines[part], *np.eye(3)]
    for direction in [sign * line for line in lines for sign in (1.0, -1.0)]:
        found = _along(parts, part, others, direction, np.inf if best is None else best.depth, config)
        best = found or best
    return best


def add_reasons(
    parts: PlacedParts,
    remaining: int,
    said: Sequence[tuple[int, Separation]],
    *,
    config: VerdictConfig,
) -> tuple[tuple[int, Separation], ...]:
    """Return what is said of each part among the remaining ones (a mask), with what is in its way as measured.

    Interlocked parts, those that are blocked by one another, share it.
    """
    answers = dict(said)
    out = {}
    for members in _interlocked(remaining, answers):
        stuck = [part for part in members if part in answers]
        if not stuck:
            continue
        if len(members) < config.interlocked:
            for part in stuck:
                others = [other for other in bits(remaining) if other != part]
                words = _measured(parts, part, others, least_interference(parts, part, others, config=config))
                out[part] = replace(answers[part], reason=f"{answers[part].reason}{words}")
            continue
        together = _together(parts, members, config)
        others = [other for other in bits(remaining) if other != stuck[0]]
        words = _measured(parts, stuck[0], others, least_interference(parts, stuck[0], others, config=config))
        for part in stuck:
            motions = answers[part].proven_for
            sure = f"not proven: {answers[part].reason}" if motions is None else f"proven for {motions}"
            out[part] = replace(answers[part], reason=f"{together} ({sure}){words}")
    return tuple((part, out[part]) for part, _ in said)


def _along(
    parts: PlacedParts,
    part: int,
    others: Sequence[int],
    direction: Float[np.ndarray, "3"],
    most: float,
    config: VerdictConfig,
) -> Interference | None:
    """What must give way along a direction, if it is less than ``most``."""
    depth, deepest = 0.0, None
    for _, other in parts.parts_ahead(part, np.zeros(3), direction, others):
        size = parts.smaller_size(part, other)

        def clears(limit: float, other: int = other) -> bool:
            return passes(parts, part, np.zeros(3), direction, other, tolerance=limit)

        bare = parts.tolerances.translation * parts.scale(part, other)
        if clears(max(depth, bare)):
            continue
        low, high = max(depth, bare), min(most, config.most * size)
        if high <= low or not clears(high):
            return None
        while high - low > config.accuracy * high:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if clears(middle) else (middle, high)
        depth, deepest = high, other
    if deepest is None:
        return None
    tolerance = parts.tolerances.plan * parts.scale(part, deepest)
    return Interference(direction=direction, depth=depth, tolerance=tolerance, other=deepest)


def _measured(parts: PlacedParts, part: int, others: Sequence[int], interference: Interference | None) -> str:
    names = parts.assembly.names
    words = ""
    if interference is not None:
        overlap = float(parts.overlaps[part, interference.other])
        beyond = (
            f" beyond the {millimetres(overlap)} that they overlap as assembled"
            if overlap > interference.tolerance
            else ""
        )
        words += (
            f"; straight out, {names[part]} goes at least {millimetres(interference.depth)} deep into"
            f" {names[interference.other]}{beyond}"
            f" ({direction_name(interference.direction)}; {millimetres(interference.tolerance)} is tolerated)"
        )
    source = parts.assembly.source
    kept = {entry.product for entry in source.kept} if source is not None else set()
    for one in (part, *others):
        count = _count_solids(parts, one) if names[one] not in kept else 1
        if count > 1 and (one == part or (interference is not None and one == interference.other) or len(others) == 1):
            words += f"; {names[one]} is {count} separate solids that move as one: plan again with --split all"
    return words


def _count_solids(parts: PlacedParts, part: int) -> int:
    vertices, faces = parts.vertices[part], parts.faces[part]
    return len(topology.split_solids(vertices, faces)) if topology.shells(faces).max() > 0 else 1


def _together(parts: PlacedParts, members: Sequence[int], config: VerdictConfig) -> str:
    names = [parts.assembly.names[part] for part in members]
    rest = len(names) - config.named
    return f"one of {len(names)} parts that hold one another: {', '.join(names[: config.named])} and {rest} more"


def _interlocked(remaining: int, said: dict[int, Separation]) -> list[list[int]]:
    """The remaining parts, grouped by who is blocked by whom."""
    group = {part: {part} for part in bits(remaining)}
    for part, separation in said.items():
        for other in separation.blocked_by:
            if other in group and group[other] is not group[part]:
                joined = group[part] | group[other]
                for member in joined:
                    group[member] = joined
    return [sorted(members) for members in {min(g): g for g in group.values()}.values()]
