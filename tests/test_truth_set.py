"""The truth set of this repository: conditions, orders and plans against what is known by construction."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import pytest
from truth_set import NAMES, Truth, read_truth

from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.conditions.orders import count_orders
from sashimono.disassembly.masks import bits
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.verify import verify_plan

UNPROVEN = {"hinge_pin": {"tongue"}}
"""Parts of which the planner knows all clauses, but cannot prove that these are all."""


@cache
def truth_of(name: str) -> Truth:
    return read_truth(name)


@cache
def conditions_of(name: str) -> RemovalConditions:
    parts = truth_of(name).parts
    return Cascade(parts, make_bodies(parts), config=SeparateConfig()).conditions()


def test_the_set_is_there() -> None:
    assert len(NAMES) >= 8


@pytest.mark.parametrize("name", NAMES)
def test_every_part_leaves_exactly_where_it_should(name: str) -> None:
    """Asked of every set of remaining parts: the answers, not only the clauses, are exact."""
    truth, conditions = truth_of(name), conditions_of(name)
    names = truth.parts.names
    for size in range(2, len(names) + 1):
        for remaining in combinations(range(len(names)), size):
            said = conditions.removable(sum(1 << k for k in remaining))
            for k in remaining:
                others = frozenset(names[other] for other in remaining if other != k)
                assert bool(said >> k & 1) is truth.frees(names[k], others), f"{names[k]} from {sorted(others)}"


@pytest.mark.parametrize("name", NAMES)
def test_the_clauses_are_the_minimal_ones_and_known_to_be_all(name: str) -> None:
    truth, conditions = truth_of(name), conditions_of(name)
    names = truth.parts.names
    found = {
        part: frozenset(frozenset(names[k] for k in bits(mask)) for mask in masks)
        for part, masks in zip(names, conditions.masks, strict=True)
    }
    assert found == truth.removable
    assert {names[k] for k in conditions.cut_short} <= UNPROVEN.get(name, set())


@pytest.mark.parametrize("name", NAMES)
def test_there_are_as_many_orders_as_trying_them_all_finds(name: str) -> None:
    truth = truth_of(name)
    expected = 0 if name == "linked_rings" else truth.count_orders()
    assert count_orders(conditions_of(name)).count == expected


@pytest.mark.parametrize("name", NAMES)
def test_plans_are_complete_where_there_is_an_order(name: str) -> None:
    truth = truth_of(name)
    plan = plan_assembly(truth.parts, config=PipelineConfig(contacts=False))
    assert plan.status == ("partial" if name == "linked_rings" else "complete")
    assert not any(step.problems for step in verify_plan(plan, truth.parts).steps)
    for k, step in enumerate(plan.steps):
        assert truth.frees(step.part, frozenset(plan.order[:k])) or k == 0
