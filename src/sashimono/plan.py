"""The values that come out: motions, contacts and the plan that holds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Overlap, Source, few_words, frozen_array, html_table
from sashimono.geometry import se3
from sashimono.geometry.legs import Leg, main_leg, path_legs


class Answer(StrEnum):
    """What is known about a part's removal. Three different answers, never merged."""

    FREE = "FREE"
    """A motion was found."""
    PROVEN_BLOCKED = "PROVEN_BLOCKED"
    """No motion of the stated class exists."""
    UNKNOWN = "UNKNOWN"
    """The budget ran out."""


class MotionClass(StrEnum):
    """The motions that a proof is about. It says nothing of any others."""

    TRANSLATIONS = "translations of the part alone"
    """Any number of straight legs in a row, along any directions, without a turn."""
    SCREWS = "screws along one thread"
    ALL = "motions of any kind"


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One stretch of a path: the motion from pose ``start`` to pose ``stop``, both included.

    The next segment starts at the pose where this one stops.
    """

    kind: Literal["transit", "insertion"]
    start: int
    stop: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A path of one part (or of parts that move together) among fixed ones, geometry only."""

    T_world_part: Float[np.ndarray, "pose 4 4"]
    """Poses from resting to assembled, joined by geodesics; the base part has one."""
    segments: tuple[Segment, ...]
    """They cover the path, in order. There are none for the base part."""
    evidence: Mapping[str, Any] = field(default_factory=dict)
    """What was measured while planning: ``max_penetration`` and ``tolerance`` [m], ..."""
    times: Float[np.ndarray, "pose"] | None = None
    """When the part is at each pose [s], from 0 at its resting pose; None where the path was not timed."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_world_part", frozen_array(self.T_world_part, np.float64))
        if self.times is not None:
            object.__setattr__(self, "times", frozen_array(self.times, np.float64))


@dataclass(frozen=True, kw_only=True, eq=False)
class Contact:
    """Where and how a robot holds or pushes a part, in the part's frame."""

    kind: Literal["grasp", "push"]
    points_part: Float[np.ndarray, "contact 3"]
    """Contact points on the surface [m]."""
    normals_part: Float[np.ndarray, "contact 3"]
    """Unit inward normals of the surface there."""
    friction: float
    """Coulomb friction coefficient μ."""
    quality: float
    """Grasp: Ferrari-Canny quality, torques divided by the part's radius; push: 0."""
    force_part: Float[np.ndarray, "contact 3"] | None = None
    """Contact forces [N], where they were solved for."""
    T_part_gripper: Float[np.ndarray, "4 4"] | None = None
    """Gripper pose: origin midway between the finger tips, x from first to second point, z along the approach."""
    details: Mapping[str, Any] = field(default_factory=dict)
    """Contact model, gripper dimensions [m], how many candidates were tried."""

    def __post_init__(self) -> None:
        for name in ("points_part", "normals_part", "force_part", "T_part_gripper"):
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, frozen_array(value, np.float64))


@dataclass(frozen=True, kw_only=True, eq=False)
class DeclaredHelix:
    """A stretch of a path that follows a thread which the CAD does not show: it was declared, not found."""

    axis: Float[np.ndarray, "3"]
    """Unit, world frame, the way in."""
    point: Float[np.ndarray, "3"]
    """A point on the axis, world frame [m]."""
    pitch: float
    """Shift along the axis for one turn by the right-hand rule [m]."""
    other: str
    """The part in which it is screwed."""
    start: int
    """Pose of the path at which it begins."""
    stop: int
    """Pose at which it ends, included."""

    def __post_init__(self) -> None:
        for name in ("axis", "point"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), np.float64))


@dataclass(frozen=True, kw_only=True)
class Alternative:
    """A part that is placed later: whether it could have come at this step instead, all others keeping their order."""

    part: str
    possible: bool
    more: float | None
    """How much more the order would then cost; negative if it would cost less. None if it is not possible."""
    reason: str
    """What it would cost more in, or what stands in the way."""


