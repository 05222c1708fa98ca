"""Options of support and gravity. Budgets count work."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class StabilityConfig:
    """When parts count as touching, as fastened, and as standing by themselves."""

    friction: float = 0.3
    """Coulomb friction coefficient μ between parts, and between parts and the table."""
    gap: float = 0.03
    """Gap up to which two parts count as touching, over the smaller one's smallest extent: parts settle in their
    clearances."""
    table_gap: float = 0.01
    """Height up to which a point counts as standing on the table, over the part's smallest extent."""
    facing: float = 0.7
    """Least cosine between one surface's normal and the other's, reversed, at a touching point."""
    max_points: int = 12
    """Touching points kept of each pair, spread as widely as possible."""
    fastened: float = 0.02
    """Depth above which a pair that overlaps as assembled counts as fastened, over the smaller part's smallest
    extent: a thread drawn as plain cylinders, an interference fit. Less is what facets of round fits overlap."""
    close_fits: bool = True
    """Whether a part that is all around another's shank, drawn without clearance, counts as joined to it."""
    fit_gap: float = 0.002
    """Clearance that counts as none there, over the smaller one's smallest extent."""
    fit_length: float = 0.26
    """Least length of such a fit, over its diameter."""
    steep: float = 0.5
    """Walls whose normal is this near to level (sine of its angle to the level) carry no weight by friction: nothing
    shows that they squeeze the part."""
    upright: float = 0.02
    """Walls whose normal is this near to level (sine of its angle) count as upright: real tapers are steeper, the
    rounding of corners is less."""
    opposing: float = 0.9
    """Least cosine between one normal and another, reversed, at which two fastened parts clamp what is between."""
    least_weight: float = 1e-4
    """Weight that every part has at least, over the heaviest: what keeps the linear programs well scaled."""
    tolerance: float = 0.01
    """Imbalance that is accepted, over a part's weight and, for torques, its radius."""
    max_programs: int = 40
    """Linear programs for one connected set of parts; when they are spent, the held parts are few, not the fewest."""
