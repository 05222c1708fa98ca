"""Use the motion planner alone: RRT-Connect moves a point past a wall, in SE(3).

python examples/05_rrt_connect.py
"""

from __future__ import annotations

import sys

import numpy as np

import sashimono


def at(x: float, y: float, z: float) -> np.ndarray:
    """Return a pose without a turn."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def is_free(T_a: np.ndarray, T_b: np.ndarray) -> bool:
    """Return whether the straight way between two poses stays clear of a wall at x = 0 with a hole in it."""
    ways = np.linspace(0.0, 1.0, 50)[:, None]
    points = (1.0 - ways) * T_a[:3, 3] + ways * T_b[:3, 3]
    in_wall = np.abs(points[:, 0]) < 0.05
    in_hole = np.linalg.norm(points[:, 1:] - (0.5, 0.5), axis=1) < 0.2
    return bool(np.all(~in_wall | in_hole))


found = sashimono.rrt_connect(
    at(-0.5, 0.0, 0.0),
    at(0.5, 0.0, 0.0),
    edge_is_free=is_free,
    sample=lambda rng: at(*rng.uniform(-1.0, 1.0, 3)),
    metric=lambda T, several: np.linalg.norm(several[:, :3, 3] - T[:3, 3], axis=1),
    step=0.2,
    config=sashimono.RRTConfig(),
    rng=np.random.default_rng(0),
)
if found.path is None:
    sys.exit(f"no path after {found.iterations} iterations")
length = np.linalg.norm(np.diff(found.path[:, :3, 3], axis=0), axis=1).sum()
sys.stdout.write(f"a path of {len(found.path)} poses, {length:.2f} m long, after {found.iterations} iterations\n")
