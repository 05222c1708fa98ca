"""Vacuum cups: where they sit, what they carry, and what is in their way."""

import math

import numpy as np
import pytest
from solids import assembly, box, part, rod

from sashimono.bodies import make_body
from sashimono.contact import VACUUM_CUP, real_tool
from sashimono.contact.suction import find_seats
from sashimono.errors import SashimonoError
from sashimono.pipeline import PipelineConfig, plan_assembly


def can(parts, name, **options):
    plan = plan_assembly(parts, config=PipelineConfig(grippers=("vacuum-cup",), **options))
    return next(step.grippers["vacuum-cup"] for step in plan.steps if step.part == name)


def test_a_seat_keeps_the_whole_rim_on_the_face():
    plate = make_body(part("plate", box((0.06, 0.04, 0.004))))
    points, normals = find_seats(plate, VACUUM_CUP)
    assert len(points) > 5
    assert np.abs(normals[:, 2]).min() > 0.999
    tol = VACUUM_CUP.flatness
    assert (np.abs(points[:, 0]) <= 0.03 - VACUUM_CUP.radius + tol).all()
    assert (np.abs(points[:, 1]) <= 0.02 - VACUUM_CUP.radius + tol).all()


def test_the_side_of_a_bar_and_a_narrow_strip_give_no_seat():
    _, normals = find_seats(make_body(part("bar", rod(0.015, 0.1))), VACUUM_CUP)
    assert (np.abs(normals[:, 2]) > 0.999).all()  # its ends are flat
    assert len(find_seats(make_body(part("strip", box((0.1, 0.012, 0.012)))), VACUUM_CUP)[0]) == 0


def test_what_it_holds_by_hand():
    force = VACUUM_CUP.vacuum * math.pi * VACUUM_CUP.radius**2
    # on the axis friction decides: weight 2 of safety, over 0.5 of friction
    assert VACUUM_CUP.holds(force / 4.0 * 0.999, 0.0)
    assert not VACUUM_CUP.holds(force / 4.0 * 1.001, 0.0)
    # three radii aside: four times the moment at the rim
    assert VACUUM_CUP.holds(force / 8.0 * 0.999, 3.0 * VACUUM_CUP.radius)
    assert not VACUUM_CUP.holds(force / 8.0 * 1.001, 3.0 * VACUUM_CUP.radius)


def test_a_lid_is_taken_from_above_and_a_peg_is_not():
    tray = box((0.1, 0.1, 0.03))
    parts = assembly(tray=tray, lid=box((0.06, 0.06, 0.004), (0.0, 0.0, 0.017)))
    assert can(parts, "lid") is None
    parts = assembly(tray=tray, peg=box((0.01, 0.01, 0.03), (0.0, 0.0, 0.03)))
    assert "no face is flat" in can(parts, "peg")


def test_a_block_of_a_kilogram_is_too_heavy():
    parts = assembly(floor=box((0.3, 0.3, 0.05)), block=box((0.12, 0.1, 0.1), (0.0, 0.0, 0.075)))
    assert can(parts, "block").startswith("too heavy")


def test_only_real_tools_are_reported():
    with pytest.raises(SashimonoError, match="no real tool"):
        real_tool("auto")
    with pytest.raises(SashimonoError, match="vacuum-cup"):
        real_tool("tongs")
