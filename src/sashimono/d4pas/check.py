"""Check a dataset against geometry made anew: motions by the independent verifier."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.assembly import Assembly
from sashimono.contact import ContactConfig
from sashimono.d4pas.dataset import Blueprint, Dataset
from sashimono.d4pas.recipe import content_hash
from sashimono.d4pas.states import is_right_order
from sashimono.geometry import se3
from sashimono.plan import Contact
from sashimono.verify.motions import MotionCheck


@dataclass(frozen=True, kw_only=True)
class Checked:
    """What came of checking some blueprints."""

    blueprints: int
    motions: int
    contacts: int
    problems: tuple[str, ...]
    """One line each, with the blueprint's id."""


def check_dataset(
    dataset: Dataset,
    *,
    sample: int | None = 20,
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Checked:
    """Re-make some blueprints (all if ``sample`` is None) and check their labels; see `check_blueprint`."""
    rng = np.random.default_rng(seed)
    chosen = np.arange(len(dataset))
    if sample is not None and sample < len(chosen):
        chosen = np.sort(rng.choice(chosen, sample, replace=False))
    problems: list[str] = []
    motions = contacts = 0
    for done, k in enumerate(chosen):
        blueprint = dataset.blueprints[int(k)]
        steps = dataset.steps.get(blueprint.id, [])
        problems += [f"{blueprint.id}: {problem}" for problem in check_blueprint(blueprint, steps)]
        motions += sum(len(step["waypoints"]) > 1 for step in steps)
        contacts += sum(step["contact"] is not None for step in steps)
        progress(done + 1, len(chosen))
    return Checked(blueprints=len(chosen), motions=motions, contacts=contacts, problems=tuple(problems))


def check_blueprint(blueprint: Blueprint, steps: Sequence[dict[str, Any]]) -> list[str]:
    """Return what is wrong with a blueprint's labels, a line each.

    The geometry is the one that was labelled; every listed order follows the conditions; the steps are those of the
    first orders; each step's motion leads from outside to the assembled pose and goes no deeper into placed parts than
    the verifier allows; contacts lie on the surface, along its normal, and their fingertips meet nothing; parts may be
    held only where they may leave. That no clause is missing is not checked here:
    `benchmarks/d4pas_oracle.py` looks for missing ones.
    """
    assembly = blueprint.assembly()
    if assembly.names != blueprint.parts:
        return ["the parts that its recipe makes are others than those labelled"]
    out = []
    if blueprint.source is None and content_hash(assembly)[:16] != blueprint.geometry_hash:
        out.append("the geometry that its recipe makes here differs from the one that was labelled")
    out += _order_problems(blueprint)
    out += _step_problems(blueprint, steps)
    out += _executable_problems(blueprint)
    check, placed, order_index = MotionCheck(assembly), [], 0
    for step in steps:
        if step["order_index"] != order_index:
            placed, order_index = [], step["order_index"]
        name = blueprint.parts[step["part"]]
        poses = np.stack([pose_of(row) for row in step["waypoints"]])
        if not np.allclose(poses[-1], assembly.parts[step["part"]].T_world_part, atol=1e-6):
            out.append(f"{name} does not end in its assembled pose")
        if placed:
            if not _begins_outside(assembly, step["part"], placed, poses):
                out.append(f"{name} does not begin outside")
            out += [f"{name}: {problem}" for problem in check.problems(step["part"], placed, poses)]
            out += [f"{name}: {problem}" for problem in _tip_problems(blueprint, step, placed, poses, check)]
        out += [f"{name}: {problem}" for problem in _contact_problems(assembly, step)]
        placed.append(step["part"])
    return out


def pose_of(row: Sequence[float]) -> Float[np.ndarray, "4 4"]:
    """Return the pose of seven numbers: x, y, z [m], quaternion w, x, y, z."""
    quaternion = np.asarray(row[3:], dtype=np.float64)
    rotation = Rotation.from_quat(quaternion / np.linalg.norm(quaternion), scalar_first=True).as_matrix()
    return se3.make(rotation, np.asarray(row[:3], dtype=np.float64))


def _order_problems(blueprint: Blueprint) -> list[str]:
    """Listed orders that the conditions forbid, or that are too few or too many."""
    listed, count = blueprint.sequences, blueprint.orders
    out = [f"order {order} breaks the conditions" for order in listed if not is_right_order(blueprint.masks, order)]
    if not listed or len(set(listed)) < len(listed) or (count is not None and len(listed) > count):
        out.append(f"{len(listed)} orders are listed, {len(set(listed))} of them different, of {count}")
    return out


def _step_problems(blueprint: Blueprint, steps: Sequence[dict[str, Any]]) -> list[str]:
    """Steps that are not those of the first listed orders, one after the other."""
    said: dict[int, list[int]] = {}
    for step in steps:
        said.setdefault(step["order_index"], []).append(step["part"])
    wanted = {k: list(blueprint.sequences[k]) for k in range(min(max(1, len(said)), len(blueprint.sequences)))}
    return [] if said == wanted else ["the steps are not those of the first listed orders"]


def _executable_problems(blueprint: Blueprint) -> list[str]:
    """Conditions of a contact that are not minimal, or that hold where the part cannot leave at all."""
    out = []
    for name, held, leaves in zip(blueprint.parts, blueprint.executable or (), blueprint.masks, strict=False):
        if any(a != b and not a & ~b for a in held for b in held):
            out.append(f"{name}: conditions of a contact are not minimal")
        if any(all(clause & ~mask for clause in leaves) for mask in held):
            out.append(f"{name}: may be held where it cannot leave")
    return out


def _tip_problems(
    blueprint: Blueprint,
    step: dict[str, Any],
    placed: Sequence[int],
    poses: Float[np.ndarray, "pose 4 4"],
    check: MotionCheck,
) -> list[str]:
    """Fingertips that meet something on the way; grasps that the conditions do not know."""
    if step["contact"] is None or step.get("radius") is None:
        return []
    there = sum(1 << k for k in placed)
    held = blueprint.executable
    if held is not None and step["contact"] == "grasp" and all(mask & there for mask in held[step["part"]]):
        return ["is grasped where the conditions know of no contact"]
    tips = {"radius": step["radius"], "approach": ContactConfig().tip_approach * step["radius"]}
    contact = Contact(
        kind=step["contact"],
        points_part=np.array(step["points"]),
        normals_part=np.array(step["normals"]),
        friction=ContactConfig().friction,
        quality=0.0,
        details={"fingertips": tips, "from_pose": step["begins"], "to_pose": len(poses) - 1.0},
    )
    return check.tip_problems(step["part"], placed, poses, contact)


def _begins_outside(assembly: Assembly, part: int, placed: Sequence[int], poses: Float[np.ndarray, "pose 4 4"]) -> bool:
    """Whether a plane across its first way parts it from all placed parts."""
    way = poses[0, :3, 3] - poses[1, :3, 3] if len(poses) > 1 else np.zeros(3)
    own = assembly.parts[part].vertices_part @ poses[0, :3, :3].T + poses[0, :3, 3]
    low = (own @ way).min()
    high = max(float((assembly.parts[k].vertices_world @ way).max()) for k in placed)
    return bool(way.any()) and bool(low > high)


def _contact_problems(assembly: Assembly, step: dict[str, Any]) -> list[str]:
    """Points off the surface, normals that are not its own; by the nearest triangle, brute force."""
    part = assembly.parts[step["part"]]
    corners = part.vertices_part[part.faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(cross, axis=1)
    real = size > 1e-16
    corners, outward = corners[real], cross[real] / size[real, None]
    scale = float(np.ptp(part.vertices_part, axis=0).max())
    out = []
    for point, normal in zip(step["points"], step["normals"], strict=True):
        gap = _distances(np.asarray(point), corners, outward)
        on = gap <= 1e-5 * scale + 1e-6 * float(np.abs(point).max())  # stored in single precision
        if not on.any():
            out.append(f"a contact lies {gap.min() * 1e3:.3g} mm off the surface")
        elif (outward[on] @ np.asarray(normal)).min() > -np.cos(np.radians(5.0)):
            out.append("a contact's normal is not that of the surface there")
    return out


def _distances(
    point: Float[np.ndarray, "3"], corners: Float[np.ndarray, "face 3 3"], outward: Float[np.ndarray, "face 3"]
) -> Float[np.ndarray, "face"]:
    """Distance of a point from each triangle."""
    height = ((point - corners[:, 0]) * outward).sum(axis=1)
    foot = point - height[:, None] * outward
    inside = np.ones(len(corners), dtype=bool)
    edge_gap = np.full(len(corners), np.inf)
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        inside &= (np.cross(b - a, foot - a) * outward).sum(axis=1) >= 0.0
        along = np.clip(((point - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1), 0.0, 1.0)
        edge_gap = np.minimum(edge_gap, np.linalg.norm(point - a - along[:, None] * (b - a), axis=1))
    return np.where(inside, np.abs(height), edge_gap)
