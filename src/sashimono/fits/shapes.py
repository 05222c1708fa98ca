"""Parts that are elastic by their whole shape: open rings, helical springs, O-rings, formed sheets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from sashimono.assembly import millimetres
from sashimono.fits.config import FitConfig
from sashimono.geometry.body import Body
from sashimono.geometry.distance.rays import cast_rays
from sashimono.geometry.features.circle import circle_center
from sashimono.geometry.features.directions import frame_along
from sashimono.geometry.mesh import measures, topology

_ANGLES = 180
_TURNS = 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
_CENTRED = 3
_LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)


@dataclass(frozen=True, kw_only=True, eq=False)
class ElasticShape:
    """What a part is, if it is elastic by its whole shape."""

    kind: Literal["ring", "spring", "seal", "clip"]
    words: str
    """What it is, with its measures."""
    give: float
    """How far it can give [m]."""
    axis: Float[np.ndarray, "3"] | None = None
    """Unit, its own frame: it gives across this, as a ring does; None if no direction is told."""


def elastic_shape(body: Body, axes: Float[np.ndarray, "axis 3"], *, config: FitConfig) -> ElasticShape | None:
    """Return what a part is by its whole shape; None if nothing tells that it is elastic.

    Args:
        body: The part.
        axes: Unit lines of its surface, in its own frame: the axis of a ring is one of them.
        config: What counts as what.
    """
    for told in (_spring, _seal, _open_ring):
        for axis in axes:
            found = told(body, axis, config)
            if found is not None:
                return found
    return None if any(_is_tube(body, axis) for axis in axes) else _formed_sheet(body, config)


def sheet_thickness(body: Body) -> float:
    """Return twice a part's volume over its surface [m]: the thickness of a sheet, half that of a round wire."""
    return 2.0 * abs(body.mass_properties.volume) / measures.area(body.vertices, body.faces)


def _open_ring(body: Body, axis: Float[np.ndarray, "3"], config: FitConfig) -> ElasticShape | None:
    """A circlip, or a C-clip: round inside or outside, thin across, and with a gap. It opens like a curved beam.

    A beam of radius R and thickness t that is bent to R + δ is strained by t/2 · (1/R - 1/(R + δ)) ≈ t δ / (2 R²).
    """
    for outside in (False, True):
        seen = _around(body, axis, outside)
        if seen is None:
            continue
        inner, outer = seen
        there = np.isfinite(inner)
        gap = 360.0 / _ANGLES * _longest_gap(there)
        if not config.ring_gap[0] <= gap <= config.ring_gap[1] or (~there).sum() > 1.2 * gap * _ANGLES / 360.0 + 1:
            continue
        # it bends where it is thin, between prongs and lugs
        thickness = float(np.quantile((outer - inner)[there], 0.25))
        rim = (outer if outside else inner)[there]
        radius = float(np.median(rim)) + (-0.5 if outside else 0.5) * thickness
        uneven = float(np.ptp(np.quantile(rim, (0.1, 0.9))))
        if not 0.0 < thickness <= config.ring_thickness * radius or uneven > config.ring_round * radius:
            continue
        give = min(2.0 * config.strain * radius**2 / thickness, config.stretch * radius)
        size = f"{millimetres(thickness)} across at a radius of {millimetres(radius)}"
        words = f"an open ring, {size}, with a gap of {gap:.0f}°"
        return ElasticShape(kind="ring", words=words, give=give, axis=axis)
    return None


