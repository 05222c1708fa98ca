"""Solid modelling for the families: primitives, fasteners and placement on manifold3d, all in millimetres.

Solids are drawn along z about the origin and then placed. Curved surfaces are polygons: hole and shaft that belong
together take the same number of segments, so that their facets lie on one another.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeVar

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold, OpType

from sashimono.d4pas.product import Product

Vector = Sequence[float] | np.ndarray
T = TypeVar("T")

SEGMENTS = 24
"""Facets of a full turn where nothing else is said."""

METRIC = {
    2.0: (3.8, 4.0, 2.0, 1.6, 0.4),
    2.5: (4.5, 5.0, 2.5, 2.0, 0.45),
    3.0: (5.5, 5.5, 3.0, 2.4, 0.5),
    4.0: (7.0, 7.0, 4.0, 3.2, 0.7),
    5.0: (8.5, 8.0, 5.0, 4.7, 0.8),
    6.0: (10.0, 10.0, 6.0, 5.2, 1.0),
    8.0: (13.0, 13.0, 8.0, 6.8, 1.25),
    10.0: (16.0, 16.0, 10.0, 8.4, 1.5),
    12.0: (18.0, 18.0, 12.0, 10.8, 1.75),
}
"""By nominal size: cap head diameter, hex width across flats, cap head height, nut height, coarse pitch (ISO 4762,
4014, 4032)."""


class Draw:
    """Draws parameters from a generator, rounded so that JSON holds them exactly."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def length(self, low: float, high: float, step: float = 0.1) -> float:
        """Return a length, evenly from an interval, in steps [mm]."""
        return round(round(float(self.rng.uniform(low, high)) / step) * step, 6)

    def count(self, low: int, high: int) -> int:
        """Return an integer, both ends included."""
        return int(self.rng.integers(low, high + 1))

    def chance(self, probability: float) -> bool:
        """Return whether something with this probability happens."""
        return bool(self.rng.random() < probability)

    def choice(self, options: Sequence[T], weights: Sequence[float] | None = None) -> T:
        """Return one of the options."""
        p = None if weights is None else np.asarray(weights, float) / np.sum(weights)
        return options[int(self.rng.choice(len(options), p=p))]

    def some(self, options: Sequence[T], count: int) -> list[T]:
        """Return this many different options, in their order."""
        picked = self.rng.choice(len(options), size=count, replace=False)
        return [options[k] for k in sorted(int(k) for k in picked)]


def cylinder(diameter: float, z0: float, z1: float, *, segments: int = SEGMENTS, top: float | None = None) -> Manifold:
    """Return a cylinder about z from z0 to z1; a cone if ``top`` gives another diameter at z1."""
    return Manifold.cylinder(z1 - z0, diameter / 2.0, (diameter if top is None else top) / 2.0, segments).translate(
        (0.0, 0.0, z0)
    )


def tube(outer: float, inner: float, z0: float, z1: float, *, segments: int = SEGMENTS) -> Manifold:
    """Return a ring about z with these diameters."""
    return cylinder(outer, z0, z1, segments=segments) - cylinder(inner, z0 - 1.0, z1 + 1.0, segments=segments)


def box(low: Vector, high: Vector) -> Manifold:
    """Return a box between two corners."""
    size = tuple(float(b - a) for a, b in zip(low, high, strict=True))
    return Manifold.cube((size[0], size[1], size[2])).translate((low[0], low[1], low[2]))


def plate(length: float, width: float, z0: float, z1: float, *, radius: float = 0.0, segments: int = 16) -> Manifold:
    """Return a plate centred about z, its upright edges rounded."""
    section = CrossSection.square((length - 2.0 * radius, width - 2.0 * radius), True)
    if radius > 0.0:
        section = section.offset(radius, JoinType.Round, circular_segments=segments)
    return Manifold.extrude(section, z1 - z0).translate((0.0, 0.0, z0))


def prism(outline: Sequence[Sequence[float]], z0: float, z1: float) -> Manifold:
    """Return the prism over a polygon (counter-clockwise points x, y) from z0 to z1."""
    return Manifold.extrude(CrossSection([np.array(outline, dtype=np.float64)]), z1 - z0).translate((0.0, 0.0, z0))


