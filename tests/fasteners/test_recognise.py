"""Fasteners in assemblies: by shape and by where they sit; what they clamp, and what comes before what."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hardware import MM, circlip, cylinder, nut, plate, ring, screw, threaded
from scipy.spatial.transform import Rotation
from solids import assembly, box, rod

from sashimono.assembly import Assembly
from sashimono.disassembly.conditions.added import added_as_dict, with_precedence
from sashimono.disassembly.conditions.clauses import Clause, RemovalConditions
from sashimono.disassembly.conditions.orders import iterate_orders
from sashimono.disassembly.removal import Removal
from sashimono.fasteners.precedence import precedence
from sashimono.fasteners.recognise import Fastener, find_fasteners
from sashimono.fasteners.report import fastener_lines, fasteners_as_dict
from sashimono.io.read import read_assembly

LABELS = json.loads((Path(__file__).parent / "labels.json").read_text(encoding="utf-8"))


def bolted() -> Assembly:
    """A bolt with a washer at either end through two plates, and its nut. From the head down."""
    return assembly(
        bolt=screw(6 * MM, 30 * MM, "hex").translate((0.0, 0.0, 1.6 * MM)),
        washer_head=ring(6.4 * MM, 12 * MM, 1.6 * MM),
        top=plate(8 * MM, 6.6 * MM, -8 * MM),
        bottom=plate(8 * MM, 6.6 * MM, -16 * MM),
        washer_nut=ring(6.4 * MM, 12 * MM, 1.6 * MM).translate((0.0, 0.0, -17.6 * MM)),
        nut=nut(6 * MM, 10 * MM, 5 * MM).translate((0.0, 0.0, -22.6 * MM)),
    )


def screwed_down(*, ridges: bool = False) -> Assembly:
    """A cover screwed on a base, and a peg beside that stands in a blind hole."""
    base = box((40 * MM, 40 * MM, 20 * MM), (0.0, 0.0, -15 * MM))
    base -= cylinder(6 * MM, 15 * MM, -18 * MM) + cylinder(8 * MM, 7 * MM, -11 * MM).translate((14 * MM, 0.0, 0.0))
    cover = plate(5 * MM, 6.6 * MM, -5 * MM, width=20 * MM)
    shaft = threaded(6 * MM, 16 * MM, 1 * MM) + screw(6 * MM, 1 * MM * 4, "hex socket") if ridges else None
    return assembly(
        base=base,
        cover=cover,
        screw=shaft or screw(6 * MM, 16 * MM, "hex socket"),
        peg=cylinder(8 * MM, 30 * MM, -11 * MM).translate((14 * MM, 0.0, 0.0)),
    )


def by_name(found: tuple[Fastener, ...]) -> dict[str, Fastener]:
    return {f.part: f for f in found}


def test_a_bolt_its_nut_and_washers_and_their_order() -> None:
    product = bolted()
    found = by_name(find_fasteners(product))
    kinds = {name: f.kind for name, f in found.items()}
    assert kinds == {"bolt": "bolt", "washer_head": "washer", "washer_nut": "washer", "nut": "nut"}
    bolt = found["bolt"]
    assert (bolt.size, bolt.tool, bolt.clamps, bolt.into, bolt.nuts) == (
        "M6",
        "wrench 10 mm",
        ("top", "bottom"),
        (),
        ("nut",),
    )
    assert dict(bolt.washers) == {"washer_head": False, "washer_nut": True}
    assert bolt.axis @ [0.0, 0.0, -1.0] > 0.9999
    assert bolt.point == pytest.approx([0.0, 0.0, 1.6 * MM], abs=1e-5)
    assert found["nut"].axis @ [0.0, 0.0, 1.0] > 0.9999
    pairs = precedence(product, tuple(found.values()))
    for pair in [
        ("top", "bolt"), ("bottom", "bolt"), ("top", "washer_head"), ("washer_head", "bolt"), ("bolt", "washer_nut"),
        ("bolt", "nut"), ("washer_nut", "nut"), ("bottom", "nut"),
    ]:  # fmt: skip
        assert pair in pairs
    assert not any((b, a) in pairs for a, b in pairs)


def conditions_of(names: str, blockers: list[list[int]]) -> RemovalConditions:
    """Conditions whose parts have one letter each, and these masks of blockers."""
    away = Removal(displacements=np.eye(4)[None], exit_direction=np.array([0.0, 0.0, 1.0]))
    clauses = tuple(tuple(Clause(blockers=mask, removal=away) for mask in masks) for masks in blockers)
    return RemovalConditions(names=tuple(names), clauses=clauses)


def test_the_orders_that_remain_are_those_that_keep_to_the_pairs() -> None:
    # a leaves once b or c has left, d once a has left
    conditions = conditions_of("abcd", [[0b0010, 0b0100], [0], [0], [0b0001]])
    pairs = {("b", "c"), ("a", "b")}
    kept = [
        order
        for order in iterate_orders(conditions)
        if order.index(2) < order.index(1) and order.index(1) < order.index(0)
    ]
    constrained = with_precedence(conditions, pairs)
    assert sorted(iterate_orders(constrained)) == sorted(kept)
    assert len(constrained.clauses[0]) == 1  # {b, c} contains {b}
    added = added_as_dict(conditions, {*pairs, ("a", "d")})
    assert added["orders"] == 0
    assert added["stuck"] == ["a", "d"]
    added = added_as_dict(conditions, pairs)
    assert added == {
        "precedence": [["a", "b"], ["b", "c"]], "orders": len(kept), "orders_reason": "", "stuck": [],
    }  # fmt: skip
    # what geometry implies is not said again
    assert added_as_dict(conditions, {("d", "a")})["precedence"] == []


@pytest.mark.parametrize("ridges", [False, True])
def test_a_screw_says_whether_its_thread_was_found(ridges: bool) -> None:
    product = screwed_down(ridges=ridges)
    found = by_name(find_fasteners(product))
    assert set(found) == {"screw"}  # a peg that stands out is no pin
    f = found["screw"]
    assert (f.kind, f.clamps, f.into, f.tool) == ("screw", ("cover",), ("base",), "hex key 5 mm")
    assert (f.thread_pitch is not None) == ridges
    assert ("pushed: no thread found" in fastener_lines([f])[0]) != ridges
    assert precedence(product, [f]) == {("cover", "screw"), ("base", "screw")}


def test_a_head_without_drive_counts_where_it_clamps() -> None:
    base = box((40 * MM, 40 * MM, 20 * MM), (0.0, 0.0, -15 * MM)) - cylinder(6 * MM, 30 * MM, -18 * MM)
    cover = plate(5 * MM, 6.6 * MM, -5 * MM)
    plain = screw(6 * MM, 16 * MM, "none")
    assert [f.kind for f in find_fasteners(assembly(base=base, cover=cover, s=plain))] == ["screw"]
    assert find_fasteners(assembly(base=base, s=plain.translate((0.0, 0.0, 2 * MM)))) == ()


def test_a_shaft_with_a_collar_is_no_screw() -> None:
    bearing = box((40 * MM, 40 * MM, 10 * MM), (0.0, 0.0, -15 * MM)) - rod(3 * MM, 1.0)
    wheel = ring(6 * MM, 30 * MM, 8 * MM).translate((0.0, 0.0, -8 * MM))
    for length in (19 * MM, 30 * MM):
        shaft = cylinder(6 * MM, length, -length) + cylinder(10 * MM, 4 * MM)
        assert find_fasteners(assembly(bearing=bearing, wheel=wheel, a=shaft)) == ()


def test_a_dowel_and_a_shaft() -> None:
    blocks = [box((20 * MM, 20 * MM, 10 * MM), (0.0, 0.0, z)) - rod(2.5 * MM, 1.0) for z in (-5 * MM, 5 * MM)]
    pinned = assembly(low=blocks[0], high=blocks[1], a=cylinder(5 * MM, 18 * MM, -9 * MM))
    (pin,) = find_fasteners(pinned)
    assert (pin.kind, set(pin.into)) == ("pin", {"low", "high"})
    shaft = assembly(low=blocks[0], high=blocks[1], a=cylinder(5 * MM, 60 * MM, -30 * MM))
    assert find_fasteners(shaft) == ()
    # the name breaks the tie: the same short bar, called a shaft
    named = Assembly(parts=(*pinned.parts[:2], replace(pinned.parts[2], name="gear_shaft")))
    assert find_fasteners(named) == ()


def test_names_decide_nothing_alone() -> None:
    product = screwed_down()
    renamed = Assembly(parts=tuple(replace(p, name=f"m6_screw_{k}") for k, p in enumerate(product.parts)))
    assert [f.part for f in find_fasteners(renamed)] == ["m6_screw_2"]


def test_a_circlip_comes_after_what_it_holds() -> None:
    shaft = rod(5 * MM, 60 * MM) - ring(9 * MM, 30 * MM, 1.2 * MM).translate((0.0, 0.0, 10 * MM))
    wheel = ring(10.2 * MM, 40 * MM, 10 * MM)
    product = assembly(shaft=shaft, wheel=wheel, clip=circlip(9.2 * MM, 13 * MM, 1 * MM).translate((0.0, 0.0, 10 * MM)))
    (clip,) = find_fasteners(product)
    assert (clip.kind, clip.into, clip.clamps) == ("circlip", ("shaft",), ("wheel",))
    assert precedence(product, [clip]) == {("shaft", "clip"), ("wheel", "clip")}


def test_turning_and_scaling_the_whole_changes_only_the_sizes() -> None:
    product = bolted()
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([0.3, 1.1, -0.4]).as_matrix()
    T[:3, 3] = 0.2, -0.1, 0.3
    turned = Assembly(parts=tuple(replace(p, T_world_part=T @ p.T_world_part) for p in product.parts))
    big = Assembly(parts=tuple(replace(p, vertices_part=25.4 * p.vertices_part) for p in product.parts))
    before = find_fasteners(product)
    for other in (find_fasteners(turned), find_fasteners(big)):
        assert [(f.part, f.kind, f.clamps, f.nuts, f.washers) for f in other] == [
            (f.part, f.kind, f.clamps, f.nuts, f.washers) for f in before
        ]
    assert [f.size for f in find_fasteners(turned)] == [f.size for f in before]


def test_labels_are_kinds_and_enough() -> None:
    kinds = [kind for own in LABELS.values() for kind in own.values()]
    assert set(kinds) <= {"screw", "bolt", "nut", "washer", "pin", "standoff", "circlip", "none"}
    assert len(kinds) >= 150
    assert sum(kind != "none" for kind in kinds) >= 75


@pytest.mark.parametrize(
    "name", ["pythonocc_demos_as1_oc_214", "telescope_sync_assembly", "micromanipulatorstepper_steppermotornema17"]
)
def test_real_fasteners_are_found_as_labelled(assemblies_folder: Path, name: str) -> None:
    found = {f.part: f.kind for f in find_fasteners(read_assembly(assemblies_folder / name, unit="mm"))}
    for part, kind in LABELS[name].items():
        assert found.get(part, "none") == kind, part


def test_what_is_written() -> None:
    written: Any = fasteners_as_dict(find_fasteners(bolted()))
    assert [entry["part"] for entry in written["fasteners"]] == ["bolt", "washer_head", "washer_nut", "nut"]
    bolt = written["fasteners"][0]
    assert (bolt["kind"], bolt["size"], bolt["tool"], bolt["thread_pitch"]) == ("bolt", "M6", "wrench 10 mm", None)
    assert bolt["washers"] == [
        {"part": "washer_head", "nut_side": False},
        {"part": "washer_nut", "nut_side": True},
    ]
