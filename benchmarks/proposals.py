"""What a learned order saves level 1: questions asked until the first complete order, by whose order is tried first.

    python benchmarks/proposals.py [NAME ...] [--network past-posed] [--least-parts 3]

Each assembly of ``shared/assemblies`` is taken apart three times from nothing: in the cascade's own order, in the
network's, and in a random one. A question is "can this part leave these others?"; a hard one goes on to threads,
several legs or physics. A wrong proposal costs a question; the order is complete all the same. Nothing is verified
here: `plan --method past` verifies every step.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import SHARED, chosen, kind_of, machine, parser, table, write_json

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.separation import Separation, Stage
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.io.read import read_assembly
from sashimono.learning.infer import assembly_clouds, encode_clouds, load_network, take_apart

HARD = ("thread", "translation", "physics")


class CountingCascade(Cascade):
    """Counts the questions by the stage that they are put to."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.asked: Counter[str] = Counter()
        along = self.directions.along

        def counted(*args: Any, **kwargs: Any) -> Separation | None:
            self.asked["blocking"] += 1
            return along(*args, **kwargs)

        self.directions.along = counted

    def _ask(self, stage: Stage, part: int, remaining: int, max_traced: int) -> Separation:
        self.asked[stage.name] += 1
        return super()._ask(stage, part, remaining, max_traced)


def main() -> None:
    arguments = parser(__doc__, "proposals.json")
    arguments.add_argument("--network", default="past-posed")
    arguments.add_argument("--least-parts", type=int, default=3)
    options = arguments.parse_args()
    network = load_network(options.network)
    rng = np.random.default_rng(0)
    orders: dict[str, Callable[[Assembly], Sequence[int]]] = {
        "cascade": lambda assembly: (),
        "network": lambda assembly: take_apart(
            encode_clouds(assembly_clouds(assembly, network.relations), network), network
        ),
        "random": lambda assembly: rng.permutation(len(assembly)).tolist(),
    }
    rows = []
    for folder in chosen(SHARED / "assemblies", options.names):
        assembly = read_assembly(folder, unit="mm")
        if len(assembly) >= options.least_parts:
            rows.append(measure(folder, assembly, orders))
            print(table(list(rows[-1]), [list(rows[-1].values())]).splitlines()[-1], flush=True)
    summary = {who: summarise([row[who] for row in rows]) for who in orders}
    hard = [row for row in rows if any(row["cascade"][stage] for stage in HARD)]
    if hard:
        summary |= {f"{who}, with hard questions": summarise([row[who] for row in hard]) for who in orders}
    write_json(options.json, {"machine": machine(), "summary": summary, "assemblies": rows})
    head = list(next(iter(summary.values())))
    print("\n" + table(["order", *head], ([who, *values.values()] for who, values in summary.items())))


def measure(folder: Path, assembly: Assembly, orders: dict[str, Callable[[Assembly], Sequence[int]]]) -> dict[str, Any]:
    """Return the questions and seconds of one assembly by each order."""
    row: dict[str, Any] = {"name": folder.name, "kind": kind_of(folder.name, len(assembly)), "parts": len(assembly)}
    for who, order in orders.items():
        start = time.process_time()
        proposed = order(assembly)
        proposing = time.process_time() - start
        cascade = CountingCascade(assembly, make_bodies(assembly), config=SeparateConfig())
        start = time.process_time()
        found = find_disassembly(cascade, config=SequenceConfig(), proposed=proposed)
        row[who] = {
            "complete": not found.stuck,
            "questions": cascade.asked.total(),
            **{stage: cascade.asked[stage] for stage in ("blocking", *HARD)},
            "seconds": round(time.process_time() - start, 3),
            "proposing": round(proposing, 3),
        }
    return row


def summarise(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return sums over assemblies, and medians of processor time."""
    return {
        "assemblies": len(rows),
        "complete": sum(row["complete"] for row in rows),
        "questions": sum(row["questions"] for row in rows),
        "hard": sum(row[stage] for row in rows for stage in HARD),
        "physics": sum(row["physics"] for row in rows),
        "median s": round(float(np.median([row["seconds"] for row in rows])), 3),
        "sum s": round(sum(row["seconds"] for row in rows), 1),
    }


if __name__ == "__main__":
    main()
