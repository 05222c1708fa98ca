"""Wrong plans by hand: each kind of wrongness at 1.05 times what the check tolerates is refuted, at 0.95 it is not.

How much is tolerated is written here once more, from the contract, not read from the check's configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh
from test_verify import MM, OVER, SOURCE, TABLE, at, box, grasp, part, plan, plate_with_hole, step

from sashimono.assembly import Assembly
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan
from sashimono.verify import verify_plan

DEPTH = 0.02
"""Of the smaller part's smallest extent: how deep a pair may be, beyond its overlap as assembled."""
WALL = 0.4
"""Of a wall's thickness: the most that this may be."""
END = 1e-6
"""Of a part's diagonal: how far its last pose may be from the assembled one."""
POINT = 1e-4
"""Of a part's diagonal: how far a contact point may be from the surface."""
ANGLE = np.radians(5.0)
"""Between the stated normal of a contact and the surface's."""

Wrong = Callable[[float], tuple[Assembly, AssemblyPlan]]
"""Given the wrongness, over what is tolerated, returns an assembly and its plan."""


def two(
    first: trimesh.Trimesh, second: trimesh.Trimesh, poses: list[np.ndarray], *, scale: float, **fields: Any
) -> tuple[Assembly, AssemblyPlan]:
    """A plan that puts a second part to a first one, both and the poses scaled; ``fields``: of its step, or a table."""
    table = fields.pop("table", TABLE)
    drawn = (part("first", first), part("second", second))
    parts = tuple(replace(each, vertices_part=scale * each.vertices_part) for each in drawn)
    moved = [se3.make(T[:3, :3], scale * T[:3, 3]) for T in poses]
    assembly = Assembly(parts=parts, source=SOURCE)
    steps = (step("first", (), [np.eye(4)]), step("second", ("first",), moved, **fields))
    return assembly, plan(assembly, *steps, table=table)


def peg(width: float = 10.0) -> trimesh.Trimesh:
    return box((width, width, 30.0), (0.0, 0.0, 15.0))


PEG_SIZE = float(np.linalg.norm([10.0, 10.0, 30.0]))


def aside(share: float, *, way: tuple[float, float], width: float = 10.0, scale: float = 1.0):
    """A peg goes down its hole beside its axis, and to it at the bottom; a wide one is pressed in.

    Its edges are deepest: in the corners of the hole, seen from its edges.
    """
    overlap = 0.5 * (width - 10.0)
    deepest = np.sqrt(2.0) * overlap + share * DEPTH * 10.0
    straight, oblique = np.sqrt(deepest**2 - overlap**2) - overlap, deepest / np.sqrt(2.0) - overlap
    shift = straight if 0 in way else oblique
    x, y = shift * np.array(way, dtype=float)
    return two(
        plate_with_hole(),
        peg(width),
        [at(80, 0, 0), at(80, 0, 60), at(x, y, 60), at(x, y, 0), at(0, 0, 0)],
        scale=scale,
    )


def turned(share: float, *, scale: float = 1.0):
    """A square peg in a wider square hole, turned about its axis until its corners are in the walls."""
    # half a diagonal at 45° is 5 √2 mm; the wall is so far off that the corners are share * 0.2 mm deep
    half = 5.0 * np.sqrt(2.0) - share * DEPTH * 10.0
    quarter = se3.make(se3.exp_so3(np.array([0.0, 0.0, np.pi / 4])))
    twist = [at(0, 0, 60) @ quarter, quarter]
    return two(plate_with_hole(2.0 * half), peg(), [at(80, 0, 0), at(80, 0, 60), *twist, at(0, 0, 0)], scale=scale)


def dipped(share: float, *, scale: float = 1.0):
    """A cap, 5 mm thick, is let down on a plate, and a little too far before it comes to rest."""
    slab, cap = box((40.0, 40.0, 10.0), (0.0, 0.0, 5.0)), box((20.0, 20.0, 5.0), (0.0, 0.0, 12.5))
    low = at(0, 0, -share * DEPTH * 5.0)
    return two(slab, cap, [at(80, 0, -10), at(80, 0, 40), at(0, 0, 40), low, at(0, 0, 0)], scale=scale)


def into_a_sheet(share: float, *, thickness: float, scale: float = 1.0):
    """A block is let down into a thin sheet, and drawn out again."""
    sheet, block = box((60.0, 60.0, thickness), (0.0, 0.0, -0.5 * thickness)), box((20.0, 20.0, 20.0), (0.0, 0.0, 10.0))
    low = at(0, 0, -share * DEPTH * thickness)
    return two(sheet, block, [at(0, 0, 50), low, at(0, 0, 0)], scale=scale, table=None)


