"""The public functions and what a notebook shows."""

from __future__ import annotations

import html
from pathlib import Path

import pytest
from solids import assembly as assembled
from solids import box, box_with_lid, linked_rings
from truth_set import read_truth

import sashimono
from sashimono.disassembly.conditions.clauses import RemovalConditions


@pytest.fixture(scope="module")
def conditions() -> RemovalConditions:
    return sashimono.find_conditions(box_with_lid())


def test_conditions_by_name(conditions: RemovalConditions) -> None:
    assert set(conditions.blockers("content")) == {frozenset({"lid"}), frozenset({"shell"})}
    assert conditions.blockers("lid") == (frozenset(),)
    assert sashimono.count_orders(conditions).count == 4
    with pytest.raises(KeyError, match="absent"):
        conditions.blockers("absent")


def test_thoroughness_is_given_on() -> None:
    tunnel = read_truth("bent_tunnel").parts
    assert sashimono.find_conditions(tunnel).blockers("cube") == (frozenset(),)
    assert frozenset() not in sashimono.find_conditions(tunnel, thorough=0).blockers("cube")


def test_explanations_of_one_part_and_of_all_that_are_stuck() -> None:
    (one,) = sashimono.explain(box_with_lid(), "content")
    assert "stopped by lid" in "\n".join(sashimono.explanation_lines(one))
    assert sashimono.explain(box_with_lid()) == ()
    assert {entry.part for entry in sashimono.explain(linked_rings())} == {"first", "second"}


@pytest.mark.parametrize(("part", "fixed"), [("contents", None), (None, ["contents"])])
def test_a_name_that_is_not_there_is_one_clear_line(part: str | None, fixed: list[str] | None) -> None:
    with pytest.raises(sashimono.SashimonoError, match=r"no part 'contents'\. There is: content"):
        sashimono.explain(box_with_lid(), part, fixed)


@pytest.mark.parametrize("in_file", [False, True])
def test_results_are_written_whether_read_from_a_file_or_not(tmp_path: Path, in_file: bool) -> None:
    parts = read_truth("linked_rings").parts
    if in_file:
        (tmp_path / "in").mkdir()
        for part in parts.parts:
            lines = [f"v {x} {y} {z}" for x, y, z in part.vertices_world]
            lines += [f"f {a} {b} {c}" for a, b, c in part.faces + 1]
            (tmp_path / "in" / f"{part.name}.obj").write_text("\n".join(lines))
        parts = sashimono.read_assembly(tmp_path / "in", unit="m")
    plan = sashimono.plan_assembly(parts)
    written = sashimono.write_results(plan, parts, tmp_path / "out")
    assert [path.name for path in written] == ["plan.json", "plan.html", "plan.glb"]
    assert all(path.stat().st_size for path in written)
    assert sashimono.read_plan(written[0]).source.path == ("../in" if in_file else "")


def test_values_say_what_they_are(conditions: RemovalConditions) -> None:
    parts = box_with_lid()
    assert repr(parts) == "Assembly(3 parts: shell, content, lid, 60 × 60 × 44 mm)"
    assert repr(parts.part("content")) == "Part('content', 12 triangles, 20 × 20 × 20 mm)"
    assert repr(conditions) == "RemovalConditions(3 parts, 4 clauses)"
    plan = sashimono.plan_assembly(linked_rings(), config=sashimono.PipelineConfig(contacts=False))
    assert repr(plan).startswith("AssemblyPlan(partial, 1 of 2 parts placed: ")
    assert "; unsolved: " in repr(plan)
    assert repr(plan.steps[0]).startswith("Step('")


def test_a_notebook_shows_tables_and_pages() -> None:
    name = "<script>alert(1)</script>"
    parts = assembled(**{name: box((0.01, 0.01, 0.01)), "other": box((0.01, 0.01, 0.01), (0.0, 0.0, 0.01))})
    plan = sashimono.plan_assembly(parts)
    for shown in (parts, plan):
        table = shown._repr_html_()
        assert name not in table
        assert html.escape(name) in table
    for page in (sashimono.show(parts), sashimono.show(parts, plan, height=333)):
        frame = page._repr_html_()
        assert frame.startswith('<iframe srcdoc="')
        assert frame.count('"') == frame.replace("&quot;", "").count('"')
        assert html.unescape(frame.split('srcdoc="')[1].split('"')[0]) == page.content
        assert len(repr(page)) < 100
    assert "333" in sashimono.show(parts, plan, height=333)._repr_html_()


def test_types_are_shipped() -> None:
    assert (Path(sashimono.__file__).parent / "py.typed").is_file()


def test_a_loaded_plan_has_its_geometry_and_saves_pages(tmp_path: Path) -> None:
    parts = assembled(under=box((0.01, 0.01, 0.01)), over=box((0.01, 0.01, 0.01), (0.0, 0.0, 0.01)))
    (tmp_path / "parts").mkdir()
    for each in parts.parts:
        lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in 1e3 * each.vertices_world]
        lines += [f"f {a} {b} {c}" for a, b, c in each.faces + 1]
        (tmp_path / "parts" / f"{each.name}.obj").write_text("\n".join(lines))
    plan = sashimono.plan_assembly(sashimono.read_assembly(tmp_path / "parts", unit="mm"))
    sashimono.write_plan(plan, tmp_path / "plan.json")
    loaded = sashimono.load_plan(tmp_path / "plan.json")
    step = loaded.steps[-1]
    assert step.direction is not None
    assert (step.direction**2).sum() == pytest.approx(1.0)
    assert step.length > 0.0
    assert step.turns == 0.0
    assert loaded._repr_html_().startswith("<iframe srcdoc=")
    assert "<script" in loaded.save_html(tmp_path / "plan.html").read_text(encoding="utf-8")
    assert loaded.save_glb(tmp_path / "plan.glb").read_bytes().startswith(b"glTF")
    assert "Step 2" in loaded.save_manual(tmp_path / "manual.html").read_text(encoding="utf-8")
    (tmp_path / "parts" / "over.obj").rename(tmp_path / "parts" / "other.obj")
    with pytest.raises(sashimono.SashimonoError, match="has no part 'over'"):
        sashimono.load_plan(tmp_path / "plan.json")
