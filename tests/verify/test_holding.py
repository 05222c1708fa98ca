"""What falls: the check's answer, by motions, beside the planner's, by forces; and plans that say too little."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from solids import assembly, bolt, box, peg_in_plate, rod

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan, Table
from sashimono.stability import StabilityConfig, Statics, Touching, fewest_held
from sashimono.verify import Verifier, VerifyConfig, VerifyReport, sinking, verify_plan
from sashimono.verify.body import SampledBody
from sashimono.verify.holding import PlacedParts

UP = np.array([0.0, 0.0, 1.0])


def placed_parts(parts: Assembly) -> PlacedParts:
    bodies = {p.name: SampledBody(p.name, p.vertices_part, p.faces, samples=3000) for p in parts.parts}
    return PlacedParts(bodies, {p.name: p.T_world_part for p in parts.parts}, VerifyConfig())


def falling(parts: Assembly, floor: float, held: tuple[str, ...] = (), up: np.ndarray = UP) -> list[str]:
    return placed_parts(parts).falling(parts.names, held, Table(normal=up, offset=floor))


def tower(*shifts: float) -> Assembly:
    """Cubes of 20 mm, one on another, each at its shift [m]."""
    return assembly(**{f"c{k}": box((0.02, 0.02, 0.02), (x, 0.0, 0.01 + 0.02 * k)) for k, x in enumerate(shifts)})


def test_a_tower_stands_while_every_centre_above_is_carried() -> None:
    assert falling(tower(0.0, 0.008), 0.0) == []
    assert falling(tower(0.0, 0.012), 0.0) == ["c1"]
    assert falling(tower(0.0, 0.012), 0.0, held=("c1",)) == []
    assert falling(tower(0.0, 0.008, 0.016), 0.0) != []
    assert falling(tower(0.0, 0.0), -0.05) == ["c0", "c1"]


def test_a_peg_hangs_in_no_exact_hole_but_in_a_thread() -> None:
    assert falling(peg_in_plate(), -1.0, held=("plate",)) == ["peg"]
    tight = box((0.06, 0.06, 0.02)) - rod(0.0047, 0.04)
    assert falling(assembly(plate=tight, peg=rod(0.005, 0.04)), -1.0, held=("plate",)) == []
    block = box((0.04, 0.04, 0.03)) - bolt(0.006, 0.0015, 0.032)
    assert falling(assembly(block=block, screw=bolt(0.006, 0.0015, 0.03)), -1.0, held=("block",)) == []


@pytest.mark.parametrize("seed", range(12))
def test_both_routes_agree_on_towers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shifts = np.cumsum(rng.uniform(-0.009, 0.009, 5))
    # nearer to tipping than the tolerances of either: not a case on which they must agree
    margins = [0.01 - abs(shifts[k:].mean() - shifts[k - 1]) for k in range(1, 5)]
    if min(np.abs(margins)) < 5e-4:
        pytest.skip("on the brink")
    parts = tower(*shifts)
    poses = {part.name: part.T_world_part for part in parts.parts}
    statics = Statics(Touching(make_bodies(parts), poses, config=StabilityConfig()), Table(normal=UP, offset=0.0))
    found = fewest_held(statics, parts.names)
    check = placed_parts(parts)
    table = Table(normal=UP, offset=0.0)
    assert (min(margins) > 0.0) == (found.held == ())
    assert check.falling(parts.names, found.held, table) == []
    for fewer in combinations(parts.names, len(found.held) - 1) if found.held else ():
        assert check.falling(parts.names, fewer, table) != []


@pytest.fixture(scope="module")
def bridge() -> tuple[Assembly, AssemblyPlan]:
    """A bar that overhangs its post: it is held, until a weight on its other end balances it."""
    post = box((0.06, 0.06, 0.04), (0.0, 0.0, 0.02))
    bar = box((0.12, 0.02, 0.01), (0.045, 0.0, 0.045))
    weight = box((0.02, 0.03, 0.05), (-0.005, 0.0, 0.075))
    parts = assembly(post=post, bar=bar, weight=weight)
    return parts, plan_assembly(parts, config=PipelineConfig(contacts=False))


def test_a_plan_says_what_is_held_and_the_check_agrees(bridge: tuple[Assembly, AssemblyPlan]) -> None:
    parts, plan = bridge
    assert {step.part: step.held for step in plan.steps} == {"post": (), "bar": ("bar",), "weight": ()}
    assert [step.hands for step in plan.steps] == [0, 1, 2]
    report = verify_plan(plan, parts)
    assert report.ok
    assert all(not step.hold_problems for step in report.steps)
    # there is no contact
    assert plan.executable is False
    assert report.executable is False
    assert "held 1" in plan.verdict
    assert "fixture none" in plan.verdict


def changed(plan: AssemblyPlan, part: str, **fields: object) -> AssemblyPlan:
    steps = tuple(replace(step, **fields) if step.part == part else step for step in plan.steps)  # pyright: ignore[reportArgumentType]
    return replace(plan, steps=steps)


def problems(report: VerifyReport) -> str:
    return "; ".join(problem for step in report.steps for problem in step.hold_problems)


def test_a_plan_that_holds_too_little_is_not_executable(bridge: tuple[Assembly, AssemblyPlan]) -> None:
    parts, plan = bridge
    careless = verify_plan(changed(plan, "bar", held=()), parts)
    assert careless.ok
    assert "bar floats or tips, and is not held" in problems(careless)
    assert careless.lines()[-1].endswith("not executable")
    assert "takes 2 hands, not 1" in problems(verify_plan(changed(plan, "weight", hands=1), parts))
    assert "'weight' is held, but not in place" in problems(verify_plan(changed(plan, "bar", held=("weight",)), parts))


def test_a_base_in_the_air_needs_a_declared_fixture(bridge: tuple[Assembly, AssemblyPlan]) -> None:
    parts, plan = bridge
    table = Table(normal=UP, offset=-0.1)
    assert not Verifier(parts).check_holds(replace(plan, table=table))
    assert "post, bar" not in problems(verify_plan(plan, parts))
    lowered = verify_plan(replace(plan, table=table), parts)
    assert "post floats or tips, and is not held" in problems(lowered)


def test_an_older_plan_says_nothing_of_hands(bridge: tuple[Assembly, AssemblyPlan]) -> None:
    parts, plan = bridge
    old = replace(plan, executable=None, steps=tuple(replace(step, held=(), hands=None) for step in plan.steps))
    report = verify_plan(old, parts)
    assert report.ok
    assert report.executable is None


def test_executable_is_the_stronger_word() -> None:
    parts = tower(0.0, 0.0)
    plan = plan_assembly(parts)
    assert plan.executable is True
    assert verify_plan(plan, parts).executable is True
    assert plan.verdict.endswith("held 0 · turned over 0 · fixture none · executable")
    claimed = replace(changed(plan, plan.order[1], contact=None), executable=True)
    report = verify_plan(claimed, parts)
    assert report.executable is False
    assert any("called executable" in note for note in report.notes)


def test_one_hand_is_not_enough_for_a_hold(bridge: tuple[Assembly, AssemblyPlan]) -> None:
    parts, _ = bridge
    plan = plan_assembly(parts, config=PipelineConfig(hands=1))
    assert plan.hands == 1
    assert plan.executable is False
    assert max(step.hands or 0 for step in plan.steps) == 2
    assert plan_assembly(parts).executable is True


def test_what_comes_from_below_declares_a_fixture() -> None:
    plate = box((0.06, 0.06, 0.01), (0.0, 0.0, 0.03)) - rod(0.003, 0.2)
    screw = rod(0.0028, 0.02, (0.0, 0.0, 0.03)) + rod(0.006, 0.005, (0.0, 0.0, 0.0225))
    lid = box((0.03, 0.03, 0.01), (0.0, 0.0, 0.045))
    parts = assembly(plate=plate, screw=screw, lid=lid)
    plan = plan_assembly(parts, config=PipelineConfig(contacts=False))
    if plan.fixture is None:  # turned over by the planner: then the screw stands in its hole
        assert plan.table is not None
        assert plan.table.normal[2] < 0.0
    else:
        assert plan.fixture.parts == (plan.order[0],)
        assert plan.fixture.height > 0.0
    assert all(not step.hold_problems for step in verify_plan(plan, parts).steps)


@pytest.mark.parametrize("first", [1, 40, 10**9])
def test_however_few_forces_the_program_begins_with_the_same_falls(monkeypatch: pytest.MonkeyPatch, first: int) -> None:
    monkeypatch.setattr(sinking, "_FIRST_FORCES", first)
    monkeypatch.setattr(sinking, "_MORE_FORCES", 5)
    assert falling(tower(0.0, 0.008, 0.0085), 0.0) == []
    assert falling(tower(0.0, 0.012), 0.0) == ["c1"]
    rings = assembly(post=rod(0.004, 0.05), ring=rod(0.012, 0.01) - rod(0.0041, 0.03))
    low = float(rings.parts[0].vertices_world[:, 2].min())
    assert falling(rings, low) == ["ring"]
    assert falling(rings, low, held=("ring",)) == []


@pytest.mark.parametrize("seed", range(6))
def test_sets_asked_one_after_another_say_what_each_says_alone(seed: int) -> None:
    # towers beside one another on a slab, some of which tip, built up in any order, now and then with something held
    rng = np.random.default_rng(seed)
    solids = {"slab": box((0.3, 0.1, 0.01), (0.1, 0.0, -0.005))}
    for k in range(4):
        x = 0.06 * k
        for high, shift in enumerate(np.cumsum(rng.uniform(-0.008, 0.008, 3))):
            solids[f"t{k}_{high}"] = box((0.02, 0.02, 0.02), (x + shift, 0.0, 0.01 + 0.02 * high))
    parts = assembly(**solids)
    table = Table(normal=UP, offset=-0.01)
    order = ["slab", *(f"t{k}_{high}" for high in range(3) for k in rng.permutation(4))]
    one_after_another = placed_parts(parts)
    for count in range(1, len(order) + 1):
        placed = order[:count]
        held = {str(name) for name in rng.choice(placed, rng.integers(0, 3))}
        alone = placed_parts(parts).falling(placed, held, table)
        assert one_after_another.falling(placed, held, table) == alone
