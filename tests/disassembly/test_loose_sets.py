"""Sets that leave as one body along several legs, where no part leaves alone and no set goes straight out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cartridge_set import CASES, cartridge_in_housing
from simultaneous_set import GroupCase
from tilt_set import part_of

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.masks import bits
from sashimono.disassembly.sequence.constraints import OrderConstraints
from sashimono.disassembly.sequence.departures import Departure, DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.sequence.products import ProductGroup
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.verify import verify_plan


def named(name: str) -> GroupCase:
    return next(case for case in CASES if case.name == name)


def cascade_of(parts: Assembly, **options: object) -> Cascade:
    return Cascade(parts, make_bodies(parts), config=replace(SeparateConfig(), **options))


def together(cascade: Cascade, result: DisassemblyResult) -> list[tuple[Departure, set[str]]]:
    """The departures of several parts as one, each with their names."""
    names = cascade.assembly.names
    found = [(entry, {names[k] for k in bits(entry.members)}) for entry in result.removals]
    return [(entry, members) for entry, members in found if len(members) > 1]


@pytest.mark.parametrize("name", ["cartridge_y_loose", "cartridge_xz_slug", "cartridge_x_slug_loose_lid"])
def test_the_set_and_its_blocked_twins(name: str) -> None:
    """Those of the benchmark that have everything between them."""
    case = named(name)
    for is_open in (True, False):
        cascade = cascade_of(case.assembly(is_open=is_open))
        result = find_disassembly(cascade, config=SequenceConfig())
        moved = together(cascade, result)
        assert [members for _, members in moved] == [set(case.movers)] * is_open
        assert bool(result.stuck) != is_open
        for entry, _ in moved:
            assert entry.separation.removal is not None
            ways = np.diff(entry.separation.removal.displacements[:, :3, 3], axis=0)
            assert len(ways) >= (3 if "xz" in case.name else 2)
            assert ways[0] @ [0.0, 0.0, 1.0] > 0.012, "first it rises out of its grooves"


def test_the_plan_holds_and_puts_the_set_together_first() -> None:
    case = named("cartridge_x_slug")
    parts = case.assembly(is_open=True)
    plan = plan_assembly(parts, config=PipelineConfig(contacts=False))
    assert plan.status == "complete"
    assert verify_plan(plan, parts).ok
    step = next(step for step in plan.steps if len(step.members) > 1)
    assert set(step.members) == set(case.movers)
    assert step.subassembly is not None
    assert set(step.subassembly.order) == set(case.movers)


def test_one_part_finds_the_same_way_past_walls() -> None:
    """What leads the search counts the steps around a wall: straight through it, the way down seemed shorter."""
    solids = cartridge_in_housing(True, way="xz")
    parts = Assembly(
        parts=tuple(
            part_of(name, solid)
            for name, solid in (
                ("cartridge", solids["left"] + solids["right"]),
                ("housing", solids["front"] + solids["back"]),
            )
        )
    )
    said = cascade_of(parts).translations.search.search(0, [1])
    assert said.removal is not None, said.reason


def test_a_precedence_that_it_breaks_keeps_it() -> None:
    parts = named("cartridge_y").assembly(is_open=True)
    cascade = cascade_of(parts)
    wishes = OrderConstraints(base="front", before=(("left", "back"),))
    result = find_disassembly(cascade, config=SequenceConfig(constraints=wishes))
    assert together(cascade, result) == []
    assert result.stuck


def test_a_refused_set_is_not_proposed_again() -> None:
    cascade = cascade_of(named("cartridge_y").assembly(is_open=True))
    [(entry, _)] = together(cascade, find_disassembly(cascade, config=SequenceConfig()))
    again = find_disassembly(cascade, config=SequenceConfig(), refused=frozenset({entry.refusal}))
    assert all(other.members != entry.members for other, _ in together(cascade, again))


def test_a_product_that_leaves_as_one_is_not_split() -> None:
    cascade = cascade_of(named("cartridge_y").assembly(is_open=True))
    across = ProductGroup(name="across", members=sum(1 << cascade.assembly.names.index(k) for k in ("back", "left")))
    result = find_disassembly(cascade, config=SequenceConfig(), products=(across,))
    assert together(cascade, result) == []


def test_the_budget_ends_it() -> None:
    cascade = cascade_of(named("cartridge_y").assembly(is_open=True), max_loose_sets=0)
    assert find_disassembly(cascade, config=SequenceConfig()).stuck
