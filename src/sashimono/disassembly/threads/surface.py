"""The thread stage: a part whose surface is a thread in another's leaves by that thread's own screw.

Axis and pitch are read off each part's surface by itself. So neither clearance between the two hides them, nor a
phase in which the CAD has their ridges overlap. About a part's own thread axis the thread sweeps nothing
but itself: what it clears in the assembled pose, and what it overlaps there, stays the same until it is out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.geometry.body import mutual_depth
from sashimono.geometry.features.helix import Helix, HelixConfig, fit_helix


@dataclass(frozen=True, kw_only=True)
class UnscrewConfig:
    """How threads are looked for and followed."""

    helix: HelixConfig = field(default_factory=HelixConfig)
    agreement: float = 0.02
    """Largest relative difference between the pitches of two parts that are one thread."""
    max_lines: int = 6
    """Lines of the part's own geometry tried as the axis."""
    max_faces: int = 40_000
    """Faces of one part looked at; of a finer mesh, every second, third, ... one."""
    leg: float = 2.0 * np.pi / 3.0
    """Turn of one stretch [rad]; geodesics need less than π."""
    most_turned: float = 0.9 * np.pi
    """Largest turn in place before the screw begins [rad]."""
    max_turns: float = 40.0
    """Turns followed along one screw."""
    offsets: int = 16
    """Where the ridges overlap: shifts along the axis, evenly within one turn's, at which it may begin instead."""


class Threads:
    """The threads between pairs of parts of one assembly, worked out as they are asked for."""

    def __init__(self, parts: PlacedParts, *, config: UnscrewConfig) -> None:
        self.parts = parts
        self.config = config
        self._pairs: dict[tuple[int, int], tuple[Helix, ...]] = {}

    def between(self, part: int, other: int) -> tuple[Helix, ...]:
        """Return the screws of a thread that both parts have where their boxes meet: the part's own, the other's.

        In the world frame, assembled; empty if they share no thread.
        """
        key = (part, other)
        if key not in self._pairs:
            self._pairs[key] = self._find(part, other)
        return self._pairs[key]

    def _find(self, part: int, other: int) -> tuple[Helix, ...]:
        own, theirs = (self.parts.vertices[k][self.parts.faces[k]] for k in (part, other))
        low = np.maximum(own.min(axis=(0, 1)), theirs.min(axis=(0, 1)))
        high = np.minimum(own.max(axis=(0, 1)), theirs.max(axis=(0, 1)))
        if (low >= high).any():
            return ()
        own, theirs = self._within(own, low, high), self._within(theirs, low, high)
        for axis in self.parts.part_lines[part][: self.config.max_lines]:
            first = fit_helix(own, axis, config=self.config.helix)
            if first is None:
                continue
            second = fit_helix(theirs, axis, config=self.config.helix)
            if second is not None and abs(first.pitch - second.pitch) <= self.config.agreement * abs(first.pitch):
                return (first, second)
        return ()

    def _within(
        self, triangles: Float[np.ndarray, "face 3 3"], low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]
    ) -> Float[np.ndarray, "_ 3 3"]:
        """The triangles whose middle is in a box."""
        middles = triangles.mean(axis=1)
        inside = triangles[((middles >= low) & (middles <= high)).all(axis=1)]
        return inside[:: 1 + len(inside) // self.config.max_faces]


def search_unscrew(
    threads: Threads, part: int, others: Sequence[int], *, max_traced: int
) -> tuple[Removal | None, int]:
    """Return a removal of the part past the others along the screw of a thread that it shares with one, else None,
    and the tracing steps (`Paths.traced`) that it took; looked at before each screw is followed."""
    parts, config = threads.parts, threads.config
    paths = Paths(parts, part, others, tolerance=parts.tolerances.turning)
    for other in paths.near(np.eye(4)):
        for helix in threads.between(part, other):
            for sign in (1.0, -1.0):
                for start in _starts(paths, other, helix, sign, config):
                    removal = _follow(paths, helix, sign, start, config) if paths.traced < max_traced else None
                    if removal is not None:
                        return removal, paths.traced
    return None, paths.traced


def _starts(
    paths: Paths, other: int, helix: Helix, sign: float, config: UnscrewConfig
) -> Iterator[list[Float[np.ndarray, "4 4"]]]:
    """Displacements from which the screw may begin, the assembled pose first.

    Where CAD draws ridges overlapping, a shift along the axis takes them midway between the other's, or else a turn
    in place: seen along the thread, that is a shift the other way. Last, with the overlap as it is.
    """
    parts = paths.parts
    limit = parts.tolerances.turning * parts.scale(paths.part, other)
    if parts.overlaps[paths.part, other] > limit:
        lead = 2.0 * np.pi * abs(helix.pitch)
        shifts = np.arange(1, config.offsets) * (lead / config.offsets)
        ways = [se3.make(None, sign * shift * helix.axis) for shift in shifts]
        T_other_world, body = se3.inverse(parts.poses[other]), parts.bodies[other]
        depths = [mutual_depth(paths.body, body, T_other_world @ D @ paths.T_assembled) for D in ways]
        clear = np.flatnonzero(np.array(depths) <= limit)
        if len(clear):
            runs = np.split(clear, np.flatnonzero(np.diff(clear) > 1) + 1)
            first, last = runs[0][len(runs[0]) // 2], runs[-1][len(runs[-1]) // 2]
            angle = (lead - shifts[last]) / abs(helix.pitch)
            twist = helix.twist(sign)
            twist[:3] -= (twist[:3] @ helix.axis) * helix.axis
            turned = [se3.exp(angle * twist)] if angle < config.most_turned else []
            for start in (ways[first], *turned):
                if paths.check(np.array([np.eye(4), start])):
                    yield [np.eye(4), start]
    yield [np.eye(4)]


def _follow(
    paths: Paths, helix: Helix, sign: float, start: list[Float[np.ndarray, "4 4"]], config: UnscrewConfig
) -> Removal | None:
    """The removal along one screw from the last of the poses given; None if something stops it."""
    direction = sign * helix.axis
    poses = start
    leg = config.leg * helix.twist(sign)
    step = se3.exp(leg)
    for _ in range(int(np.ceil(config.max_turns * 2.0 * np.pi / config.leg))):
        if paths.advance(poses[-1], leg)[1] is not None:
            return None
        poses = [*poses, step @ poses[-1]]
        end = paths.exit(poses[-1], direction)
        # an overlap as deep as assembled would let the ridges through one another: not once they have parted
        if end is not None and paths.parts_once(np.array([*poses, end])):
            return Removal(displacements=np.array([*poses, end]), exit_direction=direction)
    return None
