"""Close fits: found where a part is all around another without clearance, said in the plan, and checked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solids import Manifold, assembly, box, rod

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.sequence.cost import Placing
from sashimono.disassembly.sequence.greedy import SequenceConfig
from sashimono.disassembly.sequence.order import Orderer
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import CloseFit
from sashimono.stability import FitAxis, StabilityConfig, Touching, close_fit
from sashimono.verify import verify_plan

UPRIGHT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def wheel(bore: Manifold) -> Manifold:
    """A disc of 60 mm, 12 mm thick, 30 mm above the ground."""
    return rod(0.03, 0.012, (0.0, 0.0, 0.03)) - bore


def fit_of(shaft: Manifold, bore: Manifold) -> FitAxis | None:
    parts = assembly(shaft=shaft, wheel=wheel(bore))
    poses = {part.name: part.T_world_part for part in parts.parts}
    touching = Touching(make_bodies(parts), poses, config=StabilityConfig())
    return close_fit(touching, "shaft", "wheel", UPRIGHT)


@pytest.mark.parametrize("segments", [6, 24, 96])
def test_a_wheel_on_its_shaft_fits_about_the_axis(segments: int) -> None:
    shaft = rod(0.006, 0.08, (0.004, 0.003, 0.04), segments=segments)
    fit = fit_of(shaft, shaft)
    assert fit is not None
    assert fit.axis == (0.0, 0.0, 1.0)
    assert np.allclose(fit.point[:2], (0.004, 0.003), atol=1e-5)


SHAFT = rod(0.006, 0.08, (0.0, 0.0, 0.04))


@pytest.mark.parametrize(
    "bore",
    [
        rod(0.00605, 0.1),
        SHAFT + box((0.06, 0.0115, 0.1), (0.03, 0.0, 0.0)),
        SHAFT + rod(0.02, 0.03, (0.0, 0.0, 0.0415)),
    ],
    ids=["clearance", "open at one side", "too short"],
)
def test_what_has_play_or_is_open_or_short_is_no_fit(bore: Manifold) -> None:
    assert fit_of(SHAFT, bore) is None


def test_a_ball_bearing_fits_in_its_seat() -> None:
    """5 mm wide, of 16 mm, with chamfers, and play below: without a fit it would have to be held."""
    ring = rod(0.008, 0.0044) + rod(0.0077, 0.005) - rod(0.0025, 0.01)
    seat = rod(0.02, 0.01, (0.0, 0.0, -0.002)) - rod(0.008, 0.0058)
    parts = assembly(ring=ring, seat=seat)
    poses = {part.name: part.T_world_part for part in parts.parts}
    touching = Touching(make_bodies(parts), poses, config=StabilityConfig())
    assert close_fit(touching, "ring", "seat", UPRIGHT) is not None


def standing() -> Assembly:
    """A plate with a post; a wheel half way up on the post, which nothing stops."""
    plate = box((0.1, 0.1, 0.01), (0.0, 0.0, -0.005)) + SHAFT
    return assembly(plate=plate, wheel=wheel(SHAFT))


def test_a_plan_says_what_fits_and_the_check_looks_at_it() -> None:
    parts = standing()
    plan = plan_assembly(parts, config=PipelineConfig(contacts=False))
    brought = plan.steps[-1]
    assert brought.held == ()
    (fit,) = brought.close_fits
    assert {fit.part, fit.other} == {"plate", "wheel"}
    assert "by close fits 1" in plan.verdict
    assert plan_from_json(plan_to_json(plan)).steps[-1].close_fits == brought.close_fits
    assert not any(step.hold_problems for step in verify_plan(plan, parts).steps)
    # the same is said of another line, or of nothing: then the wheel slides down
    beside = CloseFit(part=fit.part, other=fit.other, axis=fit.axis, point=(0.02, 0.0, 0.0))
    for said in ((beside,), ()):
        wrong = replace(plan, steps=(*plan.steps[:-1], replace(brought, close_fits=said)))
        found = verify_plan(wrong, parts)
        assert "floats or tips" in " ".join(problem for step in found.steps for problem in step.hold_problems)


def test_fits_can_be_left_out_of_account() -> None:
    config = PipelineConfig(contacts=False, stability=StabilityConfig(close_fits=False))
    plan = plan_assembly(standing(), config=config)
    assert plan.steps[-1].close_fits == ()
    assert plan.steps[-1].held != ()


def test_what_goes_over_the_next_shaft_slides() -> None:
    low, high = rod(0.006, 0.04, (0.0, 0.0, 0.02)), rod(0.006, 0.04, (0.0, 0.0, 0.06))
    parts = assembly(
        plate=box((0.1, 0.1, 0.01), (0.0, 0.0, -0.005)) + low,
        shaft=high,
        wheel_1=rod(0.03, 0.012, (0.0, 0.0, 0.02)) - low,
        wheel_2=rod(0.03, 0.012, (0.0, 0.0, 0.06)) - high,
    )
    bodies = make_bodies(parts)
    cascade = Cascade(parts, bodies, config=SeparateConfig())
    orderer = Orderer(cascade, bodies, config=SequenceConfig(), stability=StabilityConfig())
    assert {frozenset((fit.part, fit.other)) for fit in orderer.close_fits} == {
        frozenset(("plate", "wheel_1")),
        frozenset(("shaft", "wheel_2")),
    }
    model, mask = orderer.model, orderer.model.scene.mask
    up = np.array([0.0, 0.0, 1.0])
    wheel = Placing(members=mask(["wheel_1"]), exit_direction=up, rest=mask(["plate"]))
    assert model.of_placing(wheel, 0, up) == {}
    over = model.of_placing(replace(wheel, rest=mask(["plate", "shaft"])), 0, up)
    assert over == {"slides": pytest.approx((0.08 - 0.014) / model.scene.size)}
