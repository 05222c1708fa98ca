"""The independent check, put together."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from sashimono.assembly import Assembly
from sashimono.errors import InputError
from sashimono.io.plan_json import read_plan
from sashimono.io.read import read_assembly
from sashimono.plan import AssemblyPlan, Step
from sashimono.verify.body import Body
from sashimono.verify.config import VerifyConfig
from sashimono.verify.grasp import Surroundings, contact_problems
from sashimono.verify.overlap import AssembledOverlaps
from sashimono.verify.pairs import PairFinding, check_pair, check_table, pair_tolerance
from sashimono.verify.report import StepReport, VerifyReport
from sashimono.verify.resting import resting_problems
from sashimono.verify.structure import plan_problems, step_problems
from sashimono.verify.sweep import HalfSpace, Screws


def verify_plan(plan: AssemblyPlan, assembly: Assembly, *, config: VerifyConfig | None = None) -> VerifyReport:
    """Check a plan from the input geometry, with none of the code that made it.

    Returns what was found: the form of the plan and that it speaks of this assembly; for each step that the part
    rests on the table at first, touches nothing along its path (placed parts, table, parts still resting) deeper than
    in the assembled pose plus the tolerance, and can be held as stated. Raises nothing: a bad plan is a finding.
    """
    config = config or VerifyConfig()
    problems, notes = plan_problems(plan, assembly, config)
    bodies = {
        part.name: Body(part.name, part.vertices_part, part.faces, samples=config.samples) for part in assembly.parts
    }
    flat = [name for name, body in bodies.items() if body.volume <= 0.0]
    problems += [f"{name!r} is not a closed, outward surface: it cannot be checked" for name in flat]
    if problems:
        steps = tuple(_form_only(k, step, plan, assembly, config) for k, step in enumerate(plan.steps))
        return VerifyReport(
            problems=tuple(problems),
            steps=steps,
            notes=(*notes, "motions were not checked"),
            complete=plan.status == "complete",
        )
    poses = {part.name: part.T_world_part for part in assembly.parts}
    overlaps = AssembledOverlaps(bodies, poses)
    forms = [step_problems(step, plan.order[:k], assembly, config) for k, step in enumerate(plan.steps)]
    steps = tuple(
        _check_step(k, plan, forms, bodies, overlaps, config)
        if not forms[k]
        else StepReport(index=k, part=step.part, problems=tuple(forms[k]))
        for k, step in enumerate(plan.steps)
    )
    return VerifyReport(problems=(), steps=steps, notes=tuple(notes), complete=plan.status == "complete")


def verify_file(
    plan_path: str | Path, input_path: str | Path | None = None, *, config: VerifyConfig | None = None
) -> VerifyReport:
    """Check a plan.json against its input, read again and compared by hash.

    The input is ``input_path``, or the plan's ``source.path``, relative to the plan's folder or to the current one:
    whichever has the right hash.
    Raises PlanFormatError for a broken plan file and InputError where the input is missing or unusable.
    """
    plan = read_plan(plan_path)
    stated = Path(input_path if input_path is not None else plan.source.path)
    candidates = [stated] if input_path is not None else [Path(plan_path).parent / stated, stated]
    found = [path for path in candidates if path.exists()]
    if not found:
        raise InputError(f"{plan_path}: its input {plan.source.path} is not there. Name it with --input.")
    assemblies = (read_assembly(path, unit=plan.source.unit) for path in found)
    return verify_plan(plan, _matching(assemblies, plan.source.sha256), config=config)


def _matching(assemblies: Iterator[Assembly], sha256: str) -> Assembly:
    """Return the first assembly with this hash, else the first; reads no more than it must."""
    first = next(assemblies)
    if first.source is not None and first.source.sha256 == sha256:
        return first
    others = (other for other in assemblies if other.source is not None and other.source.sha256 == sha256)
    return next(others, first)


def _form_only(index: int, step: Step, plan: AssemblyPlan, assembly: Assembly, config: VerifyConfig) -> StepReport:
    problems = step_problems(step, plan.order[:index], assembly, config)
    return StepReport(index=index, part=step.part, problems=tuple(problems), notes=("motion not checked",))


def _check_step(
    index: int,
    plan: AssemblyPlan,
    forms: list[list[str]],
    bodies: dict[str, Body],
    overlaps: AssembledOverlaps,
    config: VerifyConfig,
) -> StepReport:
    """Check one step whose form is sound."""
    step = plan.steps[index]
    body, poses = bodies[step.part], step.motion.T_world_part
    problems, contact_wrong, notes = [], [], []
    if plan.table is not None and index > 0:
        problems += resting_problems(body, poses[0], plan.table, config)
    findings = _pair_findings(index, plan, forms, bodies, overlaps, config)
    problems += [finding.problem for finding in findings if finding.problem]
    notes += [note for finding in findings for note in finding.notes]
    if step.contact is not None:
        contact_wrong, remarks = contact_problems(
            step, body, _surroundings(index, plan, forms, bodies, overlaps), config
        )
        notes += remarks
    elif index > 0:
        notes.append(f"no contact: {step.contact_reason or 'no reason given'}")
    met = [finding for finding in findings if finding.depth > 0.0]
    worst = max(met, key=lambda finding: finding.depth / finding.allowed, default=None)
    return StepReport(
        index=index,
        part=step.part,
        problems=tuple(problems),
        contact_problems=tuple(contact_wrong),
        notes=tuple(notes),
        max_penetration=worst.depth if worst else 0.0,
        allowed=worst.allowed if worst else None,
        against=worst.against if worst else None,
        pose=worst.pose if worst else None,
        queries=sum(finding.queries for finding in findings),
    )


def _surroundings(
    index: int, plan: AssemblyPlan, forms: list[list[str]], bodies: dict[str, Body], overlaps: AssembledOverlaps
) -> Surroundings:
    """Placed parts where they are assembled, later ones where they rest, the table."""
    around = {name: (bodies[name], overlaps.poses[name]) for name in plan.steps[index].fixed}
    for later, form in zip(plan.steps[index + 1 :], forms[index + 1 :], strict=True):
        if not form:
            around[later.part] = (bodies[later.part], later.motion.T_world_part[0])
    table = None if plan.table is None else HalfSpace(normal=plan.table.normal, offset=plan.table.offset)
    return Surroundings(bodies=around, table=table)


def _pair_findings(
    index: int,
    plan: AssemblyPlan,
    forms: list[list[str]],
    bodies: dict[str, Body],
    overlaps: AssembledOverlaps,
    config: VerifyConfig,
) -> list[PairFinding]:
    """Move the part past everything that is there: placed parts, the table, parts still resting."""
    step = plan.steps[index]
    body, path = bodies[step.part], Screws.between(step.motion.T_world_part)
    findings = []
    for name in step.fixed:
        findings.append(
            check_pair(
                body,
                bodies[name],
                path,
                overlaps.poses[name],
                allowance=lambda name=name: overlaps.depth(step.part, name),
                tolerance=pair_tolerance(body, bodies[name], config),
                config=config,
            )
        )
    for later, form in zip(plan.steps[index + 1 :], forms[index + 1 :], strict=True):
        if form:
            continue
        other = bodies[later.part]
        found = check_pair(
            body,
            other,
            path,
            later.motion.T_world_part[0],
            allowance=lambda: 0.0,
            tolerance=pair_tolerance(body, other, config),
            config=config,
        )
        findings.append(found)
    if plan.table is not None:
        table = HalfSpace(normal=plan.table.normal, offset=plan.table.offset)
        findings.append(check_table(body, table, path, config=config))
    return findings
