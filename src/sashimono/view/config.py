"""Options of the viewer files."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class ViewConfig:
    """How a plan is shown. Nothing here changes the plan."""

    traverse_seconds: float = 1.6
    """Time a transit needs to cross the scene's bounding-box diagonal [s]; sets the speed at 1x."""
    insertion_slowdown: float = 2.5
    """How many times slower than a transit an insertion is played."""
    min_move_seconds: float = 0.8
    """Shortest time a step's motion takes [s]; shorter ones are stretched."""
    hold_seconds: float = 0.35
    """Pause before and after each motion, in which the part is gripped and let go [s]."""
    base_seconds: float = 0.8
    """Time the base part is shown before the first motion [s]."""
    crease_angle: float = 0.6
    """Faces that meet at more than this angle [rad] keep a sharp edge, which is drawn as a line."""
    max_faces: int = 500_000
    """Faces stored at most, identical shapes counted once; above it vertices are clustered, for display only."""
    explode_gap: float = 0.09
    """Gap between neighbours in the exploded view, relative to the assembly's bounding-box diagonal."""
    bench_gap: float = 0.06
    """Gap around the place where a subassembly is put together, relative to that diagonal."""
    max_deviation: float = 1e-4
    """GLB: largest distance between its linear keyframes and the plan's screw motions, relative to that diagonal."""
