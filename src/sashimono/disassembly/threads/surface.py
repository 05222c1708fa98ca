"""The thread stage: a part whose surface is a thread in another's leaves by that thread's own screw.

Axis and pitch are read off each part's surface by itself. So neither clearance between the two hides them, nor a
phase in which the CAD has their ridges overlap. About a part's own thread axis the thread sweeps nothing
but itself: what it clears in the assembled pose, and what it overlaps there, stays the same until it is out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from sashimono.disassembly.paths import Paths
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.geometry.body import mutual_depth
from sashimono.geometry.features.helix import Helix, HelixConfig, fit_helix, refit_helix, thread_phase


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
    same_axis: float = 1e-3
    """Axes that are nearer, over their radius, are one."""
    same_way: float = 0.9999
    """Cosine from which on a thread leads along a direction."""
    max_turns: float = 120.0
    """Turns followed along one screw."""
    offsets: int = 16
    """Where the ridges overlap, and phases do not tell where they would not: shifts along the axis, evenly from one
    ridge to the next, at which the screw may begin."""
    farther: int = 2
    """Where the other part stops the screw, it is asked again so many ridges farther where there is room: what enters
    there may be another stretch of thread, with a phase of its own."""
    farther_offsets: int = 32
    """Shifts that are looked at there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Thread:
    """A thread that two parts have where their boxes meet. In the world frame, assembled."""

    screws: tuple[Helix, ...]
    """Along which one may leave the other: about the part's own axis, then about the other's where that differs."""
    offset: float
    """Shift of the part along the axis that takes its ridges midway between the other's [m], from 0 to `spacing`."""

    @property
    def spacing(self) -> float:
        """From one ridge to the next [m]."""
        return self.screws[0].lead / self.screws[0].starts


