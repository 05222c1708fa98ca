"""The shipped example: what the planner's users see first must be beyond doubt."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from sashimono.assembly import Assembly
from sashimono.io.read import read_assembly

SHAPES = {
    "case": 1, "plug_M10": 2, "bearing_608ZZ": 2, "pinion_shaft": 1, "bearing_6001ZZ": 2, "output_shaft": 1,
    "gear": 1, "key_4x4x14": 1, "cover": 1, "screw_M4x16": 4,
}  # fmt: skip


@pytest.fixture(scope="module")
def gearbox(gearbox_step: Path) -> Assembly:
    return read_assembly(gearbox_step)


def test_names_and_instances_come_from_the_product_tree(gearbox: Assembly) -> None:
    def shape(name: str) -> str:
        stem, _, last = name.rpartition("_")
        return stem if stem in SHAPES and last.isdigit() else name

    assert Counter(map(shape, gearbox.names)) == SHAPES
    repeated = sorted(len(group) for group in gearbox.identical)
    assert repeated == [2, 2, 2, 4]


def test_it_is_as_large_as_drawn_and_has_colours(gearbox: Assembly) -> None:
    size = 1e3 * (gearbox.bounds_world[1] - gearbox.bounds_world[0])
    assert size == pytest.approx([120.0, 84.0, 76.0], abs=0.1)
    assert all(part.color is not None for part in gearbox.parts)


def test_no_two_parts_overlap_and_nothing_needs_mending(gearbox: Assembly) -> None:
    assert gearbox.overlaps == ()
    assert gearbox.notes == ()


def test_it_is_small_enough_to_ship(gearbox_step: Path) -> None:
    assert gearbox_step.stat().st_size < 500_000
