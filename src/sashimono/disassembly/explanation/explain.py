"""Why a part cannot leave: what stops it along each direction, what must go first, what change would free it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Overlap, frozen_array
from sashimono.disassembly.cascade import Cascade
from sashimono.disassembly.conditions.clauses import minimal
from sashimono.disassembly.explanation.obstruction import Obstruction, ObstructionConfig, find_obstruction
from sashimono.disassembly.free_travel import free_travel
from sashimono.disassembly.inquiry import Inquiry
from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.plan import Answer, MotionClass


@dataclass(frozen=True, kw_only=True)
class ExplainConfig:
    """How much is said, and when a change counts as small."""

    obstruction: ObstructionConfig = field(default_factory=ObstructionConfig)
    directions: int = 6
    """Most directions reported for a part."""
    alike: float = 0.8
    """Of directions with the same blockers and a cosine above this between them, one is reported."""
    small_change: float = 0.25
    """Largest change of an outline that is proposed, relative to the smaller part's smallest extent."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Blocker:
    """One part in the way along one direction."""

    part: str
    travel: float
    """How far the explained part gets before this one stops it [m]."""
    obstruction: Obstruction | None
    """What meets what; None where the contact is too slight for the grid."""


@dataclass(frozen=True, kw_only=True, eq=False)
class BlockedDirection:
    """One direction along which a part cannot leave."""

    direction: Float[np.ndarray, "3"]
    """Unit vector in the world frame."""
    blockers: tuple[Blocker, ...]
    """Nearest first."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "direction", frozen_array(self.direction, np.float64))

    @property
    def travel(self) -> float:
        """How far the part gets along it [m]."""
        return min(blocker.travel for blocker in self.blockers)

    @property
    def change(self) -> float:
        """The smallest change of outlines that would open it [m]; infinite if one of its blockers cannot be judged."""
        return max(np.inf if b.obstruction is None else b.obstruction.lateral for b in self.blockers)


@dataclass(frozen=True, kw_only=True, eq=False)
class Explanation:
    """What is known about one part among the parts that stay."""

    part: str
    fixed: tuple[str, ...]
    """The parts that it is explained against."""
    answer: Answer
    """Whether it can leave them, by itself."""
    proven_for: MotionClass | None
    """The motions that are proven not to exist; given with PROVEN_BLOCKED, and only with it."""
    reason: str
    """In words: how it leaves, or what was tried."""
    exit_direction: Float[np.ndarray, "3"] | None
    """Last direction of its way out, where the answer is FREE."""
    directions: tuple[BlockedDirection, ...]
    """Those with a smallest set of blockers, fewest first, then others; none where the answer is FREE."""
    removal_sets: tuple[tuple[str, ...], ...]
    """Smallest sets of parts that can be removed before it, after which it leaves by one translation.
    Fewest parts first."""
    overlaps: tuple[Overlap, ...]
    """Overlaps in the CAD between it and the parts reported as blockers."""
    easy_change: BlockedDirection | None
    """The direction that a small change of outlines would open, if there is one."""


def explain_part(
    cascade: Cascade,
    part: str,
    fixed: Sequence[str] | None = None,
    *,
    config: ExplainConfig | None = None,
    inquiry: Inquiry | None = None,
) -> Explanation:
    """Return why a part cannot leave the fixed ones, or that it can; all stages are asked.

    Directions are those of the blocking relation. Raises KeyError for a name that the assembly has not.

    Args:
        cascade: What is asked.
        part: The part's name.
        fixed: Names of the parts that stay; all others if None.
        config: How much is said.
        inquiry: Shares its budget among several explanations; one of its own if None.
    """
    config, inquiry = config or ExplainConfig(), inquiry or cascade.inquire()
    assembly = cascade.assembly
    mover = assembly.index(part)
    others = cascade.parts.all_parts if fixed is None else sum(1 << assembly.index(name) for name in set(fixed))
    others &= ~(1 << mover)
    names = tuple(assembly.names[k] for k in bits(others))
    found = inquiry.separate(mover, others | 1 << mover)
    if found.removal is not None:
        return Explanation(
            part=part, fixed=names, answer=Answer.FREE, proven_for=None, reason=f"leaves by {_way(found.removal)}",
            directions=(), removal_sets=(), exit_direction=found.removal.exit_direction, overlaps=(), easy_change=None,
        )  # fmt: skip
    masks = _blockers_by_direction(cascade, mover, others)
    sets = minimal(masks.values())
    telling = _telling_directions(cascade, masks, sets, config)
    directions = [
        _blocked_direction(cascade, mover, direction_index, masks[direction_index], config)
        for direction_index in telling
    ]
    met = {blocker.part for entry in directions for blocker in entry.blockers}
    easy = min(directions, key=lambda d: d.change, default=None)
    if easy is not None and not _is_small(cascade, mover, easy, config):
        easy = None
    leaving = _leaving_before(cascade, inquiry, mover, others, sets)
    return Explanation(
        part=part,
        fixed=names,
        answer=found.answer,
        proven_for=found.proven_for,
        reason=found.reason,
        exit_direction=None,
        directions=tuple(directions),
        removal_sets=tuple(tuple(assembly.names[k] for k in bits(mask)) for mask in sets if not mask & ~leaving),
        overlaps=tuple(o for o in assembly.overlaps if part in (o.first, o.second) and {o.first, o.second} & met),
        easy_change=easy,
    )


def explain_stuck(
    cascade: Cascade, fixed: Sequence[str] | None = None, *, config: ExplainConfig | None = None
) -> tuple[Explanation, ...]:
    """Return an explanation of every part that cannot leave.

    Without ``fixed``, the parts are taken apart as far as they come, and those that hang together in the
    end are explained among themselves. With it, each of these parts that cannot leave the others now is.
    """
    assembly = cascade.assembly
    if fixed is None:
        knots = list(_knots(find_disassembly(cascade, config=SequenceConfig())))
    else:
        knots = [{assembly.index(name) for name in fixed}]
    inquiry = cascade.inquire()
    found = (
        explain_part(
            cascade, assembly.names[part], [assembly.names[k] for k in sorted(knot)], config=config, inquiry=inquiry
        )
        for knot in knots
        for part in sorted(knot)
    )
    return tuple(entry for entry in found if entry.answer is not Answer.FREE)


def _knots(apart: DisassemblyResult) -> Iterator[set[int]]:
    """Yield the parts that hang together in the end, and those of each subassembly that does not come apart."""
    if apart.stuck:
        yield {apart.base, *(part for part, _ in apart.stuck)}
    for departure in apart.removals:
        if departure.inside is not None:
            yield from _knots(departure.inside)


def _telling_directions(
    cascade: Cascade, masks: dict[int, int], sets: Sequence[int], config: ExplainConfig
) -> list[int]:
    """The directions worth reporting."""
    direction = cascade.blocking.direction
    chosen: list[int] = []
    for direction_index in sorted(masks, key=lambda s: (masks[s] not in sets, masks[s].bit_count(), s)):
        mask = masks[direction_index]
        if any(masks[c] == mask and direction(c) @ direction(direction_index) > config.alike for c in chosen):
            continue
        chosen.append(direction_index)
    # one for each smallest set comes first: they are what can be acted on
    first = [next(c for c in chosen if masks[c] == mask) for mask in sets]
    return [*first, *(c for c in chosen if c not in first)][: config.directions]


def _blockers_by_direction(cascade: Cascade, part: int, others: int) -> dict[int, int]:
    """Blocker masks by direction; the last, costly look only where no other direction needs fewer."""
    blocking = cascade.blocking
    masks: dict[int, int] = {}
    rough = {
        direction_index: blocking.blockers(part, direction_index, others)
        for direction_index in range(blocking.count_directions)
    }
    for direction_index in sorted(rough, key=lambda s: (rough[s].bit_count(), s)):
        mask = rough[direction_index]
        if not any(known & mask == known for known in masks.values()):
            mask |= sum(1 << k for k in bits(others & ~mask) if not blocking.passes(part, direction_index, k))
        masks[direction_index] = mask
    return masks


def _way(removal: Removal) -> str:
    if not np.allclose(removal.displacements[:, :3, :3], np.eye(3), atol=1e-6):
        return "motions that turn it"
    return "one translation" if len(removal.displacements) == 2 else "several translations"


def _leaving_before(cascade: Cascade, inquiry: Inquiry, part: int, others: int, sets: Sequence[int]) -> int:
    """The parts that can leave one at a time while this one stays; by costlier motions only those in ``sets``."""
    remaining, wanted = others | 1 << part, 0
    for mask in sets:
        wanted |= mask
    while wanted & remaining:
        waiting = bits(remaining & ~(1 << part))
        gone = next((k for k in waiting if cascade.directions.along(k, remaining, preference=lambda _: 0.0)), None)
        if gone is None:
            waiting = bits(remaining & wanted)
            gone = next((k for k in waiting if inquiry.separate(k, remaining).answer is Answer.FREE), None)
        if gone is None:
            break
        remaining &= ~(1 << gone)
    return others & ~remaining


def _blocked_direction(
    cascade: Cascade, part: int, direction_index: int, mask: int, config: ExplainConfig
) -> BlockedDirection:
    parts = cascade.parts
    direction = cascade.blocking.direction(direction_index)
    blockers = []
    for other in bits(mask):
        size = parts.smaller_size(part, other)
        found = find_obstruction(
            (parts.vertices[part], parts.faces[part]),
            (parts.vertices[other], parts.faces[other]),
            direction,
            slack=float(parts.overlaps[part, other]) + 1e-3 * size,
            config=config.obstruction,
        )
        travel = free_travel(parts, part, np.zeros(3), direction, other) if found is None else found.travel
        blockers.append(Blocker(part=cascade.assembly.names[other], travel=float(travel), obstruction=found))
    return BlockedDirection(direction=direction, blockers=tuple(sorted(blockers, key=lambda b: (b.travel, b.part))))


def _is_small(cascade: Cascade, part: int, direction: BlockedDirection, config: ExplainConfig) -> bool:
    sizes = cascade.parts.sizes
    smallest = min(sizes[part], *(sizes[cascade.assembly.index(b.part)] for b in direction.blockers))
    return direction.change <= config.small_change * float(smallest)
