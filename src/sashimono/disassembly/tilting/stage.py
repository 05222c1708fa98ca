"""The stage of tilting: a search in SE(3) along the contact surface, for what no push and no translation frees."""

from __future__ import annotations

from dataclasses import replace

from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_path
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.tilting.search import TiltConfig, search_tilt
from sashimono.plan import Answer, MotionClass


class TiltStage:
    """Tilts, turns and shifts at random, guided by contact. It never proves that there is no way out."""

    name = "tilt"
    motions = MotionClass.ALL

    def __init__(self, parts: PlacedParts, *, config: TiltConfig) -> None:
        self.parts, self.config = parts, config

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        others = bits(remaining & ~(1 << part))
        if any(self._overlap(part, other) for other in others):
            return Separation(
                answer=Answer.UNKNOWN,
                stage=self.name,
                reason="no tilting: the parts overlap as assembled",
            )
        config = replace(self.config, max_traced=min(max_traced, self.config.max_traced))
        found = search_tilt(self.parts, part, others, config=config)
        if found.removal is not None:
            absent = bits(self.parts.all_parts & ~remaining)
            hits = hit_by_path(self.parts, part, found.removal, absent, tolerance=self.parts.tolerances.turning)
            return Separation(
                answer=Answer.FREE, removal=found.removal, hits=hits, stage=self.name, traced=found.traced
            )
        is_cut = found.traced >= max_traced
        return Separation(
            answer=Answer.UNKNOWN,
            stage=self.name,
            reason="tilting ended where the tracing steps were spent" if is_cut else found.reason,
            traced=found.traced,
            is_cut=is_cut,
        )

    def _overlap(self, part: int, other: int) -> bool:
        """Whether two parts are deeper in each other, as assembled, than a turning motion may go.

        A path that never leaves such an overlap may go as deep all along, and a search at random finds those that
        plough through thin walls.
        """
        return bool(self.parts.overlaps[part, other] > self.parts.tolerances.turning * self.parts.scale(part, other))

    def can_recall(self, found: Separation) -> bool:
        return True

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        return asked & ~others == 0
