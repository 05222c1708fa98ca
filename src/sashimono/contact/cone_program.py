"""Equation (1) of the paper for many pushing points at once: the least force that balances a wrench.

For each point: minimise ½|F|² subject to F in its friction cone, each reaction R_k in its own, and
``G F + Σ G_k R_k = W``. In contact frames a friction cone is the second-order cone Q³, so this is a cone program with
the same reactions for all points. None or one reaction: closed form. More: a primal-dual interior-point method with
Nesterov-Todd scaling (Nesterov & Todd, "Self-scaled barriers", 1997) and Mehrotra's steps, all points in one batch; the
linear system of an iteration is 6 × 6 a point.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from sashimono.contact.wrenches import unit_across

_ITERATIONS = 60
_ACCURATE = 1e-10
_ACCEPTED = 1e-8
_J = np.array([1.0, -1.0, -1.0])


class Pushes(NamedTuple):
    """One push a point."""

    feasible: Bool[np.ndarray, "point"]
    """Whether some force in the cone balances the wrench."""
    forces: Float[np.ndarray, "point 3"]
    """The least one; 0 where there is none."""
    reactions: Float[np.ndarray, "point support 3"]
    """Forces of the supports that go with it."""
    residuals: Float[np.ndarray, "point"]
    """Norm of what is not balanced, over the norm of the wrench."""


class Contacts(NamedTuple):
    """Points with unit normals, all in one frame. Forces act along the normals, within the friction cones."""

    points: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]

    def frames(self, friction: float) -> Float[np.ndarray, "n 3 3"]:
        """Return the matrices that take Q³ to the friction cones: columns normal, μu, μv."""
        u = unit_across(self.normals)
        v = np.cross(self.normals, u)
        return np.stack([self.normals, friction * u, friction * v], axis=2)

    def maps(self, frames: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 6 3"]:
        """Return the grasp maps G from the coordinates of the frames to (force, torque about the origin)."""
        return np.concatenate([frames, np.cross(self.points[:, None], frames.swapaxes(1, 2)).swapaxes(1, 2)], axis=1)


def least_pushes(
    pushes: Contacts, supports: Contacts, wrench: Float[np.ndarray, "6"], *, friction: float, support_friction: float
) -> Pushes:
    """Return the least force at each point that, with some reactions of the supports, makes up the wrench.

    Lengths should be of order one and torques about the origin. ``friction`` is the tangent of the half angle of the
    cones. Exact to about 1e-8 of the wrench; a point that is feasible by less than that may go either way.
    """
    size = float(np.linalg.norm(wrench))
    if size == 0.0 or len(pushes.points) == 0:
        n = len(pushes.points)
        shape = (n, len(supports.points), 3)
        return Pushes(np.ones(n, dtype=bool), np.zeros((n, 3)), np.zeros(shape), np.zeros(n))
    unit = wrench / size
    if len(supports.points) == 0:
        forces, reactions = _alone(pushes, unit, friction)
    elif len(supports.points) == 1:
        forces, reactions = _against_one(pushes, supports, unit, friction, support_friction)
    else:
        forces, reactions = _interior_point(pushes, supports, unit, friction, support_friction)
    total = forces + reactions.sum(axis=1)
    torque = np.cross(pushes.points, forces) + np.cross(supports.points, reactions).sum(axis=1)
    residuals = np.linalg.norm(np.concatenate([total, torque], axis=1) - unit, axis=1)
    feasible = np.isfinite(residuals) & (residuals <= _ACCEPTED)
    feasible &= _in_cone(forces, pushes.normals, friction)
    feasible &= _in_cone(reactions, supports.normals, support_friction).all(axis=1)
    forces = np.where(feasible[:, None], size * forces, 0.0)
    reactions = np.where(feasible[:, None, None], size * reactions, 0.0)
    return Pushes(feasible, forces, reactions, np.where(np.isfinite(residuals), residuals, np.inf))


def _in_cone(forces: np.ndarray, normals: np.ndarray, friction: float) -> np.ndarray:
    along = (forces * normals).sum(axis=-1)
    aside = np.linalg.norm(forces - along[..., None] * normals, axis=-1)
    return aside <= friction * along + _ACCEPTED


def _alone(pushes: Contacts, unit: np.ndarray, friction: float) -> tuple[np.ndarray, np.ndarray]:
    """Nothing but the push: its force is the force of the wrench."""
    n = len(pushes.points)
    return np.tile(unit[:3], (n, 1)), np.zeros((n, 0, 3))


def _against_one(
    pushes: Contacts, supports: Contacts, unit: np.ndarray, friction: float, support_friction: float
) -> tuple[np.ndarray, np.ndarray]:
    """One support: torques about it leave one degree of freedom, a squeeze along the line between the two points."""
    c, m = supports.points[0], supports.normals[0]
    arms = pushes.points - c
    lengths2 = np.maximum((arms**2).sum(axis=1, keepdims=True), 1e-30)
    torque = unit[3:] - np.cross(c, unit[:3])
    base = np.cross(torque, arms) / lengths2
    lines = arms / np.sqrt(lengths2)
    low, high = _stretch(base, lines, pushes.normals, friction)
    # R = f - F: the same line, run through the other way
    other = np.broadcast_to(m, lines.shape)
    low_r, high_r = _stretch(unit[:3] - base, -lines, other, support_friction)
    low, high = np.maximum(low, low_r), np.minimum(high, high_r)
    # where the two ends cross by rounding the middle is taken, and the final check decides
    finite = np.isfinite(low) & np.isfinite(high) & (low > high)
    middle = (np.where(finite, low, 0.0) + np.where(finite, high, 0.0)) / 2.0
    ends = np.where(low <= high, np.clip(-(base * lines).sum(axis=1), low, high), middle)
    forces = base + np.where(np.isfinite(ends), ends, 0.0)[:, None] * lines
    return forces, (unit[:3] - forces)[:, None]


def _stretch(base: np.ndarray, line: np.ndarray, normal: np.ndarray, friction: float) -> tuple[np.ndarray, np.ndarray]:
    """Where along ``base + s line`` the friction cone is: from, to; (inf, -inf) where the line misses it."""
    weight = 1.0 + friction**2  # in the cone: n·F >= 0 and (1 + μ²)(n·F)² >= |F|²
    b, d = (base * normal).sum(axis=1), (line * normal).sum(axis=1)
    a2 = weight * d**2 - (line**2).sum(axis=1)
    a1 = weight * b * d - (base * line).sum(axis=1)
    a0 = weight * b**2 - (base**2).sum(axis=1)
    root = np.sqrt(np.maximum(a1**2 - a2 * a0, 0.0))
    missed = a1**2 - a2 * a0 < -1e-12
    q = -(a1 + np.where(a1 >= 0.0, root, -root))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.sort(np.stack([q / a2, a0 / q]), axis=0)
    roots = np.where(np.isnan(roots), 0.0, roots)
    # a2 > 0: the line ends inside, in the cone ahead of it or, for d < 0, behind it; else between the roots, if ahead
    low = np.where(a2 > 0.0, np.where(d > 0.0, roots[1], -np.inf), roots[0])
    high = np.where(a2 > 0.0, np.where(d > 0.0, np.inf, roots[0]), roots[1])
    middle = np.where(a2 > 0.0, 0.0, (roots[0] + roots[1]) / 2.0)
    behind = (a2 <= 0.0) & (b + middle * d < 0.0)
    empty = (missed & (a2 <= 0.0)) | behind
    return np.where(empty, np.inf, low), np.where(empty, -np.inf, high)


def _interior_point(
    pushes: Contacts, supports: Contacts, unit: np.ndarray, friction: float, support_friction: float
) -> tuple[np.ndarray, np.ndarray]:
    """Interior-point method for all points; a point leaves the batch when it is solved or shown to have no push."""
    frames, support_frames = pushes.frames(friction), supports.frames(support_friction)
    n, k = len(frames), len(support_frames)
    A = np.empty((n, k + 1, 6, 3))
    A[:, 0] = pushes.maps(frames)
    A[:, 1:] = supports.maps(support_frames)
    P = np.zeros((k + 1, 3))
    P[0] = [1.0, friction**2, friction**2]
    solved = np.full((n, k + 1, 3), np.nan)
    best = np.full(n, np.inf)
    left = np.arange(n)
    x = np.tile(np.array([1.0, 0.0, 0.0]), (n, k + 1, 1))
    s = x.copy()
    y = np.zeros((n, 6))
    alpha = np.ones(n)
    for _ in range(_ITERATIONS):
        r_dual = P * x - np.einsum("bkic,bi->bkc", A, y) - s
        r_primal = np.einsum("bkic,bkc->bi", A, x) - unit
        gap = np.einsum("bkc,bkc->b", x, s) / (k + 1)
        value = 0.5 * np.einsum("bkc,kc,bkc->b", x, P, x)
        scale = 1.0 + value
        primal = np.abs(r_primal).max(axis=1)
        merit = np.maximum(primal, gap / scale)
        better = merit < best[left]
        solved[left[better]], best[left[better]] = x[better], merit[better]
        done = (primal < _ACCURATE) & (gap < _ACCURATE * scale)
        done &= np.abs(r_dual).max(axis=(1, 2)) < 1e-7 * (1.0 + np.abs(y).max(axis=1))
        # Farkas: y with -Aᵀy in the cones and W·y > 0 shows that nothing balances
        ascent = y @ unit
        away = -np.einsum("bkic,bi->bkc", A, y)
        margin = (away[..., 0] - np.linalg.norm(away[..., 1:], axis=2)).min(axis=1)
        hopeless = (ascent > 1e-3) & (margin >= -1e-9 * ascent)
        # nothing more to gain: rounding, or reactions that grow without bound
        small = (np.abs(x).max(axis=(1, 2)) < 1e8) & (np.abs(s).max(axis=(1, 2)) < 1e8)
        stalled = ~(small & (alpha > 1e-5) & (_inside(x) > 1e-13) & (_inside(s) > 1e-13))
        keep = ~(done | hopeless | stalled)
        left, A, x, s, y, alpha = left[keep], A[keep], x[keep], s[keep], y[keep], alpha[keep]
        r_dual, r_primal, gap = r_dual[keep], r_primal[keep], gap[keep]
        if len(left) == 0:
            break
        x, s, y, alpha = _step(A, P, x, s, y, r_dual, r_primal, gap)
    forces = np.einsum("bic,bc->bi", frames, solved[:, 0])
    return forces, np.einsum("kic,bkc->bki", support_frames, solved[:, 1:])


def _step(A, P, x, s, y, r_dual, r_primal, gap):
    """One predictor-corrector step of every point."""
    w, eta = _scaling(x, s)
    lam = _apply(w, s) * eta
    # H = P + W⁻² = (L Lᵀ)⁻¹; reactions cost nothing, so that L is W for them
    L = _matrix(w) * eta[..., None]
    back = _matrix(_J * w[:, 0]) / eta[:, 0, :, None]
    # P + back² is RᵀR of the two stacked; a Cholesky factor of the sum would fail where back is huge
    stacked = np.concatenate([back, np.broadcast_to(np.diag(np.sqrt(P[0])), back.shape)], axis=1)
    L[:, 0] = np.linalg.inv(np.linalg.qr(stacked, mode="r"))
    # by QR, not through A H⁻¹ Aᵀ, whose condition is the square
    B = np.einsum("bkic,bkcd->bkdi", A, L)
    Q, R = np.linalg.qr(B.reshape(len(A), -1, 6))
    Q = Q.reshape(B.shape)
    R_inv = np.linalg.inv(R + 1e-15 * np.trace(np.abs(R), axis1=1, axis2=2)[:, None, None] * np.eye(6))

    def direction(d_c):
        turned = _divide(lam, d_c)
        q = -r_dual + _apply(_J * w, turned) / eta
        u = np.einsum("bkcd,bkc->bkd", L, q)
        rhs = -r_primal - np.einsum("bkdi,bkd->bi", B, u)
        half = np.einsum("bji,bj->bi", R_inv, rhs)
        dy = np.einsum("bij,bj->bi", R_inv, half)
        u = u + np.einsum("bkdi,bi->bkd", Q, half)
        dx = np.einsum("bkcd,bkd->bkc", L, u)
        u[:, 0] = np.einsum("bcd,bd->bc", back, dx[:, 0])
        return dx, _apply(_J * w, turned - u) / eta, dy

    square = _product(lam, lam)
    dx, ds, _ = direction(-square)
    alpha = np.minimum(_room(x, dx), _room(s, ds))
    after = np.einsum("bkc,bkc->b", x + alpha[:, None, None] * dx, s + alpha[:, None, None] * ds) / x.shape[1]
    sigma = np.clip(after / gap, 0.0, 1.0) ** 3
    toward = np.zeros_like(lam)
    toward[..., 0] = (sigma * gap)[:, None]
    corrector = _product(_apply(_J * w, dx) / eta, _apply(w, ds) * eta)
    dx, ds, dy = direction(toward - square - corrector)
    alpha = 0.99 * np.minimum(_room(x, dx), _room(s, ds))
    step = alpha[:, None, None]
    return x + step * dx, s + step * ds, y + alpha[:, None] * dy, alpha


def _scaling(x: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The Nesterov-Todd point of each pair, as a hyperbolic unit vector and a factor: W = η W̄(w), W s = W⁻¹ x."""
    x_len, s_len = _length(x), _length(s)
    x_unit, s_unit = x / x_len, s / s_len
    gamma = np.sqrt((1.0 + (x_unit * s_unit).sum(axis=-1, keepdims=True)) / 2.0)
    w = (x_unit + _J * s_unit) / (2.0 * gamma)
    return w, np.sqrt(x_len / s_len)