def hexagon(across_flats: float, z0: float, z1: float) -> Manifold:
    """Return a hexagonal prism about z."""
    return cylinder(across_flats / math.cos(math.pi / 6.0), z0, z1, segments=6)


def sphere(diameter: float, *, segments: int = SEGMENTS) -> Manifold:
    """Return a ball about the origin."""
    return Manifold.sphere(diameter / 2.0, segments)


def revolve(outline: Sequence[Sequence[float]], *, segments: int = SEGMENTS) -> Manifold:
    """Return the solid of revolution about z of a polygon of points (radius, z)."""
    return Manifold.revolve(CrossSection([np.array(outline, dtype=np.float64)]), segments)


def union(solids: Iterable[Manifold]) -> Manifold:
    """Return the union of solids."""
    return Manifold.batch_boolean(list(solids), OpType.Add)


def bolt(size: float, length: float, *, head: str = "cap", shank: float | None = None, segments: int = 12) -> Manifold:
    """Return a bolt along z: underside of the head at z = 0, shank down to ``-length``.

    ``head``: cap, hex, countersunk (its top at z = 0) or none. ``shank``: another diameter than the nominal one.
    """
    cap, flats, height, _, _ = METRIC[size]
    body = cylinder(size if shank is None else shank, -length, 0.0, segments=segments)
    if head == "cap":
        return body + cylinder(cap, 0.0, height, segments=16) - hexagon(0.5 * cap, 0.5 * height, height + 1.0)
    if head == "hex":
        return body + hexagon(flats, 0.0, 0.7 * size)
    if head == "countersunk":
        return body + cylinder(size, -0.5 * size, 0.0, segments=segments, top=2.0 * size)
    return body


def bolt_room(size: float, length: float, *, clearance: float, head: str = "cap", segments: int = 12) -> Manifold:
    """Return what a bolt needs: its hole, wider by the clearance, from above its end upwards, and room for the head."""
    cap, flats, _, _, _ = METRIC[size]
    hole = cylinder(size + clearance, -length, 0.0, segments=segments)
    if head == "countersunk":
        return hole + cylinder(size + clearance, -0.5 * size, 0.0, segments=segments, top=2.0 * size + clearance)
    wide = cap if head == "cap" else flats / math.cos(math.pi / 6.0)
    return hole + cylinder(1.15 * wide, 0.0, 40.0 * size, segments=16)


def nut(size: float, *, clearance: float = 0.0, segments: int = 12) -> Manifold:
    """Return a nut on z from 0 upwards, bored to the nominal size plus the clearance."""
    _, flats, _, height, _ = METRIC[size]
    return hexagon(flats, 0.0, height) - cylinder(size + clearance, -1.0, height + 1.0, segments=segments)


def clip(outer: float, bore: float, z0: float, z1: float, *, segments: int = SEGMENTS) -> Manifold:
    """Return a horseshoe clip about z: a ring open towards +x by its whole bore, so that it slides into a groove."""
    ring = tube(outer, bore, z0, z1, segments=segments)
    ring -= box((0.0, -bore / 2.0, z0 - 1.0), (outer, bore / 2.0, z1 + 1.0))
    return ring - box((0.35 * outer, -outer, z0 - 1.0), (outer, outer, z1 + 1.0))


def place(solid: Manifold, origin: Vector, axis: Vector = (0.0, 0.0, 1.0), *, spin: float = 0.0) -> Manifold:
    """Return a solid drawn along z with its z axis along ``axis`` and its origin at ``origin``.

    ``spin`` turns it about its own axis first [degrees]. Axes along ±x, ±y, ±z are exact.
    """
    x, y, z = np.asarray(axis, float) / np.linalg.norm(axis)
    polar = 0.0 if z == 1.0 else 180.0 if z == -1.0 else math.degrees(math.acos(z))
    azimuth = math.degrees(math.atan2(y, x))
    polar, azimuth = round(polar, 9), round(azimuth, 9)
    return (
        solid.rotate((0.0, 0.0, spin))
        .rotate((0.0, polar, 0.0))
        .rotate((0.0, 0.0, azimuth))
        .translate((origin[0], origin[1], origin[2]))
    )


