"""One table of known answers, asked of every stage of the cascade and of the cascade as a whole.

A stage may say that it does not know. It may not free what nothing frees, nor prove blocked, for its motions, what
one of these motions frees.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import pytest
from solids import (
    bayonet,
    box_with_lid,
    keyhole,
    l_tunnel,
    linked_rings,
    pair_in_pair,
    peg_in_plate,
    screwed,
    sealed_box,
)

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.plan import Answer, MotionClass


@dataclass(frozen=True, kw_only=True)
class Known:
    """What is known of one part among all others, by how the solids were drawn."""

    make: Callable[[], Assembly]
    part: str
    freed_by: frozenset[MotionClass]
    """The classes of motions in which one frees the part; a translation is also a motion of any kind."""
    stage: str
    """The stage that frees it, asked in order; or, where nothing does, that proves so."""


TRANSLATIONS = frozenset({MotionClass.TRANSLATIONS, MotionClass.ALL})
SCREWS = frozenset({MotionClass.SCREWS, MotionClass.ALL})
ANY = frozenset({MotionClass.ALL})
NONE: frozenset[MotionClass] = frozenset()


def thread() -> Assembly:
    return screwed(0.0008)


def closed_box() -> Assembly:
    return sealed_box(0.0)


KNOWN = [
    Known(make=peg_in_plate, part="peg", freed_by=TRANSLATIONS, stage="blocking"),
    Known(make=peg_in_plate, part="plate", freed_by=TRANSLATIONS, stage="blocking"),
    Known(make=box_with_lid, part="lid", freed_by=TRANSLATIONS, stage="blocking"),
    Known(make=box_with_lid, part="content", freed_by=NONE, stage="translation"),
    Known(make=l_tunnel, part="cube", freed_by=TRANSLATIONS, stage="translation"),
    Known(make=keyhole, part="panel", freed_by=TRANSLATIONS, stage="translation"),
    Known(make=thread, part="bolt", freed_by=SCREWS, stage="thread"),
    Known(make=bayonet, part="plug", freed_by=ANY, stage="physics"),
    Known(make=bayonet, part="socket", freed_by=ANY, stage="physics"),
    Known(make=linked_rings, part="first", freed_by=NONE, stage="translation"),
    Known(make=closed_box, part="screw", freed_by=NONE, stage="translation"),
    Known(make=pair_in_pair, part="front", freed_by=NONE, stage="translation"),
]
STAGES = ("blocking", "thread", "translation", "subassembly", "physics")


@cache
def cascade_of(make: Callable[[], Assembly]) -> Cascade:
    parts = make()
    return Cascade(parts, make_bodies(parts), config=SeparateConfig())


def name_of(known: Known) -> str:
    return f"{known.make.__name__}-{known.part}"


def test_the_table_is_asked_of_every_stage() -> None:
    assert tuple(stage.name for stage in cascade_of(peg_in_plate).stages) == STAGES


@pytest.mark.parametrize("known", KNOWN, ids=name_of)
@pytest.mark.parametrize("stage", STAGES)
def test_no_stage_contradicts_what_is_known(known: Known, stage: str) -> None:
    cascade = cascade_of(known.make)
    asked = next(each for each in cascade.stages if each.name == stage)
    part = cascade.assembly.index(known.part)
    said = asked.separate(part, cascade.parts.all_parts, max_traced=cascade.config.max_traced)
    if said.answer is Answer.FREE:
        assert known.freed_by, f"freed, by {stage}, though nothing frees it"
    if said.answer is Answer.PROVEN_BLOCKED:
        assert said.proven_for not in known.freed_by, f"{stage} proves blocked what such a motion frees"
    if stage == known.stage:
        assert said.answer is (Answer.FREE if known.freed_by else Answer.PROVEN_BLOCKED)


@pytest.mark.parametrize("known", KNOWN, ids=name_of)
def test_the_cascade_knows_and_says_which_stage_told_it(known: Known) -> None:
    cascade = cascade_of(known.make)
    said = cascade.separate(cascade.assembly.index(known.part), cascade.parts.all_parts)
    assert said.answer is (Answer.FREE if known.freed_by else Answer.PROVEN_BLOCKED)
    if said.answer is Answer.FREE:
        assert said.stage == known.stage
    else:
        assert said.proven_for is MotionClass.TRANSLATIONS
