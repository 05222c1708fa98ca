"""When each pose of a plan is reached; the HTML viewer and the GLB share it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part, frozen_array
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan
from sashimono.view.config import ViewConfig
from sashimono.view.playback import PlayedStep


@dataclass(frozen=True, kw_only=True, eq=False)
class StepTiming:
    """Times of one step [s], counted from the start of the whole animation."""

    start: float
    stop: float
    pose_times: Float[np.ndarray, "pose"]
    """When each pose of the motion is reached, increasing."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose_times", frozen_array(self.pose_times, np.float64))


@dataclass(frozen=True, kw_only=True)
class Timeline:
    """Times of all played steps, one after the other."""

    steps: tuple[StepTiming, ...]
    duration: float
    """When the last step ends [s]."""


def bounds_at(part: Part, T_world_part: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "2 3"]:
    """Return lower and upper corner of the part's axis-aligned box at that pose [m]."""
    vertices = se3.apply(T_world_part, part.vertices_part)
    return np.array([vertices.min(axis=0), vertices.max(axis=0)])


def scene_diagonal(plan: AssemblyPlan, assembly: Assembly) -> float:
    """Return the diagonal of the box around all parts, assembled and resting [m]."""
    boxes = [bounds_at(part, plan.parts[part.name]) for part in assembly.parts]
    boxes += [
        bounds_at(assembly.part(name), step.member_poses(name, plan.parts)[0])
        for step in plan.steps
        for name in step.members
    ]
    corners = np.concatenate(boxes)
    return max(float(np.linalg.norm(corners.max(axis=0) - corners.min(axis=0))), 1e-9)


def path_lengths(poses: Float[np.ndarray, "pose 4 4"], part: Part) -> Float[np.ndarray, "interval"]:
    """Return the length of each interval between poses [m].

    A length is the travel of the part's centre plus its turn [rad] times the part's radius.
    """
    lower, upper = part.vertices_part.min(axis=0), part.vertices_part.max(axis=0)
    radius = 0.5 * float(np.linalg.norm(upper - lower))
    centres = poses[:, :3, :3] @ (0.5 * (lower + upper)) + poses[:, :3, 3]
    turns = [float(np.linalg.norm(se3.log_so3(a[:3, :3].T @ b[:3, :3]))) for a, b in pairwise(poses)]
    return np.linalg.norm(np.diff(centres, axis=0), axis=1) + radius * np.array(turns).reshape(-1)


def _move_seconds(played: PlayedStep, part: Part, speed: float, config: ViewConfig) -> Float[np.ndarray, "interval"]:
    seconds = path_lengths(played.poses, part) / speed
    for segment in played.segments:
        if segment.kind == "insertion":
            seconds[segment.start : segment.stop] *= config.insertion_slowdown
    total = float(seconds.sum())
    if total <= 0.0:
        return np.full(len(seconds), config.min_move_seconds / len(seconds))
    # keyframe times must increase, also where a pose is given twice
    seconds = np.maximum(seconds, 1e-4 * total)
    return seconds * max(1.0, config.min_move_seconds / float(seconds.sum()))


def make_timeline(plan: AssemblyPlan, played: Sequence[PlayedStep], assembly: Assembly, config: ViewConfig) -> Timeline:
    """Return the times of every step: proportional to path length, insertions slower, a hold before and after."""
    speed = scene_diagonal(plan, assembly) / config.traverse_seconds
    clock = 0.0
    steps: list[StepTiming] = []
    for k, entry in enumerate(played):
        start = clock
        if len(entry.poses) == 1:
            clock += config.base_seconds
            pose_times = np.array([start])
        else:
            seconds = _move_seconds(entry, assembly.part(entry.step.part), speed, config)
            pose_times = start + config.hold_seconds + np.concatenate([[0.0], np.cumsum(seconds)])
            # what waits goes in with the last of its kind: its own last two times are set then
            clock = float(pose_times[-3 if entry.waits else -1]) + config.hold_seconds
        steps.append(StepTiming(start=start, stop=clock, pose_times=pose_times))
        if entry.step.simultaneous and not entry.waits:
            for j, other in enumerate(played[:k]):
                if other.waits and other.step.part in entry.step.simultaneous:
                    times = np.concatenate([steps[j].pose_times[:-2], pose_times[-2:]])
                    steps[j] = replace(steps[j], stop=clock, pose_times=times)
    return Timeline(steps=tuple(steps), duration=max(clock, config.base_seconds))


def tracks(
    played: Sequence[PlayedStep], timeline: Timeline, plan: AssemblyPlan
) -> dict[str, tuple[Float[np.ndarray, "pose 4 4"], Float[np.ndarray, "pose"]]]:
    """Return, for each part that a step brings, all poses in which it is shown and when.

    A member of a subassembly goes on where its own step has left it.
    """
    found: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for entry, timing in zip(played, timeline.steps, strict=True):
        for name in entry.step.members:
            found.setdefault(name, []).append((entry.member_poses(name, plan.parts), timing.pose_times))
    return {
        name: (np.concatenate([poses for poses, _ in pieces]), np.concatenate([times for _, times in pieces]))
        for name, pieces in found.items()
    }
