"""A plan for the MoveIt Task Constructor: a script, the steps as data, a mesh a part.

The script knows MoveIt and no plan; the data know the plan and no MoveIt. MoveIt plans what depends on the robot, the
transits; grasps and ways in are the plan's.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.geometry.mesh.text import obj_text
from sashimono.plan import AssemblyPlan, Contact, Step

SCRIPT = "assemble.py"
DATA = "steps.json"
_TURNS = 12
"""Hand poses about the line between two contacts that are offered."""
_MOST_TURN = np.radians(30.0)
"""Between two poses of a way in [rad], so that interpolation of position and rotation apart follows the screw."""


def write_mtc(plan: AssemblyPlan, assembly: Assembly, out: Path) -> tuple[str, ...]:
    """Write ``assemble.py``, ``steps.json`` and an OBJ a part into an existing folder; return the names of the files.

    Lengths are metres, poses x, y, z and a quaternion x, y, z, w, in the plan's world frame; grasps are in the part's
    frame. A step that the plan has no grasp for, and a subassembly's inside, are left to a person and say so.
    """
    files = [SCRIPT, DATA]
    for k, part in enumerate(assembly.parts):
        files.append(f"part_{k:03}.obj")
        (out / files[-1]).write_text(obj_text(part.vertices_part, part.faces), encoding="ascii")
    script = resources.files("sashimono.view").joinpath("moveit", "assemble.py.txt").read_text(encoding="utf-8")
    (out / SCRIPT).write_text(script, encoding="utf-8")
    (out / DATA).write_text(json.dumps(mtc_data(plan, assembly), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return tuple(files)


def mtc_data(plan: AssemblyPlan, assembly: Assembly) -> dict[str, Any]:
    """Return what ``steps.json`` holds."""
    up = np.array([0.0, 0.0, 1.0]) if plan.table is None else plan.table.normal / np.linalg.norm(plan.table.normal)
    start = dict(plan.parts)
    for step in reversed(plan.steps):
        start |= {name: step.member_poses(name, plan.parts)[0] for name in step.members}
    return {
        "format": "sashimono.mtc",
        "version": 1,
        "up": up.tolist(),
        "table": None if plan.table is None else {"normal": up.tolist(), "offset": plan.table.offset},
        "parts": [
            {"name": part.name, "mesh": f"part_{k:03}.obj", "start": pose_values(start[part.name])}
            for k, part in enumerate(assembly.parts)
        ],
        "steps": [_step(step, plan, up) for step in plan.steps],
    }


def _step(step: Step, plan: AssemblyPlan, up: Float[np.ndarray, "3"]) -> dict[str, Any]:
    poses = step.motion.T_world_part
    grasp = step.carry or step.contact
    by_hand = None
    together = ", ".join(step.simultaneous)
    if not step.moves:
        by_hand = "stands in place from the beginning"
    elif step.subassembly is not None:
        names = ", ".join(step.subassembly.order)
        by_hand = f"put together {names} first, as plan.json says, and place them as one"
        by_hand += f", at the same time as {together}" if together else ""
    elif together:
        by_hand = f"goes in at the same time as {together}: by hand, all together"
    elif grasp is None or grasp.kind != "grasp":
        by_hand = f"the plan has no grasp here ({step.contact_reason or 'it is pushed'}): place it by hand"
    elif step.carry is not None:
        by_hand = "the plan carries it and then pushes it home: place it by hand"
    return {
        "part": step.part,
        "moving": list(step.members),
        "touches": list(step.fixed),
        "way": [pose_values(T) for T in insertion_poses(step)],
        "placed": {name: pose_values(plan.parts[name]) for name in step.members},
        "grasps": []
        if by_hand is not None or grasp is None
        else [pose_values(T) for T in hand_poses(grasp, poses[0], up)],
        "by_hand": by_hand,
    }


def insertion_poses(step: Step) -> list[Float[np.ndarray, "4 4"]]:
    """Return the poses of the way in, from where it begins, turns in pieces of 30 degrees at most."""
    inside = [segment for segment in step.motion.segments if segment.kind == "insertion"]
    poses = step.motion.T_world_part[(inside[0].start if inside else 0) :]
    out = [poses[0]]
    for a, b in itertools.pairwise(poses):
        twist = se3.log(se3.inverse(a) @ b)
        pieces = max(1, int(np.ceil(np.linalg.norm(twist[3:]) / _MOST_TURN)))
        out += [a @ se3.exp(twist * (k / pieces)) for k in range(1, pieces)] + [b]
    return out


def hand_poses(
    grasp: Contact, T_world_part: Float[np.ndarray, "4 4"], up: Float[np.ndarray, "3"]
) -> list[Float[np.ndarray, "4 4"]]:
    """Return poses of the hand in the part's frame: x along its closing, z towards the part, between the finger tips.

    Where the plan has the gripper's pose it is that one; of fingertips alone, a hand may come from any side, from above
    first.
    """
    if grasp.T_part_gripper is not None:
        return [grasp.T_part_gripper]
    first, last = grasp.points_part[0], grasp.points_part[-1]
    middle, x = 0.5 * (first + last), last - first
    length = float(np.linalg.norm(x))
    # two contacts in one place close along their normals
    x = x / length if length > 1e-9 else grasp.normals_part[0] / np.linalg.norm(grasp.normals_part[0])
    down = -(T_world_part[:3, :3].T @ up)
    across = down - (down @ x) * x
    if np.linalg.norm(across) < 1e-6:
        across = np.cross(x, np.eye(3)[int(np.argmin(np.abs(x)))])
    z = across / np.linalg.norm(across)
    out = []
    for k in sorted(range(_TURNS), key=lambda k: min(k, _TURNS - k)):
        turn = se3.exp_so3(2.0 * np.pi * k / _TURNS * x)
        toward = turn @ z
        out.append(se3.make(np.column_stack([x, np.cross(toward, x), toward]), middle))
    return out


def pose_values(T: Float[np.ndarray, "4 4"]) -> list[float]:
    """Return x, y, z [m] and the unit quaternion x, y, z, w."""
    values: Sequence[float] = [*T[:3, 3], *Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True)]
    return [round(float(value), 9) + 0.0 for value in values]
