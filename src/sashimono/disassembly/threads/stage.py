"""The stage of threads: a part is turned out along the screw of a thread that it shares with another."""

from __future__ import annotations

from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_removal
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.separation import Separation
from sashimono.disassembly.threads.surface import Threads, Unscrewed, search_unscrew
from sashimono.plan import Answer, MotionClass


class ThreadStage:
    """Threads read off the surfaces of two parts."""

    name = "thread"
    motions = MotionClass.SCREWS

    def __init__(self, parts: PlacedParts, threads: Threads) -> None:
        self.parts, self.threads = parts, threads

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        others = remaining & ~(1 << part)
        found = search_unscrew(self.threads, part, bits(others), max_traced=max_traced)
        if found.removal is None:
            return Separation(
                answer=Answer.UNKNOWN,
                stage=self.name,
                reason="threads ended where the tracing steps were spent" if found.is_cut else self._reason(found),
                blocked_by=tuple(dict.fromkeys(way.other for way in found.stopped if way.turns > 0.0)),
                traced=found.traced,
                is_cut=found.is_cut,
                is_held=found.is_held,
            )
        absent = bits(self.parts.all_parts & ~remaining)
        hits = hit_by_removal(self.parts, part, found.removal, absent)
        return Separation(answer=Answer.FREE, removal=found.removal, hits=hits, stage=self.name, traced=found.traced)

    def _reason(self, found: Unscrewed) -> str:
        """In words, how far it can be turned in each part that it is threaded in."""
        names = self.parts.assembly.names
        words = []
        for other in dict.fromkeys(way.other for way in found.stopped):
            ways = [way for way in found.stopped if way.other == other]
            most = max(way.turns for way in ways)
            if most > 0.0:
                pitch = 1e3 * ways[0].pitch
                words.append(f"its thread in {names[other]} (a turn is {pitch:.3g} mm) stops it after {most:.3g} turns")
        return "; ".join(words)

    def can_recall(self, found: Separation) -> bool:
        return found.stage == self.name

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        return asked & ~others == 0 and not said.is_cut
