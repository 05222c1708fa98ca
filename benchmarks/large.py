"""Large products: the whole command `plan`, with its check, on generated products of 150 and 500 parts.

    python benchmarks/large.py [NAME ...] [--sizes 150 500] [--limit 900]

*rack*: modules of five parts (tray, board, two pins through it, lid) in the bays of a frame, one flat list of parts.
*tree*: the same with each module a product of its own, in a GLB file: put together on a bench, brought as one.
*side_by_side*: real CAD, whole products beside one another on the table, until there are enough parts.
A run that takes longer than the limit (wall seconds) is stopped, and counts as not planned.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from common import SHARED, chosen, machine, parser, run_sashimono, table, write_json
from manifold3d import Manifold
from second_opinion import leaves

from sashimono.io.read import read_assembly

MODULE = 5
"""Parts of one module of the rack."""
ROW = 10
"""Bays of the frame in a row."""
PITCH = 0.06
"""From bay to bay [m]."""
NEIGHBOURS = ("pythonocc_demos_as1_pe_203", "the_x_blade_gearbox", "flatxy_assembly", "hexapod_leg")
"""Real products that stand side by side."""


def main() -> None:
    arguments = parser(__doc__, "large.json")
    arguments.add_argument("--sizes", type=int, nargs="*", default=[150, 500], help="parts")
    arguments.add_argument("--limit", type=float, default=900.0, help="wall seconds of one run")
    options = arguments.parse_args()
    makers: dict[str, Callable[[int, Path], Path]] = {"rack": rack, "tree": tree, "side_by_side": side_by_side}
    rows = []
    for size in options.sizes:
        for name, make in makers.items():
            if options.names and name not in options.names:
                continue
            rows.append(measure(name, size, make, options.limit))
            print(rows[-1], file=sys.stderr, flush=True)
    write_json(options.json, {"machine": machine(), "products": rows})
    print(table(list(rows[0]), ([row[key] for key in rows[0]] for row in rows)))


def measure(name: str, size: int, make: Callable[[int, Path], Path], limit: float) -> dict[str, object]:
    """Return what planning one product took, as a process of its own, and what came of it."""
    with tempfile.TemporaryDirectory() as folder:
        source, out = make(size, Path(folder)), Path(folder) / "out"
        unit = ["--unit", "mm"] if source.is_dir() else []
        ran = run_sashimono(["plan", str(source), "--out", str(out), "--quiet", *unit], limit=limit)
        path = out / "plan.json"
        plan = json.loads(path.read_text()) if path.exists() else None
        return {
            "name": name,
            "parts": size,
            **ran.figures,
            "verify_s": None if plan is None else round(plan["timings"].get("verify", 0.0), 1),
            "status": "not planned" if plan is None else plan["status"],
            "placed": 0 if plan is None else len(set(leaves(plan["steps"]))),
            "overlaps": None if plan is None else len(plan["overlaps"]),
        }


def modules(count: int) -> tuple[Manifold, list[dict[str, Manifold]]]:
    """Return a frame with a bay for each module, and the modules' parts in place [m]; in all so many parts."""
    bays, rest = divmod(count - 1, MODULE)
    bays += rest > 0
    rows = -(-bays // ROW)
    wide, deep = PITCH * min(bays, ROW), PITCH * rows
    frame = Manifold.cube((wide, deep, 0.05)).translate((-0.005, -0.005, -0.01))
    found: list[dict[str, Manifold]] = []
    for bay in range(bays):
        at = (PITCH * (bay % ROW), PITCH * (bay // ROW), 0.0)
        frame -= Manifold.cube((0.0502, 0.0502, 0.1)).translate((at[0] - 0.0001, at[1] - 0.0001, 0.0))
        hole = Manifold.cylinder(0.1, 0.0021, 0.0021, 24)
        holes = hole.translate((0.015, 0.025, 0.002)) + hole.translate((0.035, 0.025, 0.002))
        tray = Manifold.cube((0.05, 0.05, 0.03)) - Manifold.cube((0.044, 0.044, 0.04)).translate((0.003, 0.003, 0.006))
        pin = Manifold.cylinder(0.008, 0.002, 0.002, 24) + Manifold.cylinder(0.003, 0.004, 0.004, 24).translate(
            (0.0, 0.0, 0.008)
        )
        parts = {
            "tray": tray - holes,
            "board": Manifold.cube((0.0436, 0.0436, 0.004)).translate((0.0032, 0.0032, 0.006)) - holes,
            "pin1": pin.translate((0.015, 0.025, 0.002)),
            "pin2": pin.translate((0.035, 0.025, 0.002)),
            "lid": Manifold.cube((0.0436, 0.0436, 0.004)).translate((0.0032, 0.0032, 0.026))
            + Manifold.cube((0.05, 0.05, 0.003)).translate((0.0, 0.0, 0.03)),
        }
        found.append({f"{name}_{bay + 1}": solid.translate(at) for name, solid in parts.items()})
    for _ in range(MODULE * bays + 1 - count):  # the last one is not full
        found[-1].popitem()
    return frame, found


def rack(count: int, folder: Path) -> Path:
    """Write the rack as a flat folder of meshes [mm]."""
    out = folder / "rack"
    out.mkdir()
    frame, found = modules(count)
    for name, solid in {"frame": frame, **{name: part for parts in found for name, part in parts.items()}}.items():
        mesh(solid, 1000.0).export(out / f"{name}.obj")
    return out


def tree(count: int, folder: Path) -> Path:
    """Write the rack with each module as a product of its own."""
    frame, found = modules(count)
    scene = trimesh.Scene()
    scene.add_geometry(mesh(frame, 1.0), node_name="frame", geom_name="frame")
    for bay, parts in enumerate(found):
        product = f"module_{bay + 1}"
        scene.graph.update(frame_to=product, frame_from="world", matrix=np.eye(4))
        for name, part in parts.items():
            scene.add_geometry(mesh(part, 1.0), node_name=name, geom_name=name, parent_node_name=product)
    path = folder / "rack.glb"
    scene.export(path)
    return path


def side_by_side(count: int, folder: Path) -> Path:
    """Write real products beside one another, on one table, as a flat folder of meshes [mm]; the last is cut short."""
    out = folder / "products"
    out.mkdir()
    products = [read_assembly(path, unit="mm") for name in NEIGHBOURS for path in chosen(SHARED / "assemblies", [name])]
    written, at = 0, 0.0
    for turn in range(count):
        product = products[turn % len(products)]
        points = np.concatenate([part.vertices_world for part in product.parts])
        low, high = points.min(axis=0), points.max(axis=0)
        for part in product.parts[: count - written]:
            moved = part.vertices_world - low + [at, 0.0, 0.0]
            trimesh.Trimesh(1000.0 * moved, part.faces, process=False).export(out / f"{part.name}_{turn}.obj")
            written += 1
        at += float(high[0] - low[0]) + 0.02
        if written == count:
            break
    return out


def mesh(solid: Manifold, scale: float) -> trimesh.Trimesh:
    """Return a solid's mesh, scaled."""
    made = solid.to_mesh64()
    return trimesh.Trimesh(scale * np.array(made.vert_properties[:, :3]), made.tri_verts, process=False)


if __name__ == "__main__":
    main()
