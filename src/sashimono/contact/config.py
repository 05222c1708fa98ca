"""Options of level 3. Budgets count work; lengths are fractions of the part or of the gripper."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from sashimono.geometry.features.directions import DirectionConfig


@dataclass(frozen=True, kw_only=True)
class ContactConfig:
    """How a grasp is found, scored and checked."""

    friction: float = 0.2
    """Coulomb friction coefficient μ between finger pad and part."""
    friction_cone: Literal["coulomb", "printed"] = "coulomb"
    """``coulomb``: F₁² + F₂² ≤ μ² F₃², half angle atan(μ). ``printed``: F₁² + F₂² ≤ μ F₃², as in the paper, half
    angle atan(√μ)."""
    cone_edges: int = 8
    """Edges of the pyramid inscribed in each friction cone; at least 3. More come closer to the cone, from below."""
    samples: int = 384
    """Surface samples, half of them by area, half shared evenly among the main face directions, so that the narrow
    faces of a plate are not missed. Their centre lines come on top."""
    spread: float = 0.1
    """Two candidates whose contacts lie closer than this, in radii of the part, count as one."""
    max_candidates: int = 200
    """Candidates, best quality first, that are checked for collision before giving up."""
    report_candidates: int = 12
    """The same for each gripper of which it is only asked whether it can take the part."""
    approaches: int = 16
    """Directions tried, evenly spaced around the line between the contacts; even, so that each has its opposite."""
    retreat: float = 1.0
    """Straight way of the open gripper before pick-up and after release, in finger lengths."""
    contact_clearance: float = 0.01
    """A finger begins this far behind the contact plane for the check against other bodies, in finger thicknesses:
    two bodies flush with each other then do not count as hit."""
    insertion_step: float = 0.5
    """Largest displacement of any gripper point between two checked poses of an insertion, in finger thicknesses."""
    transit_step: float = 1.0
    """The same for the transit."""
    max_insertion_poses: int = 400
    """Most poses checked of the insertions of a step; a longer one is checked at larger, even steps."""
    max_transit_poses: int = 400
    """Most poses checked of the transits of a step."""
    tip_radius: float = 0.1
    """Radius of a fingertip over the part's middle extent."""
    largest_tip: float = 0.006
    """Largest radius of a fingertip [m]."""
    tip_scales: tuple[float, ...] = (1.0, 0.5, 0.25, 0.1)
    """Fingertips tried, over that radius, the next one where the one before finds nothing."""
    tip_patch: float = 0.3
    """Radius of a fingertip's contact patch, over the fingertip's."""
    tip_approach: float = 2.0
    """Way straight off the surface that must be clear before pick-up and after release, in radii of the fingertip."""
    tip_slack: float = 0.02
    """How far a fingertip may reach into what it passes, over its radius: less than its soft skin yields."""
    tip_samples: int = 96
    """Surface samples for fingertips; centre lines come on top."""
    shortlist: int = 3
    """Clear grasps whose quality is worked out exactly."""
    push_points: int = 48
    """Surface points tried for a push."""
    density: float = 1000.0
    """Density of the parts [kg/m³], from which their weight follows."""
    drive: float = 2.0
    """Resistance that a push must overcome along the way, in weights of the part."""
    support_gap: float = 0.02
    """Gap up to which a placed part counts as touching, over the moving part's smallest extent."""
    max_supports: int = 8
    """Touching points of placed parts that can react, spread as widely as possible."""
    directions: DirectionConfig = field(default_factory=DirectionConfig)
    """How the main directions of a part are found: sources of samples and of approach directions."""

    @property
    def tangential_friction(self) -> float:
        """Tangent of the friction cone's half angle: μ, or √μ as printed."""
        return self.friction if self.friction_cone == "coulomb" else math.sqrt(self.friction)
