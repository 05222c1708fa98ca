"""Bought products: told by name, by rolling elements, by what cannot leave; planned as one part, and read again so."""

from __future__ import annotations

import json
from pathlib import Path

import manifold3d
import pytest
from manifold3d import Manifold
from nested import Node, write_glb
from solids import box, rod

from sashimono.assembly import Kept
from sashimono.bought import bought_by_name, find_bought
from sashimono.cli import BAD_INPUT, OK, run
from sashimono.errors import InputError
from sashimono.io.kept import keep_together
from sashimono.io.plan_input import read_plan_input
from sashimono.io.plan_json import read_plan
from sashimono.io.raw import ReadConfig
from sashimono.io.read import read_assembly


def bearing(at: tuple[float, float, float] = (0.0, 0.0, 0.0), elements: int = 10) -> list[Node]:
    """Two races and rollers between them, 0.05 mm of play, about z."""
    outer = rod(0.013, 0.008) - rod(0.0111, 0.01)
    inner = rod(0.0079, 0.008) - rod(0.005, 0.01)
    roller = rod(0.00155, 0.006, (0.0095, 0.0, 0.0), segments=24)
    rollers = [roller.rotate([0.0, 0.0, 360.0 * k / elements]).translate(at) for k in range(elements)]
    races = [("outer", outer.translate(at)), ("inner", inner.translate(at))]
    return [*races, *((f"roller {k}", each) for k, each in enumerate(rollers))]


def flat(path: Path, *solids: Node) -> Path:
    """A file of parts side by side, without a product."""
    return write_glb(path / "flat.glb", ("all", list(solids)))


def thrust() -> list[Node]:
    """Two washers with a groove, eight balls between them and their cage, about z."""
    ball = Manifold.sphere(0.002, 24).translate((0.012, 0.0, 0.0))
    balls = [ball.rotate((0.0, 0.0, 45.0 * k)) for k in range(8)]
    groove = Manifold.revolve(manifold3d.CrossSection.circle(0.00205, 24).translate((0.012, 0.0)), 64)
    washer = rod(0.016, 0.004, (0.0, 0.0, 0.0032), 64) - rod(0.008, 0.02, segments=64) - groove
    cage = rod(0.015, 0.001, segments=64) - rod(0.009, 0.02, segments=64)
    for each in balls:
        cage -= each.scale((1.0, 1.0, 3.0))
    washers = [("upper", washer), ("lower", washer.rotate((180.0, 0.0, 0.0)))]
    return [*washers, ("cage", cage), *((f"ball {k}", each) for k, each in enumerate(balls))]


def block(name: str = "UC like thing") -> Node:
    """A bearing in a housing on a plate, and its shaft."""
    housing = box((0.04, 0.04, 0.008)) - rod(0.013, 0.01)
    plate = box((0.04, 0.04, 0.004), (0.0, 0.0, -0.006)) - rod(0.006, 0.01, (0.0, 0.0, -0.006))
    return ("block", [("plate", plate), ("housing", housing), (name, bearing()), ("shaft", rod(0.005, 0.03))])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("608", "a ball bearing"),
        ("bearing_608ZZ", "a ball bearing"),
        ("6204-2RS v3", "a ball bearing"),
        ("LM8UU", "a linear bearing"),
        ("NEMA17 motor mount kit", "a stepper motor"),
        ("Nema 17", "a stepper motor"),
        ("MGN12H carriage", "a linear guide"),
        ("CIM Motor (217-2000)", "a motor"),
        ("PulleyBearing", "a bearing"),
        ("SG90", "a servo"),
        ("XT60 male", "a connector"),
        ("Kugellager", "a bearing"),
    ],
)
def test_standard_names_and_last_nouns_tell_what_is_bought(name: str, said: str) -> None:
    assert bought_by_name(name) == said


@pytest.mark.parametrize(
    "name", ["Motor Mount", "bearing housing", "plate 608 x 20", "Part 6000", "gearbox", "lid", "motorised stage", ""]
)
def test_other_names_do_not(name: str) -> None:
    assert bought_by_name(name) is None


