"""Algorithm 1: success and time, inertia against world axes, a batch against one worker, beside the paper's figures.

    python benchmarks/physics.py [NAME ...] [--sets truth assemblies] [--max-parts 22] [--workers N]

Every assembly is planned as it was read, where most parts stand along the world's axes, and under one rotation
drawn at random, the same for all. Success: all parts but one leave. Every assembly named is in the denominator, also
one that cannot be taken apart, and one that runs out of the budget. "As printed" follows no slippage screws. The time
is Algorithm 1's alone; what is worked out before it, once for all variants, is in its own column. `verify` judges
all removals of the variant with one worker in a run of its own, not timed. The paper's figures are of its own data
set, simulator and GPU.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from common import SHARED, chosen, kind_of, machine, parser, table, write_json
from scipy.spatial.transform import Rotation

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.contact import ContactConfig, Executability
from sashimono.disassembly.physics.search import PhysicsConfig
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.sequence.algorithm1 import Algorithm1Config, plan_disassembly
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.geometry import se3
from sashimono.io.read import read_assembly
from sashimono.verify import VerifyConfig
from sashimono.verify.body import SampledBody
from sashimono.verify.overlap import AssembledOverlaps
from sashimono.verify.pairs import check_pair, pair_tolerance
from sashimono.verify.sweep import Screws

PRINTED = PhysicsConfig(slippage_pushes=False)
PAPER = (
    ("paper: inertia axes, batch on a GPU", "", "92.7 %", "3592.0"),
    ("paper: Assemble-Them-All, one worker", "", "83.8 %", "24312.6"),
)
KEYS = ("name", "variant", "pose", "success", "removed", "refuted", "ms", "cpu_ms", "reason")
SUMMARY = ("variant", "pose", "success", "mean ms", "median ms", "mean CPU ms", "out of budget", "refuted")


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One way to run Algorithm 1."""

    name: str
    physics: PhysicsConfig = PRINTED
    executable: bool = False
    workers: int = 1
    rotated: bool = True
    """Whether the rotated assemblies are run too."""


def main() -> None:
    arguments = parser(__doc__, "physics.json")
    arguments.add_argument("--sets", nargs="+", default=["truth", "assemblies"], help="folders of the test data")
    arguments.add_argument("--max-parts", type=int, default=22, help="larger assemblies are left out, and named")
    arguments.add_argument("--max-traced", type=int, default=40_000_000, help="budget of one run, in tracing steps")
    arguments.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="of the batch")
    arguments.add_argument("--seed", type=int, default=0, help="of the rotation")
    options = arguments.parse_args()
    variants = [
        Variant(name="inertia axes"),
        Variant(name="world axes", physics=replace(PRINTED, axes="world")),
        Variant(name=f"inertia axes, batch on {options.workers} workers", workers=options.workers, rotated=False),
        Variant(name="inertia axes, isExec", executable=True, rotated=False),
        Variant(name="inertia axes and slippage", physics=PhysicsConfig()),
    ]
    folders = [path for name in options.sets for path in chosen(SHARED / name, options.names or ["*"])]
    loaded = sorted(((read_assembly(path, unit="mm"), path) for path in folders), key=_work)
    left_out = [path.name for assembly, path in loaded if len(assembly) > options.max_parts]
    T = se3.make(Rotation.random(rng=np.random.default_rng(options.seed)).as_matrix())
    rows: list[dict] = []
    taken_on = machine()  # now: what is committed while this runs is not what runs
    for assembly, path in loaded:
        if len(assembly) <= options.max_parts:
            for row in measure(path, assembly, T, variants, options.max_traced):
                rows.append(row)
                print(*(row[key] for key in KEYS), sep=" | ", flush=True)
            content = {"machine": taken_on, "max traced": options.max_traced, "left out": left_out, "runs": rows}
            write_json(options.json, content)
    print("\n" + table(SUMMARY, [*summary(rows), *((*row, "", "", "", "") for row in PAPER)]))
    print(f"\nleft out, more than {options.max_parts} parts: {', '.join(left_out) or 'none'}")


