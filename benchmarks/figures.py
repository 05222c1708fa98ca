"""Write the README's figures from the results of the other benchmarks.

    python benchmarks/truth.py && python benchmarks/speed.py --cold
    python benchmarks/real_cad.py --jobs 2 --second-opinion
    python benchmarks/level1.py --generated 5 10 20 40 --json benchmarks/results/level1.json
    python benchmarks/level1.py --single --json benchmarks/results/level1_single.json
    python benchmarks/contact.py
    python benchmarks/contact.py --grippers --json benchmarks/results/contact_tools.json
    python benchmarks/motion.py --truth --json benchmarks/results/motion_truth.json
    python benchmarks/motion.py --rrt 6
    python benchmarks/figures.py

Replaces what stands between the figures markers of README.md; a missing result is an error.
"""

from __future__ import annotations

import json
from pathlib import Path

from common import REPOSITORY, table

BEGIN, END = "<!-- figures:begin -->", "<!-- figures:end -->"
RESULTS = REPOSITORY / "benchmarks" / "results"
REAL_UNITS = ("mechanical", "pairs")
"""Kinds whose files say how large things are: furniture and puzzles are drawn in units of no meaning."""


def main() -> None:
    readme = REPOSITORY / "README.md"
    text = readme.read_text()
    head, rest = text.split(BEGIN)
    _, tail = rest.split(END)
    readme.write_text(f"{head}{BEGIN}\n{figures()}\n{END}{tail}")


def figures() -> str:
    """Return the figures section."""
    names = (
        "truth",
        "real_cad",
        "speed",
        "level1_single",
        "level1",
        "contact",
        "contact_tools",
        "motion",
        "motion_truth",
    )
    truth, real, speed, single, level1, contact, tools, motion, motion_truth = (
        load(RESULTS / f"{name}.json") for name in names
    )
    where = real["machine"]
    rows = [
        [
            kind,
            f"{s['ended']} of {s['assemblies']}",
            f"**{s['complete']}** of {s['assemblies']}{given(s)}",
            s.get("bought_whole", 0),
            s["refuted"],
            f"{s['median_cpu_s']} s",
            f"{s['p90_cpu_s']} s",
            f"{s['worst_cpu_s']} s",
            f"{s['worst_mb']} MB",
        ]
        for kind, s in real["summary"].items()
    ]
    queries = sum(row["queries"] for row in truth["assemblies"])
    keys = ("false free", "false blocked", "disputed", "clauses", "refuted")
    free, blocked, disputed, clauses, refuted = (sum(row[key] for row in truth["assemblies"]) for key in keys)
    sizes = list(single["curve"]["median s"])
    return "\n\n".join(
        [
            f"Measured on {where['cores']} cores of {where['processor']}, Python {where['python']}, processor time "
            "unless said otherwise; failures stay in the denominator. Each figure says of which commit it is.",
            "Real CAD from public repositories (`python benchmarks/real_cad.py --jobs 2 --second-opinion`; with fits: "
            "an elastic part has to give, declared in the plan; with bought sets: parts that only go together, such as "
            "a bearing's, kept as one; bought whole: the input is one bearing; refuted: complete plans against which a "
            f"third check, by exact booleans along the motion, found anything; {taken(real)}):",
            table(
                (
                    "kind",
                    "ended",
                    "complete and verified",
                    "bought whole",
                    "refuted",
                    "median",
                    "90th percentile",
                    "worst",
                    "peak memory",
                ),
                rows,
            ),
            f"Removal conditions against exact answers, {len(truth['assemblies'])} assemblies, {queries:,} queries "
            f"(`python benchmarks/truth.py`; {taken(truth)}): {free} false “free”, {blocked} false “blocked”, "
            f"{disputed} disputed (the table is wrong, by a motion that the verifier and exact booleans confirm). Of "
            f"the {clauses} clauses' witness motions the verifier refutes {refuted}.",
            motions(motion, motion_truth["summary"]),
            "Contacts of the same assemblies' steps that have a motion, with fingertips; wrong: refuted by the check, "
            "normals off by more than 5° included; milliseconds of level 3 a step, one thread "
            f"(`python benchmarks/contact.py`; {taken(contact)}):",
            contacts(contact["summary"]),
            f"Steps that a real tool can do all the way (`python benchmarks/contact.py --grippers`; {taken(tools)}): "
            f"{shares(tools['summary'])}.",
            "Removal conditions and a first order, one process, warm, processor time, generated assemblies of five "
            f"families (first row: `python benchmarks/level1.py --single`, {taken(single)}; the others, slower beyond, "
            f"were taken up to 40 parts: `python benchmarks/level1.py --generated 5 10 20 40`, {taken(level1)}):",
            table(
                ("", *(f"{size} parts" for size in sizes)),
                (
                    [name, *(f"{1e3 * row[size]:.0f} ms" if size in row else "" for size in sizes)]
                    for name, row in (
                        ("median, single translations", single["curve"]["median s"]),
                        ("median, with several legs, turns and proofs", level1["curve"]["median s"]),
                        ("90th percentile of the latter", level1["curve"]["p90 s"]),
                    )
                ),
            ),
            f"Time grows with the number of parts to the power of {single['curve']['exponent']}.",
            f"Whole commands (`python benchmarks/speed.py --cold`; {taken(speed)}):",
            table(
                ("command", "processor time", "wall time", "peak memory"),
                (
                    [f"`sashimono {r['command']}`", f"{r['cpu_s']} s", f"{r['wall_s']} s", f"{r['peak_mb']:.0f} MB"]
                    for r in speed["commands"]
                ),
            ),
        ]
    )


