"""Algorithm 1: success and time, inertia against world axes, one worker against a batch, beside the paper's figures.

    python benchmarks/physics.py [NAME ...] [--sets truth assemblies] [--max-parts 14] [--workers N]

Success: all parts but one leave. Every assembly named is in the denominator, also one that cannot be taken apart.
"As printed" follows no slippage screws; isExec is left out. The paper's figures are of its own data set and GPU.
"""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

from common import SHARED, chosen, kind_of, machine, parser, table, write_json

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.disassembly.blocking import Blocking, BlockingConfig
from sashimono.disassembly.physics import PhysicsConfig
from sashimono.io.read import read_assembly

PRINTED = PhysicsConfig(slippage_pushes=False)
VARIANTS = {
    "inertia axes, as printed": PRINTED,
    "world axes, as printed": replace(PRINTED, axes="world"),
    "inertia axes and slippage": PhysicsConfig(),
}


def main() -> None:
    arguments = parser(__doc__, "physics.json")
    arguments.add_argument("--sets", nargs="+", default=["truth"], help="folders of the test data")
    arguments.add_argument("--max-parts", type=int, default=14, help="larger assemblies are left out, and named")
    arguments.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="of the batch")
    options = arguments.parse_args()
    rows, left_out = [], []
    for folder in [path for name in options.sets for path in chosen(SHARED / name, options.names)]:
        assembly = read_assembly(folder, unit="mm")
        if len(assembly) > options.max_parts:
            left_out.append(folder.name)
            continue
        rows += measure(folder, assembly, options.workers)
    write_json(options.json, {"machine": machine(), "workers": options.workers, "left out": left_out, "runs": rows})
    keys = ("name", "variant", "workers", "success", "removed", "ms")
    print(table(keys, ([row[key] for key in keys] for row in rows)))
    print("\n" + table(("variant", "workers", "success", "mean ms"), summary(rows)))
    print("\nPaper: inertia axes 92.7 %, Assemble-Them-All's axes 83.8 %; batch 3,592 ms, one worker 24,312.6 ms.")
    print(f"left out, more than {options.max_parts} parts: {', '.join(left_out) or 'none'}")


def measure(folder: Path, assembly: Assembly, workers: int) -> list[dict]:
    """Return the runs of one assembly: every variant with one worker, the first one in a batch too."""
    rows = []
    for k, (variant, physics) in enumerate(VARIANTS.items()):
        for count in (1, workers) if k == 0 and workers > 1 else (1,):
            start = time.perf_counter()
            blocking = Blocking(assembly, make_bodies(assembly), config=BlockingConfig())
            found = plan_disassembly(blocking, config=Algorithm1Config(physics=physics, workers=count))
            rows.append(
                {
                    "name": folder.name,
                    "kind": kind_of(folder.name, len(assembly)),
                    "variant": variant,
                    "workers": count,
                    "success": len(found.removals) == len(assembly) - 1,
                    "removed": f"{len(found.removals)}/{len(assembly) - 1}",
                    "ms": round(1e3 * (time.perf_counter() - start), 1),
                }
            )
    return rows


def summary(rows: list[dict]) -> list[tuple[object, ...]]:
    """Return success and mean time of every variant and number of workers."""
    out = []
    for key in dict.fromkeys((row["variant"], row["workers"]) for row in rows):
        runs = [row for row in rows if (row["variant"], row["workers"]) == key]
        good = sum(row["success"] for row in runs)
        share = f"{good}/{len(runs)} = {100.0 * good / len(runs):.1f} %"
        out.append((*key, share, round(sum(row["ms"] for row in runs) / len(runs), 1)))
    return out


if __name__ == "__main__":
    main()
