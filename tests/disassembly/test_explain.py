"""Why not: known obstacles, known depths, in words, as JSON, on the command line and as a page."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import numpy as np
import pytest
from solids import assembly, box, box_with_lid, linked_rings, rod

from sashimono.assembly import Assembly, Part
from sashimono.bodies import make_bodies
from sashimono.cli import BAD_INPUT, NO_PLAN, OK, run
from sashimono.disassembly.cascade import Cascade, SeparateConfig
from sashimono.disassembly.explanation.explain import BlockedDirection, Explanation, explain_part, explain_stuck
from sashimono.disassembly.explanation.obstruction import ObstructionConfig, find_obstruction
from sashimono.disassembly.explanation.report import direction_name, explanation_lines, explanations_as_dict
from sashimono.disassembly.translation.search import TranslationConfig
from sashimono.io.checks import find_overlaps
from sashimono.io.raw import ReadConfig
from sashimono.plan import Answer
from sashimono.view import write_explanation

CONFIG = SeparateConfig(translation=TranslationConfig(max_legs=20))


def cascade_of(parts: Assembly) -> Cascade:
    return Cascade(parts, make_bodies(parts), config=CONFIG)


def collared_peg(lip: float, radius: float = 0.005, clearance: float = 1e-4) -> Assembly:
    """A peg through a plate, with a collar on either side that is wider than the hole by ``lip``."""
    hole = radius + clearance
    plate = box((0.03, 0.03, 0.02)) - rod(hole, 0.04, segments=128)
    peg = rod(radius, 0.05, segments=128)
    for side in (-1.0, 1.0):
        peg += rod(hole + lip, 0.003, (0.0, 0.0, 0.0135 * side), segments=128)
    return assembly(plate=plate, peg=peg)


def along(found: Explanation, name: str) -> BlockedDirection:
    return next(entry for entry in found.directions if direction_name(entry.direction) == name)


@pytest.fixture(scope="module")
def content() -> Explanation:
    return explain_part(cascade_of(box_with_lid()), "content")


def test_the_content_is_stopped_by_the_lid_upwards(content: Explanation) -> None:
    assert content.answer is not Answer.FREE
    up = along(content, "+z")
    assert [blocker.part for blocker in up.blockers] == ["lid"]
    seen = up.blockers[0].obstruction
    assert seen is not None
    assert up.travel == pytest.approx(0.015, abs=1e-9)
    assert seen.depth == pytest.approx(0.004, abs=1e-9)
    assert seen.area == pytest.approx(0.02 * 0.02, rel=0.02)
    parts = box_with_lid()
    for faces, name, side in ((seen.faces_part, "content", 1.0), (seen.faces_obstacle, "lid", -1.0)):
        corners = parts.part(name).vertices_world[parts.part(name).faces[faces]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert len(faces) == 2
        assert (np.sign(normals[:, 2]) == side).all()
    assert along(content, "-z").travel == pytest.approx(0.0, abs=1e-9)
    assert set(content.removal_sets) == {("lid",), ("shell",)}
    assert content.easy_change is None


def test_against_the_fixed_parts_only() -> None:
    cascade = cascade_of(box_with_lid())
    found = explain_part(cascade, "content", ["shell"])
    assert found.answer is Answer.FREE
    assert explanation_lines(found) == ["content can leave: it leaves by one translation, at last along +z"]
    assert explain_stuck(cascade) == ()
    assert [entry.part for entry in explain_stuck(cascade, ["shell", "content", "lid"])] == ["content"]


@pytest.mark.parametrize("lip", [0.0003, 0.0006, 0.001])
def test_a_snap_lip_is_measured(lip: float) -> None:
    found = explain_part(cascade_of(collared_peg(lip)), "peg")
    assert found.easy_change is not None
    assert direction_name(found.easy_change.direction) in ("+z", "-z")
    assert found.easy_change.travel == pytest.approx(0.002, abs=1e-9)
    assert found.easy_change.change == pytest.approx(lip, abs=4e-5)
    words = explanation_lines(found)[-1]
    assert "widen the opening of plate by" in words
    assert "trim peg by" in words
    assert found.removal_sets == (), "the plate cannot go first: it is held by the peg"


def test_linked_rings_are_explained_among_themselves() -> None:
    found = explain_stuck(cascade_of(linked_rings()))
    assert [entry.part for entry in found] == ["first", "second"]
    for entry in found:
        assert entry.answer in (Answer.PROVEN_BLOCKED, Answer.UNKNOWN)
        assert entry.removal_sets == ()
        assert all(direction.blockers for direction in entry.directions)
        assert "no parts can be removed" in "\n".join(explanation_lines(entry))
    assert along(found[0], "+z").travel == pytest.approx(0.015, abs=1e-9)


def test_an_overlap_in_the_cad_is_named() -> None:
    """A block sunk 1 mm into a pocket's side walls, under a lid: the lid holds it, the overlap is told."""
    block = box((0.022, 0.02, 0.01))
    pocket = box((0.04, 0.04, 0.03)) - box((0.02, 0.0201, 0.02))
    parts = assembly(pocket=pocket, block=block)
    parts = Assembly(parts=parts.parts, overlaps=find_overlaps(list(parts.parts), ReadConfig()))
    assert len(parts.overlaps) == 1
    found = explain_part(cascade_of(parts), "block")
    assert found.overlaps == parts.overlaps
    assert "overlap in the CAD: pocket and block share" in "\n".join(explanation_lines(found))


