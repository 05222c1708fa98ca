"""Counting orders, precedence and single queries on conditions of growing size.

    python benchmarks/orders.py [NAME ...]

Families with 20 to 80 parts: ``stacks`` of five under screws, ``rings`` on a rod open at both ends,
``random`` precedences of about three blockers a part and ``mixed``, with two alternatives each. Besides,
the truth set's exact conditions. A count that the budget of 300 subsystems ends is a failure and stays in the table.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import SHARED, chosen, machine, parser, table, write_json

from sashimono.disassembly.conditions.clauses import Clause, RemovalConditions, minimal
from sashimono.disassembly.conditions.orders import OrdersConfig, count_orders, find_precedence, random_walk
from sashimono.disassembly.removal import Removal

UP = Removal.straight(np.array([0.0, 0.0, 1.0]), 1.0)


def main() -> None:
    options = parser(__doc__, "orders.json").parse_args()
    rows = [
        measure(f"{family.__name__}{count}", family(count))
        for family in (stacks, rings, random, mixed)
        for count in (20, 40, 80)
        if not options.names
    ]
    known = {folder.name: of_truth(folder) for folder in chosen(SHARED / "truth", options.names)}
    rows += [measure(name, masks) for name, masks in known.items() if masks]
    write_json(options.json, {"machine": machine(), "assemblies": rows})
    keys = ("name", "parts", "orders", "states", "count s", "precedence ms", "query us")
    print(table(keys, ([row[key] for key in keys] for row in rows)))
    print(f"\ncounted: {sum(row['orders'] != 'unknown' for row in rows)} of {len(rows)}")


def measure(name: str, masks: list[list[int]]) -> dict:
    """Return figures for one system; the query is "can this part leave that set", on sets that come up."""
    conditions = RemovalConditions(
        names=tuple(map(str, range(len(masks)))),
        clauses=tuple(tuple(Clause(blockers=mask, removal=UP) for mask in minimal(part)) for part in masks),
    )
    counted, count_s = timed(lambda: count_orders(conditions, config=OrdersConfig(max_states=300)))
    _, precedence_s = timed(lambda: find_precedence(conditions))
    order = random_walk(conditions, rng=np.random.default_rng(0))
    remaining = [sum(1 << part for part in order[k:]) for k in range(len(order))]
    queries = [(part, mask) for mask in remaining for part in order]
    _, query_s = timed(lambda: [conditions.clause(part, mask) for part, mask in queries])
    orders = "unknown" if counted.count is None else str(counted.count)
    return {
        "name": name,
        "parts": len(masks),
        "orders": orders if len(orders) < 16 else f"{orders[0]}.{orders[1:3]}e{len(orders) - 1}",
        "states": counted.states,
        "count s": round(count_s, 3),
        "precedence ms": round(1e3 * precedence_s, 2),
        "query us": round(1e6 * query_s / max(1, len(queries)), 2),
    }


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    """Return what the call returns, and its processor time [s]."""
    start = time.process_time()
    return call(), time.process_time() - start


def stacks(count: int) -> list[list[int]]:
    """Stacks of five; the first of each is a screw, and a lid needs all screws."""
    held = [[0] if k % 5 == 0 else [1 << k - 1] for k in range(count - 1)]
    return [*held, [sum(1 << k for k in range(0, count - 1, 5))]]


def rings(count: int) -> list[list[int]]:
    """Rings on a rod: each leaves past all before it or past all behind it, or once the rod is gone."""
    rod, last = 1 << count - 1, count - 1
    return [*([(1 << k) - 1, (1 << last) - (2 << k), rod] for k in range(last)), [0]]


def random(count: int) -> list[list[int]]:
    """Each part needs about three of the twelve before it gone."""
    rng = np.random.default_rng(count)
    return [[_some(rng, k, 3)] for k in range(count)]


def mixed(count: int) -> list[list[int]]:
    """Each part leaves by one of two sets of about three of the twelve before it."""
    rng = np.random.default_rng(count)
    return [[_some(rng, k, 3), _some(rng, k, 3)] for k in range(count)]


def _some(rng: np.random.Generator, k: int, blockers: int) -> int:
    near = np.arange(max(0, k - 12), k)
    return sum(1 << int(j) for j in near[rng.random(len(near)) < blockers / 12.0])


def of_truth(folder: Path) -> list[list[int]]:
    """The exact clauses of a truth set entry; of a table only, none."""
    exact = json.loads((folder / "truth.json").read_text()).get("removable") or {}
    index = {name: k for k, name in enumerate(exact)}
    return [[sum(1 << index[n] for n in clause) for clause in clauses or []] for clauses in exact.values()]


if __name__ == "__main__":
    main()
