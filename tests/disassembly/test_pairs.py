"""Two parts alone come apart by one relative motion: what frees either of them frees both, at every stage."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from removal_check import problems
from solids import assembly, bayonet, box, keyhole, l_tunnel, linked_rings, peg_in_plate, screwed

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.separation import Separation, Stage
from sashimono.disassembly.translation.search import TranslationSearch
from sashimono.disassembly.translation.stage import TranslationStage
from sashimono.plan import Answer, MotionClass


def cascade_of(parts: Assembly) -> Cascade:
    return Cascade(parts, make_bodies(parts), config=SeparateConfig())


def check(parts: Assembly, part: int, found: Separation) -> None:
    assert found.answer is Answer.FREE
    assert found.removal is not None
    assert not problems(parts, parts.parts[part], [parts.parts[1 - part]], found.removal)


@pytest.mark.parametrize(
    ("make", "stage"),
    [
        (peg_in_plate, "blocking"),
        (lambda: screwed(0.0008), "thread"),
        (l_tunnel, "translation"),
        (bayonet, "physics"),
    ],
    ids=["blocking", "thread", "translation", "physics"],
)
def test_each_stage_that_frees_one_of_a_pair_frees_the_other(make: Callable[[], Assembly], stage: str) -> None:
    parts = make()
    cascade = cascade_of(parts)
    asked = next(entry for entry in cascade.stages if entry.name == stage)
    inquiry = cascade.inquire()
    for part in (0, 1):
        check(parts, part, inquiry.ask(asked, part, 0b11))


class OneSided:
    """A stage that is blind to all parts but one."""

    def __init__(self, stage: Stage, sees: int) -> None:
        self.stage, self.sees = stage, sees

    @property
    def name(self) -> str:
        return self.stage.name

    @property
    def motions(self) -> MotionClass:
        return self.stage.motions

    def separate(self, part: int, remaining: int, *, max_traced: int) -> Separation:
        if part != self.sees:
            return Separation(answer=Answer.UNKNOWN, stage=self.name, blocked_by=(self.sees,), reason="blind")
        return self.stage.separate(part, remaining, max_traced=max_traced)

    @property
    def search(self) -> TranslationSearch:
        assert isinstance(self.stage, TranslationStage)
        return self.stage.search

    def fewer_holders(self, part: int, holders: int, *, frees: Callable[[int], bool]) -> int:
        return holders

    def can_recall(self, found: Separation) -> bool:
        return self.stage.can_recall(found)

    def still_fails(self, said: Separation, asked: int, others: int) -> bool:
        return self.stage.still_fails(said, asked, others)


@pytest.mark.parametrize("sees", [0, 1])
@pytest.mark.parametrize(
    ("make", "stage"),
    [(lambda: screwed(0.0008), "thread"), (l_tunnel, "translation"), (bayonet, "physics")],
    ids=["thread", "translation", "physics"],
)
def test_a_stage_that_finds_the_motion_of_one_part_only_frees_both(
    make: Callable[[], Assembly], stage: str, sees: int
) -> None:
    parts = make()
    cascade = cascade_of(parts)
    cascade.stages = tuple(OneSided(entry, sees) for entry in cascade.stages if entry.name == stage)
    for part in (1 - sees, sees):
        check(parts, part, cascade.separate(part, 0b11))


@pytest.mark.parametrize("sees", [0, 1])
def test_a_proof_of_one_is_a_proof_of_the_other(sees: int) -> None:
    cascade = cascade_of(linked_rings())
    cascade.stages = (OneSided(cascade.translations, sees),)
    for part in (1 - sees, sees):
        found = cascade.separate(part, 0b11)
        assert found.answer is Answer.PROVEN_BLOCKED
        assert found.proven_for is MotionClass.TRANSLATIONS
        assert found.blocked_by == (1 - part,)


def test_a_motion_taken_over_says_which_absent_parts_it_hits() -> None:
    """The peg leaves upwards, so the plate alone leaves downwards: onto the floor, where that is there."""
    pair = {"peg": box((0.01, 0.01, 0.03), (0, 0, 0.005)), "plate": box((0.04, 0.04, 0.01)) - box((0.01, 0.01, 0.02))}
    pair["peg"] += box((0.02, 0.02, 0.01), (0, 0, 0.015))
    parts = assembly(**pair, floor=box((0.06, 0.06, 0.01), (0, 0, -0.02)))
    cascade = cascade_of(parts)
    cascade.stages = (OneSided(cascade.directions, 0),)
    found = cascade.separate(1, 0b011)
    assert found.removal is not None
    np.testing.assert_allclose(found.removal.exit_direction, [0.0, 0.0, -1.0], atol=1e-9)
    assert found.hits == 0b100


@pytest.mark.parametrize("sees", [0, 1])
def test_conditions_free_both_and_leave_nothing_open(sees: int) -> None:
    """A panel slides along its keyhole, then lifts off the stud."""
    cascade = cascade_of(keyhole())
    cascade.translations = OneSided(cascade.translations, sees)  # type: ignore[assignment]
    cascade.stages = (cascade.directions, cascade.translations)
    conditions = cascade.conditions()
    assert conditions.masks == ((0,), (0,))
    assert conditions.cut_short == ()
