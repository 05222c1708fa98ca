"""Time and memory of level 1: removal conditions and a first order, one core, warm.

    python benchmarks/level1.py [NAME ...] [--generated N ...] [--single]

Assemblies of ``shared/truth`` and generated ones: stacks of rings on a post, boards with pegs, gear
trains between plates, bolted flanges, blocks boxed under a lid and tilted against the axes. Each runs
four times in one process (two over 40 parts), and the first is not counted. ``--single`` leaves out the
later stages (translations in several legs) of the removal conditions. Also: time of one query.
"""

from __future__ import annotations

import resource
import time

import manifold3d
import numpy as np
from common import SHARED, chosen, machine, parser, table, write_json

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.io.read import read_assembly

Manifold = manifold3d.Manifold


def main() -> None:
    arguments = parser(__doc__, "level1.json")
    arguments.add_argument("--generated", type=int, nargs="*", default=[5, 10, 20, 40, 80, 150], help="sizes")
    arguments.add_argument("--single", action="store_true", help="removal conditions by single translations only")
    options = arguments.parse_args()
    config = SeparateConfig(max_queries=0) if options.single else SeparateConfig()
    rows = []
    for size in options.generated:
        for make in (ring_stack, pegged_board, gear_train, bolted_flanges, boxed_blocks):
            rows.append(measure(f"{make.__name__}_{size}", make(size), config))
            print(table(list(rows[-1]), [list(rows[-1].values())]).splitlines()[-1], flush=True)
    if options.names:
        for folder in chosen(SHARED / "truth", options.names):
            rows.append(measure(folder.name, read_assembly(folder, unit="mm"), config))
    content = {"machine": machine(), "single": options.single, "assemblies": rows, "curve": curve(rows)}
    write_json(options.json, content)
    print("\n" + table(list(rows[0]), ([row[key] for key in rows[0]] for row in rows)))
    print(f"\nmedian seconds by size: {content['curve']}")


