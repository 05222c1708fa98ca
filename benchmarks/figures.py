"""Write the README's figures from the results of the other benchmarks.

    python benchmarks/truth.py && python benchmarks/real_cad.py --second-opinion && python benchmarks/speed.py --cold
    python benchmarks/figures.py

Replaces what stands between the figures markers of README.md; a missing result is an error.
"""

from __future__ import annotations

import json
from pathlib import Path

from common import REPOSITORY, table

BEGIN, END = "<!-- figures:begin -->", "<!-- figures:end -->"
RESULTS = REPOSITORY / "benchmarks" / "results"


def main() -> None:
    readme = REPOSITORY / "README.md"
    text = readme.read_text()
    head, rest = text.split(BEGIN)
    _, tail = rest.split(END)
    readme.write_text(f"{head}{BEGIN}\n{figures()}\n{END}{tail}")


def figures() -> str:
    """Return the figures section."""
    truth, real, speed = (load(RESULTS / name) for name in ("truth.json", "real_cad.json", "speed.json"))
    where = real["machine"]
    rows = [
        [
            kind,
            f"{s['ended']} of {s['assemblies']}",
            f"**{s['complete']}** of {s['assemblies']}",
            s["refuted"],
            f"{s['median_cpu_s']} s",
            f"{s['worst_cpu_s']} s",
            f"{s['worst_mb']} MB",
        ]
        for kind, s in real["summary"].items()
    ]
    queries = sum(row["queries"] for row in truth["assemblies"])
    free, missed, blocked = (
        sum(row[key] for row in truth["assemblies"]) for key in ("false free", "missed", "false blocked")
    )
    return "\n\n".join(
        [
            f"Measured on {where['cores']} cores of {where['processor']}, Python {where['python']}, {where['date']}, "
            "whole processes, two at a time, processor time; failures stay in the denominator.",
            "Real CAD from public repositories (`python benchmarks/real_cad.py --second-opinion`; refuted: complete "
            "plans against which a third check, by exact booleans along the motion, found anything):",
            table(("kind", "ended", "complete and verified", "refuted", "median", "worst", "peak memory"), rows),
            f"Removal conditions against exact answers, {len(truth['assemblies'])} assemblies, {queries:,} queries "
            f"(`python benchmarks/truth.py`): {free} false “free”; {blocked} false “blocked”, {missed} of them where "
            "one translation would do.",
            "Whole commands (`python benchmarks/speed.py --cold`):",
            table(
                ("command", "processor time", "wall time", "peak memory"),
                (
                    [f"`sashimono {r['command']}`", f"{r['cpu_s']} s", f"{r['wall_s']} s", f"{r['peak_mb']:.0f} MB"]
                    for r in speed["commands"]
                ),
            ),
        ]
    )


def load(path: Path) -> dict:
    if not path.exists():
        raise SystemExit(f"{path} is missing: run the benchmark that writes it first")
    return json.loads(path.read_text())


if __name__ == "__main__":
    main()
