"""The independent check, put together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.io.plan_input import read_plan_input
from sashimono.io.plan_json import read_plan
from sashimono.plan import AssemblyPlan, Fixture, Step, Subassembly, Table
from sashimono.verify.body import SampledBody
from sashimono.verify.bond import stated_bonds
from sashimono.verify.compound import Compound
from sashimono.verify.config import VerifyConfig
from sashimono.verify.fits import fit_problems
from sashimono.verify.grasp import Surroundings, contact_problems
from sashimono.verify.holding import PlacedParts
from sashimono.verify.overlap import AssembledOverlaps
from sashimono.verify.pairs import PairFinding, check_by_fit, check_pair, check_table, pair_tolerance
from sashimono.verify.report import StepReport, VerifyReport
from sashimono.verify.resting import resting_problems
from sashimono.verify.structure import member_poses, members, plan_problems, simultaneous_problems, step_problems
from sashimono.verify.sweep import Screws
from sashimono.verify.target import HalfSpace
from sashimono.verify.tool import tool_problems
from sashimono.verify.turning import stretch_after, tables_of, turn_problems


class Verifier:
    """Checks plans of one assembly, from the input geometry, with none of the code that made them.

    What a motion does to another part is kept, so that the next plan that has the same motion past the same part costs
    less; what is said is the same.
    """

    def __init__(self, assembly: Assembly, *, config: VerifyConfig | None = None) -> None:
        self._site = _site(assembly, config or VerifyConfig())

    def check(self, plan: AssemblyPlan) -> VerifyReport:
        """Return what was found, as `verify_plan` does."""
        site = self._site.of(plan)
        problems, notes = plan_problems(plan, site.assembly, site.config)
        problems += fit_problems(plan.fits, site.bodies, site.config)
        flat = [name for name, body in site.bodies.items() if body.volume <= 0.0]
        problems += [f"{name!r} is not a closed, outward surface: it cannot be checked" for name in flat]
        complete = plan.status == "complete"
        if problems:
            notes = [*notes, "motions were not checked"]
            steps = _forms_only(plan.steps, site)
        else:
            steps = _check_level(plan.steps, plan.table, site)
            steps = _with_holds(plan, steps, plan.table, plan.fixture, _placed_parts(plan, site), site)
        report = VerifyReport(
            problems=tuple(problems), steps=steps, notes=tuple(notes), complete=complete, fits=len(plan.fits)
        )
        executable = _executable(plan, report)
        if plan.executable and not executable:
            report = replace(report, notes=(*report.notes, "the plan is called executable, which does not hold"))
        return replace(report, executable=executable)

    def check_holds(self, plan: AssemblyPlan) -> bool:
        """Return whether what the plan says of hands and held parts holds, and they suffice; motions are not looked at.

        For a plan whose motions and contacts hold. Whoever makes a plan asks this before calling it executable.
        """
        site = self._site.of(plan)
        bare = _forms_only(plan.steps, site)
        if any(step.problems for step in bare):
            return False
        steps = _with_holds(plan, bare, plan.table, plan.fixture, _placed_parts(plan, site), site)
        report = VerifyReport(problems=(), steps=steps, complete=plan.status == "complete")
        return bool(_executable(plan, report))


def verify_plan(plan: AssemblyPlan, assembly: Assembly, *, config: VerifyConfig | None = None) -> VerifyReport:
    """Check a plan from the input geometry, with none of the code that made it.

    Returns what was found: the form of the plan and that it speaks of this assembly; for each step that the part
    rests on the table at first, touches nothing along its path (placed parts, table, parts still resting) deeper than
    in the assembled pose plus the tolerance, and can be held as stated. Parts that move as one are looked at one by
    one along the common motion, and what put them together is checked likewise, as a little plan of its own.
    Raises nothing: a bad plan is a finding.
    """
    return Verifier(assembly, config=config).check(plan)


def _placed_parts(plan: AssemblyPlan, site: _Site) -> PlacedParts:
    screwed = [frozenset((step.part, step.declared.other)) for step in plan.all_steps if step.declared is not None]
    return PlacedParts(site.bodies, site.overlaps.poses, site.config, screwed, stated_bonds(plan))


def _with_holds(
    plan: AssemblyPlan | Subassembly,
    reports: Sequence[StepReport],
    table: Table | None,
    fixture: Fixture | None,
    placed: PlacedParts,
    site: _Site,
) -> tuple[StepReport, ...]:
    """Add to the reports of one level, and of those below, what is said of hands and does not hold.

    Where the form of a step is wrong, nothing is said of its level.
    """
    if any(site.forms(plan.steps)):
        return tuple(reports)
    out = []
    for step, report, found in zip(plan.steps, reports, placed.hold_problems(plan.steps, table, fixture), strict=True):
        below = step.subassembly
        inside = () if below is None else _with_holds(below, report.inside, below.table, below.fixture, placed, site)
        tools = tool_problems(step, site.bodies, site.overlaps.poses)
        out.append(replace(report, hold_problems=(*found, *tools), inside=inside))
    return tuple(out)


def _executable(plan: AssemblyPlan, report: VerifyReport) -> bool | None:
    """Whether somebody with as many hands can carry the plan out; None if it does not say what is held."""
    steps = plan.all_steps
    if any(step.hands is None for step in steps):
        return None
    enough = all((step.hands or 0) <= plan.hands for step in steps)
    grasped = all(step.contact is not None for step in steps if len(step.motion.T_world_part) > 1)
    unheld = any(each.hold_problems for step in report.steps for each in step.all_steps())
    return report.ok and report.complete and enough and grasped and not unheld


def verify_file(
    plan_path: str | Path, input_path: str | Path | None = None, *, config: VerifyConfig | None = None
) -> VerifyReport:
    """Check a plan.json against its input, read again and compared by hash.

    The input is ``input_path``, or the plan's ``source.path``, relative to the plan's folder or to the current one:
    whichever has the right hash.
    Raises PlanFormatError for a broken plan file and InputError where the input is missing or unusable.
    """
    plan = read_plan(plan_path)
    return verify_plan(plan, read_plan_input(plan, plan_path, input_path), config=config)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Site:
    """What all steps share."""

    assembly: Assembly
    bodies: dict[str, SampledBody]
    overlaps: AssembledOverlaps
    config: VerifyConfig
    unsolved: frozenset[str] = frozenset()
    fits: Mapping[frozenset[str], float] = field(default_factory=dict)
    """By pair: how deep the two may go into each other, as the plan declares [m]."""
    findings: dict[tuple[object, ...], PairFinding] = field(default_factory=dict)
    """What was found of a part's path past another part, by all that it depends on."""

    def of(self, plan: AssemblyPlan) -> _Site:
        """Return the site of a plan: with the parts that it leaves out, and the fits that it declares."""
        fits = {frozenset(fit.parts): fit.depth for fit in plan.fits}
        return replace(self, unsolved=frozenset(item.part for item in plan.unsolved), fits=fits)

    def forms(self, steps: Sequence[Step]) -> list[list[str]]:
        """What is wrong with the form of each of these steps, which follow one another."""
        placed: list[str] = []
        out = []
        for k, step in enumerate(steps):
            with_it = {name for other in steps[:k] if other.part in step.simultaneous for name in members(other)}
            before = [name for name in placed if name not in with_it]
            out.append(step_problems(step, before, self.assembly, self.unsolved, self.config))
            placed += members(step)
        broken = {step.part for step, problems in zip(steps, out, strict=True) if problems}
        more = [simultaneous_problems(steps, k, broken) for k in range(len(steps))]
        broken |= {step.part for step, problems in zip(steps, more, strict=True) if problems}
        # what goes in at the same time as something that cannot be looked at cannot be looked at either
        return [
            own + (too or simultaneous_problems(steps, k, broken))
            for k, (own, too) in enumerate(zip(out, more, strict=True))
        ]

    def compound(self, step: Step) -> SampledBody:
        """What moves in a step, in the frame of its part."""
        if not step.moving:
            return self.bodies[step.part]
        T_part_world = se3.inverse(self.overlaps.poses[step.part])
        parts = [(self.bodies[name], T_part_world @ self.overlaps.poses[name]) for name in step.moving]
        return Compound(step.part, parts, samples=self.config.samples)


