"""Groups that leave at once, each by a translation of its own: found, planned, shown; and none where there are none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simultaneous_set import CASES, GroupCase
from solids import assembly, box, pair_in_pair, peg_in_plate, rod

from sashimono.assembly import Assembly, Product
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.masks import bits
from sashimono.disassembly.sequence.constraints import OrderConstraints
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.sequence.order import Orderer
from sashimono.disassembly.translation.simultaneous import SimultaneousConfig, find_simultaneous
from sashimono.geometry import se3
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, _with_fasteners, plan_assembly
from sashimono.plan import AssemblyPlan
from sashimono.stability import StabilityConfig
from sashimono.verify import verify_plan
from sashimono.view.clip import ClipConfig, clip_steps, render_clip
from sashimono.view.config import ViewConfig
from sashimono.view.manual.content import make_manual
from sashimono.view.mjcf import keyframes
from sashimono.view.mtc import mtc_data
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
def test_the_set_and_its_blocked_twins(case: GroupCase) -> None:
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


@pytest.mark.parametrize("first", ["slider_1", "slider_2"])
def test_at_the_same_time_is_not_earlier(sliders: Assembly, first: str) -> None:
    second = {"slider_1": "slider_2", "slider_2": "slider_1"}[first]
    before = OrderConstraints(before=((first, second),))
    found = taken_apart(cascade_of(sliders), SequenceConfig(constraints=before))
    assert found.removals == ()
    assert any("--before" in said.reason for _, said in found.stuck)


def test_a_product_that_goes_in_at_the_same_time_as_others_keeps_its_name() -> None:
    parts = next(case for case in CASES if case.name == "two_90_key").assembly(is_open=True)
    parts = replace(parts, products=(Product(name="slide", parts=("slider_1", "key")),))
    plan = plan_assembly(parts, config=QUICK)
    assert plan.status == "complete"
    assert [entry.planned for entry in plan.products] == ["subassembly"]
    assert [step.product for step in plan.steps if step.moving] == ["slide"]


def test_a_close_fit_between_two_that_go_in_at_once_is_stated_by_the_later_one() -> None:
    """A shaft in a gear's bore, both brought at the same time: the fit holds the gear."""
    shaft = rod(0.005, 0.06, (0.0, 0.0, 0.03))
    gear = rod(0.02, 0.01, (0.0, 0.0, 0.03)) - rod(0.005, 0.1)
    parts = assembly(base=box((0.1, 0.1, 0.01), (0.0, 0.0, -0.005)), shaft=shaft, gear=gear)
    plan = plan_assembly(parts, config=QUICK)
    others = {"shaft": "gear", "gear": "shaft"}
    together = [
        replace(step, fixed=("base",), simultaneous=(others[step.part],)) if step.part in others else step
        for step in plan.steps
    ]
    orderer = Orderer(cascade_of(parts), make_bodies(parts), config=SequenceConfig(), stability=StabilityConfig())
    stated = [len(step.close_fits) for step in _with_fasteners(together, orderer)]
    assert stated == [0, 0, 1]


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
    moments = dict(keyframes(plan, sliders))
    there = plan.steps[1].motion.T_world_part
    np.testing.assert_allclose(moments[f"2 {names[0]}"][names[0]], there[-2], atol=1e-12)
    np.testing.assert_allclose(moments[f"3 {names[1]}"][names[0]], there[-1], atol=1e-12)
    assert all("at the same time as" in step["by_hand"] for step in mtc_data(plan, sliders)["steps"][1:])
    tasks = [task for chapter in make_manual(plan, sliders).chapters for task in chapter.tasks]
    assert [task.members for task in tasks] == [("base",), tuple(names)]
    steps = clip_steps(plan, sliders)
    assert [entry.step.part for entry in steps] == names[1:]
    assert render_clip(plan, sliders, steps, config=ClipConfig(width=80, height=60, frames=3, hold=1))[8:12] == b"WEBP"
