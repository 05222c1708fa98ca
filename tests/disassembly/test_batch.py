"""Many pushes stepped at once: the same answers as the simulation from event to event."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import solids

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics.batch import BatchConfig, BatchSimulator, Push
from sashimono.disassembly.physics.push import SimulateConfig, Simulated, simulate
from sashimono.disassembly.physics.search import PhysicsConfig, pushes_at
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.errors import SashimonoError
from sashimono.io.read import read_assembly

pytest.importorskip("warp", reason="the gpu extra is not installed")


def both(assembly: Assembly, name: str) -> tuple[PlacedParts, list[Push], list[Simulated], list[Simulated]]:
    parts = PlacedParts(assembly, make_bodies(assembly), config=PlacedPartsConfig())
    part = assembly.names.index(name)
    others = tuple(k for k in range(len(assembly)) if k != part)
    config = PhysicsConfig()
    paths = Paths(parts, part, others, tolerance=parts.tolerances.turning)
    wrenches = pushes_at(paths, np.eye(4), config=config)
    pushes = [Push(part=part, others=others, displacement=np.eye(4), wrench=wrench) for wrench in wrenches]
    simulator = BatchSimulator(parts, config=BatchConfig(), device="cpu")
    oracle = [simulate(paths, np.eye(4), wrench, config=SimulateConfig()) for wrench in wrenches]
    return parts, pushes, simulator.simulate(pushes), oracle


def check_agreement(assembly: Assembly, name: str) -> list[bool]:
    """Both say the same of every push, and each path passes the exact check; return which pushes free the part."""
    parts, pushes, stepped, oracle = both(assembly, name)
    free = [outcome.exit_direction is not None for outcome in stepped]
    assert free == [outcome.exit_direction is not None for outcome in oracle]
    paths = Paths(parts, pushes[0].part, pushes[0].others, tolerance=parts.tolerances.turning)
    assert all(paths.check(outcome.displacements) for outcome in stepped)
    return free


def test_a_peg_leaves_along_its_hole_only() -> None:
    free = check_agreement(solids.peg_in_plate(), "peg")
    assert any(free)
    assert not all(free)


def test_linked_rings_stay_linked_and_go_as_far() -> None:
    assert not any(check_agreement(solids.linked_rings(), "second"))


@pytest.mark.parametrize(("name", "part", "leaves"), [("bayonet", "sock", True), ("bolt_stack_tilt", "washer", False)])
def test_the_truth_set_says_the_same(name: str, part: str, leaves: bool, truth_folder: Path) -> None:
    assert any(check_agreement(read_assembly(truth_folder / name, unit="mm"), part)) == leaves


def test_the_batch_size_changes_nothing() -> None:
    assembly = solids.linked_rings()
    parts, pushes, stepped, _ = both(assembly, "second")
    one_by_one = BatchSimulator(parts, config=BatchConfig(batch=1), device="cpu").simulate(pushes)
    for a, b in zip(stepped, one_by_one, strict=True):
        assert np.array_equal(a.displacements, b.displacements)


def test_a_device_that_is_not_there_is_named() -> None:
    assembly = solids.peg_in_plate()
    parts = PlacedParts(assembly, make_bodies(assembly), config=PlacedPartsConfig())
    with pytest.raises(SashimonoError, match="cuda:99"):
        BatchSimulator(parts, config=BatchConfig(), device="cuda:99")


@pytest.mark.parametrize("together", [1, 512])
def test_algorithm1_takes_the_assembly_apart_on_a_device(together: int) -> None:
    assembly = solids.box_with_lid()
    parts = PlacedParts(assembly, make_bodies(assembly), config=PlacedPartsConfig())
    result = plan_disassembly(parts, config=Algorithm1Config(device="cpu", together=together))
    assert result.stuck == ()
    assert len(result.removals) == 2
    assert next(departure.part for departure in result.removals) != assembly.names.index("content")
