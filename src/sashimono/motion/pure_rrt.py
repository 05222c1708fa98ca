"""The paper's own level 2: RRT-Connect all the way from the resting to the assembled pose. A baseline."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import path_length
from sashimono.motion.config import MotionConfig
from sashimono.motion.scene import Scene
from sashimono.plan import Table

Pose = Float[np.ndarray, "4 4"]


class TolerantScene:
    """The same obstacles, where a fixed part may be entered as deep as in the assembled pose, plus a tolerance.

    Edges are checked at steps of a bounded point displacement, as is usual for
    RRT-Connect; nothing is certified between them.
    """

    def __init__(self, scene: Scene, T_assembled: Pose, fixed: Sequence[str], config: MotionConfig) -> None:
        self._scene = scene
        self._table: Table = scene.table
        self._step = config.max_displacement * scene.moving.radius
        self._max_checks = config.max_edge_checks
        self.tolerance = 0.0
        """Depth allowed beyond a pair's overlap in the assembled pose, the greatest of all pairs [m]."""
        self._allowed = np.zeros(len(scene.obstacles))
        for k, obstacle in enumerate(scene.obstacles):
            if obstacle.body.name in fixed:
                smaller = min(scene.moving.extents[0], obstacle.body.extents[0])
                self._allowed[k] = self.depth(T_assembled, k) + config.penetration_tolerance * smaller
                self.tolerance = max(self.tolerance, config.penetration_tolerance * smaller)

    def depth(self, T: Pose, k: int) -> float:
        """Return how deep the moving part and obstacle k lie in each other, by surface samples of both [m]."""
        moving, obstacle = self._scene.moving, self._scene.obstacles[k]
        T_obstacle_moving = se3.inverse(obstacle.T_world_part) @ T
        return max(
            obstacle.body.depth(moving, T_obstacle_moving),
            moving.depth(obstacle.body, se3.inverse(T_obstacle_moving)),
        )

    def pose_is_free(self, T: Pose) -> bool:
        """Return whether no obstacle is entered deeper than allowed, nor the table at all."""
        gaps, table_gap = self._scene.slab_gaps(T)
        if table_gap < 0.0:
            return False
        for k in np.flatnonzero(gaps <= 0.0).tolist():
            if self._scene.collides(T, k) and (self._allowed[k] == 0.0 or self.depth(T, k) > self._allowed[k]):
                return False
        return True

    def edge_is_free(self, T_a: Pose, T_b: Pose) -> bool:
        """Return whether poses along the geodesic, both ends included, are free."""
        count = int(np.ceil(path_length(self._scene.moving, T_a, T_b) / self._step))
        if count > self._max_checks:
            return False
        return all(self.pose_is_free(se3.interpolate(T_a, T_b, u)) for u in np.linspace(0.0, 1.0, count + 1))

    def max_penetration(self, poses: Sequence[Pose]) -> float:
        """Return the greatest depth in any obstacle at these poses [m]."""
        return max((self.depth(T, k) for T in poses for k in range(len(self._scene.obstacles))), default=0.0)