def test_a_slanted_obstacle_and_no_obstacle() -> None:
    square = box((0.01, 0.01, 0.01))
    mesh = square.to_mesh64()
    vertices, faces = np.array(mesh.vert_properties[:, :3]), np.array(mesh.tri_verts, np.int32)
    config = ObstructionConfig(resolution=100)
    direction = np.array([0.6, 0.0, 0.8])
    ahead = find_obstruction(
        (vertices, faces), (vertices + 0.03 * direction, faces), direction, slack=0.0, config=config
    )
    assert ahead is not None
    # the longest line through a cube of 10 mm along (0.6, 0, 0.8) is 12.5 mm
    assert ahead.travel == pytest.approx(0.03 - 0.0125, abs=1e-4)
    assert ahead.depth == pytest.approx(0.0125, abs=1e-4)
    behind = find_obstruction(
        (vertices, faces), (vertices - 0.03 * direction, faces), direction, slack=0.0, config=config
    )
    assert behind is None
    beside = vertices + np.array([0.0, 0.02, 0.0])
    assert find_obstruction((vertices, faces), (beside, faces), direction, slack=0.0, config=config) is None


def test_a_rigid_motion_changes_nothing_but_the_direction(content: Explanation) -> None:
    from sashimono.geometry import se3

    T = se3.exp(np.array([0.1, -0.2, 0.3, 0.4, -0.5, 0.6]))
    moved = Assembly(
        parts=tuple(
            Part(name=p.name, vertices_part=p.vertices_part, faces=p.faces, T_world_part=T)
            for p in box_with_lid().parts
        )
    )
    found = explain_part(cascade_of(moved), "content")
    assert set(found.removal_sets) == set(content.removal_sets)
    up = next(entry for entry in found.directions if entry.direction @ T[:3, 2] > 0.999)
    assert up.travel == pytest.approx(along(content, "+z").travel, abs=1e-8)


def test_json_is_plain_and_complete(content: Explanation) -> None:
    written = json.loads(json.dumps(explanations_as_dict([content]), allow_nan=False))
    assert written["format"] == "sashimono.explanation"
    (entry,) = written["parts"]
    assert entry["part"] == "content"
    assert entry["answer"] in ("PROVEN_BLOCKED", "UNKNOWN")
    assert entry["fixed"] == ["shell", "lid"]
    assert ["lid"] in entry["removal_sets"]
    assert {"direction", "travel", "change", "blockers"} == set(entry["directions"][0])
    assert entry["text"] == explanation_lines(content)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The box with its lid as files, in millimetres."""
    source = tmp_path / "box"
    source.mkdir()
    for part in box_with_lid().parts:
        points = "".join("v {} {} {}\n".format(*p) for p in 1e3 * part.vertices_world)
        faces = "".join("f {} {} {}\n".format(*f) for f in part.faces + 1)
        (source / f"{part.name}.obj").write_text(points + faces)
    return source


def test_command_line(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    files = ["--json", str(out / "why.json"), "--html", str(out / "why.html")]
    assert run(["explain", str(folder), "--unit", "mm", "--part", "content", *files]) == NO_PLAN
    said = capsys.readouterr().out
    assert "along +z it gets 15 mm; stopped by lid" in said
    assert "remove first: " in said
    assert json.loads((out / "why.json").read_text())["parts"][0]["part"] == "content"
    assert "<script" in (out / "why.html").read_text()
    assert run(["explain", str(folder), "--unit", "mm", "--part", "content", "--fixed", "shell"]) == OK
    assert "content can leave" in capsys.readouterr().out
    assert run(["explain", str(folder), "--unit", "mm"]) == OK
    assert "every part can leave" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "says"), [(["--part", "contents"], "'contents'"), (["--part", "lid", "--fixed", "shell, top"], "'top'")]
)
def test_bad_names_are_one_clear_line(
    folder: Path, options: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["explain", str(folder), "--unit", "mm", *options]) == BAD_INPUT
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert options[-2] in line
    assert says in line
    assert "content" in line


def test_the_page_shows_what_is_in_the_way(content: Explanation, tmp_path: Path) -> None:
    path = Path(__file__).resolve().parents[2] / "docs" / "headless_chromium.py"
    spec = importlib.util.spec_from_file_location("headless_chromium", path)
    assert spec is not None
    assert spec.loader is not None
    headless = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(headless)
    executable = headless.find_chromium()
    if executable is None:
        pytest.skip("no Chromium installed (Debian: apt-get install chromium)")
    up = next(k for k, entry in enumerate(content.directions) if direction_name(entry.direction) == "+z")
    with headless.Page(executable, width=600, height=400) as page:
        page.open(write_explanation([content], box_with_lid(), tmp_path / "why.html"))
        page.screenshot()
        assert page.evaluate("sashimono.ready") is True
        page.evaluate(f"sashimono.show(0, {up})")
        assert page.evaluate("sashimono.highlighted") == 4
        assert [page.evaluate(f"sashimono.roleOf('{n}')") for n in ("content", "lid", "shell")] == [
            "part", "blocker", "other",
        ]  # fmt: skip
        assert "+z" in page.evaluate("document.getElementById('caption').textContent")
        assert "15 mm" in page.evaluate("document.querySelector('[aria-current=step]').textContent")
        page.evaluate("document.querySelectorAll('button.row')[0].click()")
        assert page.evaluate("sashimono.shown") == [0, 0]
        assert page.errors == []
        assert [url for url in page.requests if "why.html" not in url] == []