@dataclass(frozen=True, kw_only=True)
class Fastening:
    """A fastener, and what it holds to itself once it is in place."""

    kind: str
    """``screw``, ``bolt``, ``nut``, ``washer``, ``pin``, ``standoff`` or ``circlip``."""
    size: str | None
    """Nominal size ("M6"); None if it is near none."""
    axis: tuple[float, float, float]
    """Unit, world frame: the way in."""
    point: tuple[float, float, float]
    """A point on the axis, world frame [m]."""
    joins: tuple[str, ...] = ()
    """Parts that it is screwed into, or screwed onto: rigidly joined to it while both are in place."""


@dataclass(frozen=True, kw_only=True)
class CloseFit:
    """Two parts of which one is all around the other, drawn without clearance: taken to hold one another."""

    part: str
    """The one that is brought."""
    other: str
    """The one that is in place."""
    axis: tuple[float, float, float]
    """Unit, world frame."""
    point: tuple[float, float, float]
    """A point on the axis, world frame [m]."""


@dataclass(frozen=True, kw_only=True)
class ToolSpace:
    """A piece of the space that a tool takes: a cylinder about a fastener's axis, or a sector of one."""

    low: float
    """Where it begins, from the fastener's point against its way in [m]."""
    high: float
    """Where it ends, with the fastener's way from the start until it is seated [m]."""
    radius: float
    """[m]"""
    toward: tuple[float, float, float] | None = None
    """Of a sector: unit, across the axis, its middle; None of a whole cylinder."""
    angle: float | None = None
    """Of a sector [rad]."""


