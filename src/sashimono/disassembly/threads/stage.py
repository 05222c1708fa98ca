"""The stage of threads: a part is turned out along the screw of a thread that it shares with another."""

from __future__ import annotations

from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_removal
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.threads.surface import Threads, search_unscrew
from sashimono.plan import Answer, MotionClass


class ThreadStage:
    """Threads read off the surfaces of two parts."""

    name = "thread"
    motions = MotionClass.SCREWS

    def __init__(self, parts: PlacedParts, threads: Threads) -> None:
        self.parts, self.threads = parts, threads

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        others = remaining & ~(1 << part)
        removal, traced = search_unscrew(self.threads, part, bits(others), max_traced=max_traced)
        if removal is None:
            is_cut = traced >= max_traced
            reason = "threads ended where the tracing steps were spent" if is_cut else ""
            return Separation(answer=Answer.UNKNOWN, stage=self.name, reason=reason, traced=traced, is_cut=is_cut)
        absent = bits(self.parts.all_parts & ~remaining)
        hits = hit_by_removal(self.parts, part, removal, absent)
        return Separation(answer=Answer.FREE, removal=removal, hits=hits, stage=self.name, traced=traced)

    def can_recall(self, found: Separation) -> bool:
        return found.stage == self.name

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        return asked & ~others == 0 and not said.is_cut
