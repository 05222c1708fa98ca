"""Threads: read off one surface, followed where ridges have clearance, overlap, or end; nothing seen where none is."""

from itertools import pairwise

import manifold3d
import numpy as np
import pytest
from solids import LEAD, bolt, part, peg_in_plate, rod, screwed

from sashimono.bodies import make_bodies
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.threads.surface import Threads, UnscrewConfig, search_unscrew
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import Screw, between
from sashimono.geometry.features.helix import HelixConfig, fit_helix

Z = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("lead", [LEAD, -LEAD])
def test_axis_and_pitch_are_read_off_one_surface_in_any_pose(lead: float) -> None:
    T = se3.exp(np.array([0.1, -0.2, 0.3, 0.4, 0.9, -0.3]))
    mesh = part("bolt", bolt(0.01, 0.003, 0.03, lead=lead))
    triangles = se3.apply(T, mesh.vertices_part)[mesh.faces]
    helix = fit_helix(triangles, T[:3, :3] @ Z, config=HelixConfig())
    assert helix is not None
    assert 2.0 * np.pi * helix.pitch == pytest.approx(lead, rel=0.02)
    np.testing.assert_allclose(np.cross(helix.point - T[:3, 3], T[:3, :3] @ Z), 0.0, atol=5e-5)
    for sign in (1.0, -1.0):
        screw = Screw.of(helix.twist(sign))
        assert np.sign(screw.shift @ helix.axis) == sign
        assert screw.pitch == pytest.approx(helix.pitch)


def test_what_a_turn_carries_along_itself_is_no_thread() -> None:
    cone = manifold3d.Manifold.cylinder(0.05, 0.01, 0.02, 64)
    for solid in (rod(0.01, 0.05), cone, manifold3d.Manifold.sphere(0.02, 48)):
        mesh = part("round", solid)
        assert fit_helix(mesh.vertices_part[mesh.faces], Z, config=HelixConfig()) is None
    there = PlacedParts(peg_in_plate(), make_bodies(peg_in_plate()), config=PlacedPartsConfig())
    assert not Threads(there, config=UnscrewConfig()).between(0, 1)


@pytest.mark.parametrize(("clearance", "phase"), [(0.0008, 0.0), (0.0008, 40.0)])
def test_a_bolt_leaves_by_its_own_screw_whatever_the_phase_it_is_drawn_in(clearance: float, phase: float) -> None:
    parts = screwed(clearance, phase=phase)
    there = PlacedParts(parts, make_bodies(parts), config=PlacedPartsConfig())
    index = parts.index("bolt")
    others = bits(there.all_parts & ~(1 << index))
    threads = Threads(there, config=UnscrewConfig())
    removal = search_unscrew(threads, index, others, max_traced=40_000_000).removal
    assert removal is not None
    paths = Paths(there, index, [1 - index], tolerance=0.015)
    assert paths.check(removal.displacements)
    assert paths.parts_once(removal.displacements)
    turned = sum(Screw.of(between(a, b)).angle for a, b in pairwise(removal.displacements))
    assert turned > np.pi


def test_an_overlap_excuses_no_second_meeting_on_a_path() -> None:
    """Two ridges drawn into each other part between two turns of the other thread: straight on is through the next."""
    parts = screwed(0.0005, phase=180.0)
    there = PlacedParts(parts, make_bodies(parts), config=PlacedPartsConfig())
    index = parts.index("bolt")
    paths = Paths(there, index, [1 - index], tolerance=0.015)
    straight = np.array([np.eye(4), se3.make(None, 0.03 * Z)])
    assert there.overlaps[0, 1] > 0.0
    assert paths.check(straight)
    assert not paths.parts_once(straight)
