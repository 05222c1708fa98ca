"""All disassembly orders at once: against brute force, known counts, and even chances."""

from __future__ import annotations

import json
from collections import Counter
from itertools import islice, permutations
from math import comb, factorial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sashimono.disassembly.conditions.and_or import and_or_graph
from sashimono.disassembly.conditions.clauses import Clause, RemovalConditions, minimal
from sashimono.disassembly.conditions.orders import (
    OrdersConfig,
    conditions_as_dict,
    count_orders,
    find_precedence,
    iterate_orders,
    random_walk,
)
from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal

UP = Removal.straight(np.array([0.0, 0.0, 1.0]), 1.0)
BY_BRANCHING = OrdersConfig(table_parts=1)
"""Without tables, so that the decomposition itself is tested on small systems."""


def conditions_of(masks: list[list[int]]) -> RemovalConditions:
    """Conditions with these blocker masks by part."""
    return RemovalConditions(
        names=tuple(f"p{k}" for k in range(len(masks))),
        clauses=tuple(tuple(Clause(blockers=mask, removal=UP) for mask in minimal(part)) for part in masks),
    )


def random_conditions(seed: int, count: int) -> RemovalConditions:
    """Conditions with up to three clauses a part; some parts have none, some systems are stuck."""
    rng = np.random.default_rng(seed)
    return conditions_of(
        [
            [int(m) & int(k) & ~(1 << part) for m, k in rng.integers(0, 1 << count, (rng.integers(0, 4), 2))]
            for part in range(count)
        ]
    )


def brute_force(conditions: RemovalConditions) -> list[tuple[int, ...]]:
    """Every complete order, by trying all permutations against the definition."""
    count = len(conditions.names)
    found = []
    for order in permutations(range(count)):
        for k, part in enumerate(order[:-1]):
            others = sum(1 << other for other in order[k + 1 :])
            if all(clause.blockers & others for clause in conditions.clauses[part]):
                break
        else:
            found.append(order)
    return found


@given(st.integers(0, 100_000), st.integers(1, 6))
def test_counted_listed_and_brute_force_orders_agree(seed: int, count: int) -> None:
    conditions = random_conditions(seed, count)
    expected = brute_force(conditions)
    assert list(iterate_orders(conditions)) == expected, "each once, in lexicographic order"
    for config in (OrdersConfig(), BY_BRANCHING):
        assert count_orders(conditions, config=config).count == len(expected)


@given(st.integers(0, 100_000), st.integers(2, 6))
def test_precedence_is_what_all_orders_have_in_common(seed: int, count: int) -> None:
    conditions = random_conditions(seed, count)
    orders = brute_force(conditions)
    found = find_precedence(conditions)
    assert bool(found.stuck) == (not orders)
    if not orders:
        return
    for part in range(count):
        common = (1 << count) - 1
        for order in orders:
            common &= sum(1 << other for other in order[: order.index(part)])
        assert found.leave_before[part] == common
    closure = list(found.reduced())
    for _ in range(count):
        closure = [mask | _union(closure[k] for k in bits(mask)) for mask in closure]
    assert tuple(closure) == found.leave_before, "the reduction implies the rest"


def _union(masks) -> int:
    total = 0
    for mask in masks:
        total |= mask
    return total


@pytest.mark.parametrize("config", [OrdersConfig(), BY_BRANCHING])
@pytest.mark.parametrize("seed", [2, 28, 50])
def test_sampled_orders_are_uniform(seed: int, config: OrdersConfig) -> None:
    conditions = random_conditions(seed, 6)
    orders = brute_force(conditions)
    assert 20 <= len(orders) <= 400, f"a telling example (seed {seed} has {len(orders)})"
    drawn = Counter(count_orders(conditions, config=config).sample(20 * len(orders), rng=np.random.default_rng(seed)))
    assert set(drawn) <= set(orders)
    squared = sum((drawn[order] - 20.0) ** 2 / 20.0 for order in orders)
    freedom = len(orders) - 1
    assert abs(squared - freedom) < 4.0 * np.sqrt(2.0 * freedom), "chi-square, within four standard deviations"


