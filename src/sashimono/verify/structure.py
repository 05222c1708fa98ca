"""Does the plan say what a plan must say, and does it speak of this assembly?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan, Motion, Step, Table
from sashimono.verify.config import VerifyConfig
from sashimono.verify.declared import declared_problems

_SAME_TIME = 1e-6
"""Share by which times that are the same may differ."""
_NO_TURN = 1e-9
"""Most that an entry of a rotation may change where nothing turns."""


def plan_problems(plan: AssemblyPlan, assembly: Assembly, config: VerifyConfig) -> tuple[list[str], list[str]]:
    """Return what is wrong with the plan as a whole, and what could not be checked."""
    problems, notes = [], []
    if assembly.source is None:
        notes.append("the assembly was not read from a file: no hash to compare")
    elif assembly.source.sha256 != plan.source.sha256:
        problems.append("the geometry is not the one that was planned: its sha256 differs from source.sha256")
    stand_ins = () if assembly.source is None else assembly.source.stand_ins
    notes += [f"{entry.part!r} is checked by a closed stand-in: its surface is not closed" for entry in stand_ins]
    stated = {entry.part for entry in plan.source.stand_ins}
    problems += [f"{e.part!r} is not closed, and the plan does not say so" for e in stand_ins if e.part not in stated]
    problems += _part_problems(plan, assembly, config)
    problems += _order_problems(plan, assembly)
    problems += [*_table_problems(plan.table), *_turn_problems(plan.steps, plan.table)]
    if plan.table is None:
        notes.append("the plan has no table: resting poses are not checked for stability")
    return problems, notes


def _table_problems(table: Table | None) -> list[str]:
    if table is None:
        return []
    problems = []
    if (
        table.normal.shape != (3,)
        or not np.isfinite(table.normal).all()
        or abs(np.linalg.norm(table.normal) - 1) > 1e-6
    ):
        problems.append("table.normal is not a unit vector")
    if not np.isfinite(table.offset):
        problems.append("table.offset is not a finite number")
    return problems


def _turn_problems(steps: Sequence[Step], table: Table | None) -> list[str]:
    """What is wrong with what these steps, which follow one another, say of turning the product over."""
    problems = []
    for k, step in enumerate(steps):
        if step.table is None:
            if step.held_before:
                problems.append(f"{step.part!r} says what is held after a turn, but nothing is turned over")
            continue
        problems += [f"step of {step.part!r}: {problem}" for problem in _table_problems(step.table)]
        if table is None:
            problems.append(f"the product is turned over before {step.part!r}, but there is no table to begin with")
        if k == 0:
            problems.append(f"nothing is placed that could be turned over before {step.part!r}")
        problems += [f"{name!r} is held after a turn, but not in place" for name in {*step.held_before} - {*step.fixed}]
    return problems


def _part_problems(plan: AssemblyPlan, assembly: Assembly, config: VerifyConfig) -> list[str]:
    problems = [
        f"part {name!r} of the assembly is missing from the plan" for name in assembly.names if name not in plan.parts
    ]
    for name, T in plan.parts.items():
        if name not in assembly.names:
            problems.append(f"part {name!r} of the plan is not in the assembly")
        elif not se3.is_pose(T, config.pose_tolerance):
            problems.append(f"the assembled pose of {name!r} is not rigid")
        elif not same_pose(T, assembly.part(name).T_world_part, assembly.part(name).vertices_part, config):
            problems.append(f"the assembled pose of {name!r} is not the one of the assembly")
    return problems


def _order_problems(plan: AssemblyPlan, assembly: Assembly) -> list[str]:
    problems = [f"{name!r} is in the order more than once" for name, n in Counter(plan.order).items() if n > 1]
    problems += [
        f"{name!r} is in the order but not in the assembly" for name in plan.order if name not in assembly.names
    ]
    if tuple(step.part for step in plan.steps) != tuple(plan.order):
        problems.append("the steps do not follow the order")
    placed = Counter(name for step in plan.steps for name in _placed(step))
    problems += [f"{name!r} is placed more than once" for name, n in placed.items() if n > 1]
    unsolved = {item.part for item in plan.unsolved}
    absent = [name for name in assembly.names if name not in placed]
    if plan.status == "complete":
        problems += [f"called complete, but {name!r} has no step" for name in absent]
        problems += [f"called complete, but {name!r} is listed as unsolved" for name in sorted(unsolved)]
    else:
        problems += [f"{name!r} has neither a step nor a reason in unsolved" for name in absent if name not in unsolved]
        if not absent and not unsolved:
            problems.append("called partial, but every part has a step and nothing is unsolved")
    return problems


def simultaneous_problems(steps: Sequence[Step], k: int, broken: Collection[str]) -> list[str]:
    """Return what is wrong with what happens at the same time as step number ``k`` of those that follow one another.

    Insertions that go at once must be straight, and of one stretch: then they pass each other in straight lines.
    ``broken`` are the parts of steps of which the form is wrong by itself.
    """
    step, number = steps[k], {each.part: j for j, each in enumerate(steps)}
    if not step.simultaneous:
        return []
    if unknown := [name for name in step.simultaneous if number.get(name, k) == k]:
        return [f"is to happen at the same time as {unknown[0]!r}, which is no other step"]
    together = sorted([k, *(number[name] for name in step.simultaneous)])
    names = {steps[j].part for j in together}
    if len(names) <= len(step.simultaneous) or any({steps[j].part, *steps[j].simultaneous} != names for j in together):
        return [f"the steps of {', '.join(sorted(names))} do not agree on what happens at the same time"]
    if together != list(range(together[0], together[-1] + 1)):
        return [f"the steps of {', '.join(sorted(names))} happen at the same time, but do not follow one another"]
    if step.table is not None and k > together[0]:
        return ["the product is turned over between steps that happen at the same time"]
    if wrong := [name for name in step.simultaneous if name in broken]:
        return [f"happens at the same time as {wrong[0]!r}, of which the form is wrong"]
    if step.part in broken:
        return []
    segments, poses = step.motion.segments, step.motion.T_world_part
    if [s.kind for s in segments] != ["transit", "insertion"] or segments[1].stop - segments[1].start != 1:
        return ["happens at the same time as another step, so it must have a transit, then an insertion of one stretch"]
    if np.abs(poses[-1, :3, :3] - poses[-2, :3, :3]).max() > _NO_TURN:
        return ["happens at the same time as another step, so it must not turn in its insertion"]
    seconds = [float(times[-1] - times[-2]) for j in together if (times := steps[j].motion.times) is not None]
    if not seconds:
        return []
    if len(seconds) < len(together):
        return ["happens at the same time as another step, but only one of them has times"]
    if min(seconds) <= 0.0 or max(seconds) - min(seconds) > _SAME_TIME * max(seconds):
        return ["happens at the same time as another step, but its insertion takes another time, or none"]
    return []


def _placed(step: Step) -> list[str]:
    """Every part that a step of its own puts in its place, inside a subassembly too."""
    if step.subassembly is None:
        return [step.part]
    return [name for inner in step.subassembly.steps for name in _placed(inner)]


def members(step: Step) -> tuple[str, ...]:
    """Return the parts that move in a step."""
    return step.moving if step.moving else (step.part,)


def member_poses(step: Step, name: str, assembly: Assembly) -> Float[np.ndarray, "pose 4 4"]:
    """Return one member's poses: it undergoes the same displacements as the part whose path is stated."""
    path = step.motion.T_world_part
    if name == step.part:
        return path
    back = se3.inverse(assembly.part(step.part).T_world_part)
    return np.array([T @ back @ assembly.part(name).T_world_part for T in path])