@dataclass(frozen=True, kw_only=True)
class Tool:
    """What drives a fastener, and whether there is room for it."""

    name: str
    """In words: "hex key 4 mm"."""
    kind: Literal["hex key", "wrench", "screwdriver"]
    size: float | None
    """Width of the key or of the hexagon [m]; None if it is not known."""
    access: bool
    """Whether its space is free of the parts that are in place at this step."""
    reason: str | None
    """What is in the way; None if nothing is."""
    space: tuple[ToolSpace, ...]
    """What it takes; of several ways to drive it, that with the fewest parts in the way."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Step:
    """One part, or a subassembly as one body, brought from its resting pose to its assembled pose."""

    part: str
    """The part; of a subassembly, the one whose path and frame stand for all."""
    fixed: tuple[str, ...]
    """Parts already placed, members of subassemblies by their own names."""
    motion: Motion
    contact: Contact | None
    contact_reason: str | None = None
    """Why there is no contact; None if there is one."""
    carry: Contact | None = None
    """The grasp that brings the part to where ``contact`` takes over; None if that holds it all the way, or if there is
    none. Both say in their details from which pose to which they act (``from_pose``, ``to_pose``)."""
    grippers: Mapping[str, str | None] = field(default_factory=dict)
    """Of the grippers asked about: None for one that can take the part all the way, else why it cannot."""
    moving: tuple[str, ...] = ()
    """All parts of the subassembly, `part` included; empty for a single part."""
    subassembly: Subassembly | None = None
    """How it was put together before; None for a single part."""
    simultaneous: tuple[str, ...] = ()
    """Parts whose steps, next to this one, happen at the same time; empty: none. Each waits where its insertion begins
    until all are there. Then all insertions start together, each straight and at constant speed, and end together."""
    declared: DeclaredHelix | None = None
    """The thread that part of the path follows, where one was declared."""
    held: tuple[str, ...] = ()
    """Parts that must be held once this one is in place and let go: the others then stand by themselves."""
    hands: int | None = None
    """Most hands at work at once: one a held part, one for the part that is brought. None where it is not known."""
    table: Table | None = None
    """The table of this step and those after it, where the product is turned over before it; None: nothing is turned.
    Its part, and those of later steps, rest on this table, and are laid out once the product has been turned."""
    held_before: tuple[str, ...] = ()
    """Where the product is turned over: parts that must be held on the new table until this step's part comes."""
    fastener: Fastening | None = None
    """What the part is, if it is a screw, bolt, nut or the like; None of any other part."""
    tool: Tool | None = None
    """What drives it, if it is a screw, bolt or nut with a drive."""
    close_fits: tuple[CloseFit, ...] = ()
    """Close fits of what is brought with what is in place: both are rigidly joined from now on."""
    alternatives: tuple[Alternative, ...] | None = None
    """What else could have come here, and why it did not; None where that was not asked."""

    def __repr__(self) -> str:
        name = "" if self.product is None else f"{self.product}, "
        what = f"{name}subassembly of {few_words(self.members)}" if self.moving else repr(self.part)
        return f"Step({what} onto {len(self.fixed)} parts, {len(self.motion.T_world_part)} poses, {self.moved_by})"

    @property
    def moved_by(self) -> str:
        """What grasps or pushes it, in a word."""
        return "no grasp" if self.contact is None else self.contact.kind

    @property
    def all_steps(self) -> tuple[Step, ...]:
        """This step and those inside its subassembly."""
        inside = () if self.subassembly is None else self.subassembly.steps
        return (self, *(deeper for step in inside for deeper in step.all_steps))

    @property
    def turned(self) -> bool:
        """Whether the product is turned over before this step."""
        return self.table is not None

    @property
    def moves(self) -> bool:
        """Whether it brings its part: the base, and what stands with it from the beginning, have one pose."""
        return len(self.motion.T_world_part) > 1

    @cached_property
    def insertion(self) -> tuple[Leg, ...]:
        """The legs of the way in: what follows the transit, straight stretches and screws; none if nothing moves."""
        inside = [segment for segment in self.motion.segments if segment.kind == "insertion"]
        if not inside:
            return ()
        return path_legs(self.motion.T_world_part[inside[0].start : inside[-1].stop + 1])

    @property
    def direction(self) -> Float[np.ndarray, "3"] | None:
        """Unit direction of the way in, world frame; None where there is none.

        It is that of the last leg that travels at least a tenth of the way; of a turn in place, its axis.
        """
        leg = main_leg(self.insertion)
        return None if leg is None else leg.direction

    @property
    def length(self) -> float:
        """Travel along the legs of the way in, all together [m]."""
        return sum(leg.length for leg in self.insertion)

    @property
    def turns(self) -> float:
        """Whole turns on the way in, right-hand rule about `direction`: clockwise, seen along it, is positive."""
        way = self.direction
        if way is None:
            return 0.0
        return sum(leg.turns if leg.direction @ way >= 0.0 else -leg.turns for leg in self.insertion)

    @property
    def members(self) -> tuple[str, ...]:
        """All parts that this step brings."""
        return self.moving or (self.part,)

    @property
    def product(self) -> str | None:
        """The product of the input's tree that it brings; None for any other subassembly, and for a part."""
        return None if self.subassembly is None else self.subassembly.product

    def member_poses(
        self, name: str, assembled: Mapping[str, Float[np.ndarray, "4 4"]]
    ) -> Float[np.ndarray, "pose 4 4"]:
        """Return the poses of one member along the path, given the assembled pose of every part.

        All members undergo the same displacements, so that a geodesic of one is a geodesic of all.
        """
        poses = self.motion.T_world_part
        if name == self.part:
            return poses
        return poses @ se3.inverse(assembled[self.part]) @ assembled[name]


@dataclass(frozen=True, kw_only=True, eq=False)
class Subassembly:
    """How several parts are put together before they move as one: a little plan in the same world frame.

    Its last poses are the parts' assembled poses in the finished product; its table is its own.
    """

    order: tuple[str, ...]
    """Assembly order, base part first."""
    steps: tuple[Step, ...]
    """One for each name in ``order``."""
    table: Table | None
    fixture: Fixture | None = None
    """What holds its base above its table; None if that stands on it."""
    product: str | None = None
    """The product of the input's tree that it is; None where it moves as one because no part leaves alone."""


@dataclass(frozen=True, kw_only=True)
class PlannedProduct:
    """A product of the input's tree, and how it is put together."""

    name: str
    parts: tuple[str, ...]
    """All of its parts."""
    planned: Literal["subassembly", "base", "apart"]
    """On a bench of its own, and brought as one; first of all, where it stands; or part by part like all others."""
    reason: str = ""
    """Why it is not put together by itself, or which of its parts come later."""


