"""Threads read off a surface: the screw that carries it into itself.

A surface with unit normals n at points x slides along itself under a screw (v, ω) if ``n · v + (x × n) · ω`` is zero
everywhere (Gelfand & Guibas, "Shape segmentation using local slippage analysis", 2004). With the direction of the
axis given, ω is known and v follows from a linear fit: its part across the axis says where that is, its part along
it is the pitch. Clearance and overlap between two parts do not matter, for each tells its own screw.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, kw_only=True)
class HelixConfig:
    """What counts as a thread; lengths are over the typical distance from the axis."""

    flank: tuple[float, float] = (0.2, 0.95)
    """Faces whose normal has this much along the axis tell the pitch; more of it, and they are end faces."""
    inlier: float = 0.05
    """Largest normal velocity, over that of the turn, of a face that the screw carries along itself."""
    scales: tuple[float, ...] = (1.0, 0.5, 0.2, 0.1, 0.05, 0.03, 0.03, 0.03)
    """Scales of the Cauchy weights of the robust fit, one round each."""
    least_share: float = 0.03
    """Share of the surface, end faces aside, that flanks must be."""
    least_fit: float = 0.8
    """Share of the flanks that the screw must carry along themselves."""
    most_turned: float = 0.4
    """Most of the flanks that a mere turn may carry along themselves: cones and fillets are no threads."""
    least_pitch: float = 0.005
    """Smallest shift per radian."""
    most_pitch: float = 0.25
    """Largest shift per radian that is looked for where normals do not tell it."""
    most_pitches: int = 2000
    """Pitches that are looked at then, at most."""
    least_faces: int = 24
    """Fewer faces tell nothing."""
    coherence: float = 0.5
    """Of flanks that keep in step with a thread this much (see `_coherence`), the normals may err: facets of a fine
    thread do, by more than its slope. Ridges keep up to 0.9 of it, anything else seldom 0.2."""
    least_turns: float = 2.0
    """Turns from which on the pitch is told by the step rather than by the normals."""
    refined: float = 0.05
    """Relative change of the pitch by which it is looked for then."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Helix:
    """A screw by its axis and pitch."""

    axis: Float[np.ndarray, "3"]
    """Unit direction."""
    point: Float[np.ndarray, "3"]
    """A point on the axis [m]."""
    pitch: float
    """Shift along the axis for a turn about it by the right-hand rule [m/rad]; negative for a left-hand thread."""
    radius: float
    """Typical distance of the surface from the axis [m]."""

    def twist(self, sign: float) -> Float[np.ndarray, "6"]:
        """Return the spatial twist of one radian that shifts along the axis, or against it for a negative sign."""
        w = np.copysign(1.0, sign * self.pitch) * self.axis
        return np.concatenate([np.copysign(abs(self.pitch), sign) * self.axis - np.cross(w, self.point), w])


def fit_helix(
    triangles: Float[np.ndarray, "face 3 3"], axis: Float[np.ndarray, "3"], *, config: HelixConfig
) -> Helix | None:
    """Return the screw about an axis of this direction that carries the triangles along themselves, if one does.

    None for surfaces that a mere turn carries along themselves, or that have too few flanks. The flanks must slide
    along themselves, or keep in step with the thread: those of a fine one do, whatever its facets do to normals.
    """
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    good = areas > 1e-12 * areas.max(initial=0.0)
    normals, areas, points = normals[good] / areas[good, None], areas[good], triangles[good].mean(axis=1)
    along = normals @ axis
    side = np.abs(along) < config.flank[1]
    normals, areas, points, along = normals[side], areas[side], points[side], along[side]
    if len(areas) < config.least_faces:
        return None
    flank = np.abs(along) > config.flank[0]
    if areas[flank].sum() < config.least_share * areas.sum():
        return None
    middle = areas @ points / areas.sum()
    arms = points - middle
    radius = float(np.median(np.linalg.norm(np.cross(arms, axis), axis=1)))
    turning = -(np.cross(arms, normals) @ axis)
    v = _robust_fit(normals, turning, areas, radius, config)
    pitch = float(v @ axis)
    weights = (areas * along)[flank]
    if abs(pitch) < config.least_pitch * radius:
        return _by_step(axis, radius, points[flank], weights, config)
    helix = Helix(axis=axis, point=middle + np.cross(axis, v), pitch=pitch, radius=radius)
    if _coherence(helix, points[flank], weights) >= config.coherence:
        refined = _refined(helix, points[flank], weights, config)
        return refined or _by_step(axis, radius, points[flank], weights, config) or helix
    fits = _carried(normals[flank], turning[flank], np.abs(weights), v, config.inlier * radius)
    turned = _carried(normals[flank], turning[flank], np.abs(weights), v - pitch * axis, config.inlier * radius)
    if fits >= config.least_fit and turned <= config.most_turned:
        return helix
    return _by_step(axis, radius, points[flank], weights, config)


