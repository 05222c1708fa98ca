"""Closed stand-ins: they contain the surface, say how far off they are, and are flagged wherever a plan is read."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold
from test_read import arrays, box, obj

from sashimono.cli import BAD_INPUT, OK, run
from sashimono.geometry.mesh import measures, topology
from sashimono.io.mending.stand_in import stand_in
from sashimono.io.plan_json import read_plan
from sashimono.io.raw import ReadConfig
from sashimono.io.read import read_assembly
from sashimono.verify import verify_file, verify_plan


def torn_cup() -> tuple[np.ndarray, np.ndarray]:
    """A cup without its rim: two shells, each of which ends in a circle of 40 edges."""
    cup = Manifold.cylinder(20.0, 10.0, circular_segments=40) - Manifold.cylinder(
        20.0, 8.0, circular_segments=40
    ).translate((0.0, 0.0, 3.0))
    vertices, faces = arrays(cup)
    top = (vertices[faces][:, :, 2] > 19.9).all(axis=1)
    return vertices, faces[~top]


def test_every_hole_is_covered_and_nothing_else_is_changed() -> None:
    vertices, faces = torn_cup()
    body = stand_in(1e-3 * vertices, faces, config=ReadConfig())
    assert body is not None
    assert body.how == "2 holes covered"
    assert topology.is_closed(body.surface.faces)
    filled = measures.volume(body.surface.vertices, body.surface.faces)
    # the rim inside the other is its hole: a ring is missing, 2 mm wide
    assert filled == pytest.approx(1e-9 * np.pi * (10.0**2 * 20.0 - 8.0**2 * 17.0), rel=0.01)
    assert 0.0008 < body.off < 0.0011


def test_a_hole_of_any_size_is_covered() -> None:
    vertices, faces = box(10.0, 10.0, 10.0)
    top = (vertices[faces][:, :, 2] > 9.9).all(axis=1)
    body = stand_in(1e-3 * vertices, faces[~top], config=ReadConfig())
    assert body is not None
    assert measures.volume(body.surface.vertices, body.surface.faces) == pytest.approx(1e-6)
    assert body.off == pytest.approx(0.005, rel=0.1)


def test_open_shells_whose_rims_branch_become_hulls() -> None:
    vertices, faces = box(10.0, 10.0, 10.0)
    fin = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [5.0, -6.0, 0.0]])  # a third triangle at an edge of the box
    both = np.concatenate([vertices, fin])
    a, b = (int(np.argmin(np.linalg.norm(vertices - corner, axis=1))) for corner in fin[:2])
    torn = np.concatenate([faces, [[a, b, len(vertices) + 2]]])
    body = stand_in(1e-3 * both, torn, config=ReadConfig())
    assert body is not None
    assert "convex hull" in body.how
    assert measures.volume(body.surface.vertices, body.surface.faces) > 1e-6
    assert body.surface.vertices[:, 1].min() == pytest.approx(-0.006)
    assert 0.0 < body.off < 0.006


def test_a_flat_sheet_has_no_stand_in() -> None:
    sheet = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0]])
    assert stand_in(sheet, np.array([[0, 1, 2]]), config=ReadConfig()) is None


@pytest.fixture
def torn(tmp_path: Path) -> Path:
    folder = tmp_path / "torn"
    folder.mkdir()
    (folder / "plate.obj").write_text(obj(*box(40.0, 40.0, 5.0, at=(-20.0, -20.0, -5.0))))
    (folder / "cup.obj").write_text(obj(*torn_cup()))
    return folder


def test_a_plan_with_a_stand_in_says_so_everywhere(
    torn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert run(["plan", str(torn), "--unit", "mm", "--no-contacts", "--out", str(out)]) == OK
    said = capsys.readouterr()
    assert "cup: mesh has 80 open edges; a closed stand-in is used, 2 holes covered, up to " in said.out + said.err
    document = json.loads((out / "plan.json").read_text())
    (entry,) = document["source"]["stand_ins"]
    assert (entry["part"], entry["how"]) == ("cup", "2 holes covered")
    assert "closed stand-in" in (out / "plan.html").read_text()
    report = verify_file(out / "plan.json")
    assert report.ok
    assert any("'cup' is checked by a closed stand-in" in note for note in report.notes)


def test_a_plan_that_hides_a_stand_in_is_refuted(torn: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run(["plan", str(torn), "--unit", "mm", "--no-contacts", "--out", str(out)]) == OK
    plan = read_plan(out / "plan.json")
    parts = read_assembly(torn, unit="mm", config=ReadConfig(stand_ins=True))
    assert verify_plan(plan, parts).ok
    hidden = replace(plan, source=replace(plan.source, stand_ins=()))
    assert any("'cup' is not closed" in problem for problem in verify_plan(hidden, parts).problems)


def test_without_stand_ins_open_parts_are_refused(
    torn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["plan", str(torn), "--unit", "mm", "--out", str(tmp_path / "out"), "--no-stand-ins"]
    assert run(asked) == BAD_INPUT
    assert "mesh has 80 open edges" in capsys.readouterr().err
