"""Generated fasteners with known answers, and look-alikes; metres, along z, the head up."""

from __future__ import annotations

import manifold3d
import numpy as np
from solids import Manifold, box, rod

MM = 1e-3


def hexagon(flats: float, height: float, at: float = 0.0) -> Manifold:
    """A hexagonal prism along z from a height on."""
    return Manifold.cylinder(height, flats / np.sqrt(3.0), flats / np.sqrt(3.0), 6).translate((0.0, 0.0, at))


def cylinder(diameter: float, height: float, at: float = 0.0, segments: int = 32) -> Manifold:
    """A cylinder along z from a height on."""
    return Manifold.cylinder(height, diameter / 2, diameter / 2, segments).translate((0.0, 0.0, at))


def screw(d: float, length: float, drive: str, *, segments: int = 32) -> Manifold:
    """A screw whose head rests at z = 0, with a plain shank with a tip below."""
    tip = Manifold.cylinder(0.1 * d, 0.4 * d, 0.5 * d, segments).translate((0.0, 0.0, -length))
    shank = cylinder(d, length - 0.1 * d, -length + 0.1 * d, segments) + tip
    if drive == "hex":
        return shank + hexagon(1.65 * d, 0.65 * d)
    if drive == "countersunk":
        head = Manifold.cylinder(0.5 * d, d / 2, d, segments).translate((0.0, 0.0, -0.5 * d))
        return shank + head - slot(d, -0.25 * d)
    head = cylinder(1.6 * d, d, 0.0, segments)
    if drive == "hex socket":
        return shank + head - hexagon(0.8 * d, d, 0.5 * d)
    if drive == "slot":
        return shank + head - slot(2.0 * d, 0.6 * d)
    if drive == "cross":
        arm = box((0.9 * d, 0.2 * d, d), (0.0, 0.0, d))
        return shank + head - arm - arm.rotate((0.0, 0.0, 90.0))
    assert drive == "none"
    return shank + head


def slot(d: float, at: float) -> Manifold:
    """What is cut from a head for a screwdriver."""
    return box((3.0 * d, 0.15 * d, d), (0.0, 0.0, at + 0.5 * d))


def threaded(d: float, length: float, pitch: float) -> Manifold:
    """A shank with ridges from z = -length to 0."""
    circle = manifold3d.CrossSection.circle(0.45 * d, 32).translate((0.05 * d, 0.0))
    return circle.extrude(length, int(24 * length / pitch), 360.0 * length / pitch).translate((0.0, 0.0, -length))


def nut(d: float, flats: float, height: float, segments: int = 32) -> Manifold:
    """A nut with a plain hole from z = 0 up, its corners chamfered."""
    cone = Manifold.cylinder(height, 0.62 * flats, 0.62 * flats, 48)
    top = Manifold.cylinder(0.1 * flats, 0.5 * flats, 0.57 * flats, 48)
    chamfer = cone ^ (top + cylinder(1.14 * flats, height, 0.1 * flats, 48))
    return (hexagon(flats, height) ^ chamfer) - cylinder(d, 3.0 * height, -height, segments)


def ring(hole: float, outer: float, height: float, segments: int = 48) -> Manifold:
    """A flat ring or tube from z = 0 up."""
    return cylinder(outer, height, 0.0, segments) - cylinder(hole, 3.0 * height, -height, segments)


def circlip(inner: float, outer: float, height: float) -> Manifold:
    """A flat ring with a gap of 60 degrees."""
    wedge = np.array([(0.0, 0.0), (outer, -0.577 * outer), (outer, 0.577 * outer)])
    gap = manifold3d.CrossSection([wedge]).extrude(3.0 * height)
    return ring(inner, outer, height) - gap.translate((0.0, 0.0, -height))


def standoff(flats: float, length: float, hole: float, depth: float) -> Manifold:
    """A hexagonal bar with a hole in each end."""
    holes = cylinder(hole, 2.0 * depth, -depth) + cylinder(hole, 2.0 * depth, length - depth)
    return hexagon(flats, length) - holes


def plate(thickness: float, hole: float, at: float, width: float = 30 * MM) -> Manifold:
    """A square plate with a hole about z, from a height on."""
    return box((width, width, thickness), (0.0, 0.0, at + thickness / 2)) - rod(hole / 2, 1.0)
