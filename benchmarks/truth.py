"""Removal conditions against exact answers: false "free" and false "blocked" over all remaining sets.

    python benchmarks/truth.py [NAME ...]

All non-empty sets of remaining parts for up to 12 parts; beyond, 4,000 random sets and every set on
1,000 random disassembly orders. A false "blocked" is looked at again with 2,000 even directions: if
one of them frees the part by a single translation, it counts as missed; if none does, the part needs
a rotation or more than one translation.

The motion behind every clause is checked by `verify` past all parts that may be there (`refuted`: clauses
that do not hold). Where the table says "blocked" and there is such a motion, `verify` has nothing against
it, and exact booleans at 400 poses on the way share no volume, the query is counted as `disputed` instead
of false "free", and the motion is written to the results: then the table is wrong.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
from common import SHARED, chosen, machine, parser, table, write_json
from witnesses import Witnesses

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.conditions.clauses import Clause, RemovalConditions, minimal
from sashimono.disassembly.free_travel import free_travel
from sashimono.disassembly.masks import bits
from sashimono.geometry.features.directions import sphere_directions
from sashimono.io.read import read_assembly


def main() -> None:
    options = parser(__doc__, "truth.json").parse_args()
    rows = [measure(folder) for folder in chosen(SHARED / "truth", options.names)]
    write_json(options.json, {"machine": machine(), "assemblies": rows})
    counts = ("queries", "false free", "disputed", "false blocked", "missed", "clauses", "refuted", "cut short")
    keys = ("name", "parts", *counts, "s")
    print(table(keys, ([row[key] for key in keys] for row in rows)))
    totals = {key: sum(row[key] for row in rows) for key in counts}
    print("\n" + ", ".join(f"{key}: {value}" for key, value in totals.items()))
    for row in rows:
        for dispute in row["disputes"]:
            print(f"{row['name']}: table disputed, a verified motion exists: {dispute}")


def measure(folder: Path) -> dict:
    """Return the counts for one assembly."""
    assembly = read_assembly(folder, unit="mm")
    truth = Truth(json.loads((folder / "truth.json").read_text()), assembly.names)
    start = time.process_time()
    cascade = Cascade(assembly, make_bodies(assembly), config=SeparateConfig())
    conditions = cascade.conditions()
    seconds = time.process_time() - start
    witnesses = Witnesses(assembly)
    refuted = refuted_clauses(conditions, witnesses)
    queries = 0
    contradicted: dict[Clause, int] = {}
    owner = {clause: part for part, clauses in enumerate(conditions.clauses) for clause in clauses}
    blocked: dict[int, list[int]] = {}
    for remaining in remaining_sets(truth, conditions, len(assembly)):
        said = conditions.removable(remaining)
        for part in bits(remaining):
            queries += 1
            right, told = truth.removable(part, remaining), bool(said >> part & 1)
            if told and not right:
                clause = conditions.clause(part, remaining)
                assert clause is not None
                contradicted[clause] = contradicted.get(clause, 0) + 1
            if right and not told:
                blocked.setdefault(part, []).append(remaining)
    disputes = [
        found
        for clause, count in contradicted.items()
        if clause not in refuted and (found := dispute(assembly, witnesses, owner[clause], clause, count))
    ]
    missed = {part: len(sets) for part, sets in blocked.items() if cascade_misses(cascade, part, sets)}
    return {
        "name": folder.name,
        "parts": len(assembly),
        "queries": queries,
        "false free": sum(contradicted.values()) - sum(found["queries"] for found in disputes),
        "disputed": sum(found["queries"] for found in disputes),
        "false blocked": sum(len(sets) for sets in blocked.values()),
        "missed": sum(missed.values()),
        "clauses": len(owner),
        "refuted": len(refuted),
        "cut short": len(conditions.cut_short),
        "disputes": disputes,
        "refutations": {
            f"{assembly.names[owner[clause]]} without {names_in(assembly, clause.blockers)}": why
            for clause, why in refuted.items()
        },
        "blocked parts": {assembly.names[part]: len(sets) for part, sets in blocked.items()},
        "s": round(seconds, 3),
    }


def refuted_clauses(conditions: RemovalConditions, witnesses: Witnesses) -> dict[Clause, list[str]]:
    """Return the clauses whose motion does not hold past all parts that may be there, with what is wrong."""
    everything = (1 << len(conditions.names)) - 1
    found = {
        clause: witnesses.problems(part, everything & ~(1 << part) & ~clause.blockers, clause.removal)
        for part, clauses in enumerate(conditions.clauses)
        for clause in clauses
    }
    return {clause: problems for clause, problems in found.items() if problems}


def dispute(
    assembly: Assembly, witnesses: Witnesses, part: int, clause: Clause, count: int
) -> dict[str, object] | None:
    """Return what shows that a table wrongly says "blocked" where a clause holds, or None if nothing does."""
    others = (1 << len(assembly)) - 1 & ~(1 << part) & ~clause.blockers
    clearance = witnesses.clearance(part, others, clause.removal)
    if not clearance.is_free:
        return None
    return {
        "part": assembly.names[part],
        "without": names_in(assembly, clause.blockers),
        "past": names_in(assembly, others),
        "queries": count,
        "displacements": clause.removal.displacements.tolist(),
        "shared volume, share of the smaller part": clearance.share,
    }


def names_in(assembly: Assembly, mask: int) -> list[str]:
    """Return the names of the parts in a mask."""
    return [assembly.names[k] for k in bits(mask)]


def cascade_misses(cascade: Cascade, part: int, sets: list[int]) -> bool:
    """Return whether some even direction frees the part from one of the smallest of these sets."""
    parts = cascade.parts
    for others in minimal(remaining & ~(1 << part) for remaining in sets):
        for direction in sphere_directions(2000):
            if all(np.isinf(free_travel(parts, part, np.zeros(3), direction, other)) for other in bits(others)):
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
