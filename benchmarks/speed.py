"""Whole-process time of ``sashimono plan`` and ``sashimono demo``: processor and wall time, median of some runs.

    python benchmarks/speed.py [--runs 5] [--cold]

One run before that is not counted (it fills the caches of compiled code); ``--cold`` measures that first
run too, with an empty cache.
"""

from __future__ import annotations

import statistics
import tempfile

from common import SHARED, machine, parser, run_sashimono, table, write_json


def main() -> None:
    arguments = parser(__doc__, "speed.json")
    arguments.add_argument("--runs", type=int, default=5, help="counted runs of each command")
    arguments.add_argument("--cold", action="store_true", help="also the demo's first run with nothing compiled")
    options = arguments.parse_args()
    rows = [measure("demo", ["demo"], options.runs)]
    for name in options.names or ["bolt_stack", "gearbox14"]:
        folder = SHARED / "truth" / name
        if not folder.is_dir():
            raise SystemExit(f"{folder} is absent; set SASHIMONO_SHARED to the folder that holds truth/")
        rows.append(measure(f"plan {name}", ["plan", str(folder), "--unit", "mm"], options.runs))
    if options.cold:
        rows.append(measure_cold())
    write_json(options.json, {"machine": machine(), "commands": rows})
    keys = ("command", "exit", "runs", "cpu_s", "wall_s", "peak_mb")
    print(table(keys, ([row[key] for key in keys] for row in rows)))


def measure(name: str, command: list[str], runs: int) -> dict:
    """Return medians over some runs after one that is not counted."""
    with tempfile.TemporaryDirectory() as out:
        found = [run([*command, "--out", out]) for _ in range(runs + 1)][1:]
    return summary(name, found)


def measure_cold() -> dict:
    """Return the figures of one demo run that must compile everything."""
    with tempfile.TemporaryDirectory() as out, tempfile.TemporaryDirectory() as cache:
        return summary("demo, nothing compiled", [run(["demo", "--out", out], NUMBA_CACHE_DIR=cache)])


def summary(name: str, found: list[dict]) -> dict:
    exits = sorted({row["exit"] for row in found})
    medians = {key: round(statistics.median(row[key] for row in found), 2) for key in ("cpu_s", "wall_s", "peak_mb")}
    return {"command": name, "exit": exits[0] if len(exits) == 1 else exits, "runs": len(found), **medians}


def run(arguments: list[str], **environment: str) -> dict[str, object]:
    """Run the command line once and return exit status, seconds and peak memory."""
    return run_sashimono(arguments, **environment).figures


if __name__ == "__main__":
    main()