@dataclass(frozen=True, kw_only=True)
class Unsolved:
    """A part for which no step was found, and why."""

    part: str
    answer: Answer
    blocked_by: tuple[str, ...]
    reason: str
    proven_for: MotionClass | None = None
    """The motions that are proven not to exist; given with PROVEN_BLOCKED, and only with it."""

    def __post_init__(self) -> None:
        assert (self.answer is Answer.PROVEN_BLOCKED) == (self.proven_for is not None), "a proof is of some motions"

    @property
    def verdict(self) -> str:
        """The answer, with the motions that a proof is about."""
        return str(self.answer) if self.proven_for is None else f"{self.answer} for {self.proven_for}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """The plane ``normal · x = offset`` on which resting parts stand; gravity is along -normal."""

    normal: Float[np.ndarray, "3"]
    offset: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "normal", frozen_array(self.normal, np.float64))


@dataclass(frozen=True, kw_only=True)
class Fixture:
    """What holds the base, and what stands with it from the beginning, above the table."""

    parts: tuple[str, ...]
    height: float
    """Of the base's lowest point above the table [m]."""
    reason: str
    """Why the base does not stand on the table."""


@dataclass(frozen=True, kw_only=True)
class OrderCost:
    """What the order of a plan costs: how an order is told from a better one."""

    total: float
    """The sum of all terms, each times its weight."""
    terms: Mapping[str, float]
    """How often, or how much, of each term there is."""
    weights: Mapping[str, float]
    """What each counts."""


FitKind = Literal["ring", "spring", "seal", "clip", "snap", "press"]
"""An open ring (circlip, C-clip); a helical spring; an O-ring; a formed sheet; an arm with a lip; a press fit."""


@dataclass(frozen=True, kw_only=True)
class DeclaredFit:
    """Two parts of which one has to give on the way: they may go deeper into each other than any others.

    The CAD has both rigid. That one gives is an assumption, from its shape.
    """

    parts: tuple[str, str]
    """The one that gives, and the one that it gives way to."""
    kind: FitKind
    depth: float
    """How deep the two may go into each other, all in all, anywhere on the way [m]."""
    reason: str
    """In words, with what has to give."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RestingPoses:
    """Where parts wait, given from outside: a tray, a feeder, what a camera saw."""

    table: Table
    poses: Mapping[str, Float[np.ndarray, "4 4"]]
    """``T_world_part`` of some parts, or of all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class AssemblyPlan:
    """A plan, complete or partial, as written to plan.json."""

    status: Literal["complete", "partial"]
    """Complete: every part has a step, and the independent check found nothing wrong."""
    source: Source
    parts: Mapping[str, Float[np.ndarray, "4 4"]]
    """Assembled pose ``T_world_part`` of each part."""
    order: tuple[str, ...]
    """Assembly order, base part first; a subassembly by the name of one of its parts."""
    steps: tuple[Step, ...]
    """One for each name in ``order``."""
    products: tuple[PlannedProduct, ...] = ()
    """How the products of the input's tree were planned, the outer ones first; none where it has no tree."""
    unsolved: tuple[Unsolved, ...] = ()
    table: Table | None = None
    fixture: Fixture | None = None
    """What holds the base above the table; None if it stands on it."""
    hands: int = 2
    """How many hands there are."""
    executable: bool | None = None
    """Whether it can be carried out: complete, a contact at every moving step, nothing that floats or tips unheld, and
    no step that takes more than ``hands``. None where that was not looked at."""
    cost: OrderCost | None = None
    """What the order costs; None where that was not counted."""
    fits: tuple[DeclaredFit, ...] = ()
    """Pairs of which one has to give on the way, declared so."""
    overlaps: tuple[Overlap, ...] = ()
    identical: tuple[tuple[str, ...], ...] = ()
    notes: tuple[str, ...] = ()
    config: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0
    version: str = ""
    """Package version that made the plan."""
    timings: Mapping[str, float] = field(default_factory=dict)
    """Seconds by stage; the only fields that differ between two runs with the same seed."""

    def __repr__(self) -> str:
        unsolved = f"; unsolved: {few_words([entry.part for entry in self.unsolved])}" if self.unsolved else ""
        placed = f"{len(self.placed)} of {len(self.parts)} parts placed"
        return f"AssemblyPlan({self.status}, {placed}: {few_words(self.order)}{unsolved})"

    def _repr_html_(self) -> str:
        """Return a table of the steps, as a notebook shows it; `sashimono.show` plays them in 3D."""
        rows = [
            (str(k), few_words(step.members), f"{len(step.motion.T_world_part)} poses", _contact_words(step))
            for k, step in enumerate(self.steps, start=1)
        ]
        rows += [("-", entry.part, entry.verdict, entry.reason) for entry in self.unsolved]
        return html_table(repr(self), ("step", "part", "motion", "contact"), rows)

    @property
    def verdict(self) -> str:
        """What the plan is worth, in figures: motions, contacts, most parts held at once, what is in a fixture."""
        moving = [step for step in self.all_steps if step.moves]
        words = [
            f"motions {len(moving)}/{len(moving) + len(self.unsolved)}",
            f"contacts {sum(step.contact is not None for step in moving)}/{len(moving)}",
        ]
        if self.fits:
            words.append(fit_words(len(self.fits)))
        if blocked := sum(step.tool is not None and not step.tool.access for step in moving):
            words.append(f"tools without room {blocked}")
        if self.executable is not None:
            below = [step.subassembly for step in self.all_steps if step.subassembly is not None]
            fixtures = [fixture for fixture in (self.fixture, *(each.fixture for each in below)) if fixture is not None]
            parts = [name for fixture in fixtures for name in fixture.parts]
            held = [max(len(step.held), len(step.held_before)) for step in self.all_steps]
            words += [
                f"held {max(held, default=0)}",
                *([f"by close fits {fits}"] if (fits := sum(bool(step.close_fits) for step in self.all_steps)) else []),
                f"turned over {sum(step.turned for step in self.all_steps)}",
                f"fixture {few_words(parts) if parts else 'none'}",
                "executable" if self.executable else f"not executable with {self.hands} hands",
            ]
        return " · ".join(words)

    @property
    def all_steps(self) -> tuple[Step, ...]:
        """Every step, each followed by those inside its subassembly."""
        return tuple(inner for step in self.steps for inner in step.all_steps)

    @property
    def placed(self) -> tuple[str, ...]:
        """Parts that have a step of their own, inside subassemblies too, in the order in which they are placed."""
        return placed_parts(self.steps)


