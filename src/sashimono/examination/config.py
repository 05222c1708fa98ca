"""When something is worth saying."""

from __future__ import annotations

from dataclasses import dataclass, field

from sashimono.bodies import SampleConfig
from sashimono.fasteners.recognise import FastenerConfig
from sashimono.geometry.features.tube import TubeConfig
from sashimono.io.raw import ReadConfig


@dataclass(frozen=True, kw_only=True)
class DoctorConfig:
    """Bounds of the examination. Lengths are relative to the smallest extent of the smaller part, unless said."""

    reading: ReadConfig = field(default_factory=ReadConfig)
    fasteners: FastenerConfig = field(default_factory=FastenerConfig)
    samples: SampleConfig = field(default_factory=lambda: SampleConfig(area_samples=600, max_vertices=1500))
    touching: float = 0.03
    """Two parts touch up to this gap; the same holds for support in a plan."""
    tiny: float = 0.02
    """A clearance below this is tiny: the check of a plan allows as much penetration."""
    least_clearance: float = 2e-4
    """Smaller gaps count as contact."""
    clearance_share: float = 0.05
    """Share of a part's surface samples that face the other across such a gap, at least."""
    facing: float = 0.9
    """Least cosine between one surface's normal and the opposite of the other's."""
    same: float = 0.98
    """Two parts are one and the same in one place if this share of both volumes is common."""
    swallowed: float = 0.98
    """A part lies wholly in another's material if this share of its volume does."""
    rounding: float = 0.01
    """Overlaps that are less deep are faces drawn a hair into one another."""
    round_fit: TubeConfig = field(default_factory=lambda: TubeConfig(depth=(1e-4, 0.15), least_share=0.7))
    """Overlaps that are thin tubes: round fits with interference, and threads drawn as plain cylinders."""
    thread: float = 0.04
    """Tubes at least as thick as this, over their diameter, are threads."""
    facets: float = 0.006
    """Round fits that overlap by less than this, over their diameter, may be facets of two equal cylinders."""
    measured_overlaps: int = 200
    """Depths are measured of so many pairs, the worst first."""
    depth_points: int = 1500
    """Points looked at for the depth of one overlap."""
    rays: int = 64
    """Directions in which a part is looked at, from points all over its surface."""
    seen_from: tuple[int, ...] = (4, 32)
    """Points of a part's surface from which rays are cast; more if none of the fewer is seen."""
    large_mesh: int = 200_000
    """Triangles of one part from which on planning is slow."""
    metric_share: float = 0.8
    """Share of the screws that have metric sizes in another unit, for the unit to be doubted."""
