"""Samples that pass over the same helix are followed once, and nothing that is too deep gets past for it."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold
from solids import LEAD, bolt, rod

from sashimono.geometry import se3
from sashimono.verify.body import SampledBody
from sashimono.verify.helices import find_helices, helix_tree, laid_together
from sashimono.verify.sweep import Screws, Sweep, sweep


def body(solid: Manifold) -> SampledBody:
    mesh = solid.to_mesh64()
    vertices = np.array(mesh.vert_properties)[:, :3]
    return SampledBody("body", vertices, np.array(mesh.tri_verts).astype(np.int64), samples=1500)


def screw_of(length: float) -> Manifold:
    """A screw of this length that fits into the nut as it stands."""
    return bolt(0.01, 0.003, length).rotate((0.0, 0.0, -180.0 * (length - 0.02) / LEAD))


def unscrewed(turns: float, lead: float, tilt: np.ndarray) -> np.ndarray:
    """Poses of a thread about z that is turned out along it, all in a tilted frame."""
    angles = np.linspace(0.0, 2.0 * np.pi * turns, int(np.ceil(3.0 * turns)) + 1)
    twists = [np.array([0.0, 0.0, a * lead / (2.0 * np.pi), 0.0, 0.0, a]) for a in angles]
    return np.array([tilt @ se3.exp(twist) for twist in twists])


def swept(moving: SampledBody, fixed: SampledBody, poses: np.ndarray, limit: float) -> list[Sweep]:
    """The sweeps of either against the other."""
    path, T = Screws.between(poses), poses[0]
    options = {"limit": limit, "resolution": 0.125 * limit, "coarse": 1e-3, "max_queries": 50_000_000}
    there = sweep(moving.tree, fixed, path.seen_from(T), **options)
    return [there, sweep(fixed.tree, moving, path.reversed_for(T), **options)]


@pytest.fixture(scope="module")
def nut() -> SampledBody:
    return body(rod(0.02, 0.012) - bolt(0.0102, 0.003, 0.02))


TILT = se3.exp(np.array([0.1, -0.2, 0.05, 0.4, -0.9, 0.3]))


def test_a_thread_takes_a_fraction_of_the_looks_and_holds_as_before(
    nut: SampledBody, monkeypatch: pytest.MonkeyPatch
) -> None:
    screw, poses = body(screw_of(0.03)), unscrewed(6.0, LEAD, TILT)
    with_helices = swept(screw, nut, poses, 2e-4)
    monkeypatch.setattr(Screws, "helices", lambda path, size: None)
    without = swept(screw, nut, poses, 2e-4)
    assert all(found.holds for found in with_helices + without)
    assert sum(found.queries for found in with_helices) < 0.4 * sum(found.queries for found in without)
    for first, second in zip(with_helices, without, strict=True):
        assert first.depth <= 2e-4
        assert first.depth == pytest.approx(second.depth, abs=2.5e-5)


@pytest.mark.parametrize("height", [0.1, 1.05, 1.5])
def test_a_bump_on_a_thread_is_found_if_it_is_too_high(nut: SampledBody, height: float) -> None:
    """A wart on a flank of the screw, outside of the nut at first: it gets into the nut after three turns."""
    limit = 2e-4
    screw = screw_of(0.06)
    # on the crest line, 14 mm below the middle, standing out of the crest by the clearance and more
    at = -0.014
    turn = 2.0 * np.pi * (at + 0.01) / LEAD
    crest = 0.013 + 2e-4 + height * limit - 4e-4
    wart = rod(4e-4, 8e-4, segments=24).translate((crest * np.cos(turn), crest * np.sin(turn), at))
    found = swept(body(screw + wart), nut, unscrewed(8.0, LEAD, TILT), limit)
    assert all(each.holds for each in found) == (height < 1.0)
    assert not any(each.exhausted for each in found)


def test_wobbling_turns_are_no_helix() -> None:
    poses = unscrewed(5.0, LEAD, np.eye(4))
    poses[4] = poses[4] @ se3.exp(np.array([0.0, 0.0, 0.0, 0.01, 0.0, 0.0]))
    path = Screws.between(poses)
    found = path.helices(0.05)
    assert found is not None
    assert (found.run >= 0).sum() < len(path.angle)
    assert Screws.between(unscrewed(0.5, LEAD, TILT)).helices(0.05) is None


def test_helices_are_told_by_radius_and_height() -> None:
    axis = np.tile([0.0, 0.0, 1.0], (3, 1))
    found = find_helices(axis, np.zeros((3, 3)), np.full(3, 3.0), 0.01 * axis, 0.05)
    assert found is not None
    angles = np.linspace(-4.0, 9.0, 40)
    points = np.stack([0.02 * np.cos(angles), 0.02 * np.sin(angles), angles * 0.01 / 3.0 + 0.001], axis=1)
    helix, at = found.invariants(0, points)
    np.testing.assert_allclose(helix, np.tile(helix[0], (40, 1)), atol=1e-12)
    np.testing.assert_allclose(at - at[0], angles - angles[0], atol=1e-9)
    np.testing.assert_allclose(found.points(0, helix, at), points, atol=1e-12)


def test_stretches_are_joined_only_where_they_meet() -> None:
    helix = np.array([[1.0, 0.5], [1.0, 0.5], [1.0, 0.5], [3.0, 0.5]])
    low, high = np.array([0.0, 0.5, 5.0, 0.2]), np.array([1.0, 2.0, 6.0, 0.3])
    found, first, last = laid_together(helix, low, high, 0.25)
    assert found.shape == (3, 2)
    assert np.abs(found - np.array([[1.0, 0.5], [1.0, 0.5], [3.0, 0.5]])).max() <= 0.125
    np.testing.assert_array_equal(first, [0.0, 5.0, 0.2])
    np.testing.assert_allclose(last, [2.0, 6.0, 0.3])


def test_a_tree_of_helices_holds_all_of_them() -> None:
    rng = np.random.default_rng(0)
    helix = rng.uniform([0.01, 0.0], [0.012, 0.003], (300, 2))
    low = rng.uniform(0.0, 10.0, 300)
    tree = helix_tree(helix, low, low + 20.0)
    root = len(tree.reach) - 1
    assert np.linalg.norm(helix - tree.helix[root], axis=1).max() <= tree.reach[root] + 1e-12
    assert (tree.low[root], tree.high[root]) == (low.min(), low.max() + 20.0)
    for node in np.flatnonzero(tree.first_child >= 0):
        own = slice(tree.first_child[node], tree.first_child[node] + tree.child_count[node])
        apart = np.linalg.norm(tree.helix[own] - tree.helix[node], axis=1)
        assert (apart <= tree.reach[node] + 1e-12).all()
        assert (tree.low[own] >= tree.low[node]).all()
        assert (tree.high[own] <= tree.high[node]).all()
    assert (tree.first_child < 0).sum() == 300


def test_turns_of_a_run_are_told_as_times() -> None:
    poses = unscrewed(3.0, LEAD, TILT)
    path = Screws.between(np.concatenate([poses[:1] @ se3.make(None, np.array([0.0, 0.0, 0.01])), poses]))
    found = path.helices(0.05)
    assert found is not None
    np.testing.assert_array_equal(found.run, [-1] + [0] * 9)
    assert found.turned(0) == pytest.approx((0.0, 6.0 * np.pi))
    times = found.times(0, np.array([0.0, np.pi, 6.0 * np.pi]))
    np.testing.assert_allclose(times, [1.0, 1.0 + 1.5, 10.0], atol=1e-6)