def _around(
    body: Body, axis: Float[np.ndarray, "3"], outside: bool
) -> tuple[Float[np.ndarray, "ray"], Float[np.ndarray, "ray"]] | None:
    """Where a part begins and ends all around an axis of this direction, through the middle of its inner or outer rim;
    None if the axis is not free, or if the part is not there at most heights.

    Lugs stand out on the one rim, prongs on the other.
    """
    frame = frame_along(axis)
    along = body.vertices @ axis
    low, high = float(along.min()), float(along.max())
    center = circle_center(body.samples @ frame[:2].T)
    rays = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
    inner, outer = np.full(_ANGLES, np.inf), np.zeros(_ANGLES)
    for _ in range(_CENTRED):
        origins = [center @ frame[:2] + (low + level * (high - low)) * axis for level in _LEVELS]
        if (body.signed_distance.query(np.array(origins)) <= 0.0).any():
            return None
        inner, outer, levels = _seen_around(body, origins, rays @ frame[:2])
        there = np.isfinite(inner)
        if there.sum() < 3 or np.median(levels[there]) < 3:
            return None
        rim = (outer if outside else inner)[there]
        # what stands out aside: the next circle is through the half of the rim that is nearest to this one
        off = np.abs(rim - np.median(rim))
        kept = off <= np.median(off)
        center = circle_center(center + (rim[:, None] * rays[there])[kept])
    return inner, outer


def _seen_around(
    body: Body, origins: list[Float[np.ndarray, "3"]], rays: Float[np.ndarray, "ray 3"]
) -> tuple[Float[np.ndarray, "ray"], Float[np.ndarray, "ray"], Int[np.ndarray, "ray"]]:
    """Where a part begins and ends along each ray, as seen from some points and from afar; and from how many of the
    points it is met."""
    inner, outer = np.full((len(origins), len(rays)), np.inf), np.zeros((len(origins), len(rays)))
    far = 3.0 * body.radius
    for k, origin in enumerate(origins):
        inner[k], _ = cast_rays(body.signed_distance, np.tile(origin, (len(rays), 1)), rays, side="entering")
        hit = np.isfinite(inner[k])
        back, _ = cast_rays(body.signed_distance, origin + far * rays[hit], -rays[hit], side="entering")
        outer[k, hit] = far - back
    return inner.min(axis=0), outer.max(axis=0), np.isfinite(inner).sum(axis=0)


def _is_tube(body: Body, axis: Float[np.ndarray, "3"]) -> bool:
    """Whether a part is closed all around an axis of this direction through its middle, at most heights."""
    frame = frame_along(axis)
    along = body.vertices @ axis
    origins = [body.center + (along.min() + level * np.ptp(along) - body.center @ axis) * axis for level in _LEVELS]
    if (body.signed_distance.query(np.array(origins)) <= 0.0).any():
        return False
    rays = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)]) @ frame[:2]
    return bool(_seen_around(body, origins, rays)[2].min() >= 3)


def _longest_gap(there: Bool[np.ndarray, "angle"]) -> int:
    """The longest run, around the circle, of angles at which nothing is."""
    if there.all() or not there.any():
        return 0 if there.all() else len(there)
    start = int(np.argmax(there))
    longest = run = 0
    for k in np.roll(there, -start):
        run = 0 if k else run + 1
        longest = max(longest, run)
    return longest


def _spring(body: Body, axis: Float[np.ndarray, "3"], config: FitConfig) -> ElasticShape | None:
    """A helical spring: a thin round wire whose surface keeps in step with a pitch, over two turns and more."""
    frame = frame_along(axis)
    flat, along = body.samples @ frame[:2].T, body.samples @ axis
    flat = flat - circle_center(flat)
    radii = np.hypot(*flat.T)
    radius = 0.5 * float(np.quantile(radii, (0.02, 0.98)).sum())
    wire = sheet_thickness(body)  # of a round wire, its radius
    if not 0.0 < wire <= config.spring_wire * radius or (np.abs(radii - radius) > 1.6 * wire).mean() > 0.05:
        return None
    length = float(np.ptp(along))
    if length < 4.0 * wire:
        return None
    # phases are told apart by an eighth of a turn over the whole length
    rates = 2.0 * np.pi * np.arange(2.0, 0.5 * length / wire, 0.125) / length
    rates = np.concatenate([rates, -rates])
    # what looks in or out is level with the middle of the wire
    outward = (body.sample_normals @ frame[:2].T * flat).sum(axis=1) / radii
    level = np.abs(outward) > 0.85
    if level.mean() < 0.1:
        return None
    along = along[level]
    waves = np.exp(1j * np.arctan2(flat[level, 1], flat[level, 0]))
    step = np.array([abs((waves * np.exp(-1j * along * rate)).mean()) for rate in rates]) if len(rates) else np.zeros(1)
    if step.max() < config.spring_step:
        return None
    turns = length * abs(float(rates[int(np.argmax(step))])) / (2.0 * np.pi)
    words = f"a helical spring of {turns:.1f} turns, wire {millimetres(2.0 * wire)}, coil radius {millimetres(radius)}"
    return ElasticShape(kind="spring", words=words, give=min(config.stretch * radius, 2.0 * wire), axis=axis)


