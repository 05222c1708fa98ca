"""The order by its cost: what each term counts, what the search brings, what else could have come."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from solids import assembly, box, box_with_lid, rod
from truth_set import read_truth

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.sequence.constraints import OrderConstraints
from sashimono.disassembly.sequence.cost import SOMETIMES, TERMS, OrderCostConfig, Placing
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.sequence.holds import Allowance, Contacts, HoldCounter, unsteadiness
from sashimono.disassembly.sequence.order import Orderer
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import Table
from sashimono.stability import StabilityConfig, Touching

UP = np.array([0.0, 0.0, 1.0])


def bolted() -> Assembly:
    """Two plates on each other, two headed screws through the upper one into the lower one, a cup on top."""
    holes = rod(0.0033, 0.2, (0.02, 0.0, 0.0)) + rod(0.0033, 0.2, (-0.02, 0.0, 0.0))
    threads = rod(0.00305, 0.2, (0.02, 0.0, 0.0)) + rod(0.00305, 0.2, (-0.02, 0.0, 0.0))
    hexagon = rod(0.0028, 0.01, (0.0, 0.0, 0.018), segments=6)
    screw = rod(0.003, 0.018, (0.0, 0.0, 0.001)) + rod(0.005, 0.006, (0.0, 0.0, 0.013)) - hexagon
    return assembly(
        cover=box((0.08, 0.04, 0.01), (0.0, 0.0, 0.005)) - holes,
        screw_1=screw.translate((0.02, 0.0, 0.0)),
        screw_2=screw.translate((-0.02, 0.0, 0.0)),
        body=box((0.08, 0.04, 0.02), (0.0, 0.0, -0.01)) - threads,
    )


def orderer_of(parts: Assembly, config: SequenceConfig | None = None) -> tuple[Cascade, Orderer]:
    bodies = make_bodies(parts)
    cascade = Cascade(parts, bodies, config=SeparateConfig())
    return cascade, Orderer(cascade, bodies, config=config or SequenceConfig(), stability=StabilityConfig())


def names_of(parts: Assembly, found: DisassemblyResult) -> list[str]:
    """Return the assembly order."""
    return [parts.names[k] for k in (found.base, *(departure.part for departure in reversed(found.removals)))]


def test_screws_come_last_in_their_own_order_and_are_found() -> None:
    parts = bolted()
    cascade, orderer = orderer_of(parts)
    assert {f.part: (f.clamps, f.into) for f in orderer.fasteners} == dict.fromkeys(
        ("screw_1", "screw_2"), (("cover",), ("body",))
    )
    found = orderer.improve(find_disassembly(cascade, config=SequenceConfig()))
    assert names_of(parts, found) == ["body", "cover", "screw_1", "screw_2"]
    assert found.up == (0.0, 0.0, 1.0)


def test_a_bookcase_is_built_on_its_back() -> None:
    """Shelves between uprights fall out while the case stands; on its back everything stands."""
    back = box((0.4, 0.01, 0.6), (0.0, 0.105, 0.0))
    left, right = (box((0.02, 0.2, 0.6), (x, 0.0, 0.0)) for x in (-0.19, 0.19))
    shelves = {f"shelf_{k}": box((0.36, 0.2, 0.02), (0.0, 0.0, z)) for k, z in enumerate((-0.1, 0.1))}
    parts = assembly(back=back, left=left, right=right, **shelves)
    plan = plan_assembly(parts, config=PipelineConfig(contacts=False))
    assert plan.table is not None
    np.testing.assert_allclose(plan.table.normal, (0.0, -1.0, 0.0), atol=1e-9)
    assert plan.order[0] == "back"
    assert all(not step.held for step in plan.steps)
    standing = plan_assembly(parts, config=first_order())
    assert standing.cost is not None
    assert plan.cost is not None
    assert plan.cost.total < standing.cost.total


def first_order() -> PipelineConfig:
    config = PipelineConfig(contacts=False)
    return replace(config, sequence=replace(config.sequence, search=replace(config.sequence.search, enabled=False)))


@pytest.mark.parametrize("name", ["bolted_lid", "hinge_pin", "ring_stack", "sliding_lid", "bent_tunnel"])
def test_no_order_is_dearer_than_the_first_and_every_departure_is_free(name: str) -> None:
    parts = read_truth(name).parts
    cascade, orderer = orderer_of(parts)
    first = find_disassembly(cascade, config=SequenceConfig())
    found = orderer.improve(first)
    assert {d.part for d in found.removals} | {found.base} == {d.part for d in first.removals} | {first.base}
    fresh, _ = orderer_of(parts)
    remaining = cascade.parts.all_parts
    for departure in found.removals:
        s = departure.separation.direction_index
        if s is not None and departure.inside is None:
            assert fresh.blocking.is_free(departure.part, s, remaining & ~departure.members)
        remaining &= ~departure.members
    assert first.stuck or remaining.bit_count() == 1


def test_what_the_user_wants_is_kept() -> None:
    parts = bolted()
    config = SequenceConfig(constraints=OrderConstraints(base="cover", before=(("screw_2", "screw_1"),)))
    cascade, orderer = orderer_of(parts, config)
    found = orderer.improve(find_disassembly(cascade, config=config), up=(0.0, 0.0, -2.0))
    order = names_of(parts, found)
    assert order[0] == "cover"
    assert order.index("screw_2") < order.index("screw_1")
    assert found.up == (0.0, 0.0, -1.0)


def test_the_search_can_be_switched_off() -> None:
    cascade, orderer = orderer_of(bolted(), first_order().sequence)
    found = find_disassembly(cascade, config=SequenceConfig())
    assert orderer.improve(found) is found


def test_terms_count_what_they_say() -> None:
    parts = bolted()
    _, orderer = orderer_of(parts)
    model, scene = orderer.model, orderer.model.scene
    mask = scene.mask
    rest = mask(["cover", "body"])
    screw = Placing(members=mask(["screw_1"]), exit_direction=UP, rest=rest)
    assert model.of_placing(screw, mask(["screw_2"]), UP) == {"interrupted_runs": 1.0}
    assert (
        model.of_placing(replace(screw, after=replace(screw, members=mask(["screw_2"]))), mask(["screw_2"]), UP) == {}
    )
    below = model.of_placing(replace(screw, exit_direction=-UP), 0, UP)
    assert below.keys() == {"not_from_above", "from_below", "slides"}
    sideways = replace(screw, exit_direction=np.array([1.0, 0.0, 0.0]))
    assert model.of_placing(replace(screw, after=sideways), 0, UP) == {"direction_changes": 1.0}
    # the cover leaves while a screw is there that must come after it: the screw was placed too early
    cover = Placing(members=mask(["cover"]), exit_direction=UP, rest=mask(["body", "screw_1"]))
    assert model.of_placing(cover, 0, UP) == {"fasteners_out_of_turn": 1.0}
    alone = Placing(members=mask(["screw_1"]), exit_direction=UP, rest=mask(["screw_2"]))
    assert model.of_placing(alone, 0, UP)["apart"] == 1.0
    assert model.of_hands(0, 0) == {}
    assert model.of_hands(2, 1) == {"held": 1.0, "hands_missing": 1.0}
    assert model.total({"held": 2.0, "hands_missing": 1.0}) == pytest.approx(5.0)
    assert set(OrderCostConfig().weights) == set(TERMS)


def test_a_fastener_that_waits_is_late() -> None:
    parts = Assembly(parts=(*bolted().parts, *assembly(cube=box((0.01, 0.01, 0.01), (0.0, 0.0, 0.015))).parts))
    _, orderer = orderer_of(parts)
    mask = orderer.model.scene.mask
    cube = Placing(members=mask(["cube"]), exit_direction=UP, rest=mask(["cover", "body"]))
    assert orderer.model.of_placing(cube, mask(["screw_1", "screw_2"]), UP) == {"fasteners_late": 2.0}


@cache
def tower() -> tuple[Contacts, Assembly]:
    parts = assembly(**{f"c{k}": box((0.02, 0.02, 0.02), (0.006 * k, 0.0, 0.01 + 0.02 * k)) for k in range(4)})
    poses = {part.name: part.T_world_part for part in parts.parts}
    return Contacts(Touching(make_bodies(parts), poses, config=StabilityConfig()), parts.names), parts


@pytest.mark.parametrize("placed", range(1, 16))
def test_the_bound_of_held_parts_is_one(placed: int) -> None:
    contacts, _ = tower()
    counter = HoldCounter(contacts, Table(normal=UP, offset=0.0), fixed=0, allowance=Allowance(1000), known={})
    assert counter.at_least(placed) <= counter.fewest(placed)
    in_air = HoldCounter(contacts, Table(normal=UP, offset=-1.0), fixed=0, allowance=Allowance(1000), known={})
    assert in_air.at_least(placed) >= 1


def test_a_bound_whose_budget_is_spent_counts_nothing() -> None:
    contacts, _ = tower()
    spent = HoldCounter(contacts, Table(normal=UP, offset=0.0), fixed=0, allowance=Allowance(0), known={})
    assert spent.at_least(0b1111) == 0
    in_air = HoldCounter(contacts, Table(normal=UP, offset=-1.0), fixed=0, allowance=Allowance(0), known={})
    assert in_air.at_least(0b1111) == 1


def test_a_flat_plate_is_steady_and_one_on_edge_is_not() -> None:
    parts = assembly(flat=box((0.1, 0.1, 0.01), (0.0, 0.0, 0.005)), edge=box((0.01, 0.1, 0.1), (0.2, 0.0, 0.05)))
    poses = {part.name: part.T_world_part for part in parts.parts}
    touching = Touching(make_bodies(parts), poses, config=StabilityConfig())
    table = Table(normal=UP, offset=0.0)
    assert unsteadiness(touching, ["flat"], table, steady=0.6) == 0.0
    assert unsteadiness(touching, ["edge"], table, steady=0.6) == pytest.approx(1.0 - np.arctan(0.1) / 0.6)
    assert unsteadiness(touching, ["edge"], Table(normal=UP, offset=-1.0), steady=0.6) == 1.0


def test_each_step_says_what_else_could_have_come() -> None:
    plan = plan_assembly(bolted(), config=PipelineConfig(contacts=False, explain_order=True))
    said = {step.part: {a.part: a for a in step.alternatives or ()} for step in plan.steps}
    assert said["screw_1"] == said["screw_2"] == {}
    instead = said["cover"]["screw_1"]
    assert not instead.possible
    assert "cover gets in" in instead.reason
    read = plan_from_json(plan_to_json(plan))
    assert [step.alternatives for step in read.steps] == [step.alternatives for step in plan.steps]
    boxed = plan_assembly(
        Assembly(parts=(*box_with_lid().parts, *assembly(top=box((0.01, 0.01, 0.01), (0.0, 0.0, 0.5))).parts)),
        config=PipelineConfig(contacts=False, explain_order=True),
    )
    possible = [a for step in boxed.steps for a in step.alternatives or () if a.possible]
    assert possible
    assert all(a.more is not None and a.reason for a in possible)


def test_the_cost_of_a_plan_is_written_and_older_plans_have_none() -> None:
    plan = plan_assembly(bolted(), config=PipelineConfig(contacts=False))
    assert plan.cost is not None
    assert set(plan.cost.terms) == set(plan.cost.weights) == set(TERMS) - set(SOMETIMES)
    assert plan.cost.total == pytest.approx(sum(plan.cost.weights[t] * n for t, n in plan.cost.terms.items()))
    text = plan_to_json(plan)
    assert plan_from_json(text).cost == plan.cost
    assert plan_from_json(plan_to_json(replace(plan, cost=None))).cost is None
    fasteners = {step.part: step.fastener for step in plan_from_json(text).steps}
    assert fasteners["cover"] is None
    assert fasteners["screw_1"] is not None
    assert fasteners["screw_1"].joins == ("body",)