def given(summary: dict) -> str:
    """Return in brackets how many of the complete plans rest on declared fits, and on sets kept as bought."""
    counts = ((summary.get("with_fits", 0), "with fits"), (summary.get("with_sets", 0), "with bought sets"))
    said = ", ".join(f"{count} {words}" for count, words in counts if count)
    return f" ({said})" if said else ""


def motions(motion: dict, truth: dict) -> str:
    """Return the figures of level 2, beside RRT-Connect alone."""
    said, (step, found) = motion["summary"], ("steps with a removal", "steps with a motion")
    given = next(key for key in said if key.startswith("steps given to RRT-Connect (ours)"))
    seconds = given.split(", ")[1]
    return (
        f"Motions from the tray to the assembled pose (`python benchmarks/motion.py --rrt 6`; {taken(motion)}): "
        f"{said[found]} of {said[step]} steps that have a removal on real CAD, {truth[found]} of {truth[step]} of the "
        f"truth set; all motions of an assembly take {1e3 * said['median s an assembly']:.0f} ms in the median, "
        f"{said['p99 s']:.1f} s at the 99th percentile, {said['worst s']:.1f} s at worst. Given the {said[given]} "
        f"steps of the small ones from the same resting poses, with {seconds}, RRT-Connect alone finds "
        f"{said['found by RRT-Connect (ours)']}, OMPL's with our collision check "
        f"{said['found by RRT-Connect (ompl)']}."
    )


COUNTS = ("steps", "contact", "grasp", "taken over", "push", "wrong", "median ms")


def contacts(summary: dict) -> str:
    """Return the table of contacts by kind of assembly."""
    return table(("kind", *COUNTS), ([kind, *(row[name] for name in COUNTS)] for kind, row in summary.items()))


def shares(summary: dict) -> str:
    """Return the real tools' shares of all steps of a kind, where the files say how large things are."""
    said = []
    for kind in REAL_UNITS:
        row = summary[kind]
        tools = [f"{name} {100 * row[name] / row['steps']:.0f} %" for name in row if name not in COUNTS]
        said.append(f"{kind}: {', '.join(tools)}")
    return "; ".join(said)


def taken(result: dict) -> str:
    """Return when and of which commit a result was taken."""
    return f"{result['machine']['date']}, commit {result['machine']['commit']}"


def load(path: Path) -> dict:
    if not path.exists():
        raise SystemExit(f"{path} is missing: run the benchmark that writes it first")
    return json.loads(path.read_text())


if __name__ == "__main__":
    main()
