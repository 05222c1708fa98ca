"""The product is turned over where that costs less: the search, the plan, its cost, and the check of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from solids import assembly, box, rod

from sashimono.assembly import Assembly, Source
from sashimono.disassembly.sequence.search_config import OrderSearchConfig
from sashimono.errors import SashimonoError
from sashimono.exports import step_table
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan, Step, Table, step_tables
from sashimono.revision.carry_over import carry_over
from sashimono.revision.parts import PartChange
from sashimono.verify import verify_plan
from sashimono.view.config import ViewConfig
from sashimono.view.manual.content import make_manual
from sashimono.view.mjcf import keyframes
from sashimono.view.playback import page_frames
from sashimono.view.scene import make_scene

UP = np.array([0.0, 0.0, 1.0])
CORNERS = [*product((-0.12, 0.12), (-0.07, 0.07))]


def set_table() -> Assembly:
    """A table with four legs in holes under its top, and three things on it."""
    top = box((0.3, 0.2, 0.02), (0.0, 0.0, 0.11))
    for x, y in CORNERS:
        top -= rod(0.0102, 0.01, (x, y, 0.105))
    legs = {f"leg_{k}": rod(0.01, 0.11, (x, y, 0.055)) for k, (x, y) in enumerate(CORNERS)}
    things = {f"thing_{k}": box((0.03, 0.03, 0.03), (0.05 * k - 0.05, 0.0, 0.135)) for k in range(3)}
    return assembly(top=top, **legs, **things)


@cache
def planned() -> AssemblyPlan:
    return plan_assembly(set_table())


def turned_step(plan: AssemblyPlan) -> tuple[int, Step]:
    """Return the only step before which the product is turned over, and its number from 0."""
    ((k, step),) = [(k, step) for k, step in enumerate(plan.steps) if step.turned]
    return k, step


def test_a_table_is_built_upside_down_and_set_once_it_stands() -> None:
    plan = planned()
    assert plan.status == "complete"
    assert plan.table is not None
    np.testing.assert_allclose(plan.table.normal, -UP, atol=1e-9)
    assert plan.order[0] == "top"
    assert {*plan.order[1:5]} == {f"leg_{k}" for k in range(4)}
    k, step = turned_step(plan)
    assert k == 5
    assert step.table is not None
    np.testing.assert_allclose(step.table.normal, UP, atol=1e-9)
    assert step.table.offset == pytest.approx(0.0, abs=1e-9)
    assert "turned over 1 · fixture none" in plan.verdict
    assert plan.executable
    for entry, table in zip(plan.steps[1:], step_tables(plan.steps, plan.table)[1:], strict=True):
        assert table is not None
        assert entry.direction is not None
        assert entry.direction @ table.normal == pytest.approx(-1.0), "everything comes from above"
        assert not entry.held


def test_it_costs_less_than_the_cheapest_without_a_turn() -> None:
    plan = planned()
    config = PipelineConfig(contacts=False)
    search = replace(config.sequence.search, turned_tables=0)
    flat = plan_assembly(set_table(), config=replace(config, sequence=replace(config.sequence, search=search)))
    assert not any(step.turned for step in flat.steps)
    assert plan.cost is not None
    assert flat.cost is not None
    assert plan.cost.terms["turn_overs"] == 1.0
    assert plan.cost.terms["turned_loose"] == 4.0
    assert plan.cost.total < flat.cost.total
    assert flat.cost.terms["turn_overs"] == 0.0


def test_nobody_turns_what_is_not_worth_it_or_what_the_user_wants_upright() -> None:
    only = assembly(plate=box((0.1, 0.1, 0.01)), block=box((0.02, 0.02, 0.02), (0.0, 0.0, 0.015)))
    assert not any(step.turned for step in plan_assembly(only, config=PipelineConfig(contacts=False)).steps)
    config = PipelineConfig(contacts=False)
    motion = replace(config.motion, table=replace(config.motion.table, up=(0.0, 0.0, -1.0)))
    assert not any(step.turned for step in plan_assembly(set_table(), config=replace(config, motion=motion)).steps)
    assert OrderSearchConfig().turned_tables > 0


def test_parts_of_the_second_table_rest_on_it() -> None:
    plan, parts = planned(), set_table()
    for step, table in zip(plan.steps[1:], step_tables(plan.steps, plan.table)[1:], strict=True):
        assert table is not None
        vertices = parts.part(step.part).vertices_part
        rest = step.motion.T_world_part[0]
        heights = (vertices @ rest[:3, :3].T + rest[:3, 3]) @ table.normal
        assert heights.min() == pytest.approx(table.offset, abs=1e-9)


def test_a_turned_plan_is_written_and_read() -> None:
    plan = planned()
    text = plan_to_json(plan)
    assert plan_to_json(plan_from_json(text)) == text
    k, step = turned_step(plan)
    read = plan_from_json(text).steps[k].table
    assert read is not None
    assert step.table is not None
    np.testing.assert_array_equal(read.normal, step.table.normal)
    with pytest.raises(SashimonoError, match="must have both turned and a table"):
        plan_from_json(text.replace('"turned": true', '"turned": false'))


def with_step(plan: AssemblyPlan, k: int, **changes: object) -> AssemblyPlan:
    steps = [*plan.steps]
    steps[k] = replace(steps[k], **changes)
    return replace(plan, steps=tuple(steps))


def test_the_check_accepts_it() -> None:
    report = verify_plan(planned(), set_table())
    assert report.ok, report.lines()
    assert report.executable


def problems_of(plan: AssemblyPlan) -> str:
    report = verify_plan(plan, set_table())
    said = [*report.problems]
    for step in report.steps:
        said += [*step.problems, *step.contact_problems, *step.hold_problems]
    return "; ".join(said)


def test_a_forged_table_is_refused() -> None:
    plan = planned()
    k, step = turned_step(plan)
    table = step.table
    assert table is not None
    lower, higher = (Table(normal=table.normal, offset=table.offset + d) for d in (-0.01, 0.01))
    assert "floats 10 mm over the table that it is turned onto" in problems_of(with_step(plan, k, table=lower))
    assert "below the table that the product is turned onto" in problems_of(with_step(plan, k, table=higher))
    # never turned over: the things would come from below, through the table
    assert problems_of(with_step(plan, k, table=None))
    # turned back at once: legs that were put in from above on the other table
    assert "unit vector" in problems_of(with_step(plan, k, table=Table(normal=2.0 * UP, offset=0.0)))
    assert "nothing is placed that could be turned over" in problems_of(with_step(plan, 0, table=table))
    tilted = np.array([0.0, 0.28, 0.96])
    lowest = min(float((set_table().part(name).vertices_world @ tilted).min()) for name in step.fixed)
    on_edge = Table(normal=tilted, offset=lowest)
    said = problems_of(with_step(plan, k, table=on_edge))
    assert "once it is turned over, and is not held" in said
    assert "held after a turn" in problems_of(with_step(plan, k, held_before=("thing_2",)))
    assert "nothing is turned over" in problems_of(with_step(plan, 1, held_before=("top",)))
    without = replace(plan, table=None)
    assert "there is no table to begin with" in problems_of(without)


def test_a_fixture_ends_where_the_product_is_turned_over() -> None:
    plan = planned()
    assert plan.fixture is None
    assert all(step.hands is not None and step.hands <= 2 for step in plan.steps)


def test_pages_show_the_product_turned_on_a_table_that_stays() -> None:
    plan, parts = planned(), set_table()
    frames = page_frames(plan, parts)
    for k, T in enumerate(frames):
        on = step_tables(plan.steps, plan.table)[k]
        assert on is not None
        assert plan.table is not None
        np.testing.assert_allclose(T[:3, :3] @ on.normal, plan.table.normal, atol=1e-9)
    scene = make_scene(plan, parts, ViewConfig()).json
    (turn,) = [step for step in scene["steps"] if step["turns"]]
    assert turn["label"] == "6a"
    assert {plan.order.index(parts.names[k]) for k in turn["moving"]} == set(range(5))
    moments = dict(keyframes(plan, parts))
    assert [*moments][5:8] == ["5 leg_3", "6 turned over", "6 thing_0"]
    assert moments["5 leg_3"]["top"][2, 2] * moments["6 turned over"]["top"][2, 2] < 0.0
    np.testing.assert_allclose(moments["8 thing_2"]["thing_0"], frames[5] @ parts.part("thing_0").T_world_part)


def test_instructions_say_so() -> None:
    plan, parts = planned(), set_table()
    tasks = make_manual(plan, parts).tasks
    assert [task.turns_product for task in tasks] == [False] * 5 + [True] + [False] * 2
    np.testing.assert_allclose(tasks[5].up, UP, atol=1e-9)
    np.testing.assert_allclose(tasks[4].up, -UP, atol=1e-9)
    notes = [row[-1] for row in step_table(plan, parts, ())]
    assert [k for k, note in enumerate(notes) if "turned over" in str(note)] == [6]


def test_the_old_plan_is_good_for_shorter_legs() -> None:
    """Carried over to legs that are 10 mm shorter, the product stands 10 mm lower once it is turned over."""
    plan = planned()
    shorter = []
    for part in set_table().parts:
        vertices = np.array(part.vertices_part)
        if part.name.startswith("leg"):
            vertices[vertices[:, 2] < 0.01, 2] += 0.01
        shorter.append(replace(part, vertices_part=vertices))
    parts = Assembly(parts=tuple(shorter), source=Source(path="", sha256="", unit="m"))
    changes = [PartChange(old=n, new=n, reshaped=n.startswith("leg"), displacement=np.eye(4)) for n in parts.names]
    new = carry_over(plan, parts, changes)
    k, step = turned_step(new)
    assert k == 5
    assert step.table is not None
    assert step.table.offset == pytest.approx(0.01)
    report = verify_plan(new, parts)
    assert not [problem for each in report.steps for problem in each.problems]
