"""The workspace on the table: a work area that stays free, and the parts resting beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.motion.config import MotionConfig
from sashimono.motion.insertion import Insertion, densify
from sashimono.motion.resting import StablePose, resting_rotation, stable_at
from sashimono.motion.tray import lay_out
from sashimono.plan import Table


@dataclass(frozen=True, kw_only=True, eq=False)
class Rest:
    """Where the parts wait."""

    poses: Mapping[str, Float[np.ndarray, "4 4"]]
    """Resting pose ``T_world_part`` of each part."""
    stable: Mapping[str, StablePose]
    """The face it stands on."""
    box_low: Float[np.ndarray, "3"]
    """Lower corner of a box around everything, in the table frame [m]."""
    box_high: Float[np.ndarray, "3"]
    """Upper corner."""


def rest_parts(
    names: Sequence[str],
    bodies: Mapping[str, Body],
    assembled: Mapping[str, Float[np.ndarray, "4 4"]],
    insertions: Mapping[str, Insertion],
    table: Table,
    R_table: Float[np.ndarray, "3 3"],
    config: MotionConfig,
    given: Mapping[str, Float[np.ndarray, "4 4"]] | None = None,
) -> Rest:
    """Return resting poses for these parts, in tray order, clear of the assembly and of what is inserted low.

    Args:
        names: Parts to lay out.
        bodies: Geometry of every part in the scene.
        assembled: Assembled poses of every part in the scene.
        insertions: Last stretches of the motions known.
        table: Plane to stand on.
        R_table: Its frame; the last column is the normal.
        config: Options.
        given: Resting poses from elsewhere, taken as they are; the others are laid out clear of them.
    """
    given = {} if given is None else {name: given[name] for name in names if name in given}
    stable = {name: stable_at(bodies[name], T[:3, :3], table.normal) for name, T in given.items()}
    placed = [np.array(bodies[name].support(T, R_table.T)) for name, T in given.items()]
    waiting = [name for name in names if name not in given]
    rotations, boxes = {}, {}
    for name in waiting:
        rotations[name], stable[name] = resting_rotation(
            bodies[name], assembled[name][:3, :3], table.normal, config.resting
        )
        boxes[name] = np.array(bodies[name].support(se3.make(rotations[name]), R_table.T))
    tops = [box[1, 2] - box[0, 2] + config.lift * bodies[name].size for name, box in boxes.items()]
    swept = _swept_boxes(bodies, assembled, insertions, R_table)
    reached = swept[:, 0, 2] < table.offset + max(tops, default=0.0)
    low_ones = swept[reached] if reached.any() else swept
    low, high = low_ones[:, 0, :2].min(axis=0), low_ones[:, 1, :2].max(axis=0)
    border = config.tray.work_margin * float((high - low).max())
    for box in placed:
        low, high = np.minimum(low, box[0, :2]), np.maximum(high, box[1, :2])
    borders = np.array([config.tray.gap * bodies[name].size for name in waiting])
    sides = np.array([boxes[name][1, :2] - boxes[name][0, :2] for name in waiting]).reshape(-1, 2)
    middles = lay_out(sides + 2.0 * borders[:, None], low - border, high + border, config.tray)
    poses = dict(given)
    for name, middle in zip(waiting, middles, strict=True):
        box = boxes[name]
        shift = np.append(middle - (box[0, :2] + box[1, :2]) / 2.0, table.offset - box[0, 2])
        poses[name] = se3.make(rotations[name], R_table @ shift)
    corners = [swept[:, 0].min(axis=0), swept[:, 1].max(axis=0)]
    for name in names:
        corners.extend(bodies[name].support(poses[name], R_table.T))
    return Rest(poses=poses, stable=stable, box_low=np.min(corners, axis=0), box_high=np.max(corners, axis=0))


def _swept_boxes(
    bodies: Mapping[str, Body],
    assembled: Mapping[str, Float[np.ndarray, "4 4"]],
    insertions: Mapping[str, Insertion],
    R_table: Float[np.ndarray, "3 3"],
) -> Float[np.ndarray, "leg 2 3"]:
    """Boxes, in the table frame, around each assembled part and each leg of each insertion."""
    boxes = [np.array(bodies[name].support(T, R_table.T)) for name, T in assembled.items()]
    for name, insertion in insertions.items():
        dense, slack = densify(bodies[name], np.concatenate([insertion.T_clear[None], insertion.poses]))
        low, high = bodies[name].supports(np.array(dense), R_table.T)
        low, high = np.minimum(low[:-1], low[1:]) - slack, np.maximum(high[:-1], high[1:]) + slack
        boxes.extend(np.stack([low, high], axis=1))
    return np.array(boxes)
