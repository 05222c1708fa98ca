"""Whole-process planning of real CAD assemblies: ended, complete, refuted, time and memory.

    python benchmarks/real_cad.py [NAME ...] [--jobs 2] [--second-opinion] [--method past]

Each assembly is planned by ``sashimono plan`` in a process of its own. Failures stay in the
denominator, each with its reason. ``--second-opinion`` looks at every complete plan once more by a
third route, exact boolean intersections along the motion (`second_opinion.py`).

An input that is one bought part is refused as such ("bought whole"): it is neither planned nor a failure, and stays in
the denominator. Complete plans in which loose parts were taken as bought (a bearing, a rod in its cylinder) are counted
apart as well ("with sets").
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from common import SHARED, chosen, kind_of, machine, parser, run_sashimono, table, write_json
from second_opinion import refutations

NOTHING = "nothing to assemble"
"""What the command says of an input that is one bought part."""


def main() -> None:
    arguments = parser(__doc__, "real_cad.json")
    arguments.add_argument("--jobs", type=int, default=1, help="processes at a time; 1 for figures of time")
    arguments.add_argument("--second-opinion", action="store_true", help="check complete plans by booleans as well")
    arguments.add_argument("--method", default="cascade", help="what proposes the order: cascade or past")
    options = arguments.parse_args()
    folders = chosen(SHARED / "assemblies", options.names)
    with ThreadPoolExecutor(options.jobs) as pool:
        rows = []
        for row in pool.map(lambda folder: measure(folder, options.method, second=options.second_opinion), folders):
            rows.append(row)
            print(f"{row['name']}: {row['status']}, exit {row['exit']}, {row['cpu_s']} s", file=sys.stderr, flush=True)
    summary = summarise(rows)
    write_json(options.json, {"machine": machine(), "summary": summary, "assemblies": rows})
    columns = ("kind", "assemblies", "ended", "complete", "with fits", "with sets", "bought whole", "refuted")
    print(
        table(
            (*columns, "median cpu s", "p90 cpu s", "worst cpu s", "worst MB"),
            ([kind, *values.values()] for kind, values in summary.items()),
        )
    )
    for row in rows:
        for fit in row.get("fits", []):
            print(f"- {row['name']}: fit declared, {' and '.join(fit['parts'])}, {fit['kind']}; {fit['reason']}")
        if row["status"] != "complete":
            print(f"- {row['name']} ({row['kind']}, {row['parts']} parts): {row['reason']}")


def measure(folder: Path, method: str, *, second: bool) -> dict:
    """Plan one assembly and return what came of it."""
    parts = len(list(folder.glob("*.obj")))
    row = {"name": folder.name, "kind": kind_of(folder.name, parts), "parts": parts}
    with tempfile.TemporaryDirectory() as out:
        ran = run_sashimono(["plan", str(folder), "--out", out, "--unit", "mm", "--method", method])
        row |= ran.figures
        path = Path(out) / "plan.json"
        if ran.exit == 2 and ran.errors and NOTHING in ran.errors[-1]:
            reason = ran.errors[-1].replace(str(folder), folder.name)
            return row | {"status": "bought whole", "reason": reason, "refuted": []}
        if ran.exit not in (0, 3) or not path.exists():
            reason = ran.errors[-1] if ran.errors else "no plan.json"
            return row | {"status": "crashed", "reason": reason, "refuted": []}
        plan = json.loads(path.read_text())
        try:
            refuted = refutations(path, folder) if second and plan["status"] == "complete" else []
        except Exception as error:  # hours of other rows are not lost for it; it counts against the plan
            refuted = [f"the second opinion failed: {error!r}"]
    return row | {
        "status": plan["status"],
        "refuted": refuted,
        "grasps": sum(step["contact"] is not None for step in plan["steps"]),
        "subassemblies": sum("subassembly" in step for step in plan["steps"]),
        "timings": plan.get("timings"),
        "fits": plan.get("fits", []),
        "reason": "; ".join(reasons(plan["unsolved"])),
        "kept": [f"{entry['product']}: {entry['reason']}" for entry in plan["source"].get("kept", ())],
        "sets": sum("members" in entry for entry in plan["source"].get("kept", ())),
    }


def reasons(unsolved: list[dict]) -> list[str]:
    """Return what is said of the parts without a step, once for all of which the same is said."""
    alike: dict[tuple[str, str], list[str]] = defaultdict(list)
    for entry in unsolved:
        alike[entry["answer"], entry["reason"]].append(entry["part"])
    return [
        f"{names[0]}{f' and {len(names) - 1} more' if len(names) > 1 else ''} {answer} ({reason})"
        for (answer, reason), names in alike.items()
    ]


def summarise(rows: list[dict]) -> dict[str, dict]:
    """Return the counts by kind and for all."""
    kinds: dict[str, list[dict]] = defaultdict(list)
    for row in rows:
        kinds[row["kind"]].append(row)
        kinds["all"].append(row)
    return {
        kind: {
            "assemblies": len(group),
            "ended": sum(row["exit"] in (0, 3) or row["status"] == "bought whole" for row in group),
            "complete": sum(row["status"] == "complete" for row in group),
            "with_fits": sum(row["status"] == "complete" and bool(row.get("fits")) for row in group),
            "with_sets": sum(row["status"] == "complete" and row["sets"] > 0 for row in group),
            "bought_whole": sum(row["status"] == "bought whole" for row in group),
            "refuted": sum(bool(row["refuted"]) for row in group),
            "median_cpu_s": sorted(row["cpu_s"] for row in group)[len(group) // 2],
            "p90_cpu_s": sorted(row["cpu_s"] for row in group)[int(0.9 * len(group))],
            "worst_cpu_s": max(row["cpu_s"] for row in group),
            "worst_mb": max(row["peak_mb"] for row in group),
        }
        for kind, group in sorted(kinds.items(), key=lambda item: (item[0] == "all", item[0]))
    }


if __name__ == "__main__":
    main()