def _length(x: np.ndarray) -> np.ndarray:
    tail = np.linalg.norm(x[..., 1:], axis=-1)
    return np.sqrt(np.maximum((x[..., 0] - tail) * (x[..., 0] + tail), 1e-30))[..., None]


def _inside(x: np.ndarray) -> np.ndarray:
    """How far inside its cones each point is: the least, over their heights."""
    return (1.0 - np.linalg.norm(x[..., 1:], axis=-1) / np.maximum(x[..., 0], 1e-300)).min(axis=1)


def _apply(w: np.ndarray, v: np.ndarray) -> np.ndarray:
    """W̄(w) v, the symmetric square root of the quadratic representation."""
    tail = (w[..., 1:] * v[..., 1:]).sum(axis=-1, keepdims=True)
    head = w[..., :1] * v[..., :1] + tail
    rest = v[..., 1:] + (v[..., :1] + tail / (1.0 + w[..., :1])) * w[..., 1:]
    return np.concatenate([head, rest], axis=-1)


def _matrix(w: np.ndarray) -> np.ndarray:
    """The matrix W̄(w)."""
    out = np.eye(3) + w[..., :, None] * w[..., None, :] / (1.0 + w[..., :1, None])
    out[..., 0, :] = w
    out[..., :, 0] = w
    return out


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Jordan product of Q³."""
    head = (a * b).sum(axis=-1, keepdims=True)
    return np.concatenate([head, a[..., :1] * b[..., 1:] + b[..., :1] * a[..., 1:]], axis=-1)


def _divide(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The u with a ∘ u = b."""
    head = np.maximum(_length(a) ** 2, 1e-30)
    u0 = (a[..., :1] * b[..., :1] - (a[..., 1:] * b[..., 1:]).sum(axis=-1, keepdims=True)) / head
    return np.concatenate([u0, (b[..., 1:] - u0 * a[..., 1:]) / a[..., :1]], axis=-1)


def _room(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
    """How far each point can go, at most 1, before one of its cones is left."""
    c = np.maximum(x[..., 0] ** 2 - (x[..., 1:] ** 2).sum(axis=-1), 1e-300)
    b = x[..., 0] * dx[..., 0] - (x[..., 1:] * dx[..., 1:]).sum(axis=-1)
    a = dx[..., 0] ** 2 - (dx[..., 1:] ** 2).sum(axis=-1)
    disc = np.sqrt(np.maximum(b**2 - a * c, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        # the first root of a t² + 2 b t + c: c / (-b + √(b² - a c)) where it lies ahead
        t = np.where((disc - b > 0.0) & (b**2 >= a * c), c / (disc - b), np.inf)
        t = np.where((a > 0.0) & (b >= 0.0), np.inf, t)
        head = np.where(dx[..., 0] < 0.0, -x[..., 0] / dx[..., 0], np.inf)
    return np.minimum(np.minimum(t, head).min(axis=1), 1.0)
