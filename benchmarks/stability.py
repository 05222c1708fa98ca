"""Which plans can be carried out with two hands, and with one, by kind?

    python benchmarks/stability.py [NAME ...] [--plans FOLDER]

With ``--plans FOLDER``, plans are read from NAME.json there; those that are missing are made and written. Besides hands
are counted: placed parts that touch nothing and that nobody holds, and pairs of which a fastener comes before what it
clamps, or a nut before its bolt.

Whether a simulation agrees on what stands: `stability_simulation.py`.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import SHARED, chosen, kind_of, machine, parser, table, write_json

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.io.plan_json import read_plan, write_plan
from sashimono.io.read import read_assembly
from sashimono.pipeline import plan_assembly
from sashimono.plan import AssemblyPlan, Subassembly, step_tables
from sashimono.stability import StabilityConfig, Touching


def main() -> None:
    arguments = parser(__doc__, "stability.json")
    arguments.add_argument("--plans", type=Path, help="folder of plans to read, or to write where they are missing")
    options = arguments.parse_args()
    rows: list[dict[str, Any]] = []
    for folder in chosen(SHARED / "assemblies", options.names):
        parts = read_assembly(folder, unit="mm")
        if len(parts) < 3:
            continue
        plan = plan_of(folder.name, parts, options.plans)
        rows.append(row_of(folder, plan, parts))
        print(f"{folder.name}: {plan.verdict}", file=sys.stderr, flush=True)
    summary = summarise(rows)
    write_json(options.json, {"machine": machine(), "summary": summary, "assemblies": rows})
    heads = ("kind", *next(iter(summary.values())))
    print(table(heads, ([kind, *values.values()] for kind, values in summary.items())))


def plan_of(name: str, parts: Assembly, plans: Path | None) -> AssemblyPlan:
    """Return the plan of an assembly: the one that is kept, or a new one."""
    path = None if plans is None else plans / f"{name}.json"
    if path is not None and path.exists():
        return read_plan(path)
    plan = plan_assembly(parts)
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_plan(plan, path)
    return plan


def row_of(folder: Path, plan: AssemblyPlan, parts: Assembly) -> dict[str, Any]:
    """Return what one plan says of hands."""
    most = max((step.hands or 0 for step in plan.all_steps), default=0)
    return {
        "name": folder.name,
        "kind": kind_of(folder.name, len(plan.parts)),
        "parts": len(plan.parts),
        "complete": plan.status == "complete",
        "two_hands": bool(plan.executable),
        "one_hand": bool(plan.executable) and most <= 1,
        "held": max((len(step.held) for step in plan.all_steps), default=0),
        "hands": most,
        "fixture": plan.fixture is not None,
        "turned_over": sum(step.turned for step in plan.all_steps),
        "close_fits": sum(bool(step.close_fits) for step in plan.all_steps),
        "floating": floating(plan, parts),
        "out_of_turn": 0.0 if plan.cost is None else plan.cost.terms["fasteners_out_of_turn"],
        "cost": None if plan.cost is None else plan.cost.total,
        "terms": {} if plan.cost is None else dict(plan.cost.terms),
    }


def floating(plan: AssemblyPlan, parts: Assembly) -> list[str]:
    """Return the placed parts that touch neither table, fixture nor what is in place, and that nobody holds."""
    poses = {part.name: part.T_world_part for part in parts.parts}
    touching = Touching(make_bodies(parts), poses, config=StabilityConfig())
    out: list[str] = []

    def look(level: AssemblyPlan | Subassembly) -> None:
        fixed = () if level.fixture is None else level.fixture.parts
        for step, on in zip(level.steps, step_tables(level.steps, level.table), strict=True):
            near = any(len(touching.between(a, b).points) for a in step.members for b in step.fixed)
            joined = any(touching.fastened(a, b) for a in step.members for b in step.fixed)
            stands = on is not None and any(len(touching.on_table(a, on).points) for a in step.members)
            if not (near or joined or stands or {*step.members} & {*step.held, *fixed}):
                out.append(step.part)
            if step.subassembly is not None:
                look(step.subassembly)

    look(plan)
    return out


def summarise(rows: Sequence[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the shares by kind."""
    by_kind = defaultdict(list)
    for row in rows:
        by_kind[row["kind"]].append(row)
        by_kind["all"].append(row)
    return {
        kind: {
            "assemblies": len(found),
            "complete": sum(row["complete"] for row in found),
            "two hands": sum(row["two_hands"] for row in found),
            "one hand": sum(row["one_hand"] for row in found),
            "mean most held": round(float(np.mean([row["held"] for row in found])), 2),
            "fixture": sum(row["fixture"] for row in found),
            "turned over": sum(row["turned_over"] for row in found),
            "close fits": sum(row["close_fits"] for row in found),
            "floating": sum(len(row["floating"]) for row in found),
            "out of turn": sum(row["out_of_turn"] for row in found),
        }
        for kind, found in sorted(by_kind.items())
    }


if __name__ == "__main__":
    main()
