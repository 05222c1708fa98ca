"""What the search for a cheaper order brings: hands, ways from above, turns of direction, fasteners in turn, time.

    python benchmarks/order_cost.py [NAME ...]

Each real assembly of three and more parts is planned twice: in the order that is found first, and in the cheapest that
is found. Both plans are counted by the same cost. Assemblies that the result file has already are not planned again;
remove it to begin anew. Figures are of complete plans, by kind. Time is processor time, of this process.
"""

from __future__ import annotations

import json
import sys
import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from common import SHARED, chosen, kind_of, machine, parser, table, write_json

from sashimono.assembly import Assembly, Part
from sashimono.io.read import read_assembly
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan

COUNTED = ("held", "not_from_above", "from_below", "direction_changes", "interrupted_runs", "fasteners_out_of_turn")
VARIANTS = {"first": False, "cheapest": True}


def main() -> None:
    options = parser(__doc__, "order_cost.json").parse_args()
    known = json.loads(options.json.read_text())["assemblies"] if options.json.exists() else []
    rows: dict[str, dict[str, Any]] = {row["name"]: row for row in known}
    # what is loaded or compiled once counts for neither variant
    for searched in VARIANTS.values():
        planned(boxes(), searched)
    for folder in chosen(SHARED / "assemblies", options.names):
        parts = read_assembly(folder, unit="mm")
        if folder.name in rows or len(parts) < 3:
            continue
        row: dict[str, Any] = {"name": folder.name, "kind": kind_of(folder.name, len(parts)), "parts": len(parts)}
        for variant, searched in VARIANTS.items():
            row[variant] = planned(parts, searched)
        rows[folder.name] = row
        costs = " -> ".join(str(row[variant]["cost"]) for variant in VARIANTS)
        print(f"{folder.name}: {costs}", file=sys.stderr, flush=True)
        content = {"machine": machine(), "summary": summarise([*rows.values()]), "assemblies": [*rows.values()]}
        write_json(options.json, content)
    for kind, figures in summarise([*rows.values()]).items():
        print(f"\n{kind}\n")
        print(table(["", *VARIANTS], ([name, *values] for name, values in figures.items())))


def boxes() -> Assembly:
    """Return three boxes on one another."""
    parts = []
    for k in range(3):
        box = trimesh.creation.box((0.02, 0.02, 0.02))
        pose = np.eye(4)
        pose[2, 3] = 0.02 * k
        parts.append(Part(name=f"box_{k}", vertices_part=box.vertices, faces=box.faces, T_world_part=pose))
    return Assembly(parts=tuple(parts))


def planned(parts: Assembly, searched: bool) -> dict[str, Any]:
    """Return what one plan comes to."""
    config = PipelineConfig()
    search = replace(config.sequence.search, enabled=searched)
    config = replace(config, sequence=replace(config.sequence, search=search))
    start = time.process_time()
    plan = plan_assembly(parts, config=config)
    return {**figures_of(plan), "seconds": round(time.process_time() - start, 2)}


def figures_of(plan: AssemblyPlan) -> dict[str, Any]:
    """Return the terms of a plan's cost, and whether it can be carried out with two hands, and with one."""
    most = max((step.hands or 0 for step in plan.all_steps), default=0)
    terms = {} if plan.cost is None else {term: plan.cost.terms[term] for term in COUNTED}
    return {
        "complete": plan.status == "complete",
        "two_hands": bool(plan.executable),
        "one_hand": bool(plan.executable) and most <= 1,
        "contacts": sum(step.contact is not None for step in plan.all_steps if step.moves),
        "moving": sum(step.moves for step in plan.all_steps),
        "hands": most,
        "fixture": plan.fixture is not None,
        "cost": None if plan.cost is None else round(plan.cost.total, 3),
        **terms,
    }


def summarise(rows: Sequence[dict[str, Any]]) -> dict[str, dict[str, list[Any]]]:
    """Return, by kind and over all, each figure for both variants: sums of yes, means of numbers."""
    by_kind = defaultdict(list)
    for row in rows:
        by_kind[row["kind"]].append(row)
        by_kind["all"].append(row)
    return {kind: _figures(found) for kind, found in sorted(by_kind.items())}


def _figures(rows: Sequence[dict[str, Any]]) -> dict[str, list[Any]]:
    out: dict[str, list[Any]] = {"assemblies": [len(rows)] * len(VARIANTS)}
    for name in ("complete", "two_hands", "one_hand", "fixture"):
        out[name] = [sum(row[variant][name] for row in rows) for variant in VARIANTS]
    out["contacts"] = [f"{_sum(rows, v, 'contacts')}/{_sum(rows, v, 'moving')}" for v in VARIANTS]
    both = [row for row in rows if all(row[variant]["complete"] for variant in VARIANTS)]
    for name in ("hands", "cost", *COUNTED):
        out[f"mean {name}"] = [
            round(float(np.mean([row[variant][name] for row in both])), 2) if both else None for variant in VARIANTS
        ]
    first, last = VARIANTS
    ratios = [row[last]["seconds"] / row[first]["seconds"] for row in rows]
    out["median time over the first"] = [1.0, round(float(np.median(ratios)), 2)]
    return out


def _sum(rows: Sequence[dict[str, Any]], variant: str, name: str) -> int:
    return sum(row[variant][name] for row in rows)


if __name__ == "__main__":
    main()