def test_known_counts_of_many_parts() -> None:
    count = 150
    free = conditions_of([[0]] * count)
    assert count_orders(free).count == factorial(count)
    chain = conditions_of([[(1 << part) - 1] for part in range(count)])
    assert count_orders(chain).count == 1
    # twenty stacks of five, each held by its own screw, under one lid that all screws hold
    stacks = [[0] if k % 5 == 0 else [1 << k - 1] for k in range(100)]
    screws = sum(1 << k for k in range(0, 100, 5))
    assert count_orders(conditions_of([*stacks])).count == factorial(100) // factorial(5) ** 20
    lid_last = conditions_of([*stacks, [(1 << 100) - 1]])
    assert count_orders(lid_last).count == factorial(100) // factorial(5) ** 20
    lid_first = conditions_of([*([mask[0] | 1 << 100] for mask in stacks), [0]])
    assert count_orders(lid_first).count == factorial(100) // factorial(5) ** 20
    lid_between = count_orders(conditions_of([*stacks, [screws]]))
    assert lid_between.count is not None
    assert lid_between.count > factorial(100) // factorial(5) ** 20
    # a set of rings on a rod, open at both ends: the first out is one of two, always
    rings = conditions_of([[(1 << part) - 1, (1 << 60) - (2 << part)] for part in range(60)])
    assert count_orders(rings).count == 2**59


def test_count_where_a_lid_leaves_in_the_middle() -> None:
    """m screws hold a lid, each screw has a washer: orders by where the lid falls, summed independently."""
    screws, washers = 12, 12
    masks = [[0]] * screws + [[1 << k] for k in range(washers)] + [[(1 << screws) - 1]]
    # all 12 screws before the lid; a washer any time after its screw
    total = 0
    for early in range(washers + 1):  # washers that left before the lid
        before = screws + early
        # pairs in order, the other screws anywhere, all before the lid; the rest of the washers after it
        total += comb(washers, early) * factorial(before) // 2**early * factorial(washers - early)
    assert count_orders(conditions_of(masks)).count == total


def test_the_budget_is_honest() -> None:
    rng = np.random.default_rng(5)
    masks = [[int(m) for m in (rng.random((3, part)) < 0.15) @ (1 << np.arange(part))] for part in range(40)]
    conditions = conditions_of(masks)
    counted = count_orders(conditions, config=OrdersConfig(max_states=5))
    assert counted.count is None
    assert "5 subsystems" in counted.reason
    with pytest.raises(ValueError, match="budget"):
        counted.sample(1, rng=rng)
    walk = random_walk(conditions, rng=rng)
    assert sorted(walk) == list(range(40))
    assert len(list(islice(iterate_orders(conditions), 1000))) == 1000


def test_two_parts_that_never_leave_are_named() -> None:
    conditions = conditions_of([[], [], [0]])
    counted = count_orders(conditions)
    assert counted.count == 0
    assert "2 parts" in counted.reason
    assert list(iterate_orders(conditions)) == []
    assert conditions_as_dict(conditions)["stuck"] == ["p0", "p1"]
    assert random_walk(conditions, rng=np.random.default_rng(0)) == (2,)


def test_the_written_form() -> None:
    """Screw, lid, content: the content is placed before the lid, the lid before the screw."""
    written = conditions_as_dict(conditions_of([[0], [0b001], [0b011]]))
    assert written == {
        "parts": ["p0", "p1", "p2"],
        "clauses": {"p0": [[]], "p1": [["p0"]], "p2": [["p0", "p1"]]},
        "orders": 1,
        "orders_reason": "",
        "precedence": [["p1", "p0"], ["p2", "p1"]],
        "stuck": [],
        "cut_short": [],
    }


def test_and_or_graph_holds_every_order() -> None:
    conditions = random_conditions(3, 6)
    graph = and_or_graph(conditions).as_dict()
    json.dumps(graph)
    assert graph["complete"]
    ways = {k: int(len(parts) == 1) for k, parts in enumerate(graph["nodes"])}
    for arc in reversed(graph["arcs"]):  # larger nodes come first, so their parts are counted by now
        rest, single = arc["into"]
        assert len(graph["nodes"][single]) == 1
        assert sorted(graph["nodes"][rest] + graph["nodes"][single]) == sorted(graph["nodes"][arc["from"]])
        ways[arc["from"]] += ways[rest]
    assert ways[0] == count_orders(conditions).count
    small = and_or_graph(conditions, config=OrdersConfig(max_nodes=3)).as_dict()
    assert not small["complete"]
    assert "3 subassemblies" in small["reason"]


def test_ring_stack_is_counted_exactly(truth_folder) -> None:
    exact = json.loads((truth_folder / "ring_stack20" / "truth.json").read_text())["removable"]
    index = {name: k for k, name in enumerate(exact)}
    masks = [[sum(1 << index[n] for n in clause) for clause in clauses] for clauses in exact.values()]
    # the rod at any time, the 19 rings from the top until then and in any order after
    expected = sum(factorial(left) for left in range(20))
    assert count_orders(conditions_of(masks)).count == expected
