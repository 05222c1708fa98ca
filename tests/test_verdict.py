"""Depth of overlaps as the planner and the check measure it, and what is said of parts that stay."""

from __future__ import annotations

import numpy as np
import pytest
from solids import assembly, box, part, rod

from sashimono.bodies import make_bodies, make_body
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.physics.search import PhysicsConfig
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.sequence.reasons import VerdictConfig, least_interference
from sashimono.geometry.overlap import intersection_depth
from sashimono.verify import VerifyConfig
from sashimono.verify.body import SampledBody as CheckedBody
from sashimono.verify.overlap import intersection


def test_plates_crossing_in_one_plane_are_half_a_plate_deep_in_each_other() -> None:
    first, second = (part(name, box(size)) for name, size in (("a", (80.0, 30.0, 9.0)), ("b", (30.0, 80.0, 9.0))))
    planned = intersection_depth(make_body(first), make_body(second), np.eye(4))
    bodies = [CheckedBody(p.name, p.vertices_part, p.faces, samples=VerifyConfig().samples) for p in (first, second)]
    checked = intersection(*bodies, np.eye(4)).depth
    half = 0.5 * np.ptp(first.vertices_part[:, 2])
    assert planned == pytest.approx(half, rel=0.01)
    assert checked == pytest.approx(half, rel=0.01)


def test_a_snap_fit_says_how_deep_the_part_would_go() -> None:
    # a bead of radius 5.5 mm behind a neck of radius 5 mm
    ring = rod(10e-3, 20e-3) - rod(6e-3, 14e-3) - rod(5e-3, 40e-3)
    given = assembly(ring=ring, bead=rod(5.5e-3, 4e-3))
    cascade = Cascade(given, make_bodies(given), config=SeparateConfig(physics=PhysicsConfig(max_pushes=0)))
    interference = least_interference(cascade.parts, 1, [0], config=VerdictConfig())
    assert interference is not None
    assert interference.depth == pytest.approx(0.5e-3, rel=0.03)
    assert abs(interference.direction[2]) == pytest.approx(1.0)
    found = find_disassembly(cascade, config=SequenceConfig())
    ((part, separation),) = found.stuck
    assert f"straight out, {given.names[part]} goes at least 0.5" in separation.reason
