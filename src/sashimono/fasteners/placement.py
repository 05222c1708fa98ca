"""Where a fastener-like part sits: which parts are all around its axis, how tightly, and from where to where.

Other parts are cut at right angles to its axis. Where a part's section has a hole around the axis, the fastener goes
through it; where the axis is in its material, the CAD drew no hole, or a thread that overlaps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from manifold3d import Error, Manifold

from sashimono.assembly import Assembly
from sashimono.fasteners.profile import contains_origin, free_radius, signed_area
from sashimono.geometry.features.directions import frame_along
from sashimono.geometry.mesh.solid import to_manifold


@dataclass(frozen=True, kw_only=True)
class PlacementConfig:
    """How parts about an axis are looked for."""

    sections: int = 24
    """Cuts along a shank."""
    reach: float = 1.35
    """Widest hole that still counts as being around a shank, over the shank's radius."""
    tight: float = 1.03
    """Widest hole that holds a shank by itself: it is screwed or pushed in."""


@dataclass(frozen=True, kw_only=True)
class Around:
    """A part around a stretch of an axis."""

    part: int
    low: float
    """Where it begins along the axis [m]."""
    high: float
    """Where it ends."""
    share: float
    """Share of the stretch looked at along which it is around the axis."""
    fit: float
    """Radius of its hole over that of the shank, the median; 0 where the axis is in its material."""

    @property
    def middle(self) -> float:
        """Middle of its stretch [m]."""
        return 0.5 * (self.low + self.high)


class Solids:
    """The parts of an assembly as exact solids in the world, made when first asked for."""

    def __init__(self, assembly: Assembly) -> None:
        self.assembly = assembly
        self.boxes = np.array([part.bounds_world for part in assembly.parts])
        self._solids: dict[int, Manifold | None] = {}

    def solid(self, part: int) -> Manifold | None:
        """Return a part's solid in the world frame [m]; None if its surface bounds none."""
        if part not in self._solids:
            own = self.assembly.parts[part]
            solid = to_manifold(own.vertices_world, own.faces)
            self._solids[part] = solid if solid.status() == Error.NoError else None
        return self._solids[part]

    def near(self, part: int, margin: float) -> list[int]:
        """Return the other parts whose boxes come within a margin [m] of a part's box."""
        low, high = self.boxes[part, 0] - margin, self.boxes[part, 1] + margin
        close = (self.boxes[:, 0] <= high).all(axis=1) & (self.boxes[:, 1] >= low).all(axis=1)
        return [int(k) for k in np.flatnonzero(close) if k != part]

    def sections(
        self, part: int, axis: Float[np.ndarray, "3"], point: Float[np.ndarray, "3"], heights: Sequence[float]
    ) -> list[list[Float[np.ndarray, "_ 2"]]]:
        """Return a part's sections at heights along an axis, their polygons given about the axis."""
        solid = self.solid(part)
        if solid is None:
            return [[] for _ in heights]
        frame = frame_along(axis)
        turned = solid.transform(np.column_stack([frame, -frame @ point]))
        return [turned.slice(float(h)).to_polygons() for h in heights]


def parts_around(
    solids: Solids,
    part: int,
    axis: Float[np.ndarray, "3"],
    point: Float[np.ndarray, "3"],
    low: float,
    high: float,
    radius: float,
    *,
    config: PlacementConfig,
) -> list[Around]:
    """Return the parts that are all around a part's axis between two heights, within reach of a radius [m].

    By their middle along the axis.
    """
    heights = low + (np.arange(config.sections) + 0.5) / config.sections * (high - low)
    step = (high - low) / config.sections
    found = []
    for other in solids.near(part, 0.0):
        fits = []
        for height, polygons in zip(heights, solids.sections(other, axis, point, list(heights)), strict=True):
            fit = _fit(polygons, radius)
            if fit is not None and fit <= config.reach:
                fits.append((height, fit))
        if fits:
            at = [height for height, _ in fits]
            found.append(
                Around(
                    part=other,
                    low=min(at) - 0.5 * step,
                    high=max(at) + 0.5 * step,
                    share=len(fits) / config.sections,
                    fit=float(np.median([fit for _, fit in fits])),
                )
            )
    return sorted(found, key=lambda entry: entry.middle)


def touches_ring(
    solids: Solids,
    other: int,
    axis: Float[np.ndarray, "3"],
    point: Float[np.ndarray, "3"],
    height: float,
    inner: float,
    outer: float,
) -> bool:
    """Return whether a part has material in a ring about an axis at a height, between two radii [m]."""
    (polygons,) = solids.sections(other, axis, point, [height])
    if not polygons:
        return False
    angles = 2.0 * np.pi * np.arange(12) / 12.0
    radius = 0.5 * (inner + outer)
    ways = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return any(contains_origin([p - way for p in polygons]) for way in ways)


def _fit(polygons: Sequence[Float[np.ndarray, "_ 2"]], radius: float) -> float | None:
    """The radius of the hole around the axis over a radius, 0 in material; None where there is no closed hole."""
    around = [polygon for polygon in polygons if contains_origin([polygon])]
    if len(around) % 2 == 1:
        return 0.0
    hole = next((polygon for polygon in around if signed_area(polygon) < 0.0), None)
    return None if hole is None else free_radius([hole])[0] / radius
