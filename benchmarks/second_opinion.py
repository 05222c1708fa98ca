"""A third look at a plan: exact boolean intersections along each motion, straight from plan.json.

    python benchmarks/second_opinion.py PLAN.json INPUT

Reads the JSON and the meshes by itself, moves each part along its path in small steps and measures
the intersection with every placed and every resting part by manifold3d. Uses neither the planners nor
`sashimono.verify`, but for the readers of files: they say which parts are split, and which stay together.
A pair is refuted where the intersection is deeper than in the assembled pose: where the deepest point shared
exceeds the assembled depth plus the tolerance, or the tolerance alone once the two have come apart. A pair of
which the plan declares a fit may go as deep as that.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import igl
import manifold3d
import numpy as np
from scipy.spatial.transform import RigidTransform, Rotation

from sashimono.assembly import Assembly
from sashimono.io.plan_input import read_plan_input
from sashimono.io.plan_json import plan_from_json

POSES_PER_STEP = 60
POINTS = 3000
TOLERANCE = 0.02


def main() -> None:
    found = refutations(Path(sys.argv[1]), Path(sys.argv[2]))
    print("\n".join(found) or "nothing found against it")
    raise SystemExit(3 if found else 0)


def refutations(plan_path: Path, source: Path) -> list[str]:
    """Return what speaks against a plan, a line each."""
    plan = json.loads(plan_path.read_text())
    assembly = read_plan_input(plan_from_json(plan_path.read_text()), plan_path, source)
    solids = {part.name: solid(part.vertices_part, part.faces) for part in assembly.parts}
    sizes = {part.name: extent(part.vertices_part, solids[part.name]) for part in assembly.parts}
    poses = {part["name"]: np.array(part["T_world_part"]) for part in plan["parts"]}
    out = wrong_places(plan, poses, assembly)
    fits = {frozenset(fit["parts"]): fit["depth"] for fit in plan.get("fits", [])}
    return out + against_steps(plan["steps"], Surfaces(assembly), solids, sizes, poses, fits)


def against_steps(
    steps: list[dict], surfaces: Surfaces, solids: dict, sizes: dict, poses: dict, fits: dict
) -> list[str]:
    """Return what speaks against steps that follow one another, and against those inside their subassemblies."""
    out = []
    for k, step in enumerate(steps):
        if "subassembly" in step:
            out += against_steps(step["subassembly"]["steps"], surfaces, solids, sizes, poses, fits)
        others = {name: poses[name] for name in step["fixed"]}
        for later in steps[k + 1 :]:
            others |= {name: path(later, name, poses)[0] for name in members(later)}
        for name in members(step) if k else []:
            given = {other: fits.get(frozenset((name, other)), 0.0) for other in step["fixed"]}
            out += against_part(name, path(step, name, poses), given, others, surfaces, solids, sizes)
    return out


def against_part(
    name: str, way: np.ndarray, given: dict, others: dict, surfaces: Surfaces, solids: dict, sizes: dict
) -> list[str]:
    """Return what one part goes too deep into on its way; ``given`` has the placed parts, and the fit with each."""
    bodies = {other: placed(solids[other], T) for other, T in others.items()}
    tolerances = {other: TOLERANCE * min(sizes[name], sizes[other]) for other in others}

    def depth(other: str, T: np.ndarray) -> float:
        here = placed(solids[name], T)
        if not boxes_meet(here, bodies[other]):
            return 0.0
        return surfaces.depth(here ^ bodies[other], {name: T, other: others[other]})

    allowed = {other: depth(other, way[-1]) if other in given else 0.0 for other in others}
    found, out = set(), []
    # backwards from the assembled pose: once a pair has parted, its overlap excuses nothing any more
    for T in reversed(resampled(way)):
        for other in others:
            deep = depth(other, T)
            most = max(allowed[other] + tolerances[other], given.get(other, 0.0))
            if deep > most and other not in found:
                found.add(other)
                out.append(
                    f"{name} is {deep * 1e3:.4g} mm deep in {other} on its way, "
                    f"{allowed[other] * 1e3:.4g} mm allowed (tolerance {tolerances[other] * 1e3:.4g} mm)"
                )
            if deep == 0.0:
                allowed[other] = 0.0
    return out


def members(step: dict) -> list[str]:
    """Return the parts that move in a step."""
    return step.get("moving", [step["part"]])


def path(step: dict, name: str, poses: dict) -> np.ndarray:
    """Return the poses of one of the parts that move in a step."""
    return np.array(step["path"]["T_world_part"]) @ np.linalg.inv(poses[step["part"]]) @ poses[name]


def leaves(steps: list[dict]) -> list[str]:
    """Return the parts that have a step of their own."""
    out = []
    for step in steps:
        out += leaves(step["subassembly"]["steps"]) if "subassembly" in step else [step["part"]]
    return out


def wrong_places(plan: dict, poses: dict, assembly: Assembly) -> list[str]:
    """Return the parts not placed exactly once, or elsewhere than in the input's assembled pose."""
    found = leaves(plan["steps"])
    out = [f"{name} is placed {found.count(name)} times" for name in assembly.names if found.count(name) != 1]
    out += [
        f"{name} is not where it is in the input"
        for name in assembly.names
        if np.abs(poses[name] - assembly.part(name).T_world_part).max() > 1e-9
    ]

    def ends(steps: list[dict]) -> None:
        for step in steps:
            if np.abs(np.array(step["path"]["T_world_part"][-1]) - poses[step["part"]]).max() > 1e-9:
                out.append(f"{step['part']} does not end in its assembled pose")
            ends(step.get("subassembly", {"steps": []})["steps"])

    ends(plan["steps"])
    return out


