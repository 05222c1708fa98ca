"""The product tree: read, planned as subassemblies, and said where that is not possible."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from nested import Node, write_3mf, write_glb
from solids import box, rod

from sashimono.assembly import Assembly, Product
from sashimono.cli import BAD_INPUT, OK, run  # noqa: F401
from sashimono.console import summary_lines
from sashimono.disassembly.sequence.greedy import SequenceConfig
from sashimono.disassembly.sequence.products import ProductConfig
from sashimono.exports import bill_table, step_table
from sashimono.io.plan_json import plan_from_json, plan_to_json
from sashimono.io.read import read_assembly
from sashimono.pipeline import PipelineConfig, plan_assembly
from sashimono.plan import AssemblyPlan, PlannedProduct
from sashimono.verify import verify_plan
from sashimono.view.manual.content import make_manual

QUICK = PipelineConfig(contacts=False)
PLATE = box((0.06, 0.06, 0.01), (0.0, 0.0, -0.005))
BLOCK = box((0.02, 0.02, 0.02), (0.0, 0.0, 0.01)) - rod(0.004, 0.02, (0.0, 0.0, 0.015))
PIN = rod(0.004, 0.02, (0.0, 0.0, 0.015))


def tower() -> Node:
    """A block with a pin in it, drawn as one product, on a plate, with a cube beside it."""
    cube = box((0.01, 0.01, 0.01), (0.022, 0.0, 0.005))
    return ("bench", [("plate", PLATE), ("tower v2:1", [("block", BLOCK), ("pin", PIN)]), ("cube", cube)])


def axle(*, loose_head: bool) -> Node:
    """A rod through a wall with a collar at either end, the left one in one piece with the rod unless it is loose."""
    along_x = [0.0, 90.0, 0.0]
    wall = box((0.01, 0.04, 0.04)) - rod(0.004, 0.03).rotate(along_x)
    shaft, ring = rod(0.004, 0.04).rotate(along_x), (rod(0.01, 0.006) - rod(0.004, 0.01)).rotate(along_x)
    left, right = ring.translate((-0.01, 0.0, 0.0)), ring.translate((0.01, 0.0, 0.0))
    inside = [("rod", shaft), ("left", left)] if loose_head else [("rod", shaft + left)]
    return ("frame", [("wall", wall), ("axle", [*inside, ("right", right)])])


def read(tmp_path: Path, root: Node, write: Callable[[Path, Node], Path] = write_glb) -> Assembly:
    return read_assembly(write(tmp_path / f"product{'.3mf' if write is write_3mf else '.glb'}", root))


def planned(plan: AssemblyPlan) -> dict[str, str]:
    return {entry.name: entry.planned for entry in plan.products}


@pytest.mark.parametrize("write", [write_glb, write_3mf])
def test_nested_products_are_read_with_their_parts(tmp_path: Path, write: Callable[[Path, Node], Path]) -> None:
    parts = read(
        tmp_path,
        ("all", [("a", PLATE), ("outer", [("wrap", [("b", BLOCK), ("in", [("c", PIN), ("d", PIN)])])])]),
        write,
    )
    assert parts.names == ("a", "b", "c", "d")
    # what holds nothing but another product is the same as that, by its outer name
    assert parts.products == (Product(name="outer", parts=("b", "c", "d")), Product(name="in", parts=("c", "d")))
    assert parts.source is not None
    assert parts.source.products == parts.products


def test_two_uses_of_one_product_have_names_of_their_own(tmp_path: Path) -> None:
    pair = [("block", BLOCK), ("pin", PIN)]
    parts = read(tmp_path, ("all", [("plate", PLATE), ("pair:1", pair), ("pair:2", pair)]))
    assert [(p.name, p.parts) for p in parts.products] == [
        ("pair_1", ("block_1", "pin_1")),
        ("pair_2", ("block_2", "pin_2")),
    ]


def test_the_examples_groups_are_read_from_step() -> None:
    parts = read_assembly(Path(__file__).parent.parent / "src/sashimono/examples/gearbox.step")
    assert {product.name: len(product.parts) for product in parts.products} == {
        "housing": 3, "input": 3, "output": 5, "lid": 5,
    }  # fmt: skip


def test_a_product_is_put_together_on_a_bench_and_brought_as_one(tmp_path: Path) -> None:
    parts = read(tmp_path, tower())
    plan = plan_assembly(parts, config=QUICK)
    assert plan.status == "complete"
    assert plan.products == (PlannedProduct(name="tower v2", parts=("block", "pin"), planned="subassembly"),)
    (step,) = [step for step in plan.steps if step.moving]
    assert step.product == "tower v2"
    assert set(step.moving) == {"block", "pin"}
    assert step.subassembly is not None
    assert [inner.part for inner in step.subassembly.steps] == ["block", "pin"]
    assert verify_plan(plan, parts).ok
    assert plan_to_json(plan_from_json(plan_to_json(plan))) == plan_to_json(plan)


def test_names_of_the_tree_lead_in_lists_and_tables(tmp_path: Path) -> None:
    parts = read(tmp_path, tower())
    plan = plan_assembly(parts, config=QUICK)
    lines = summary_lines(plan, parts)
    assert any(line.split()[1:3] == ["tower", "v2"] and "subassembly of 2" in line for line in lines)
    assert "product tower v2: put together on a bench of its own" in lines
    head, *rows = bill_table(plan, parts, ())
    assert {row[head.index("part")]: row[head.index("products")] for row in rows} == {
        "plate": "", "block": "tower v2", "pin": "tower v2", "cube": "",
    }  # fmt: skip
    head, *rows = step_table(plan, parts, ())
    assert [row[head.index("product")] for row in rows if row[head.index("product")]] == ["tower v2"]
    assert [chapter.product for chapter in make_manual(plan, parts).chapters] == ["tower v2", ""]


def test_flat_takes_all_apart(tmp_path: Path) -> None:
    parts = read(tmp_path, tower())
    flat = PipelineConfig(contacts=False, sequence=SequenceConfig(products=ProductConfig(enabled=False)))
    plan = plan_assembly(parts, config=flat)
    assert planned(plan) == {"tower v2": "apart"}
    assert not any(step.moving for step in plan.steps)
    bare = Assembly(parts=parts.parts, source=parts.source, overlaps=parts.overlaps, identical=parts.identical)
    assert plan_assembly(bare, config=flat).order == plan.order


def test_a_product_that_does_not_get_in_as_one_is_taken_apart_and_says_so(tmp_path: Path) -> None:
    parts = read(tmp_path, axle(loose_head=False))
    plan = plan_assembly(parts, config=QUICK)
    assert plan.status == "complete"
    (entry,) = plan.products
    assert (entry.name, entry.planned) == ("axle", "apart")
    assert "does not leave as one" in entry.reason
    assert verify_plan(plan, parts).ok


def test_a_product_of_loose_parts_is_none(tmp_path: Path) -> None:
    cubes = [(f"cube {side}", box((0.01, 0.01, 0.01), (x, 0.0, 0.005))) for side, x in (("a", -0.02), ("b", 0.02))]
    plan = plan_assembly(read(tmp_path, ("all", [("plate", PLATE), ("cubes", cubes)])), config=QUICK)
    (entry,) = plan.products
    assert entry.planned == "apart"
    assert "does not hang together" in entry.reason


def test_the_product_with_the_base_in_it_is_put_together_first(tmp_path: Path) -> None:
    posts = [(f"post {k}", rod(0.003, 0.01, (x, 0.02, 0.005))) for k, x in enumerate((-0.02, 0.02))]
    plan = plan_assembly(
        read(tmp_path, ("all", [("frame", [("plate", PLATE), *posts]), ("block", BLOCK), ("pin", PIN)])), config=QUICK
    )
    assert planned(plan) == {"frame": "base"}
    assert set(plan.order[:3]) == {"plate", "post 0", "post 1"}


def test_a_collar_that_goes_on_last_is_left_out_of_its_product(tmp_path: Path) -> None:
    parts = read(tmp_path, axle(loose_head=True))
    plan = plan_assembly(parts, config=QUICK)
    assert plan.status == "complete"
    (entry,) = plan.products
    (later,) = {"left", "right"} & set(plan.order)
    assert (entry.planned, entry.reason) == ("subassembly", f"without {later}, put on later")
    assert plan.order[-1] == later
    assert verify_plan(plan, parts).ok


def test_the_lids_screws_come_after_it() -> None:
    """What a product's own fasteners join to others comes later; a lid without its screws is a single part."""
    parts = read_assembly(Path(__file__).parent.parent / "src/sashimono/examples/gearbox.step")
    plan = plan_assembly(parts, config=QUICK)
    kinds = {entry.name: entry for entry in plan.products}
    assert kinds["housing"].planned == "base"
    assert kinds["input"].planned == "subassembly"
    assert "come later" in kinds["lid"].reason
    assert plan.status == "complete"
