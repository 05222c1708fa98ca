"""Removal conditions past single translations: complete and proven, checked by `verify`, the same however they lie."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from removal_check import problems
from solids import assembly, box, l_tunnel, rod

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.conditions.clauses import RemovalConditions
from sashimono.disassembly.masks import bits
from sashimono.disassembly.paths import hit_by_path
from sashimono.disassembly.removal import Removal
from sashimono.disassembly.translation.caging import Cages
from sashimono.disassembly.translation.configuration_space import Space, SpaceConfig
from sashimono.disassembly.translation.lattice_flood import explore, label, met_on_every_way
from sashimono.disassembly.translation.lattice_scene import Drawn, LatticeSceneBuilder, shell
from sashimono.geometry import se3
from sashimono.io.read import read_assembly


def conditions_of(parts: Assembly) -> RemovalConditions:
    return Cascade(parts, make_bodies(parts), config=SeparateConfig()).conditions()


def by_name(parts: Assembly, conditions: RemovalConditions) -> dict[str, set[frozenset[str]]]:
    return {
        name: {frozenset(parts.names[k] for k in bits(clause.blockers)) for clause in clauses}
        for name, clauses in zip(parts.names, conditions.clauses, strict=True)
    }


def cups() -> Assembly:
    """Three cups in one another, walls 1 mm, gaps none: thin for their size."""
    out = {}
    for k in range(3):
        radius = 0.012 + 0.001 * k
        out[f"cup{k}"] = rod(radius, 0.012, (0.0, 0.0, -0.001 * k)) - rod(
            radius - 0.001, 0.012, (0, 0, 0.001 - 0.001 * k)
        )
    return assembly(**out)


def screwed_lid() -> Assembly:
    """A wide thin lid on a box, held by two small screws far apart."""
    lid, base = (
        box((0.08, 0.05, 0.003), (0, 0, 0.0115)),
        box((0.08, 0.05, 0.02)) - box((0.06, 0.046, 0.02), (0, 0, 0.005)),
    )
    solids = {}
    for k, x in enumerate((-0.035, 0.035)):
        lid -= rod(0.0016, 0.01, (x, 0.0, 0.0115))
        base -= rod(0.0015, 0.012, (x, 0.0, 0.004))
        solids[f"screw{k}"] = rod(0.0015, 0.011, (x, 0.0, 0.0075)) + rod(0.003, 0.002, (x, 0.0, 0.014))
    return assembly(base=base, lid=lid, **solids)


def test_thin_walls_are_proven() -> None:
    conditions = conditions_of(cups())
    assert by_name(cups(), conditions)["cup1"] == {frozenset({"cup0"}), frozenset({"cup2"})}
    assert conditions.cut_short == ()


def test_each_of_two_small_screws_holds_a_wide_lid() -> None:
    parts = screwed_lid()
    conditions = conditions_of(parts)
    assert by_name(parts, conditions)["lid"] >= {frozenset({"screw0", "screw1"}), frozenset({"base"})}
    assert parts.index("lid") not in conditions.cut_short


def test_every_witness_holds_by_the_check() -> None:
    parts = l_tunnel()
    conditions = conditions_of(parts)
    for part, clauses in enumerate(conditions.clauses):
        for clause in clauses:
            others = [p for k, p in enumerate(parts.parts) if k != part and not clause.blockers >> k & 1]
            assert problems(parts, parts.parts[part], others, clause.removal) == []


def test_a_bayonet_comes_apart_both_ways_by_one_motion(truth_folder) -> None:
    parts = read_assembly(truth_folder / "bayonet", unit="mm")
    conditions = conditions_of(parts)
    assert [[clause.blockers for clause in clauses] for clauses in conditions.clauses] == [[0], [0]]
    for part, (clause,) in enumerate(conditions.clauses):
        assert problems(parts, parts.parts[part], [parts.parts[1 - part]], clause.removal) == []
        turned = clause.removal.displacements[-1, :3, :3]
        assert np.trace(turned) < 2.9


@settings(max_examples=15)
@given(seed=st.integers(0, 100))
def test_the_motion_of_the_other_part_is_the_same_relative_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = se3.exp(np.concatenate([rng.uniform(-1, 1, 3), rng.uniform(-1, 1, 3)]))
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    removal = Removal(
        displacements=np.stack([np.eye(4), turn, se3.make(None, 0.5 * direction) @ turn]), exit_direction=direction
    )
    other = removal.of_the_other()
    for D, E in zip(removal.displacements, other.displacements, strict=True):
        np.testing.assert_allclose(D @ E, np.eye(4), atol=1e-12)
    leg = se3.inverse(other.displacements[1]) @ other.displacements[2]
    last = other.displacements[2, :3, 3] - other.displacements[1, :3, 3]
    np.testing.assert_allclose(leg[:3, :3], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(last, 0.5 * other.exit_direction, atol=1e-12)
    again = other.of_the_other()
    np.testing.assert_allclose(again.exit_direction, removal.exit_direction, atol=1e-12)


def test_a_part_between_many_others_costs_no_question_for_each_of_their_sets(truth_folder) -> None:
    """A ring in the middle of a stack on a rod: one ring above and the rod hold it, whatever else is gone."""
    conditions = conditions_of(read_assembly(truth_folder / "ring_stack20", unit="mm"))
    assert conditions.cut_short == ()


@pytest.mark.parametrize(("name", "seed"), [("bolt_stack_tilt", 0), ("box_lid", 1), ("peg_facet_mismatch", 2)])
def test_conditions_do_not_depend_on_how_it_lies(truth_folder, name: str, seed: int) -> None:
    parts = read_assembly(truth_folder / name, unit="mm")
    rng = np.random.default_rng(seed)
    scale = 10.0 ** rng.uniform(-1.0, 1.0)
    T = se3.exp(np.concatenate([rng.uniform(-0.1, 0.1, 3), rng.uniform(-1.5, 1.5, 3)]))
    moved = Assembly(
        parts=tuple(
            Part(
                name=p.name, vertices_part=se3.apply(T, scale * p.vertices_part), faces=p.faces, T_world_part=np.eye(4)
            )
            for p in (parts.parts[k] for k in rng.permutation(len(parts)))
        )
    )
    assert by_name(moved, conditions_of(moved)) == by_name(parts, conditions_of(parts))


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), most=st.sampled_from([4, 10_000]))
def test_the_points_that_are_kept_tell_what_all_points_would(seed: int, most: int) -> None:
    """Voxel against voxel, at random: with all points exactly what the shells meet, with few never more."""
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 6, 3)
    solid = rng.random(sizes) < 0.7
    solid.ravel()[0] = True
    window = np.array([4, 4, 4])
    part = Drawn(np.pad(solid, 1), np.full(3, -1))
    scene = LatticeSceneBuilder(window, 3, max_points=most)
    room = sizes + window - 1
    obstacles = []
    for bit in range(3):
        first = np.array([rng.integers(0, n) for n in room])
        drawn = rng.random([rng.integers(1, n - f + 1) for n, f in zip(room, first, strict=True)]) < 0.3
        scene.put(bit, part, Drawn(np.pad(drawn, 1), first - 1))
        whole = np.zeros(room, bool)
        whole[tuple(slice(f, f + n) for f, n in zip(first, drawn.shape, strict=True))] = drawn
        obstacles.append(whole)
    built = scene.finished()
    if built is None:  # nothing of the obstacles was drawn
        return
    labels, known = np.zeros(window, np.int64), np.zeros(window, np.int64)
    own = part.shell
    for cell in np.ndindex(*window):
        mask = int(label(built, cell, labels, known))
        for bit, whole in enumerate(obstacles):
            theirs = shell(np.pad(whole, 1)) - 1
            at = theirs - cell
            inside = ((at >= 0) & (at < solid.shape)).all(axis=1)
            met = [bool(whole[tuple((own + cell).T)].any()), bool(solid[tuple(at[inside].T)].any())]
            assert not mask >> bit & 1 or any(met)
            if most > 4:
                assert mask >> bit & 1 in (int(met[0]), int(met[1]))


@settings(max_examples=60)
@given(seed=st.integers(0, 10_000), fill=st.sampled_from([0.05, 0.15, 0.3, 0.5]), walls=st.booleans())
def test_what_is_met_on_every_way_out_blocks_it_by_itself(seed: int, fill: float, walls: bool) -> None:
    """Exactly those obstacles without which there is a way past the base, and with which there is none."""
    rng = np.random.default_rng(seed)
    shape, count, base = tuple(rng.integers(5, 10, 3).tolist()), 5, 0b1
    labels = np.zeros(shape, np.int64)
    for bit in range(count):
        labels |= (rng.random(shape) < (fill if bit else 0.5 * fill)).astype(np.int64) << bit
        if walls and bit:  # sheets right across the lattice
            axis = int(rng.integers(3))
            sheet = [slice(None)] * 3
            sheet[axis] = int(rng.integers(1, shape[axis] - 1))
            labels[tuple(sheet)] |= 1 << bit
    if walls:  # a channel: the base all around the way out
        labels[1:-1, 1:-1, [1, -2]] |= base
        labels[1:-1, [1, -2], 1:-1] |= base
    start = tuple(n // 2 for n in shape)
    labels[start] = 0
    scene = LatticeSceneBuilder(np.array(shape), count, max_points=1)
    dot = Drawn(np.pad(np.ones((1, 1, 1), bool), 1), np.zeros(3, int))
    scene.put(0, dot, dot)  # anything: all labels are known
    built, known = scene.finished(), np.full(shape, -1, np.int64)
    assert built is not None

    def is_out(past: int) -> bool:
        steps, queue = np.full(shape, -1, np.int32), np.empty((labels.size + 1, 3), np.int32)
        return bool(explore(built, labels, known, start, past, steps, queue, labels.size)[0])

    wanted = 0b11110
    expected = sum(1 << bit for bit in range(1, count) if not is_out(base | 1 << bit)) if is_out(base) else 0
    assert met_on_every_way(built, labels, known, start, base, wanted, 100 * labels.size) == expected
    few = int(met_on_every_way(built, labels, known, start, base, wanted, 3))
    assert few & ~expected == 0


def test_rings_on_a_post_hold_the_lowest_one_by_themselves_each() -> None:
    """Each ring above, and the post: what one proof tells of the others is what each is asked by itself."""
    rings = {
        f"ring{k}": rod(0.012, 0.004, (0.0, 0.0, 0.004 * k)) - rod(0.0051, 0.01, (0.0, 0.0, 0.004 * k))
        for k in range(7)
    }
    parts = assembly(post=rod(0.005, 0.04, (0.0, 0.0, 0.014)) + rod(0.02, 0.004, (0.0, 0.0, -0.004)), **rings)
    cascade = Cascade(parts, make_bodies(parts), config=SeparateConfig())
    asked = Cages(cascade.parts, config=SpaceConfig())
    everything = cascade.parts.all_parts & ~0b10
    with asked.across_sets():
        for above in range(2, 8):
            proof = asked.prove(1, everything)
            assert proof is not None
            alone = Cages(cascade.parts, config=SpaceConfig()).prove(1, sum(1 << part for part in proof))
            assert alone is not None
            everything &= ~(1 << above)
        assert asked.prove(1, everything) is None


def test_a_ridge_lower_than_the_tolerance_proves_nothing() -> None:
    """A block in a pocket goes over a ridge of a hundredth of its size, then up: contact normals alone deny it."""
    pocket = box((0.04, 0.02, 0.02), (0.015, 0.005, 0.005)) - box((0.0202, 0.01, 0.01), (0.0101, 0.005, 0.005))
    pocket -= box((0.0101, 0.01, 0.02), (0.01515, 0.005, 0.01))
    pocket += box((0.0001, 0.01, 0.0001), (0.01005, 0.005, 0.00005))
    parts = assembly(block=box((0.01, 0.01, 0.01), (0.005, 0.005, 0.005)), pocket=pocket)
    said = Cascade(parts, make_bodies(parts), config=SeparateConfig()).separate(0, 0b11)
    assert said.removal is not None, said.reason
    assert not problems(parts, parts.parts[0], [parts.parts[1]], said.removal)


def test_a_part_that_is_met_again_is_in_the_way_of_a_motion_found_without_it() -> None:
    """A pin drawn into one wall may leave it so, but not go through the next: the overlap excuses no second wall."""
    walls = box((0.01, 0.02, 0.02), (-0.005, 0, 0)) + box((0.002, 0.02, 0.02), (0.021, 0, 0))
    walls += box((0.032, 0.02, 0.002), (0.006, 0, -0.011))
    pin = box((0.0112, 0.002, 0.002), (0.0044, 0, 0))
    parts = assembly(pin=pin, walls=walls)
    there = Cascade(parts, make_bodies(parts), config=SeparateConfig()).parts
    ahead = Removal.straight(np.array([1.0, 0.0, 0.0]), 0.06)
    assert hit_by_path(there, 0, ahead, [1], tolerance=0.0075) == 0b10


@pytest.mark.parametrize("thickness", [5e-7, 5e-6])
def test_a_foil_has_more_lattice_points_than_a_word_counts(thickness: float) -> None:
    parts = assembly(foil=box((1.0, 1.0, thickness)), slab=box((1.1, 1.1, 0.1), (0, 0, -0.05 - thickness)))
    there = Cascade(parts, make_bodies(parts), config=SeparateConfig()).parts
    assert not Space(there, 0, 80.0, config=SpaceConfig()).flood(0b10).blocked
