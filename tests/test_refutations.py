"""A check that refutes: the pipeline goes back to level 1, plans another way, and says so where none is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from solids import box_with_lid, peg_in_plate

from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import Answer, AssemblyPlan, Step
from sashimono.verify import Verifier, VerifyReport

SAID = "a reason made up by this test"


class RefutingCheck:
    """The real check, which also refutes every step that a test picks."""

    def __init__(self, picks: Callable[[Step, int], bool], *, contact_only: bool = False) -> None:
        self._picks = picks
        self._field = "contact_problems" if contact_only else "problems"
        self.plans: list[AssemblyPlan] = []
        """The drafts that it was given, one for each attempt."""

    def __call__(self, plan: AssemblyPlan, report: VerifyReport) -> VerifyReport:
        self.plans.append(plan)
        steps = tuple(
            replace(entry, **{self._field: (SAID,)}) if self._picks(step, len(self.plans)) else entry
            for step, entry in zip(plan.steps, report.steps, strict=True)
        )
        return replace(report, steps=steps)


def way_in(plan: AssemblyPlan, part: str) -> np.ndarray:
    """Return the direction in which a part's last motion goes, rounded."""
    poses = next(step for step in plan.steps if step.part == part).motion.T_world_part[:, :3, 3]
    moves = [step for step in np.diff(poses, axis=0) if np.linalg.norm(step) > 1e-9]
    return np.round(moves[-1] / np.linalg.norm(moves[-1]), 6)


def refuting(monkeypatch: pytest.MonkeyPatch, picks: Callable[[Step, int], bool], **options: bool) -> RefutingCheck:
    check = RefutingCheck(picks, **options)
    real = Verifier.check
    monkeypatch.setattr(Verifier, "check", lambda verifier, plan: check(plan, real(verifier, plan)))
    return check


def test_a_refuted_way_is_not_taken_again_and_another_completes_the_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    check = refuting(monkeypatch, lambda step, attempt: step.part == "lid" and attempt == 1)
    plan = plan_assembly(box_with_lid(), config=PipelineConfig(contacts=False))
    assert len(check.plans) == 2
    assert plan.status == "complete"
    assert plan.unsolved == ()
    assert not np.array_equal(way_in(check.plans[0], "lid"), way_in(check.plans[1], "lid"))
    assert np.array_equal(way_in(plan, "lid"), way_in(check.plans[1], "lid"))


@pytest.mark.parametrize("attempts", [1, 3])
def test_what_is_refuted_every_time_is_tried_so_often_and_then_said(
    monkeypatch: pytest.MonkeyPatch, attempts: int
) -> None:
    check = refuting(monkeypatch, lambda step, attempt: step.part == "lid")
    plan = plan_assembly(box_with_lid(), config=PipelineConfig(contacts=False, max_attempts=attempts))
    assert len(check.plans) == attempts
    ways = {tuple(way_in(draft, "lid")) for draft in check.plans}
    assert len(ways) == attempts, "each attempt takes another way"
    assert plan.status == "partial"
    assert "lid" not in plan.order
    (entry,) = plan.unsolved
    assert entry.part == "lid"
    assert entry.answer is Answer.UNKNOWN
    assert SAID in entry.reason
    assert all("lid" not in step.fixed for step in plan.steps)


def test_attempts_end_where_no_way_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    """A peg in a plate has two ways out: refused both, it is not asked for a third."""
    check = refuting(monkeypatch, lambda step, attempt: len(step.motion.T_world_part) > 1)
    plan = plan_assembly(peg_in_plate(), config=PipelineConfig(contacts=False, max_attempts=50))
    assert len(check.plans) < 50
    assert plan.status == "partial"
    assert [SAID in entry.reason for entry in plan.unsolved] == [True]


def test_a_refuted_grasp_costs_the_grasp_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    check = refuting(monkeypatch, lambda step, attempt: step.contact is not None, contact_only=True)
    plan = plan_assembly(peg_in_plate())
    assert any(step.contact is not None for step in check.plans[0].steps)
    assert all(step.contact is None for step in plan.steps)
    assert any(SAID in (step.contact_reason or "") for step in plan.steps)
    assert sorted(plan.order) == ["peg", "plate"]
