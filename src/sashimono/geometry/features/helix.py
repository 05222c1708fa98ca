"""Threads read off a surface: the screw that carries it into itself.

A surface with unit normals n at points x slides along itself under a screw (v, ω) if ``n · v + (x × n) · ω`` is zero
everywhere (Gelfand & Guibas, "Shape segmentation using local slippage analysis", 2004). With the direction of the
axis given, ω is known and v follows from a linear fit: its part across the axis says where that is, its part along
it is the pitch. Clearance and overlap between two parts do not matter, for each tells its own screw.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex, Float


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
    most_starts: int = 4
    """Threads have at most so many starts."""
    per_turn: int = 16
    """Least faces of flanks on one turn of a ridge."""
    one_handed: float = 0.7
    """Share of the step with a thread that may be kept with the same one of the other hand."""
    as_good: float = 0.8
    """Fewer starts are taken if they keep this share of the step that more of them keep."""
    steep: float = 0.9999
    """Where such flanks tell nothing, faces whose normal has up to this much along the axis are flanks: of a square
    thread. The ends of a part have more."""
    least_faces: int = 24
    """Fewer faces tell nothing."""
    coherence: float = 0.5
    """Of flanks that keep in step with a thread this much (see `_coherence`), the normals may err: facets of a fine
    thread do, by more than its slope. Ridges keep up to 0.9 of it, anything else seldom 0.2."""
    least_turns: float = 2.0
    """Turns of ridges, side by side or not, from which on the pitch is told by the step rather than by the normals."""
    refined: float = 0.05
    """Relative change of the pitch by which it is looked for then; more, where there are few ridges."""
    rings: tuple[float, ...] = (0.02, 0.005, 0.002)
    """Widths of the rings about the axis, each about a better one, whose corners of flanks are taken for a circle."""
    ring_share: float = 0.25
    """Share of the corners that the last ring must have: crests and roots have, a taper has not."""


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
    starts: int = 1
    """Ridges that run side by side."""

    @property
    def lead(self) -> float:
        """Shift along the axis in one whole turn [m], positive."""
        return 2.0 * np.pi * abs(self.pitch)

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
    faces = _Faces.of(triangles, axis)
    flanks = faces.between(*config.flank)
    side = faces.between(0.0, config.flank[1])
    found = None
    if len(side.areas) >= config.least_faces and flanks.areas.sum() >= config.least_share * side.areas.sum():
        found = _by_slippage(side, flanks, config)
    if found is None:
        flanks = faces.between(config.flank[0], config.steep)
        if len(flanks.areas) < config.least_faces or flanks.areas.sum() < config.least_share * faces.areas.sum():
            return None
        found = _by_step(flanks, flanks.radius(flanks.middle), config)
    if found is None:
        return None
    centered = replace(found, point=_center(found, flanks, config))
    return _refined(centered, flanks, config) or found


def refit_helix(helix: Helix, triangles: Float[np.ndarray, "face 3 3"], *, config: HelixConfig) -> Helix:
    """Return the helix with the pitch that more of the same thread tells: the more turns, the better it is known."""
    flanks = _Faces.of(triangles, helix.axis).between(config.flank[0], config.steep)
    if len(flanks.areas) < config.least_faces:
        return helix
    return _refined(helix, flanks, config) or helix


def thread_phase(helix: Helix, triangles: Float[np.ndarray, "face 3 3"], *, config: HelixConfig) -> float:
    """Return where along the helix those flanks are that look along its axis, from -π to π [rad].

    A whole turn is from one ridge to the next. A shift by s along the axis adds ``starts s / pitch``. Of two threads
    that fit into one another, one has its ridges where the other has none: their phases differ by π.
    """
    flanks = _Faces.of(triangles, helix.axis).between(config.flank[0], config.steep)
    return float(np.angle(_in_step(helix, flanks, np.array([helix.pitch]), windowed=True)[0]))


@dataclass(frozen=True, kw_only=True, eq=False)
class _Faces:
    """Faces seen along an axis."""

    axis: Float[np.ndarray, "3"]
    corners: Float[np.ndarray, "face 3 3"]
    points: Float[np.ndarray, "face 3"]
    normals: Float[np.ndarray, "face 3"]
    areas: Float[np.ndarray, "face"]

    @classmethod
    def of(cls, triangles: Float[np.ndarray, "face 3 3"], axis: Float[np.ndarray, "3"]) -> _Faces:
        """Take in triangles; those of no area are left out."""
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        areas = np.linalg.norm(normals, axis=1)
        good = areas > 1e-12 * areas.max(initial=0.0)
        triangles, areas = triangles[good], areas[good]
        normals = normals[good] / areas[:, None]
        return cls(axis=axis, corners=triangles, points=triangles.mean(axis=1), normals=normals, areas=areas)

    @property
    def along(self) -> Float[np.ndarray, "face"]:
        return self.normals @ self.axis

    @property
    def weights(self) -> Float[np.ndarray, "face"]:
        """Areas as seen along the axis, with the sign of the side that is seen."""
        return self.areas * self.along

    @property
    def middle(self) -> Float[np.ndarray, "3"]:
        return self.areas @ self.points / self.areas.sum()

    def between(self, least: float, most: float) -> _Faces:
        """The faces whose normals have so much along the axis."""
        along = np.abs(self.along)
        keep = (along >= least) & (along < most)
        arrays = {name: getattr(self, name)[keep] for name in ("corners", "points", "normals", "areas")}
        return replace(self, **arrays)

    def radius(self, point: Float[np.ndarray, "3"]) -> float:
        """Typical distance from the axis through a point [m]."""
        return float(np.median(np.linalg.norm(np.cross(self.points - point, self.axis), axis=1)))


def _by_slippage(side: _Faces, flanks: _Faces, config: HelixConfig) -> Helix | None:
    """The screw that normals tell, or else that by which the flanks keep in step."""
    axis, middle = side.axis, side.middle
    radius = side.radius(middle)

    def turning(faces: _Faces) -> Float[np.ndarray, "face"]:
        return -(np.cross(faces.points - middle, faces.normals) @ axis)

    v = _robust_fit(side.normals, turning(side), side.areas, radius, config)
    pitch = float(v @ axis)
    if abs(pitch) < config.least_pitch * radius:
        return _by_step(flanks, radius, config)
    helix = Helix(axis=axis, point=middle + np.cross(axis, v), pitch=pitch, radius=radius)
    every = [replace(helix, starts=k + 1) for k in range(config.most_starts)]
    coherences = np.array([_coherence(each, flanks) for each in every])
    helix = every[_fewest(coherences, config)]
    if coherences.max() >= config.coherence:
        refined = _refined(helix, flanks, config)
        return refined or _by_step(flanks, radius, config) or helix
    stepped = _by_step(flanks, radius, config)
    if stepped is not None:
        return stepped
    weights, limit = np.abs(flanks.weights), config.inlier * radius
    fits = _carried(flanks.normals, turning(flanks), weights, v, limit)
    turned = _carried(flanks.normals, turning(flanks), weights, v - pitch * axis, limit)
    return helix if fits >= config.least_fit and turned <= config.most_turned else None


def _by_step(flanks: _Faces, radius: float, config: HelixConfig) -> Helix | None:
    """The thread with which the faces keep in step best, of any pitch, about the middle of a circle through them.

    None if they keep in step with none.

    Where facets are coarse (sixteen a turn), their normals err by more than the slope of the thread.
    """
    point, _ = _circled(flanks.axis, flanks.points, np.abs(flanks.weights))
    untwisted = Helix(axis=flanks.axis, point=point, pitch=0.0, radius=radius)
    turned, along = _cylindrical(untwisted, flanks.points)
    along = along - along.min()
    least, most = (radius * limit for limit in (config.least_pitch, config.most_pitch))
    found, coherences = [], []
    for starts in range(1, config.most_starts + 1):
        # few faces keep in step with any number of turns
        fastest = min(starts / least, 2.0 * np.pi * len(along) / (config.per_turn * max(float(along.max()), least)))
        # a cell is small beside the shortest wave, and a quarter turn of phase tells two rates apart
        cell = 0.3 / fastest
        waves = np.exp(-1j * starts * turned) * flanks.weights
        index = (along / cell).astype(np.int64)
        count = 1 << (4 * int(index.max()) + 3).bit_length()
        sums = np.bincount(index, np.real(waves), count) + 1j * np.bincount(index, np.imag(waves), count)
        step = np.abs(np.fft.ifft(sums)) * count / np.abs(flanks.weights).sum()
        rates = 2.0 * np.pi * np.fft.fftfreq(count, cell)
        step[(np.abs(rates) < starts / most) | (np.abs(rates) > fastest)] = 0.0
        # what keeps in step with either hand is no thread
        step[step * config.one_handed < np.roll(step[::-1], 1)] = 0.0
        k = int(np.argmax(step))
        coherences.append(float(step[k]))
        found.append(replace(untwisted, pitch=starts / float(rates[k]) if step[k] > 0.0 else most, starts=starts))
    if max(coherences) < config.coherence:
        return None
    best = found[_fewest(np.array(coherences), config)]
    return _refined(best, flanks, config) or best


def _fewest(coherences: Float[np.ndarray, "starts"], config: HelixConfig) -> int:
    """Which number of starts it is: the first that is as good as the best, as square ridges keep all odd ones."""
    return int(np.argmax(coherences >= config.as_good * coherences.max()))


def _center(helix: Helix, flanks: _Faces, config: HelixConfig) -> Float[np.ndarray, "3"]:
    """A point of the axis of the circle, or cone, on which most corners of the flanks lie; if few do, the helix's."""
    corners = flanks.corners.reshape(-1, 3)
    point, slope = _circled(helix.axis, corners, np.ones(len(corners)))
    share = 0.0
    for width in config.rings:
        along = (corners - point) @ helix.axis
        reach = np.linalg.norm(np.cross(corners - point, helix.axis), axis=1) - slope * along
        order = np.argsort(reach)
        stops = np.searchsorted(reach[order], reach[order] + width * helix.radius, side="right")
        counts = stops - np.arange(len(order))
        first = int(np.argmax(counts))
        share = float(counts[first]) / len(order)
        ring = corners[order[first : stops[first]]]
        point, slope = _circled(helix.axis, ring, np.ones(len(ring)))
    return point if share >= config.ring_share else helix.point


