"""States and y: small systems with known answers, and two routes to the same table."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sashimono.d4pas.states import (
    all_states,
    can_leave,
    insertable,
    is_reachable,
    is_right_order,
    random_state,
    right_next,
)

SCREWED = ((0b110,), (0b100,), (0b000,))
"""A base (part 0) under a plate (1) under a screw (2)."""


def test_a_screw_alone_can_be_put_in_but_leads_nowhere() -> None:
    assert insertable(SCREWED, 0b001) == 0b110
    assert right_next(SCREWED, 0b001) == 0b010
    assert not is_reachable(SCREWED, 0b101)


def test_the_table_of_a_chain_has_one_state_a_level() -> None:
    assert all_states(SCREWED, limit=100) == {0b111: 0, 0b011: 0b100, 0b001: 0b010, 0b000: 0b001}


def test_a_limit_that_is_too_small_gives_no_table() -> None:
    free = tuple((0,) for _ in range(10))
    assert all_states(free, limit=1000) is None
    table = all_states(free, limit=1024)
    assert table is not None
    assert len(table) == 1024


def test_orders_are_judged_step_by_step() -> None:
    assert is_right_order(SCREWED, [0, 1, 2])
    assert not is_right_order(SCREWED, [0, 2, 1])
    assert not is_right_order(SCREWED, [0, 1])


systems = st.integers(2, 6).flatmap(
    lambda count: st.lists(
        st.lists(st.integers(0, (1 << count) - 1), min_size=1, max_size=3), min_size=count, max_size=count
    ).map(lambda rows: tuple(tuple(mask & ~(1 << part) for mask in row) for part, row in enumerate(rows)))
)


@given(systems)
def test_y_by_bits_is_y_by_walking_all_states(masks: tuple[tuple[int, ...], ...]) -> None:
    table = all_states(masks, limit=1 << len(masks))
    assert table is not None
    for state, right in table.items():
        assert right_next(masks, state) == right
        assert is_reachable(masks, state)
    for state in set(range(1 << len(masks))) - set(table):
        assert not is_reachable(masks, state)


@given(systems, st.integers(0, 2**32 - 1))
def test_drawn_states_are_reachable_and_fewer_parts_never_block_more(
    masks: tuple[tuple[int, ...], ...], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    for count in range(len(masks)):
        state = random_state(masks, count, rng)
        assert is_reachable(masks, state)
        for part in range(len(masks)):
            if can_leave(masks, part, state):
                assert can_leave(masks, part, state & int(rng.integers(1 << len(masks))))


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_states_have_the_number_of_parts_asked_for_where_all_come_apart(count: int) -> None:
    assert random_state(SCREWED, count, np.random.default_rng(0)).bit_count() == count