class Threads:
    """The threads between pairs of parts of one assembly, worked out as they are asked for."""

    def __init__(self, parts: PlacedParts, *, config: UnscrewConfig) -> None:
        self.parts = parts
        self.config = config
        self._pairs: dict[tuple[int, int], Thread | None] = {}

    def between(self, part: int, other: int) -> Thread | None:
        """Return the thread that a part has with another one; None if they share none."""
        key = (part, other)
        if key not in self._pairs:
            self._pairs[key] = self._find(part, other)
        return self._pairs[key]

    def _find(self, part: int, other: int) -> Thread | None:
        whole = [self.parts.vertices[k][self.parts.faces[k]] for k in (part, other)]
        low = np.maximum(*(each.min(axis=(0, 1)) for each in whole))
        high = np.minimum(*(each.max(axis=(0, 1)) for each in whole))
        if (low >= high).any():
            return None
        own, theirs = (self._within(each, low, high) for each in whole)
        for axis in self.parts.part_lines[part][: self.config.max_lines]:
            first = fit_helix(own, axis, config=self.config.helix)
            if first is None:
                continue
            second = fit_helix(theirs, axis, config=self.config.helix)
            if second is not None and abs(first.pitch - second.pitch) <= self.config.agreement * abs(first.pitch):
                return self._thread((first, second), (own, theirs), whole)
        return None

    def _thread(
        self,
        found: tuple[Helix, Helix],
        near: tuple[Float[np.ndarray, "_ 3 3"], Float[np.ndarray, "_ 3 3"]],
        whole: list[Float[np.ndarray, "_ 3 3"]],
    ) -> Thread:
        """The thread of two helices: with the pitch that the longer one tells, all along its part."""
        config = self.config.helix
        spans = []
        for helix, triangles, every in zip(found, near, whole, strict=True):
            reach = np.linalg.norm(np.cross(triangles.reshape(-1, 3) - helix.point, helix.axis), axis=1).max()
            middles = every.mean(axis=1)
            along = every[np.linalg.norm(np.cross(middles - helix.point, helix.axis), axis=1) <= reach]
            along = along[:: 1 + len(along) // self.config.max_faces]
            refit = refit_helix(helix, along, config=config)
            spans.append((float(np.ptp(along @ helix.axis)), refit.pitch))
        pitch = max(spans)[1]
        first, second = (replace(helix, pitch=pitch) for helix in found)
        apart = float(np.linalg.norm(np.cross(first.point - second.point, first.axis)))
        one = apart <= self.config.same_axis * first.radius
        phases = [thread_phase(first, triangles, config=config) for triangles in near]
        offset = first.pitch / first.starts * (phases[1] + np.pi - phases[0])
        return Thread(
            screws=(first,) if one else (first, second), offset=float(np.mod(offset, first.lead / first.starts))
        )

    def _within(
        self, triangles: Float[np.ndarray, "face 3 3"], low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"]
    ) -> Float[np.ndarray, "_ 3 3"]:
        """The triangles whose middle is in a box."""
        middles = triangles.mean(axis=1)
        inside = triangles[((middles >= low) & (middles <= high)).all(axis=1)]
        return inside[:: 1 + len(inside) // self.config.max_faces]


@dataclass(frozen=True, kw_only=True, eq=False)
class Unscrewed:
    """What came of turning a part out of its threads."""

    removal: Removal | None
    traced: int
    """Tracing steps (`Paths.traced`) that it took."""
    is_cut: bool = False
    """Whether they were spent before every thread was followed."""
    stopped: tuple[Stopped, ...] = ()
    """Each way along each thread that was followed and leads nowhere, as far as it goes."""

    @property
    def is_held(self) -> bool:
        """Whether a thread holds the part: it follows it for a turn, and the thread itself ends it, not a third part.

        As long as threads are engaged there is no other motion.
        """
        return any(
            max(way.turns for way in ways) >= 1.0 and all(way.at_end or way.turns < 1.0 for way in ways)
            for ways in self._by_other.values()
        )

    @property
    def _by_other(self) -> dict[int, list[Stopped]]:
        out: dict[int, list[Stopped]] = {}
        for way in self.stopped:
            out.setdefault(way.other, []).append(way)
        return out


@dataclass(frozen=True, kw_only=True)
class Stopped:
    """How far a part gets along a thread that does not let it out."""

    other: int
    """The part that the thread is shared with."""
    pitch: float
    """Shift in one turn [m]."""
    turns: float
    at_end: bool
    """Whether it is the other part that stops it, or that is in the way straight out from there."""


def search_unscrew(
    threads: Threads,
    part: int,
    others: Sequence[int],
    *,
    max_traced: int,
    among: Sequence[int] | None = None,
    direction: Float[np.ndarray, "3"] | None = None,
) -> Unscrewed:
    """Return a removal of the part along the screw of a thread that it shares with one of the others, if there is one.

    Args:
        threads: Of the assembly.
        part: What moves.
        others: Those in which it may be threaded.
        max_traced: Tracing steps allowed; looked at before each screw is followed.
        among: Those past which it moves; the others if None.
        direction: The way out, unit; any if None.
    """
    parts, config = threads.parts, threads.config
    limits = parts.tolerances
    among = others if among is None else among
    drawn = Paths(parts, part, among, tolerance=limits.turning, once_parted=limits.thread)
    spent, stopped = 0, []
    for other in drawn.near(np.eye(4)):
        thread = threads.between(part, other) if other in others else None
        if thread is None:
            continue
        # once its ridges are clear of the other's, no overlap as assembled lets them through one another; facets do
        # touch, while out of the last turn there is no need to
        clear = Paths(parts, part, among, tolerance=limits.turning, parted={other: limits.thread})
        out = Paths(parts, part, among, tolerance=limits.turning, parted={other: limits.turning})
        for helix in thread.screws:
            for sign in (1.0, -1.0):
                if direction is not None and float(sign * helix.axis @ direction) < config.same_way:
                    continue
                ends = []
                for start in _starts(drawn, other, thread, helix, sign, config):
                    traced = spent + drawn.traced + clear.traced + out.traced
                    if traced >= max_traced:
                        return Unscrewed(removal=None, traced=traced, is_cut=True)
                    found = _follow(drawn if len(start) == 1 else clear, out, helix, sign, start, config)
                    if isinstance(found, Removal):
                        return Unscrewed(removal=found, traced=spent + drawn.traced + clear.traced + out.traced)
                    ends.append(found)
                turns, stopper = max(ends, key=lambda end: end[0])
                if stopper == other and helix is thread.screws[0]:
                    for start in _later_starts(drawn, other, thread, helix, sign, turns, config):
                        found = _follow(clear, out, helix, sign, start, config)
                        if isinstance(found, Removal):
                            return Unscrewed(removal=found, traced=spent + drawn.traced + clear.traced + out.traced)
                        turns, stopper = max((turns, stopper), found, key=lambda end: end[0])
                stopped.append(Stopped(other=other, pitch=helix.lead, turns=turns, at_end=stopper == other))
        spent += clear.traced + out.traced
    return Unscrewed(removal=None, traced=spent + drawn.traced, stopped=tuple(stopped))


def _starts(
    paths: Paths, other: int, thread: Thread, helix: Helix, sign: float, config: UnscrewConfig
) -> Iterator[list[Float[np.ndarray, "4 4"]]]:
    """Displacements from which the screw may begin, the assembled pose first.

    Midway between the other's ridges there is most room: a shift along the axis takes a part there, or else a turn in
    place, which, seen along the thread, is a shift the other way; the nearest first. Where CAD draws ridges
    overlapping, this comes before the pose as it is.
    """
    parts = paths.parts
    scale = parts.scale(paths.part, other)
    overlaps = parts.overlaps[paths.part, other] > parts.tolerances.turning * scale
    if not overlaps:
        yield [np.eye(4)]
    spacing = thread.spacing
    ahead = behind = float(np.mod(sign * thread.offset, spacing))
    found = bool(_clear_shifts(paths, other, sign * helix.axis, np.array([ahead])).all())
    if not found and overlaps:
        shifts = np.arange(1, config.offsets) * (spacing / config.offsets)
        rooms = _rooms(_clear_shifts(paths, other, sign * helix.axis, shifts))
        found = len(rooms) > 0
        if found:
            ahead, behind = (float(shifts[room]) for room in (rooms[0], rooms[-1]))
    if found:
        yield from _shifted(paths, thread, helix, sign, ahead, behind)
    if overlaps:
        yield [np.eye(4)]


def _later_starts(
    paths: Paths, other: int, thread: Thread, helix: Helix, sign: float, turns: float, config: UnscrewConfig
) -> Iterator[list[Float[np.ndarray, "4 4"]]]:
    """Displacements from which the screw may begin for what enters the other part's thread after so many turns.

    A screw may have two threads, one after the other, or be drawn where none of its thread is engaged. Where it is
    stopped, the phase that matters is that of the stretch that enters there.
    """
    spacing, count = thread.spacing, config.farther_offsets
    farther = spacing * (np.ceil(turns * helix.starts) + config.farther)
    shifts = np.arange(count) * (spacing / count)
    clear = _clear_shifts(paths, other, sign * helix.axis, farther + shifts)
    if clear.all() or not clear.any():
        return
    # a room that goes on past the last shift is one with what begins at none
    first = int(np.argmin(clear))
    for room in _rooms(np.roll(clear, -first)):
        shift = float(shifts[(room + first) % count])
        yield from _shifted(paths, thread, helix, sign, shift, shift)


def _clear_shifts(
    paths: Paths, other: int, direction: Float[np.ndarray, "3"], shifts: Float[np.ndarray, "shift"]
) -> Bool[np.ndarray, "shift"]:
    """Whether a part, shifted so far from the assembled pose, is clear of the other's ridges."""
    parts = paths.parts
    body, T_other_world = parts.bodies[other], se3.inverse(parts.poses[other])
    limit = parts.tolerances.thread * parts.scale(paths.part, other)
    poses = [T_other_world @ se3.make(None, shift * direction) @ paths.T_assembled for shift in shifts]
    return np.array([mutual_depth(paths.body, body, pose) <= limit for pose in poses])


def _rooms(clear: Bool[np.ndarray, "shift"]) -> list[int]:
    """The middle of each run of shifts that are clear."""
    where = np.flatnonzero(clear)
    runs = np.split(where, np.flatnonzero(np.diff(where) > 1) + 1)
    return [int(run[len(run) // 2]) for run in runs if len(run)]


def _shifted(
    paths: Paths, thread: Thread, helix: Helix, sign: float, ahead: float, behind: float
) -> Iterator[list[Float[np.ndarray, "4 4"]]]:
    """The ways from the assembled pose to where the screw begins that nothing stops: a shift ahead, or a turn in place.

    The turn is what a shift by ``behind``, less the spacing, would be; the shorter way is first.
    """
    spacing = thread.spacing
    shifted = [np.eye(4), se3.make(None, sign * ahead * helix.axis)]
    angle = (spacing - behind) / abs(helix.pitch)
    twist = helix.twist(sign)
    twist[:3] -= (twist[:3] @ helix.axis) * helix.axis
    turned = [se3.exp(k * angle / 3.0 * twist) for k in range(4)]
    for start in (shifted, turned) if 2.0 * ahead < spacing else (turned, shifted):
        if paths.check(np.array(start)) and paths.parts_once(np.array(start)):
            yield start


def _follow(
    within: Paths, out: Paths, helix: Helix, sign: float, start: list[Float[np.ndarray, "4 4"]], config: UnscrewConfig
) -> Removal | tuple[float, int | None]:
    """The removal along one screw from the last of the poses given; or how many turns it goes, and what stops it then.

    Once the threads have parted, a part that is turned farther can still leave: so where it can is found by bisection.

    Args:
        within: Along the thread.
        out: Straight out of it.
        helix: The thread.
        sign: Along its axis, or against it.
        start: Where it begins.
        config: How far it is followed.
    """
    direction = sign * helix.axis
    leg = config.leg * helix.twist(sign)
    way = float((within.out(start[-1], direction)[:3, 3] - start[-1][:3, 3]) @ direction)
    turns = min(config.max_turns, np.ceil(way / helix.lead))
    count = int(np.ceil(turns * 2.0 * np.pi / config.leg))
    # one turn first: most that are stopped are stopped at once
    reached, turned, stopper = 0, 0.0, None
    for stop in (min(count, int(np.ceil(2.0 * np.pi / config.leg))), count):
        if stop > reached:
            u, stopper = within.advance(se3.exp(reached * leg) @ start[-1], (stop - reached) * leg)
            turned = (reached + u * (stop - reached)) * config.leg / (2.0 * np.pi)
            reached = int(np.floor(turned * 2.0 * np.pi / config.leg + 1e-9))
            if stopper is not None:
                break

    def removal(legs: int) -> Removal | None:
        poses = [*start, *(se3.exp(k * leg) @ start[-1] for k in range(1, legs + 1))]
        # an overlap as deep as assembled would let the ridges through one another: they are to part by turning
        end = out.exit(poses[-1], direction)
        if end is None or not within.parts_once(np.array([*poses, end])):
            return None
        return Removal(displacements=np.array([*poses, end]), exit_direction=direction)

    found = removal(reached) if reached else None
    if found is None:
        if stopper is None:
            at = se3.exp(reached * leg) @ start[-1]
            stopper = out.advance(at, out.straight(at, direction))[1]
        return turned, stopper
    low, high = 0, reached
    while high - low > 1:
        middle = (low + high) // 2
        earlier = removal(middle)
        found, low, high = (found, middle, high) if earlier is None else (earlier, low, middle)
    return found
