"""Level 3 on real assemblies: steps with a contact by kind and gripper, milliseconds a step, wrong contacts.

    python benchmarks/contact.py 'automate_*' --grippers --json benchmarks/results/contact.json

Each assembly is planned with fingertips. Counted are the steps that have a motion. Contacts are judged by
`sashimono.verify`, which shares no code with level 3, before the plan drops what it refutes: a part is wrong
if any contact of it ever was, in any attempt. Times are those of level 3
alone, processor time of one thread, per step.
"""

from __future__ import annotations

import statistics
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

from common import SHARED, chosen, kind_of, machine, parser, table, write_json

import sashimono
from sashimono import tree
from sashimono.contact import REAL_TOOLS
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.verify import Verifier


def main() -> None:
    options = parser(__doc__, "contact.json")
    options.add_argument("--grippers", action="store_true", help="also ask which real grippers can take each part")
    arguments = options.parse_args()
    tools = REAL_TOOLS if arguments.grippers else ()
    rows: list[dict[str, Any]] = []
    for folder in chosen(SHARED / "assemblies", arguments.names):
        rows += measure(folder, tools)
        print(f"{folder.name}: {sum(row['assembly'] == folder.name for row in rows)} steps", flush=True)
    summary = summarise(rows, tools)
    write_json(arguments.json, {"machine": machine(), "summary": summary, "steps": rows})
    head = ("kind", "steps", "contact", "grasp", "taken over", "push", "wrong", "median ms", *tools)
    print(table(head, ([kind, *values.values()] for kind, values in summary.items())))


def measure(folder: Path, grippers: tuple[str, ...]) -> list[dict[str, Any]]:
    """Plan one assembly; return a row for each step that has a motion."""
    seconds, wrong = [], set()
    choose, check = tree.choose_contacts, Verifier.check

    def timed(level, order, *rest, report=(), **options):
        start = time.process_time()
        found = choose(level, order, *rest, **options)
        seconds.append((time.process_time() - start, max(1, len(order) - 1)))
        if not report:
            return found
        asked = choose(level, order, *rest, report=report, **(options | {"progress": None}))
        return {name: found[name]._replace(grippers=asked[name].grippers) for name in found}

    def judged(verifier, plan, *rest, **options):
        report = check(verifier, plan, *rest, **options)
        wrong.update(step.part for entry in report.steps for step in entry.all_steps() if step.contact_problems)
        return report

    tree.choose_contacts, Verifier.check = timed, judged
    try:
        assembly = sashimono.read_assembly(folder, unit="mm")
        plan = plan_assembly(assembly, config=PipelineConfig(grippers=grippers))
    finally:
        tree.choose_contacts, Verifier.check = choose, check
    kind = kind_of(folder.name, len(assembly))
    spent = 1e3 * sum(second for second, _ in seconds) / max(1, sum(count for _, count in seconds))
    rows = []
    for step in plan.all_steps:
        if len(step.motion.T_world_part) < 2:
            continue
        contact = step.contact
        rows.append(
            {
                "assembly": folder.name,
                "kind": kind,
                "part": step.part,
                "contact": None if contact is None else contact.kind,
                "from_pose": 0.0 if contact is None else contact.details.get("from_pose", 0.0),
                "wrong": step.part in wrong,
                "reason": step.contact_reason,
                "milliseconds": round(spent, 2),
                "grippers": {name: said is None for name, said in step.grippers.items()},
            }
        )
    return rows


def summarise(rows: list[dict[str, Any]], tools: tuple[str, ...]) -> dict[str, dict[str, object]]:
    """Return the counts by kind and for all; a gripper's count is of the steps that it can do."""
    kinds: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows:
        kinds[row["kind"]].append(row)
        kinds["all"].append(row)
    return {
        kind: {
            "steps": len(group),
            "contact": sum(row["contact"] is not None for row in group),
            "grasp": sum(row["contact"] == "grasp" and row["from_pose"] == 0.0 for row in group),
            "taken over": sum(row["contact"] == "grasp" and row["from_pose"] > 0.0 for row in group),
            "push": sum(row["contact"] == "push" for row in group),
            "wrong": sum(row["wrong"] for row in group),
            "median ms": round(statistics.median(row["milliseconds"] for row in group), 1),
            **{name: sum(row["grippers"].get(name, False) for row in group) for name in tools},
        }
        for kind, group in sorted(kinds.items(), key=lambda item: (item[0] == "all", item[0]))
    }


if __name__ == "__main__":
    main()
