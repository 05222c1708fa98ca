"""Does a path turn as the plan declares where it says that it follows a thread?"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from sashimono.geometry import se3
from sashimono.plan import DeclaredHelix, Step
from sashimono.verify.config import VerifyConfig


def declared_problems(step: Step, config: VerifyConfig) -> list[str]:
    """Return what is wrong with the thread that a step declares; nothing if it declares none.

    From the stated first to the last pose the part must turn by the right-hand rule about the axis, and shift along
    it by the pitch each turn, to the pose tolerance. Whether there is such a thread in reality is not to be checked.
    """
    helix, poses = step.declared, step.motion.T_world_part
    if helix is None:
        return []
    numbers = np.array([*np.ravel(helix.axis), *np.ravel(helix.point), helix.pitch])
    if helix.axis.shape != (3,) or helix.point.shape != (3,) or not np.isfinite(numbers).all():
        return ["the declared thread is not given by finite numbers"]
    if abs(np.linalg.norm(helix.axis) - 1.0) > 1e-6 or helix.pitch <= 0.0:
        return ["the declared thread has no unit axis or no positive pitch"]
    if helix.other not in step.fixed:
        return [f"the declared thread is in {helix.other!r}, which is not there"]
    if not any(s.kind == "insertion" and s.start <= helix.start < helix.stop <= s.stop for s in step.motion.segments):
        return ["the declared thread is not on a stretch of the insertion"]
    for k in range(helix.start, helix.stop):
        problem = _stretch_problem(poses[k], poses[k + 1], helix, config)
        if problem:
            return [f"between poses {k} and {k + 1} the path is not the declared thread: {problem}"]
    return []


def _stretch_problem(
    T_a: Float[np.ndarray, "4 4"], T_b: Float[np.ndarray, "4 4"], helix: DeclaredHelix, config: VerifyConfig
) -> str | None:
    """What is wrong with one stretch: its screw, seen in the world frame at the axis, is a turn with a shift."""
    to_axis = se3.make(None, -helix.point)
    twist = se3.log(to_axis @ T_b @ se3.inverse(T_a) @ se3.inverse(to_axis))
    angle = float(twist[3:] @ helix.axis)
    if angle <= 0.0 or np.linalg.norm(twist[3:] - angle * helix.axis) > config.pose_tolerance:
        return "it does not turn about the axis"
    lead = 2.0 * np.pi * twist[:3] / angle
    if np.linalg.norm(lead - helix.pitch * helix.axis) > config.declared_tolerance * helix.pitch:
        return "it does not shift by the pitch each turn"
    return None
