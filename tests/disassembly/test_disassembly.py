"""Level 1: known answers, monotony, invariance, and the exact answers of the truth set."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from solids import (
    assembly,
    box,
    box_with_lid,
    l_tunnel,
    linked_rings,
    pair_in_pair,
    pairs_in_pairs,
    peg_in_plate,
    rod,
    sliding_halves,
)

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies
from sashimono.disassembly.blocking.groups import find_subassembly
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.conditions.clauses import minimal
from sashimono.disassembly.masks import bits
from sashimono.disassembly.physics.search import PhysicsConfig
from sashimono.disassembly.refusal import Refusal
from sashimono.disassembly.sequence.departures import DisassemblyResult
from sashimono.disassembly.sequence.greedy import SequenceConfig, find_disassembly
from sashimono.disassembly.translation.search import TranslationConfig
from sashimono.geometry import se3
from sashimono.plan import Answer

CONFIG = SeparateConfig(
    translation=TranslationConfig(max_legs=40),
    physics=PhysicsConfig(max_pushes=4, max_stretches=4),
    max_queries=64,
)


def cascade_of(parts: Assembly) -> Cascade:
    return Cascade(parts, make_bodies(parts), config=CONFIG)


def clauses_of(parts: Assembly) -> dict[str, set[frozenset[str]]]:
    conditions = cascade_of(parts).conditions()
    return {
        name: {frozenset(parts.names[k] for k in bits(clause.blockers)) for clause in clauses}
        for name, clauses in zip(parts.names, conditions.clauses, strict=True)
    }


@pytest.mark.parametrize("clearance", [0.0, 1e-5, 2e-4])
def test_a_peg_leaves_along_its_hole_only(clearance: float) -> None:
    parts = peg_in_plate(clearance)
    blocking = cascade_of(parts).blocking
    free = [blocking.direction(s) for s in range(blocking.count_directions) if blocking.is_free(1, s, 0b01)]
    assert len(free) == 2
    np.testing.assert_allclose(np.abs(np.array(free)), [[0.0, 0.0, 1.0]] * 2, atol=1e-12)


def test_content_leaves_when_the_lid_or_the_box_is_gone() -> None:
    assert clauses_of(box_with_lid()) == {
        "shell": {frozenset()},
        "content": {frozenset({"lid"}), frozenset({"shell"})},
        "lid": {frozenset()},
    }


def test_linked_rings_never_separate() -> None:
    parts = linked_rings()
    result = find_disassembly(cascade_of(parts), config=SequenceConfig())
    assert result.removals == ()
    assert len(result.stuck) == 1
    assert result.stuck[0][1].answer in (Answer.PROVEN_BLOCKED, Answer.UNKNOWN)
    assert result.stuck[0][1].reason


def test_a_ball_in_a_fitting_socket_is_proven_blocked() -> None:
    """A cube in a cube-shaped void: every direction runs into a wall, which is a proof and named as one."""
    void = box((0.04, 0.04, 0.04)) - box((0.02, 0.02, 0.02))
    parts = assembly(shell=void, cube=box((0.02, 0.02, 0.02)))
    separation = cascade_of(parts).translations.separate(1, 0b11, max_traced=0)
    assert separation.answer is Answer.PROVEN_BLOCKED
    assert separation.blocked_by == (0,)
    assert "translations" in separation.reason


def test_two_translations_where_one_is_not_enough() -> None:
    parts = l_tunnel()
    cascade = cascade_of(parts)
    assert not any(cascade.blocking.is_free(1, s, 0b01) for s in range(cascade.blocking.count_directions) if s % 2 == 0)
    separation = cascade.translations.separate(1, 0b11, max_traced=0)
    assert separation.answer is Answer.FREE
    assert separation.removal is not None


TURN = se3.exp(np.array([0.02, -0.03, 0.01, 0.4, -0.9, 0.3]))


def turned(parts: Assembly, T: np.ndarray) -> Assembly:
    return Assembly(
        parts=tuple(
            Part(name=p.name, vertices_part=se3.apply(T, p.vertices_part), faces=p.faces, T_world_part=np.eye(4))
            for p in parts.parts
        )
    )


def z_tunnel() -> Assembly:
    """A cube deep in a tunnel with two bends: down, aside, down, with no clearance at all."""
    block = box((0.07, 0.03, 0.07))
    block -= box((0.01, 0.01, 0.02), (-0.02, 0.0, 0.01))
    block -= box((0.05, 0.01, 0.01), (0.0, 0.0, -0.005))
    block -= box((0.01, 0.01, 0.04), (0.02, 0.0, -0.02))
    return assembly(block=block, cube=box((0.01, 0.01, 0.01), (-0.02, 0.0, 0.015)))


@pytest.mark.parametrize("T", [np.eye(4), TURN], ids=["straight", "tilted"])
@pytest.mark.parametrize(("make", "legs"), [(l_tunnel, 1), (z_tunnel, 3)])
def test_tunnels_without_clearance(make, legs: int, T: np.ndarray) -> None:
    for part in (0, 1):
        separation = cascade_of(turned(make(), T)).translations.separate(part, 0b11, max_traced=0)
        assert separation.answer is Answer.FREE
        assert separation.removal is not None
        assert len(separation.removal.displacements) >= legs + 1


@pytest.mark.parametrize("T", [np.eye(4), TURN], ids=["straight", "tilted"])
def test_a_loose_cage_is_proven_by_its_configuration_space(T: np.ndarray) -> None:
    """A cube that rattles in a box with a window too small for it: no contact proves anything, the lattice does."""
    void = box((0.06, 0.06, 0.06)) - box((0.04, 0.04, 0.04)) - box((0.014, 0.014, 0.1))
    parts = turned(assembly(shell=void, cube=box((0.02, 0.02, 0.02)), aside=box((0.01, 0.01, 0.01), (0.1, 0, 0))), T)
    separation = cascade_of(parts).translations.separate(1, 0b111, max_traced=0)
    assert separation.answer is Answer.PROVEN_BLOCKED
    assert separation.stage == "translation"
    assert separation.blocked_by == (0,)
    assert "translations" in separation.reason


def test_a_loose_cage_with_a_window_just_wide_enough_is_not_proven() -> None:
    void = box((0.06, 0.06, 0.06)) - box((0.04, 0.04, 0.04)) - box((0.02, 0.02, 0.1))
    parts = assembly(shell=void, cube=box((0.02, 0.02, 0.02), (0.005, -0.003, 0.0)))
    separation = cascade_of(parts).translations.separate(1, 0b11, max_traced=0)
    assert separation.answer is Answer.FREE


def test_a_motion_found_answers_for_every_set_without_the_parts_it_would_hit() -> None:
    parts = l_tunnel()
    cube = parts.parts[1]
    far = Part(
        name="far",
        vertices_part=cube.vertices_part,
        faces=cube.faces,
        T_world_part=se3.make(None, np.array([0.5, 0, 0])),
    )
    cascade = cascade_of(Assembly(parts=(*parts.parts, far)))
    inquiry = cascade.inquire()
    first = inquiry.ask(cascade.translations, 0, 0b011)
    assert first.answer is Answer.FREE
    assert not first.hits & 0b100
    assert inquiry.ask(cascade.translations, 0, 0b111) is first
    assert cascade.inquire().ask(cascade.translations, 0, 0b111) is not first, "another inquiry was not told"


@pytest.mark.parametrize("seed", range(3))
def test_a_cube_between_six_walls_is_free_just_where_one_is_missing(seed: int) -> None:
    """Six loose walls, of random sizes and distances: the cube passes none of them, and any gap of a wall frees it."""
    rng = np.random.default_rng(seed)
    solids = {"cube": box((0.01, 0.01, 0.01))}
    for k in range(6):
        axis, side = k // 2, 1.0 if k % 2 else -1.0
        at = np.zeros(3)
        at[axis] = side * rng.uniform(0.0095, 0.014)
        size = np.full(3, rng.uniform(0.008, 0.03))
        size[axis] = 0.006
        solids[f"wall{k}"] = box(tuple(size.tolist()), tuple(at.tolist()))
    cascade = cascade_of(assembly(**solids))
    everything = (1 << 6) - 1
    for walls in (everything, *(everything & ~(1 << k) for k in range(6)), 0b010101, 0b001111):
        answer = cascade.translations.separate(0, walls << 1 | 1, max_traced=0).answer
        assert answer is (Answer.PROVEN_BLOCKED if walls == everything else Answer.FREE), f"{walls:06b}"


def test_a_thin_washer_is_not_jumped() -> None:
    """A 0.2 mm washer under a bolt head: the bolt leaves upwards, not down through it."""
    bolt = rod(0.005, 0.03) + rod(0.01, 0.006, (0.0, 0.0, 0.018))
    washer = rod(0.012, 0.0002, (0.0, 0.0, 0.0149)) - rod(0.0051, 0.01, (0.0, 0.0, 0.0149))
    parts = assembly(bolt=bolt, washer=washer)
    blocking = cascade_of(parts).blocking
    free = [blocking.direction(s)[2] for s in range(blocking.count_directions) if blocking.is_free(0, s, 0b10)]
    assert free == [1.0]


def test_removal_ends_clear_of_what_stays() -> None:
    parts = box_with_lid()
    result = find_disassembly(cascade_of(parts), config=SequenceConfig())
    assert len(result.removals) == 2
    left = {0, 1, 2}
    for departure in result.removals:
        part, removal = departure.part, departure.separation.removal
        assert removal is not None
        D = removal.displacements[-1]
        d = removal.exit_direction
        back = (se3.apply(D, parts.parts[part].vertices_world) @ d).min()
        left.remove(part)
        assert back > max((parts.parts[k].vertices_world @ d).max() for k in left)


def test_dovetailed_halves_slide_one_way_only() -> None:
    lower, upper = sliding_halves((0.04, 0.03, 0.02))
    blocking = cascade_of(assembly(lower=lower, upper=upper)).blocking
    free = [blocking.direction(s) for s in range(blocking.count_directions) if blocking.is_free(1, s, 0b01)]
    np.testing.assert_allclose(np.abs(np.array(free)), [[1.0, 0.0, 0.0]] * 2, atol=1e-12)


def departures_of(parts: Assembly, result: DisassemblyResult) -> list[set[str]]:
    return [{parts.names[k] for k in bits(departure.members)} for departure in result.departures()]


def test_a_bar_in_halves_leaves_a_block_in_halves_as_one() -> None:
    parts = pair_in_pair()
    cascade = cascade_of(parts)
    result = find_disassembly(cascade, config=SequenceConfig())
    assert parts.names[result.base] in {"low", "high"}
    assert departures_of(parts, result)[0] == {"front", "back"}
    assert sorted(map(len, departures_of(parts, result))) == [1, 1, 2]
    assert result.stuck == ()
    group = result.removals[0]
    assert group.separation.removal is not None
    np.testing.assert_allclose(np.abs(group.separation.removal.exit_direction), [0.0, 1.0, 0.0], atol=1e-9)
    assert group.inside is not None
    assert group.part == group.inside.base
    assert group.inside.stuck == ()


def test_groups_come_apart_into_groups() -> None:
    parts = pairs_in_pairs()
    result = find_disassembly(cascade_of(parts), config=SequenceConfig())
    found = departures_of(parts, result)
    assert found[0] == {"low", "high", "front", "back"}
    assert found[1] == {"front", "back"}
    assert sorted(map(len, found)) == [1, 1, 1, 2, 4]
    assert all(departure.inside is None or departure.inside.stuck == () for departure in result.departures())


def test_a_group_refused_is_not_taken_again() -> None:
    parts = pair_in_pair()
    cascade = cascade_of(parts)
    first = find_disassembly(cascade, config=SequenceConfig()).removals[0]
    second = find_disassembly(cascade, config=SequenceConfig(), refused=frozenset({first.refusal})).removals[0]
    assert second.members == first.members
    assert second.separation.direction_index != first.separation.direction_index


@settings(max_examples=8)
@given(st.integers(0, 1000))
def test_conditions_do_not_change_with_a_rigid_motion_a_scale_or_names(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = box_with_lid()
    T = se3.exp(np.concatenate([rng.uniform(-1.0, 1.0, 3), rng.uniform(-2.0, 2.0, 3)]))
    scale = 10.0 ** rng.uniform(-2.0, 2.0)
    order = rng.permutation(3)
    moved = Assembly(
        parts=tuple(
            Part(name=f"x{k}", vertices_part=scale * p.vertices_part, faces=p.faces, T_world_part=T)
            for k, p in ((k, parts.parts[k]) for k in order)
        )
    )
    renamed = {
        f"x{parts.index(name)}": {frozenset(f"x{parts.index(n)}" for n in clause) for clause in clauses}
        for name, clauses in clauses_of(parts).items()
    }
    assert clauses_of(moved) == renamed


@settings(max_examples=10)
@given(st.integers(0, 1000))
def test_adding_an_obstacle_never_frees_a_part(seed: int) -> None:
    """Asked of two assemblies, each with a relation of its own: a cap takes one way out, and adds none."""
    rng = np.random.default_rng(seed)
    side = float(rng.choice([-1.0, 1.0]))
    size = rng.uniform(0.002, 0.03, 3)
    at = (*rng.uniform(-0.001, 0.001, 2), side * (0.0205 + size[2] / 2 + rng.uniform(0.0, 0.02)))
    without = peg_in_plate()
    capped = Assembly(parts=(*without.parts, *assembly(cap=box(tuple(size), at)).parts))

    def ways_out(parts: Assembly) -> set[tuple[float, ...]]:
        blocking, peg = cascade_of(parts).blocking, parts.index("peg")
        free = (s for s in range(blocking.count_directions) if blocking.is_free(peg, s, blocking.parts.all_parts))
        return {tuple(np.round(blocking.direction(s), 6) + 0.0) for s in free}

    assert ways_out(without) == {(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)}
    assert ways_out(capped) == {(0.0, 0.0, -side)}


def test_minimal_keeps_no_superset() -> None:
    assert minimal([0b111, 0b001, 0b110, 0b011, 0b110]) == [0b001, 0b110]


@pytest.mark.parametrize(
    "name", ["bolt_stack", "bolt_stack_tilt", "box_lid", "peg_facet_mismatch", "burr6", "Ltunnel_clr0"]
)
def test_conditions_are_the_exact_ones(truth_folder, name: str) -> None:
    from sashimono.io.read import read_assembly

    parts = read_assembly(truth_folder / name, unit="mm")
    conditions = cascade_of(parts).conditions()
    content = json.loads((truth_folder / name / "truth.json").read_text())
    index = {n: k for k, n in enumerate(parts.names)}
    if "removable_table" in content:
        listed = {sum(1 << index[n] for n in left): set(free) for left, free in content["removable_table"]}
        for remaining, free in listed.items():
            assert {parts.names[k] for k in bits(conditions.removable(remaining))} == free
        return
    exact = content["removable"]
    for remaining in range(1, 1 << len(parts)):
        if remaining & (remaining - 1) == 0:
            continue
        said = conditions.removable(remaining)
        for k in bits(remaining):
            right = any(not any(remaining >> index[n] & 1 for n in clause) for clause in exact[parts.names[k]] or [])
            assert bool(said >> k & 1) == right, (parts.names[k], bin(remaining))


def test_the_part_that_stays_decides_which_set_moves() -> None:
    parts = pair_in_pair()
    cascade = cascade_of(parts)
    bar = {parts.index("front"), parts.index("back")}
    found = [
        find_subassembly(
            cascade.blocking, 0b1111, stays=stays, worth=lambda direction: 0.0, connected=lambda mask: True
        )
        for stays in (0, 2)
    ]
    assert [set(bits(group.members)) for group in found if group is not None] == [bar, {0, 1}]
    apart = find_subassembly(
        cascade.blocking, 0b1111, stays=0, worth=lambda direction: 0.0, connected=lambda mask: False
    )
    assert apart is not None
    assert find_subassembly(cascade.blocking, 0b0011, stays=0, worth=lambda d: 0.0, connected=lambda mask: True) is None


def test_a_part_whose_motion_was_refused_is_still_spoken_of() -> None:
    """Nothing is lost between the levels: what may not leave any more is stuck, with a reason."""
    parts = peg_in_plate()
    cascade = cascade_of(parts)
    every = [None, *range(cascade.blocking.count_directions)]
    refused = frozenset(
        Refusal(members=1 << part, direction_index=direction_index) for part in range(2) for direction_index in every
    )
    result = find_disassembly(cascade, config=SequenceConfig(), refused=refused)
    assert result.removals == ()
    ((part, separation),) = result.stuck
    assert {part, result.base} == {0, 1}
    assert separation.answer is Answer.UNKNOWN
    assert "refused" in separation.reason
