"""Assemblies in which a set must leave as one body along two or three legs, and blocked twins.

Truth by construction. A cartridge of two halves lies in a housing of two halves. The halves of the cartridge are joined
by square pegs along x, those of the housing by square pegs along y. At its sides the cartridge has upright T rails, one
of each half, in grooves of the housing. So no part moves alone, nor one half of the one with one half of the other: all
that can move is the whole cartridge, upwards. It rises until it stands above its grooves and below the roof, and leaves
through a window. In the blocked twin the window is too low. Drawn in millimetres, in metres once built.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import manifold3d
from simultaneous_set import GroupCase
from tilt_set import span

Manifold = manifold3d.Manifold
RISE = 14.0
"""How far the cartridge rises before it goes aside."""
FAR = 80.0
"""Beyond the housing."""


def cartridge() -> Manifold:
    """The cartridge in one piece, with its rails."""
    solid = span((-20.0, 20.0), (-10.0, 10.0), (0.0, 10.0))
    for side in (-1.0, 1.0):
        for half_width, out in ((2.0, 14.0), (5.0, 18.0)):
            y = sorted((side * (out - 4.5), side * out))
            solid += span((10.0 * side - half_width, 10.0 * side + half_width), (y[0], y[1]), (0.0, 10.0))
    return solid


def wider(solid: Manifold, clearance: float) -> Manifold:
    """The solid with half the clearance more on every side."""
    return solid.minkowski_sum(Manifold.cube([clearance] * 3, center=True)) if clearance else solid


def rise(clearance: float) -> Manifold:
    """What the cartridge needs on its way up, with so much room all around."""
    room = wider(cartridge(), clearance)
    for z in (5.0, 10.0, RISE):
        room += wider(cartridge(), clearance).translate((0.0, 0.0, z))
    return room


def halves_along(solid: Manifold, axis: int, pegs: Sequence[Manifold], clearance: float) -> tuple[Manifold, Manifold]:
    """The two sides of a solid; the pegs belong to the lower one."""
    normal = [0.0, 0.0, 0.0]
    normal[axis] = 1.0
    upper, lower = solid.split_by_plane(tuple(normal), 0.0)
    for peg in pegs:
        lower, upper = lower + peg, upper - wider(peg, clearance)
    return lower, upper


def cartridge_in_housing(
    is_open: bool, *, way: str, clearance: float = 0.0, slug: bool = False, lid: bool = False
) -> dict[str, Manifold]:
    """The solids by name.

    Args:
        is_open: Whether the window is high enough.
        way: Where the cartridge goes once it has risen: along x or y, or along x and then up a shaft ("xz").
        clearance: Between the cartridge and the housing, and pegs and holes.
        slug: Whether there is a slug in a pocket that both halves of the cartridge close.
        lid: Whether a lid lies on the housing; it leaves first.
    """
    top = 10.0 + RISE + 0.5 * clearance
    sill = RISE - 0.5 - 0.5 * clearance
    height = top if is_open else top - 4.0
    housing = span((-32.0, 32.0), (-26.0, 26.0), (-6.0, 40.0)) - rise(clearance)
    x, y = 20.0 + 0.5 * clearance, 18.0 + 0.5 * clearance
    ends = ((-x, x), (-y, FAR)) if way == "y" else ((-x, FAR), (-y, y))
    window = span(*ends, (sill, height))
    housing -= span((-x, x), (-y, y), (sill, top)) + window
    if way == "xz":
        shaft = span((40.0, 80.0 + 2.0 * clearance), (-y, y), (sill, 60.0))
        housing += span((32.0, 90.0), (-26.0, 26.0), (-6.0, 40.0)) - shaft - window
    posts = [
        span((px - 2.0, px + 2.0), (-1.0, 8.0), (pz - 1.5, pz + 1.5)) for px in (-28.0, 28.0) for pz in (-3.0, 34.0)
    ]
    out: dict[str, Manifold] = dict(zip(("front", "back"), halves_along(housing, 1, posts, clearance), strict=True))
    pegs = [span((-1.0, 8.0), (py - 2.0, py + 2.0), (3.0, 7.0)) for py in (-6.0, 6.0)]
    solid = cartridge()
    if slug:
        solid -= span((-4.0, 4.0), (-3.0, 3.0), (3.0, 7.0))
        out["slug"] = span((-4.0, 4.0), (-3.0, 3.0), (3.0, 7.0))
    out |= dict(zip(("left", "right"), halves_along(solid, 0, pegs, clearance), strict=True))
    if lid:
        out["lid"] = span((-20.0, 20.0), (-20.0, 20.0), (40.0, 44.0))
    return out


def case(name: str, *also: str, **options: Any) -> GroupCase:
    """A case; ``also`` names what is in the cartridge."""
    return GroupCase(
        name=name,
        movers=("left", "right", *also),
        build=lambda is_open: cartridge_in_housing(is_open, **options),
        at_once=False,
    )


CASES = (
    *(case(f"cartridge_{way}", way=way) for way in ("x", "y", "xz")),
    *(case(f"cartridge_{way}_loose", way=way, clearance=0.1) for way in ("x", "y", "xz")),
    *(case(f"cartridge_{way}_slug", "slug", way=way, slug=True) for way in ("x", "y", "xz")),
    case("cartridge_x_slug_loose_lid", "slug", way="x", slug=True, clearance=0.1, lid=True),
)
