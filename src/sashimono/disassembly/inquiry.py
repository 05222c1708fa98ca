"""An inquiry: the questions of one run, with what follows from the answers so far, and one budget for all.

Fewer obstacles never block more. So a motion frees a part from every set without the parts that it hits, and a
failure holds for every set that has what caused it. Inquiries share nothing: an answer never depends on what another
inquiry asked before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from sashimono.disassembly.separation import UNASKED, Separation, Stage
from sashimono.plan import Answer

Ask = Callable[[Stage, int, int, int], Separation]
"""Called with a stage, a part, the mask of the remaining parts, and the tracing steps that are left."""


class Inquiry:
    """Asks stages, remembers what they said, and shares one budget of tracing steps among all questions.

    A late question may end UNKNOWN because earlier ones spent the budget. The same questions in the same
    order have the same answers.
    """

    def __init__(self, stages: Sequence[Stage], ask: Ask, *, max_traced: int) -> None:
        self.stages = tuple(stages)
        self._ask = ask
        self._left = max_traced
        self._found: dict[int, list[Separation]] = {}
        self._failed: dict[tuple[str, int], list[tuple[int, Separation]]] = {}

    def separate(self, part: int, remaining: int, *, stages: Sequence[Stage] | None = None) -> Separation:
        """Return what all stages, or those given, know about a part: the first motion, or everything that was said.

        A stage whose motions are proven not to exist is not asked, nor, of a part known to be held, one of any motions.
        """
        known = UNASKED
        for stage in self.stages if stages is None else stages:
            if known.rules_out(stage):
                continue
            known = known.and_then(self.ask(stage, part, remaining))
            if known.answer is Answer.FREE:
                break
        return known

    def ask(self, stage: Stage, part: int, remaining: int) -> Separation:
        """Return what one stage knows about a part, from memory where that decides it."""
        others = remaining & ~(1 << part)
        for found in self._found.get(part, []):
            if stage.can_recall(found) and not found.hits & others:
                return found
        failed = self._failed.setdefault((stage.name, part), [])
        for asked, said in failed:
            if stage.still_fails(said, asked, others):
                return said
        said = self._ask(stage, part, remaining, self._left)
        self._left = max(0, self._left - said.traced)
        if said.removal is None:
            failed.append((others, said))
        elif stage.can_recall(said):
            self.remember(part, said)
        return said

    def remember(self, part: int, found: Separation) -> None:
        """Take in a motion that frees a part."""
        assert found.removal is not None, "only motions are remembered"
        self._found.setdefault(part, []).append(found)
