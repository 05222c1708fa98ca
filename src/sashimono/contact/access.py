"""Can the gripper reach the part, carry it along its motion and let go of it?"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from sashimono.contact.clearance import Surroundings
from sashimono.contact.config import ContactConfig
from sashimono.contact.gripper import Boxes
from sashimono.contact.poses import resample, segment_poses
from sashimono.geometry.body import Body
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion, Table

_STAGES = {
    "itself": "the part itself",
    "assembled": "{} at the assembled pose",
    "pick-up": "{} at pick-up",
    "insertion": "{} during the insertion",
    "transit": "{} during the transit",
}


@runtime_checkable
class Reach(Protocol):
    """What is asked of a tool: the boxes that it fills, in its own frame, z along the approach. Lengths in metres."""

    @property
    def pad_thickness(self) -> float: ...
    @property
    def max_opening(self) -> float: ...
    @property
    def finger_length(self) -> float: ...
    @property
    def finger_thickness(self) -> float: ...
    @property
    def palm_length(self) -> float: ...
    @property
    def palm_width(self) -> float: ...

    def closed(self, opening: float, *, inset: float) -> Boxes:
        """Return what it fills while it holds a part this wide."""
        ...

    def release(self, opening: float, retreat: float, *, inset: float) -> Boxes:
        """Return what it sweeps while it lets go and retreats by that length along -z [m]."""
        ...


class Access:
    """The checks of a gripper along one step, cheapest first, and a tally of what failed them."""

    def __init__(
        self,
        body: Body,
        motion: Motion,
        obstacles: Sequence[Obstacle],
        table: Table | None,
        gripper: Reach,
        config: ContactConfig,
    ) -> None:
        self.gripper, self.config = gripper, config
        self.retreat = config.retreat * gripper.finger_length
        self._inset = config.contact_clearance * gripper.finger_thickness
        self._itself = Surroundings([Obstacle(body=body, T_world_part=np.eye(4))], None)
        self._around = Surroundings(obstacles, table)
        self._start, self._end = motion.T_world_part[0], motion.T_world_part[-1]
        reach = body.radius + gripper.finger_length + gripper.palm_length + gripper.palm_width + gripper.max_opening
        self._paths: dict[str, np.ndarray] = {}
        self.spacing: dict[str, float] = {}
        for kind, step, most in (
            ("insertion", config.insertion_step, config.max_insertion_poses),
            ("transit", config.transit_step, config.max_transit_poses),
        ):
            parts = [
                resample(poses, center=body.center, reach=reach, step=step * gripper.finger_thickness, max_poses=most)
                for poses in segment_poses(motion, kind)
            ]
            if parts:
                self._paths[kind] = np.concatenate([poses for poses, _ in parts])[::-1]
                self.spacing[kind] = max(spacing for _, spacing in parts)
        down = -table.normal if table is not None else np.zeros(3)
        self._ease = self._start[:3, :3].T @ down + self._end[:3, :3].T @ _last_direction(motion, body.center)
        self._tried = 0
        self._hits: dict[str, Counter[str]] = defaultdict(Counter)

    def first_clear(
        self, opening: float, T_part_gripper: Float[np.ndarray, "approach 4 4"]
    ) -> Float[np.ndarray, "4 4"] | None:
        """Return the first approach in which the gripper is clear of everything; None if there is none.

        They are tried from above at pick-up and from behind at the insertion first.
        """
        order = np.argsort(-np.round(T_part_gripper[:, :3, 2] @ self._ease, 9), kind="stable")
        left = T_part_gripper[order]
        self._tried += len(left)
        own = self.gripper.release(opening, self.retreat, inset=self.gripper.pad_thickness)
        others = self.gripper.release(opening, self.retreat, inset=self._inset)
        for stage, surroundings, sweep, T in (
            ("itself", self._itself, own, np.eye(4)),
            ("assembled", self._around, others, self._end),
            ("pick-up", self._around, others, self._start),
        ):
            hits = surroundings.hits(sweep, T @ left)
            self._hits[stage].update(hits.values())
            left = np.delete(left, list(hits), axis=0)
        boxes = self.gripper.closed(opening, inset=self._inset)
        return next((T for T in left if self._carries(boxes, T)), None)

    def _carries(self, boxes: Boxes, T_part_gripper: Float[np.ndarray, "4 4"]) -> bool:
        """Return whether the closed gripper is clear of everything on the whole way; if not, note what it hit."""
        for stage, path in self._paths.items():
            hit = self._around.first_hit(boxes, path @ T_part_gripper)
            if hit is not None:
                self._hits[stage][hit] += 1
                return False
        return True

    def reason(self, total: int, checked: int) -> str:
        """Return in plain words which checks failed the grasps."""
        count = f"{total} candidate grasps" if checked == total else f"{checked} best of {total} candidate grasps"
        stages = sorted((s for s in _STAGES if self._hits[s]), key=lambda stage: -self._hits[stage].total())
        if not stages:
            return f"{count}, none of positive quality"
        told = [f"hit {_STAGES[stage].format(self._names(stage))}" for stage in stages]
        if len(told) == 1:
            return f"{count}, all {told[0]}"
        shares = [f"{100.0 * self._hits[s].total() / self._tried:.0f} % {t}" for s, t in zip(stages, told, strict=True)]
        return f"{count} at {self.config.approaches} approaches each: {', '.join(shares)}"

    def _names(self, stage: str) -> str:
        """The three bodies hit most often, and whether there are more."""
        ranked = sorted(self._hits[stage].items(), key=lambda item: (-item[1], item[0]))
        names = ", ".join(name for name, _ in ranked[:3])
        return names if len(ranked) <= 3 else f"{names} and {len(ranked) - 3} more"


def _last_direction(motion: Motion, center: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Unit direction in which the part's centre goes over the last segment; zero if it stays."""
    start = motion.segments[-1].start if motion.segments else 0
    first, last = motion.T_world_part[start], motion.T_world_part[-1]
    way = (last[:3, :3] - first[:3, :3]) @ center + last[:3, 3] - first[:3, 3]
    length = float(np.linalg.norm(way))
    return way / length if length > 0.0 else way