def step_problems(
    step: Step, placed: Sequence[str], assembly: Assembly, unsolved: Collection[str], config: VerifyConfig
) -> list[str]:
    """Return what is wrong with the form of one step; its geometry can be looked at only if nothing is.

    ``placed``: the parts placed before it. ``unsolved``: the parts that the plan admits not to have placed.
    """
    if foreign := [name for name in (step.part, *step.moving) if name not in assembly.names]:
        return [f"{foreign[0]!r} is not in the assembly"]
    problems = [f"{name!r} is in place already" for name in members(step) if name in placed]
    if len(set(step.fixed)) != len(step.fixed) or set(step.fixed) != set(placed):
        problems.append(f"fixed is {list(step.fixed)}, but placed before are {list(placed)}")
    problems += _group_problems(step, bool(placed), unsolved)
    problems += _path_problems(step.motion, bool(placed), config)
    if not problems:
        problems += declared_problems(step, config)
        for name in members(step):
            part = assembly.part(name)
            if not same_pose(member_poses(step, name, assembly)[-1], part.T_world_part, part.vertices_part, config):
                problems.append(f"the path does not end in the assembled pose{f' of {name!r}' if step.moving else ''}")
    return problems


def _group_problems(step: Step, moves: bool, unsolved: Collection[str]) -> list[str]:
    """What is wrong with the parts that move together and with how they are said to have come together."""
    inside = step.subassembly
    if not step.moving and inside is None:
        return []
    if not moves:
        return ["the base must be a single part"]
    problems = [f"{name!r} moves twice" for name, n in Counter(step.moving).items() if n > 1]
    if step.part not in step.moving:
        problems.append(f"moves {list(step.moving)}, but its path is that of {step.part!r}")
    if inside is None:
        return [*problems, f"moves {len(step.moving)} parts, but does not say how they were put together"]
    if tuple(inner.part for inner in inside.steps) != tuple(inside.order):
        problems.append("the steps inside the subassembly do not follow its order")
    brought = {name for inner in inside.steps for name in members(inner)}
    placed = {name for inner in inside.steps for name in _placed(inner)}
    problems += [
        f"{name!r} is put into the subassembly, but does not move with it" for name in brought - {*step.moving}
    ]
    problems += [
        f"{name!r} moves with the subassembly, but is not put into it"
        for name in step.moving
        if name not in placed and name not in unsolved
    ]
    return sorted(problems) + _table_problems(inside.table) + _turn_problems(inside.steps, inside.table)


