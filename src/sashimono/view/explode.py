"""The exploded view: every part drawn back along its insertion, on the axis of what it sits on, the last ones first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, frozen_array
from sashimono.geometry import se3
from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.mesh.measures import sample_surface
from sashimono.plan import AssemblyPlan, Step
from sashimono.view.config import ViewConfig
from sashimono.view.timeline import bounds_at

_SAMPLES = 600
"""Surface points of a part by which it is seen what it sits on."""
_AHEAD = 0.5
"""Least cosine between a surface's normal and the way in for the surface to face forward."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Pull:
    """One displacement of the exploded view. A part that sits on another makes the other's pulls before its own."""

    turn: int
    """Place of the step among all steps as they are played: the last ones are drawn out first."""
    vector: Float[np.ndarray, "3"]
    """At its end, world frame [m]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "vector", frozen_array(self.vector, np.float64))


@dataclass(frozen=True, kw_only=True, eq=False)
class Explosion:
    """Of each part: by which pulls it is displaced, and on which part it sits."""

    pulls: Mapping[str, tuple[Pull, ...]]
    """The pulls of what the part sits on, then its own, then those inside its subassembly; none of what stays."""
    seats: Mapping[str, str]
    """The part on whose axis a part stays, for those that sit on one."""

    def offset(self, name: str) -> Float[np.ndarray, "3"]:
        """Return the part's displacement in the full exploded view [m]."""
        return sum((pull.vector for pull in self.pulls[name]), np.zeros(3))


def explode(plan: AssemblyPlan, assembly: Assembly, config: ViewConfig) -> Explosion:
    """Return how the parts are drawn apart.

    A part goes back along its insertion until it is clear of the boxes of all that is there before it, a gap between;
    the boxes have an edge along that way, as those of the world's axes are too large about a part that is turned. It
    starts from where the part that it sits on is drawn, so that a screw stays on the axis of its hole wherever the
    plate is. What it sits on is what it meets with most of its forward faces, else with most of its surface.
    Subassemblies go as one, and are drawn apart in themselves too.
    """
    boxes = {part.name: bounds_at(part, plan.parts[part.name]) for part in assembly.parts}
    corners = np.concatenate(list(boxes.values()))
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    work = _Work(
        surfaces=_Surfaces(plan, assembly, boxes),
        gap=config.explode_gap * float(np.linalg.norm(upper - lower)),
        center=0.5 * (lower + upper),
    )
    moved = {name for step in plan.steps if step.moves for name in step.members}
    work.explode(plan.steps, [name for name in assembly.names if name not in moved])
    pulls = {name: tuple(work.pulls.get(name, ())) for name in assembly.names}
    return Explosion(pulls=pulls, seats=work.seats)


def explosion_offsets(plan: AssemblyPlan, assembly: Assembly, config: ViewConfig) -> dict[str, Float[np.ndarray, "3"]]:
    """Return how far each part is displaced in the full exploded view [m]; zero for the base and unsolved parts."""
    found = explode(plan, assembly, config)
    return {name: found.offset(name) for name in assembly.names}


@dataclass(kw_only=True, eq=False)
class _Work:
    """What has been drawn apart so far."""

    surfaces: _Surfaces
    gap: float
    center: Float[np.ndarray, "3"]
    pulls: dict[str, list[Pull]] = field(default_factory=dict)
    seats: dict[str, str] = field(default_factory=dict)
    turn: int = 0

    def explode(self, steps: Sequence[Step], there: Iterable[str]) -> None:
        """Draw the steps of one level apart, insides first; ``there`` are parts that stay in place."""
        placed = list(there)
        for step in steps:
            if step.subassembly is not None:
                self.explode(step.subassembly.steps, ())
            turn, self.turn = self.turn, self.turn + 1
            if step.moves:
                self._draw_back(step, turn, placed)
            placed += [name for name in step.members if name not in placed]

    def _drawn(self, name: str, R: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "2 3"]:
        return self.surfaces.bounds(name, R) + R @ sum((pull.vector for pull in self.pulls.get(name, ())), np.zeros(3))

    def _draw_back(self, step: Step, turn: int, placed: Sequence[str]) -> None:
        middle = _common([self._drawn(name, np.eye(3)) for name in step.members]).mean(axis=0)
        direction = _withdrawal(step, middle - self.center)
        R = _frame(direction)
        box = _common([self._drawn(name, R) for name in step.members])
        seat = self.surfaces.seat(step.members, placed, direction)
        before = list(self.pulls.get(seat, ())) if seat is not None else []
        travel = 0.0
        if placed:
            # parts keep a gap along the way only, so that neighbours side by side stay level
            ahead = R @ direction
            along = self.gap * np.abs(ahead)
            others = np.array([self._drawn(name, R) for name in placed]) + np.array([-along, along])
            start = box + R @ sum((pull.vector for pull in before), np.zeros(3))
            shrunk = start + np.array([[1.0], [-1.0]]) * 0.01 * (box[1] - box[0])
            # a part that slides off sideways is clear of all boxes at once: it moves by its own length all the same
            length = float(np.abs(ahead) @ (box[1] - box[0]))
            travel = max(_clearing_travel(shrunk, ahead, others), length + self.gap)
        own = Pull(turn=turn, vector=travel * direction)
        for name in step.members:
            self.pulls[name] = [*before, own, *self.pulls.get(name, ())]
            if seat is not None:
                self.seats.setdefault(name, seat)