def measure(name: str, assembly: Assembly, config: SeparateConfig) -> dict[str, object]:
    """Return the seconds of the runs after the first (processor time, median) and what was found."""
    seconds = []
    for _ in range(4 if len(assembly) <= 40 else 2):
        start = time.process_time()
        cascade = Cascade(assembly, make_bodies(assembly), config=config)
        conditions = cascade.conditions()
        middle = time.process_time()
        result = find_disassembly(cascade, config=SequenceConfig())
        seconds.append((middle - start, time.process_time() - middle))
    first, second = np.median(seconds[1:], axis=0).tolist()
    everything = cascade.parts.all_parts
    begin = time.process_time()
    for _ in range(100):
        conditions.removable(everything)
    query = (time.process_time() - begin) / 100
    return {
        "name": name,
        "parts": len(assembly),
        "conditions s": round(first, 3),
        "order s": round(second, 3),
        "removed": len(result.removals),
        "clauses": sum(len(c) for c in conditions.clauses),
        "cut short": len(conditions.cut_short),
        "query ms": round(1e3 * query, 4),
        "peak MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }


def curve(rows: list[dict]) -> dict[str, object]:
    """Return median and p90 seconds (conditions and order) by number of parts, and the medians' exponent."""
    sizes = sorted({row["parts"] for row in rows})
    seconds = {size: [r["conditions s"] + r["order s"] for r in rows if r["parts"] == size] for size in sizes}
    median = {size: round(float(np.median(seconds[size])), 3) for size in sizes}
    p90 = {size: round(float(np.percentile(seconds[size], 90)), 3) for size in sizes}
    exponent = None
    if len(sizes) > 1:
        exponent = round(float(np.polyfit(np.log(sizes), np.log([max(median[s], 1e-3) for s in sizes]), 1)[0]), 2)
    return {"median s": median, "p90 s": p90, "exponent": exponent}


def ring_stack(count: int) -> Assembly:
    """Rings on a post between two flanges of one part and a cap."""
    post = Manifold.cylinder(0.004 * count + 0.01, 0.005, 0.005, 32) + Manifold.cylinder(0.004, 0.02, 0.02, 32)
    parts = {"post": post}
    for k in range(count - 1):
        radius = 0.012 + 0.004 * (k % 3)
        ring = Manifold.cylinder(0.004, radius, radius, 32) - Manifold.cylinder(0.004, 0.0051, 0.0051, 32)
        parts[f"ring{k}"] = ring.translate((0.0, 0.0, 0.004 + 0.004 * k))
    return _assembly(parts)


def pegged_board(count: int) -> Assembly:
    """A board with blocks on it, each held by a peg through it into the board."""
    blocks = (count - 1) // 2
    columns = int(np.ceil(np.sqrt(max(1, blocks))))
    board = Manifold.cube((0.03 * columns, 0.03 * columns, 0.01))
    parts: dict[str, Manifold] = {}
    for k in range(count - 1):
        x, y = 0.03 * (k // 2 % columns) + 0.015, 0.03 * (k // 2 // columns) + 0.015
        hole = Manifold.cylinder(0.02, 0.004, 0.004, 24).translate((x, y, 0.004))
        if k % 2 == 0:
            board -= hole
            parts[f"block{k // 2}"] = Manifold.cube((0.02, 0.02, 0.01)).translate((x - 0.01, y - 0.01, 0.01)) - hole
        else:
            head = Manifold.cylinder(0.004, 0.007, 0.007, 24).translate((x, y, 0.02))
            shank = Manifold.cylinder(0.016, 0.00395, 0.00395, 24).translate((x, y, 0.004))
            parts[f"peg{k // 2}"] = head + shank
    return _assembly({"board": board} | parts)


def gear_train(count: int) -> Assembly:
    """Meshing gears on pins between two plates."""
    pairs = max(1, (count - 2) // 2)
    base = Manifold.cube((0.0202 * pairs + 0.03, 0.04, 0.006)).translate((-0.025, -0.02, -0.006))
    parts: dict[str, Manifold] = {}
    cover = base.translate((0.0, 0.0, 0.018))
    for k in range(count - 2):
        x = 0.0202 * (k // 2)
        if k % 2 == 0:
            teeth = [_tooth(j, 12, 0.5 * (k // 2 % 2)) for j in range(12)]
            bore = Manifold.cylinder(0.012, 0.0031, 0.0031, 24)
            gear = Manifold.batch_boolean([Manifold.cylinder(0.008, 0.0088, 0.0088, 48), *teeth], manifold3d.OpType.Add)
            parts[f"gear{k // 2}"] = (gear - bore).translate((x, 0.0, 0.001))
            hole = Manifold.cylinder(0.03, 0.00305, 0.00305, 24).translate((x, 0.0, -0.004))
            base, cover = base - hole, cover - hole
        else:
            parts[f"pin{k // 2}"] = Manifold.cylinder(0.02, 0.003, 0.003, 24).translate((x, 0.0, -0.004))
    return _assembly({"base": base, "cover": cover} | parts)


def bolted_flanges(count: int) -> Assembly:
    """Flanges in a row along x, each bolted to the one before by two bolts."""
    parts: dict[str, Manifold] = {}
    sideways = (0.0, 90.0, 0.0)
    for k in range((count + 2) // 3):
        parts[f"flange{k}"] = Manifold.cylinder(0.01, 0.025, 0.025, 48).rotate(sideways).translate((0.01 * k, 0.0, 0.0))
    for k in range(count - len(parts)):
        angle, flange = np.pi * (k % 2 + 0.37 * (k // 2)), k // 2
        y, z = 0.017 * np.cos(angle), 0.017 * np.sin(angle)
        head = Manifold.cylinder(0.004, 0.0035, 0.0035, 6)
        shank = Manifold.cylinder(0.014, 0.0018, 0.0018, 24).translate((0.0, 0.0, -0.014))
        bolt = (head + shank).rotate(sideways).translate((0.01 * flange + 0.016, y, z))
        room = Manifold.cylinder(0.0041, 0.004, 0.004, 24) + Manifold.cylinder(0.016, 0.0019, 0.0019, 24).translate(
            (0.0, 0.0, -0.016)
        )
        hollow = room.rotate(sideways).translate((0.01 * flange + 0.016, y, z))
        parts = {name: solid - hollow if name.startswith("flange") else solid for name, solid in parts.items()}
        parts[f"bolt{k}"] = bolt
    return _assembly(parts)


def boxed_blocks(count: int) -> Assembly:
    """Blocks side by side in the pockets of a box, under a lid that sits in its rim; tilted."""
    columns = int(np.ceil(np.sqrt(count - 2)))
    side = 0.02 * columns + 0.004
    box = Manifold.cube((side, side, 0.02)) - Manifold.cube((side - 0.004, side - 0.004, 0.006)).translate(
        (0.002, 0.002, 0.016)
    )
    lid = Manifold.cube((side - 0.0042, side - 0.0042, 0.004)).translate((0.0021, 0.0021, 0.016))
    parts: dict[str, Manifold] = {}
    for k in range(count - 2):
        x, y = 0.02 * (k % columns) + 0.004, 0.02 * (k // columns) + 0.004
        box -= Manifold.cube((0.016, 0.016, 0.016)).translate((x, y, 0.002))
        parts[f"block{k}"] = Manifold.cube((0.0158, 0.0158, 0.0138)).translate((x + 0.0001, y + 0.0001, 0.002))
    tilted = {"box": box, "lid": lid} | parts
    return _assembly({name: solid.rotate((17.0, 31.0, 53.0)) for name, solid in tilted.items()})


def _tooth(index: int, count: int, shift: float) -> Manifold:
    tooth = Manifold.cube((0.004, 0.0018, 0.008)).translate((0.0074, -0.0009, 0.0))
    return tooth.rotate((0.0, 0.0, 360.0 * (index + shift) / count))


def _assembly(solids: dict[str, Manifold]) -> Assembly:
    parts = []
    for name, solid in solids.items():
        mesh = solid.to_mesh64()
        vertices = np.array(mesh.vert_properties[:, :3])
        faces = np.array(mesh.tri_verts, dtype=np.int32)
        parts.append(Part(name=name, vertices_part=vertices, faces=faces, T_world_part=np.eye(4)))
    return Assembly(parts=tuple(parts))


if __name__ == "__main__":
    main()