def test_rollers_between_races_are_a_bearing(tmp_path: Path) -> None:
    parts = read_assembly(write_glb(tmp_path / "block.glb", block()))
    (entry,) = find_bought(parts)
    assert (entry.product, entry.reason) == ("UC like thing", "bought: a bearing, 10 rollers between races")
    whole = keep_together(parts, [entry])
    assert whole.names == ("plate", "housing", "UC like thing", "shaft")
    assert whole.products == ()
    assert whole.source is not None
    assert whole.source.kept == (entry,)
    assert any("12 parts kept together" in note for note in whole.notes)


def test_pins_through_a_flange_are_no_bearing(tmp_path: Path) -> None:
    """Six pins on a circle go through both discs: nothing runs between them."""
    pins = [rod(0.0015, 0.008, (0.0095, 0.0, 0.0), 24).rotate([0.0, 0.0, 60.0 * k]) for k in range(6)]
    disc = rod(0.013, 0.004)
    for pin in pins:
        disc -= pin
    discs = [("below", disc.translate((0.0, 0.0, -0.002))), ("above", disc.translate((0.0, 0.0, 0.002)))]
    root = (
        "all",
        [
            ("hub", [*discs, *((f"pin {k}", pin) for k, pin in enumerate(pins))]),
            ("cube", box((0.01,) * 3, (0.0, 0.0, 0.009))),
        ],
    )
    assert find_bought(read_assembly(write_glb(tmp_path / "hub.glb", root))) == ()


def test_bearings_in_a_file_without_products_are_told_by_their_shape(tmp_path: Path) -> None:
    housing = box((0.04, 0.04, 0.03)) - rod(0.013, 0.05)
    seal = rod(0.011, 0.001, (0.0, 0.0, 0.0035)) - rod(0.008, 0.02)
    second = [(f"idler_{name}", solid) for name, solid in bearing((0.0, 0.0, 0.01))]
    source = flat(tmp_path, ("housing", housing), *bearing(), ("seal", seal), ("shaft", rod(0.005, 0.06)), *second)
    parts = read_assembly(source)
    kept = find_bought(parts)
    assert [(entry.product, len(entry.members), entry.reason) for entry in kept] == [
        ("bearing", 13, "bought: a bearing, 10 rollers between races"),
        ("idler", 12, "bought: a bearing, 10 rollers between races"),
    ]
    assert "seal" in kept[0].members
    whole = keep_together(parts, kept)
    assert whole.names == ("housing", "bearing", "shaft", "idler")
    assert whole.source is not None
    again = read_assembly(source, config=ReadConfig(kept=whole.source.kept))
    assert again.names == whole.names
    assert find_bought(parts, keep=["idl*"]) == kept
    strange = Kept(product="x", reason="y", members=("shaft", "nosuch"))
    with pytest.raises(InputError, match="no part 'nosuch', of which x is made"):
        keep_together(parts, [strange])


def test_two_rows_between_the_same_races_are_one_bearing(tmp_path: Path) -> None:
    races = [(name, solid.scale((1.0, 1.0, 2.0))) for name, solid in bearing()[:2]]
    rows = [(f"{name} {z}", solid.translate((0.0, 0.0, z))) for z in (-0.004, 0.004) for name, solid in bearing()[2:]]
    (entry,) = find_bought(read_assembly(flat(tmp_path, *races, *rows, ("shaft", rod(0.005, 0.06)))))
    assert entry.reason == "bought: a bearing, 20 rollers between races"


def test_balls_between_washers_are_a_bearing(tmp_path: Path) -> None:
    (entry,) = find_bought(read_assembly(flat(tmp_path, *thrust(), ("shaft", rod(0.008, 0.06)))))
    assert (len(entry.members), entry.reason) == (11, "bought: a bearing, 8 balls between races")


def pins_in_pockets() -> list[Node]:
    """Round keys, half in a hub and half in the ring about it: they lock the two."""
    pins = [rod(0.0015, 0.006, (0.0095, 0.0, 0.0), 24).rotate((0.0, 0.0, 60.0 * k)) for k in range(6)]
    hub, ring = rod(0.0095, 0.006) - rod(0.006, 0.02), rod(0.013, 0.006) - rod(0.0095, 0.02)
    for pin in pins:
        hub, ring = hub - pin, ring - pin
    return [("hub", hub), ("ring", ring), *((f"pin {k}", pin) for k, pin in enumerate(pins))]


