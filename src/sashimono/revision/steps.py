"""What two plans do differently: order, motions, what holds a part, hands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from sashimono.geometry import se3
from sashimono.geometry.features.directions import direction_name
from sashimono.plan import AssemblyPlan, Step

SAME_ANGLE = 0.02
"""Two directions are the same within this angle [rad]."""
SAME_LENGTH = 0.02
"""Two lengths are the same within this share of the longer one."""


@dataclass(frozen=True, kw_only=True)
class StepChange:
    """What one part's step does differently, in words."""

    part: str
    """Its name in the new plan."""
    words: tuple[str, ...]


def changed_pairs(old: AssemblyPlan, new: AssemblyPlan, names: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    """Return pairs of parts, by their new names, that changed places: the first is placed earlier now, later before.

    Only neighbours in the new order are looked at, so that one part that moved is not told many times.
    """
    before = {names[name]: k for k, name in enumerate(old.placed) if name in names}
    now = [name for name in new.placed if name in before]
    return tuple((a, b) for a, b in pairwise(now) if before[a] > before[b])


def changed_steps(old: AssemblyPlan, new: AssemblyPlan, names: Mapping[str, str]) -> tuple[StepChange, ...]:
    """Return what the steps of parts that both plans place do differently, in the order of the new one."""
    before = {names[step.part]: step for step in old.all_steps if step.part in names}
    found = []
    for step in new.all_steps:
        if step.part in before and (words := _differences(before[step.part], step, names)):
            found.append(StepChange(part=step.part, words=tuple(words)))
    return tuple(found)


def _differences(old: Step, new: Step, names: Mapping[str, str]) -> list[str]:
    words = []
    before, after = _insertion(old), _insertion(new)
    if (before is None) != (after is None):
        words.append("is brought now" if before is None else "stands from the beginning now")
    elif before is not None and after is not None:
        if np.arccos(np.clip(before[0] @ after[0], -1.0, 1.0)) > SAME_ANGLE:
            words.append(f"along {direction_name(after[0])}, was {direction_name(before[0])}")
        if not np.isclose(before[1], after[1], rtol=SAME_LENGTH, atol=1e-6):
            words.append(f"{1e3 * after[1]:.3g} mm, was {1e3 * before[1]:.3g} mm")
        if abs(before[2] - after[2]) > 0.02:
            words.append(f"{after[2]:.2g} turns, were {before[2]:.2g}")
    if {names.get(name, name) for name in old.members} != set(new.members):
        words.append(f"moves with {len(new.members) - 1} others, with {len(old.members) - 1} before")
    if {names.get(name, name) for name in old.simultaneous} != set(new.simultaneous):
        now, then = (", ".join(step.simultaneous) or "nothing" for step in (new, old))
        words.append(f"at the same time as {now}, was with {then}")
    if _tool(old) != _tool(new):
        words.append(f"{_tool(new)}, was {_tool(old)}")
    if old.turned != new.turned:
        words.append(
            "the product is turned over before it now" if new.turned else "nothing is turned over before it now"
        )
    if {names.get(name, name) for name in old.held} != set(new.held):
        words.append(f"held: {', '.join(new.held) or 'nothing'}, was {', '.join(old.held) or 'nothing'}")
    if old.hands != new.hands and None not in (old.hands, new.hands):
        words.append(f"{new.hands} hands, were {old.hands}")
    return words


def _insertion(step: Step) -> tuple[np.ndarray, float, float] | None:
    """Direction of the last stretch, length of the origin's way and turns of the insertion; None if nothing moves."""
    if not step.moves:
        return None
    start = next((segment.start for segment in step.motion.segments if segment.kind == "insertion"), 0)
    poses = step.motion.T_world_part[start:]
    ways = np.diff(poses[:, :3, 3], axis=0)
    lengths = np.linalg.norm(ways, axis=1)
    last = ways[np.flatnonzero(lengths > 0.0)[-1]] if (lengths > 0.0).any() else np.zeros(3)
    turned = sum(float(np.linalg.norm(se3.log_so3(a[:3, :3].T @ b[:3, :3]))) for a, b in pairwise(poses))
    return last / max(float(np.linalg.norm(last)), 1e-300), float(lengths.sum()), turned / (2.0 * np.pi)


def _tool(step: Step) -> str:
    """What brings a part, in words."""
    if not step.moves:
        return "nothing"
    if step.contact is None:
        return "no grasp"
    gripper = step.contact.details.get("gripper")
    name = gripper.get("name") if isinstance(gripper, dict) else gripper
    return f"{step.contact.kind} by {name}" if isinstance(name, str) else step.contact.kind