class _Surfaces:
    """Which part another one sits on, by points of its surface."""

    def __init__(self, plan: AssemblyPlan, assembly: Assembly, boxes: Mapping[str, Float[np.ndarray, "2 3"]]) -> None:
        self._boxes = boxes
        self._meshes = {
            part.name: (se3.apply(plan.parts[part.name], part.vertices_part), part.faces) for part in assembly.parts
        }
        self._bounds: dict[tuple[str, bytes], np.ndarray] = {}
        self._distances: dict[str, SignedDistance] = {}
        self._samples: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    def bounds(self, name: str, R: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "2 3"]:
        """Return the box about a part as it is assembled, its edges along the rows of ``R``."""
        key = name, R.tobytes()
        if key not in self._bounds:
            points = self._meshes[name][0] @ R.T
            self._bounds[key] = np.array([points.min(axis=0), points.max(axis=0)])
        return self._bounds[key]

    def seat(self, names: Sequence[str], placed: Sequence[str], away: Float[np.ndarray, "3"]) -> str | None:
        """Return the placed part that these sit on, which leave in direction ``away``; None if they touch none."""
        best, most = None, 0.0
        for other in placed:
            score = sum(self._contact(name, other, away) for name in names)
            if score > most:
                best, most = other, score
        return best

    def _contact(self, name: str, other: str, away: Float[np.ndarray, "3"]) -> float:
        """Share of the part's surface that lies on the other; a share that faces forward counts a hundredfold."""
        a, b = self._boxes[name], self._boxes[other]
        slack = 0.05 * float(min(np.ptp(a, axis=0).min(), np.ptp(b, axis=0).min()))
        low, high = np.maximum(a[0], b[0]) - slack, np.minimum(a[1], b[1]) + slack
        if (low > high).any():
            return 0.0
        points, normals = self._points(name)
        near = ((points >= low) & (points <= high)).all(axis=1)
        if not near.any():
            return 0.0
        if other not in self._distances:
            self._distances[other] = SignedDistance(*self._meshes[other])
        # farther than what is asked about it is infinite
        distance, _ = self._distances[other].normals(points[near], 1.01 * slack)
        on = np.abs(distance) <= slack
        forward = on & (normals[near] @ away < -_AHEAD)
        return (100.0 * float(forward.sum()) + float(on.sum())) / len(points)

    def _points(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        if name not in self._samples:
            # the same points each time: nothing here may change from run to run
            points, normals, _ = sample_surface(*self._meshes[name], _SAMPLES, np.random.default_rng(0))
            self._samples[name] = points, normals
        return self._samples[name]


def _withdrawal(step: Step, away: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Return the unit direction in which the part leaves: back along its last insertion, else ``away``."""
    poses = step.motion.T_world_part
    insertions = [segment for segment in step.motion.segments if segment.kind == "insertion"]
    start = insertions[-1].start if insertions else 0
    for direction in (poses[start, :3, 3] - poses[-1, :3, 3], away, np.array([0.0, 0.0, 1.0])):
        length = float(np.linalg.norm(direction))
        if length > 1e-9:
            return direction / length
    raise AssertionError("the last direction has unit length")


def _frame(direction: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rows of a frame with an edge along a direction; the world's, where the direction is one of its axes.

    The axis of the world that is most across the direction decides the others.
    """
    if np.abs(direction).max() > 1.0 - 1e-9:
        return np.eye(3)
    across = np.eye(3)[int(np.argmin(np.abs(direction)))]
    across = across - (across @ direction) * direction
    across /= np.linalg.norm(across)
    return np.array([direction, across, np.cross(direction, across)])


def _clearing_travel(
    box: Float[np.ndarray, "2 3"], direction: Float[np.ndarray, "3"], others: Float[np.ndarray, "other 2 3"]
) -> float:
    """Return the shortest travel along ``direction`` after which the box meets none of the others ever again [m]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        to_touch = (others[:, 0] - box[1]) / direction
        to_leave = (others[:, 1] - box[0]) / direction
    apart = (others[:, 0] >= box[1]) | (others[:, 1] <= box[0])
    still = np.abs(direction) < 1e-12
    enter = np.where(still, np.where(apart, np.inf, -np.inf), np.minimum(to_touch, to_leave)).max(axis=1)
    leave = np.where(still, np.where(apart, -np.inf, np.inf), np.maximum(to_touch, to_leave)).min(axis=1)
    meets = leave > np.maximum(enter, 0.0)
    return float(leave[meets].max()) if meets.any() else 0.0


def _common(boxes: list[Float[np.ndarray, "2 3"]]) -> Float[np.ndarray, "2 3"]:
    corners = np.array(boxes)
    return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
