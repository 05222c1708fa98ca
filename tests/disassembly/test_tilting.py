"""Parts that must tilt: the tilt set by construction, its blocked twins, and the pieces of the search."""

from dataclasses import replace

import numpy as np
import pytest
from solids import assembly, box, rod
from tilt_set import CASES, TiltCase

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.tilting.axes import round_axes
from sashimono.disassembly.tilting.contact_surface import ContactSurface, Gaps, admissible
from sashimono.disassembly.tilting.probes import edge_points
from sashimono.disassembly.tilting.search import TiltConfig, search_tilt
from sashimono.geometry import se3
from sashimono.plan import Answer
from sashimono.verify.motions import MotionCheck

BY_NAME = {case.name: case for case in CASES}
QUICK = ("lid_with_lip", "ears", "camera", "pole_clamp")


def placed(parts: Assembly) -> PlacedParts:
    return PlacedParts(parts, make_bodies(parts), config=PlacedPartsConfig())


def cascade_of(parts: Assembly) -> Cascade:
    return Cascade(parts, make_bodies(parts), config=SeparateConfig(tilting=True))


@pytest.mark.parametrize("name", QUICK)
def test_a_part_that_must_tilt_leaves_and_the_check_grants_it(name: str) -> None:
    parts = BY_NAME[name].assembly(is_open=True)
    found = cascade_of(parts).separate(1, 3)
    assert found.answer is Answer.FREE
    assert found.stage == "tilt"
    assert found.removal is not None
    path = found.removal.displacements[::-1] @ parts.parts[1].T_world_part
    assert MotionCheck(parts).problems(1, [0], path) == []


@pytest.mark.parametrize("name", ["lid_with_lip", "floor_plank"])
def test_with_the_way_blocked_it_does_not(name: str) -> None:
    found = cascade_of(BY_NAME[name].assembly(is_open=False)).separate(1, 3)
    assert found.answer is not Answer.FREE


@pytest.mark.slow
@pytest.mark.parametrize("is_open", [True, False])
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_tilt_set(case: TiltCase, is_open: bool) -> None:
    parts = case.assembly(is_open=is_open)
    found = cascade_of(parts).separate(1, 3)
    assert (found.answer is Answer.FREE) == is_open
    if found.removal is not None:
        path = found.removal.displacements[::-1] @ parts.parts[1].T_world_part
        assert MotionCheck(parts).problems(1, [0], path) == []


def test_a_tilt_is_the_same_whatever_was_asked_before_and_whatever_else_is_far_away() -> None:
    parts = BY_NAME["ears"].assembly(is_open=True)
    alone = search_tilt(placed(parts), 1, [0], config=TiltConfig()).removal
    far = assembly(far=box((0.01, 0.01, 0.01), (0.5, 0.0, 0.0)))
    there = placed(replace(parts, parts=(*parts.parts, *far.parts)))
    search_tilt(there, 0, [1, 2], config=TiltConfig(max_slides=3))
    again = search_tilt(there, 1, [0], config=TiltConfig()).removal
    assert alone is not None
    assert again is not None
    np.testing.assert_array_equal(alone.displacements, again.displacements)


def test_a_budget_that_runs_out_says_so_and_is_no_proof() -> None:
    parts = BY_NAME["bent_key"].assembly(is_open=True)
    found = cascade_of(parts).tilting.separate(1, 3, max_traced=50_000)
    assert found.answer is Answer.UNKNOWN
    assert found.proven_for is None
    assert found.is_cut
    assert "tracing steps were spent" in found.reason
    little = search_tilt(placed(parts), 1, [0], config=TiltConfig(max_slides=2))
    assert little.removal is None
    assert "2 slides" in little.reason


def test_the_projection_is_the_nearest_motion_that_closes_no_gap() -> None:
    rng = np.random.default_rng(3)
    rows = rng.standard_normal((12, 6))
    gaps = rng.uniform(0.0, 0.5, 12)
    wanted = rng.standard_normal(6)
    motion = admissible(Gaps(rows=rows, gaps=gaps), wanted, rounds=5000)
    assert (rows @ motion + gaps).min() > -1e-6
    # optimal: what is given up is a sum of rows that press, each with weight ≥ 0 (Karush, Kuhn and Tucker)
    tight = rows[rows @ motion + gaps < 1e-6]
    weights = np.linalg.lstsq(tight.T, motion - wanted, rcond=None)[0]
    assert weights.min() > -1e-5
    np.testing.assert_allclose(tight.T @ weights, motion - wanted, atol=1e-5)


def test_gaps_tell_how_a_motion_opens_them() -> None:
    parts = assembly(
        floor=box((0.06, 0.06, 0.01), (0.0, 0.0, -0.005)), block=box((0.02, 0.02, 0.02), (0.0, 0.0, 0.011))
    )
    there = placed(parts)
    paths = Paths(there, 1, [0], tolerance=0.0)
    surface = ContactSurface(paths, most_probes=300, leeway=0.0)
    found = surface.gaps(np.eye(4), margin=0.005)
    assert found.gaps.min() == pytest.approx(0.001)
    rise = np.array([0.0, 0.0, 0.0004, 0.0, 0.0, 0.0])
    tilt = np.array([0.0, 0.0, 0.0, 2e-4, 1e-4, 0.0])
    for motion in (rise, tilt):
        after = surface.gaps(surface.moved(np.eye(4), motion), margin=0.005)
        told = (found.gaps + found.rows @ motion).min()
        assert after.gaps.min() == pytest.approx(told, abs=2e-6)
    T = se3.exp(np.array([0.01, -0.02, 0.03, 0.4, 0.5, -0.6]))
    np.testing.assert_allclose(surface.moved(np.eye(4), surface.motion_to(np.eye(4), T)), T, atol=1e-12)


def test_axes_of_round_faces_are_found_in_solids_and_holes() -> None:
    plate = box((0.06, 0.06, 0.01)) - rod(0.008, 0.02, (0.012, -0.007, 0.0))
    body = next(iter(make_bodies(assembly(plate=plate)).values()))
    axes = round_axes(body, most=3, merge=0.001)
    assert len(axes) == 1
    np.testing.assert_allclose(axes[0, 0, :2], [0.012, -0.007], atol=1e-6)
    np.testing.assert_allclose(np.abs(axes[0, 1]), [0.0, 0.0, 1.0], atol=1e-9)


def test_edge_points_lie_on_sharp_convex_edges_only() -> None:
    solid = box((0.04, 0.04, 0.02)) - box((0.02, 0.02, 0.02), (0.0, 0.0, 0.01))
    body = next(iter(make_bodies(assembly(solid=solid)).values()))
    points = edge_points(body, spacing=0.002)
    assert len(points) > 50
    in_pocket = (np.abs(points[:, :2]).max(axis=1) < 0.0101) & (points[:, 2] < 0.0099)
    assert not in_pocket.any()
    on_planes = np.stack([np.abs(np.abs(points[:, 0]) - x) < 1e-9 for x in (0.02, 0.01)])
    assert (
        on_planes.any(axis=0)
        | (np.abs(np.abs(points[:, 1]) - 0.02) < 1e-9)
        | (np.abs(np.abs(points[:, 1]) - 0.01) < 1e-9)
    ).all()
