"""Groups that leave at once, each by a translation of its own: found, planned, shown; and none where there are none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simultaneous_set import CASES, SimultaneousCase
from solids import assembly, box, pair_in_pair, peg_in_plate

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.masks import bits
from sashimono.disassembly.sequence.constraints import OrderConstraints
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.translation.simultaneous import SimultaneousConfig, find_simultaneous
from sashimono.geometry import se3
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan
from sashimono.verify import verify_plan
from sashimono.view.clip import ClipConfig, clip_steps, render_clip
from sashimono.view.config import ViewConfig
from sashimono.view.manual.content import make_manual
from sashimono.view.playback import played_steps
from sashimono.view.timeline import make_timeline, tracks

QUICK = PipelineConfig(contacts=False)


def cascade_of(parts: Assembly) -> Cascade:
    return Cascade(parts, make_bodies(parts), config=SeparateConfig())


def at_once(cascade: Cascade, remaining: int, **options: int) -> list[set[str]]:
    """The names of the groups that leave the remaining parts at once, past the first part."""
    found = cascade.find_simultaneous(remaining, stays=0, allowed=lambda groups: True, **options)
    return [{cascade.assembly.names[k] for k in bits(group.members)} for group in found]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_set_and_its_blocked_twins(case: SimultaneousCase) -> None:
    for is_open in (True, False):
        parts = case.assembly(is_open=is_open)
        cascade = cascade_of(parts)
        remaining = sum(1 << k for k, name in enumerate(parts.names) if name in ("base", *case.movers))
        groups = at_once(cascade, remaining)
        assert set().union(*groups) == (set(case.movers) if is_open else set())
        assert len(groups) == (3 if "slider_3" in case.movers else 2) * is_open
        if is_open and "key" in case.movers:
            assert {"slider_1", "key"} in groups


@pytest.fixture(scope="module")
def sliders() -> Assembly:
    return next(case for case in CASES if case.name == "two_75").assembly(is_open=True)


@pytest.fixture(scope="module")
def sliders_plan(sliders: Assembly) -> AssemblyPlan:
    return plan_assembly(sliders, config=QUICK)


def test_all_pass_one_another_along_the_straight_relative_motions(sliders: Assembly) -> None:
    cascade = cascade_of(sliders)
    found = cascade.find_simultaneous(cascade.parts.all_parts, stays=0, allowed=lambda groups: True)
    shifts = [group.removal.displacements[-1][:3, 3] for group in found]
    # the third side of the triangle is the rail that joins the two
    angle = np.radians(75.0)
    ways = np.array([[1.0, 0.0, 0.0], [np.cos(angle), np.sin(angle), 0.0]])
    lengths = np.linalg.norm(shifts, axis=1)
    np.testing.assert_allclose(lengths[0], lengths[1], rtol=1e-6)
    np.testing.assert_allclose(np.array(shifts) / lengths[:, None], np.sign(shifts[0] @ ways[0]) * ways, atol=1e-6)
    boxes = [part.bounds_world + shift for part, shift in zip(sliders.parts[1:], shifts, strict=True)]
    middle = np.array([corners.mean(axis=0) for corners in boxes])
    assert np.linalg.norm(middle[0] - middle[1]) > 0.05


def test_what_leaves_alone_or_as_one_body_is_no_business_of_it() -> None:
    cascade = cascade_of(peg_in_plate())
    assert at_once(cascade, 0b11) == []
    plan = plan_assembly(pair_in_pair(), config=QUICK)
    assert plan.status == "complete"
    assert any(step.moving for step in plan.steps)
    assert not any(step.simultaneous for step in plan.steps)


def test_only_what_must_move_does() -> None:
    """A loose block beside the sliders stays."""
    parts = CASES[0].assembly(is_open=True)
    loose = assembly(loose=box((0.01, 0.01, 0.01), (0.09, 0.09, 0.005))).parts
    both = Assembly(parts=(*parts.parts, *loose))
    cascade = cascade_of(both)
    found = cascade.find_simultaneous(cascade.parts.all_parts, stays=0, allowed=lambda groups: len(groups) > 1)
    assert sum(group.members for group in found) == 0b110


def test_budgets_end_it(sliders: Assembly) -> None:
    cascade = cascade_of(sliders)
    for config in (
        SimultaneousConfig(max_parts=2),
        SimultaneousConfig(max_programs=0),
        SimultaneousConfig(max_groups=1),
    ):
        touching = cascade._touching
        assert find_simultaneous(cascade.parts, touching, 0b111, stays=0, config=config) == ()


def taken_apart(cascade: Cascade, config: SequenceConfig, **options: Any) -> DisassemblyResult:
    return find_disassembly(cascade, config=config, **options)


def test_a_refused_set_is_not_proposed_again(sliders: Assembly) -> None:
    cascade = cascade_of(sliders)
    found = taken_apart(cascade, SequenceConfig())
    assert [departure.simultaneous for departure in found.removals] == [0b100, 0b010]
    refused = frozenset({found.removals[0].refusal})
    assert not found.avoids(refused, cascade.parts.all_parts)
    again = taken_apart(cascade, SequenceConfig(), refused=refused)
    assert again.removals == ()
    assert {part for part, _ in again.stuck} == {1, 2}


def test_a_precedence_that_it_breaks_keeps_it(sliders: Assembly) -> None:
    before = OrderConstraints(before=(("slider_1", "base"),))
    found = taken_apart(cascade_of(sliders), SequenceConfig(constraints=before))
    assert found.base == 1 or found.removals == ()


def test_the_plan_holds_and_says_so(sliders: Assembly, sliders_plan: AssemblyPlan) -> None:
    plan = sliders_plan
    assert plan.status == "complete"
    assert verify_plan(plan, sliders).ok
    first, second = plan.steps[1:]
    assert (first.simultaneous, second.simultaneous) == ((second.part,), (first.part,))
    assert first.fixed == second.fixed == ("base",)
    assert first.hands == second.hands == 2
    spans = [step.motion.times[-1] - step.motion.times[-2] for step in (first, second) if step.motion.times is not None]
    assert spans[0] == pytest.approx(spans[1], abs=1e-9)
    text = plan_to_json(plan)
    assert plan_to_json(plan_from_json(text)) == text
    assert plan_from_json(text).steps[1].simultaneous == first.simultaneous


def test_turned_as_a_whole_and_with_a_key_and_a_lid() -> None:
    case = CASES[-1]
    parts = case.assembly(is_open=True)
    T = se3.exp(np.array([0.1, 0.2, 0.0, 0.7, -0.4, 1.1]))
    turned = replace(parts, parts=tuple(replace(part, T_world_part=T @ part.T_world_part) for part in parts.parts))
    plan = plan_assembly(turned, config=QUICK)
    assert plan.status == "complete"
    assert {name for step in plan.steps if step.simultaneous for name in step.members} == set(case.movers)
    assert {step.hands for step in plan.steps if step.simultaneous} == {3}
    assert verify_plan(plan, turned).ok


def test_with_the_way_blocked_nothing_is_placed_and_nothing_crashes() -> None:
    plan = plan_assembly(CASES[0].assembly(is_open=False), config=QUICK)
    assert plan.status == "partial"
    assert plan.order == ("base",)


def test_they_are_shown_going_in_together(sliders: Assembly, sliders_plan: AssemblyPlan, tmp_path: Path) -> None:
    plan = sliders_plan
    played = played_steps(plan, sliders, ViewConfig())
    assert [[segment.kind for segment in entry.segments] for entry in played] == [
        [], ["transit", "wait", "insertion"], ["transit", "insertion"]
    ]  # fmt: skip
    timeline = make_timeline(plan, played, sliders, ViewConfig())
    shown = tracks(played, timeline, plan)
    names = [step.part for step in plan.steps[1:]]
    (first, first_times), (_, second_times) = (shown[name] for name in names)
    np.testing.assert_array_equal(first_times[-2:], second_times[-2:])
    assert (np.diff(first_times) > 0.0).all()
    np.testing.assert_array_equal(first[-3], first[-2])
    tasks = [task for chapter in make_manual(plan, sliders).chapters for task in chapter.tasks]
    assert [task.members for task in tasks] == [("base",), tuple(names)]
    steps = clip_steps(plan, sliders)
    assert [entry.step.part for entry in steps] == names[1:]
    assert render_clip(plan, sliders, steps, config=ClipConfig(width=80, height=60, frames=3, hold=1))[8:12] == b"WEBP"
