"""The physics stage: breadth first over the rest poses to which pushes bring a part, until one takes it out.

Pushes are forces along the part's inertia axes and torques about them (as in Algorithm 1 of the paper), and the
screws that its contacts leave free (slippage): those take it out of threads and bayonets. Each motion found has
passed the exact check. That none was found is never a proof.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.physics.push import SimulateConfig, simulate
from sashimono.disassembly.physics.slippage import free_twists
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3


@dataclass(frozen=True, kw_only=True)
class PhysicsConfig:
    """Pushes and budget of the search; it counts work, never time."""

    simulate: SimulateConfig = field(default_factory=SimulateConfig)
    axes: Literal["inertia", "world"] = "inertia"
    """Axes along which forces and torques act."""
    slippage_pushes: bool = True
    """Whether the screws that the contacts leave free are followed too."""
    max_pushes: int = 80
    """Pushes simulated for one part."""
    max_stretches: int = 24
    """Stretches followed for one part over all pushes, but for those that follow a known screw unhindered."""
    max_traced: int = 40_000_000
    """Tracing steps (`Paths.traced`) for one part; looked at after each push."""
    novelty: float = 0.05
    """A rest pose nearer than this share of the part's smallest extent to a known one is not new."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PhysicsResult:
    """A removal by pushes, or why there is none."""

    removal: Removal | None
    blocked_by: tuple[int, ...] = ()
    """Parts met, where there is no removal."""
    reason: str = ""
    pushes: int = 0
    """Pushes simulated."""
    traced: int = 0
    """Tracing steps taken."""


def search_physics(parts: PlacedParts, part: int, others: Sequence[int], *, config: PhysicsConfig) -> PhysicsResult:
    """Return a removal of the part past the others by simulated pushes from rest pose to rest pose."""
    paths = Paths(parts, part, others, tolerance=parts.tolerances.turning)
    start = np.eye(4)[None]
    queue = deque([start])
    known = [np.eye(4)]
    met: set[int] = set()
    pushes = stretches = 0
    spent = config.max_traced <= 0
    while queue and pushes < config.max_pushes and stretches < config.max_stretches and not spent:
        before = queue.popleft()
        for push in pushes_at(paths, before[-1], config=config)[: config.max_pushes - pushes]:
            if spent := paths.traced >= config.max_traced:
                break
            left = min(config.simulate.max_stretches, config.max_stretches - stretches)
            outcome = simulate(paths, before[-1], push, config=replace(config.simulate, max_stretches=left))
            pushes += 1
            stretches += outcome.stretches
            if outcome.exit_direction is not None:
                removal = outcome.removal(before)
                if paths.parts_once(removal.displacements):
                    return PhysicsResult(removal=removal, pushes=pushes, traced=paths.traced)
                continue
            met.update(outcome.met)
            rest = outcome.displacements[-1]
            if all(paths.distance(rest, other) > config.novelty * paths.size for other in known):
                known.append(rest)
                queue.append(np.concatenate([before[:-1], outcome.displacements]))
    if spent:
        reason = f"physics ran out of its budget of {config.max_traced} tracing steps"
    elif queue or stretches >= config.max_stretches:
        reason = f"physics ran out of its budget of {config.max_pushes} pushes and {config.max_stretches} stretches"
    else:
        reason = f"no push leads to a new rest pose after {pushes} pushes"
    blocked_by = tuple(sorted(met))
    return PhysicsResult(removal=None, blocked_by=blocked_by, reason=reason, pushes=pushes, traced=paths.traced)


def pushes_at(paths: Paths, D: Float[np.ndarray, "4 4"], *, config: PhysicsConfig) -> list[Float[np.ndarray, "6"]]:
    """Return the pushes to try at a rest pose: unit wrenches (force, torque over radius) about the part's centre."""
    pushes = []
    if config.slippage_pushes:
        center = se3.apply(D, paths.center[None])[0]
        for twist in free_twists(paths, D, config=config.simulate.slippage):
            push = np.concatenate([(twist[:3] + se3.cross(twist[3:], center)) / paths.body.radius, twist[3:]])
            pushes.append(push / np.linalg.norm(push))
    axes = np.eye(3)
    if config.axes == "inertia":
        axes = (D @ paths.T_assembled)[:3, :3] @ paths.body.mass_properties.axes
    for kind in range(2):
        for axis in axes.T:
            for sign in (1.0, -1.0):
                push = np.zeros(6)
                push[3 * kind : 3 * kind + 3] = sign * axis
                pushes.append(push)
    return pushes
