"""Steps that happen at the same time: what a plan may say of them, and how deep two that go in at once may be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from test_verify import MM, at, box, part, plan, refuted, step

from sashimono.assembly import Assembly
from sashimono.plan import AssemblyPlan, Contact, Motion, Segment, Step
from sashimono.verify import verify_plan
from sashimono.verify.body import SampledBody
from sashimono.verify.config import VerifyConfig
from sashimono.verify.pairs import pair_tolerance


def blocks() -> Assembly:
    """A plate on the table, and on it two blocks that meet in the plane x = 0."""
    return Assembly(
        parts=(
            part("plate", box((200.0, 200.0, 10.0), (0.0, 0.0, 5.0))),
            part("left", box((20.0, 30.0, 20.0), (-10.0, 0.0, 20.0))),
            part("right", box((20.0, 30.0, 20.0), (10.0, 0.0, 20.0))),
        ),
    )


def brought(name: str, other: str, rest: np.ndarray, begin: np.ndarray) -> Step:
    """From where it rests, up, above where its insertion begins, down to there, and in."""
    over = begin.copy()
    over[2, 3] += 60.0 * MM
    up = rest.copy()
    up[2, 3] = over[2, 3]
    poses = [rest, up, over, begin, np.eye(4)]
    made = step(name, ("plate",), poses, simultaneous=(other,))
    segments = (Segment(kind="transit", start=0, stop=3), Segment(kind="insertion", start=3, stop=4))
    return replace(made, motion=replace(made.motion, segments=segments))


def both(left: tuple[float, float, float], right: tuple[float, float, float]) -> AssemblyPlan:
    """A plan in which both blocks go in at once, from these displacements [mm]."""
    return plan(
        blocks(),
        step("plate", (), [np.eye(4)]),
        brought("left", "right", at(-200.0, 0.0, -10.0), at(*left)),
        brought("right", "left", at(200.0, 0.0, -10.0), at(*right)),
    )


def changed(base: AssemblyPlan, k: int, change: Callable[[Step], Step]) -> AssemblyPlan:
    return replace(base, steps=tuple(change(each) if j == k else each for j, each in enumerate(base.steps)))


def with_motion(motion: Motion, **fields: object) -> Callable[[Step], Step]:
    return lambda each: replace(each, motion=replace(motion, **fields))


SOUND = both((-40.0, 0.0, 0.0), (-40.0, 50.0, 0.0))
"""The one slides along the other: relative to each other they go along y."""


def test_two_that_slide_along_each_other_pass() -> None:
    report = verify_plan(SOUND, blocks())
    assert report.ok, "\n".join(report.lines())


def test_one_after_the_other_the_same_ways_do_not_hold() -> None:
    alone = [replace(each, simultaneous=()) for each in SOUND.steps]
    alone[2] = replace(alone[2], fixed=("plate", "left"))
    refuted(verify_plan(replace(SOUND, steps=tuple(alone)), blocks()), "right", "deep into left")


@pytest.mark.parametrize("share", [0.9, 1.05])
@pytest.mark.parametrize("side", ["left", "right"])
def test_how_deep_they_may_be_in_each_other_on_the_way(share: float, side: str) -> None:
    """Half way in, seen along x, the one has come too near by a share of what is tolerated."""
    parts = blocks()
    bodies = [SampledBody(p.name, p.vertices_part, p.faces, samples=VerifyConfig().samples) for p in parts.parts[1:]]
    tolerance = pair_tolerance(bodies[0], bodies[1], VerifyConfig()) / MM
    # they overlap along y from 30 mm apart on, when 3/5 of the way is left
    off = share * tolerance * 5.0 / 3.0
    left = (-40.0 + off * (side == "left"), 0.0, 0.0)
    right = (-40.0 - off * (side == "right"), 50.0, 0.0)
    report = verify_plan(both(left, right), parts)
    assert report.ok == (share < 1.0), "\n".join(report.lines())


def test_what_is_clear_at_both_ends_only_is_found_in_between() -> None:
    refuted(verify_plan(both((-40.0, 0.0, 0.0), (-60.0, 31.0, 0.0)), blocks()), "as both go in", "deep into left")


def test_what_waits_is_in_the_way_of_what_comes_after_it() -> None:
    """The right block is brought through where the left one waits."""
    through = SOUND.steps[2].motion.T_world_part.copy()
    through[2] = at(-55.0, 10.0, 0.0)
    wrong = changed(SOUND, 2, with_motion(SOUND.steps[2].motion, T_world_part=through))
    refuted(verify_plan(wrong, blocks()), "right", "deep into left")


def test_what_rests_is_in_the_way_of_what_comes_before_it() -> None:
    through = SOUND.steps[1].motion.T_world_part.copy()
    through[2] = at(220.0, 0.0, -5.0)
    wrong = changed(SOUND, 1, with_motion(SOUND.steps[1].motion, T_world_part=through))
    assert any("deep into right" in problem for problem in verify_plan(wrong, blocks()).steps[1].problems)


def test_the_plate_is_in_the_way_as_ever() -> None:
    refuted(verify_plan(both((-40.0, 0.0, -1.0), (-40.0, 50.0, 0.0)), blocks()), "deep into plate")


def third(fixed: tuple[str, ...]) -> Step:
    return step("third", fixed, [at(0.0, 150.0, 0.0), np.eye(4)])


def test_the_form_of_such_steps() -> None:
    parts, second = blocks(), SOUND.steps[2]
    half = second.motion.T_world_part
    middle = half[-2].copy()
    middle[:3, 3] *= 0.5
    turned = half.copy()
    turned[-2, :3, :3] = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    times = np.arange(5.0)
    timed = changed(SOUND, 1, with_motion(SOUND.steps[1].motion, times=times))
    unequal = changed(timed, 2, with_motion(second.motion, times=np.array([0.0, 1.0, 2.0, 3.0, 5.0])))
    segments = (*second.motion.segments[:1], Segment(kind="insertion", start=3, stop=5))
    two_stretches = with_motion(second.motion, T_world_part=np.array([*half[:-1], middle, half[-1]]), segments=segments)
    grasp = Contact(kind="push", points_part=np.zeros((1, 3)), normals_part=np.eye(3)[:1], friction=0.5, quality=1.0)
    cases = [
        (changed(SOUND, 2, lambda each: replace(each, simultaneous=())), "do not agree"),
        (changed(SOUND, 2, lambda each: replace(each, simultaneous=("left", "plate"))), "do not agree"),
        (changed(SOUND, 2, lambda each: replace(each, simultaneous=("nobody",))), "which is no other step"),
        (changed(SOUND, 2, lambda each: replace(each, simultaneous=("right",))), "which is no other step"),
        (changed(SOUND, 2, lambda each: replace(each, fixed=("plate", "left"))), "fixed is"),
        (changed(SOUND, 2, two_stretches), "an insertion of one stretch"),
        (changed(SOUND, 2, with_motion(second.motion, T_world_part=turned)), "must not turn"),
        (unequal, "takes another time"),
        (timed, "only one of them has times"),
        (changed(SOUND, 2, lambda each: replace(each, contact=grasp)), "none can be checked"),
    ]
    for wrong, words in cases:
        refuted(verify_plan(wrong, parts), words)


def test_what_is_malformed_is_a_finding_and_no_crash() -> None:
    one_pose = Motion(
        T_world_part=np.eye(4)[None],
        segments=(Segment(kind="transit", start=0, stop=0), Segment(kind="insertion", start=0, stop=1)),
    )
    report = verify_plan(changed(SOUND, 2, with_motion(one_pose)), blocks())
    refuted(report, "a single pose", "'right', of which the form is wrong")


@pytest.mark.parametrize("seconds", [(1e-7, 4e-7), (0.0, 0.0), (2.0, 2.00001)])
def test_insertions_that_go_at_once_take_as_long_however_short(seconds: tuple[float, float]) -> None:
    plan_so = SOUND
    for k, last in zip((1, 2), seconds, strict=True):
        motion = SOUND.steps[k].motion
        plan_so = changed(plan_so, k, with_motion(motion, times=np.array([0.0, 1.0, 2.0, 3.0, 3.0 + last])))
    refuted(verify_plan(plan_so, blocks()), "takes another time, or none")


def test_a_step_between_them_is_refused() -> None:
    parts = Assembly(parts=(*blocks().parts, part("third", box((10.0, 10.0, 10.0), (0.0, 60.0, 15.0)))))
    steps = [*SOUND.steps[:2], third(("plate", "left")), SOUND.steps[2]]
    wrong = plan(parts, *steps)
    refuted(verify_plan(wrong, parts), "do not follow one another")


def test_hands_count_all_of_them() -> None:
    held = replace(SOUND, steps=tuple(replace(each, hands=k and 2) for k, each in enumerate(SOUND.steps)))
    report = verify_plan(held, blocks())
    assert not any(each.hold_problems for each in report.steps), "\n".join(report.lines())
    one = changed(held, 2, lambda each: replace(each, hands=1))
    assert "takes 2 hands, not 1" in "\n".join(verify_plan(one, blocks()).lines())
