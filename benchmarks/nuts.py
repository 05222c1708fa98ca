"""Nuts on bolts with truth by construction: each comes off by its thread, and no other way.

    python benchmarks/nuts.py [--count 200] [--seed 0] [--json benchmarks/results/nuts.json]

M4 to M24, coarse and fine pitch, right- and left-hand, with a radial clearance of 0 to 5 % of the diameter, 12 to 64
facets a turn, any length, any phase of the nut (where there is no clearance, ridges are then drawn into each other),
and the whole turned at random. Solved is one whose plan is complete, verified, and turns.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
from collections import Counter
from pathlib import Path

import manifold3d
import numpy as np
from common import REPOSITORY, machine, table, write_json

from sashimono.assembly import Assembly, Part
from sashimono.geometry import se3
from sashimono.pipeline import PipelineConfig, plan_assembly

COARSE = {4: 0.7, 5: 0.8, 6: 1.0, 8: 1.25, 10: 1.5, 12: 1.75, 16: 2.0, 20: 2.5, 24: 3.0}
"""Nominal diameter and pitch of ISO 261 [mm]."""
FINE = {4: 0.5, 5: 0.5, 6: 0.75, 8: 1.0, 10: 1.25, 12: 1.25, 16: 1.5, 20: 1.5, 24: 2.0}


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=200)
    options.add_argument("--seed", type=int, default=0)
    options.add_argument("--only", type=int, default=None, metavar="K", help="the one of this number")
    options.add_argument("--json", type=Path, default=REPOSITORY / "benchmarks" / "results" / "nuts.json")
    arguments = options.parse_args()
    numbers = range(arguments.count) if arguments.only is None else [arguments.only]
    rows = []
    for k in numbers:
        rows.append(measure(k, arguments.seed))
        print(rows[-1], file=sys.stderr, flush=True)
    solved = sum(row["solved"] for row in rows)
    seconds = sorted(row["cpu_s"] for row in rows)
    summary = {
        "nuts": len(rows),
        "solved": solved,
        "share": round(solved / len(rows), 3),
        "median cpu s": round(float(np.median(seconds)), 2),
        "worst cpu s": seconds[-1],
        "not solved, by cause": dict(Counter(row["reason"] for row in rows if not row["solved"])),
    }
    if arguments.only is None:
        write_json(arguments.json, {"machine": machine(), "summary": summary, "nuts": rows})
    print(table(("", "figure"), summary.items()))


def measure(number: int, seed: int) -> dict[str, object]:
    """Draw one nut on its bolt, plan it, and return what came of it."""
    size, assembly = draw(np.random.default_rng([seed, number]))
    start = time.process_time()
    plan = plan_assembly(assembly, config=PipelineConfig(contacts=False))
    turned = max((turns(step.motion.T_world_part) for step in plan.steps), default=0.0)
    solved = plan.status == "complete" and turned > 1.0
    reason = "" if solved else plan.unsolved[0].reason if plan.unsolved else "not turned"
    return {
        "number": number,
        **size,
        "solved": solved,
        "cpu_s": round(time.process_time() - start, 2),
        "reason": reason,
    }


def turns(poses: np.ndarray) -> float:
    """Return by how many turns a path turns in all."""
    return float(sum(np.linalg.norm(se3.log(se3.inverse(a) @ b)[3:]) for a, b in itertools.pairwise(poses))) / 2 / np.pi


def draw(rng: np.random.Generator) -> tuple[dict[str, object], Assembly]:
    """Return what is drawn, and the assembly."""
    diameter = int(rng.choice(list(COARSE)))
    pitch = (COARSE if rng.random() < 0.7 else FINE)[diameter]
    hand = -1 if rng.random() < 0.2 else 1
    clearance = 0.0 if rng.random() < 0.3 else float(rng.uniform(0.0, 0.05))
    facets = int(rng.integers(12, 65))
    length = float(rng.uniform(1.5, 4.0)) * diameter
    height = float(rng.uniform(0.6, 1.0)) * diameter
    phase = float(rng.uniform(0.0, 360.0))
    at = float(rng.uniform(0.0, max(length - height, 0.0)))
    shaft = thread(diameter, pitch, hand, facets, length, 0.0)
    head = hexagon(1.6 * diameter, 0.65 * diameter).translate((0.0, 0.0, -0.65 * diameter))
    hole = thread(diameter, pitch, hand, facets, height + 2.0 * pitch, clearance * diameter / 2.0)
    # where it stands along the bolt and how it is turned belong together; the phase is what CAD gets wrong
    hole = hole.translate((0.0, 0.0, -pitch)).rotate((0.0, 0.0, hand * 360.0 * (at - pitch) / pitch + phase))
    nut = (hexagon(1.7 * diameter, height) - hole).translate((0.0, 0.0, at))
    T = se3.make(rotation(rng), rng.uniform(-0.1, 0.1, 3))
    drawn = {
        "thread": f"M{diameter}x{pitch}{'-LH' if hand < 0 else ''}",
        "clearance": round(clearance, 4),
        "facets": facets,
        "phase": round(phase, 1),
    }
    return drawn, Assembly(parts=(part("bolt", head + shaft, T), part("nut", nut, T)))


def thread(diameter: float, pitch: float, hand: int, facets: int, length: float, wider: float) -> manifold3d.Manifold:
    """Return a threaded rod [mm] from z = 0 on: a ridge of the ISO profile, wound about a core, facets as CAD has them.

    The basic profile has a crest of 1/8 and a root of 1/4 of the pitch, flanks of 60° between them.
    """
    depth = 5.0 / 8.0 * 0.866 * pitch
    outer = diameter / 2.0 + wider
    inner, sunk = outer - depth, 0.05 * depth
    # radius and height of the ridge's corners; it is sunk a little into the core
    profile = np.array(
        [
            [inner - sunk, -(3.0 / 8.0 + 0.01) * pitch],
            [outer, -pitch / 16.0],
            [outer, pitch / 16.0],
            [inner - sunk, (3.0 / 8.0 + 0.01) * pitch],
        ]
    )
    steps = np.arange(int(np.ceil(facets * (length / pitch + 2.0))) + 1)
    angles, rise = 2.0 * np.pi * steps / facets, pitch * steps / facets - pitch
    vertices = np.stack(
        [
            profile[None, :, 0] * np.cos(angles)[:, None],
            profile[None, :, 0] * np.sin(angles)[:, None],
            profile[None, :, 1] + rise[:, None],
        ],
        axis=2,
    ).reshape(-1, 3)
    corner = np.arange(4)
    here = (4 * steps[:-1, None] + corner).reshape(-1)
    beside = (4 * steps[:-1, None] + (corner + 1) % 4).reshape(-1)
    faces = np.concatenate(
        [
            np.stack([here, here + 4, beside], axis=1),
            np.stack([beside, here + 4, beside + 4], axis=1),
            [[0, 1, 2], [0, 2, 3]],
            4 * steps[-1] + np.array([[0, 2, 1], [0, 3, 2]]),
        ]
    )
    ridge = manifold3d.Manifold(manifold3d.Mesh64(vert_properties=vertices, tri_verts=faces.astype(np.uint64)))
    if ridge.volume() < 0.0 or ridge.status() != manifold3d.Error.NoError:
        raise AssertionError(f"the ridge is no solid: {ridge.status()}, {ridge.volume()} mm³")
    core = manifold3d.Manifold.cylinder(length, inner, inner, facets)
    rod = core + (ridge ^ manifold3d.Manifold.cylinder(length, 2.0 * outer, 2.0 * outer, 8))
    return rod if hand > 0 else rod.mirror((1.0, 0.0, 0.0))


def hexagon(width: float, height: float) -> manifold3d.Manifold:
    """Return a hexagonal prism [mm] of this width across flats, from z = 0 on."""
    return manifold3d.CrossSection.circle(width / np.sqrt(3.0), 6).extrude(height)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """Return a rotation, all equally likely (Shoemake 1992)."""
    w, x, y, z = (quaternion := rng.normal(size=4)) / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def part(name: str, solid: manifold3d.Manifold, T: np.ndarray) -> Part:
    """Return a part in place, in metres."""
    mesh = solid.to_mesh64()
    vertices = 1e-3 * np.asarray(mesh.vert_properties)[:, :3]
    return Part(name=name, vertices_part=vertices, faces=np.asarray(mesh.tri_verts).astype(np.int32), T_world_part=T)


if __name__ == "__main__":
    main()