def _contact_words(step: Step) -> str:
    """Return what holds the part, with its quality, or why nothing does."""
    if step.contact is None:
        return step.contact_reason or step.moved_by
    return f"{step.moved_by}, quality {step.contact.quality:.3f}" if step.contact.kind == "grasp" else step.moved_by


def fit_words(count: int) -> str:
    """Return how many fits are declared, in words."""
    return f"{count} fit{'' if count == 1 else 's'} declared"


def step_tables(steps: Sequence[Step], table: Table | None) -> tuple[Table | None, ...]:
    """Return the table of each of these steps, which follow one another and begin on this table."""
    tables = []
    for step in steps:
        table = step.table or table
        tables.append(table)
    return tuple(tables)


def same_table(steps: Sequence[Step], k: int) -> tuple[Step, ...]:
    """Return the steps after number ``k`` that are done before the product is next turned over."""
    later = []
    for step in steps[k + 1 :]:
        if step.turned:
            break
        later.append(step)
    return tuple(later)


def simultaneous_steps(steps: Sequence[Step], k: int) -> tuple[Step, ...]:
    """Return the steps that happen at the same time as number ``k``, itself among them, in their order."""
    return tuple(step for step in steps if step is steps[k] or step.part in steps[k].simultaneous)


def waits(steps: Sequence[Step], k: int) -> bool:
    """Return whether step number ``k`` waits, before its insertion, for a later one that happens at the same time."""
    return any(later.part in steps[k].simultaneous for later in steps[k + 1 :])


def placed_parts(steps: tuple[Step, ...]) -> tuple[str, ...]:
    """Return the parts that these steps place one by one: those of a subassembly by the steps inside it."""
    names: list[str] = []
    for step in steps:
        names += (step.part,) if step.subassembly is None else placed_parts(step.subassembly.steps)
    return tuple(names)