def _by_step(
    axis: Float[np.ndarray, "3"],
    radius: float,
    points: Float[np.ndarray, "face 3"],
    weights: Float[np.ndarray, "face"],
    config: HelixConfig,
) -> Helix | None:
    """The thread with which the faces keep in step best, of any pitch, about the middle of a circle through them.

    None if they keep in step with none.

    Where facets are coarse (sixteen a turn), their normals err by more than the slope of the thread.
    """
    untwisted = Helix(axis=axis, point=_circled(axis, points, np.abs(weights)), pitch=0.0, radius=radius)
    turned, along = _cylindrical(untwisted, points)
    least, most = (radius * limit for limit in (config.least_pitch, config.most_pitch))
    # phases z / pitch are told apart by a quarter turn over the whole length
    count = int(np.ceil(2.0 / np.pi * float(np.ptp(along)) * (1.0 / least - 1.0 / most)))
    rates = np.linspace(1.0 / most, 1.0 / least, min(max(count, 2), config.most_pitches))
    rates = np.concatenate([rates, -rates])
    waves = np.exp(-1j * turned) * weights
    step = np.array([abs((waves * np.exp(1j * along * rate)).sum()) for rate in rates]) / np.abs(weights).sum()
    best = int(np.argmax(step))
    if step[best] < config.coherence:
        return None
    found = replace(untwisted, pitch=1.0 / float(rates[best]))
    return _refined(found, points, weights, config) or found


def _circled(
    axis: Float[np.ndarray, "3"], points: Float[np.ndarray, "face 3"], weights: Float[np.ndarray, "face"]
) -> Float[np.ndarray, "3"]:
    """The point of an axis about which points lie on a circle, by linear least squares (Kåsa 1976)."""
    middle = weights @ points / weights.sum()
    plane = np.linalg.svd(axis[None])[2][1:]
    flat = (points - middle) @ plane.T
    rows = np.sqrt(weights)[:, None] * np.column_stack([2.0 * flat, np.ones(len(flat))])
    center = np.linalg.lstsq(rows, np.sqrt(weights) * (flat**2).sum(axis=1), rcond=None)[0][:2]
    return middle + center @ plane


def _coherence(helix: Helix, points: Float[np.ndarray, "face 3"], weights: Float[np.ndarray, "face"]) -> float:
    """How well faces keep in step with a thread of one start, from 0 to 1; weights are areas seen along the axis.

    In the phase ``z / pitch - angle`` a thread stands still: faces that look up are on one side of the circle, those
    that look down on the other, and their signed sum is long (2/π if spread evenly). Of anything else it cancels.
    """
    turned, along = _cylindrical(helix, points)
    return float(abs((weights * np.exp(1j * (along / helix.pitch - turned))).sum()) / np.abs(weights).sum())


def _refined(
    helix: Helix, points: Float[np.ndarray, "face 3"], weights: Float[np.ndarray, "face"], config: HelixConfig
) -> Helix | None:
    """The pitch near the helix's own with which the faces keep in step best, where there are turns enough to tell.

    None where they keep in step better with one that is farther off.
    """
    turned, along = _cylindrical(helix, points)
    turns = float(np.ptp(along)) / (2.0 * np.pi * abs(helix.pitch))
    if turns < config.least_turns:
        return helix
    count = int(np.ceil(16.0 * config.refined * turns))
    pitches = helix.pitch * (1.0 + np.linspace(-config.refined, config.refined, 2 * count + 1))
    step = np.array([abs((weights * np.exp(1j * (along / pitch - turned))).sum()) for pitch in pitches])
    best = int(np.argmax(step))
    if best in (0, 2 * count):
        return None
    before, here, after = step[best - 1 : best + 2]
    offset = 0.5 * (before - after) / min(before - 2.0 * here + after, -1e-12 * here)  # the parabola's top
    return replace(helix, pitch=float(pitches[best] + offset * (pitches[1] - pitches[0])))


def _cylindrical(
    helix: Helix, points: Float[np.ndarray, "face 3"]
) -> tuple[Float[np.ndarray, "face"], Float[np.ndarray, "face"]]:
    """Angles about the axis [rad] and coordinates along it [m]."""
    _, first, second = np.linalg.svd(helix.axis[None])[2]
    if np.cross(first, second) @ helix.axis < 0.0:
        second = -second
    arms = points - helix.point
    return np.arctan2(arms @ second, arms @ first), arms @ helix.axis


def _robust_fit(
    normals: Float[np.ndarray, "face 3"],
    turning: Float[np.ndarray, "face"],
    areas: Float[np.ndarray, "face"],
    radius: float,
    config: HelixConfig,
) -> Float[np.ndarray, "3"]:
    """The v that best solves ``n · v = turning``: reweighted least squares with ever narrower Cauchy weights."""
    v, weights = np.zeros(3), areas
    for scale in config.scales:
        weighed = normals * weights[:, None]
        v = np.linalg.solve(weighed.T @ normals + 1e-9 * weights.sum() * np.eye(3), weighed.T @ turning)
        weights = areas / (1.0 + ((normals @ v - turning) / (scale * radius)) ** 2)
    return v


def _carried(
    normals: Float[np.ndarray, "face 3"],
    turning: Float[np.ndarray, "face"],
    weights: Float[np.ndarray, "face"],
    v: Float[np.ndarray, "3"],
    limit: float,
) -> float:
    """The weighed share of faces that move along themselves."""
    return float(weights[np.abs(normals @ v - turning) < limit].sum() / weights.sum())
