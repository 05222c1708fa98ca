"""Declared threads: a screw drawn without ridges is turned out, not pulled.

The CAD shows a cylinder in a narrower hole. Which thread it stands for is not drawn, so it is declared: right-hand,
of the standard coarse pitch (ISO 261) of the cylinder's diameter. The motion is flagged as declared wherever it is
told. It is taken only if the exact check of paths passes it. Otherwise the part is pulled straight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.free_travel import parting_travel
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.separation import DeclaredThread
from sashimono.disassembly.shared_bodies import SharedBodies
from sashimono.disassembly.threads.surface import Threads
from sashimono.geometry import se3
from sashimono.geometry.features.tube import Tube


@dataclass(frozen=True, kw_only=True)
class DeclareConfig:
    """Which threads are declared, and how they are followed."""

    enabled: bool = False
    """Whether any are. The check of a plan follows every turn: an M3 screw of ten turns costs it seconds."""
    diameters: tuple[float, ...] = (
        0.25, 1.0, 1.2, 1.4, 1.6, 2.0, 2.5, 3.0, 3.5, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 16.0, 20.0, 24.0, 30.0, 36.0,
        42.0, 48.0, 56.0, 64.0,
    )  # fmt: skip
    """Nominal diameters [mm]."""
    pitches: tuple[float, ...] = (
        0.075, 0.25, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.6, 0.7, 0.8, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0, 3.5, 4.0,
        4.5, 5.0, 5.5, 6.0,
    )  # fmt: skip
    """Their coarse pitches (ISO 261) [mm]; interpolated between, and as at the ends beyond, where all are fine."""
    snap: float = 0.03
    """A diameter that is so near to a nominal one, over it, counts as that: M6 is often drawn with 5.9 mm."""
    coaxial: float = 0.1
    """Largest distance between the axes of tubes that are one thread, over the radius."""
    leg: float = 0.3 * np.pi
    """Turn of one stretch of the path [rad]."""
    max_turns: float = 24.0
    """Longer threads are pulled straight."""

    def pitch(self, diameter: float) -> float:
        """Return the pitch for a diameter [both in m]."""
        nominal = np.array(self.diameters)
        nearest = float(nominal[np.argmin(np.abs(nominal - 1e3 * diameter))])
        drawn = nearest if abs(nearest - 1e3 * diameter) <= self.snap * nearest else 1e3 * diameter
        return 1e-3 * float(np.interp(drawn, nominal, self.pitches))


def declared_removal(
    shared: SharedBodies,
    threads: Threads,
    part: int,
    others: Sequence[int],
    straight: Removal,
    *,
    config: DeclareConfig,
) -> tuple[Removal, DeclaredThread] | None:
    """Return a part's straight removal with turns at its beginning, as long as a declared thread is engaged.

    None if it shares no thin coaxial tube about its way out, if its surface has a thread of its own, or if anything
    is in the way of the turn: then the straight removal stays.
    """
    parts, axis = shared.parts, straight.exit_direction
    found = _tubes(shared, threads, part, others, axis, config)
    if found is None:
        return None
    other, tube, travel = found
    pitch = config.pitch(2.0 * tube.outer_radius)
    if travel > config.max_turns * pitch or travel <= 0.0:
        return None
    angle = 2.0 * np.pi * travel / pitch
    count = int(np.ceil(angle / config.leg))
    twist = np.concatenate([travel * axis - np.cross(angle * axis, tube.point), angle * axis])
    turned = np.array([se3.exp(k / count * twist) for k in range(count + 1)])
    paths = Paths(parts, part, others, tolerance=parts.tolerances.declared)
    if not paths.check(turned):
        return None
    end = paths.exit(turned[-1], axis)
    # up to there the two have not parted, by how long the thread is
    if end is None or not paths.parts_once(np.array([turned[-1], end])):
        return None
    thread = DeclaredThread(axis=axis, point=tube.point, pitch=pitch, other=other, stretches=count)
    return Removal(displacements=np.array([*turned, end]), exit_direction=axis), thread


def _tubes(
    shared: SharedBodies,
    threads: Threads,
    part: int,
    others: Sequence[int],
    axis: Float[np.ndarray, "3"],
    config: DeclareConfig,
) -> tuple[int, Tube, float] | None:
    """The other part whose tube is left last, that tube, and the travel until then; None if tubes are not coaxial."""
    parts = shared.parts
    best: tuple[int, Tube, float] | None = None
    for other in shared.overlapping(part, sum(1 << other for other in others)):
        tube = shared.tube(part, other, axis)
        if tube is None:
            continue
        if threads.between(part, other):
            return None
        if best is not None:
            apart = float(np.linalg.norm(np.cross(tube.point - best[1].point, axis)))
            if apart > config.coaxial * tube.outer_radius:
                return None
        size = parts.smaller_size(part, other)
        T_other_world = se3.inverse(parts.poses[other])
        travel = parting_travel(
            parts.bodies[part],
            parts.bodies[other],
            T_other_world @ parts.poses[part],
            T_other_world[:3, :3] @ axis,
            length=float(np.linalg.norm(np.ptp(np.concatenate([parts.vertices[k] for k in (part, other)]), axis=0))),
            tolerance=parts.tolerances.translation * parts.scale(part, other),
            least_step=parts.tolerances.least_step * size,
        )
        if best is None or travel > best[2]:
            best = (other, tube, travel)
    return best
