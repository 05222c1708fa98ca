"""The planner stays under what the independent check allows."""

from __future__ import annotations

import pytest

from sashimono.disassembly.cascade import SeparateConfig
from sashimono.disassembly.tolerances import Tolerances
from sashimono.errors import SashimonoError
from sashimono.motion.config import MotionConfig
from sashimono.verify.config import VerifyConfig


def test_no_motion_of_the_planner_may_go_as_deep_as_the_check_allows() -> None:
    planner, check = SeparateConfig().parts.tolerances, VerifyConfig()
    assert planner.plan <= check.relative_tolerance
    assert max(planner.translation, planner.declared) <= 0.75 * check.relative_tolerance
    assert planner.turning <= 0.375 * check.relative_tolerance
    # thin walls: the check allows a share of the wall, the planner the plan's share of so many walls
    assert planner.plan * planner.thin_walls <= check.relative_wall
    assert MotionConfig().penetration_tolerance <= check.relative_tolerance


@pytest.mark.parametrize(
    ("given", "problem"),
    [
        ({"translation": 0.02}, "translation .* less than plan"),
        ({"turning": 0.03}, "turning .* less than plan"),
        ({"declared": 0.02}, "declared .* less than plan"),
        ({"plan": 0.015}, "less than plan"),
        ({"least_step": 0.0}, "least_step must be positive"),
    ],
)
def test_tolerances_that_the_check_would_refuse_are_not_taken(given: dict[str, float], problem: str) -> None:
    with pytest.raises(SashimonoError, match=problem):
        Tolerances(**given)