def _site(assembly: Assembly, config: VerifyConfig) -> _Site:
    bodies = {
        part.name: SampledBody(part.name, part.vertices_part, part.faces, samples=config.samples)
        for part in assembly.parts
    }
    poses = {part.name: part.T_world_part for part in assembly.parts}
    return _Site(
        assembly=assembly,
        bodies=bodies,
        overlaps=AssembledOverlaps(bodies, poses, config),
        config=config,
    )


def _forms_only(steps: Sequence[Step], site: _Site) -> tuple[StepReport, ...]:
    return tuple(
        StepReport(
            index=k,
            part=step.part,
            problems=tuple(form),
            notes=("motion not checked",),
            inside=() if step.subassembly is None else _forms_only(step.subassembly.steps, site),
        )
        for k, (step, form) in enumerate(zip(steps, site.forms(steps), strict=True))
    )


def _check_level(steps: Sequence[Step], table: Table | None, site: _Site) -> tuple[StepReport, ...]:
    """Check steps that follow one another: those of the plan, or those by which one subassembly is put together."""
    forms, tables = site.forms(steps), tables_of(steps, table)
    reports = []
    for k, step in enumerate(steps):
        inside = ()
        if step.subassembly is not None:
            below = step.subassembly
            inside = _forms_only(below.steps, site) if forms[k] else _check_level(below.steps, below.table, site)
        if forms[k]:
            reports.append(StepReport(index=k, part=step.part, problems=tuple(forms[k]), inside=inside))
            continue
        later = [steps[j] for j in stretch_after(steps, k) if not forms[j]]
        before = [each for each in steps[:k] if each.part in step.simultaneous]
        report = replace(_check_step(k, step, before, later, tables[k], site), inside=inside)
        if step.table is not None:
            wrong = turn_problems(step.fixed, site.bodies, site.overlaps.poses, step.table, site.config)
            report = replace(report, problems=(*wrong, *report.problems))
        reports.append(report)
    return tuple(reports)


