"""Clauses by duality: all of them, with few questions, and honest where the budget ends."""

import sys
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sashimono.disassembly.conditions import enumeration
from sashimono.disassembly.conditions.clauses import minimal
from sashimono.disassembly.conditions.enumeration import SetAnswer, enumerate_clauses

PARTS = 6
BUDGETS = {"max_queries": 1000, "max_unproven": 1000, "max_undecided": 1000}
masks = st.integers(0, (1 << PARTS) - 1)


def oracle(truth: list[int], asked: list[int], *, generous: bool):
    """Answers from the true clauses; cores as large as they may be, or minimal."""

    def ask(others: int) -> SetAnswer:
        assert others not in asked, "no set is asked twice"
        asked.append(others)
        free = [clause for clause in truth if not clause & others]
        if free:
            return SetAnswer(clause=free[0])
        core = others
        for k in range(PARTS):
            if not generous and all(clause & core & ~(1 << k) for clause in truth):
                core &= ~(1 << k)
        return SetAnswer(core=core)

    return ask


@given(truth=st.lists(masks, max_size=6), known=st.lists(st.integers(0, 5), max_size=3), generous=st.booleans())
def test_all_minimal_clauses_are_found(truth: list[int], known: list[int], generous: bool) -> None:
    everything = (1 << PARTS) - 1
    truth = minimal([*truth, everything])
    asked: list[int] = []
    start = [truth[k] for k in known if k < len(truth)]
    found = enumerate_clauses(everything, start, oracle(truth, asked, generous=generous), **BUDGETS)
    assert list(found.clauses) == truth
    assert found.is_complete
    assert found.queries == len(asked)
    for core in found.cores:
        assert all(core & clause for clause in truth)
    if not generous:
        assert found.queries <= len(truth) + len(found.cores)


def test_what_the_budget_leaves_open_is_said() -> None:
    ask = oracle([0b000111, 0b111000], [], generous=False)
    for budget in ({"max_queries": 1}, {"max_undecided": 1}):
        found = enumerate_clauses(63, [63], ask, **BUDGETS | budget)
        assert not found.is_complete
        ask = oracle([0b000111, 0b111000], [], generous=False)


def test_answers_without_proof_are_never_complete() -> None:
    found = enumerate_clauses(0b11, [0b11], lambda others: SetAnswer(core=others, is_proven=False), **BUDGETS)
    assert found.clauses == (0b11,)
    assert not found.is_complete
    once = enumerate_clauses(
        63, [63], lambda others: SetAnswer(core=1, is_proven=False), **BUDGETS | {"max_unproven": 1}
    )
    assert (once.queries, once.is_complete) == (1, False)


def test_a_clause_that_needs_more_gone_than_was_gone_is_refused() -> None:
    with pytest.raises(AssertionError):
        enumerate_clauses(0b11, [], lambda others: SetAnswer(clause=0b11), **BUDGETS)


def test_twenty_screws_cost_twenty_questions() -> None:
    """A lid leaves when all screws are gone, or its box: each screw holds it with the box, and that is all."""
    everything = (1 << 21) - 1
    box, screws = 1 << 20, (1 << 20) - 1

    def ask(others: int) -> SetAnswer:
        if not others & box:
            return SetAnswer(clause=box)
        held = others & screws
        return SetAnswer(clause=screws) if not held else SetAnswer(core=box | (held & -held))

    found = enumerate_clauses(everything, [box], ask, **BUDGETS)
    assert list(found.clauses) == [box, screws]
    assert found.queries == 21
    assert np.all([core.bit_count() == 2 for core in found.cores])


def count_steps(run: Callable[[], object]) -> int:
    """Count the calls and the generator steps inside the enumeration: work that is the same on every machine."""
    steps = 0

    def count(frame, event, argument) -> None:
        nonlocal steps
        steps += event == "call" and frame.f_code.co_filename == enumeration.__file__

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        run()
    finally:
        sys.setprofile(before)
    return steps


def test_many_large_cores_are_worked_through_at_once() -> None:
    """Of 60 parts, each question names another 25 that hold: comparing all that could be asked took half a minute."""
    rng = np.random.default_rng(0)
    everything = (1 << 60) - 1

    def ask(others: int) -> SetAnswer:
        left = [k for k in range(60) if others >> k & 1]
        return SetAnswer(core=sum(1 << int(k) for k in rng.choice(left, min(25, len(left)), replace=False)))

    def run() -> None:
        found = enumerate_clauses(everything, [everything], ask, **BUDGETS | {"max_queries": 64})
        assert (found.queries, found.is_complete) == (64, False)

    steps = count_steps(run)
    assert steps < 2_000_000, f"{steps:,} steps"
