"""Does the gripper touch anything? Its boxes against the bodies around and the table."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import fcl
import numpy as np
from jaxtyping import Float

from sashimono.contact.gripper import Boxes
from sashimono.geometry.body import Body
from sashimono.geometry.distance.collision import FCL_UNITS
from sashimono.motion.scene import Obstacle
from sashimono.plan import Table

TABLE = "the table"


class Surroundings:
    """Everything that the gripper may hit in one step. Moves the colliders of the bodies: one at a time."""

    def __init__(self, obstacles: Sequence[Obstacle], table: Table | None) -> None:
        self._obstacles = tuple(obstacles)
        self._table = table
        boxes = np.empty((len(self._obstacles), 2, 3))
        for k, obstacle in enumerate(self._obstacles):
            boxes[k] = obstacle.body.support(obstacle.T_world_part, np.eye(3))
            obstacle.body.move(obstacle.T_world_part)
        self._low, self._high = boxes[:, 0], boxes[:, 1]
        self._request = fcl.CollisionRequest()

    def first_hit(self, boxes: Boxes, T_world_gripper: Float[np.ndarray, "pose 4 4"]) -> str | None:
        """Return the name of a body that the gripper touches at one of the poses, or None if it is free in all."""
        return next((name for _, name in self._each_hit(boxes, T_world_gripper)), None)

    def hits(self, boxes: Boxes, T_world_gripper: Float[np.ndarray, "pose 4 4"]) -> dict[int, str]:
        """Return, for each pose at which the gripper is not free, the name of a body that it touches there."""
        return dict(self._each_hit(boxes, T_world_gripper))

    def _each_hit(self, boxes: Boxes, T_world_gripper: Float[np.ndarray, "pose 4 4"]) -> Iterator[tuple[int, str]]:
        """Yield (pose, name), one for each pose that is not free.

        The boxes must hang together, the last one being the palm: a gripper that crosses no surface
        of a body lies wholly inside it or wholly outside, and the palm's centre tells.
        """
        R, p = T_world_gripper[:, :3, :3], T_world_gripper[:, :3, 3]
        middle, half = (boxes.low + boxes.high) / 2.0, (boxes.high - boxes.low) / 2.0
        centers = middle @ R.transpose(0, 2, 1) + p[:, None]
        done = np.zeros(len(R), dtype=np.bool_)
        if self._table is not None:
            normal = self._table.normal
            drop = np.abs(normal @ R) @ half.T
            # the slack is rounding: a box may stand on the table
            done |= (centers @ normal - drop < self._table.offset - 1e-6 * float(half.max())).any(axis=1)
            yield from ((int(pose), TABLE) for pose in np.flatnonzero(done))
        if not self._obstacles:
            return
        halves = half @ np.abs(R).transpose(0, 2, 1)
        low, high = (centers - halves)[:, :, None], (centers + halves)[:, :, None]
        near = ((low <= self._high) & (high >= self._low)).all(axis=3) & ~done[:, None, None]
        shapes: dict[tuple[int, float], fcl.CollisionObject] = {}
        finished = -1
        for pose, box, k in np.argwhere(near).tolist():
            if pose == finished:
                continue
            body = self._obstacles[k].body
            shape = shapes.get((box, FCL_UNITS))
            if shape is None:
                shape = fcl.CollisionObject(fcl.Box(*(2.0 * FCL_UNITS * half[box]).tolist()))
                shapes[box, FCL_UNITS] = shape
            shape.setTransform(fcl.Transform(np.ascontiguousarray(R[pose]), FCL_UNITS * centers[pose, box]))
            if self._crosses(shape, body) or (box == len(half) - 1 and self._inside(k, centers[pose, box])):
                finished = pose
                yield pose, body.name

    def _crosses(self, shape: fcl.CollisionObject, body: Body) -> bool:
        return fcl.collide(shape, body.collider.fcl_object, self._request, fcl.CollisionResult()) > 0

    def _inside(self, k: int, point: Float[np.ndarray, "3"]) -> bool:
        body, T = self._obstacles[k].body, self._obstacles[k].T_world_part
        return body.signed_distance.contains((point - T[:3, 3]) @ T[:3, :3])
