"""A plan as an MJCF scene: each part a free body with its mesh, a keyframe for the start and after each step.

Bodies do not weigh and do not collide, so that a simulator shows the plan as it is: exact contact between meshes is not
what it computes (hulls would jam every hole). Whoever wants to simulate turns that on and brings convex pieces.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.assembly import Assembly
from sashimono.geometry.mesh.text import obj_text
from sashimono.plan import AssemblyPlan, Table, waits
from sashimono.view.appearance import linear_rgb, part_colors
from sashimono.view.keyframes import rotation_between
from sashimono.view.playback import page_frames

SCENE = "scene.xml"
GRAVITY = 9.81


def write_mjcf(plan: AssemblyPlan, assembly: Assembly, out: Path) -> tuple[str, ...]:
    """Write ``scene.xml`` and an OBJ a part into an existing folder, in metres; return the names of the files.

    The world frame is the product's, and gravity is along the table's normal. Keyframes are called ``start`` and
    ``NUMBER PART``, as the steps; parts without a step stay where they are assembled. Where the product is turned over
    the table stays, and a keyframe ``NUMBER turned over`` and all later ones show the product turned.
    """
    root = xml.Element("mujoco", model="sashimono")
    xml.SubElement(root, "compiler", meshdir=".", angle="radian")
    normal = np.array([0.0, 0.0, 1.0]) if plan.table is None else plan.table.normal
    xml.SubElement(root, "option", gravity=_numbers(-GRAVITY * normal))
    asset, world = xml.SubElement(root, "asset"), xml.SubElement(root, "worldbody")
    low, high = assembly.bounds_world
    middle, size = (low + high) / 2.0, float(np.linalg.norm(high - low))
    _statistics(root, middle, size)
    xml.SubElement(
        world, "light", pos=_numbers(middle + 2.0 * size * normal), dir=_numbers(-normal), directional="true"
    )
    if plan.table is not None:
        _add_table(world, plan.table, middle, size)
    colors, files = part_colors(plan, assembly), [SCENE]
    for k, part in enumerate(assembly.parts):
        files.append(f"part_{k:03}.obj")
        (out / files[-1]).write_text(obj_text(part.vertices_part, part.faces), encoding="ascii")
        xml.SubElement(asset, "mesh", name=part.name, file=files[-1], inertia="convex")
        body = xml.SubElement(world, "body", name=part.name, gravcomp="1")
        xml.SubElement(body, "freejoint")
        color = _numbers(np.array([*linear_rgb(colors[part.name]), 1.0]))
        xml.SubElement(body, "geom", type="mesh", mesh=part.name, rgba=color, contype="0", conaffinity="0")
    keys = xml.SubElement(root, "keyframe")
    for name, poses in keyframes(plan, assembly):
        qpos = np.concatenate([_free_joint(poses[part]) for part in assembly.names])
        xml.SubElement(keys, "key", name=name, qpos=_numbers(qpos))
    xml.indent(root)
    xml.ElementTree(root).write(out / SCENE, encoding="utf-8", xml_declaration=True)
    return tuple(files)


def keyframes(plan: AssemblyPlan, assembly: Assembly) -> list[tuple[str, dict[str, Float[np.ndarray, "4 4"]]]]:
    """Return the name of each moment and the pose of every part then: the start, each turn, the end of each step.

    Steps inside a subassembly come before the step that brings it, numbered within it (``4.2``). Of steps that happen
    at the same time, all but the last end where their parts wait.
    """
    frames = page_frames(plan, assembly)
    poses = {part.name: part.T_world_part for part in assembly.parts}
    steps = []
    for k, step in enumerate(plan.steps):
        inside = () if step.subassembly is None else step.subassembly.steps
        steps += [(f"{k + 1}.{j + 1}", below, frames[k], waits(inside, j)) for j, below in enumerate(inside)]
        steps.append((str(k + 1), step, frames[k], waits(plan.steps, k)))
    for _, step, T, _ in reversed(steps):  # of the steps that move a part, the first says where it waits
        poses |= {name: T @ step.member_poses(name, plan.parts)[0] for name in step.members}
    out = [("start", dict(poses))]
    waiting: dict[str, Float[np.ndarray, "4 4"]] = {}
    for label, step, T, is_waiting in steps:
        if step.turned:
            poses |= {name: T @ plan.parts[name] for name in step.fixed}
            out.append((f"{label} turned over", dict(poses)))
        placed = {name: T @ step.member_poses(name, plan.parts)[-1] for name in step.members}
        if is_waiting:  # it goes in with the last of those that happen at the same time
            waiting |= placed
            placed = {name: T @ step.member_poses(name, plan.parts)[-2] for name in step.members}
        elif step.simultaneous:
            placed |= waiting
            waiting = {}
        poses |= placed
        if step.subassembly is None:
            out.append((f"{label} {step.part}", dict(poses)))
        else:
            out.append((f"{label} {step.part} and {len(step.members) - 1} more", dict(poses)))
    return out


def _statistics(root: xml.Element, middle: Float[np.ndarray, "3"], size: float) -> None:
    """What a viewer frames, and how near and far it draws."""
    xml.SubElement(root, "statistic", center=_numbers(middle), extent=_number(2.0 * size))
    visual = xml.SubElement(root, "visual")
    xml.SubElement(visual, "map", znear="0.001", zfar="50")


def _add_table(world: xml.Element, table: Table, middle: Float[np.ndarray, "3"], size: float) -> None:
    foot = middle - (middle @ table.normal - table.offset) * table.normal
    x, y, z, w = rotation_between(np.array([0.0, 0.0, 1.0]), table.normal)
    xml.SubElement(
        world,
        "geom",
        name="table",
        type="plane",
        pos=_numbers(foot),
        quat=_numbers(np.array([w, x, y, z])),
        size=_numbers(np.array([4.0 * size, 4.0 * size, 0.1 * size])),
        rgba="0.85 0.87 0.9 1",
        contype="0",
        conaffinity="0",
    )


def _free_joint(T: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "7"]:
    """Position, then the quaternion, scalar first."""
    return np.concatenate([T[:3, 3], Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True, scalar_first=True)])


def _numbers(values: np.ndarray) -> str:
    return " ".join(_number(float(value)) for value in values)


def _number(value: float) -> str:
    return f"{value:.9g}"
