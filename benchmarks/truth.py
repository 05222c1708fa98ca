"""Removal conditions against exact answers: false "free" and false "blocked" over all remaining sets.

    python benchmarks/truth.py [NAME ...]

All non-empty sets of remaining parts for up to 12 parts; beyond, 4,000 random sets and every set on
1,000 random disassembly orders. A false "blocked" is looked at again with 2,000 even directions: if
one of them frees the part by a single translation, it counts as missed; if none does, the part needs
a rotation or more than one translation.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
from common import SHARED, chosen, machine, parser, table, write_json

from sashimono.bodies import make_bodies
from sashimono.disassembly.blocking import bits
from sashimono.disassembly.clauses import RemovalConditions, minimal
from sashimono.disassembly.separate import Cascade, SeparateConfig
from sashimono.geometry.directions import sphere_directions
from sashimono.io.read import read_assembly


def main() -> None:
    options = parser(__doc__, "truth.json").parse_args()
    rows = [measure(folder) for folder in chosen(SHARED / "truth", options.names)]
    write_json(options.json, {"machine": machine(), "assemblies": rows})
    keys = ("name", "parts", "queries", "false free", "false blocked", "missed", "s")
    print(table(keys, ([row[key] for key in keys] for row in rows)))
    totals = {key: sum(row[key] for row in rows) for key in ("queries", "false free", "false blocked", "missed")}
    print("\n" + ", ".join(f"{key}: {value}" for key, value in totals.items()))


def measure(folder: Path) -> dict:
    """Return the counts for one assembly."""
    assembly = read_assembly(folder, unit="mm")
    truth = Truth(json.loads((folder / "truth.json").read_text()), assembly.names)
    start = time.process_time()
    cascade = Cascade(assembly, make_bodies(assembly), config=SeparateConfig())
    conditions = cascade.conditions()
    seconds = time.process_time() - start
    queries = free = 0
    blocked: dict[int, list[int]] = {}
    for remaining in remaining_sets(truth, conditions, len(assembly)):
        said = conditions.removable(remaining)
        for part in bits(remaining):
            queries += 1
            right, told = truth.removable(part, remaining), bool(said >> part & 1)
            free += told and not right
            if right and not told:
                blocked.setdefault(part, []).append(remaining)
    missed = {part: sum(1 for _ in sets if cascade_misses(cascade, part, sets)) for part, sets in blocked.items()}
    return {
        "name": folder.name,
        "parts": len(assembly),
        "queries": queries,
        "false free": free,
        "false blocked": sum(len(sets) for sets in blocked.values()),
        "missed": sum(missed.values()),
        "blocked parts": {assembly.names[part]: len(sets) for part, sets in blocked.items()},
        "s": round(seconds, 3),
    }


def cascade_misses(cascade: Cascade, part: int, sets: list[int]) -> bool:
    """Return whether some even direction frees the part from one of the smallest of these sets."""
    table_ = cascade.blocking
    for others in minimal(remaining & ~(1 << part) for remaining in sets):
        for direction in sphere_directions(2000):
            if all(np.isinf(table_.travel(part, np.zeros(3), direction, other)) for other in bits(others)):
                return True
    return False


def remaining_sets(truth: Truth, conditions: RemovalConditions, count: int) -> list[int]:
    """Return the sets of remaining parts to ask about, of two parts or more."""
    full = (1 << count) - 1
    if count <= 12:
        sets = set(range(1, full + 1))
    else:
        rng = np.random.default_rng(0)
        sets = {sum(1 << int(k) for k in np.flatnonzero(rng.random(count) < 0.5)) for _ in range(4000)}
        for _ in range(1000):
            remaining = full
            while remaining:
                sets.add(remaining)
                free = [k for k in bits(remaining) if truth.removable(k, remaining)]
                if not free:
                    break
                remaining &= ~(1 << int(rng.choice(free)))
    return sorted(s for s in sets if s & (s - 1))


class Truth:
    """The exact answers of a truth.json: clauses, or a table of remaining sets."""

    def __init__(self, content: dict, names: tuple[str, ...]) -> None:
        index = {name: k for k, name in enumerate(names)}
        self._table = None
        if "removable_table" in content:
            self._table = {
                sum(1 << index[n] for n in remaining): sum(1 << index[n] for n in free)
                for remaining, free in content["removable_table"]
            }
        else:
            self._clauses = {
                index[name]: [sum(1 << index[n] for n in clause) for clause in clauses or []]
                for name, clauses in content["removable"].items()
            }

    def removable(self, part: int, remaining: int) -> bool:
        if self._table is not None:
            return bool(self._table[remaining] >> part & 1)
        return any(not clause & remaining & ~(1 << part) for clause in self._clauses[part])


if __name__ == "__main__":
    main()
