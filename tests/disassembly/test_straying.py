"""A deep overlap as assembled is an excuse only near to where it is; a shallow one all along."""

from __future__ import annotations

import numpy as np
import pytest
from solids import assembly, box, rod

from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.free_travel import free_travel
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import Answer

UP, ASIDE = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def placed(**solids: object) -> PlacedParts:
    parts = assembly(**solids)
    return PlacedParts(parts, make_bodies(parts), config=PlacedPartsConfig())


def beam_with_pin() -> dict[str, object]:
    """A pin drawn into the end of a long beam without a hole, in the way of which the whole beam lies."""
    beam = box((0.2, 0.03, 0.03))
    pin = rod(0.004, 0.03).translate((-0.096, 0.0, 0.0))
    return {"beam": beam, "pin": pin}


def test_a_pin_does_not_plough_along_a_beam_but_leaves_by_its_hole() -> None:
    parts = placed(**beam_with_pin())
    assert len(parts.overlap_places(0, 1)) == 1
    travel = free_travel(parts, 1, np.zeros(3), ASIDE, 0)
    assert 0.0 < travel < 0.06, "it goes as far as the overlap is large, and no farther"
    assert free_travel(parts, 1, np.zeros(3), UP, 0) == np.inf
    # seen from the beam it is the same
    assert free_travel(parts, 0, np.zeros(3), -ASIDE, 1) < 0.06


@pytest.mark.parametrize("over", [1e-4, 2e-3])
def test_a_press_fit_is_pushed_along_its_whole_bore(over: float) -> None:
    sleeve = rod(0.01, 0.06) - rod(0.005, 0.07)
    bush = (rod(0.005 + over, 0.01) - rod(0.003, 0.02)).translate((0.0, 0.0, -0.02))
    parts = placed(sleeve=sleeve, bush=bush)
    assert parts.overlaps[0, 1] > 0.5 * over
    shallow = over < 2e-4
    assert (parts.overlap_places(0, 1) == ()) == shallow
    assert (free_travel(parts, 1, np.zeros(3), UP, 0) == np.inf) == shallow


def test_the_cascade_never_proposes_it_and_the_plan_needs_one_attempt() -> None:
    parts = assembly(**beam_with_pin())
    cascade = Cascade(parts, make_bodies(parts), config=SeparateConfig())
    found = cascade.separate(1, 0b11)
    assert found.answer is Answer.FREE
    assert found.removal is not None
    assert abs(found.removal.exit_direction @ ASIDE) < 0.5
    plan = plan_assembly(parts, config=PipelineConfig(max_attempts=1, contacts=False))
    assert plan.status == "complete"
