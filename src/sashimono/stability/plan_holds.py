"""What must be held at each step of a plan, and what a fixture holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sashimono.geometry import se3
from sashimono.geometry.body import Body
from sashimono.plan import AssemblyPlan, Fixture, Motion, Step, Table, same_table, simultaneous_steps, waits
from sashimono.stability.config import StabilityConfig
from sashimono.stability.holding import fewest_held
from sashimono.stability.statics import Statics
from sashimono.stability.touching import Touching


def hold_plan(
    plan: AssemblyPlan,
    bodies: Mapping[str, Body],
    *,
    config: StabilityConfig,
    touching: Touching | None = None,
) -> AssemblyPlan:
    """Return the plan with what each step must hold, how many hands it takes, and the fixtures that it uses.

    A plan without a table is returned as it is: nothing says where down is.

    Args:
        plan: What is to be held.
        bodies: Every placed part by name.
        config: Options.
        touching: The touching points of these parts, where somebody found them already.
    """
    if plan.table is None:
        return plan
    screwed = [(step.part, step.declared.other) for step in plan.all_steps if step.declared is not None]
    fastened = [(step.part, other) for step in plan.all_steps if step.fastener for other in step.fastener.joins]
    fitted = [(fit.part, fit.other) for step in plan.all_steps for fit in step.close_fits]
    known = touching or Touching(bodies, plan.parts, config=config)
    touching = known.with_fastened([*screwed, *fastened, *fitted])
    steps, fixture = _hold_level(plan.steps, plan.table, touching)
    return replace(plan, steps=steps, fixture=fixture)


def _hold_level(steps: Sequence[Step], table: Table, touching: Touching) -> tuple[tuple[Step, ...], Fixture | None]:
    """Steps that follow one another, those inside subassemblies first. A turn takes the product out of a fixture."""
    fixture = _fixture(steps, table, touching)
    statics = Statics(touching, table)
    fixed = () if fixture is None else fixture.parts
    out: list[Step] = []
    held: tuple[str, ...] = ()
    for k, step in enumerate(steps):
        if step.table is not None:
            statics, fixed = Statics(touching, step.table), ()
            turned = fewest_held(statics, step.fixed, preferred=held)
            held = turned.held
            step = replace(step, held_before=held)
            if not turned.fewest:
                step = replace(step, motion=_not_fewest(step.motion))
        # what is inserted at the same time is let go at the same time
        brought = tuple(name for each in simultaneous_steps(steps, k) for name in each.members)
        found = fewest_held(
            statics, (*step.fixed, *brought), fixed=fixed, preferred=(*held, *brought) if step.moves else ()
        )
        hands = max(len(held) + step.moves + len(step.simultaneous), len(found.held))
        after = found.held
        inside = step.subassembly
        if inside is not None and inside.table is not None:
            inner, below = _hold_level(inside.steps, inside.table, touching)
            inside = replace(inside, steps=inner, fixture=below)
        motion = step.motion if found.fewest else _not_fewest(step.motion)
        out.append(replace(step, held=after, hands=hands, subassembly=inside, motion=motion))
        if not waits(steps, k):
            held = after
    return tuple(out), fixture


def _not_fewest(motion: Motion) -> Motion:
    return replace(motion, evidence={**motion.evidence, "held_fewest": False})


def _fixture(steps: Sequence[Step], table: Table, touching: Touching) -> Fixture | None:
    """The fixture in which the base stands above the table, with the reason; None if it stands on the table."""
    if not steps:
        return None
    base = steps[0].part
    low = touching.bodies[base].lowest(touching.poses[base], table.normal)
    height = low - table.offset
    standing = [step.part for step in steps if not step.moves]
    lowest = min(touching.bodies[name].lowest(touching.poses[name], table.normal) for name in standing)
    if lowest - table.offset <= touching.config.table_gap * touching.bodies[base].smallest_extent:
        return None
    first = [*steps[:1], *same_table(steps, 0)]
    lower = [step.part for step in first if _lowest_inserted(step, table, touching) < lowest]
    names = ", ".join(lower[:3]) + (f" and {len(lower) - 3} more" if len(lower) > 3 else "")
    reason = f"on the way in, {names} comes lower than the base" if lower else "the table lies lower than the base"
    return Fixture(parts=tuple(standing), height=float(height), reason=reason)


def _lowest_inserted(step: Step, table: Table, touching: Touching) -> float:
    """Return the least height of what a step brings, over its insertion [m]."""
    starts = [segment.start for segment in step.motion.segments if segment.kind == "insertion"]
    if not starts:
        return np.inf
    first = min(starts)
    back = se3.inverse(touching.poses[step.part])
    return min(
        touching.bodies[name].lowest(T @ back @ touching.poses[name], table.normal)
        for T in step.motion.T_world_part[first:]
        for name in step.members
    )
