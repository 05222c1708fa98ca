"""Insertion: the removal reversed, from a pre-insertion pose just clear of the fixed parts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.geometry.body import Body, path_length
from sashimono.motion.scene import Obstacle, Scene
from sashimono.plan import Table


@dataclass(frozen=True, kw_only=True, eq=False)
class Insertion:
    """The last stretch of a part's motion."""

    poses: Float[np.ndarray, "pose 4 4"]
    """From the pre-insertion pose to the assembled pose, joined by geodesics."""
    exit_direction: Float[np.ndarray, "3"]
    """Where the part came from: unit, in the world frame."""
    T_clear: Float[np.ndarray, "4 4"]
    """Farther out than the pre-insertion pose, until nothing fixed is beside the part any more."""
    gap: float
    """Gap to the nearest fixed part in the pre-insertion pose, a lower bound [m]; infinite if there is none."""


def plan_insertion(
    body: Body,
    T_assembled: Float[np.ndarray, "4 4"],
    removal: Removal,
    fixed: Sequence[Obstacle],
    *,
    directions: Float[np.ndarray, "direction 3"],
    margin: float,
    max_checks: int,
) -> Insertion:
    """Return the insertion along the removal, as short as the margin to the fixed parts allows.

    The last leg of the removal is lengthened or shortened: from its pre-insertion pose
    on, all the way out, the part keeps the margin [m] to every fixed part.
    """
    exit_direction = removal.exit_direction
    waypoints = removal.displacements @ T_assembled
    legs = list(waypoints)
    if len(legs) > 1 and _is_straight(legs[-2], legs[-1], exit_direction, margin):
        legs.pop()  # the last leg is made anew from where it starts
    start = legs[-1]
    scene = _without_table(body, fixed, exit_direction, directions, max_checks)
    # a removal that was out before its last leg needs none of it
    least = margin if len(legs) == 1 else 0.0
    travel, gap = _shortest_travel(scene, start, exit_direction, margin, least, max_checks)
    poses = [_shifted(start, travel * exit_direction), *legs[::-1]] if travel > 0.0 else legs[::-1]
    beside = scene.exit_travel(poses[0], exit_direction, margin)
    return Insertion(
        poses=np.array(poses),
        exit_direction=exit_direction,
        T_clear=_shifted(poses[0], beside * exit_direction),
        gap=gap,
    )


def whole_insertion(
    body: Body,
    T_assembled: Float[np.ndarray, "4 4"],
    removal: Removal,
    fixed: Sequence[Obstacle],
    *,
    directions: Float[np.ndarray, "direction 3"],
) -> Insertion:
    """Return the insertion along all of the removal, neither shortened nor lengthened."""
    poses = (removal.displacements @ T_assembled)[::-1]
    scene = _without_table(body, fixed, removal.exit_direction, directions, max_checks=1)
    gap = max(0.0, float(scene.slab_gaps(poses[0])[0].min(initial=np.inf)))
    return Insertion(poses=poses, exit_direction=removal.exit_direction, T_clear=poses[0], gap=gap)


def _without_table(
    body: Body,
    fixed: Sequence[Obstacle],
    exit_direction: Float[np.ndarray, "3"],
    directions: Float[np.ndarray, "direction 3"],
    max_checks: int,
) -> Scene:
    """The part among the fixed ones only, the slabs along the way out first."""
    nowhere = Table(normal=directions[0], offset=-np.inf)
    return Scene(body, fixed, nowhere, np.vstack([exit_direction, directions]), clearance=0.0, max_checks=max_checks)


def _shortest_travel(
    scene: Scene,
    start: Float[np.ndarray, "4 4"],
    direction: Float[np.ndarray, "3"],
    margin: float,
    least: float,
    max_checks: int,
) -> tuple[float, float]:
    """Come in from far away until a fixed part is one margin away: the travel left, and the gap there [m]."""
    travel = max(scene.exit_travel(start, direction, margin), least)
    remembered = np.full(len(scene.obstacles), -np.inf)
    gap = np.inf
    for _ in range(max_checks):
        T = _shifted(start, travel * direction)
        gaps = np.maximum(scene.slab_gaps(T)[0], remembered)
        for k in np.flatnonzero(gaps < 2.0 * margin).tolist():
            gaps[k] = remembered[k] = scene.distance(T, k)
        gap = float(gaps.min(initial=np.inf))
        step = min(gap - margin, travel - least)
        if step < 0.05 * margin:
            break
        travel -= step
        remembered -= step
    else:  # the last step was taken without looking at where it led
        gap = margin
    return travel, gap


def sweep_low(body: Body, poses: Float[np.ndarray, "pose 4 4"], normal: Float[np.ndarray, "3"]) -> float:
    """Return a lower bound of the least coordinate along the normal that the part reaches on its way [m]."""
    dense, slack = densify(body, poses)
    return float(body.supports(np.array(dense), normal[None])[0].min()) - slack


def densify(body: Body, poses: Float[np.ndarray, "pose 4 4"]) -> tuple[list[Float[np.ndarray, "4 4"]], float]:
    """Return poses along the path, and how far its points may stray from the hull of two neighbours' positions [m].

    Straight legs need only their ends; a leg that turns is cut so that the stray is at most 1 % of the radius.
    """
    out, slack = [poses[0]], 0.0
    for T_a, T_b in pairwise(poses):
        twist = se3.log(se3.inverse(T_a) @ T_b)
        turn = float(np.linalg.norm(twist[3:]))
        count = 1
        if turn > 1e-9:
            allowed = 0.02 * body.radius
            count = int(np.ceil(path_length(body, T_a, T_b) / allowed))
            slack = max(slack, allowed / 2.0)
        step = se3.exp(twist / count)
        for _ in range(1, count):
            out.append(out[-1] @ step)
        out.append(T_b)
    return out, slack


def _is_straight(
    T_a: Float[np.ndarray, "4 4"], T_b: Float[np.ndarray, "4 4"], direction: Float[np.ndarray, "3"], margin: float
) -> bool:
    """Whether b is a shifted along the direction, to a small part of the margin."""
    shift = T_b[:3, 3] - T_a[:3, 3]
    along = float(shift @ direction)
    turned = np.abs(T_b[:3, :3] - T_a[:3, :3]).max() > 1e-9
    return not turned and along >= 0.0 and float(np.linalg.norm(shift - along * direction)) <= 1e-6 * (along + margin)


def _shifted(T: Float[np.ndarray, "4 4"], shift: Float[np.ndarray, "3"]) -> Float[np.ndarray, "4 4"]:
    out = T.copy()
    out[:3, 3] += shift
    return out
