"""What the independent check found."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class StepReport:
    """What was found in one step."""

    index: int
    """Position in the plan, from 0."""
    part: str
    problems: tuple[str, ...] = ()
    """Plain-language reasons to refuse the step's motion; none if it holds."""
    contact_problems: tuple[str, ...] = ()
    """Reasons to refuse its contact."""
    hold_problems: tuple[str, ...] = ()
    """What falls or tips though nobody holds it, hands that were miscounted, and tools without the room that they are
    said to have. The motion holds all the same."""
    notes: tuple[str, ...] = ()
    """What could not be checked or is worth knowing, though no reason to refuse."""
    max_penetration: float = 0.0
    """Deepest penetration measured along the path [m], of the pair that came nearest to what it is allowed."""
    allowed: float | None = None
    """What that pair is allowed [m]: the tolerance, and its depth in the assembled pose where that was needed."""
    against: str | None = None
    """The part, or "table", that it was measured against."""
    pose: float | None = None
    """Where on the path: pose index, fractions between two poses."""
    queries: int = 0
    """Distance queries that the step took."""
    fits: tuple[tuple[tuple[str, str], float], ...] = ()
    """Pairs that go deeper into each other than they may without the fit that the plan declares of them, and how deep
    [m]; a declared depth that they exceed as well is among the problems."""
    inside: tuple[StepReport, ...] = ()
    """What was found in the steps by which a subassembly was put together."""

    @property
    def ok(self) -> bool:
        """Whether nothing was found wrong, inside a subassembly either."""
        return not self.problems and not self.contact_problems and all(step.ok for step in self.inside)

    def all_steps(self) -> list[StepReport]:
        """Return this step and those inside it."""
        return [self, *(deeper for step in self.inside for deeper in step.all_steps())]

    def lines(self) -> list[str]:
        """Return one readable line for the step, and one indented for each inside it."""
        return [self.line(), *(f"    {line}" for step in self.inside for line in step.lines())]

    def line(self) -> str:
        """Return one readable line."""
        return "; ".join([self._motion_line(), *(f"not executable: {problem}" for problem in self.hold_problems)])

    def _motion_line(self) -> str:
        wrong = self.problems + self.contact_problems
        head = f"{'BAD' if wrong else 'ok '} {self.index + 1:3d} {self.part}"
        if wrong:
            return f"{head}: {'; '.join(wrong)}"
        if self.against is None:
            return f"{head}: touches nothing on its way"
        depth, allowed = self.max_penetration * 1e3, (self.allowed or 0.0) * 1e3
        said = f"{head}: deepest {depth:.4f} mm into {self.against} (allowed {allowed:.4f} mm)"
        given = (f"{names[1]} {1e3 * deep:.4f} mm" for names, deep in self.fits)
        return said + (f"; a declared fit with {', '.join(given)}" if self.fits else "")


@dataclass(frozen=True, kw_only=True)
class VerifyReport:
    """What was found in a whole plan."""

    problems: tuple[str, ...]
    """Reasons to refuse the plan that belong to no single step."""
    steps: tuple[StepReport, ...]
    notes: tuple[str, ...] = ()
    complete: bool = True
    """Whether the plan claims to place every part."""
    fits: int = 0
    """How many fits it declares: pairs that may go deeper into each other than any other."""
    executable: bool | None = None
    """Whether it can be carried out: complete, nothing wrong, a contact at every moving step, nothing falls unheld, and
    no step takes more hands than there are. None where the plan does not say what is held."""

    @property
    def ok(self) -> bool:
        """Whether nothing was found wrong, in the plan or in any step."""
        return not self.problems and all(step.ok for step in self.steps)

    def lines(self) -> list[str]:
        """Return one readable line a step, after one for each problem of the whole plan, and a verdict."""
        steps = [deeper for step in self.steps for deeper in step.all_steps()]
        bad = sum(bool(step.problems or step.contact_problems) for step in steps)
        if self.ok:
            verdict = f"verified: {len(steps)} steps hold"
            verdict += "" if self.complete else "; the plan is partial: not every part has a step"
            verdict += f"; {self.fits} fit{'s' if self.fits != 1 else ''} declared" if self.fits else ""
            verdict += "" if self.executable is None else "; executable" if self.executable else "; not executable"
        else:
            verdict = f"refuted: {bad} of {len(steps)} steps do not hold, {len(self.problems)} problems of the plan"
        return [
            *(f"BAD plan: {problem}" for problem in self.problems),
            *(f"note: {note}" for note in self.notes),
            *(line for step in self.steps for line in step.lines()),
            verdict,
        ]
