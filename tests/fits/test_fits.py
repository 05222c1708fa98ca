"""Elastic parts: which are told, which are not, what is declared of them, and what comes of it in a plan."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from elastic_set import ELASTIC, RIGID, FitCase, coil, hooks, ring, torus, wedge
from solids import assembly as assembly_of
from solids import box, rod
from tilt_set import part_of

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.console import summary_lines
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.free_travel import free_travel
from sashimono.errors import PlanFormatError
from sashimono.fits.arms import find_arm
from sashimono.fits.config import FitConfig
from sashimono.fits.find import FitFinder
from sashimono.fits.shapes import elastic_shape
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import DeclaredFit
from sashimono.verify import verify_plan

BY_NAME = {case.name: case for case in (*ELASTIC, *RIGID)}
QUICK = ("circlip", "o_ring", "spring_on_post", "snap_lid", "press_disc")
ALIKE = ("closed_ring_12.5_0.4", "thick_c_8_60", "thick_hooks_5", "backed_hooks_0.1", "dumbbell_4.6_8", "bridge_2")
CHEAP = PipelineConfig(contacts=False, separate=SeparateConfig(max_traced=20_000))


def fits_of(parts: Assembly) -> tuple[DeclaredFit, ...]:
    cascade = Cascade(parts, make_bodies(parts), config=SeparateConfig())
    return FitFinder(cascade.parts, config=FitConfig()).find(cascade.parts.all_parts)


def shape_of(solid: object, axis: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> str | None:
    part = part_of("it", solid)
    body = make_bodies(Assembly(parts=(part,)))["it"]
    found = elastic_shape(body, np.array([axis]), config=FitConfig())
    return None if found is None else found.kind


@pytest.mark.parametrize("name", QUICK)
def test_what_has_to_give_is_told_with_the_depth_that_it_was_built_with(name: str) -> None:
    case = BY_NAME[name]
    (fit,) = fits_of(case.assembly())
    assert fit.kind == case.kind
    assert case.depth * 0.98e-3 < fit.depth < case.depth * 1.25e-3
    assert fit.reason.startswith("elastic: ")


@pytest.mark.parametrize("name", ALIKE)
def test_what_looks_alike_and_cannot_give_is_not_told(name: str) -> None:
    assert fits_of(BY_NAME[name].assembly()) == ()


@pytest.mark.slow
@pytest.mark.parametrize("case", RIGID, ids=lambda case: case.name)
def test_no_rigid_one_is_told(case: FitCase) -> None:
    assert fits_of(case.assembly()) == ()


@pytest.mark.slow
@pytest.mark.parametrize("case", ELASTIC, ids=lambda case: case.name)
def test_each_elastic_one_is_told(case: FitCase) -> None:
    assert [fit.kind for fit in fits_of(case.assembly())] == [case.kind]


@pytest.mark.parametrize("height", [0.125, 0.5, 1.0])
def test_the_root_of_an_arm_is_found_from_anywhere_on_a_lip_as_thick_as_the_arm(height: float) -> None:
    """The middle of arm and lip together lies in the face of the arm below the lip."""
    arm = box((0.5, 2.0, 6.0), (0.25, 0.0, -1.0)) + box((0.5, 2.0, 2.0), (0.75, 0.0, 1.0))
    hook = assembly_of(hook=arm + box((5.0, 4.0, 2.0), (0.5, 0.0, -5.0)))
    pressed, inwards = np.array([1.0, 0.3, height]), np.array([-1.0, 0.0, 0.0])
    found = find_arm(make_bodies(hook)["hook"], pressed, inwards, 0.1, config=FitConfig())
    assert found is not None
    assert found[0].thickness == pytest.approx(0.5)
    assert found[0].length == pytest.approx(4.0 + height, abs=0.4)


def test_shapes_that_are_elastic_in_themselves() -> None:
    assert shape_of(ring(9.6, 12.0, (0.0, 1.0)) - wedge(40.0, 20.0, (-1.0, 2.0))) == "ring"
    assert shape_of(coil(6.0, 0.8, 3.2, 5.0)) == "spring"
    assert shape_of(torus(10.0, 1.0)) == "seal"


def test_shapes_that_are_not() -> None:
    assert shape_of(ring(9.6, 12.0, (0.0, 1.0))) is None
    assert shape_of(ring(5.0, 12.0, (0.0, 1.0)) - wedge(40.0, 20.0, (-1.0, 2.0))) is None
    assert shape_of(torus(10.0, 4.5)) is None
    assert shape_of(coil(6.0, 2.4, 6.0, 4.0)) is None


def test_a_part_that_leaves_by_itself_needs_no_fit() -> None:
    lid = hooks(1.5)["lid"]
    far = Assembly(parts=(part_of("lid", lid), part_of("far", lid.translate((0.0, 0.0, 60.0)))))
    assert fits_of(far) == ()


def test_a_fit_is_of_its_pair_alone() -> None:
    parts = BY_NAME["snap_lid"].assembly()
    post = replace(parts.parts[1], name="second")
    three = Assembly(parts=(*parts.parts, replace(post, T_world_part=np.diag([1.0, 1.0, 1.0, 1.0]))))
    placed = Cascade(three, make_bodies(three), config=SeparateConfig()).parts
    up = np.array([0.0, 0.0, 1.0])
    given = placed.with_fits({(0, 1): 0.45e-3})
    assert np.isinf(free_travel(given, 1, np.zeros(3), up, 0))
    assert np.isfinite(free_travel(given, 2, np.zeros(3), up, 0))
    assert np.isfinite(free_travel(placed, 1, np.zeros(3), up, 0))
    assert np.isfinite(free_travel(placed.with_fits({(0, 1): 0.36e-3}), 1, np.zeros(3), up, 0))


@pytest.mark.slow
def test_a_plan_declares_the_fit_that_it_needs(tmp_path: Path) -> None:
    parts = BY_NAME["snap_lid"].assembly()
    plan = plan_assembly(parts, config=CHEAP)
    assert plan.status == "complete"
    (fit,) = plan.fits
    assert fit.parts == ("lid", "box")
    assert "1 fit declared" in plan.verdict
    lines = summary_lines(plan, parts)
    assert lines[0] == "complete and verified, 1 fit declared: 2 of 2 parts placed"
    assert any(line.startswith("fit declared: lid and box, snap; elastic: 0.4") for line in lines)
    report = verify_plan(plan, parts)
    assert report.ok
    assert any("1 fit declared" in line for line in report.lines())
    again = plan_from_json(plan_to_json(plan))
    assert again.fits == plan.fits
    rigid = plan_assembly(parts, config=replace(CHEAP, fits=FitConfig(enabled=False)))
    assert rigid.status == "partial"
    assert rigid.fits == ()


@pytest.mark.slow
def test_a_network_s_order_declares_the_same_fit() -> None:
    parts = BY_NAME["snap_lid"].assembly()
    plan = plan_assembly(parts, config=replace(CHEAP, method="past"))
    assert plan.status == "complete"
    assert [fit.parts for fit in plan.fits] == [("lid", "box")]


def test_a_plan_that_is_complete_without_declares_nothing() -> None:
    parts = assembly_of(plug=rod(0.004, 0.02))
    both = Assembly(parts=(*parts.parts, part_of("other", hooks(1.5)["lid"].translate((0.0, 0.0, 50.0)))))
    plan = plan_assembly(both, config=CHEAP)
    assert plan.status == "complete"
    assert plan.fits == ()


def test_a_kind_that_there_is_not_is_refused_by_the_reader() -> None:
    parts = BY_NAME["snap_lid"].assembly()
    plan = plan_assembly(Assembly(parts=parts.parts[:1]), config=CHEAP)
    fit = DeclaredFit(parts=("lid", "box"), kind="snap", depth=1e-4, reason="")
    text = plan_to_json(replace(plan, fits=(fit,))).replace('"snap"', '"magic"')
    with pytest.raises(PlanFormatError, match=r"fits\[0\].kind"):
        plan_from_json(text)