def _check_step(
    index: int, step: Step, waiting: Sequence[Step], later: Sequence[Step], table: Table | None, site: _Site
) -> StepReport:
    """Check one step whose form is sound: those before it that happen at the same time, and what follows it."""
    body, config = site.compound(step), site.config
    problems, contact_wrong, notes = [], [], []
    if table is not None and index > 0:
        problems += resting_problems(body, step.motion.T_world_part[0], table, config)
    findings = []
    for name in members(step):
        found = _pair_findings(step, name, waiting, later, table, site)
        whose = f"{name} " if step.moving else ""
        problems += [f"{whose}{finding.problem}" for finding in found if finding.problem]
        findings += found
    notes += [note for finding in findings for note in finding.notes]
    if step.contact is not None and step.simultaneous:
        contact_wrong = ["a contact is stated, and none can be checked of what goes in at the same time as another"]
    elif step.contact is not None:
        contact_wrong, remarks = contact_problems(step, body, _surroundings(step, later, table, site), config)
        notes += remarks
    elif index > 0:
        notes.append(f"no grasp: {step.contact_reason or 'no reason given'}")
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
        fits=tuple((finding.by_fit, finding.depth) for finding in findings if finding.by_fit is not None),
    )


def _surroundings(step: Step, later: Sequence[Step], table: Table | None, site: _Site) -> Surroundings:
    """Placed parts where they are assembled, later ones where they rest, the table."""
    around = {name: (site.bodies[name], site.overlaps.poses[name]) for name in step.fixed}
    for waiting in later:
        for name in members(waiting):
            around[name] = (site.bodies[name], member_poses(waiting, name, site.assembly)[0])
    plane = None if table is None else HalfSpace(normal=table.normal, offset=table.offset)
    return Surroundings(bodies=around, table=plane)


