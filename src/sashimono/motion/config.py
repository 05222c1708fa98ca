"""Options of level 2. Lengths are fractions of a part's *size*, see `Body.size`; budgets count work."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class RestingConfig:
    """How a resting pose is chosen among the stable ones."""

    min_tipping_angle: float = 0.17
    """A pose that withstands this tilt of the table [rad] is stable enough; the least turned of these is taken."""
    coplanar_angle: float = 1e-3
    """Neighbouring hull triangles whose normals differ by less are one face [rad]."""
    touching_height: float = 0.0025
    """A corner of a face this far above the table, over the part's smallest extent, touches it. Where the part does not
    stand on the corners that touch, the face is several: thin plates are bent by less than `coplanar_angle`."""


@dataclass(frozen=True, kw_only=True)
class TableConfig:
    """Which way is up: the candidate normal with the highest score."""

    up: tuple[float, float, float] | None = None
    """The normal, where the user gives one; else the best candidate."""
    above_weight: float = 0.5
    """Score of insertions straight from above (from below: minus this), averaged over the parts."""
    standing_bonus: float = 0.5
    """Score of a base part that stands stably."""
    upright_bonus: float = 0.25
    """Score of the file's own +z."""
    level_angle: float = 0.1
    """A face this near to level [rad] still counts as standing: chair legs are not cut to a world axis."""


@dataclass(frozen=True, kw_only=True)
class TrayConfig:
    """How the resting parts are laid out beside the assembly."""

    gap: float = 0.3
    """Free border around each resting part."""
    work_margin: float = 0.15
    """Free border of the work area, as a fraction of its longer side."""
    aspect: float = 1.6
    """Width of the tray over its depth, where the work area is not wider."""


@dataclass(frozen=True, kw_only=True)
class RRTConfig:
    """RRT-Connect (Kuffner and LaValle, 2000)."""

    max_iterations: int = 400
    """Samples drawn before giving up."""
    max_nodes: int = 4000
    """Nodes of both trees together before giving up."""
    step: float = 1.0
    """Longest extension, in radii of the part (rotation weighed by the radius)."""
    uniform_rotation: float = 0.3
    """Share of samples with a uniform rotation; the others turn part of the way from start to goal."""


@dataclass(frozen=True, kw_only=True)
class SmoothingConfig:
    """Shortcut smoothing (Geraerts and Overmars, 2007)."""

    iterations: int = 24
    """Random shortcuts tried."""
    min_gain: float = 0.01
    """A shortcut is taken if it saves at least this share of the path's length."""


@dataclass(frozen=True, kw_only=True)
class SpeedLimits:
    """How fast a part may go."""

    speed: float
    """Of the part's centre [m/s]."""
    acceleration: float
    """[m/s²]"""
    turn_speed: float
    """[rad/s]"""
    turn_acceleration: float
    """[rad/s²]"""


@dataclass(frozen=True, kw_only=True)
class TrajectoryConfig:
    """How a path is timed. The defaults are within what every industrial arm does beside people (ISO 10218-1: 250
    mm/s); set them to those of your robot."""

    transit: SpeedLimits = field(
        default_factory=lambda: SpeedLimits(speed=0.25, acceleration=1.0, turn_speed=1.5, turn_acceleration=6.0)
    )
    insertion: SpeedLimits = field(
        default_factory=lambda: SpeedLimits(speed=0.05, acceleration=0.25, turn_speed=1.5, turn_acceleration=6.0)
    )
    deviation: float = 0.005
    """How far a corner may be rounded, in radii of the part: sets the speed at it."""
    corner: float = 0.17
    """A change of direction beyond this counts as one [rad]."""


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """Options of level 2."""

    insertion: Literal["removal", "rrt"] = "removal"
    """``removal``: transit, then the removal reversed. ``rrt``: RRT-Connect from resting to assembled pose, as the
    paper has it; a baseline that fails on tight fits."""
    clearance: float = 0.05
    """Gap kept from everything in transit."""
    min_clearance: float = 0.005
    """Gap kept in transit where `clearance` finds no way."""
    preinsertion_margin: float = 0.15
    """Gap to the fixed parts in the pre-insertion pose, and from an insertion below the base to the table."""
    lift: float = 0.25
    """Height of the straight lift that begins each motion."""
    max_edge_checks: int = 400
    """Poses looked at before a motion between two poses counts as blocked."""
    max_turn: float = 2.8
    """Largest rotation between two poses [rad]: near π a geodesic's sense of rotation hangs on the last digit."""
    penetration_tolerance: float = 0.02
    """``insertion="rrt"``: depth beyond the pair's overlap when assembled, over the smaller part's smallest extent."""
    max_displacement: float = 0.02
    """``insertion="rrt"``: largest point displacement between two checked poses, in radii of the part."""
    table: TableConfig = field(default_factory=TableConfig)
    resting: RestingConfig = field(default_factory=RestingConfig)
    tray: TrayConfig = field(default_factory=TrayConfig)
    rrt: RRTConfig = field(default_factory=RRTConfig)
    smoothing: SmoothingConfig = field(default_factory=SmoothingConfig)
    trajectory: TrajectoryConfig = field(default_factory=TrajectoryConfig)
