"""Contact wrenches and Ferrari-Canny quality: known answers, another route, invariances."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from sashimono.contact.ferrari_canny import ferrari_canny, quality_bound
from sashimono.contact.wrenches import contact_wrenches, torsional_friction, unit_across
from sashimono.geometry import se3

POINTS = np.array([[[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
NORMALS = -POINTS


def wrenches_of(points=POINTS, normals=NORMALS, *, friction=0.2, torsion=0.02, edges=8, center=None, **more):
    return contact_wrenches(
        points,
        normals,
        tangential_friction=friction,
        torsion=torsion,
        edges=edges,
        center=np.zeros(3) if center is None else center,
        radius=more.pop("radius", 1.0),
        **more,
    )


def random_grasp(seed):
    """A grasp whose line lies in both cones, at a random offset from the origin."""
    rng = np.random.default_rng(seed)
    line = rng.normal(size=3)
    line /= np.linalg.norm(line)
    across = unit_across(line[None])[0]
    middle = rng.uniform(-0.4, 0.4, 3)
    half = rng.uniform(0.1, 0.5)
    normals = np.array([line + 0.1 * across, -line + 0.05 * across])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.array([[middle - half * line, middle + half * line]]), normals[None]


def ray_length(wrenches, direction):
    """How far the hull reaches along a direction: max t with t * direction in the hull (a linear program)."""
    n = len(wrenches)
    result = linprog(
        np.r_[np.zeros(n), -1.0],
        A_eq=np.block([[wrenches.T, -direction[:, None]], [np.ones((1, n)), np.zeros((1, 1))]]),
        b_eq=np.r_[np.zeros(6), 1.0],
        bounds=[(0.0, None)] * n + [(None, None)],
    )
    return -result.fun


def test_two_hard_contacts_have_no_quality():
    hard = wrenches_of(torsion=0.0)[0]
    assert np.linalg.matrix_rank(hard) == 5
    assert ferrari_canny(hard) == 0.0


def test_symmetric_soft_grasp_is_as_good_as_its_torsion():
    # nothing but the fingers' torsion resists a torque about the line; friction is far stronger
    for torsion in (0.001, 0.002, 0.004):
        assert ferrari_canny(wrenches_of(torsion=torsion)[0]) == pytest.approx(torsion, rel=2e-3)


def test_torsional_friction_of_a_disc():
    assert torsional_friction(0.2, 0.006) == pytest.approx(0.0008)


def test_contacts_on_one_side_have_no_quality():
    assert ferrari_canny(wrenches_of(normals=np.array([[[1.0, 0, 0], [1.0, 0, 0]]]))[0]) == 0.0


def quality_by_enumeration(wrenches):
    """Distance to the nearest facet, every six wrenches tried as a facet n . w = 1 of a hull around the origin."""
    sixes = wrenches[np.array(list(itertools.combinations(range(len(wrenches)), 6)))]
    sixes = sixes[np.abs(np.linalg.det(sixes)) > 1e-12]
    planes = np.linalg.solve(sixes, np.ones((len(sixes), 6, 1)))[:, :, 0]
    facets = planes[(planes @ wrenches.T).max(axis=1) <= 1.0 + 1e-7]
    return 1.0 / np.linalg.norm(facets, axis=1).max()


@pytest.mark.parametrize("seed", range(4))
def test_quality_against_enumeration_and_linear_programs(seed):
    wrenches = wrenches_of(*random_grasp(seed), edges=6)[0]
    quality = ferrari_canny(wrenches)
    assert quality > 0.0
    assert quality == pytest.approx(quality_by_enumeration(wrenches), rel=1e-6)
    directions = np.random.default_rng(seed).normal(size=(40, 6))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    assert min(ray_length(wrenches, direction) for direction in directions) >= quality - 1e-9


@given(st.integers(0, 10_000), st.floats(0.01, 100.0), st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6))
@settings(max_examples=25)
def test_quality_is_invariant_to_scale_and_motion(seed, scale, twist):
    points, normals = random_grasp(seed)
    first = unit_across(normals[:, 0])
    T = se3.exp(np.array(twist))
    R = T[:3, :3]
    moved = wrenches_of(
        scale * (points @ R.T + T[:3, 3]),
        normals @ R.T,
        torsion=0.02 * scale,
        radius=scale,
        center=scale * T[:3, 3],
        first_edges=first @ R.T,
    )
    still = wrenches_of(points, normals, first_edges=first)
    assert ferrari_canny(moved[0]) == pytest.approx(ferrari_canny(still[0]), rel=1e-6)


@given(st.integers(0, 10_000), st.floats(0.002, 0.05))
@settings(max_examples=40)
def test_bound_is_above_and_near(seed, torsion):
    points, normals = random_grasp(seed)
    wrenches = wrenches_of(points, normals, torsion=torsion)
    lines = points[:, 1] - points[:, 0]
    lines = lines / np.linalg.norm(lines, axis=1, keepdims=True)
    bound = quality_bound(wrenches, lines, points.mean(axis=1))[0]
    exact = ferrari_canny(wrenches[0])
    assert exact - 1e-9 <= bound <= 2.0 * exact


def test_more_friction_and_edges_never_hurt():
    points, normals = random_grasp(3)
    by_friction = [ferrari_canny(wrenches_of(points, normals, friction=mu)[0]) for mu in (0.2, 0.4, 0.8)]
    assert by_friction == sorted(by_friction)
    by_edges = [ferrari_canny(wrenches_of(points, normals, edges=m)[0]) for m in (4, 8, 16)]
    assert by_edges == sorted(by_edges)