def _path_problems(motion: Motion, moves: bool, config: VerifyConfig) -> list[str]:
    poses = motion.T_world_part
    if poses.ndim != 3 or poses.shape[1:] != (4, 4) or len(poses) == 0:
        return ["the path is not a list of 4x4 poses"]
    bad = [k for k, T in enumerate(poses) if not se3.is_pose(T, config.pose_tolerance)]
    if bad:
        return [f"pose {bad[0]} of the path is not rigid"]
    if not moves:
        return [] if len(poses) == 1 and not motion.segments else ["the base part must have one pose and no segment"]
    if len(poses) < 2:
        return ["the path has a single pose: the part never moves to its place"]
    stops = [0, *(segment.stop for segment in motion.segments)]
    starts = [*(segment.start for segment in motion.segments), len(poses) - 1]
    if stops != starts or any(segment.start >= segment.stop for segment in motion.segments):
        return [f"the segments do not cover poses 0 to {len(poses) - 1} in order"]
    unknown = [segment.kind for segment in motion.segments if segment.kind not in ("transit", "insertion")]
    if unknown:
        return [f"segment kind {unknown[0]!r} is neither transit nor insertion"]
    if (times := motion.times) is not None and (
        times.shape != (len(poses),) or times[0] != 0.0 or not np.isfinite(times).all() or (np.diff(times) < 0.0).any()
    ):
        return ["times are not one for each pose, from 0 on and never back"]
    return [] if motion.segments[-1].kind == "insertion" else ["the last segment is no insertion"]


def same_pose(a: np.ndarray, b: np.ndarray, points_part: np.ndarray, config: VerifyConfig) -> bool:
    """Return whether two poses put every point of a part in the same place, over the part's size."""
    if a.shape != b.shape:
        return False
    low, high = points_part.min(axis=0), points_part.max(axis=0)
    corners = np.array(np.meshgrid(*np.stack([low, high], axis=1))).reshape(3, -1).T
    apart = np.linalg.norm(se3.apply(a, corners) - se3.apply(b, corners), axis=1).max()
    return bool(apart <= config.pose_tolerance * np.linalg.norm(high - low))
