"""Transit: from the lifted resting pose to the pre-insertion pose, clear of everything."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.geometry.body import Body, path_length
from sashimono.motion.config import MotionConfig
from sashimono.motion.rrt_connect import pose_metric, pose_sampler, rrt_connect
from sashimono.motion.scene import EdgeCheck, Scene
from sashimono.motion.smoothing import smooth

Pose = Float[np.ndarray, "4 4"]


@dataclass(frozen=True, kw_only=True)
class Work:
    """How much was looked at."""

    edges: int = 0
    poses: int = 0
    distances: int = 0
    """Exact mesh distances."""
    rrt_nodes: int = 0
    """0 if no tree was grown."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Transit:
    """A free path, or what stood in the way."""

    path: tuple[Pose, ...] | None
    """Poses joined by geodesics; None if none was found."""
    clearance: float
    """Clearance that was asked for [m]."""
    blocked_by: tuple[str, ...]
    """Without a path: what was met, most often first."""
    work: Work


class EdgeChecker:
    """Asks a scene about edges, and keeps count."""

    def __init__(self, scene: Scene, max_turn: float) -> None:
        self.scene = scene
        self._max_turn = max_turn
        self.edges = self.poses = self.distances = 0
        self.met: dict[str, int] = {}

    def check(self, T_a: Pose, T_b: Pose) -> EdgeCheck:
        """Return what the scene says about the geodesic from a to b."""
        result = self.scene.check_edge(T_a, T_b)
        self.edges += 1
        self.poses += result.poses
        self.distances += result.distances
        if result.blocked_by is not None:
            self.met[result.blocked_by] = self.met.get(result.blocked_by, 0) + 1
        return result

    def is_free(self, T_a: Pose, T_b: Pose) -> bool:
        """Return whether the geodesic from a to b is free and turns no more than allowed."""
        turn = np.linalg.norm(se3.log_so3(T_a[:3, :3].T @ T_b[:3, :3]))
        return bool(turn <= self._max_turn) and self.check(T_a, T_b).free


def plan_transit(
    scene: Scene,
    lifted: Pose,
    preinsertion: Pose,
    exit_direction: Float[np.ndarray, "3"],
    R_table: Float[np.ndarray, "3 3"],
    *,
    box: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]],
    config: MotionConfig,
    rng: np.random.Generator,
) -> Transit:
    """Return a path from the lifted pose to the pre-insertion pose.

    First the ways a crane would take (up, across, down, from above or from a side),
    then RRT-Connect; then the same with less clearance.

    Args:
        scene: The table and every part that stands still.
        lifted: A little above the resting pose.
        preinsertion: Where the insertion starts.
        exit_direction: Of the removal, in the world frame.
        R_table: Table frame; its last column is the normal.
        box: Corners of the box in which RRT-Connect samples the part's centre, in the table frame [m].
        config: Clearances and budgets.
        rng: Source of the samples.
    """
    body = scene.moving
    counts = Work()
    met: dict[str, int] = {}
    for share in (config.clearance, config.min_clearance):
        checker = EdgeChecker(scene.with_clearance(share * body.size), config.max_turn)
        path, nodes = None, 0
        blockers = [name for T in (lifted, preinsertion) if (name := checker.scene.blocker(T)) is not None]
        if not blockers:
            path = _first_free(checker, crane_paths(scene, lifted, preinsertion, exit_direction, R_table))
            if path is None:
                path, nodes = _rrt(checker, lifted, preinsertion, R_table, box, config, rng)
        if path is not None:
            path = smooth(
                path,
                edge_is_free=checker.is_free,
                length=lambda a, b: path_length(body, a, b),
                config=config.smoothing,
                rng=rng,
            )
        counts = Work(
            edges=counts.edges + checker.edges,
            poses=counts.poses + checker.poses,
            distances=counts.distances + checker.distances,
            rrt_nodes=counts.rrt_nodes + nodes,
        )
        if path is not None:
            return Transit(path=tuple(path), clearance=checker.scene.clearance, blocked_by=(), work=counts)
        for name, count in [*checker.met.items(), *((name, 1) for name in blockers)]:
            met[name] = met.get(name, 0) + count
    worst = tuple(sorted(met, key=lambda name: (-met[name], name)))
    return Transit(path=None, clearance=config.min_clearance * body.size, blocked_by=worst, work=counts)