def pins_in_a_plate() -> list[Node]:
    """Pins on a circle in one ring, and a disc in its middle."""
    pins = [rod(0.0015, 0.012, (0.0095, 0.0, 0.0), 24).rotate((0.0, 0.0, 60.0 * k)) for k in range(6)]
    plate = rod(0.013, 0.006) - rod(0.006, 0.02)
    for pin in pins:
        plate -= pin
    disc = rod(0.006, 0.006) - rod(0.003, 0.02)
    return [("plate", plate), ("disc", disc), *((f"pin {k}", pin) for k, pin in enumerate(pins))]


def balls_in_pockets(lid: bool) -> list[Node]:
    """Balls on a circle in pockets of one plate, with a plain lid on them or without."""
    balls = [Manifold.sphere(0.002, 24).translate((0.012, 0.0, 0.0)).rotate((0.0, 0.0, 45.0 * k)) for k in range(8)]
    plate = rod(0.016, 0.004, (0.0, 0.0, -0.002), 64) - rod(0.008, 0.02, segments=64)
    for ball in balls:
        plate -= ball
    cover = rod(0.016, 0.004, (0.0, 0.0, 0.004), 64) - rod(0.008, 0.02, segments=64)
    return [("plate", plate), *([("lid", cover)] if lid else []), *((f"ball {k}", b) for k, b in enumerate(balls))]


def shaft_in_needles() -> list[Node]:
    """Rollers that run on a long shaft, in a housing."""
    housing = box((0.05, 0.05, 0.008)) - rod(0.0111, 0.02)
    return [("housing", housing), ("shaft", rod(0.0079, 0.06) - rod(0.005, 0.1)), *bearing()[2:]]


def planets() -> list[Node]:
    """Five wheels with teeth around a sun, in a ring."""
    tooth = box((0.001, 0.0005, 0.006), (0.0029, 0.0, 0.0))
    wheel = rod(0.0026, 0.006)
    for k in range(18):
        wheel += tooth.rotate((0.0, 0.0, 20.0 * k))
    wheels = [wheel.translate((0.0095, 0.0, 0.0)).rotate((0.0, 0.0, 72.0 * k)) for k in range(5)]
    ring, sun = rod(0.016, 0.006) - rod(0.0129, 0.02), rod(0.0061, 0.006) - rod(0.003, 0.02)
    return [("ring", ring), ("sun", sun), *((f"planet {k}", each) for k, each in enumerate(wheels))]


@pytest.mark.parametrize(
    "solids",
    [
        pins_in_pockets(),
        pins_in_a_plate(),
        balls_in_pockets(lid=False),
        balls_in_pockets(lid=True),
        shaft_in_needles(),
        planets(),
        [*bearing(elements=4)],
        [bearing()[0], *bearing()[2:]],
        [*bearing()[:2], *bearing()[2:7]],
    ],
    ids=["keys", "pins", "balls", "covered", "shaft", "planets", "four", "one-race", "one-side"],
)
def test_what_looks_like_a_bearing_and_is_none(tmp_path: Path, solids: list[Node]) -> None:
    foot = ("foot", box((0.03, 0.03, 0.004), (0.0, 0.0, -0.05)))
    parts = read_assembly(flat(tmp_path, *solids, foot))
    assert any(len(names) >= 4 for names in parts.identical)
    assert find_bought(parts) == ()


def test_what_a_bearing_is_in_is_no_bearing(tmp_path: Path) -> None:
    """A wheel with a bearing as a product of its own, and one whose bearing's parts lie loose in it."""
    tyre = rod(0.02, 0.008) - rod(0.013, 0.02)
    away = (0.06, 0.0, 0.0)
    root = (
        "all",
        [
            ("wheel", [("tyre", tyre), ("insert", bearing())]),
            ("other", [("tyre 2", tyre.translate(away)), *((f"in {n}", s) for n, s in bearing(away))]),
            ("shaft", rod(0.005, 0.06)),
        ],
    )
    whole = read_assembly(write_glb(tmp_path / "wheels.glb", root))
    kept = find_bought(whole)
    assert [(entry.product, len(entry.members)) for entry in kept] == [("insert", 0), ("in", 12)]
    merged = keep_together(whole, kept)
    assert merged.names == ("tyre", "insert", "tyre 2", "in", "shaft")
    assert [product.parts for product in merged.products] == [("tyre", "insert"), ("tyre 2", "in")]


