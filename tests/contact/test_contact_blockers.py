"""What a contact meets: known answers, and for every set of parts the same as level 3 asked anew."""

import numpy as np
import pytest
import trimesh

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies
from sashimono.contact import ContactConfig
from sashimono.contact.contact_blockers import ContactBlockers, central_pushes
from sashimono.contact.tip_contact import choose_tip_contact, find_tip_grasps
from sashimono.geometry import se3
from sashimono.motion.scene import Obstacle
from sashimono.plan import Motion, Segment

CONFIG = ContactConfig()


def box(name, extents, middle, holes=()):
    mesh = trimesh.creation.box(extents)
    for hole in holes:
        mesh = trimesh.boolean.difference([mesh, trimesh.creation.box(hole)])
    pose = se3.make(translation=np.array(middle, dtype=np.float64))
    return Part(name=name, vertices_part=mesh.vertices, faces=mesh.faces, T_world_part=pose)


def straight_down(part, way):
    above = part.T_world_part.copy()
    above[:3, 3] += way
    return Motion(
        T_world_part=np.array([above, part.T_world_part]), segments=(Segment(kind="insertion", start=0, stop=1),)
    )


def in_a_well(cube):
    """A cube on a floor between four walls, which its top is level with, 1 mm apart."""
    walls = [
        box("left", (0.01, 0.02, 0.02), (-0.016, 0.0, 0.0)),
        box("right", (0.01, 0.02, 0.02), (0.016, 0.0, 0.0)),
        box("front", (0.02, 0.01, 0.02), (0.0, -0.016, 0.0)),
        box("back", (0.02, 0.01, 0.02), (0.0, 0.016, 0.0)),
        box("floor", (0.06, 0.06, 0.01), (0.0, 0.0, -0.016)),
    ]
    return Assembly(parts=(cube, *walls))


def blockers_of(assembly, motion, config=CONFIG):
    bodies = make_bodies(assembly, rng=np.random.default_rng(0))
    part = assembly.parts[0]
    grasps = find_tip_grasps(part, bodies[part.name], config=config, rng=np.random.default_rng(1))
    around = {
        k: Obstacle(body=bodies[other.name], T_world_part=other.T_world_part)
        for k, other in enumerate(assembly.parts)
        if k
    }
    found = ContactBlockers(motion, around, body=bodies[part.name], grasps=grasps, config=config)
    return found, grasps, bodies, around


def test_a_cube_in_a_well_is_grasped_once_a_pair_of_walls_or_the_floor_is_gone_and_pushed_at_any_time():
    cube = box("cube", (0.02, 0.02, 0.02), (0.0, 0.0, 0.0))
    found, *_ = blockers_of(in_a_well(cube), straight_down(cube, (0.0, 0.0, 0.06)), ContactConfig(tip_scales=(1.0,)))
    sideways, across, below = 0b000110, 0b011000, 0b100000
    met = {entry.met for entry in found.contacts if entry.kind == "grasp"}
    assert {sideways, across, below} <= met
    assert 0 not in met
    assert found.minimal() == [0]
    assert found.best(0b111110).kind == "push"
    assert found.best(across | below).kind == "grasp"


def test_with_nothing_around_every_contact_is_clear():
    cube = box("cube", (0.02, 0.02, 0.02), (0.0, 0.0, 0.0))
    found, *_ = blockers_of(Assembly(parts=(cube,)), straight_down(cube, (0.0, 0.0, 0.06)))
    assert found.contacts
    assert {entry.met for entry in found.contacts} == {0}
    assert found.best(0).kind == "grasp"


def test_without_a_middle_to_push_on_one_wall_beside_the_rim_must_go_or_the_floor():
    ring = box("ring", (0.02, 0.02, 0.02), (0.0, 0.0, 0.0), holes=[(0.012, 0.012, 0.04)])
    one_size = ContactConfig(tip_scales=(1.0,))
    motion = straight_down(ring, (0.0, 0.0, 0.06))
    found, _, bodies, _ = blockers_of(in_a_well(ring), motion, one_size)
    assert len(central_pushes(motion, bodies["ring"], one_size)[0]) == 0
    assert found.best(0b111110) is None
    assert sorted(found.minimal()) == [0b10, 0b100, 0b1000, 0b10000, 0b100000]


@pytest.mark.parametrize("sunk", [0.0, 0.004])
def test_for_every_set_of_parts_the_answer_is_the_one_of_level_3(sunk):
    block = box("block", (0.02, 0.012, 0.02), (0.0, 0.0, -sunk))
    assembly = in_a_well(block)
    motion = straight_down(block, (0.0, 0.0, 0.06))
    found, grasps, bodies, around = blockers_of(assembly, motion)
    minimal = found.minimal()
    for present in range(0, 1 << len(assembly.parts), 2):
        best = found.best(present)
        assert (best is not None) == any(not mask & present for mask in minimal)
        fixed = [obstacle for k, obstacle in around.items() if present >> k & 1]
        asked = choose_tip_contact(motion, fixed, (), None, body=bodies["block"], grasps=grasps, config=CONFIG)
        if best is not None and best.kind == "grasp":
            assert asked.contact.kind == "grasp"
        if best is None or best.kind == "push":
            assert asked.contact is None or asked.contact.kind == "push"


def test_a_push_goes_through_the_centre_of_mass_and_only_where_the_way_is_straight():
    wedge = box("wedge", (0.03, 0.02, 0.01), (0.0, 0.0, 0.0))
    bodies = make_bodies(Assembly(parts=(wedge, box("far", (1, 1, 1), (9, 9, 9)))), rng=np.random.default_rng(0))
    motion = straight_down(wedge, (0.0, 0.0, 0.05))
    points, normals = central_pushes(motion, bodies["wedge"], CONFIG)
    np.testing.assert_allclose(points, [[0.0, 0.0, 0.005]], atol=1e-9)
    np.testing.assert_allclose(normals, [[0.0, 0.0, -1.0]], atol=1e-9)
    slanted, _ = central_pushes(straight_down(wedge, (0.0, 0.03, 0.05)), bodies["wedge"], CONFIG)
    assert len(slanted) == 0, "a finger slips off a face that is 31 degrees off the way"
    aside = np.array([se3.make(translation=np.array(t)) for t in ((0.1, 0.0, 0.05), (0.0, 0.0, 0.05), (0.0, 0.0, 0.0))])
    bent = Motion(T_world_part=aside, segments=(Segment(kind="insertion", start=0, stop=2),))
    assert len(central_pushes(bent, bodies["wedge"], CONFIG)[0]) == 0
