"""Is there room for the tool that a step names, where it says so?

The space is taken from the plan and filled with points; none of them may be inside a part that is in place. So that a
plan cannot make its tool too small, the space must be as wide as the tool's own width says, and long enough for a hand.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import Step, ToolSpace
from sashimono.verify.body import SampledBody

_LEAST_REACH = 0.025
"""A tool reaches at least so far from its screw [m]."""
_INSIDE = 0.96
"""Points lie within this share of a space's radius: what only touches is not in the way."""
_TURNS, _RINGS, _LEVELS = 24, 4, 40


def tool_problems(
    step: Step, bodies: Mapping[str, SampledBody], poses: Mapping[str, Float[np.ndarray, "4 4"]]
) -> list[str]:
    """Return what is wrong with a step's word that its tool has access; nothing where it does not say so.

    Args:
        step: The step.
        bodies: By part.
        poses: Assembled pose of each part.
    """
    tool, fastener = step.tool, step.fastener
    if tool is None:
        return []
    if fastener is None:
        return [f"it names {tool.name}, but no fastener that it drives"]
    if not tool.access:
        return []
    axis, point = np.array(fastener.axis), np.array(fastener.point)
    if not np.isfinite([*axis, *point]).all() or abs(np.linalg.norm(axis) - 1.0) > 1e-6:
        return ["the axis of its fastener is not a unit vector"]
    for space in tool.space:
        if not (np.isfinite([space.low, space.high, space.radius]).all() and space.high > space.low):
            return ["the space of its tool is none"]
    narrow = tool.size is not None and any(2.0 * space.radius < tool.size for space in tool.space)
    reach = max(max(space.high - space.low, 0.0 if space.toward is None else space.radius) for space in tool.space)
    if narrow or reach < _LEAST_REACH:
        return [f"the space that it takes {tool.name} to need is too small for that tool"]
    # a nut turns around its bolt, which is in the middle of the tool
    hollow = tool.size / 2.0 if fastener.kind == "nut" and tool.size is not None else 0.0
    points = np.concatenate([_points(space, axis, point, hollow) for space in tool.space])
    for name in step.fixed:
        local = se3.apply(se3.inverse(poses[name]), points)
        near = local[bodies[name].box_distance(local) <= 0.0]
        if len(near) and bool((bodies[name].distance(near) < 0.0).any()):
            return [f"{name!r} is in the way of {tool.name}, though the step says that it has access"]
    return []


def _points(
    space: ToolSpace, axis: Float[np.ndarray, "3"], point: Float[np.ndarray, "3"], hollow: float
) -> Float[np.ndarray, "n 3"]:
    """Points that fill a space, world frame."""
    if space.toward is None or space.angle is None:
        first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        turns = np.linspace(0.0, 2.0 * np.pi, _TURNS, endpoint=False)
    else:
        first = np.array(space.toward)
        turns = np.linspace(-0.5, 0.5, _TURNS) * _INSIDE * space.angle
    first = first / np.linalg.norm(first)
    second = np.cross(axis, first)
    across = np.cos(turns)[:, None] * first + np.sin(turns)[:, None] * second
    shares = (np.arange(_RINGS) + 1.0) / _RINGS if space.toward is None else np.linspace(0.2, 1.0, 4 * _RINGS)
    radii = hollow + (_INSIDE * space.radius - hollow) * shares
    spread = 0.5 - 0.5 * _INSIDE
    heights = space.low + (space.high - space.low) * np.linspace(spread, 1.0 - spread, _LEVELS)
    flat = (radii[:, None, None] * across).reshape(-1, 3)
    return (point + flat[None] - heights[:, None, None] * axis).reshape(-1, 3)
