"""A plan's word alone joins no screw: the check looks whether the two touch all around."""

from __future__ import annotations

import numpy as np
import pytest
from solids import Manifold, assembly, box, rod

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.plan import Fastening, Table
from sashimono.stability import StabilityConfig, Touching, embraces
from sashimono.verify import VerifyConfig
from sashimono.verify.body import SampledBody
from sashimono.verify.bond import StatedBond
from sashimono.verify.holding import PlacedParts

DOWN = Table(normal=np.array([0.0, 0.0, 1.0]), offset=-1.0)


def hung(hole: Manifold) -> Assembly:
    """A screw in a plate's hole, its head below: it would fall out."""
    screw = rod(0.003, 0.02, (0.0, 0.0, 0.0)) + rod(0.005, 0.005, (0.0, 0.0, -0.0125))
    return assembly(plate=box((0.05, 0.05, 0.02)) - hole, screw=screw)


def falling(parts: Assembly, fastening: Fastening | None) -> list[str]:
    bodies = {p.name: SampledBody(p.name, p.vertices_part, p.faces, samples=3000) for p in parts.parts}
    bond = None if fastening is None else StatedBond(fastening.axis, fastening.point, close=False)
    stated = {} if bond is None else {frozenset(("screw", "plate")): bond}
    placed = PlacedParts(bodies, {p.name: p.T_world_part for p in parts.parts}, VerifyConfig(), stated=stated)
    return placed.falling(parts.names, {"plate"}, DOWN)


def said(
    axis: tuple[float, float, float] = (0.0, 0.0, 1.0), point: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> Fastening:
    return Fastening(kind="screw", size="M6", axis=axis, point=point, joins=("plate",))


TIGHT = rod(0.00302, 0.1)


def test_a_screw_that_fills_its_hole_is_held_by_it_if_the_plan_says_so() -> None:
    parts = hung(TIGHT)
    assert falling(parts, None) == ["screw"]
    assert falling(parts, said()) == []


@pytest.mark.parametrize(
    ("hole", "fastening"),
    [
        (rod(0.0045, 0.1), said()),
        (TIGHT + box((0.05, 0.006, 0.1), (0.0245, 0.0, 0.0)), said()),
        (TIGHT, said(axis=(1.0, 0.0, 0.0))),
        (TIGHT, said(point=(0.02, 0.0, 0.0))),
        (TIGHT, said(axis=(0.0, 0.0, 2.0))),
        (TIGHT, said(axis=(0.0, 0.0, float("nan")))),
    ],
    ids=["wide hole", "open slot", "other axis", "beside it", "no unit axis", "no number"],
)
def test_it_is_not_held_where_the_two_do_not_touch_all_around(hole: Manifold, fastening: Fastening) -> None:
    assert falling(hung(hole), fastening) == ["screw"]


@pytest.mark.parametrize(("radius", "expected"), [(0.00302, True), (0.0045, False)])
def test_the_planner_asks_the_same(radius: float, expected: bool) -> None:
    parts = hung(rod(radius, 0.1))
    poses = {part.name: part.T_world_part for part in parts.parts}
    touch = Touching(make_bodies(parts), poses, config=StabilityConfig()).between("screw", "plate")
    assert embraces(touch, np.array([0.0, 0.0, 1.0]), np.zeros(3)) is expected
    assert embraces(touch, np.array([1.0, 0.0, 0.0]), np.zeros(3)) is False