def into_a_wall(share: float, *, scale: float = 1.0):
    """A block is let down into the floor of an open box, a millimetre thick."""
    outer, inner = box((60.0, 60.0, 60.0), (0.0, 0.0, 29.0)), box((58.0, 58.0, 60.0), (0.0, 0.0, 30.0))
    shell = trimesh.boolean.difference([outer, inner], engine="manifold")
    low = at(0, 0, -share * min(WALL, DEPTH * 40.0))
    block = box((40.0, 40.0, 40.0), (0.0, 0.0, 20.0))
    return two(shell, block, [at(0, 0, 90), low, at(0, 0, 0)], scale=scale, table=None)


def into_the_table(share: float, *, scale: float = 1.0):
    return two(plate_with_hole(), peg(), [*OVER[:-1], at(0, 0, -share * DEPTH * 10.0), at(0, 0, 0)], scale=scale)


def starts_off_the_table(share: float, *, up: float, scale: float = 1.0):
    """A peg that floats over the table before it is taken, or stands in it."""
    return two(plate_with_hole(), peg(), [at(80, 0, up * share * DEPTH * 10.0), *OVER[1:]], scale=scale)


def ends_beside(share: float, *, way: tuple[float, float, float], scale: float = 1.0):
    shift = share * END * PEG_SIZE * np.array(way)
    return two(plate_with_hole(10.1), peg(), [*OVER[:-1], at(*shift)], scale=scale)


def grasped(share: float, *, point: tuple[float, float], tilt: tuple[float, float], scale: float = 1.0):
    """Fingers on the peg's x faces; how far each point is off its face, and how far each normal is turned."""
    off = share * POINT * PEG_SIZE * np.array(point)
    angle = share * ANGLE * np.array(tilt)
    sound = grasp()
    assert sound.T_part_gripper is not None
    contact = replace(
        sound,
        points_part=scale * (sound.points_part + np.array([[-off[0], 0.0, 0.0], [off[1], 0.0, 0.0]]) * MM),
        normals_part=np.array([[np.cos(angle[0]), np.sin(angle[0]), 0.0], [-np.cos(angle[1]), 0.0, np.sin(angle[1])]]),
        friction=0.5,
        T_part_gripper=se3.make(sound.T_part_gripper[:3, :3], scale * sound.T_part_gripper[:3, 3]),
        details={"gripper": {name: scale * size for name, size in sound.details["gripper"].items()}},
    )
    return two(plate_with_hole(), peg(), OVER, scale=scale, contact=contact)


def kinds() -> Iterator[tuple[str, Wrong]]:
    """Yield every kind of wrongness, in several sizes and directions."""

    def of(make: Callable[..., tuple[Assembly, AssemblyPlan]], **options: Any) -> tuple[str, Wrong]:
        words = [f"{name} {value}" for name, value in options.items()]
        return " ".join([make.__name__, *words]), lambda share: make(share, **options)

    for scale in (0.1, 1.0, 25.0):
        for way in ((1, 0), (-1, 0), (0, 1), (1, -1)):
            yield of(aside, way=way, scale=scale)
        for width in (10.2, 10.4):
            yield of(aside, way=(1, 0), width=width, scale=scale)
            yield of(aside, way=(-1, -1), width=width, scale=scale)
        for thickness in (1.0, 0.3):
            yield of(into_a_sheet, thickness=thickness, scale=scale)
        for way in ((1, 0, 0), (0, -1, 0), (0, 0, 1)):
            yield of(ends_beside, way=way, scale=scale)
        for point in ((1, 0), (0, 1), (-1, 0)):
            yield of(grasped, point=point, tilt=(0, 0), scale=scale)
        for tilt in ((1, 0), (0, 1), (-1, 0)):
            yield of(grasped, point=(0, 0), tilt=tilt, scale=scale)
        for up in (1, -1):
            yield of(starts_off_the_table, up=up, scale=scale)
        yield of(into_a_wall, scale=scale)
        yield of(turned, scale=scale)
        yield of(dipped, scale=scale)
        yield of(into_the_table, scale=scale)


KINDS = dict(kinds())


def test_there_are_enough() -> None:
    assert len(KINDS) >= 60


@pytest.mark.parametrize("name", KINDS)
def test_a_little_more_than_tolerated_is_refuted_and_a_little_less_is_not(name: str) -> None:
    for share, holds in ((0.95, True), (1.05, False)):
        assembly, wrong = KINDS[name](share)
        report = verify_plan(wrong, assembly)
        assert report.ok is holds, (share, report.lines())
