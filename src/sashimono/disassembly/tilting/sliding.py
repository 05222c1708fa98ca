"""Sliding: how far a part follows a wanted motion along the contact surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.tilting.contact_surface import ContactSurface, Gaps, admissible

Wanted = Callable[[Float[np.ndarray, "4 4"]], Float[np.ndarray, "6"]]
"""Given the displacement, the rest of the motion (v, R ω) that is wanted [m]."""


@dataclass(frozen=True, kw_only=True)
class SlideConfig:
    """Steps of one slide; lengths over the moving part's radius."""

    step: float = 0.15
    """Longest stretch between two looks at the contacts."""
    free_step: float = 0.4
    """The same where nothing is near."""
    least_step: float = 0.01
    """A shorter stretch that meets something ends the slide."""
    max_steps: int = 30
    """Stretches of one slide."""
    least_gain: float = 0.15
    """Share of the wanted motion that a stretch must bring, or the part rests."""
    rounds: int = 60
    """Rounds of the projection."""
    retractions: int = 2
    """Times a part that ended too deep is pushed back to the contact surface."""


def gaps_at(surface: ContactSurface, D: Float[np.ndarray, "4 4"], *, config: SlideConfig) -> Gaps:
    """Return what is near the part where a slide begins."""
    return surface.gaps(D, margin=1.5 * config.step * surface.paths.body.radius)


def slide(
    surface: ContactSurface, D: Float[np.ndarray, "4 4"], near: Gaps, wanted: Wanted, *, config: SlideConfig
) -> list[Float[np.ndarray, "4 4"]]:
    """Return the displacements passed from D on, without D, joined by geodesics that the probes clear; empty at rest.

    Each stretch goes along the motion nearest to the wanted one that closes no gap, and is retracted to the contact
    surface where the curvature led it in. ``near`` are the gaps at D (`gaps_at`).
    """
    radius = surface.paths.body.radius
    step, least = config.step * radius, config.least_step * radius
    passed: list[np.ndarray] = []
    for _ in range(config.max_steps):
        rest = wanted(D)
        length = float(np.linalg.norm(rest))
        if length < 0.5 * least:
            break
        ahead = rest * min(1.0, step / length)
        motion = admissible(near, ahead, rounds=config.rounds)
        if float(motion @ ahead) < config.least_gain * float(ahead @ ahead):
            break
        motion *= min(1.0, step / max(float(np.linalg.norm(motion)), 1e-12))
        reached = surface.moved(D, motion)
        around = surface.gaps(reached, margin=1.5 * step)
        for _ in range(config.retractions):
            if around.gaps.min(initial=0.0) >= 0.0:
                break
            reached = surface.moved(reached, admissible(around, np.zeros(6), rounds=config.rounds))
            around = surface.gaps(reached, margin=1.5 * step)
        gained = surface.motion_to(D, reached)
        if float(gained @ ahead) < config.least_gain * float(ahead @ ahead):
            is_clear = False
        else:
            is_clear = surface.is_clear(D, reached)
        if not is_clear:
            step *= 0.4
            if step < least:
                break
            continue
        D, near = reached, around
        passed.append(D)
        step = min(1.5 * step, (config.step if len(near.gaps) else config.free_step) * radius)
    return passed
