"""Proofs for wide thin parts on small ones, and the way out where there is room."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold
from solids import assembly, box

from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.translation.configuration_space import Space, SpaceConfig
from sashimono.plan import Answer


def test_a_wide_plate_with_play_on_a_small_rivet_is_proven_held() -> None:
    """Its heads let it slide along the shank; the clearance is a thousandth of the plate's width."""
    rivet = Manifold.cylinder(0.012, 0.001, 0.001, 12) + Manifold.cylinder(0.002, 0.002, 0.002, 12)
    rivet += Manifold.cylinder(0.002, 0.002, 0.002, 12).translate((0, 0, 0.012))
    hole = Manifold.cylinder(0.1, 0.00104, 0.00104, 12, True)
    parts = assembly(plate=box((0.04, 0.04, 0.002), (0.01, 0.01, 0.006)) - hole, rivet=rivet)
    said = Cascade(parts, make_bodies(parts), config=SeparateConfig()).separate(0, 0b11)
    assert said.answer is Answer.PROVEN_BLOCKED


def test_room_leads_out_and_a_touching_part_has_none() -> None:
    """Between a floor and a ceiling: sideways, once it is off the floor."""
    plates = box((0.05, 0.05, 0.01), (0, 0, -0.01)) + box((0.05, 0.05, 0.01), (0, 0, 0.03))
    parts = assembly(block=box((0.01, 0.01, 0.01)), plates=plates)
    there = Cascade(parts, make_bodies(parts), config=SeparateConfig()).parts
    room = Space(there, 0, 5.0, config=SpaceConfig(), grown=True)
    assert not room.way(0b10, np.zeros(3), set())
    way = np.array(room.way(0b10, np.array([0.0, 0.0, 0.009]), set()))
    assert len(way) >= 2
    assert abs(way[-1, :2]).max() > 0.025
    assert (way[:, 2] > 0.0).all()