@pytest.mark.parametrize("closed", [True, False])
def test_a_ball_that_cannot_leave_makes_a_bought_part(tmp_path: Path, *, closed: bool) -> None:
    cage = box((0.02, 0.02, 0.02)) - box((0.012, 0.012, 0.012 if closed else 0.05))
    ball = Manifold.sphere(0.005, 24)
    joint = [("cage", cage), ("ball", ball)]
    parts = read_assembly(
        write_glb(
            tmp_path / "j.glb", ("all", [("joint", joint), ("foot", box((0.03, 0.03, 0.004), (0.0, 0.0, -0.012)))])
        )
    )
    assert [entry.product for entry in find_bought(parts)] == (["joint"] if closed else [])


def test_two_uses_of_one_bearing_are_one_shape(tmp_path: Path) -> None:
    pair = [("608:1", bearing()), ("608:2", bearing((0.0, 0.0, 0.02)))]
    parts = read_assembly(
        write_glb(tmp_path / "pair.glb", ("all", [*pair, ("shaft", rod(0.005, 0.05, (0.0, 0.0, 0.01)))]))
    )
    whole = keep_together(parts, find_bought(parts))
    assert whole.names == ("608_1", "608_2", "shaft")
    assert whole.identical == (("608_1", "608_2"),)


def test_what_is_kept_is_the_users_word_and_must_exist(tmp_path: Path) -> None:
    parts = read_assembly(
        write_glb(tmp_path / "x.glb", ("all", [("unit a", bearing(elements=3)), ("shaft", rod(0.005, 0.03))]))
    )
    assert find_bought(parts) == ()
    (entry,) = find_bought(parts, keep=["unit*"])
    assert entry.reason == "wanted: --keep"
    with pytest.raises(InputError, match=r"--keep nosuch: no product is called so"):
        find_bought(parts, keep=["nosuch"])
    both = ("all", [("608", bearing(elements=3)), ("shaft", rod(0.005, 0.03))])
    alone = read_assembly(write_glb(tmp_path / "y.glb", both), config=ReadConfig(exclude=("shaft",)))
    assert alone.products == ()  # the product is all that there is


def test_a_bearing_is_planned_as_one_part_and_checked_as_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = write_glb(tmp_path / "block.glb", block())
    assert run(["plan", str(source), "--out", str(tmp_path / "out"), "--no-contacts"]) == OK
    assert "product UC like thing: one part, bought: a bearing, 10 rollers between races" in capsys.readouterr().out
    document = json.loads((tmp_path / "out" / "plan.json").read_text())
    assert [part["name"] for part in document["parts"]] == ["plate", "housing", "UC like thing", "shaft"]
    assert document["source"]["kept"] == [
        {"product": "UC like thing", "reason": "bought: a bearing, 10 rollers between races"}
    ]
    assert len(document["source"]["products"][0]["parts"]) == 12
    plan = read_plan(tmp_path / "out" / "plan.json")
    assert read_plan_input(plan, tmp_path / "out" / "plan.json").names == tuple(plan.parts)
    assert run(["verify", str(tmp_path / "out" / "plan.json")]) == OK


def test_a_bearing_alone_is_nothing_to_assemble(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = flat(tmp_path, *bearing())
    asked = ["plan", str(source), "--out", str(tmp_path / "out"), "--no-contacts"]
    assert run(asked) == BAD_INPUT
    said = capsys.readouterr().err
    assert "all 12 parts are one (bought: a bearing, 10 rollers between races): nothing to assemble" in said
    assert "--flat takes it apart" in said
    assert not (tmp_path / "out" / "plan.json").exists()
    assert run([*asked, "--flat"]) == OK


def test_keep_and_flat_contradict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = write_glb(tmp_path / "block.glb", block())
    asked = ["plan", str(source), "--out", str(tmp_path / "out"), "--keep", "UC*", "--flat"]
    assert run(asked) == BAD_INPUT
    assert "contradict" in capsys.readouterr().err
