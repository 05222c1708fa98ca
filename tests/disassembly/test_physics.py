"""Pushes with contact and friction: known answers, invariance, and the same answer for any number of workers."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from solids import assembly, bayonet, box, linked_rings, peg_in_plate, rod

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics.contact_solver import Contacts, sliding_twist
from sashimono.disassembly.physics.push import SimulateConfig, simulate
from sashimono.disassembly.physics.search import PhysicsConfig, PhysicsResult, pushes_at, search_physics
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.geometry import se3
from sashimono.geometry.body import SampleConfig
from sashimono.geometry.distance.screw import Screw, adjoint, advance_along_screw, between
from sashimono.io.read import read_assembly

SOLVER = {"friction": 0.2, "iterations": 200, "tolerance": 1e-9}


def placed(parts: Assembly, samples: SampleConfig | None = None) -> PlacedParts:
    return PlacedParts(parts, make_bodies(parts, config=samples), config=PlacedPartsConfig())


def moved(parts: Assembly, T: np.ndarray) -> Assembly:
    return Assembly(parts=tuple(replace(p, T_world_part=T @ p.T_world_part) for p in parts.parts))


def searched(parts: Assembly, name: str) -> PhysicsResult:
    there = placed(parts)
    index = parts.index(name)
    others = bits(there.all_parts & ~(1 << index))
    found = search_physics(there, index, others, config=PhysicsConfig())
    if found.removal is not None:  # what a search claims, the check must grant
        assert Paths(there, index, others, tolerance=0.015).check(found.removal.displacements)
    return found


def slanted_slot(angle: float) -> Assembly:
    """A block in a fitting slot that leaves along a slope in the x-z plane; walls on all sides but the open end."""
    turned = se3.exp_so3(np.array([0.0, -angle, 0.0]))
    frame = np.concatenate([turned, np.zeros((3, 1))], axis=1)
    slider = box((0.02, 0.01, 0.01)).transform(frame)
    slot = box((0.08, 0.01, 0.01), (0.03, 0.0, 0.0)).transform(frame)
    return assembly(block=box((0.05, 0.04, 0.05)) - slot, slider=slider)


def test_a_push_along_a_wall_slides_and_one_within_the_friction_cone_sticks() -> None:
    feet = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    floor = Contacts(np.tile([0.0, 0.0, 1.0], (4, 1)), feet, np.zeros(4))

    def pushed(angle: float) -> np.ndarray:
        push = np.array([np.sin(angle), 0.0, -np.cos(angle), 0.0, 0.0, 0.0])
        return sliding_twist(floor, push, **SOLVER)

    np.testing.assert_allclose(pushed(np.arctan(0.15)), 0.0, atol=1e-6)
    slid = pushed(np.radians(60.0))
    # overdamped: what friction leaves of the tangential push, none of the normal one
    np.testing.assert_allclose(slid[2], 0.0, atol=1e-6)
    assert slid[0] == pytest.approx(np.sin(np.radians(60.0)) - 0.2 * np.cos(np.radians(60.0)), rel=0.05)


def test_marching_along_a_screw_stops_where_the_distance_says() -> None:
    parts = assembly(wall=box((0.02, 0.02, 0.02)))
    field = make_bodies(parts)["wall"].signed_distance
    point = np.array([[0.03, 0.0, 0.0]])
    about_z = np.array([0.0, 0.0, 0.001, 0.0, 0.0, np.pi])
    # a half turn about (0.0201, 0, 0) passes the wall, whose face is at x = 0.01; one about (0.019, 0, 0) does not
    options = {"limit": 1e-6, "least_step": 1e-6}
    past = adjoint(se3.make(None, np.array([0.0201, 0.0, 0.0])), about_z)
    assert np.isinf(advance_along_screw(field, point, past, **options)[0])
    twist = adjoint(se3.make(None, np.array([0.019, 0.0, 0.0])), about_z)
    met = np.arccos(-9.0 / 11.0) / np.pi
    assert advance_along_screw(field, point, twist, **options)[0] == pytest.approx(met, abs=1e-3)
    screw = Screw.of(twist)
    np.testing.assert_allclose(screw.axis, [0.0, 0.0, 1.0], atol=1e-12)
    assert screw.pitch == pytest.approx(0.001 / np.pi)
    T = se3.exp(np.array([0.1, 0.2, 0.3, 0.4, -0.5, 0.6]))
    np.testing.assert_allclose(se3.exp(between(np.eye(4), T)), T, atol=1e-12)


@pytest.mark.parametrize("seed", range(2))
def test_marching_along_a_screw_agrees_with_looking_everywhere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    block = box((0.04, 0.03, 0.02)) - rod(0.006, 0.05, segments=24)
    field = make_bodies(assembly(wall=block))["wall"].signed_distance
    limit, step, looks = 1e-4, 2e-4, 800
    for start in rng.uniform(-0.03, 0.03, (6, 3)):
        twist = np.concatenate([rng.uniform(-0.02, 0.02, 3), rng.uniform(-1.0, 1.0, 3)])
        if seed % 2:  # in the hole, along its facets
            start, twist = np.append(0.0059 * np.array([np.cos(start[0]), np.sin(start[0])]), 0.0), np.zeros(6)
            twist[3:] = [0.0, 0.0, rng.uniform(0.5, 2.0)]
        path = np.array([se3.apply(se3.exp(u * twist), start[None])[0] for u in np.linspace(0.0, 1.0, looks)])
        deep = np.flatnonzero(-field.query(path) > limit)
        found, _ = advance_along_screw(field, start[None], twist, limit=limit, least_step=step)
        if not len(deep):
            assert np.isinf(found)
        elif np.isfinite(found):
            slack = 2.0 * step / np.linalg.norm(np.diff(path, axis=0), axis=1).sum() + 1.0 / looks
            assert deep[0] / looks - 1.0 / looks <= found <= deep[0] / looks + slack
        else:  # only what is deep for less than a step is jumped
            assert np.linalg.norm(path[deep[-1]] - path[deep[0]]) < step


@pytest.mark.parametrize("angle", [0.3, 0.7])
def test_a_block_pushed_sideways_slides_out_of_a_slanted_slot(angle: float) -> None:
    parts = slanted_slot(angle)
    paths = Paths(placed(parts), 1, [0], tolerance=0.0075)
    outcome = simulate(paths, np.eye(4), np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0]), config=SimulateConfig())
    assert outcome.exit_direction is not None
    np.testing.assert_allclose(outcome.exit_direction, [np.cos(angle), 0.0, np.sin(angle)], atol=1e-3)


def test_a_peg_leaves_along_its_hole_both_ways() -> None:
    parts = peg_in_plate()
    paths = Paths(placed(parts), 1, [0], tolerance=0.0075)
    ways = set()
    for push in pushes_at(paths, np.eye(4), config=PhysicsConfig()):
        outcome = simulate(paths, np.eye(4), push, config=SimulateConfig())
        if outcome.exit_direction is not None:
            assert abs(outcome.exit_direction[2]) == pytest.approx(1.0, abs=1e-6)
            ways.add(float(np.sign(outcome.exit_direction[2])))
    assert ways == {-1.0, 1.0}


def test_linked_rings_stay_linked() -> None:
    parts = linked_rings()
    there = placed(parts, SampleConfig(area_samples=300))
    found = search_physics(there, 0, [1], config=PhysicsConfig(max_pushes=16))
    assert found.removal is None
    assert found.blocked_by == (1,)
    assert found.reason


@pytest.mark.parametrize("seed", [0, 1])
def test_a_bayonet_turns_then_leaves_wherever_it_stands(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = np.eye(4) if seed == 0 else se3.exp(np.concatenate([rng.uniform(-0.1, 0.1, 3), rng.uniform(-2.0, 2.0, 3)]))
    removal = searched(moved(bayonet(), T), "plug").removal
    assert removal is not None
    turn = np.linalg.norm(se3.log_so3(removal.displacements[-1][:3, :3]))
    assert np.degrees(turn) == pytest.approx(60.0, abs=3.0)
    np.testing.assert_allclose(np.abs(T[:3, :3].T @ removal.exit_direction), [0.0, 0.0, 1.0], atol=0.02)


@pytest.mark.parametrize("degrees", [25.0, 41.0])
def test_a_bayonet_that_could_turn_on_leaves_where_its_lugs_meet_the_slot(degrees: float) -> None:
    lugs = box((0.02, 0.004, 0.004))
    slot = box((0.0202, 0.0042, 0.015), (0.0, 0.0, 0.0075))
    hole = rod(0.0062, 0.06, segments=96) + slot + rod(0.0102, 0.0044, segments=96)
    socket = rod(0.015, 0.02, segments=96) - hole
    plug = rod(0.006, 0.04, segments=96) + lugs.rotate((0.0, 0.0, degrees))
    removal = searched(assembly(socket=socket, plug=plug), "plug").removal
    assert removal is not None
    assert abs(removal.exit_direction[2]) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("name", ["snapfit", "thread_clr0"])
def test_the_truth_set_says_the_same(name: str, truth_folder: Path) -> None:
    parts = read_assembly(truth_folder / name, unit="mm")
    removal = searched(parts, parts.names[0]).removal
    if name == "snapfit":
        assert removal is None
    else:
        assert removal is not None
        turns = [np.linalg.norm(between(a, b)[3:]) for a, b in pairwise(removal.displacements)]
        assert sum(turns) > 2.0 * np.pi
        assert max(turns) < 0.9 * np.pi
        assert turns[-1] < 1e-9


@pytest.mark.parametrize("monotone", [True, False])
def test_algorithm1_is_the_same_for_any_number_of_workers(monotone: bool) -> None:
    plate = box((0.06, 0.06, 0.02)) - rod(0.005, 0.04)
    parts = assembly(plate=plate, peg=rod(0.005, 0.02, (0.0, 0.0, 0.0)), cap=box((0.02, 0.02, 0.01), (0.0, 0.0, 0.015)))
    there = placed(parts, SampleConfig(area_samples=300))
    results = [
        plan_disassembly(there, config=Algorithm1Config(workers=workers, monotone=monotone)) for workers in (1, 3)
    ]
    first, second = ([(d.part, d.separation.removal) for d in result.removals] for result in results)
    assert [k for k, _ in first] == [k for k, _ in second]
    assert len(first) == 2
    for (_, a), (_, b) in zip(first, second, strict=True):
        assert a is not None
        assert b is not None
        np.testing.assert_array_equal(a.displacements, b.displacements)


def test_algorithm1_says_which_budget_ran_out_and_tells_of_each_part_that_left() -> None:
    parts = linked_rings()
    there = placed(parts, SampleConfig(area_samples=300))
    results = [
        plan_disassembly(there, config=Algorithm1Config(max_traced=20_000, max_attempts=400, workers=workers))
        for workers in (1, 2)
    ]
    reasons = [[separation.reason for _, separation in result.stuck] for result in results]
    assert reasons[0] == reasons[1] == ["Algorithm 1 ran out of its budget of 20000 tracing steps"]

    told = []
    pegs = assembly(
        plate=box((0.1, 0.04, 0.02)) - rod(0.005, 0.04, (-0.03, 0.0, 0.0)) - rod(0.005, 0.04, (0.03, 0.0, 0.0)),
        left=rod(0.005, 0.02, (-0.03, 0.0, 0.0)),
        right=rod(0.005, 0.02, (0.03, 0.0, 0.0)),
    )
    result = plan_disassembly(placed(pegs), config=Algorithm1Config(), progress=told.append)
    assert len(result.removals) == 2
    assert told == [1, 2]


def test_algorithm1_asks_whether_a_robot_can() -> None:
    parts = peg_in_plate()
    there = placed(parts)
    asked = []

    def never(part: int, others: int, removal: object) -> bool:
        asked.append((part, others))
        return False

    result = plan_disassembly(there, config=Algorithm1Config(), is_executable=never)
    assert result.removals == ()
    assert asked
    assert [k for k, _ in result.stuck] == [1 - result.base]
