"""What makes straight ways faster changes no answer: what was asked before, how much is enough, what was closest."""

from __future__ import annotations

import numpy as np
import pytest
from solids import assembly, box, rod

from sashimono.bodies import make_bodies
from sashimono.disassembly.free_travel import free_travel, passes
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.tilting.contact_surface import ContactSurface
from sashimono.disassembly.translation.leaning import LeaningConfig, around, leaning_direction
from sashimono.geometry import se3
from sashimono.geometry.features.directions import sphere_directions

SOLIDS = {
    "peg_in_block": {"block": box((0.06, 0.06, 0.04)) - rod(0.0101, 0.05), "peg": rod(0.01, 0.05)},
    "pin_drawn_into_beam": {"beam": box((0.2, 0.03, 0.03)), "pin": rod(0.004, 0.03).translate((-0.096, 0.0, 0.0))},
    "plate_in_corner": {
        "corner": box((0.08, 0.08, 0.03)) - box((0.08, 0.08, 0.03)).translate((0.02, 0.02, 0.01)),
        "plate": box((0.03, 0.03, 0.01)).translate((0.0, 0.0, 0.006)),
    },
}


def placed(name: str) -> PlacedParts:
    parts = assembly(**SOLIDS[name])
    return PlacedParts(parts, make_bodies(parts), config=PlacedPartsConfig())


@pytest.mark.parametrize("name", SOLIDS)
def test_whether_a_part_passes_is_whether_its_travel_is_infinite(name: str) -> None:
    parts, directions = placed(name), [*np.eye(3), *-np.eye(3), *sphere_directions(24)]
    infinite = 0
    for direction in directions:
        travel = free_travel(parts, 1, np.zeros(3), direction, 0)
        assert passes(parts, 1, np.zeros(3), direction, 0) == np.isinf(travel)
        infinite += np.isinf(travel)
    assert 0 < infinite < len(directions)


@pytest.mark.parametrize("name", SOLIDS)
def test_of_a_travel_that_is_enough_no_more_is_told_and_any_other_is_exact(name: str) -> None:
    parts = placed(name)
    for direction in sphere_directions(24):
        exact = free_travel(parts, 1, np.zeros(3), direction, 0)
        for enough in (0.0, 1e-4, 3e-3, 0.02):
            travel = free_travel(parts, 1, np.zeros(3), direction, 0, enough=enough)
            if exact > enough:
                assert travel == exact
            else:
                assert exact - 1e-12 <= travel <= enough


@pytest.mark.parametrize("name", SOLIDS)
def test_what_was_asked_before_changes_no_answer(name: str) -> None:
    directions = sphere_directions(24)

    def answers(parts: PlacedParts) -> list[float]:
        exact = [free_travel(parts, 1, np.zeros(3), direction, 0) for direction in directions]
        return [*exact, *(passes(parts, 1, np.zeros(3), direction, 0) for direction in directions)]

    used = placed(name)
    for direction in reversed(directions):
        passes(used, 1, np.zeros(3), direction, 0)
        passes(used, 1, np.array([0.0, 0.0, 0.01]), direction, 0)
    assert used.stoppers[1, 0], "something was learned"
    assert answers(used) == answers(placed(name))


def test_contacts_are_the_same_from_wherever_the_part_was_seen_last() -> None:
    def surface() -> ContactSurface:
        parts = placed("peg_in_block")
        return ContactSurface(Paths(parts, 1, [0], tolerance=parts.tolerances.turning), most_probes=200, leeway=0.3)

    poses = [se3.exp(np.array([0.0, 0.0, 0.002 * k, 0.01 * k, 0.0, 0.1 * k])) for k in range(6)]
    used = surface()
    for D in reversed(poses):
        used.gaps(D, margin=0.01)
    for D in poses:
        again, fresh = used.gaps(D, margin=0.01), surface().gaps(D, margin=0.01)
        assert len(fresh.gaps)
        np.testing.assert_array_equal(again.gaps, fresh.gaps)
        np.testing.assert_array_equal(again.rows, fresh.rows)


@pytest.mark.parametrize("name", SOLIDS)
def test_leaning_that_looks_no_farther_than_it_must_finds_what_exact_travels_find(name: str) -> None:
    parts, config = placed(name), LeaningConfig(square=0.0)
    travels = [(free_travel(parts, 1, np.zeros(3), direction, 0), direction) for direction in sphere_directions(60)]
    given = np.array([direction for travel, direction in travels if np.isfinite(travel)])
    found, expected = leaning_direction(parts, 1, [0], given, config=config), climbed(parts, given, config)
    assert (found is None) == (expected is None)
    if found is not None and expected is not None:
        np.testing.assert_array_equal(found, expected)
        assert passes(parts, 1, np.zeros(3), found, 0)


def climbed(parts: PlacedParts, given: np.ndarray, config: LeaningConfig) -> np.ndarray | None:
    """What `leaning_direction` is to find, with every travel told exactly."""

    def travel(direction: np.ndarray) -> float:
        return free_travel(parts, 1, np.zeros(3), direction, 0)

    reaches = np.array([travel(direction) for direction in given])
    looks = 0
    for k in np.argsort(-np.round(reaches, 12), kind="stable")[: config.starts]:
        best, reach = given[k], reaches[k]
        for step in config.steps:
            improved = True
            while improved and np.isfinite(reach) and looks < config.max_looks:
                improved = False
                for direction in around(best, step, config.neighbours):
                    looks += 1
                    if travel(direction) > config.gain * reach:
                        best, reach, improved = direction, travel(direction), True
                        break
        if np.isinf(reach):
            return best
    return None
