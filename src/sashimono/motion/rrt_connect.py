"""RRT-Connect (Kuffner and LaValle, "RRT-Connect: An efficient approach to single-query path planning", 2000)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.motion.config import RRTConfig

Pose = Float[np.ndarray, "4 4"]


@dataclass(frozen=True, kw_only=True, eq=False)
class RRTResult:
    """What the search found, and how much work it was."""

    path: Float[np.ndarray, "pose 4 4"] | None
    """Poses from start to goal, joined by geodesics; None if the budget ran out."""
    iterations: int
    nodes: int
    """Of both trees."""
    edge_checks: int


class _Tree:
    """Poses grown from one root, in arrays that double."""

    def __init__(self, root: Pose) -> None:
        self.poses = np.empty((64, 4, 4))
        self.parents = np.empty(64, dtype=np.int64)
        self.count = 0
        self.add(root, -1)

    def add(self, T: Pose, parent: int) -> int:
        if self.count == len(self.poses):
            self.poses = np.concatenate([self.poses, np.empty_like(self.poses)])
            self.parents = np.concatenate([self.parents, np.empty_like(self.parents)])
        self.poses[self.count] = T
        self.parents[self.count] = parent
        self.count += 1
        return self.count - 1

    def branch(self, node: int) -> list[Pose]:
        """Poses from the root to this node."""
        out = []
        while node >= 0:
            out.append(self.poses[node].copy())
            node = int(self.parents[node])
        return out[::-1]


def rrt_connect(
    start: Pose,
    goal: Pose,
    *,
    edge_is_free: Callable[[Pose, Pose], bool],
    sample: Callable[[np.random.Generator], Pose],
    metric: Callable[[Pose, Float[np.ndarray, "node 4 4"]], Float[np.ndarray, "node"]],
    step: float,
    config: RRTConfig,
    rng: np.random.Generator,
) -> RRTResult:
    """Return a path from start to goal in SE(3), or None with the work done.

    Two trees grow from the two ends; each iteration extends one towards a sample by at
    most ``step`` (in the metric's unit) and then connects the other to the new node,
    extension by extension until it is reached or blocked.

    Args:
        start: First pose, taken to be free.
        goal: Last pose, taken to be free.
        edge_is_free: Whether the geodesic between two poses is free; asked both ways round.
        sample: Draws a pose.
        metric: Distance from one pose to each of several.
        step: Longest extension.
        config: Budgets.
        rng: Source of the samples.
    """
    trees = (_Tree(start), _Tree(goal))
    checks = 0

    def extend(tree: _Tree, target: Pose) -> tuple[int, bool]:
        """One extension: the new node (-1 if trapped), and whether it is the target."""
        nonlocal checks
        gaps = metric(target, tree.poses[: tree.count])
        nearest = int(np.argmin(gaps))
        gap = float(gaps[nearest])
        if gap == 0.0:
            return nearest, True
        reached = gap <= step
        T = target if reached else se3.interpolate(tree.poses[nearest], target, step / gap)
        checks += 1
        if not edge_is_free(tree.poses[nearest], T):
            return -1, False
        return tree.add(T, nearest), reached

    def finish(path: np.ndarray | None, iterations: int) -> RRTResult:
        return RRTResult(path=path, iterations=iterations, nodes=sum(t.count for t in trees), edge_checks=checks)

    for iteration in range(1, config.max_iterations + 1):
        grown, other = trees if iteration % 2 else trees[::-1]
        # the first sample of each tree is the other end: open space needs no luck
        target = other.poses[0] if iteration <= 2 else sample(rng)
        new, _ = extend(grown, target)
        if new < 0:
            continue
        met, reached = -1, False
        while not reached and sum(t.count for t in trees) < config.max_nodes:
            met, reached = extend(other, grown.poses[new])
            if met < 0:
                break
        if reached:
            ends = (grown.branch(new), other.branch(met))
            first, second = ends if iteration % 2 else ends[::-1]
            return finish(np.array(first + second[::-1][1:]), iteration)
        if sum(t.count for t in trees) >= config.max_nodes:
            return finish(None, iteration)
    return finish(None, config.max_iterations)


def pose_metric(
    center_part: Float[np.ndarray, "3"], radius: float
) -> Callable[[Pose, Float[np.ndarray, "node 4 4"]], Float[np.ndarray, "node"]]:
    """Return a metric on SE(3): distance of the part's centre plus angle times its radius [m]."""

    def metric(T: Pose, nodes: Float[np.ndarray, "node 4 4"]) -> Float[np.ndarray, "node"]:
        shift = (nodes[:, :3, :3] - T[:3, :3]) @ center_part + (nodes[:, :3, 3] - T[:3, 3])
        # |R_a - R_b| = 2 sqrt(2) sin(angle / 2) in the Frobenius norm, exact near zero
        chord = np.linalg.norm((nodes[:, :3, :3] - T[:3, :3]).reshape(-1, 9), axis=1)
        angle = 2.0 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0))
        return np.linalg.norm(shift, axis=1) + radius * angle

    return metric


def pose_sampler(
    low: Float[np.ndarray, "3"],
    high: Float[np.ndarray, "3"],
    R_box: Float[np.ndarray, "3 3"],
    center_part: Float[np.ndarray, "3"],
    start: Pose,
    goal: Pose,
    config: RRTConfig,
) -> Callable[[np.random.Generator], Pose]:
    """Return a sampler of poses with the part's centre in a box (in the frame R_box).

    Rotations are uniform with probability ``config.uniform_rotation``, else part of
    the way from the start's to the goal's.
    """
    turn = se3.log_so3(start[:3, :3].T @ goal[:3, :3])

    def sample(rng: np.random.Generator) -> Pose:
        center = R_box @ (low + rng.random(3) * (high - low))
        if rng.random() < config.uniform_rotation:
            R = _uniform_rotation(rng)
        else:
            R = start[:3, :3] @ se3.exp_so3(np.clip(1.5 * rng.random() - 0.25, 0.0, 1.0) * turn)
        return se3.make(R, center - R @ center_part)

    return sample


def _uniform_rotation(rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    w, x, y, z = (q := rng.standard_normal(4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
