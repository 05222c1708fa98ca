"""One front door: every caller hears the same answer, and no proof without the motions that it is about."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from solids import bayonet, box_with_lid, keyhole, linked_rings, screwed

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.explanation.explain import explain_part
from sashimono.disassembly.explanation.report import explanation_lines
from sashimono.plan import Answer


def cascade_of(parts: Assembly) -> Cascade:
    return Cascade(parts, make_bodies(parts), config=SeparateConfig())


@pytest.mark.parametrize(
    ("make", "part"),
    [(lambda: screwed(0.0008), "bolt"), (lambda: screwed(0.0008), "nut"), (bayonet, "plug"), (keyhole, "panel")],
    ids=["bolt", "nut", "bayonet", "keyhole"],
)
def test_what_a_later_stage_frees_is_not_said_to_be_blocked(make: Callable[[], Assembly], part: str) -> None:
    found = explain_part(cascade_of(make()), part)
    assert found.answer is Answer.FREE
    assert "blocked" not in "\n".join(explanation_lines(found))


def test_a_proof_names_the_motions_that_it_is_about() -> None:
    for parts, name in ((linked_rings(), "first"), (box_with_lid(), "content")):
        found = explain_part(cascade_of(parts), name)
        line = explanation_lines(found)[0]
        assert found.answer is Answer.PROVEN_BLOCKED
        assert "proven to be blocked for translations" in line
