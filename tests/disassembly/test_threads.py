"""Threads: read off one surface, followed where ridges have clearance, overlap, or end; nothing seen where none is."""

from itertools import pairwise

import manifold3d
import numpy as np
import nuts
import pytest
from removal_check import problems
from solids import LEAD, bolt, box, part, peg_in_plate, rod, screwed

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import Paths
from sashimono.disassembly.placed_parts import PlacedParts, PlacedPartsConfig
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.threads.surface import Threads, UnscrewConfig, search_unscrew
from sashimono.geometry import se3
from sashimono.geometry.distance.screw import Screw, advance_along_screw, between, shared_stops
from sashimono.geometry.distance.signed_distance import SignedDistance
from sashimono.geometry.features.helix import HelixConfig, fit_helix
from sashimono.plan import Answer

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


KINDS = {
    "iso": {},
    "square": {"square": True},
    "tapered": {"taper": 1.0 / 32.0},
    "two starts": {"starts": 2},
    "three starts": {"starts": 3},
}


def threaded(name: str, solid: manifold3d.Manifold) -> Part:
    """A part drawn in millimetres."""
    return part(name, solid.scale((1e-3, 1e-3, 1e-3)))


@pytest.mark.parametrize("hand", [1, -1])
@pytest.mark.parametrize("kind", list(KINDS))
def test_every_kind_of_thread_is_read_to_a_thousandth(kind: str, hand: int) -> None:
    T = se3.exp(np.array([0.1, -0.2, 0.3, 0.4, 0.9, -0.3]))
    mesh = threaded("bolt", nuts.thread(10.0, 1.5, hand, 18, 20.0, 0.0, **KINDS[kind]))
    helix = fit_helix(se3.apply(T, mesh.vertices_part)[mesh.faces], T[:3, :3] @ Z, config=HelixConfig())
    assert helix is not None
    starts = KINDS[kind].get("starts", 1)
    assert helix.starts == starts
    assert 2.0 * np.pi * helix.pitch == pytest.approx(1.5e-3 * starts * hand, rel=1e-3)
    np.testing.assert_allclose(np.cross(helix.point - T[:3, 3], T[:3, :3] @ Z), 0.0, atol=2e-5)


@pytest.mark.parametrize("kind", ["iso", "square", "two starts"])
def test_phases_tell_how_far_a_nut_is_from_where_it_fits(kind: str) -> None:
    """The nut is drawn a quarter turn on from where it fits: a shift of so much of the lead takes it there."""
    starts = KINDS[kind].get("starts", 1)
    shaft = nuts.thread(10.0, 1.5, 1, 32, 20.0, 0.0, **KINDS[kind])
    hole = nuts.thread(10.0, 1.5, 1, 32, 12.0, 0.2, **KINDS[kind], gap=0.1)
    nut = nuts.hexagon(17.0, 9.0) - hole.translate((0.0, 0.0, -1.5)).rotate((0.0, 0.0, -360.0 / starts + 90.0))
    parts = Assembly(parts=(threaded("bolt", shaft), threaded("nut", nut)))
    there = PlacedParts(parts, make_bodies(parts), config=PlacedPartsConfig())
    thread = Threads(there, config=UnscrewConfig()).between(1, 0)
    assert thread is not None
    assert thread.spacing == pytest.approx(1.5e-3, rel=1e-3)
    assert thread.offset == pytest.approx(0.25 * 1.5e-3 * starts % 1.5e-3, abs=2e-5)


def captive() -> Assembly:
    """A nut on a bolt between two collars: its thread lets it turn, and ends before either."""
    shaft = nuts.thread(10.0, 1.5, 1, 32, 40.0, 0.0)
    for z in (-4.0, 40.0):
        shaft += manifold3d.Manifold.cylinder(4.0, 5.0, 5.0, 32).translate((0.0, 0.0, z))
    hole = nuts.thread(10.0, 1.5, 1, 32, 12.0, 0.15)
    nut = nuts.hexagon(17.0, 9.0) - hole.translate((0.0, 0.0, -1.5)).rotate((0.0, 0.0, -360.0))
    return Assembly(parts=(threaded("bolt", shaft), threaded("nut", nut.translate((0.0, 0.0, 15.0)))))


def test_a_part_that_its_thread_holds_is_said_to_be_and_asked_nothing_more() -> None:
    parts = captive()
    cascade = Cascade(parts, make_bodies(parts), config=SeparateConfig())
    said = cascade.inquire().separate(1, 0b11)
    assert said.answer is Answer.PROVEN_BLOCKED, "for translations"
    assert said.is_held
    assert "its thread in bolt (a turn is 1.5 mm) stops it after" in said.reason
    assert "physics" not in said.reason
    found = search_unscrew(Threads(cascade.parts, config=UnscrewConfig()), 1, [0], max_traced=40_000_000)
    # 15 mm are below it, and 16 mm above
    assert sorted(way.turns for way in found.stopped) == pytest.approx([10.0, 10.7], abs=0.6)


