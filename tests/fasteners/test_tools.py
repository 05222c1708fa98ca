"""Tool access: straight from above, swung under a roof, or not at all; orders that leave room; and the check of it."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hardware import MM, cylinder, nut, plate, screw
from solids import assembly, box

from sashimono.assembly import Assembly
from sashimono.fasteners.recognise import Fastener, find_fasteners
from sashimono.fasteners.tools import tool_for, tool_ways
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import Tool
from sashimono.verify import verify_plan
from sashimono.view.manual.content import make_manual

QUICK = PipelineConfig(contacts=False)


def under_a_roof(height: float | None, drive: str = "hex socket") -> Assembly:
    """A cover screwed on a base, and a roof so high above the cover [mm], on a leg beside it."""
    base = box((40 * MM, 40 * MM, 20 * MM), (0.0, 0.0, -15 * MM)) - cylinder(6 * MM, 15 * MM, -18 * MM)
    solids = {"base": base, "cover": plate(5 * MM, 6.6 * MM, -5 * MM, width=20 * MM)}
    solids["screw"] = screw(6 * MM, 16 * MM, drive)
    if height is not None:
        leg = box((4 * MM, 40 * MM, (height + 5) * MM), (-18 * MM, 0.0, (height - 5) * MM / 2.0))
        solids["roof"] = leg + box((40 * MM, 40 * MM, 4 * MM), (0.0, 0.0, (height + 2) * MM))
    return assembly(**solids)


def the_screw(parts: Assembly) -> Fastener:
    (found,) = [f for f in find_fasteners(parts) if f.part == "screw"]
    return found


def tool_of(parts: Assembly) -> Tool:
    fastener = the_screw(parts)
    tool = tool_for(fastener, tool_ways(parts, fastener), [name for name in parts.names if name != "screw"])
    assert tool is not None
    return tool


def test_a_free_screw_is_driven_straight() -> None:
    tool = tool_of(under_a_roof(None))
    assert (tool.name, tool.kind, tool.access, tool.reason) == ("hex key 5 mm", "hex key", True, None)
    assert tool.size == pytest.approx(5 * MM, rel=0.05)  # across the facets of a coarse hexagon
    assert [space.toward for space in tool.space] == [None, None]
    # what is swept is a cylinder behind the head, as far as the screw still stands out at the start
    head = the_screw(under_a_roof(None)).head_length
    assert tool.space[0].low == pytest.approx(head)


def test_an_angled_key_goes_under_a_roof_of_60_mm_but_not_of_30() -> None:
    high = tool_of(under_a_roof(60.0))
    assert high.access
    assert high.space[-1].angle is not None
    # it is swung where the leg is not
    assert high.space[-1].toward is not None
    assert high.space[-1].toward[0] > -0.9
    low = tool_of(under_a_roof(30.0))
    assert not low.access
    assert low.reason == "no room for it: roof in the way"


def test_a_screwdriver_has_no_angle() -> None:
    assert not tool_of(under_a_roof(60.0, "slot")).access


def test_a_wrench_needs_its_swing_at_the_head() -> None:
    assert tool_of(under_a_roof(30.0, "hex")).access
    low = tool_of(under_a_roof(8.0, "hex"))
    assert not low.access


def test_a_nut_turns_around_its_bolt() -> None:
    parts = assembly(
        bolt=screw(6 * MM, 30 * MM, "hex"),
        top=plate(8 * MM, 6.6 * MM, -8 * MM),
        bottom=plate(8 * MM, 6.6 * MM, -16 * MM),
        nut=nut(6 * MM, 10 * MM, 5 * MM).translate((0.0, 0.0, -21 * MM)),
    )
    (fastener,) = [f for f in find_fasteners(parts) if f.part == "nut"]
    (way,) = tool_ways(parts, fastener)
    assert way.blockers == frozenset()


def test_the_screw_is_set_before_the_roof_takes_its_room() -> None:
    parts = under_a_roof(30.0)
    plan = plan_assembly(parts, config=QUICK)
    assert plan.order.index("screw") < plan.order.index("roof")
    (step,) = [step for step in plan.steps if step.part == "screw"]
    assert step.tool is not None
    assert step.tool.access
    assert plan_to_json(plan_from_json(plan_to_json(plan))) == plan_to_json(plan)
    assert '"tool_access": true' in plan_to_json(plan)
    assert make_manual(plan, parts).tasks


def test_the_check_refutes_room_that_is_not_there() -> None:
    parts = under_a_roof(30.0)
    plan = plan_assembly(parts, config=QUICK)
    assert not [problem for step in verify_plan(plan, parts).steps for problem in step.hold_problems]

    def with_tool(tool: Tool) -> list[str]:
        steps = tuple(replace(step, tool=tool) if step.part == "screw" else step for step in plan.steps)
        report = verify_plan(replace(plan, steps=steps), parts)
        return [problem for step in report.steps for problem in step.hold_problems]

    (tool,) = [step.tool for step in plan.steps if step.tool is not None]
    wide = tuple(replace(space, radius=0.05) for space in tool.space)
    assert any("is in the way of hex key 5 mm" in problem for problem in with_tool(replace(tool, space=wide)))
    assert with_tool(replace(tool, space=wide, access=False)) == []
    thin = tuple(replace(space, radius=1e-4) for space in tool.space)
    assert any("too small for that tool" in problem for problem in with_tool(replace(tool, space=thin)))
