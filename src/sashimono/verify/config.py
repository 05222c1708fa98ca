"""What the independent check tolerates and how hard it looks."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class VerifyConfig:
    """Options of :func:`sashimono.verify.verify_plan`; the defaults are the plan.json contract."""

    relative_tolerance: float = 0.02
    """Depth a pair may reach beyond its overlap in the assembled pose, over the smaller part's smallest extent."""
    relative_wall: float = 0.4
    """Most that this tolerance may be, over the thickness of either part's thin walls: shells never slip through."""
    relative_parted: float = 0.5
    """Depth, over that tolerance, at which a pair that overlaps in the assembled pose has parted: an overlap that
    wavers about the tolerance itself, as facets of a thread make it, has not ended."""
    relative_excuse: float = 0.1
    """Overlap in the assembled pose, over the smaller part's smallest extent, up to which it is an excuse all along, as
    for a press fit, if it is less than ``relative_wall`` too. A deeper one excuses what is no farther from it than it
    is large, than twice its depth, or this."""
    relative_fit: float = 0.15
    """Most that a declared fit may be deep, over the smaller part's smallest extent, where neither part is thin."""
    thin_fit: float = 0.15
    """A part is thin in itself if twice its volume over its surface, over its middle extent, is at most this ..."""
    hollow_fit: float = 0.65
    """... and its volume, over that of its convex hull, at most this."""
    give_thickness: float = 2.0
    """Most that a fit with such a part may be deep, over twice its volume over its surface, ..."""
    give_extent: float = 0.1
    """... and over its middle extent."""
    relative_through: float = 2.3
    """Thickness of a part, over how deep the other one is in it there, up to which, in both parts at once, one slips
    through the other: in the middle of a wall it is 2. No declared fit excuses that."""
    samples: int = 3000
    """Surface samples aimed at per part, besides its own vertices; they set the spacing between samples."""
    relative_resolution: float = 0.04
    """Travel between two looks at a vertex, over the pair tolerance, below which contact is not refined further."""
    max_queries: int = 6_000_000
    """Distance queries allowed for one pair in one step; a pair that needs more is refused, never passed."""
    boolean_poses: int = 3
    """Poses of each touching pair and step at which the exact intersection body is measured as well."""
    pose_tolerance: float = 1e-6
    """Largest deviation of a rotation from orthonormal, and of a pose from the assembled one over the part's size."""
    declared_tolerance: float = 1e-3
    """Largest deviation of a stretch that is declared to follow a thread from it in one turn, over the pitch."""
    resting_tolerance: float = 0.005
    """Height up to which a vertex counts as standing on the table, over the part's smallest extent."""
    contact_tolerance: float = 1e-4
    """Distance of a contact point from the surface, over the part's size."""
    normal_tolerance: float = 0.0873
    """Angle between a stated contact normal and the surface's [rad]: 5°."""
    tip_tolerance: float = 0.1
    """How far a fingertip may reach into anything, over its radius: its skin is soft."""
    max_tip_steps: int = 20_000
    """Distance steps allowed along one stretch of a fingertip's way; one that needs more is refused."""
    support_tolerance: float = 0.021
    """Gap up to which a placed part counts as supporting a pushed one, over the pushed part's smallest extent."""
    balance_tolerance: float = 1e-6
    """What a push may leave unbalanced, over the wrench it must add up to."""
    cone_tolerance: float = 1e-3
    """Angle by which a grasp line may leave a friction cone [rad], for rounding."""
    cone_edges: int = 8
    """Edges of the pyramid that stands for a friction cone in the force-closure check."""
    torsion_radius: float = 0.1
    """Soft finger: torsional friction over tangential friction, over the part's radius, when the plan states none."""
    hold_gap: float = 0.036
    """Gap up to which two parts count as touching where it is asked what stands, over the smaller one's smallest
    extent."""
    hold_table_gap: float = 0.012
    """The same for the table, over the part's smallest extent."""
    hold_friction: float = 0.31
    """Friction coefficient between placed parts: no less than the planner's, so that only what surely falls is said to.
    The next ones leave as much room."""
    hold_edges: int = 8
    """Edges of the pyramid that stands for a friction cone between placed parts."""
    hold_steep: float = 0.45
    """Walls whose normal is this near to level (sine of the angle) carry no weight by friction, unless clamped."""
    hold_upright: float = 0.01
    """Walls whose normal is this near to level (sine of the angle) are upright: they carry no weight as wedges."""
    hold_fastened: float = 0.016
    """Depth above which a pair that overlaps as assembled is fastened, over the smaller one's smallest extent."""
    hold_fit_gap: float = 0.0024
    """Clearance of a close fit, over the smaller one's smallest extent."""
    hold_points: int = 40
    """Most touching points taken of each pair."""
    hold_tolerance: float = 0.02
    """How fast a part may still fall, in the units of the linear program, in which 1 is free fall."""