def _pair_findings(
    step: Step, moving: str, waiting: Sequence[Step], later: Sequence[Step], table: Table | None, site: _Site
) -> list[PairFinding]:
    """Move one part past everything that is there: placed parts, parts still resting, the table.

    ``waiting``: those steps before it that happen at the same time. ``later``: what comes after it.
    """
    body, poses = site.bodies[moving], member_poses(step, moving, site.assembly)
    past = _Past(site, body, poses)
    # what goes in at the same time rests or waits only until the insertion begins
    brought = _Past(site, body, poses[:-1]) if step.simultaneous else past
    findings = [past.part(name, site.overlaps.poses[name], site.overlaps) for name in step.fixed]
    for other in later:
        way = brought if other.part in step.simultaneous else past
        for name in members(other):
            findings.append(way.part(name, member_poses(other, name, site.assembly)[0], None))
    for other in waiting:
        for name in members(other):
            theirs = member_poses(other, name, site.assembly)
            findings += [brought.part(name, theirs[-2], None), _both_going_in(body, poses, name, theirs, site)]
    if table is not None:
        findings.append(
            check_table(body, HalfSpace(normal=table.normal, offset=table.offset), past.path, config=site.config)
        )
    return findings


def _both_going_in(
    body: SampledBody,
    poses: Float[np.ndarray, "pose 4 4"],
    name: str,
    theirs: Float[np.ndarray, "their_pose 4 4"],
    site: _Site,
) -> PairFinding:
    """What a part meets of another one while both go in: its way seen from the other one, which is straight."""
    T, last = site.overlaps.poses[name], len(poses) - 2
    seen = np.array([T @ se3.inverse(there) @ here for there, here in zip(theirs[-2:], poses[-2:], strict=True)])
    found = _Past(site, body, seen).part(name, T, site.overlaps)
    problem = found.problem and f"as both go in, from pose {last} on, {found.problem}"
    return replace(found, pose=last + found.pose, problem=problem)


class _Past:
    """One part on its path past others."""

    def __init__(self, site: _Site, body: SampledBody, poses: Float[np.ndarray, "pose 4 4"]) -> None:
        self.path = Screws.between(poses)
        self._site, self._body = site, body
        self._key = (body.name, np.ascontiguousarray(poses).tobytes())
        # a ball around the part's box, on its way
        self._low, self._high = self.path.swept_boxes(0.5 * (body.low + body.high), 0.5 * body.size)

    def part(self, name: str, pose: Float[np.ndarray, "4 4"], overlaps: AssembledOverlaps | None) -> PairFinding:
        """Return what the part does to another one in this pose."""
        site, body, other = self._site, self._body, self._site.bodies[name]
        tolerance = pair_tolerance(body, other, site.config)
        low, high = other.box_in(pose)
        if ((self._low > high) | (self._high < low)).any(axis=1).all():
            return PairFinding(against=name, depth=0.0, allowed=tolerance, pose=0.0, problem=None, queries=0)
        key = (*self._key, name, np.ascontiguousarray(pose).tobytes(), overlaps is None)
        if key not in site.findings:
            options = {"overlaps": overlaps, "tolerance": tolerance, "config": site.config}
            site.findings[key] = check_pair(body, other, self.path, pose, **options)
        found, declared = site.findings[key], site.fits.get(frozenset((body.name, name)))
        if found.problem is None or declared is None or overlaps is None or declared <= tolerance:
            return found
        key = (*key, declared)
        if key not in site.findings:
            site.findings[key] = check_by_fit(body, other, self.path, pose, depth=declared, config=site.config)
        return site.findings[key]