def measure(
    folder: Path, assembly: Assembly, T: np.ndarray, variants: Sequence[Variant], max_traced: int
) -> Iterator[dict]:
    """Yield the runs of one assembly: all variants as it was read, and those that ask for it rotated by T."""
    for pose, moved in (("as read", assembly), ("rotated", rotated(assembly, T))):
        start = time.perf_counter()
        bodies = make_bodies(moved)
        parts = PlacedParts(moved, bodies, config=PlacedPartsConfig())
        for body in parts.bodies:
            assert body.signed_distance is not None
            assert len(body.hull_points)
        before = round(1e3 * (time.perf_counter() - start), 1)
        for variant in variants:
            if pose == "rotated" and not variant.rotated:
                continue
            found, counted = run(moved, bodies, parts, variant, max_traced)
            yield {
                "name": folder.name,
                "kind": kind_of(folder.name, len(assembly)),
                "parts": len(assembly),
                "variant": variant.name,
                "pose": pose,
                "success": len(found.removals) == len(assembly) - 1,
                "removed": f"{len(found.removals)}/{len(assembly) - 1}",
                "refuted": refuted(moved, found) if variant.workers == 1 else [],
                **counted,
                "before_ms": before,
                "reason": next((separation.reason for _, separation in found.stuck), ""),
            }


def run(
    assembly: Assembly, bodies: dict, parts: PlacedParts, variant: Variant, max_traced: int
) -> tuple[DisassemblyResult, dict]:
    """Return what one variant found, and what it took."""
    config = Algorithm1Config(physics=variant.physics, workers=variant.workers, max_traced=max_traced)
    options = {}
    if variant.executable:
        rng = np.random.default_rng(0)
        options["is_executable"] = Executability(assembly, bodies, gripper=None, config=ContactConfig(), rng=rng)
    wall, processor = time.perf_counter(), time.process_time()
    found = plan_disassembly(parts, config=config, **options)
    ms = 1e3 * (time.perf_counter() - wall)
    return found, {"ms": round(ms, 1), "cpu_ms": round(1e3 * (time.process_time() - processor), 1)}


def refuted(assembly: Assembly, found: DisassemblyResult) -> list[str]:
    """Return what the check finds wrong with the removals."""
    config = VerifyConfig()
    bodies = {
        part.name: SampledBody(part.name, part.vertices_part, part.faces, samples=config.samples)
        for part in assembly.parts
    }
    poses = {part.name: part.T_world_part for part in assembly.parts}
    overlaps = AssembledOverlaps(bodies, poses, config)
    remaining = list(assembly.names)
    problems = []
    for departure in found.removals:
        name = assembly.names[departure.part]
        remaining.remove(name)
        removal = departure.separation.removal
        assert removal is not None, "what left has a way out"
        path = Screws.between(removal.displacements[::-1] @ poses[name])
        for other in remaining:
            finding = check_pair(
                bodies[name],
                bodies[other],
                path,
                poses[other],
                overlaps=overlaps,
                tolerance=pair_tolerance(bodies[name], bodies[other], config),
                config=config,
            )
            if finding.problem:
                problems.append(f"{name}: {finding.problem}")
    return problems


def rotated(assembly: Assembly, T: np.ndarray) -> Assembly:
    """Return the assembly moved as a whole."""
    return replace(assembly, parts=tuple(replace(part, T_world_part=T @ part.T_world_part) for part in assembly.parts))


def summary(rows: list[dict]) -> list[tuple[object, ...]]:
    """Return success and time of every variant and pose."""
    out = []
    for key in dict.fromkeys((row["variant"], row["pose"]) for row in rows):
        runs = [row for row in rows if (row["variant"], row["pose"]) == key]
        good = sum(row["success"] for row in runs)
        ms = [row["ms"] for row in runs]
        out.append(
            (
                *key,
                f"{good}/{len(runs)} = {100.0 * good / len(runs):.1f} %",
                round(statistics.mean(ms), 1),
                round(statistics.median(ms), 1),
                round(statistics.mean(row["cpu_ms"] for row in runs), 1),
                sum("budget" in row["reason"] for row in runs),
                sum(bool(row["refuted"]) for row in runs),
            )
        )
    return out


def _work(loaded: tuple[Assembly, Path]) -> tuple[int, int, str]:
    assembly, path = loaded
    return len(assembly), sum(len(part.faces) for part in assembly.parts), path.name


if __name__ == "__main__":
    main()
