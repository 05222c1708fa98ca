"""The steps in the order in which they are played: how a subassembly was put together, then its own step.

A plan says that a subassembly is put together elsewhere, and not where. It is shown on the table beside everything
else: each inside gets a bench of its own. From there the subassembly is carried to the tray; that way is made up for
the eye, has not been planned, and is a segment of the kind ``carry``.

Where the product is turned over, the page shows it turned on a table that stays: all that is placed moves as one, in a
segment of the kind ``turn``, made up likewise. It comes to stand so that the parts that follow wait where none did.

What is inserted at the same time is brought one after the other. The first ones wait, in a segment of the kind
``wait``, until the last one is there.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation, Slerp

from sashimono.assembly import Assembly, Part
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan, Motion, Step, Subassembly, Table, same_table, waits
from sashimono.view.config import ViewConfig
from sashimono.view.keyframes import rotation_between

UP = (0.0, 0.0, 1.0)
"""Which way is up when a plan has no table."""


@dataclass(frozen=True, kw_only=True)
class PlayedSegment:
    """One stretch of what is shown, from pose ``start`` to pose ``stop``."""

    kind: str
    """``transit``, ``insertion``, ``carry``, ``turn`` or ``wait``."""
    start: int
    stop: int


@dataclass(frozen=True, kw_only=True, eq=False)
class PlayedStep:
    """One step as it is shown."""

    step: Step
    label: str
    """Its number; inside subassemblies that of the subassembly's step, a dot, and its own."""
    poses: Float[np.ndarray, "pose 4 4"]
    """Where the step's part is shown, world frame of the page."""
    segments: tuple[PlayedSegment, ...]
    turns: bool = False
    """Whether it is no step of the plan, but the product turned over: all that is placed moves."""

    @property
    def waits(self) -> bool:
        """Whether it waits for others that are inserted at the same time: its last two poses are as late as theirs."""
        return any(segment.kind == "wait" for segment in self.segments)

    @property
    def depth(self) -> int:
        """How many subassemblies it is inside of."""
        return self.label.count(".")

    def member_poses(self, name: str, parts: Mapping[str, Float[np.ndarray, "4 4"]]) -> Float[np.ndarray, "pose 4 4"]:
        """Return where one member is shown, given the assembled pose of every part."""
        if name == self.step.part:
            return self.poses
        return self.poses @ se3.inverse(parts[self.step.part]) @ parts[name]


def played_steps(plan: AssemblyPlan, assembly: Assembly, config: ViewConfig) -> tuple[PlayedStep, ...]:
    """Return all steps in the order in which they are played, insides first.

    Without subassemblies these are the plan's steps as they are.
    """
    stage = _Stage(plan, assembly, config)
    return tuple(stage.played(plan.steps, "", stage.pages))


def page_frames(
    plan: AssemblyPlan, assembly: Assembly, config: ViewConfig | None = None
) -> tuple[Float[np.ndarray, "4 4"], ...]:
    """Return what shows the plan's world frame on the page, for each step of the top level: turned with the product."""
    return tuple(_Stage(plan, assembly, config or ViewConfig()).pages)