def _seal(body: Body, axis: Float[np.ndarray, "3"], config: FitConfig) -> ElasticShape | None:
    """An O-ring by its shape, a torus. That it is one is told only where it sits tight (see `sits_tight`)."""
    frame = frame_along(axis)
    points = np.concatenate([body.vertices, body.samples])
    flat, along = points @ frame[:2].T, points @ axis
    flat = flat - 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    radii = np.hypot(*flat.T)
    radius, section = 0.5 * float(radii.max() + radii.min()), 0.5 * float(np.ptp(along))
    if not 0.0 < section <= config.seal_section * radius:
        return None
    off = np.hypot(radii - radius, along - 0.5 * (along.max() + along.min())) - section
    around = np.histogram(np.arctan2(flat[:, 1], flat[:, 0]), bins=12, range=(-np.pi, np.pi))[0]
    if np.abs(off).max() > config.seal_round * section or (around == 0).any():
        return None
    words = f"an O-ring, section {millimetres(2.0 * section)}, inner diameter {millimetres(2.0 * (radius - section))}"
    return ElasticShape(kind="seal", words=words, give=min(config.stretch * radius, 1.7 * section), axis=axis)


def sits_tight(
    body: Body, other: Body, T_other_body: Float[np.ndarray, "4 4"], axis: Float[np.ndarray, "3"], config: FitConfig
) -> bool:
    """Return whether a ring about an axis of its own frame touches, or overlaps, another part nearly all around."""
    frame = frame_along(axis)
    flat = body.samples @ frame[:2].T
    flat = flat - 0.5 * (flat.min(axis=0) + flat.max(axis=0))
    near = 0.1 * sheet_thickness(body)
    gaps = other.signed_distance.query(body.samples @ T_other_body[:3, :3].T + T_other_body[:3, 3])
    at = np.arctan2(flat[gaps < near, 1], flat[gaps < near, 0])
    touched = np.histogram(at, bins=24, range=(-np.pi, np.pi))[0] > 0
    return float(touched.mean()) >= config.seal_around


def _formed_sheet(body: Body, config: FitConfig) -> ElasticShape | None:
    """A clip of formed sheet: thin everywhere, not flat, and hollow, but no closed box."""
    thickness, middle = sheet_thickness(body), float(body.extents[1])
    filled = abs(body.mass_properties.volume) / float(body.hull.volume)
    if thickness > config.sheet * middle or filled > config.sheet_filled or body.wall > 1.5 * thickness:
        return None
    starts = body.samples - 1e-6 * body.radius * body.sample_normals
    across, _ = cast_rays(body.signed_distance, starts, -body.sample_normals, side="leaving")
    if (np.abs(across - np.median(across)) < 0.2 * np.median(across)).mean() < config.sheet_even:
        return None
    if float(body.extents[0]) < config.sheet_formed * thickness or topology.shells(body.faces).max() > 0:
        return None
    free = config.sheet_free * middle
    give = min(config.strain * free**2 / (1.5 * thickness), 2.0 * thickness)
    return ElasticShape(kind="clip", words=f"a clip of formed sheet, {millimetres(thickness)} thick", give=give)
