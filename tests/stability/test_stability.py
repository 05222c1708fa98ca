"""Support and gravity: partial assemblies with known answers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from solids import Manifold, assembly, bolt, box, rod

from sashimono.assembly import Assembly
from sashimono.bodies import make_bodies
from sashimono.plan import Table
from sashimono.stability import Holding, StabilityConfig, Statics, Touching, fewest_held
from sashimono.verify import VerifyConfig
from sashimono.verify.body import SampledBody
from sashimono.verify.holding import PlacedParts

UP = np.array([0.0, 0.0, 1.0])


def holding(
    parts: Assembly,
    floor: float,
    *,
    placed: Sequence[str] | None = None,
    fixed: Sequence[str] = (),
    up: np.ndarray = UP,
    config: StabilityConfig | None = None,
    fastened: Sequence[tuple[str, str]] = (),
    preferred: Sequence[str] = (),
) -> Holding:
    """What must be held of these parts on a table at this height [m]."""
    poses = {part.name: part.T_world_part for part in parts.parts}
    touching = Touching(make_bodies(parts), poses, config=config or StabilityConfig(), fastened=fastened)
    statics = Statics(touching, Table(normal=up, offset=floor))
    return fewest_held(statics, placed or parts.names, fixed=fixed, preferred=preferred)


def stack(shift: float, gap: float = 0.0) -> Assembly:
    """A cube of 20 mm on another, shifted by some way and lifted by a gap."""
    low = box((0.02, 0.02, 0.02), (0.0, 0.0, 0.01))
    return assembly(low=low, high=box((0.02, 0.02, 0.02), (shift, 0.0, 0.03 + gap)))


@pytest.mark.parametrize(("shift", "held"), [(0.0, ()), (0.0095, ()), (0.0105, ("high",)), (0.03, ("high",))])
def test_a_cube_stands_on_another_while_its_centre_is_above_it(shift: float, held: tuple[str, ...]) -> None:
    assert holding(stack(shift), 0.0) == Holding(held=held, fewest=True)


def test_what_hangs_in_the_air_is_held() -> None:
    assert holding(stack(0.0, gap=0.002), 0.0).held == ("high",)
    assert holding(stack(0.0), -0.05).held == ("low",)  # the table is far below: one hand carries both
    assert holding(stack(0.0), -0.05, fixed=["low"]).held == ()


def test_where_up_is_counts() -> None:
    # lying on the side, each of the two cubes stands by itself
    assert holding(stack(0.0105), -0.01, up=np.array([0.0, 1.0, 0.0])).held == ()


def test_friction_holds_on_a_slope_up_to_its_angle() -> None:
    for angle, held in ((15.0, ()), (18.0, ("block",))):  # atan 0.3 = 16.7 degrees
        wedge = box((0.2, 0.04, 0.04)).rotate((0.0, angle, 0.0))
        block = box((0.04, 0.02, 0.01), (0.0, 0.0, 0.025)).rotate((0.0, angle, 0.0))
        assert holding(assembly(wedge=wedge, block=block), -1.0, fixed=["wedge"]).held == held


def test_a_peg_in_an_exact_hole_is_not_held_by_a_squeeze() -> None:
    plate = box((0.06, 0.06, 0.02)) - rod(0.005, 0.04)
    parts = assembly(plate=plate, peg=rod(0.005, 0.04))
    assert holding(parts, -1.0, fixed=["plate"]).held == ("peg",)
    on_its_side = np.array([1.0, 0.0, 0.0])
    assert holding(parts, -1.0, fixed=["plate"], up=on_its_side).held == ()
    assert holding(parts, -0.02, placed=["peg", "plate"], fixed=["plate"]).held == ()  # it stands on the table


@pytest.mark.parametrize(("wider", "held"), [(0.00002, ("peg",)), (0.004, ())])
def test_a_taper_carries_and_rounding_does_not(wider: float, held: tuple[str, ...]) -> None:
    plate, cone = box((0.06, 0.06, 0.02)), Manifold.cylinder(0.04, 0.005, 0.005 + wider, 48, center=True)
    parts = assembly(plate=plate - cone, peg=cone)
    assert holding(parts, -1.0, fixed=["plate"]).held == held
    bodies = {part.name: SampledBody(part.name, part.vertices_part, part.faces, samples=3000) for part in parts.parts}
    placed = PlacedParts(bodies, {part.name: part.T_world_part for part in parts.parts}, VerifyConfig())
    table = Table(normal=np.array([0.0, 0.0, 1.0]), offset=-1.0)
    assert placed.falling(parts.names, {"plate"}, table) == list(held)


def test_an_interference_fit_and_a_declared_pair_are_fastened() -> None:
    plate = box((0.06, 0.06, 0.02)) - rod(0.0047, 0.04)
    assert holding(assembly(plate=plate, peg=rod(0.005, 0.04)), -1.0, fixed=["plate"]).held == ()
    loose = assembly(plate=box((0.06, 0.06, 0.02)) - rod(0.005, 0.04), peg=rod(0.005, 0.04))
    assert holding(loose, -1.0, fixed=["plate"], fastened=[("peg", "plate")]).held == ()


def test_a_screw_hangs_in_its_thread() -> None:
    radius, ridge = 0.006, 0.0015
    block = box((0.04, 0.04, 0.03)) - bolt(radius, ridge, 0.032)
    parts = assembly(block=block, screw=bolt(radius, ridge, 0.03))
    assert holding(parts, -1.0, fixed=["block"]).held == ()


def test_a_plate_screwed_to_a_wall_is_clamped() -> None:
    wall = box((0.02, 0.08, 0.08), (-0.01, 0.0, 0.0)) - rod(0.002, 0.2).rotate((0.0, 90.0, 0.0))
    plate = box((0.005, 0.04, 0.04), (0.0025, 0.0, 0.0)) - rod(0.003, 0.2).rotate((0.0, 90.0, 0.0))
    shank = rod(0.00225, 0.02).rotate((0.0, 90.0, 0.0)).translate((-0.005, 0.0, 0.0))
    screw = shank + rod(0.0045, 0.004).rotate((0.0, 90.0, 0.0)).translate((0.007, 0.0, 0.0))
    parts = assembly(wall=wall, plate=plate, screw=screw)
    assert holding(parts, -1.0, fixed=["wall"], placed=["wall", "plate"]).held == ("plate",)
    assert holding(parts, -1.0, fixed=["wall"]).held == ()


def test_the_fewest_are_held() -> None:
    # a bar on two posts that stand on nothing: it rests on both of them
    left, right = box((0.01, 0.01, 0.05), (-0.04, 0.0, 0.0)), box((0.01, 0.01, 0.05), (0.04, 0.0, 0.0))
    bar = box((0.1, 0.01, 0.01), (0.0, 0.0, 0.03))
    parts = assembly(left=left, right=right, bar=bar)
    assert holding(parts, -0.025).held == ()
    assert holding(parts, -1.0) == Holding(held=("left", "right"), fewest=True)
    assert holding(parts, -1.0, placed=["left", "bar"]).held == ("left", "bar")
    assert holding(parts, -0.025, placed=["left", "bar"]).held == ("bar",)


def test_what_is_held_already_is_preferred() -> None:
    # two bars in the air: the upper one rests on the lower
    low = box((0.1, 0.01, 0.01), (0.0, 0.0, 0.0))
    parts = assembly(low=low, high=box((0.02, 0.01, 0.01), (0.0, 0.0, 0.01)))
    assert holding(parts, -1.0, preferred=["high"]).held == ("low",)  # held from above, the lower one would fall
    pair = [("low", "high")]
    assert holding(parts, -1.0, preferred=["high"], fastened=pair).held == ("high",)


def test_a_spent_budget_says_so() -> None:
    # each cube stands on the one below, both together tip: one of them is held, whichever
    post = box((0.02, 0.02, 0.02), (0.0, 0.0, 0.01))
    low, high = (box((0.02, 0.02, 0.02), (0.008 * k, 0.0, 0.01 + 0.02 * k)) for k in (1, 2))
    parts = assembly(post=post, low=low, high=high)
    assert holding(parts, 0.0, placed=["post", "low"]).held == ()
    found = holding(parts, 0.0, fixed=["post"])
    assert found.fewest
    assert len(found.held) == 1
    spent = holding(parts, 0.0, fixed=["post"], config=StabilityConfig(max_programs=0))
    assert not spent.fewest
    assert len(spent.held) == 1


def chamfered_lid(*, upside_down: bool, ledge: bool) -> Assembly:
    """A lid with a chamfer all around its lower face, in a frame that it fits. It ends where the lid does, or has a
    ledge a little below: so bearings are drawn, with play in their seats."""
    frame = box((0.08, 0.08, 0.02)) - box((0.0601, 0.0601, 0.03))
    if ledge:
        frame += box((0.08, 0.08, 0.0042), (0.0, 0.0, -0.0129)) - box((0.05, 0.05, 0.03))
    low, high = (box((w, w, 1e-6), (0.0, 0.0, z)) for w, z in ((0.058, -0.0099995), (0.06, -0.0089)))
    lid = Manifold.batch_hull([low, high, box((0.06, 0.06, 1e-6), (0.0, 0.0, 0.0))])
    parts = assembly(frame=frame, lid=lid)
    if upside_down:
        parts = assembly(frame=frame.rotate((180.0, 0.0, 0.0)), lid=lid.rotate((180.0, 0.0, 0.0)))
    return parts


@pytest.mark.parametrize(("upside_down", "ledge"), [(False, False), (True, False), (False, True)])
def test_a_chamfer_that_faces_a_wall_carries_nothing(upside_down: bool, ledge: bool) -> None:
    """It faces the wall within the gap, leaning: by its normal the lid would lie on it."""
    parts = chamfered_lid(upside_down=upside_down, ledge=ledge)
    assert holding(parts, -1.0, fixed=["frame"]).held == ("lid",)
    poses = {p.name: p.T_world_part for p in parts.parts}
    bodies = {p.name: SampledBody(p.name, p.vertices_part, p.faces, samples=3000) for p in parts.parts}
    seen = PlacedParts(bodies, poses, VerifyConfig())
    assert seen.falling(parts.names, ("frame",), Table(normal=UP, offset=-1.0)) == ["lid"]


def test_walls_that_meet_in_an_edge_push_nothing() -> None:
    """A ring lies over a groove whose inner wall is hardly narrower than its bore: one wall ends below the other."""
    groove = rod(0.025, 0.01) - rod(0.02, 0.02)
    plate = box((0.1, 0.1, 0.02), (0.0, 0.0, -0.01)) - groove
    parts = assembly(plate=plate, ring=rod(0.04, 0.03, (0.0, 0.0, 0.015)) - rod(0.0201, 0.1))
    poses = {part.name: part.T_world_part for part in parts.parts}
    seen = Touching(make_bodies(parts), poses, config=StabilityConfig()).between("plate", "ring")
    assert len(seen.points) >= 3
    assert np.allclose(seen.normals, -UP, atol=1e-6)
    bodies = {p.name: SampledBody(p.name, p.vertices_part, p.faces, samples=3000) for p in parts.parts}
    pushes = PlacedParts(bodies, poses, VerifyConfig())._contact("plate", "ring")
    assert len(pushes.points) >= 3
    assert np.allclose(pushes.normals, -UP, atol=1e-6)
    assert holding(parts, -1.0, fixed=["plate"]).held == ()


@pytest.mark.parametrize("seed", range(6))
def test_sets_asked_one_after_another_are_held_as_each_is_alone(seed: int) -> None:
    # towers beside one another on a slab, some of which tip, built up in any order; now and then one is in a fixture
    rng = np.random.default_rng(seed)
    solids = {"slab": box((0.3, 0.1, 0.01), (0.1, 0.0, -0.005))}
    for k in range(4):
        for high, shift in enumerate(np.cumsum(rng.uniform(-0.008, 0.008, 3))):
            solids[f"t{k}_{high}"] = box((0.02, 0.02, 0.02), (0.06 * k + shift, 0.0, 0.01 + 0.02 * high))
    parts = assembly(**solids)
    touching = Touching(make_bodies(parts), {p.name: p.T_world_part for p in parts.parts}, config=StabilityConfig())
    table = Table(normal=UP, offset=-0.01)
    one_after_another = Statics(touching, table)
    order = ["slab", *(f"t{k}_{high}" for high in range(3) for k in rng.permutation(4))]
    for count in range(1, len(order) + 1):
        placed = order[:count]
        fixed = [str(name) for name in rng.choice(placed, rng.integers(0, 2))]
        alone = fewest_held(Statics(touching, table), placed, fixed=fixed)
        assert fewest_held(one_after_another, placed, fixed=fixed) == alone
