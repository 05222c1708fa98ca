"""Ferrari-Canny quality: the radius of the largest origin-centred ball in the hull of the contact wrenches.

Ferrari & Canny, "Planning optimal grasps" (1992), L1 metric: the hull of the union of all contacts' unit
wrenches. Origin of torques: the centre of mass; torques are divided by the part's radius.
"""

from __future__ import annotations

import itertools

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sashimono.contact.wrenches import unit_across

_RANK_TOLERANCE = 1e-9


def ferrari_canny(wrenches: Float[np.ndarray, "wrench 6"]) -> float:
    """Return the quality of the grasp whose extreme wrenches these are; 0 if it cannot resist every wrench.

    Two hard contacts span only five dimensions (nothing resists torque about the line between them), so
    their quality is always 0.
    """
    singular = np.linalg.svd(wrenches - wrenches.mean(axis=0), compute_uv=False)
    if len(singular) < 6 or singular[-1] <= _RANK_TOLERANCE * singular[0]:
        return 0.0
    try:
        hull = ConvexHull(wrenches)
    except QhullError:  # flat within Qhull's own tolerance
        return 0.0
    return max(0.0, float(-hull.equations[:, -1].max()))


def quality_bound(
    wrenches: Float[np.ndarray, "grasp wrench 6"],
    lines: Float[np.ndarray, "grasp 3"],
    arms: Float[np.ndarray, "grasp 3"],
) -> Float[np.ndarray, "grasp"]:
    """Return an upper bound of the quality of many two-finger grasps at once.

    The ball's radius is the least support of the hull over all directions of wrench space; this is the least
    over a fixed set of them. The set lies in a frame of the grasp itself, with x along the line between its
    contacts (``lines``, unit) and the origin midway, at ``arms`` (over the radius) from the origin of
    torques: there the weak directions are nearly pure torques.
    """
    y = unit_across(lines)
    frames = np.stack([lines, y, np.cross(lines, y)], axis=1)
    probes = _probe_directions()
    force, torque = probes[:, :3] @ frames, probes[:, 3:] @ frames
    directions = np.concatenate([force - np.cross(torque, arms[:, None]), torque], axis=2)
    support = (wrenches @ directions.transpose(0, 2, 1)).max(axis=1)
    return np.maximum((support / np.linalg.norm(directions, axis=2)).min(axis=1), 0.0)


def _probe_directions() -> Float[np.ndarray, "direction 6"]:
    """The axes of wrench space and mixtures of two of them at several ratios, all signs."""
    axes = np.eye(6)
    rows = [sign * axis for axis in axes for sign in (1.0, -1.0)]
    for a, b in itertools.permutations(range(6), 2):
        for ratio, first, second in itertools.product((0.03, 0.1, 0.3, 1.0), (1.0, -1.0), (1.0, -1.0)):
            if ratio < 1.0 or a < b:
                rows.append(first * axes[a] + second * ratio * axes[b])
    return np.array(rows)
