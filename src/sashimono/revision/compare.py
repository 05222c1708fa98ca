"""The comparison: one call from two sides to what changed."""

from __future__ import annotations

from dataclasses import dataclass, replace

from sashimono.assembly import Assembly, html_table
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.plan import Answer, AssemblyPlan
from sashimono.revision.carry_over import NotCarriedOver, carry_over
from sashimono.revision.parts import PartChange, match_parts
from sashimono.revision.sources import Side
from sashimono.revision.steps import StepChange, changed_pairs, changed_steps
from sashimono.verify import VerifyConfig, VerifyReport, verify_plan


@dataclass(frozen=True, kw_only=True, eq=False)
class Revision:
    """What is different between two sides."""

    old: Side
    new: Side
    parts: tuple[PartChange, ...]
    """One for each part of either."""
    earlier: tuple[tuple[str, str], ...] = ()
    """Two plans: pairs of parts of which the first is placed earlier now, and was placed later."""
    steps: tuple[StepChange, ...] = ()
    """Two plans: steps that do something differently."""
    status: tuple[str, str] | None = None
    """Two plans: their status, if it changed."""
    holds: bool | None = None
    """Whether the old plan still works for the new geometry; None where that cannot be told."""
    order_works: bool | None = None
    """Whether, where it does not work, its order does with other motions; None where that was not found out."""
    reasons: tuple[str, ...] = ()
    """Why it does not work, or why that cannot be told."""

    def __repr__(self) -> str:
        changed = sum(bool(change.kinds) for change in self.parts)
        plan = {True: "the old plan works", False: "the old plan does not work", None: "no word on the old plan"}
        return f"Revision({changed} of {len(self.parts)} parts changed, {plan[self.holds]})"

    def _repr_html_(self) -> str:
        rows = [
            (" and ".join(change.kinds), change.old or "", change.new or "") for change in self.parts if change.kinds
        ]
        rows += [("reason", "", reason) for reason in self.reasons]
        return html_table(repr(self), ("change", "old", "new"), rows)

    @property
    def same(self) -> bool:
        """Whether nothing is different."""
        changed = any(change.kinds for change in self.parts)
        return not (changed or self.earlier or self.steps or self.status)


def compare(old: Side, new: Side, *, config: VerifyConfig | None = None) -> Revision:
    """Return what changed between two sides, and whether the old plan, if there is one, still works.

    The old plan is put onto the new geometry, with its order and motions, and checked by the independent verifier.

    Args:
        old: Before: a plan or a product.
        new: After: a plan or a product.
        config: Of the check.
    """
    parts = match_parts(old, new)
    found = Revision(old=old, new=new, parts=parts)
    names = {change.old: change.new for change in parts if change.old is not None and change.new is not None}
    if old.plan is not None and new.plan is not None:
        found = replace(
            found,
            earlier=changed_pairs(old.plan, new.plan, names),
            steps=changed_steps(old.plan, new.plan, names),
            status=None if old.plan.status == new.plan.status else (old.plan.status, new.plan.status),
        )
    return _with_verdict(found, config)


def _with_verdict(found: Revision, config: VerifyConfig | None) -> Revision:
    """Add whether the old plan works for the new geometry, and why not."""
    old, new, parts = found.old, found.new, found.parts
    if old.plan is None:
        return replace(found, reasons=("there is no old plan to check: give one as OLD",))
    if new.assembly is None:
        return replace(found, reasons=(f"{new.path}: {new.note}",))
    added = tuple(f"{change.new} is new: the old plan has no step for it" for change in parts if change.old is None)
    try:
        plan = carry_over(old.plan, new.assembly, parts)
    except NotCarriedOver as error:
        return replace(found, holds=False, reasons=(*added, f"the old plan cannot be carried over: {error}"))
    if added:
        return replace(found, holds=False, reasons=added)
    report = verify_plan(plan, new.assembly, config=config)
    if report.ok and report.complete:
        return replace(found, holds=True)
    partial = () if report.complete else ("the old plan is partial",)
    return replace(
        found,
        holds=False,
        order_works=None if partial or report.problems else _order_works(plan, report, new.assembly),
        reasons=(*partial, *_problems(report)),
    )


def _order_works(plan: AssemblyPlan, report: VerifyReport, assembly: Assembly) -> bool | None:
    """Whether each part whose step was refuted can be brought in its turn by some other motion."""
    cascade = Cascade(assembly, make_bodies(assembly), config=SeparateConfig())
    works: bool | None = True
    for step, said in zip(plan.steps, report.steps, strict=True):
        if said.ok:
            continue
        if step.moving or step.simultaneous:
            return None
        remaining = sum(1 << assembly.index(name) for name in (step.part, *step.fixed))
        answer = cascade.separate(assembly.index(step.part), remaining).answer
        if answer is Answer.PROVEN_BLOCKED:
            return False
        works = works if answer is Answer.FREE else None
    return works


def _problems(report: VerifyReport) -> list[str]:
    """What the check refused, a line a step."""
    lines = list(report.problems)
    for step in report.steps:
        for each in step.all_steps():
            wrong = (*each.problems, *each.contact_problems)
            lines += [f"step {each.index + 1}, {each.part}: {'; '.join(wrong)}"] if wrong else []
    return lines
