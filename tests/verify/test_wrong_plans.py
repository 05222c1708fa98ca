"""Wrong plans by hand: each kind of wrongness at 1.05 times what the check tolerates is refuted, at 0.95 it is not.

How much is tolerated is written here once more, from the contract, not read from the check's configuration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import trimesh

from sashimono.assembly import Assembly, Part, Source
from sashimono.geometry import se3
from sashimono.plan import AssemblyPlan, Contact, Motion, Segment, Step, Table
from sashimono.verify import verify_plan

MM = 1e-3
SOURCE = Source(path="here", sha256="5a", unit="mm")
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


def at(*shift: float) -> np.ndarray:
    """Pose that shifts a part from its assembled pose."""
    return se3.make(translation=np.array(shift, dtype=float))


def box(size: tuple[float, float, float], center: tuple[float, float, float]) -> trimesh.Trimesh:
    return trimesh.creation.box(extents=size, transform=se3.make(translation=np.array(center)))


def step(name: str, fixed: tuple[str, ...], poses: list[np.ndarray], **fields: Any) -> Step:
    segments = (Segment(kind="insertion", start=0, stop=len(poses) - 1),) if len(poses) > 1 else ()
    motion = Motion(T_world_part=np.array(poses), segments=segments)
    return Step(part=name, fixed=fixed, motion=motion, **{"contact": None, **fields})


def two(
    first: trimesh.Trimesh,
    second: trimesh.Trimesh,
    poses: list[np.ndarray],
    *,
    scale: float,
    on_table: bool = True,
    **fields: Any,
) -> tuple[Assembly, AssemblyPlan]:
    """A plan that puts a second part to a first one, both drawn in millimetres and then scaled, the poses too."""
    parts = tuple(
        Part(
            name=name,
            vertices_part=np.array(mesh.vertices) * MM * scale,
            faces=np.array(mesh.faces),
            T_world_part=np.eye(4),
        )
        for name, mesh in (("first", first), ("second", second))
    )
    moved = [se3.make(T[:3, :3], T[:3, 3] * MM * scale) for T in poses]
    assembly = Assembly(parts=parts, source=SOURCE)
    return assembly, AssemblyPlan(
        status="complete",
        source=SOURCE,
        parts={p.name: p.T_world_part for p in parts},
        order=("first", "second"),
        steps=(step("first", (), [np.eye(4)]), step("second", ("first",), moved, **fields)),
        table=Table(normal=np.array([0.0, 0.0, 1.0]), offset=0.0) if on_table else None,
    )


def plate(hole: float = 10.0) -> trimesh.Trimesh:
    """40 × 40 × 10 mm on the table, with a square hole through its middle."""
    outer = box((40.0, 40.0, 10.0), (0.0, 0.0, 5.0))
    return trimesh.boolean.difference([outer, box((hole, hole, 30.0), (0.0, 0.0, 5.0))], engine="manifold")


def peg(width: float = 10.0) -> trimesh.Trimesh:
    return box((width, width, 30.0), (0.0, 0.0, 15.0))


OVER = [at(80, 0, 0), at(80, 0, 60), at(0, 0, 60), at(0, 0, 0)]
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
    return two(plate(), peg(width), [at(80, 0, 0), at(80, 0, 60), at(x, y, 60), at(x, y, 0), at(0, 0, 0)], scale=scale)


def turned(share: float, *, scale: float = 1.0):
    """A square peg in a wider square hole, turned about its axis until its corners are in the walls."""
    # half a diagonal at 45° is 5 √2 mm; the wall is so far off that the corners are share * 0.2 mm deep
    half = 5.0 * np.sqrt(2.0) - share * DEPTH * 10.0
    quarter = se3.exp_so3(np.array([0.0, 0.0, np.pi / 4]))
    twist = [se3.make(quarter, np.array([0.0, 0.0, 60.0])), se3.make(quarter)]
    return two(plate(2.0 * half), peg(), [at(80, 0, 0), at(80, 0, 60), *twist, at(0, 0, 0)], scale=scale)


def dipped(share: float, *, scale: float = 1.0):
    """A cap, 5 mm thick, is let down on a plate, and a little too far before it comes to rest."""
    slab, cap = box((40.0, 40.0, 10.0), (0.0, 0.0, 5.0)), box((20.0, 20.0, 5.0), (0.0, 0.0, 12.5))
    low = at(0, 0, -share * DEPTH * 5.0)
    return two(slab, cap, [at(80, 0, -10), at(80, 0, 40), at(0, 0, 40), low, at(0, 0, 0)], scale=scale)


def into_a_sheet(share: float, *, thickness: float, scale: float = 1.0):
    """A block is let down into a thin sheet, and drawn out again."""
    sheet, block = box((60.0, 60.0, thickness), (0.0, 0.0, -0.5 * thickness)), box((20.0, 20.0, 20.0), (0.0, 0.0, 10.0))
    low = at(0, 0, -share * DEPTH * thickness)
    return two(sheet, block, [at(0, 0, 50), low, at(0, 0, 0)], scale=scale, on_table=False)


def into_a_wall(share: float, *, scale: float = 1.0):
    """A block is let down into the floor of an open box, a millimetre thick."""
    outer, inner = box((60.0, 60.0, 60.0), (0.0, 0.0, 29.0)), box((58.0, 58.0, 60.0), (0.0, 0.0, 30.0))
    shell = trimesh.boolean.difference([outer, inner], engine="manifold")
    low = at(0, 0, -share * min(WALL, DEPTH * 40.0))
    block = box((40.0, 40.0, 40.0), (0.0, 0.0, 20.0))
    return two(shell, block, [at(0, 0, 90), low, at(0, 0, 0)], scale=scale, on_table=False)


def into_the_table(share: float, *, scale: float = 1.0):
    return two(plate(), peg(), [*OVER[:-1], at(0, 0, -share * DEPTH * 10.0), at(0, 0, 0)], scale=scale)


def starts_off_the_table(share: float, *, up: float, scale: float = 1.0):
    """A peg that floats over the table before it is taken, or stands in it."""
    return two(plate(), peg(), [at(80, 0, up * share * DEPTH * 10.0), *OVER[1:]], scale=scale)


def ends_beside(share: float, *, way: tuple[float, float, float], scale: float = 1.0):
    shift = share * END * PEG_SIZE * np.array(way)
    return two(plate(10.1), peg(), [*OVER[:-1], at(*shift)], scale=scale)


def grasped(share: float, *, point: tuple[float, float], tilt: tuple[float, float], scale: float = 1.0):
    """Fingers on the peg's x faces; how far each point is off its face, and how far each normal is turned."""
    off = share * POINT * PEG_SIZE * np.array(point)
    angle = share * ANGLE * np.array(tilt)
    down = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]])
    sizes = {f"finger_{name}": size for name, size in (("width", 8), ("thickness", 4), ("length", 40))}
    sizes |= {f"palm_{name}": size for name, size in (("width", 40), ("depth", 20), ("length", 10))}
    sizes["max_opening"] = 30
    contact = Contact(
        kind="grasp",
        points_part=np.array([[-5.0 - off[0], 0.0, 25.0], [5.0 + off[1], 0.0, 25.0]]) * MM * scale,
        normals_part=np.array([[np.cos(angle[0]), np.sin(angle[0]), 0.0], [-np.cos(angle[1]), 0.0, np.sin(angle[1])]]),
        friction=0.5,
        quality=0.1,
        T_part_gripper=se3.make(down, np.array([0.0, 0.0, 25.0]) * MM * scale),
        details={"gripper": {name: value * MM * scale for name, value in sizes.items()}},
    )
    return two(plate(), peg(), OVER, scale=scale, contact=contact)


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
        assembly, plan = KINDS[name](share)
        report = verify_plan(plan, assembly)
        assert report.ok is holds, (share, report.lines())
