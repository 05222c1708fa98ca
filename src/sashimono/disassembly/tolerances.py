"""How deep a moving part may go into the others: one value for all stages, held under what the check of a plan allows.

All depths are measured beyond the overlap that the pair has in the assembled pose, and are given over the scale of
the pair (`PlacedParts.scale`): the smaller part's smallest extent, or less where either part has thin walls.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

from sashimono.errors import SashimonoError


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Depths that motions may reach, over the scale of the pair. No stage may go as deep as a plan may.

    The margin between the two covers what probes do not see between them. It is a quarter of the plan's tolerance
    for translations, and five eighths for motions that turn.
    """

    plan: float = 0.02
    """What a finished plan may reach: at most the `relative_tolerance` of the independent check. Proofs that a part
    is held are true for motions up to this depth."""
    translation: float = 0.015
    """What a translation may reach where it is traced."""
    turning: float = 0.0075
    """What a motion that turns may reach where it is followed. Half of what translations may: paths that use it up
    (out of the last turn of a thread) hit between probes."""
    declared: float = 0.015
    """What the turn of a declared thread may reach."""
    thread: float = 0.018
    """What facets of two threads may reach while one turns in the other. They meet corner to face, and all corners are
    probes, so that little is not seen: nine tenths of what a plan may reach."""
    parted: float = 0.011
    """Depth at which a pair that overlaps as assembled has parted on a path that turns: no later than the check has it
    (half the plan's). An overlap that wavers about what translations may reach, as facets make it, has not ended."""
    thin_walls: float = 20.0
    """A pair's scale is at most so many thicknesses of either part's thin walls: shells never slip through."""
    shallow: float = 0.09
    """Overlap as assembled, over the smaller part's smallest extent, up to which it is an excuse anywhere on the way,
    as of a press fit; a deeper one is an excuse only near to where it is."""
    shallow_wall: float = 0.36
    """The same, over the thickness of either part's thin walls: both hold."""
    excuse_reach: float = 0.9
    """How far from a piece of a deep overlap it is an excuse, over how large the piece is, or twice its depth."""
    least_step: float = 1.0 / 64.0
    """Shortest step of tracing along a wall that the part slides on, over the smaller part's smallest extent."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            if not getattr(self, entry.name) > 0.0:
                raise SashimonoError(f"tolerances: {entry.name} must be positive, is {getattr(self, entry.name)}")
        for name in ("translation", "turning", "declared", "thread", "parted"):
            if not getattr(self, name) < self.plan:
                raise SashimonoError(
                    f"tolerances: {name} ({getattr(self, name)}) must be less than plan ({self.plan}), or the check "
                    "of the plan refuses what the planner finds"
                )
