"""The exploded view: every part drawn back along its insertion until it is clear of what is there before it."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.plan import AssemblyPlan, Step
from sashimono.view.config import ViewConfig
from sashimono.view.timeline import bounds_at


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


def explosion_offsets(plan: AssemblyPlan, assembly: Assembly, config: ViewConfig) -> dict[str, Float[np.ndarray, "3"]]:
    """Return how far each part is displaced in the full exploded view [m]; zero for the base and unsolved parts.

    The parts of a subassembly stay together.
    """
    boxes = {part.name: bounds_at(part, plan.parts[part.name]) for part in assembly.parts}
    corners = np.concatenate(list(boxes.values()))
    lower, upper = corners.min(axis=0), corners.max(axis=0)
    gap = config.explode_gap * float(np.linalg.norm(upper - lower))
    offsets = {part.name: np.zeros(3) for part in assembly.parts}
    moved = {name for step in plan.steps if len(step.motion.T_world_part) > 1 for name in step.members}
    placed = [boxes[name] for name in assembly.names if name not in moved]
    for step in plan.steps:
        if step.part not in moved:
            continue
        box = _common([boxes[name] for name in step.members])
        direction = _withdrawal(step, box.mean(axis=0) - 0.5 * (lower + upper))
        if placed:
            # parts keep a gap along the way only, so that neighbours side by side stay level
            along = gap * np.abs(direction)
            others = np.array(placed) + np.array([-along, along])
            shrunk = box + np.array([[1.0], [-1.0]]) * 0.01 * (box[1] - box[0])
            offsets |= dict.fromkeys(step.members, direction * _clearing_travel(shrunk, direction, others))
        placed.append(box + offsets[step.part])
    return offsets