def solid(vertices: np.ndarray, faces: np.ndarray) -> manifold3d.Manifold:
    return manifold3d.Manifold(manifold3d.Mesh64(vertices.astype(np.float64), faces.astype(np.uint64)))


def extent(vertices: np.ndarray, body: manifold3d.Manifold) -> float:
    """Smallest extent along the principal axes of the vertices of a fine sampling of the solid's volume."""
    mesh = body.refine_to_length(float(np.ptp(vertices, axis=0).max()) / 20).to_mesh64()
    points = mesh.vert_properties[:, :3]
    a, b, c = np.moveaxis(points[mesh.tri_verts.astype(np.int64)] - points[0], 1, 0)
    weights = np.einsum("fi,fi->f", a, np.cross(b, c))
    middles = points[0] + (a + b + c) / 4
    centre = weights @ middles / weights.sum()
    spread = np.einsum("f,fi,fj->ij", weights, middles - centre, middles - centre) / weights.sum()
    return float(np.ptp(vertices @ np.linalg.eigh(spread)[1], axis=0).min())


def placed(body: manifold3d.Manifold, T: np.ndarray) -> manifold3d.Manifold:
    return body.transform(T[:3])


def boxes_meet(a: manifold3d.Manifold, b: manifold3d.Manifold) -> bool:
    box_a, box_b = np.array(a.bounding_box()), np.array(b.bounding_box())
    return bool((box_a[:3] <= box_b[3:]).all() and (box_b[:3] <= box_a[3:]).all())


class Surfaces:
    """Distances to the two surfaces of a pair: the deepest point that they share is as deep as it is far from one."""

    def __init__(self, assembly: Assembly) -> None:
        self.meshes = {p.name: (np.array(p.vertices_part), p.faces.astype(np.int64)) for p in assembly.parts}

    def depth(self, common: manifold3d.Manifold, places: dict[str, np.ndarray]) -> float:
        """Return the greatest distance of the shared body's surface from either surface, no signs needed.

        Looked at on edges of even length: of a plate within another, the middle of the large faces is deepest.
        """
        if common.is_empty() or common.volume() <= 0.0:
            return 0.0
        grain = float(np.sqrt(common.surface_area() / POINTS))
        points = np.array(common.refine_to_length(grain).to_mesh64().vert_properties[:, :3])
        out = 0.0
        for name, T in places.items():
            seen = np.ascontiguousarray((points - T[:3, 3]) @ T[:3, :3])
            out = max(out, float(np.sqrt(igl.point_mesh_squared_distance(seen, *self.meshes[name])[0].max())))
        return out


def resampled(path: np.ndarray) -> list[np.ndarray]:
    """Return poses along the geodesics of a path, evenly over its segments' translation."""
    lengths = np.linalg.norm(np.diff(path[:, :3, 3], axis=0), axis=1) + 1e-12
    out = []
    for a, b, length in zip(path[:-1], path[1:], lengths, strict=True):
        start, end = RigidTransform.from_matrix(a), RigidTransform.from_matrix(b)
        twist = (start.inv() * end).as_exp_coords()
        turned = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).magnitude()
        count = max(3, round(POSES_PER_STEP * length / lengths.sum()), int(np.ceil(turned / 0.2)))
        for u in np.linspace(0.0, 1.0, count, endpoint=False):
            out.append((start * RigidTransform.from_exp_coords(u * twist)).as_matrix())
    return [*out, path[-1]]


if __name__ == "__main__":
    main()
