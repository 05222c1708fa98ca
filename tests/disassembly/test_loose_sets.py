"""Sets that leave as one body along several legs, where no part leaves alone and no set goes straight out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cartridge_set import CASES, cartridge_in_housing
from manifold3d import Manifold
from simultaneous_set import GroupCase
from tilt_set import part_of, span

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.blocking.groups import LooseConfig
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
    cascade = cascade_of(named("cartridge_y").assembly(is_open=True), loose=LooseConfig(max_sets=0))
    assert find_disassembly(cascade, config=SequenceConfig()).stuck


def test_what_lies_loose_in_a_set_goes_along() -> None:
    solids = cartridge_in_housing(True, way="y", slug=True)
    solids["slug"] = span((-4.0, 4.0), (-3.0, 3.0), (3.0, 6.0))  # a millimetre of play upwards
    cascade = cascade_of(Assembly(parts=tuple(part_of(name, solid) for name, solid in solids.items())))
    result = find_disassembly(cascade, config=SequenceConfig())
    assert [members for _, members in together(cascade, result)] == [{"slug", "left", "right"}]


def test_what_coarse_maps_miss_is_traced() -> None:
    """A ball in a socket of both halves: the depth maps do not see that the socket closes a little over its equator."""
    solids = cartridge_in_housing(True, way="y")
    ball = Manifold.sphere(1.0, 48).translate((0.0, 0.0, 9.6))
    solids |= {side: solids[side] - ball for side in ("left", "right")} | {"ball": ball}
    cascade = cascade_of(Assembly(parts=tuple(part_of(name, solid) for name, solid in solids.items())))
    names, blocking = cascade.assembly.names, cascade.blocking
    up = next(s for s in range(blocking.count_directions) if blocking.direction(s)[2] > 0.9999)
    assert not blocking.blockers(names.index("ball"), up, 1 << names.index("left")), "this case shows nothing"
    found = cascade.loose_sets(cascade.parts.all_parts, stays=names.index("front"))
    assert [{names[k] for k in bits(members)} for members in found] == [{"left", "right", "ball"}]


@pytest.mark.parametrize("base", ["left", "front"])
def test_either_side_may_stay(base: str) -> None:
    cascade = cascade_of(named("cartridge_y").assembly(is_open=True))
    wishes = OrderConstraints(base=base)
    result = find_disassembly(cascade, config=SequenceConfig(constraints=wishes))
    assert not result.stuck
    assert [members for _, members in together(cascade, result)] == [
        {"left", "right"} if base == "front" else {"front", "back"}
    ]


def test_a_straight_way_that_was_refused_does_not_come_back_by_the_search() -> None:
    """Without a roof the cartridge goes straight up: once that is refused, it is not found again under another name."""
    solids = cartridge_in_housing(True, way="y")
    for side in ("front", "back"):
        solids[side] -= span((-25.0, 25.0), (-18.0, 18.0), (20.0, 60.0))
    cascade = cascade_of(Assembly(parts=tuple(part_of(name, solid) for name, solid in solids.items())))
    [(entry, members)] = together(cascade, find_disassembly(cascade, config=SequenceConfig()))
    assert members == {"left", "right"}
    assert entry.refusal.direction_index is not None
    again = find_disassembly(cascade, config=SequenceConfig(), refused=frozenset({entry.refusal}))
    for other, _ in together(cascade, again):
        assert other.separation.removal is not None
        assert other.separation.removal.exit_direction @ [0.0, 0.0, 1.0] < 0.99