def crane_paths(
    scene: Scene,
    start: Pose,
    goal: Pose,
    exit_direction: Float[np.ndarray, "3"],
    R_table: Float[np.ndarray, "3 3"],
) -> Iterator[list[Pose]]:
    """Yield paths that go up, turn, cross above everything, come down, and approach the goal in one or two moves.

    Every leg is a translation or a turn about the part's centre.
    """
    body, normal = scene.moving, R_table[:, 2]
    margin = 0.2 * body.size
    reach = body.radius + margin
    height = max(scene.top() + reach, *(float(body.center_world(T) @ normal) for T in (start, goal)))
    turned = [_at_height(body, T, normal, height) for T in _turn(body, start, goal[:3, :3])]
    sides = [R_table @ np.array([np.cos(a), np.sin(a), 0.0]) for a in np.arange(8) * (np.pi / 4.0)]
    homeward = body.center_world(start) - body.center_world(goal)
    sides.sort(key=lambda side: -round(float(side @ homeward), 9))
    out = _moved(goal, exit_direction * scene.exit_travel(goal, exit_direction, margin))
    approaches: list[list[Pose]] = [[goal], [out, goal]]
    approaches += [[_moved(goal, side * scene.exit_travel(goal, side, margin)), goal] for side in sides]
    approaches += [[_moved(out, side * scene.exit_travel(out, side, margin)), out, goal] for side in sides]
    for approach in approaches:
        above = _at_height(body, approach[0], normal, height)
        yield [start, *turned, above, *approach]


def _first_free(checker: EdgeChecker, paths: Iterator[list[Pose]]) -> list[Pose] | None:
    """The first path of which every edge is free; edges shared with an earlier one are not asked again."""
    known: dict[bytes, bool] = {}

    def is_free(T_a: Pose, T_b: Pose) -> bool:
        key = T_a.tobytes() + T_b.tobytes()
        if key not in known:
            known[key] = checker.is_free(T_a, T_b)
        return known[key]

    for path in paths:
        # the approach decides: look at it first
        if all(is_free(a, b) for a, b in reversed(list(pairwise(path)))):
            return path
    return None


def _rrt(
    checker: EdgeChecker,
    start: Pose,
    goal: Pose,
    R_table: Float[np.ndarray, "3 3"],
    box: tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]],
    config: MotionConfig,
    rng: np.random.Generator,
) -> tuple[list[Pose] | None, int]:
    body = checker.scene.moving
    result = rrt_connect(
        start,
        goal,
        edge_is_free=checker.is_free,
        sample=pose_sampler(*box, R_table, body.center, start, goal, config.rrt),
        metric=pose_metric(body.center, body.radius),
        step=config.rrt.step * body.radius,
        config=config.rrt,
        rng=rng,
    )
    return (None if result.path is None else list(result.path)), result.nodes


def _turn(body: Body, T: Pose, R_goal: Float[np.ndarray, "3 3"]) -> list[Pose]:
    """The pose, then turned about the part's centre to the goal's rotation, by at most a quarter turn at a time."""
    rotation = se3.log_so3(T[:3, :3].T @ R_goal)
    count = int(np.ceil(np.linalg.norm(rotation) / (np.pi / 2.0) - 1e-9))
    poses = [T]
    for k in range(1, count + 1):
        R = R_goal if k == count else T[:3, :3] @ se3.exp_so3(rotation * (k / count))
        poses.append(se3.make(R, body.center_world(T) - R @ body.center))
    return poses


def _at_height(body: Body, T: Pose, normal: Float[np.ndarray, "3"], height: float) -> Pose:
    return _moved(T, (height - float(body.center_world(T) @ normal)) * normal)


def _moved(T: Pose, shift: Float[np.ndarray, "3"]) -> Pose:
    out = T.copy()
    out[:3, 3] += shift
    return out