class _Stage:
    """The table of the page, and the benches in use on it."""

    def __init__(self, plan: AssemblyPlan, assembly: Assembly, config: ViewConfig) -> None:
        self._plan, self._assembly = plan, assembly
        self._up = np.array(UP) if plan.table is None else plan.table.normal / np.linalg.norm(plan.table.normal)
        first = [*plan.steps[:1], *same_table(plan.steps, 0)]
        points = [self._corners(part, plan.parts[part.name][None]) for part in assembly.parts]
        points += [self._swept(step, np.eye(4)) for step in first]
        assembled, everything = np.concatenate(points[: len(assembly)]), np.concatenate(points)
        toward = everything.mean(axis=0) - assembled.mean(axis=0)  # where the tray is
        toward = toward - toward @ self._up * self._up
        if np.linalg.norm(toward) < 1e-9:
            toward = np.cross(self._up, np.eye(3)[np.argmin(np.abs(self._up))])
        toward = toward / np.linalg.norm(toward)
        self._frame = np.array([toward, np.cross(self._up, toward), self._up])
        """Rows: away from the product, along the row of benches, up."""
        low, high = self._bounds(everything)
        self._floor = low[2] if plan.table is None else plan.table.offset / float(np.linalg.norm(plan.table.normal))
        self.pages = self._pages(plan.steps, np.eye(4))
        """Shows the world frame on the page, for each step of the top level."""
        turned = [self._swept(step, T) for step, T in zip(plan.steps, self.pages, strict=True)]
        low, high = self._bounds(np.concatenate([everything, *turned]))
        self._gap = config.bench_gap * float(np.linalg.norm(high - low))
        self._low, self._high = low, high
        waiting = [self._waiting(step, T) for step, T in zip(plan.steps, self.pages, strict=True)]
        self._top = float(self._bounds(np.concatenate([*waiting, everything[:1]]))[1][2])
        """Height of what waits on the tray."""
        self._corner = np.array([high[0] + self._gap, low[1]])
        """Where the next bench begins."""
        self._depth = 0.0
        """Width of the widest bench of this row."""

    def played(
        self, steps: Sequence[Step], prefix: str, pages: Sequence[Float[np.ndarray, "4 4"]]
    ) -> Iterator[PlayedStep]:
        """Yield the steps of one level and all below it; ``pages`` show its world frame on the page, for each step."""
        for k, (step, T_page) in enumerate(zip(steps, pages, strict=True)):
            label = f"{prefix}{k + 1}"
            if step.turned and step.fixed:
                yield self._turn(step, f"{label}a", pages[k - 1], T_page)
            poses = T_page @ step.motion.T_world_part
            segments = [PlayedSegment(kind=s.kind, start=s.start, stop=s.stop) for s in step.motion.segments]
            if step.subassembly is not None:
                T_bench = self._bench(step.subassembly)
                inside = self._pages(step.subassembly.steps, T_bench)
                yield from self.played(step.subassembly.steps, f"{label}.", inside)
                way = self._carried(step, inside[-1] @ self._plan.parts[step.part], poses[0])
                n = len(way) - 1
                segments = [
                    PlayedSegment(kind="carry", start=0, stop=n),
                    *(PlayedSegment(kind=s.kind, start=s.start + n, stop=s.stop + n) for s in segments),
                ]
                poses = np.concatenate([way, poses[1:]])
            if waits(steps, k):
                begin = segments[-1].start
                poses = np.insert(poses, begin, poses[begin], axis=0)
                segments = [
                    *segments[:-1],
                    PlayedSegment(kind="wait", start=begin, stop=begin + 1),
                    PlayedSegment(kind="insertion", start=begin + 1, stop=len(poses) - 1),
                ]
            yield PlayedStep(step=step, label=label, poses=poses, segments=tuple(segments))

    def _pages(self, steps: Sequence[Step], T_page: Float[np.ndarray, "4 4"]) -> list[Float[np.ndarray, "4 4"]]:
        """What shows the world frame on the page, for each step of a level that begins like this."""
        pages = []
        taken: list[Float[np.ndarray, "n 3"]] = []
        for k, step in enumerate(steps):
            if step.table is not None and step.fixed:
                T_page = self._turned(T_page, step.table, [step, *same_table(steps, k)], taken)
            taken.append(self._waiting(step, T_page))
            pages.append(T_page)
        return pages

    def _turned(
        self,
        T_page: Float[np.ndarray, "4 4"],
        table: Table,
        steps: Sequence[Step],
        taken: Sequence[Float[np.ndarray, "n 3"]],
    ) -> Float[np.ndarray, "4 4"]:
        """The world frame turned so that a table of its own is level: the quarter turn by which the parts of these
        steps wait farthest from where others did."""
        placed = [self._corners(self._assembly.part(n), self._plan.parts[n][None]) for n in steps[0].fixed]
        middle = np.concatenate(placed).mean(axis=0)
        where = se3.apply(T_page, middle[None])[0]
        level = Rotation.from_quat(rotation_between(T_page[:3, :3] @ table.normal, self._up)).as_matrix()
        offset = table.offset / float(np.linalg.norm(table.normal))
        others = np.concatenate(taken)[:, None] @ self._frame.T
        found = []
        for quarter in range(4):
            R = Rotation.from_rotvec(0.5 * np.pi * quarter * self._up).as_matrix() @ level @ T_page[:3, :3]
            shift = where - R @ middle
            shift = shift + (self._floor - float(shift @ self._up) - offset) * self._up
            T = se3.make(R, shift)
            points = np.concatenate([self._waiting(step, T) for step in steps]) @ self._frame.T
            apart = np.linalg.norm(points[:, None, :2] - others[None, :, 0, :2], axis=2).min()
            found.append((-round(float(apart), 6), quarter, T))
        return min(found, key=lambda entry: entry[:2])[2]

    def _turn(
        self,
        step: Step,
        label: str,
        T_from: Float[np.ndarray, "4 4"],
        T_to: Float[np.ndarray, "4 4"],
        pieces: int = 16,
    ) -> PlayedStep:
        """All that is placed before a step, lifted, turned over and set down."""
        lead = step.fixed[0]
        corners = np.concatenate(
            [self._corners(self._assembly.part(name), self._plan.parts[name][None]) for name in step.fixed]
        )
        center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        radius = float(np.linalg.norm(corners - center, axis=1).max())
        ends = [se3.apply(T, center[None])[0] for T in (T_from, T_to)]
        top = max(self._floor + 1.1 * radius, *(float(end @ self._up) for end in ends))
        share = np.linspace(0.0, 1.0, pieces + 1)
        turns = Slerp([0.0, 1.0], Rotation.from_matrix([T_from[:3, :3], T_to[:3, :3]]))(share).as_matrix()
        raised = [end + (top - float(end @ self._up)) * self._up for end in ends]
        way = [
            se3.make(R, (1.0 - u) * raised[0] + u * raised[1] - R @ center) for u, R in zip(share, turns, strict=True)
        ]
        poses = np.array([T_from, *way, T_to]) @ self._plan.parts[lead]
        turned = Step(
            part=lead,
            fixed=(),
            motion=Motion(T_world_part=poses, segments=()),
            contact=None,
            moving=step.fixed if len(step.fixed) > 1 else (),
            held=step.held_before,
        )
        segments = (PlayedSegment(kind="turn", start=0, stop=len(poses) - 1),)
        return PlayedStep(step=turned, label=label, poses=poses, segments=segments, turns=True)

    def _waiting(self, step: Step, T_page: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "_ 3"]:
        """Corners of the boxes of all that comes in a step, where it waits."""
        return np.concatenate(
            [
                self._corners(self._assembly.part(name), T_page @ step.member_poses(name, self._plan.parts)[:1])
                for name in step.members
            ]
        )

    def _bench(self, below: Subassembly) -> Float[np.ndarray, "4 4"]:
        """Where the world frame of an inside is shown: its table turned level, on a free place."""
        table = below.table or Table(normal=self._up, offset=0.0)
        turn = Rotation.from_quat(rotation_between(table.normal, self._up)).as_matrix()
        level = se3.make(turn)
        first = [*below.steps[:1], *same_table(below.steps, 0)]
        low, high = self._bounds(np.concatenate([self._swept(step, level) for step in first]))
        bottom = low[2] if below.table is None else table.offset / float(np.linalg.norm(table.normal))
        if self._corner[1] > self._low[1] and self._corner[1] + high[1] - low[1] > self._high[1]:
            self._corner = np.array([self._corner[0] + self._depth + self._gap, self._low[1]])
            self._depth = 0.0
        shift = np.array([*(self._corner - low[:2]), self._floor - bottom])
        self._corner[1] += high[1] - low[1] + self._gap
        self._depth = max(self._depth, float(high[0] - low[0]))
        return se3.make(None, self._frame.T @ shift) @ level

    def _carried(
        self, step: Step, T_from: Float[np.ndarray, "4 4"], T_to: Float[np.ndarray, "4 4"], pieces: int = 8
    ) -> Float[np.ndarray, "pose 4 4"]:
        """Poses of the step's part from the bench to where its step begins: up, across above all that waits, down."""
        names = step.members
        inside = se3.inverse(self._plan.parts[step.part])
        corners = np.concatenate(
            [self._corners(self._assembly.part(name), (inside @ self._plan.parts[name])[None]) for name in names]
        )
        center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        radius = float(np.linalg.norm(corners - center, axis=1).max())
        top = self._top + radius
        ends = [se3.apply(T, center[None])[0] for T in (T_from, T_to)]
        raised = [end + max(0.0, top - float(end @ self._up)) * self._up for end in ends]
        turns = Slerp([0.0, 1.0], Rotation.from_matrix([T_from[:3, :3], T_to[:3, :3]]))
        share = np.linspace(0.0, 1.0, pieces + 1)
        across = [
            se3.make(R, (1.0 - u) * raised[0] + u * raised[1] - R @ center)
            for u, R in zip(share, turns(share).as_matrix(), strict=True)
        ]
        return np.array([T_from, *across, T_to])

    def _swept(self, step: Step, T_page: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "_ 3"]:
        """Corners of the boxes of all that moves in a step, at every pose but those in mid-transit."""
        wanted = [0, *(s.start for s in step.motion.segments if s.kind == "insertion"), -1]
        return np.concatenate(
            [
                self._corners(self._assembly.part(name), T_page @ step.member_poses(name, self._plan.parts)[wanted])
                for name in step.members
            ]
        )

    def _corners(self, part: Part, poses: Float[np.ndarray, "pose 4 4"]) -> Float[np.ndarray, "_ 3"]:
        low, high = part.vertices_part.min(axis=0), part.vertices_part.max(axis=0)
        corners = np.stack(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), axis=-1).reshape(-1, 3)
        return (corners @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]).reshape(-1, 3)

    def _bounds(self, points: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
        along = points @ self._frame.T
        return along.min(axis=0), along.max(axis=0)