def on_circle(count: int, diameter: float, *, phase: float = 0.0) -> list[tuple[float, float]]:
    """Return points on a circle about the origin; the phase in degrees."""
    angles = [math.radians(phase + 360.0 * k / count) for k in range(count)]
    return [(diameter / 2.0 * math.cos(a), diameter / 2.0 * math.sin(a)) for a in angles]


def corners(length: float, width: float, inset: float) -> list[tuple[float, float]]:
    """Return the four corners of a centred rectangle, moved inwards."""
    x, y = length / 2.0 - inset, width / 2.0 - inset
    return [(x, y), (-x, y), (-x, -y), (x, -y)]


def spur_gear(teeth: int, module: float, bore: float, z0: float, z1: float, *, phase: float = 0.0) -> Manifold:
    """Return a spur gear about z with trapezoidal teeth, slightly thinner than the gaps; the phase in degrees.

    Two gears mesh at the distance of half the sum of their pitch diameters (``teeth · module``), one phase 0, the
    other half a tooth on.
    """
    pitch, root, tip = teeth * module / 2.0, (teeth - 2.4) * module / 2.0, (teeth + 1.8) * module / 2.0
    half = math.pi / (2.0 * teeth) * 0.92
    outline: list[tuple[float, float]] = []
    for k in range(teeth):
        middle = math.radians(phase) + 2.0 * math.pi * k / teeth
        for radius, angle in ((root, -1.45 * half), (pitch, -half), (tip, -0.5 * half)):
            outline.append((radius * math.cos(middle + angle), radius * math.sin(middle + angle)))
        for radius, angle in ((tip, 0.5 * half), (pitch, half), (root, 1.45 * half)):
            outline.append((radius * math.cos(middle + angle), radius * math.sin(middle + angle)))
    gear = prism(outline, z0, z1)
    return gear if bore <= 0.0 else gear - cylinder(bore, z0 - 1.0, z1 + 1.0)


def fasten(
    product: Product,
    names: Iterable[str],
    size: float,
    length: float,
    origin: Vector,
    axis: Vector,
    *,
    clearance: float = 0.0,
    head: str = "cap",
    reach: float = 40.0,
    part: str = "screw",
) -> str:
    """Drive a bolt into these parts and return its name: its shank runs from the origin against ``axis``.

    The hole is cut from the parts, and room for the head as far as ``reach`` above it.
    """
    _, flats, _, _, _ = METRIC[size]
    room = cylinder(size + clearance, -length, 0.0, segments=12)
    if head == "countersunk":
        room += cylinder(size + clearance, -0.5 * size, 0.0, segments=12, top=2.0 * size + clearance)
        room += cylinder(2.0 * size + clearance, 0.0, reach, segments=12)
    elif head != "none":
        wide = METRIC[size][0] if head == "cap" else flats / math.cos(math.pi / 6.0)
        room += cylinder(1.15 * wide, 0.0, reach, segments=16)
    product.cut(names, place(room, origin, axis))
    return product.add(part, place(bolt(size, length, head=head), origin, axis))


def peg(
    product: Product,
    names: Iterable[str],
    diameter: float,
    length: float,
    origin: Vector,
    axis: Vector,
    *,
    clearance: float = 0.0,
    reach: float = 0.0,
    part: str = "pin",
    segments: int = 12,
) -> str:
    """Drive a plain pin into these parts and return its name: it runs from the origin against ``axis``.

    The hole is cut from the parts, open as far as ``reach`` above the origin.
    """
    hole = cylinder(diameter + clearance, -length, reach, segments=segments)
    product.cut(names, place(hole, origin, axis))
    return product.add(part, place(cylinder(diameter, -length, 0.0, segments=segments), origin, axis))


def tidy(product: Product) -> Product:
    """Merge points that lie nearer than a ten-thousandth of a millimetre, where cuts left such; return the product."""
    for name, solid in product.solids.items():
        mesh = solid.to_mesh64()
        corners_of = np.asarray(mesh.vert_properties)[:, :3][np.asarray(mesh.tri_verts)]
        edges = corners_of - np.roll(corners_of, 1, axis=1)
        if len(edges) and (edges**2).sum(axis=2).min() < 1e-8:
            product.solids[name] = solid.as_original().simplify(1e-4)
    return product
