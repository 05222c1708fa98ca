"""Threads drawn as plain cylinders are declared and turned; pins leave along themselves, not through the wood."""

from __future__ import annotations

import dataclasses
from itertools import pairwise

import manifold3d
import numpy as np
import pytest
from solids import assembly, box, part, rod

from sashimono.assembly import Assembly, Source
from sashimono.bodies import make_bodies
from sashimono.console import summary_lines
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.threads.declared import DeclareConfig
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import Screw, between
from sashimono.geometry.features.tube import TubeConfig, fit_tube, shared_body
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan, DeclaredHelix
from sashimono.verify import verify_plan

Z = np.array([0.0, 0.0, 1.0])
M6 = 0.001


def screw(head: manifold3d.Manifold | None = None, *, radius: float = 0.003) -> manifold3d.Manifold:
    """A shank 12 mm long, 8 mm of it below z = 0, with a head on it."""
    return rod(radius, 0.012, (0.0, 0.0, -0.002)) + (head or rod(0.005, 0.004, (0.0, 0.0, 0.006)))


def screwed(
    hole: float = 0.0025, *, radius: float = 0.003, head: manifold3d.Manifold | None = None, **more: manifold3d.Manifold
) -> Assembly:
    """A screw in a block whose hole is narrower than its shank."""
    block = box((0.03, 0.03, 0.02), (0.0, 0.0, -0.01)) - rod(hole, 0.03, (0.0, 0.0, -0.01))
    return assembly(block=block, screw=screw(head, radius=radius), **more)


def taken_apart(parts: Assembly, *, enabled: bool = True) -> DisassemblyResult:
    config = SeparateConfig(declare=DeclareConfig(enabled=enabled))
    return find_disassembly(Cascade(parts, make_bodies(parts), config=config), config=SequenceConfig())


def test_coarse_pitches_are_those_of_iso_261() -> None:
    config = DeclareConfig()
    for diameter, pitch in ((3.0, 0.5), (6.0, 1.0), (5.88, 1.0), (8.0, 1.25), (20.0, 2.5), (64.0, 6.0), (90.0, 6.0)):
        assert config.pitch(1e-3 * diameter) == pytest.approx(1e-3 * pitch)
    assert config.pitch(0.009) == pytest.approx(0.001375)


@pytest.mark.parametrize(("hole", "is_thread"), [(0.0025, True), (0.00295, False), (0.0015, False), (0.0, False)])
def test_a_thin_coaxial_tube_is_a_thread(hole: float, is_thread: bool) -> None:
    T = se3.exp(np.array([0.1, 0.2, -0.1, 0.5, -0.7, 0.2]))
    block = box((0.03, 0.03, 0.02), (0.0, 0.0, -0.01))
    parts = [part("block", block - rod(hole, 0.05) if hole else block), part("screw", screw())]
    moved = Assembly(parts=tuple(dataclasses.replace(p, T_world_part=T) for p in parts))
    bodies = make_bodies(moved)
    shared = shared_body(bodies["block"], bodies["screw"], T, T)
    assert shared is not None
    tube = fit_tube(shared, T[:3, :3] @ Z, config=TubeConfig())
    assert (tube is not None) == is_thread
    if tube is not None:
        assert tube.outer_radius == pytest.approx(0.003, rel=0.01)
        assert tube.inner_radius == pytest.approx(hole, rel=0.01)
        np.testing.assert_allclose(np.cross(tube.point - T[:3, 3], T[:3, :3] @ Z), 0.0, atol=1e-5)
        assert fit_tube(shared, T[:3, 0], config=TubeConfig()) is None


def test_two_pins_in_one_part_are_no_thread() -> None:
    pins = (
        rod(0.003, 0.01, (0.01, 0.0, 0.0))
        + rod(0.003, 0.01, (-0.01, 0.0, 0.0))
        + box((0.03, 0.01, 0.002), (0.0, 0.0, 0.006))
    )
    holes = rod(0.0025, 0.03, (0.01, 0.0, 0.0)) + rod(0.0025, 0.03, (-0.01, 0.0, 0.0))
    found = taken_apart(assembly(block=box((0.05, 0.05, 0.01)) - holes, pins=pins))
    assert [departure.separation.declared for departure in found.removals] == [None]