def relieved(quarters: int) -> Assembly:
    """A screw with a head and a waist, in a sleeve whose thread is about the waist, so that its end enters that later.

    The end is threaded as well, so many quarter turns out of step with the rest.
    """
    waist = manifold3d.Manifold.cylinder(32.0, 4.1, 4.1, 32).translate((0.0, 0.0, -7.0))
    end = nuts.thread(10.0, 1.5, 1, 32, 5.0, 0.0).rotate((0.0, 0.0, 90.0 * quarters)).translate((0.0, 0.0, -9.0))
    rest = nuts.thread(10.0, 1.5, 1, 32, 15.0, 0.0).translate((0.0, 0.0, 18.0))
    head = manifold3d.Manifold.cylinder(4.0, 9.0, 9.0, 32).translate((0.0, 0.0, 33.0))
    hole = nuts.thread(10.0, 1.5, 1, 32, 12.0, 0.15)
    nut = nuts.hexagon(17.0, 9.0) - hole.translate((0.0, 0.0, -1.5)).rotate((0.0, 0.0, -360.0))
    sleeve = manifold3d.Manifold.cylinder(18.0, 8.0, 8.0, 32) - manifold3d.Manifold.cylinder(18.0, 5.6, 5.6, 32)
    nut = nut.translate((0.0, 0.0, 3.0)) + sleeve.translate((0.0, 0.0, 12.0))
    return Assembly(parts=(threaded("screw", waist + end + rest + head), threaded("nut", nut)))


@pytest.mark.parametrize("quarters", [1, 2])
def test_a_stretch_of_thread_that_enters_later_has_a_phase_of_its_own(quarters: int) -> None:
    parts = relieved(quarters)
    there = PlacedParts(parts, make_bodies(parts), config=PlacedPartsConfig())
    found = search_unscrew(Threads(there, config=UnscrewConfig()), 0, [1], max_traced=40_000_000)
    assert found.removal is not None
    assert found.removal.exit_direction @ Z > 0.99, "the head does not pass the nut"
    turned = sum(Screw.of(between(a, b)).angle for a, b in pairwise(found.removal.displacements))
    assert turned > 2.0 * np.pi
    assert problems(parts, parts.parts[0], [parts.parts[1]], found.removal) == []


def test_ridges_drawn_into_each_other_are_turned_out_not_pulled_through() -> None:
    """The overlap is shallow beside the nut, and would excuse a pull as that of a press fit."""
    shaft = nuts.thread(16.0, 1.5, 1, 20, 30.0, 0.0, starts=3)
    hole = nuts.thread(16.0, 1.5, 1, 20, 17.0, 0.0, starts=3)
    nut = nuts.hexagon(27.0, 14.0) - hole.translate((0.0, 0.0, -1.5)).rotate((0.0, 0.0, -120.0 + 187.0))
    parts = Assembly(parts=(threaded("bolt", shaft), threaded("nut", nut.translate((0.0, 0.0, 4.5)))))
    cascade = Cascade(parts, make_bodies(parts), config=SeparateConfig())
    found = find_disassembly(cascade, config=SequenceConfig())
    assert not found.stuck
    removal = found.removals[0].separation.removal
    assert removal is not None
    assert sum(Screw.of(between(a, b)).angle for a, b in pairwise(removal.displacements)) > 2.0 * np.pi


def test_points_on_one_helix_are_followed_once_and_stop_where_they_did() -> None:
    mesh = threaded("bolt", nuts.thread(10.0, 1.5, 1, 24, 20.0, 0.0))
    lead, turns = 1.5e-3, 5.0
    twist = 2.0 * np.pi * turns * np.array([0.0, 0.0, lead / 2.0 / np.pi, 0.0, 0.0, 1.0])
    stops = shared_stops(mesh.vertices_part, twist, np.full(len(mesh.vertices_part), 1e-6))
    assert stops is not None
    assert stops.sum() < 0.2 * len(stops)
    # a wall that the bolt runs into after a while
    wall = part("wall", box((0.03, 0.03, 0.002), (0.0, 0.0, 0.0243)))
    field = SignedDistance(wall.vertices_part, wall.faces)
    options = {"limit": 1e-5, "least_step": 1e-5}
    alone, work = advance_along_screw(field, mesh.vertices_part, twist, **options)
    shared, less = advance_along_screw(field, mesh.vertices_part, twist, **options, stops=stops)
    assert alone == pytest.approx((0.0033 + 1e-5) / (turns * lead), rel=2e-2)
    assert shared == pytest.approx(alone, abs=1e-4)
    assert less <= work