def _circled(
    axis: Float[np.ndarray, "3"], points: Float[np.ndarray, "point 3"], weights: Float[np.ndarray, "point"]
) -> tuple[Float[np.ndarray, "3"], float]:
    """The point of an axis about which points lie on a circle, or on a slim cone, and how the radius grows along it.

    By linear least squares (Kåsa 1976), with the square of the radius linear along the axis.
    """
    middle = weights @ points / weights.sum()
    plane = np.linalg.svd(axis[None])[2][1:]
    arms = points - middle
    flat = arms @ plane.T
    rows = np.sqrt(weights)[:, None] * np.column_stack([2.0 * flat, np.ones(len(flat)), arms @ axis])
    solved = np.linalg.lstsq(rows, np.sqrt(weights) * (flat**2).sum(axis=1), rcond=None)[0]
    radius = np.sqrt(max(float(solved[2] + solved[:2] @ solved[:2]), 1e-300))
    return middle + solved[:2] @ plane, float(solved[3]) / (2.0 * radius)


def _in_step(
    helix: Helix, flanks: _Faces, pitches: Float[np.ndarray, "pitch"], *, windowed: bool = False
) -> Complex[np.ndarray, "pitch"]:
    """The sums of the flanks' weights, each with its phase in a thread of one of these pitches, over all weights.

    Windowed (Hann), so that faces where the thread begins and ends say less: a part of a turn has a phase of its own.
    """
    turned, along = _cylindrical(helix, flanks.points)
    weights = flanks.weights
    if windowed:
        length = max(float(np.ptp(along)), 1e-12 * helix.radius)
        weights = weights * np.sin(np.pi * (along - along.min()) / length) ** 2
    total = max(float(np.abs(weights).sum()), 1e-300)
    waves = weights * np.exp(-1j * helix.starts * turned)
    return np.array([(waves * np.exp(1j * helix.starts * along / pitch)).sum() / total for pitch in pitches])


def _coherence(helix: Helix, flanks: _Faces) -> float:
    """How well faces keep in step with a thread, from 0 to 1; weights are areas seen along the axis.

    In the phase ``z / pitch - angle`` a thread stands still: faces that look up are on one side of the circle, those
    that look down on the other, and their signed sum is long (2/π if spread evenly). Of anything else it cancels.
    """
    return float(abs(_in_step(helix, flanks, np.array([helix.pitch]))[0]))


def _refined(helix: Helix, flanks: _Faces, config: HelixConfig) -> Helix | None:
    """The pitch near the helix's own with which the faces keep in step best, where there are turns enough to tell.

    None where they keep in step better with one that is farther off.
    """
    ridges = float(np.ptp(_cylindrical(helix, flanks.points)[1])) / helix.lead * helix.starts
    if ridges < config.least_turns:
        return helix
    # few ridges tell it only to a part of what one of them more would make
    reach = max(config.refined, 0.5 / ridges)
    count = int(np.ceil(16.0 * reach * ridges))
    pitches = helix.pitch * (1.0 + np.linspace(-reach, reach, 2 * count + 1))
    step = np.abs(_in_step(helix, flanks, pitches, windowed=True))
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
