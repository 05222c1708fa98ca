"""The table: which way is up, and how far below the base part it lies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.removal import Removal
from sashimono.geometry.body import Body
from sashimono.motion.config import RestingConfig, TableConfig
from sashimono.motion.resting import stable_poses

_WORLD_AXES = ((0, 0, 1), (0, 0, -1), (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0))


def choose_normal(
    base: Body,
    R_base: Float[np.ndarray, "3 3"],
    removals: Mapping[str, Removal],
    config: TableConfig,
    resting: RestingConfig,
) -> Float[np.ndarray, "3"]:
    """Return the unit normal of the table: +z of the file unless the assembly goes together better otherwise.

    Insertions from above count most, then a base part that stands stably, then
    the file's own +z. Candidates are the world axes and the base part's stable faces. ``config.up`` overrules them all.
    """
    if config.up is not None:
        return np.array(config.up, dtype=np.float64) / np.linalg.norm(config.up)
    exits = np.array([removal.exit_direction for removal in removals.values()]).reshape(-1, 3)
    standing = [pose for pose in stable_poses(base, resting) if pose.tipping_angle >= resting.min_tipping_angle]
    ups = [-(R_base @ pose.down_part) for pose in standing]
    level = np.cos(config.level_angle)
    axes = [np.array(axis, dtype=np.float64) for axis in _WORLD_AXES]
    oblique = [up for up in ups if all(float(up @ axis) < level for axis in axes)]
    best, best_score = axes[0], -np.inf
    for k, normal in enumerate([*axes, *oblique]):
        score = config.above_weight * float((exits @ normal).mean()) if len(exits) else 0.0
        score += config.standing_bonus * any(float(up @ normal) >= level for up in ups)
        score += config.upright_bonus * (k == 0)
        if score > best_score + 1e-9:
            best, best_score = normal, score
    return best


def table_offset(
    base_low: float,
    preinsertion_lows: Mapping[str, float],
    insertion_lows: Mapping[str, float],
    margins: Mapping[str, float],
) -> float:
    """Return how high the table lies along its normal [m].

    The base part stands on it, unless another part comes lower on its way in, or starts
    its insertion within its margin of the table: then the base stands in a fixture, high
    enough for the margin. A part flush with the base part's underside may end on the table.
    """
    offset = base_low
    for name, low in preinsertion_lows.items():
        offset = min(offset, low - margins[name])
    for name, low in insertion_lows.items():
        if low < base_low - 0.01 * margins[name]:
            offset = min(offset, low - margins[name])
    return offset


def frame(normal: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation whose columns are the table's x, y and normal; the identity for +z."""
    axis = int(np.argmax(np.abs(normal)))
    x = np.eye(3)[(1, 2, 0)[axis]]
    x = x - (x @ normal) * normal
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(normal, x), normal])
