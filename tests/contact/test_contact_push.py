"""Pushes: the batched solver against conic oracles, known answers, and what the independent check says of them."""

import clarabel
import numpy as np
import pytest
from scipy import sparse

from sashimono.contact.cone_program import Contacts, least_pushes

SEED = 11


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def problem(point, normal, supports, friction, support_friction):
    """Columns of the balance and the quadratic cost, in the coordinates in which every cone is Q³."""
    push = Contacts(point[None], normal[None])
    A = [push.maps(push.frames(friction))[0], *supports.maps(supports.frames(support_friction))]
    return np.concatenate(A, axis=1), np.array([1.0, friction**2, friction**2])


def by_clarabel(point, normal, supports, wrench, friction, support_friction):
    """The least squared force, inf where nothing balances, None where the oracle is not sure."""
    A, cost = problem(point, normal, supports, friction, support_friction)
    n = A.shape[1]
    P = np.zeros(n)
    P[:3] = cost
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    arguments = (
        sparse.csc_matrix(np.diag(P)),
        np.zeros(n),
        sparse.csc_matrix(np.concatenate([A, -np.eye(n)])),
        np.concatenate([wrench, np.zeros(n)]),
        [clarabel.ZeroConeT(6), *[clarabel.SecondOrderConeT(3)] * (n // 3)],
    )
    for tolerance in (1e-10, 1e-9, 1e-8):  # degenerate ones reach no more
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = tolerance
        found = clarabel.DefaultSolver(*arguments, settings).solve()
        status = str(found.status)
        # its residuals are relative: with forces of 1e13 they say nothing
        if status == "Solved" and np.abs(found.x).max() < 1e8:
            return 2.0 * found.obj_val
        if status == "PrimalInfeasible":
            return np.inf
    return np.inf if status == "AlmostPrimalInfeasible" else None


def random_case(rng, mode):
    """Supports and points; the wrench at random, or one that the first point balances, inside or on the cone's rim."""
    count = int(rng.integers(0, 9)) if mode else int(rng.integers(0, 2))
    supports = Contacts(rng.uniform(-1.0, 1.0, (count, 3)), unit(rng.normal(size=(count, 3))))
    if mode == 3 and count:  # degenerate: all on one plane, with one normal
        flat = np.concatenate([supports.points[:, :2], np.zeros((count, 1))], axis=1)
        supports = Contacts(flat, np.tile([0.0, 0.0, 1.0], (count, 1)))
    pushes = Contacts(rng.uniform(-1.0, 1.0, (3, 3)), unit(rng.normal(size=(3, 3))))
    friction, support_friction = rng.uniform(0.05, 0.9, 2)
    if mode in (0, 3):
        wrench = rng.normal(size=6)
    if mode in (1, 2) or (mode == 0 and rng.random() < 0.5):
        aside = rng.uniform(-0.6, 0.6, 2) if mode == 1 else [1.0, 0.0]
        force = pushes.frames(friction)[0] @ np.array([1.0, *aside])
        inner = np.concatenate([np.ones((count, 1)), rng.uniform(-0.6, 0.6, (count, 2))], axis=1)
        reactions = np.einsum("kij,kj->ki", supports.frames(support_friction), inner) * rng.uniform(0, 2, (count, 1))
        torque = np.cross(pushes.points[0], force) + np.cross(supports.points, reactions).sum(axis=0)
        wrench = np.concatenate([force + reactions.sum(axis=0), torque])
    return pushes, supports, wrench / np.linalg.norm(wrench), friction, support_friction


@pytest.mark.parametrize("cases", [60, pytest.param(840, marks=pytest.mark.slow)])
@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_the_least_push_is_that_of_the_conic_oracle(mode, cases):
    rng = np.random.default_rng(SEED + mode + cases)
    unlike, unsure, total = [], 0, 0
    for case in range(cases):
        pushes, supports, wrench, friction, support_friction = random_case(rng, mode)
        got = least_pushes(pushes, supports, wrench, friction=friction, support_friction=support_friction)
        for k in range(len(pushes.points)):
            best = by_clarabel(pushes.points[k], pushes.normals[k], supports, wrench, friction, support_friction)
            total += 1
            if best is None:
                unsure += 1
                continue
            mine = float(got.forces[k] @ got.forces[k]) if got.feasible[k] else np.inf
            if not (mine == best or abs(mine - best) <= 1e-6 * (1.0 + best)):
                unlike.append((case, k, mine, best))
    assert not unlike, f"seed {SEED}: {len(unlike)} of {total}: {unlike[:5]}"
    assert unsure <= 0.06 * total


def test_it_is_the_semidefinite_program_as_printed():
    cvxpy = pytest.importorskip("cvxpy")
    rng = np.random.default_rng(SEED)
    for _ in range(3):
        pushes, supports, wrench, mu, support_mu = random_case(rng, 1)
        A, _ = problem(pushes.points[0], pushes.normals[0], supports, mu, support_mu)
        f = cvxpy.Variable(A.shape[1])
        size = cvxpy.Variable()
        # (head, a, b) in Q³ as a linear matrix inequality, and the size of the force by a Schur complement
        limits = [
            cvxpy.bmat([[f[j] + f[j + 1], f[j + 2]], [f[j + 2], f[j] - f[j + 1]]]) >> 0 for j in range(0, A.shape[1], 3)
        ]
        force = cvxpy.reshape(cvxpy.multiply(f[:3], np.array([1.0, mu, mu])), (3, 1), order="F")
        top = cvxpy.reshape(size, (1, 1), order="F")
        limits += [A @ f == wrench, cvxpy.bmat([[top, force.T], [force, size * np.eye(3)]]) >> 0]
        best = cvxpy.Problem(cvxpy.Minimize(size), limits).solve(
            solver="CLARABEL", tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10
        )
        got = least_pushes(pushes, supports, wrench, friction=mu, support_friction=support_mu)
        assert got.feasible[0]
        # the objective is the square; a force of zero is reached only to the root of its precision
        assert np.sum(got.forces[0] ** 2) == pytest.approx(best**2, abs=1e-8)


def test_known_answers():
    down = Contacts(np.array([[0.0, 0.0, 1.0], [0.5, 0.0, 1.0]]), np.array([[0.0, 0.0, -1.0]] * 2))
    nothing = Contacts(np.zeros((0, 3)), np.zeros((0, 3)))
    wrench = np.array([0.0, 0.0, -2.0, 0.0, 0.0, 0.0])
    alone = least_pushes(down, nothing, wrench, friction=0.2, support_friction=0.2)
    # above the centre it needs no help; beside it nothing takes up the moment
    assert alone.feasible.tolist() == [True, False]
    np.testing.assert_allclose(alone.forces[0], [0.0, 0.0, -2.0])
    corners = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    floor = Contacts(corners, np.tile([0.0, 0.0, 1.0], (4, 1)))
    leaning = least_pushes(down, floor, wrench, friction=1e-3, support_friction=1e-3)
    assert leaning.feasible.all()
    # beside the centre the floor holds against the moment about its edge, without friction: 0.5 F = F - 2
    assert leaning.forces[1, 2] == pytest.approx(-4.0, abs=0.02)
    assert np.linalg.norm(leaning.forces[0]) == pytest.approx(2.0, abs=1e-6)
