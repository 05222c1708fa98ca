"""Declared fits as the check sees them: no deeper than stated, for that pair only, and never as deep as one likes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from elastic_set import hooks, ring, wedge
from tilt_set import part_of, rod, span

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan, DeclaredFit, Motion, Segment, Source, Step
from sashimono.verify import VerifyConfig, verify_plan
from sashimono.verify.body import SampledBody
from sashimono.verify.fits import largest_fit

MM = 1e-3


def lid_on_box() -> Assembly:
    """A box, a lid whose hooks are 0.4 mm wider than its walls let pass, and a weight beside them."""
    solids = {**hooks(1.5), "weight": span((40, 60), (-10, 10), (-16, 4))}
    return Assembly(parts=tuple(part_of(name, solid) for name, solid in solids.items()))


def bring(name: str, fixed: tuple[str, ...], *offsets: tuple[float, float, float]) -> Step:
    """A step through these offsets from the assembled pose [mm]."""
    poses = np.array([se3.make(translation=np.array(offset) * MM) for offset in offsets])
    segments = (Segment(kind="insertion", start=0, stop=len(poses) - 1),) if len(poses) > 1 else ()
    return Step(part=name, fixed=fixed, motion=Motion(T_world_part=poses, segments=segments), contact=None)


def lid_plan(*offsets: tuple[float, float, float], **fields: Any) -> AssemblyPlan:
    """The box, the weight, then the lid from 40 mm above, by way of these offsets [mm]."""
    parts = lid_on_box()
    steps = (
        bring("box", (), (0.0, 0.0, 0.0)),
        bring("weight", ("box",), (0.0, 0.0, 90.0), (0.0, 0.0, 0.0)),
        bring("lid", ("box", "weight"), (0.0, 0.0, 40.0), *offsets, (0.0, 0.0, 0.0)),
    )
    return AssemblyPlan(
        status="complete",
        source=Source(path="", sha256="", unit="m"),
        parts={part.name: part.T_world_part for part in parts.parts},
        order=tuple(step.part for step in steps),
        steps=steps,
        **fields,
    )


def fit(depth: float, *parts: str) -> DeclaredFit:
    """A fit of this depth [mm], of lid and box unless others are named."""
    first, second = parts or ("lid", "box")
    return DeclaredFit(parts=(first, second), kind="snap", depth=depth * MM, reason="by hand")


def said(plan: AssemblyPlan) -> list[str]:
    report = verify_plan(plan, lid_on_box())
    return [*report.problems, *(problem for step in report.steps for problem in step.problems)]


def test_a_fit_lets_its_pair_go_as_deep_as_it_says_and_is_told() -> None:
    report = verify_plan(lid_plan(fits=(fit(0.45),)), lid_on_box())
    assert report.ok
    assert report.fits == 1
    ((names, depth),) = report.steps[2].fits
    assert names == ("lid", "box")
    assert depth == pytest.approx(0.4 * MM, abs=0.01 * MM)
    assert "a declared fit with box 0.4" in report.steps[2].line()


def test_without_one_it_is_refuted() -> None:
    (problem,) = said(lid_plan())
    assert "mm deep into box" in problem


def test_a_fit_that_is_not_needed_is_not_told() -> None:
    report = verify_plan(lid_plan(fits=(fit(0.45), fit(0.3, "lid", "weight"))), lid_on_box())
    assert report.ok
    assert [names for step in report.steps for names, _ in step.fits] == [("lid", "box")]


@pytest.mark.parametrize("depth", [0.3, 0.38])
def test_deeper_than_declared_is_refuted(depth: float) -> None:
    (problem,) = said(lid_plan(fits=(fit(depth),)))
    assert "mm deep into box" in problem


def test_a_fit_of_another_pair_excuses_nothing() -> None:
    assert said(lid_plan(fits=(fit(0.45, "lid", "weight"),)))
    assert said(lid_plan(fits=(fit(0.45, "weight", "box"),)))


def test_a_motion_that_goes_deeper_half_way_is_refuted() -> None:
    # 0.3 mm aside while the hooks pass the rim: one of them is 0.7 mm deep
    aside = ((0.3, 0.0, 20.0), (0.3, 0.0, 2.0), (0.0, 0.0, 1.9))
    assert said(lid_plan(*aside, fits=(fit(0.45),)))
    assert said(lid_plan(*aside, fits=(fit(0.65),)))
    assert not said(lid_plan(*((0.0, y, z) for _, y, z in aside), fits=(fit(0.45),)))


def test_a_fit_deeper_than_parts_of_these_sizes_can_give_is_refuted() -> None:
    (problem,) = said(lid_plan(fits=(fit(5.0),)))
    assert "can give" in problem


def test_a_fit_is_no_way_through_a_wall() -> None:
    # sideways through the wall of the box
    through = ((60.0, 0.0, 40.0), (60.0, 0.0, 0.0))
    plan = lid_plan(*through, fits=(fit(0.7),))
    assert any("deep into box" in problem for problem in said(plan))


@pytest.mark.parametrize(
    ("fits", "words"),
    [
        ((fit(0.4), fit(0.3, "box", "lid")), "more than once"),
        ((fit(0.4, "lid", "lid"),), "two parts"),
        ((fit(0.4, "lid", "nobody"),), "not in the assembly"),
        ((fit(-0.4),), "no positive depth"),
        ((fit(float("nan")),), "no positive depth"),
    ],
)
def test_fits_that_say_nothing_sound_are_refused(fits: tuple[DeclaredFit, ...], words: str) -> None:
    assert any(words in problem for problem in said(lid_plan(fits=fits)))


def test_a_fit_excuses_nothing_of_parts_that_still_rest() -> None:
    plan = lid_plan(fits=(fit(0.45),))
    # the weight is brought past where the lid rests, through it
    resting = replace(plan.steps[1], motion=bring("weight", (), (-40.0, 0.0, 40.0), (0.0, 0.0, 0.0)).motion)
    through = replace(plan, steps=(plan.steps[0], resting, plan.steps[2]), fits=(fit(0.45), fit(0.4, "weight", "lid")))
    assert any("deep into lid" in problem for problem in said(through))


def test_how_much_a_pair_can_give() -> None:
    def body(solid: Any) -> SampledBody:
        part = part_of("it", solid)
        return SampledBody("it", part.vertices_part, part.faces, samples=1000)

    config = VerifyConfig()
    cube, plate = body(span((0, 20), (0, 20), (0, 20))), body(span((0, 60), (0, 40), (0, 4)))
    shaft, clip = body(rod(10.0, (0.0, 40.0))), body(ring(9.6, 12.0, (0, 1)) - wedge(40.0, 20.0, (-1, 2)))
    assert largest_fit(cube, cube, config) == pytest.approx(config.relative_fit * 20 * MM)
    assert largest_fit(cube, plate, config) == pytest.approx(config.relative_fit * 4 * MM)
    # a circlip gives more than a share of its thickness
    assert config.relative_fit * 1 * MM < 0.4 * MM < largest_fit(clip, shaft, config) < 2 * MM


def test_a_fit_lets_nothing_slip_through_a_thin_wall() -> None:
    # angles of sheet 0.8 mm thick: no point of either is ever deeper in the other than 0.4 mm
    wall = span((-15, 15), (-0.4, 0.4), (0, 20)) + span((-15, 15), (-0.4, 20), (-0.8, 0.1))
    blade = span((-5, 5), (-20, -12), (10, 10.8)) + span((-5, 5), (-12.8, -12), (10, 16))
    parts = Assembly(parts=(part_of("wall", wall), part_of("blade", blade)))
    steps = (bring("wall", (), (0.0, 0.0, 0.0)), bring("blade", ("wall",), (0.0, 50.0, 0.0), (0.0, 0.0, 0.0)))
    through = AssemblyPlan(
        status="complete",
        source=Source(path="", sha256="", unit="m"),
        parts={part.name: part.T_world_part for part in parts.parts},
        order=("wall", "blade"),
        steps=steps,
        fits=(fit(0.5, "blade", "wall"),),
    )
    report = verify_plan(through, parts)
    assert not report.problems  # parts of these sizes could give so much
    (problem,) = report.steps[1].problems
    assert "slips through wall" in problem
