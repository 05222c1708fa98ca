"""Assemblies in which two or three groups must move at once, each in a direction of its own, and blocked twins.

Truth by construction. Sliders lie on a base, each with a dovetail in a groove of its own, so that it moves along the
groove and no other way. Neighbours are joined by a dovetail along the difference of their directions, so that neither
moves unless the other one does, at the one speed that fits. No part leaves alone, nor any set as one body: the
directions of the grooves differ. In the blocked twin, walls of the base stand two millimetres beside a slider, at both
of its ends. Drawn in millimetres, built by manifold3d, in metres once built.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import manifold3d
import numpy as np
from tilt_set import part_of

from sashimono.assembly import Assembly

Manifold = manifold3d.Manifold
UP = np.array([0.0, 0.0, 1.0])
REACH = 400.0
"""Length of what goes on beyond everything [mm]."""


@dataclass(frozen=True, kw_only=True)
class GroupCase:
    """An assembly of the set."""

    name: str
    movers: tuple[str, ...]
    """Parts that move together; any other leaves alone, or comes apart from its like once they are gone."""
    build: Callable[[bool], dict[str, Manifold]]
    """Given whether the way is open, returns the solids by name."""
    at_once: bool = True
    """Whether the movers move in different ways at the same time; else as one body, along several legs."""

    def assembly(self, *, is_open: bool) -> Assembly:
        """Return the assembly, or its twin with the way blocked."""
        return Assembly(parts=tuple(part_of(name, solid) for name, solid in self.build(is_open).items()))


def prism(profile: list[tuple[float, float]], across: np.ndarray, out: np.ndarray, at: np.ndarray, length: float):
    """A profile, drawn (across, out), drawn out to both sides of a point along the third axis."""
    along = np.cross(across, out)
    T = np.column_stack([across, out, along, at - 0.5 * length * along])
    return manifold3d.CrossSection([np.array(profile)]).extrude(length).transform(T)


def dovetail(along: np.ndarray, out: np.ndarray, at: np.ndarray, length: float, width: float = 6.0, depth: float = 4.0):
    """A rail that grows wider on its way out of a face, from a point of it; a millimetre of it is behind the face."""
    neck = 0.25 * width
    profile = [(-neck, -1.0), (neck, -1.0), (neck, 0.0), (0.5 * width, depth), (-0.5 * width, depth), (-neck, 0.0)]
    return prism(profile, np.cross(out, along), out, at, length)


def swept(solid: Manifold, start: np.ndarray, stop: np.ndarray) -> Manifold:
    """What a convex solid sweeps from one displacement to another."""
    return manifold3d.Manifold.batch_hull([solid.translate(tuple(start)), solid.translate(tuple(stop))])


def sliders(
    angle: float, is_open: bool, *, third: bool = False, lid: bool = False, key: bool = False, clearance: float = 0.0
) -> dict[str, Manifold]:
    """Two sliders whose grooves enclose an angle [degrees].

    A third one lies beyond the second and moves as the first does. A lid over all leaves first. A key fills a pocket of
    the first slider that the second one closes: it moves with the first, and comes out afterwards.
    """
    ways = [np.array([1.0, 0.0, 0.0]), np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle)), 0.0])]
    between = ways[0] - ways[1]
    between /= np.linalg.norm(between)
    across = np.cross(UP, between)  # from the first to the second
    if across @ ways[0] < 0.0:
        across = -across
    base = Manifold.cube((240.0, 240.0, 12.0), center=True).translate((0.0, 0.0, -6.0))
    ways = [*ways, ways[0]][: 3 if third else 2]
    middles = [(30.0 * k - 15.0) * across for k in range(len(ways))]
    out: dict[str, Manifold] = {}
    blocks = []
    for k, (way, middle) in enumerate(zip(ways, middles, strict=True)):
        low, high = -15.0 + 0.5 * clearance * (k > 0), 15.0 - 0.5 * clearance * (k + 1 < len(ways))
        square = [(-20.0, low), (20.0, low), (20.0, high), (-20.0, high)]
        blocks.append(prism(square, between, across, middle + 8.0 * UP, 16.0))
        out[f"slider_{k + 1}"] = blocks[k] + dovetail(way, -UP, middle, 16.0)
        base -= dovetail(way, -UP, middle, REACH, 6.0 + clearance, 4.0 + clearance)
    if not is_open:
        for side in (-1.0, 1.0):
            wall = swept(blocks[0], 2.0 * side * ways[0], 14.0 * side * ways[0])
            for block, way in zip(blocks, ways, strict=True):
                wall -= swept(block, -2.0 * way, 2.0 * way)
            base += wall.translate((0.0, 0.0, -1.0))
        base = max(base.decompose(), key=lambda piece: piece.volume())  # without slivers between two sliders
    for k in range(1, len(out)):
        face = (30.0 * k - 30.0) * across + 8.0 * UP
        first, second = f"slider_{k}", f"slider_{k + 1}"
        out[first] += dovetail(between, across, face - 0.5 * clearance * across, 24.0)
        out[second] -= dovetail(between, across, face - clearance * across, REACH, 6.0 + clearance, 4.0 + clearance)
    if lid:
        out["lid"] = Manifold.cube((70.0, 70.0, 4.0), center=True).translate((0.0, 0.0, 18.0))
    if key:
        pocket, out["key"] = (
            prism([(7.0, -4.0), (13.0, -4.0), (13.0, stop), (7.0, stop)], between, across, 13.5 * UP, 3.0)
            for stop in (1.0, 0.0)
        )
        out["slider_1"] -= pocket
    return {"base": base, **out}


def case(name: str, angle: float, *also: str, **options: Any) -> GroupCase:
    """A case; ``also`` names what moves besides the two sliders."""
    return GroupCase(
        name=name,
        movers=("slider_1", "slider_2", *also),
        build=lambda is_open: sliders(angle, is_open, **options),
    )


CASES = (
    *(case(f"two_{angle}", float(angle)) for angle in (60, 75, 90, 105, 120)),
    *(case(f"two_{angle}_loose", float(angle), clearance=0.1) for angle in (70, 90, 110)),
    *(case(f"two_{angle}_lid", float(angle), lid=True) for angle in (80, 100)),
    *(case(f"two_{angle}_key", float(angle), "key", key=True) for angle in (90, 110)),
    *(case(f"three_{angle}", float(angle), "slider_3", third=True) for angle in (75, 90, 105)),
    case("three_90_key_lid", 90.0, "slider_3", "key", third=True, key=True, lid=True),
)
