"""The stage of physics: a part is pushed, slides and turns, until it is out."""

from __future__ import annotations

from dataclasses import replace

from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_path
from sashimono.disassembly.physics.search import PhysicsConfig, search_physics
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import Separation
from sashimono.plan import Answer, MotionClass


class PhysicsStage:
    """Pushes with contact and friction. It finds motions that turn too, and never proves that there is none."""

    name = "physics"
    motions = MotionClass.ALL

    def __init__(self, parts: PlacedParts, *, config: PhysicsConfig) -> None:
        self.parts, self.config = parts, config

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        config = replace(self.config, max_traced=min(max_traced, self.config.max_traced))
        found = search_physics(self.parts, part, bits(remaining & ~(1 << part)), config=config)
        if found.removal is not None:
            return replace(self.witness(part, remaining, found.removal), traced=found.traced)
        is_cut = found.traced >= max_traced
        return Separation(
            answer=Answer.UNKNOWN,
            stage=self.name,
            blocked_by=found.blocked_by,
            reason="physics ended where the tracing steps were spent" if is_cut else found.reason,
            traced=found.traced,
            is_cut=is_cut,
        )

    def witness(self, part: int, remaining: int, removal: Removal) -> Separation:
        """Return the separation by a motion that frees a part, with those of the absent parts that it would hit."""
        absent = bits(self.parts.all_parts & ~remaining & ~(1 << part))
        hits = hit_by_path(self.parts, part, removal, absent, tolerance=self.parts.tolerances.turning)
        return Separation(answer=Answer.FREE, removal=removal, hits=hits, stage=self.name)

    def can_recall(self, found: Separation) -> bool:
        return True

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        return asked & ~others == 0
