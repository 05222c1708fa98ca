"""Where on a turn to try an exit: at the angles at which faces of the part come parallel to faces of an obstacle."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.paths import Paths

_SAME = np.radians(0.1)
"""Angles nearer than this are one."""


def alignments(
    paths: Paths, D: Float[np.ndarray, "4 4"], twist: Float[np.ndarray, "6"], *, most: int
) -> Float[np.ndarray, "u"]:
    """Return the u in (0, 1), ascending, at which lines of the part, turned on from D along the spatial twist, are
    parallel to lines of the others; heaviest lines first, if there are more than ``most``.

    A lug passes a slot that it fits where their sides are parallel. Lines within 5 degrees of the plane across the
    axis count; a turn by half brings them back.
    """
    turn = float(np.linalg.norm(twist[3:]))
    axis = twist[3:] / turn
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    across = np.array([first, np.cross(axis, first)])
    own = _angles(paths.parts.part_lines[paths.part] @ D[:3, :3].T, axis, across)
    theirs = [_angles(paths.parts.part_lines[k], axis, across) for k in paths.near(D, twist=twist)]
    if not theirs:
        return np.zeros(0)
    needed = (np.concatenate(theirs)[:, None] - own[None, :]) % np.pi
    # by the weight of both lines: those come first that are first in their lists
    rank = np.concatenate([np.arange(len(t)) for t in theirs])[:, None] + np.arange(len(own))[None, :]
    found: list[float] = []
    for angle in needed.ravel()[np.argsort(rank.ravel(), kind="stable")]:
        if _SAME < angle < turn - _SAME and len(found) < most and all(abs(angle - k) > _SAME for k in found):
            found.append(float(angle))
    return np.sort(found) / turn


def _angles(
    lines: Float[np.ndarray, "line 3"], axis: Float[np.ndarray, "3"], across: Float[np.ndarray, "2 3"]
) -> Float[np.ndarray, "_"]:
    flat = lines[np.abs(lines @ axis) < np.sin(np.radians(5.0))] @ across.T
    return np.arctan2(flat[:, 1], flat[:, 0])
