"""Proofs for wide thin parts on small ones, and the way out where there is room."""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold
from removal_check import problems
from solids import assembly, box

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.translation.caging import Cages
from sashimono.disassembly.translation.configuration_space import Space, SpaceConfig
from sashimono.disassembly.translation.drawing import KeptSolids
from sashimono.disassembly.translation.lattice_scene import shell
from sashimono.plan import Answer


def riveted_plate() -> Assembly:
    """The rivet's heads let the plate slide along the shank; the clearance is a thousandth of the plate's width."""
    rivet = Manifold.cylinder(0.012, 0.001, 0.001, 12) + Manifold.cylinder(0.002, 0.002, 0.002, 12)
    rivet += Manifold.cylinder(0.002, 0.002, 0.002, 12).translate((0, 0, 0.012))
    hole = Manifold.cylinder(0.1, 0.00104, 0.00104, 12, True)
    return assembly(plate=box((0.04, 0.04, 0.002), (0.01, 0.01, 0.006)) - hole, rivet=rivet)


def test_a_wide_plate_with_play_on_a_small_rivet_is_proven_held() -> None:
    parts = riveted_plate()
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


def trough(length: float) -> Assembly:
    """A rod in a block, with a channel so long [m] that leads out at 13 degrees from upright, between two end walls."""
    rod = Manifold.cylinder(0.03, 0.01, 0.01, 64, True).rotate((90.0, 0.0, 0.0))
    hole = wider = rod.scale((1.005, 1.006, 1.005))
    for angle in np.radians((12.5, 13.0, 13.5)):
        way = length * np.array([np.sin(angle), 0.0, np.cos(angle)])
        hole += Manifold.batch_hull([wider, wider.translate(tuple(way))])
    return assembly(rod=rod, trough=box((0.06, 0.0402, 0.05), (0.0, 0.0, 0.009)) - hole)


def test_a_straight_way_out_that_no_face_points_along_is_found() -> None:
    parts = trough(0.08)
    cascade = Cascade(parts, make_bodies(parts), config=SeparateConfig())
    assert cascade.directions.separate(0, 0b11, max_traced=0).removal is None, "no line leads out"
    said = cascade.translations.separate(0, 0b11, max_traced=0)
    assert said.removal is not None
    assert problems(parts, parts.parts[0], [parts.parts[1]], said.removal) == []


def test_the_same_with_the_way_closed_is_held() -> None:
    parts = trough(0.015)
    cascade = Cascade(parts, make_bodies(parts), config=SeparateConfig())
    assert cascade.translations.separate(0, 0b11, max_traced=0).removal is None


def test_a_proof_put_off_comes_to_the_same_as_one_in_one_go() -> None:
    parts = riveted_plate()
    there = Cascade(parts, make_bodies(parts), config=SeparateConfig()).parts
    assert Cages(there, config=SpaceConfig()).prove(0, 0b10) == (1,)
    attempt = Cages(there, config=SpaceConfig()).attempt(0, 0b10)
    portions = [attempt.go_on(work=1) for _ in range(30)]
    found = next(k for k, proof in enumerate(portions) if proof is not None)
    assert found > 0, "one look was enough: this case does not show that a proof can be put off"
    assert portions[found] == (1,)
    assert portions[found + 1 :] == [None] * (29 - found), "what is proven is not looked at again"


def rings_on_a_post() -> PlacedParts:
    """A post with a foot (part 0) and six rings on it (parts 1 to 6), the lowest first."""
    post = Manifold.cylinder(0.05, 0.005, 0.005, 32) + Manifold.cylinder(0.004, 0.02, 0.02, 32)
    ring = Manifold.cylinder(0.004, 0.012, 0.012, 32) - Manifold.cylinder(0.004, 0.0051, 0.0051, 32)
    rings = {f"ring{k}": ring.translate((0.0, 0.0, 0.004 + 0.004 * k)) for k in range(6)}
    parts = assembly(post=post, **rings)
    return Cascade(parts, make_bodies(parts), config=SeparateConfig()).parts


def some_sets(rng: np.random.Generator, part: int, count: int) -> list[int]:
    return [sum(1 << k for k in range(7) if k != part and rng.random() < 0.6) for _ in range(count)]


def test_what_was_asked_before_changes_no_proof_into_none_nor_back() -> None:
    """Each ring is held by the post and any ring above, in whatever order that is asked."""
    there, part, above = rings_on_a_post(), 3, (4, 5, 6)
    rng = np.random.default_rng(0)
    for _ in range(4):
        cages, sets = Cages(there, config=SpaceConfig()), some_sets(rng, part, 12)
        with cages.across_sets():
            for others in [*sets, *sets]:
                proof = cages.prove(part, others)
                is_held = bool(others & 1) and any(others >> k & 1 for k in above)
                assert (proof is not None) == is_held
                if proof is not None:
                    mask = sum(1 << k for k in proof)
                    assert not mask & ~others
                    assert Cages(there, config=SpaceConfig()).prove(part, mask) is not None


def test_one_set_has_the_same_proof_whatever_was_asked_before() -> None:
    """Also after many sets were asked about, where one proof told of others."""
    there, part = rings_on_a_post(), 3
    rng = np.random.default_rng(1)
    cages = Cages(there, config=SpaceConfig())
    sets = some_sets(rng, part, 10)
    with cages.across_sets():
        told = [cages.prove(part, others) for others in sets]
    fresh = [Cages(there, config=SpaceConfig()).prove(part, others) for others in sets]
    assert told != fresh, "this case does not show that across sets another proof is told"
    assert [cages.prove(part, others) for others in sets] == fresh


def test_a_wall_of_two_obstacles_is_known_by_both() -> None:
    """A block within two tubes, one above the other: asked before about one of them, it has the proof of both."""
    block = box((0.01, 0.01, 0.02))
    hole = box((0.0104, 0.0104, 0.06))
    tubes = [box((0.03, 0.03, 0.0102), (0, 0, z)) - hole for z in (-0.0051, 0.0051)]
    plates = [box((0.03, 0.03, 0.01), (0, 0, z)) for z in (-0.0152, 0.0152)]
    parts = assembly(block=block, low=tubes[0], high=tubes[1], below=plates[0], above=plates[1])
    there = Cascade(parts, make_bodies(parts), config=SeparateConfig()).parts
    everything = 0b11110
    fresh = Cages(there, config=SpaceConfig()).prove(0, everything)
    assert fresh is not None
    for before in (0b11100, 0b11010, 0b00100, 0b00010):
        cages = Cages(there, config=SpaceConfig())
        cages.prove(0, before)
        assert cages.prove(0, everything) == fresh


def test_solids_kept_for_other_windows_are_the_ones_drawn_and_not_too_many() -> None:
    rng = np.random.default_rng(1)
    solids = [np.pad(rng.random((3, 3, 3)) < 0.6, 1) for _ in range(8)]
    kept = KeptSolids(most=3 * solids[0].size)
    drawn = 0

    def draw(k: int) -> np.ndarray:
        nonlocal drawn
        drawn += 1
        return solids[k]

    for k in (0, 1, 2, 0, 1, 2, 3, 4, 5, 0):
        solid, rim = kept.get((k,), lambda k=k: draw(k))
        assert solid is solids[k]
        assert np.array_equal(rim, shell(solids[k]))
    assert drawn == 7, "the first three once, three more, and the first again"