def test_a_screw_without_ridges_is_turned_out_by_its_standard_pitch() -> None:
    found = taken_apart(screwed())
    (departure,) = found.removals
    thread, removal = departure.separation.declared, departure.separation.removal
    assert thread is not None
    assert removal is not None
    assert thread.pitch == pytest.approx(M6)
    turns = [Screw.of(between(a, b)) for a, b in pairwise(removal.displacements[: thread.stretches + 1])]
    assert max(turn.angle for turn in turns) < np.pi / 3.0
    assert 2.0 * np.pi * turns[0].pitch == pytest.approx(M6)
    assert sum(turn.angle for turn in turns) / (2.0 * np.pi) == pytest.approx(8.0, abs=0.5)
    (straight,) = taken_apart(screwed(), enabled=False).removals
    assert straight.separation.declared is None
    assert straight.separation.removal is not None
    assert len(straight.separation.removal.displacements) == 2


def test_a_head_that_cannot_turn_is_pulled() -> None:
    """A square head between two walls: the turn is blocked, the straight pull is free and unflagged."""
    walls = box((0.03, 0.004, 0.012), (0.0, 0.0071, 0.006)) + box((0.03, 0.004, 0.012), (0.0, -0.0071, 0.006))
    found = taken_apart(screwed(head=box((0.01, 0.01, 0.004), (0.0, 0.0, 0.006)), walls=walls))
    departure = next(d for d in found.removals if d.separation.removal is not None and d.part == 1)
    assert departure.separation.declared is None


def planned() -> tuple[AssemblyPlan, Assembly]:
    short = assembly(block=box((0.03, 0.03, 0.02), (0.0, 0.0, -0.015)) - rod(0.0025, 0.06), screw=screw())
    parts = dataclasses.replace(short, source=Source(path="screw", sha256="00", unit="m"))
    return plan_assembly(
        parts, config=PipelineConfig(contacts=False, separate=SeparateConfig(declare=DeclareConfig(enabled=True)))
    ), parts


def test_the_plan_flags_it_and_the_check_holds_it_to_it() -> None:
    plan, parts = planned()
    assert plan.status == "complete"
    step = next(step for step in plan.steps if step.part == "screw")
    helix = step.declared
    assert helix is not None
    assert (helix.other, helix.stop) == ("block", len(step.motion.T_world_part) - 1)
    np.testing.assert_allclose(helix.axis, -Z, atol=1e-6)
    again = plan_from_json(plan_to_json(plan))
    assert plan_to_json(again) == plan_to_json(plan)
    assert any("declared: the CAD has no thread" in line for line in summary_lines(again, parts))
    assert verify_plan(again, parts).ok

    def refuted(changed: DeclaredHelix) -> bool:
        steps = tuple(dataclasses.replace(s, declared=changed) if s.part == "screw" else s for s in plan.steps)
        return not verify_plan(dataclasses.replace(plan, steps=steps), parts).ok

    assert refuted(dataclasses.replace(helix, pitch=1.01 * helix.pitch))
    assert refuted(dataclasses.replace(helix, point=helix.point + 1e-4 * np.eye(3)[0]))
    assert refuted(dataclasses.replace(helix, axis=-helix.axis))
    assert refuted(dataclasses.replace(helix, start=0))
    assert refuted(dataclasses.replace(helix, other="nothing"))


def test_a_pin_leaves_solid_wood_along_itself() -> None:
    """Sideways too it goes no deeper than as assembled; the rest of the way is through wood."""
    pin = rod(0.0015, 0.02, (0.0, 0.0, 0.011))
    wood = box((0.06, 0.06, 0.02))
    found = taken_apart(assembly(wood=wood, pin=pin.rotate((0.0, 90.0, 0.0)).translate((0.02, 0.0, 0.0))))
    (departure,) = found.removals
    assert departure.separation.removal is not None
    np.testing.assert_allclose(departure.separation.removal.exit_direction, [1.0, 0.0, 0.0], atol=1e-6)
