"""What a part may be by its shape alone: a screw, a nut, a washer, a pin, a standoff, a circlip, or none.

Each shape says how sure it is. Some are told by themselves: a head with a socket and a thin shank is a screw. Others
look like what is none: a pin like a shaft, a washer like a ring. These are left to where they are in the assembly.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from sashimono.fasteners.profile import Profile, ProfileConfig, Section, part_profile
from sashimono.fasteners.sizes import nut_size, shank_size, washer_size
from sashimono.geometry.features.helix import Helix, HelixConfig, fit_helix

Form = Literal["headed", "headless", "nut", "washer", "standoff", "circlip", "plate"]
"""What a part looks like. "headless" is a round bar: a set screw, a stud, a pin, or a shaft."""

Drive = Literal["none", "hex socket", "six-lobe", "slot", "cross", "hex"]
"""What turns it: "hex" is an outer hexagon."""


@dataclass(frozen=True, kw_only=True)
class ShapeConfig:
    """What counts as which shape. Lengths are over the shank's or the hole's diameter unless stated."""

    profile: ProfileConfig = field(default_factory=ProfileConfig)
    helix: HelixConfig = field(default_factory=HelixConfig)
    turned: float = 0.8
    """Least share of the length that is round, hexagonal or square about the axis."""
    head: tuple[float, float] = (1.22, 3.1)
    """Diameter of a head, least and most."""
    head_length: float = 1.6
    """Longest head."""
    shank_length: float = 0.6
    """Shortest shank."""
    straight: float = 0.6
    """Share of a shank's length that is within a fifth of its radius; the rest is its tip."""
    solid: float = 0.65
    """Share of a shank's length that has no hole."""
    nut_length: tuple[float, float] = (0.2, 1.5)
    """Length of a nut, least and most; longer ones are standoffs."""
    nut_flats: tuple[float, float] = (1.35, 2.7)
    """Width of a nut across its flats, least and most."""
    standoff_flats: tuple[float, float] = (1.35, 4.0)
    """The same of a standoff."""
    washer_length: float = 0.4
    """Thickest washer."""
    washer_outer: tuple[float, float] = (1.4, 4.5)
    """Outer diameter of a washer, least and most."""
    plate_across: float = 2.8
    """Widest plate with a hole that may stand for a nut."""
    convex: float = 0.97
    """Least area of an outline, its hole filled, over that of its convex hull: gears and knobs have less."""
    clip_thickness: float = 0.3
    """Thickest circlip, over its outer radius."""
    clip_filled: float = 0.65
    """Most material of a circlip, over the area of its convex hull."""
    clip_around: tuple[float, float] = (0.6, 0.985)
    """Share of the full turn that a circlip covers, least and most."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shape:
    """A part that may be a fastener; lengths in m, in the frame of the vertices."""

    form: Form
    axis: Float[np.ndarray, "3"]
    """Unit direction; of what has a head or a drive, the way in: from there to the tip."""
    point: Float[np.ndarray, "3"]
    """On the axis: where the head rests, else the middle."""
    diameter: float
    """Of the shank or the hole."""
    outer: float
    """Largest diameter; across the flats of a hexagon."""
    low: float
    """Where the shank or ring begins, along the axis from the point."""
    high: float
    """Where it ends."""
    head_length: float = 0.0
    drive: Drive = "none"
    drive_size: float = 0.0
    """Across the flats of socket or hexagon."""
    helix: Helix | None = None
    """The thread on the shank, or in the hole."""
    size: str = ""
    """Nominal, as "M6"; "" if unknown."""
    certain: bool = False
    """Whether the shape tells by itself that it is a fastener."""

    @property
    def length(self) -> float:
        """Of the shank or ring along the axis."""
        return self.high - self.low


def recognise_shape(
    vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"], *, config: ShapeConfig
) -> Shape | None:
    """Return what a closed part may be by its shape alone; None if it looks like no fastener."""
    profile = part_profile(vertices, faces, config=config.profile)
    if profile is None:
        return None
    plate = _plate(profile, config) if profile.turned < config.turned else None
    clip = _circlip(profile, config)
    if clip is not None or plate is not None or profile.turned < config.turned:
        return clip or plate
    triangles = vertices[faces]
    for seen in (profile, profile.flipped()):
        found = _headed(seen, triangles, config)
        if found is not None:
            return found
    return _standoff(profile, config) or _ring(profile, triangles, config) or _headless(profile, triangles, config)


def _headed(profile: Profile, triangles: Float[np.ndarray, "face 3 3"], config: ShapeConfig) -> Shape | None:
    """A screw whose head is at the upper end."""
    sections = profile.sections
    radii = np.array([s.radius for s in sections])
    lengths = np.array([s.length for s in sections])
    for k in range(1, len(sections)):
        radius = float(radii[:k].max())
        if radii[k] < 1.06 * radius:
            continue
        shank, head = sections[:k], sections[k:]
        diameter, length, head_length = 2.0 * radius, float(lengths[:k].sum()), float(lengths[k:].sum())
        straight = lengths[:k][radii[:k] >= 0.8 * radius].sum()
        if not config.head[0] * radius <= radii[k:].max() <= config.head[1] * radius or straight < (
            config.straight * length
        ):
            continue
        if head_length > config.head_length * diameter or length < config.shank_length * diameter:
            continue
        if sum(s.length for s in shank if s.inner == "none") < config.solid * length:
            continue
        if any(s.outer in ("hex", "square", "other") for s in shank if s.radius > 0.9 * radius):
            continue
        if sum(s.length for s in head if s.outer in ("other", "ridged")) > 0.5 * head_length:
            continue
        drive, drive_size = _drive(head, config)
        # as far as a hole goes into the head only
        seat = shank[-1].high
        helix = _thread(triangles, profile, shank[0].low, seat, diameter, out=True, config=config)
        if helix is None and any(s.outer == "ridged" for s in shank):
            continue
        hexagon = [s for s in head if s.outer == "hex"]
        return Shape(
            form="headed",
            axis=-profile.axis,
            point=profile.point + seat * profile.axis,
            diameter=diameter,
            outer=max(s.flats for s in (hexagon or head)),
            low=0.0,
            high=seat - shank[0].low,
            head_length=head_length,
            drive=drive,
            drive_size=drive_size,
            helix=helix,
            size=shank_size(diameter),
            certain=drive != "none" or helix is not None,
        )
    return None


def _drive(head: tuple[Section, ...], config: ShapeConfig) -> tuple[Drive, float]:
    """What turns a head, given from its seat to its top, and the size across the flats."""
    total = sum(s.length for s in head)
    if not head:
        return "none", 0.0
    recesses: tuple[tuple[str, Drive], ...] = (
        ("hex", "hex socket"), ("lobes", "six-lobe"), ("cross", "cross"), ("slot", "slot"),
    )  # fmt: skip
    for inner, drive in recesses:
        with_it = [s for s in head if s.inner == inner]
        if sum(s.length for s in with_it) >= 0.1 * total:
            hexagon = _hexagon(head, total, config)
            if hexagon and drive in ("cross", "slot"):
                return "hex", hexagon
            return drive, float(np.median([s.hole for s in with_it]))
    hexagon = _hexagon(head, total, config)
    return ("hex", hexagon) if hexagon else ("none", 0.0)


def _hexagon(head: tuple[Section, ...], total: float, config: ShapeConfig) -> float:
    """Across the flats of a head that is a hexagon over 0.4 of its length, else 0."""
    flats = [s for s in head if s.outer == "hex" and s.outline_filled >= config.convex]
    return float(np.median([s.flats for s in flats])) if sum(s.length for s in flats) >= 0.4 * total else 0.0


def _headless(profile: Profile, triangles: Float[np.ndarray, "face 3 3"], config: ShapeConfig) -> Shape | None:
    """A round bar: with a drive it is a set screw, drive end up."""
    radius = max(s.radius for s in profile.sections)
    ends = 0.1 * profile.length
    low, high = profile.sections[0].low, profile.sections[-1].high
    round_ones = [s for s in profile.sections if s.outer in ("round", "ridged") and s.radius >= 0.8 * radius]
    if sum(s.length for s in round_ones) < 0.7 * profile.length:
        return None
    middle = [s for s in profile.sections if s.low > low + ends and s.high < high - ends]
    if any(s.radius < 0.85 * radius for s in middle) and not any(s.outer == "ridged" for s in middle):
        return None
    driven = [s for s in profile.sections if s.inner in ("hex", "lobes", "slot", "cross")]
    if any(s.outline_filled < config.convex for s in round_ones if s.outer == "round" and s.inner != "slot"):
        return None
    if driven:
        if sum(s.length for s in driven) > 0.75 * profile.length:
            return None
        at_top = driven[-1].high > high - ends
        if not at_top and driven[0].low > low + ends:
            return None
        if not at_top:
            profile = profile.flipped()
            low, high = profile.sections[0].low, profile.sections[-1].high
            driven = [s for s in profile.sections if s.inner in ("hex", "lobes", "slot", "cross")]
    rest = [s for s in profile.sections if s not in driven]
    if sum(s.length for s in rest if s.inner != "none") > (0.2 * profile.length if driven else 0.0):
        return None
    helix = _thread(triangles, profile, low, high, 2.0 * radius, out=True, config=config)
    if helix is None and any(s.outer == "ridged" for s in profile.sections):
        return None
    if driven and profile.length > 8.0 * 2.0 * radius and helix is None:
        return None
    drive, drive_size = _drive(tuple(driven), config)
    return Shape(
        form="headless",
        axis=-profile.axis,
        point=profile.point + high * profile.axis,
        diameter=2.0 * radius,
        outer=2.0 * radius,
        low=0.0,
        high=profile.length,
        drive=drive,
        drive_size=drive_size,
        helix=helix,
        size=shank_size(2.0 * radius),
        certain=drive in ("hex socket", "six-lobe"),
    )


def _ring(profile: Profile, triangles: Float[np.ndarray, "face 3 3"], config: ShapeConfig) -> Shape | None:
    """A nut or washer: a hole all the way through."""
    if any(s.inner not in ("round", "ridged") for s in profile.sections if s.length > 0.1 * profile.length):
        return None
    holes = [s.hole for s in profile.sections if s.inner in ("round", "ridged")]
    if not holes:
        return None
    hole, length = min(holes), profile.length
    low, high = profile.sections[0].low, profile.sections[-1].high
    helix = _thread(triangles, profile, low, high, hole, out=False, config=config)
    hexagon = [s for s in profile.sections if s.outer == "hex" and _is_convex(s, config)]
    square = [s for s in profile.sections if s.outer == "square" and _is_convex(s, config)]
    flats = float(np.median([s.flats for s in hexagon or square])) if hexagon or square else 0.0
    outer = flats or 2.0 * max(s.radius for s in profile.sections)
    nut_like = config.nut_flats[0] * hole <= outer <= config.nut_flats[1] * hole and (
        config.nut_length[0] * hole <= length <= config.nut_length[1] * hole
    )
    common = {
        "axis": profile.axis, "point": profile.point + 0.5 * (low + high) * profile.axis, "diameter": hole,
        "outer": outer, "low": -0.5 * length, "high": 0.5 * length, "helix": helix,
    }  # fmt: skip
    if nut_like and sum(s.length for s in hexagon) >= 0.45 * length:
        size = nut_size(hole, flats)
        return Shape(form="nut", drive="hex", drive_size=flats, size=size, certain=True, **common)
    if nut_like and sum(s.length for s in square) >= 0.8 * length:
        size = nut_size(hole, flats)
        return Shape(form="nut", drive="hex", drive_size=flats, size=size, certain=helix is not None, **common)
    plain = [s for s in profile.sections if s.outer == "round"]
    if sum(s.length for s in plain) < 0.8 * length:
        return None
    if helix is not None and 0.2 * hole <= length <= config.nut_length[1] * hole and 1.15 * hole <= outer <= 2.7 * hole:
        return Shape(form="nut", certain=True, **common)
    if helix is not None and 1.5 * hole < length and 1.2 * hole <= outer <= 3.0 * hole:
        return Shape(form="standoff", certain=True, **common)
    constant = max(holes) <= 1.1 * hole and all(s.radius >= 0.8 * 0.5 * outer for s in plain)
    if (
        constant
        and length <= config.washer_length * hole
        and config.washer_outer[0] * hole <= outer <= config.washer_outer[1] * hole
        and all(_is_convex(s, config) for s in plain)
    ):
        size = washer_size(hole, outer, length)
        return Shape(form="washer", size=size, certain=size != "", **common)
    return None


def _standoff(profile: Profile, config: ShapeConfig) -> Shape | None:
    """A hexagonal bar with a hole in each end, or in one end and a stud on the other."""
    hexagon = [s for s in profile.sections if s.outer == "hex" and _is_convex(s, config)]
    if not hexagon:
        return None
    flats = float(np.median([s.flats for s in hexagon]))
    body = sum(s.length for s in hexagon)
    if body < 1.2 * flats * 0.5 or body < 0.6 * profile.length:
        return None
    ends = [profile.sections[0], profile.sections[-1]]
    holes = [s.hole for s in hexagon if s.inner == "round"]
    if not holes:
        return None
    hole = max(holes)
    studs = [s.outer == "round" and s.inner == "none" and s.radius <= 0.4 * flats for s in ends]
    open_ends = [s.inner == "round" for s in ends]
    if not all(a or b for a, b in zip(studs, open_ends, strict=True)) or not any(open_ends):
        return None
    if not config.standoff_flats[0] * hole <= flats <= config.standoff_flats[1] * hole or (
        body <= config.nut_length[1] * hole
    ):
        return None
    low, high = profile.sections[0].low, profile.sections[-1].high
    return Shape(
        form="standoff",
        axis=profile.axis,
        point=profile.point + 0.5 * (low + high) * profile.axis,
        diameter=hole,
        outer=flats,
        low=0.5 * (low - high),
        high=0.5 * (high - low),
        drive="hex",
        drive_size=flats,
        size=nut_size(hole, flats),
        certain=True,
    )


def _circlip(profile: Profile, config: ShapeConfig) -> Shape | None:
    """A flat ring with a gap."""
    radius = max(s.radius for s in profile.sections)
    if profile.length > config.clip_thickness * radius:
        return None
    for s in profile.sections:
        if (
            s.inner != "other"
            or s.pieces != 1
            or s.filled > config.clip_filled
            or not config.clip_around[0] <= s.around <= config.clip_around[1]
            or s.inside < 0.35 * radius
        ):
            return None
    low, high = profile.sections[0].low, profile.sections[-1].high
    inside = min(s.inside for s in profile.sections)
    return Shape(
        form="circlip",
        axis=profile.axis,
        point=profile.point + 0.5 * (low + high) * profile.axis,
        diameter=2.0 * inside,
        outer=2.0 * radius,
        low=0.5 * (low - high),
        high=0.5 * (high - low),
        certain=False,
    )


def _plate(profile: Profile, config: ShapeConfig) -> Shape | None:
    """A small plate of one outline with one round hole in its middle."""
    first = profile.sections[0]
    for s in profile.sections:
        same = abs(s.radius - first.radius) <= 0.02 * first.radius and abs(s.hole - first.hole) <= 0.02 * first.radius
        if s.inner != "round" or not same or s.pieces != 1 or not _is_convex(s, config):
            return None
    if 2.0 * first.radius > config.plate_across * first.hole or profile.length > config.nut_length[1] * first.hole:
        return None
    low, high = profile.sections[0].low, profile.sections[-1].high
    return Shape(
        form="plate",
        axis=profile.axis,
        point=profile.point + 0.5 * (low + high) * profile.axis,
        diameter=first.hole,
        outer=2.0 * first.radius,
        low=0.5 * (low - high),
        high=0.5 * (high - low),
    )


def _is_convex(section: Section, config: ShapeConfig) -> bool:
    """Whether a section is one convex outline, its holes filled."""
    return section.pieces == 1 and section.outline_filled >= config.convex


def _thread(
    triangles: Float[np.ndarray, "face 3 3"],
    profile: Profile,
    low: float,
    high: float,
    diameter: float,
    *,
    out: bool,
    config: ShapeConfig,
) -> Helix | None:
    """The thread between two heights on the outside, or on the inside, of what is near this diameter."""
    middles = triangles.mean(axis=1)
    arms = middles - profile.point
    heights = arms @ profile.axis
    arms = arms - np.outer(heights, profile.axis)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    reach = np.linalg.norm(arms, axis=1)
    outward = (normals * arms).sum(axis=1) > 0.0
    flat = np.abs(normals @ profile.axis) > 0.98 * np.linalg.norm(normals, axis=1)
    near = (heights > low) & (heights < high) & (outward | flat if out else ~outward | flat)
    near &= (reach < 0.55 * diameter) & (reach > 0.3 * diameter) if out else (reach < 0.65 * diameter)
    helix = fit_helix(triangles[near], profile.axis, config=config.helix) if near.sum() else None
    if helix is None or not 0.05 <= 2.0 * np.pi * abs(helix.pitch) / diameter <= 0.6:
        return None
    return helix
