"""Can the part be held, or pushed, where the plan says?"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import linprog

from sashimono.geometry import se3
from sashimono.plan import Contact, Motion, Step
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.fingertips import span_of, tip_problems
from sashimono.verify.pairs import pair_tolerance
from sashimono.verify.push import push_problems
from sashimono.verify.sweep import Screws, sweep
from sashimono.verify.target import HalfSpace

_GRIPPER_LENGTHS = ("finger_width", "finger_thickness", "finger_length", "max_opening")
_OPTIONAL_LENGTHS = ("tip_reach", "patch_radius", "opened")
_PALM_LENGTHS = ("palm_width", "palm_depth", "palm_length")


@dataclass(frozen=True, kw_only=True, eq=False)
class Surroundings:
    """What stands around one step: placed parts, parts still resting, the table."""

    bodies: Mapping[str, tuple[SampledBody, Float[np.ndarray, "4 4"]]]
    table: HalfSpace | None

    def fixed(self, names: Collection[str]) -> dict[str, tuple[SampledBody, Float[np.ndarray, "4 4"]]]:
        """Return the placed parts among them."""
        return {name: entry for name, entry in self.bodies.items() if name in names}


def contact_problems(
    step: Step,
    body: SampledBody,
    around: Surroundings,
    config: VerifyConfig,
) -> tuple[list[str], list[str]]:
    """Return what is wrong with a step's contact, and what could not be checked.

    ``around``: everything past which the gripper goes, from pick-up to release.
    """
    problems, notes = _one_contact(step, step.contact, body, around, config)
    if step.carry is not None and not problems:
        problems, more = _one_contact(step, step.carry, body, around, config)
        problems = [f"on the way there: {problem}" for problem in problems] or _handover_problems(step)
        notes += more
    elif not problems and step.contact is not None and span_of(step.contact, step.motion)[0] > 0.0:
        notes.append("no grasp brings the part to where its contact begins")
    return problems, notes


def _handover_problems(step: Step) -> list[str]:
    """Does the grasp that carries the part begin with the path and last until the other contact takes over?"""
    assert step.carry is not None
    assert step.contact is not None
    (first, until), (since, last) = span_of(step.carry, step.motion), span_of(step.contact, step.motion)
    if first != 0.0 or until < since or last < len(step.motion.T_world_part) - 1:
        return ["the grasp that carries the part and its contact do not cover the path together"]
    return []


def _one_contact(
    step: Step, contact: Contact | None, body: SampledBody, around: Surroundings, config: VerifyConfig
) -> tuple[list[str], list[str]]:
    assert contact is not None
    if problem := _form_problem(contact):
        return [problem], []
    problems = _surface_problems(contact, body, config)
    if problems:
        return problems, []
    notes: list[str] = []
    if contact.kind == "push":
        problems += _force_problems(contact, config)
        problems += push_problems(contact, step.motion, body, around.fixed(step.fixed), around.table, config)
    else:
        problems += _antipodal_problems(contact, config)
        if not problems and not force_closure(contact, body, config):
            problems.append("grasp: the contacts cannot balance every wrench (no force closure)")
    if "fingertips" in contact.details:
        return problems or tip_problems(contact, step.motion, body, around.bodies, around.table, config), notes
    if contact.kind == "push":
        return problems, ["push: no fingertip stated, so its way was not checked"]
    gripper = contact.details.get("gripper")
    if contact.T_part_gripper is None or not isinstance(gripper, Mapping):
        notes.append("grasp: no gripper stated, so the fingers were not checked")
    elif missing := [name for name in _GRIPPER_LENGTHS if not _is_length(gripper.get(name))]:
        problems.append(f"grasp: the gripper's {missing[0]} is not a length")
    elif wrong := [name for name in _OPTIONAL_LENGTHS if name in gripper and not _is_length(gripper[name])]:
        problems.append(f"grasp: the gripper's {wrong[0]} is not a length")
    else:
        problems += _gripper_problems(contact, gripper, config)
        problems += _finger_problems(contact, gripper, step.motion, around, config)
    return problems, notes


def _is_length(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value) and value > 0.0


def _form_problem(contact: Contact) -> str | None:
    points, normals = contact.points_part, contact.normals_part
    if points.ndim != 2 or points.shape[1] != 3 or points.shape != normals.shape or len(points) == 0:
        return f"{contact.kind}: points and normals are not two lists of as many vectors"
    if not (np.isfinite(points).all() and np.isfinite(normals).all()):
        return f"{contact.kind}: points or normals are not finite"
    if contact.kind == "grasp" and len(points) < 2:
        return "grasp: it takes at least two contacts"
    if not (math.isfinite(contact.friction) and contact.friction > 0.0):
        return f"{contact.kind}: friction is {contact.friction}, not above 0"
    return None


def _surface_problems(contact: Contact, body: SampledBody, config: VerifyConfig) -> list[str]:
    kind, points, normals = contact.kind, contact.points_part, contact.normals_part
    off = np.abs(body.distance(points))
    if off.max() > config.contact_tolerance * body.size:
        return [f"{kind}: contact {int(off.argmax())} is {off.max() * 1e3:.4g} mm off the surface"]
    if np.abs(np.linalg.norm(normals, axis=1) - 1.0).max() > 1e-6:
        return [f"{kind}: a normal is not of unit length"]
    # at an edge either face will do: the one nearest to the point, or to a point a little inside or outside
    step = 10.0 * config.contact_tolerance * body.size
    faces = np.stack([body.nearest_normal(points + shift * normals) for shift in (0.0, step, -step)], axis=1)
    angles = np.arccos(np.clip(-np.einsum("nkj,nj->nk", faces, normals), -1.0, 1.0)).min(axis=1)
    if angles.max() > config.normal_tolerance:
        worst = int(angles.argmax())
        return [f"{kind}: normal {worst} is {np.degrees(angles[worst]):.1f}° off the surface's inward normal"]
    return []


def _tangential(contact: Contact) -> float:
    return math.sqrt(contact.friction) if contact.details.get("friction_cone") == "printed" else contact.friction


def _force_problems(contact: Contact, config: VerifyConfig) -> list[str]:
    forces = contact.force_part
    if contact.kind != "push":
        return []
    if forces is None:
        return ["push: no force is stated, so nothing shows that it moves the part"]
    if forces.shape != contact.points_part.shape or not np.isfinite(forces).all():
        return ["push: there is not one finite force for each contact"]
    along = np.einsum("ij,ij->i", forces, contact.normals_part)
    aside = np.linalg.norm(forces - along[:, None] * contact.normals_part, axis=1)
    if (aside > (_tangential(contact) + config.cone_tolerance) * np.maximum(along, 0.0)).any():
        return ["push: a force is outside its friction cone"]
    return []


def _antipodal_problems(contact: Contact, config: VerifyConfig) -> list[str]:
    if len(contact.points_part) != 2:
        return []
    line = contact.points_part[1] - contact.points_part[0]
    span = float(np.linalg.norm(line))
    if span == 0.0:
        return ["grasp: both contacts are the same point"]
    cosines = np.array([contact.normals_part[0] @ line, -contact.normals_part[1] @ line]) / span
    angle = float(np.arccos(np.clip(cosines, -1.0, 1.0)).max())
    cone = math.atan(_tangential(contact))
    if angle > cone + config.cone_tolerance:
        return [f"grasp: not antipodal, {math.degrees(angle):.1f}° off a cone of {math.degrees(cone):.1f}°"]
    return []


def force_closure(contact: Contact, body: SampledBody, config: VerifyConfig) -> bool:
    """Return whether the contacts, as soft fingers, can balance any wrench.

    The wrenches on the rims of the linearised friction cones must span all six dimensions and be able to cancel
    with every coefficient positive: a linear program for the largest smallest coefficient.
    """
    radius = 0.5 * body.size
    gripper = contact.details.get("gripper")
    gripper = contact.details.get("fingertips", gripper)
    patch: Any = gripper.get("patch_radius") if isinstance(gripper, Mapping) else None
    torsion = 2.0 / 3.0 * float(patch) / radius if _is_length(patch) else config.torsion_radius
    friction = _tangential(contact)
    angles = 2.0 * np.pi * np.arange(config.cone_edges) / config.cone_edges
    columns = []
    for point, normal in zip(contact.points_part, contact.normals_part, strict=True):
        u, v = np.linalg.svd(normal[None])[2][1:]
        arm = (point - body.center_of_mass) / radius
        forces = normal + friction * (np.cos(angles)[:, None] * u + np.sin(angles)[:, None] * v)
        columns.append(np.hstack([forces, np.cross(arm, forces)]))
        twists = np.array([[1.0], [-1.0]]) * friction * torsion * normal
        columns.append(np.hstack([np.tile(normal, (2, 1)), np.cross(arm, normal) + twists]))
    wrenches = np.vstack(columns).T
    count = wrenches.shape[1]
    if np.linalg.matrix_rank(wrenches, tol=1e-9) < 6:
        return False
    # maximise t with W λ = 0, Σ λ = 1, λ >= t
    equal = np.zeros((7, count + 1))
    equal[:6, :count], equal[6, :count] = wrenches, 1.0
    above = np.hstack([-np.eye(count), np.ones((count, 1))])
    cost = np.append(np.zeros(count), -1.0)
    bounds = [(0.0, None)] * count + [(None, None)]
    found = linprog(cost, A_ub=above, b_ub=np.zeros(count), A_eq=equal, b_eq=np.append(np.zeros(6), 1.0), bounds=bounds)
    return bool(found.status == 0 and -found.fun > 1e-9)


def _gripper_problems(contact: Contact, gripper: Mapping[str, Any], config: VerifyConfig) -> list[str]:
    """Does the gripper reach the contacts: opening wide enough, origin and x axis between the two points?"""
    T = contact.T_part_gripper
    if T is None or not se3.is_pose(T, config.pose_tolerance):
        return ["grasp: the gripper pose is not rigid"]
    first, second = contact.points_part[:2]
    span = float(np.linalg.norm(second - first))
    if span > gripper["max_opening"] * (1.0 + 1e-9):
        return [f"grasp: the contacts are {span * 1e3:.4g} mm apart, more than the gripper opens"]
    away = np.linalg.norm(T[:3, 3] - 0.5 * (first + second))
    if away > config.contact_tolerance * gripper["finger_length"] or T[:3, 0] @ (second - first) < 0.999 * span:
        return ["grasp: the gripper pose does not put its fingers on the contacts"]
    return []


def _finger_problems(
    contact: Contact, gripper: Mapping[str, Any], motion: Motion, around: Surroundings, config: VerifyConfig
) -> list[str]:
    """Sweep the gripper past everything: coming for the part open, carrying it closed, leaving it open."""
    T_part_gripper = contact.T_part_gripper
    assert T_part_gripper is not None
    span = float(np.linalg.norm(contact.points_part[1] - contact.points_part[0]))
    closed = _gripper_boxes(gripper, span, config)
    ways = [("on its way", closed, motion.T_world_part @ T_part_gripper)]
    retreat, opened = contact.details.get("retreat"), gripper.get("opened")
    if retreat is not None and opened is not None and _is_length(retreat) and _is_length(opened):
        away = se3.make(None, np.array([0.0, 0.0, -float(retreat)]))
        wide = _gripper_boxes(gripper, max(span, float(opened)), config)
        for when, T in (("at pick-up", motion.T_world_part[0]), ("at release", motion.T_world_part[-1])):
            ways.append((when, wide, np.stack([T @ T_part_gripper, T @ T_part_gripper @ away])))
    for when, boxes, poses in ways:
        for k, (start, stop) in enumerate(pairwise(poses)):
            if hit := _first_hit(boxes, Screws.between(np.stack([start, stop])), around, config):
                place = f"between poses {k} and {k + 1}" if when == "on its way" else when
                return [f"grasp: the {hit[0]} hits {hit[1]} {place}"]
    return []


def _first_hit(
    boxes: list[SampledBody], path: Screws, around: Surroundings, config: VerifyConfig
) -> tuple[str, str] | None:
    """Return the first box of the gripper that hits something along the path, and what it hits."""
    options: dict[str, Any]
    for box in boxes:
        if around.table is not None:
            # flush with the table is no hit: a part that lies on it is held down there
            limit = config.relative_tolerance * box.smallest_extent
            options = {"limit": limit, "resolution": limit, "coarse": 0.25 * box.wall}
            if not sweep(box.tree, around.table, path, max_queries=config.max_queries, **options).holds:
                return box.name, "the table"
        for name, (body, T_world_body) in around.bodies.items():
            tolerance = pair_tolerance(box, body, config)
            options = {"limit": tolerance, "resolution": tolerance, "coarse": 0.25 * min(box.wall, body.wall)}
            found = sweep(box.tree, body, path.seen_from(T_world_body), max_queries=config.max_queries, **options)
            if found.holds:
                back = path.reversed_for(T_world_body)
                found = sweep(body.tree, box, back, max_queries=config.max_queries, **options)
            if not found.holds:
                return box.name, name
    return None


def _gripper_boxes(gripper: Mapping[str, Any], opening: float, config: VerifyConfig) -> list[SampledBody]:
    """The fingers, this far apart, and the palm."""
    half, y, length = 0.5 * opening, 0.5 * gripper["finger_width"], gripper["finger_length"]
    if _is_length(gripper.get("closing_advance")):
        length += gripper["closing_advance"] * (1.0 - min(1.0, opening / gripper["max_opening"]))
    outer, tip = half + gripper["finger_thickness"], float(gripper.get("tip_reach", 0.0))
    boxes = [
        _box("first finger", [-outer, -y, -length], [-half, y, tip], config),
        _box("second finger", [half, -y, -length], [outer, y, tip], config),
    ]
    if all(_is_length(gripper.get(name)) for name in _PALM_LENGTHS):
        x, y = max(0.5 * gripper["palm_width"], outer), 0.5 * gripper["palm_depth"]
        boxes.append(_box("palm", [-x, -y, -length - gripper["palm_length"]], [x, y, -length], config))
    return boxes


def _box(name: str, low: list[float], high: list[float], config: VerifyConfig) -> SampledBody:
    corners = np.array([[(low, high)[k >> axis & 1][axis] for axis in range(3)] for k in range(8)])
    quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]]
    faces = np.array([[q[a], q[b], q[c]] for q in quads for a, b, c in ((0, 1, 2), (0, 2, 3))])
    return SampledBody(name, corners, faces, samples=config.samples // 4)
