"""The doctor: what it finds in solids whose faults are known, in words, as JSON and in its page."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hardware import MM, cylinder, hexagon, plate, screw, threaded
from solids import Manifold, box, rod

import sashimono
from sashimono.cli import BAD_INPUT, DIFFERS, OK, run
from sashimono.examination import Diagnosis, diagnosis_as_dict, diagnosis_lines, examine
from sashimono.io.read import inspect_assembly


def write_folder(folder: Path, *, scale: float = 1e3, **solids: Manifold) -> Path:
    """Write solids in place as OBJ files in millimetres (or metres times ``scale``)."""
    folder.mkdir(exist_ok=True)
    for name, solid in solids.items():
        mesh = solid.to_mesh64()
        write_obj(folder / f"{name}.obj", np.array(mesh.vert_properties)[:, :3] * scale, np.array(mesh.tri_verts))
    return folder


def write_obj(path: Path, vertices: np.ndarray, faces: np.ndarray) -> None:
    lines = ["v {} {} {}".format(*row) for row in vertices.tolist()]
    lines += ["f {} {} {}".format(*(row + 1)) for row in faces]
    path.write_text("\n".join(lines) + "\n")


def open_box(path: Path, size: float, at: tuple[float, float, float]) -> None:
    """Write a box in millimetres that lacks one side."""
    mesh = box((size, size, size), at).to_mesh64()
    faces = np.array(mesh.tri_verts).astype(np.int64)
    vertices = np.array(mesh.vert_properties)[:, :3]
    top = vertices[faces][:, :, 2].min(axis=1) > at[2]
    write_obj(path, vertices, faces[~top & (np.arange(len(faces)) > 0)])


def look(folder: Path, **solids: Manifold) -> Diagnosis:
    return examine(inspect_assembly(write_folder(folder, **solids)))


def kinds(found: Diagnosis, severity: str) -> list[tuple[str, tuple[str, ...]]]:
    return [(each.kind, each.parts) for each in found.findings if each.severity == severity]


def test_a_sound_assembly_has_nothing_in_the_way(tmp_path: Path) -> None:
    found = look(tmp_path / "in", base=box((0.04, 0.04, 0.01)), block=box((0.02, 0.02, 0.02), (0.0, 0.0, 0.015)))
    assert found.ok
    assert found.findings == ()
    assert found.size_words == "40 × 40 × 30 mm: plausible for mm, as none is stated"
    assert found.touching == {"base": ("block",), "block": ("base",)}
    assert [each.how for each in found.treatments] == ["planned as it is"] * 2
    assert diagnosis_lines(found)[-1] == "nothing stands in the way of a plan, no warnings"


def test_the_worst_of_everything(tmp_path: Path) -> None:
    hollow = box((0.03, 0.03, 0.03), (0.1, 0.0, 0.015)) - box((0.02, 0.02, 0.02), (0.1, 0.0, 0.015))
    folder = write_folder(
        tmp_path / "in",
        base=box((0.3, 0.1, 0.01), (0.0, 0.0, -0.005)),
        block=box((0.02, 0.02, 0.02), (0.0, 0.0, 0.01)),
        block_copy=box((0.02, 0.02, 0.02), (0.0, 0.0, 0.01)),
        hollow=hollow,
        kernel=box((0.008, 0.01, 0.012), (0.1, 0.0, 0.012)),
        seed=box((0.005, 0.006, 0.004), (-0.1, 0.0, -0.005)),
        sunk=box((0.02, 0.02, 0.02), (-0.05, 0.0, 0.006)),
        cloud=box((0.01, 0.01, 0.01), (0.0, 0.0, 0.1)),
    )
    open_box(folder / "torn.obj", 20.0, (50.0, 0.0, 10.0))
    found = examine(inspect_assembly(folder))
    assert not found.ok
    assert sorted(kinds(found, "error")) == [
        ("duplicate", ("block", "block_copy")),
        ("hidden", ("kernel", "hollow")),
        ("inside", ("seed", "base")),
        ("surface", ("torn",)),
    ]
    assert ("overlap", ("base", "sunk")) in kinds(found, "warning")
    assert ("floating", ("cloud",)) in kinds(found, "warning")
    sunk = next(pair for pair in found.overlaps if pair.second == "sunk")
    assert sunk.guess == "drawing error"
    assert sunk.depth == pytest.approx(0.004, rel=0.02)
    assert sunk.fraction == pytest.approx(0.2)
    refused = {each.part: each.how for each in found.treatments if not each.planned}
    assert set(refused) == {"block_copy", "kernel", "seed", "torn"}
    assert "open edge" in refused["torn"]
    assert diagnosis_lines(found)[-1].startswith("4 things in the way of a plan, ")


def test_parts_that_nobody_sees(tmp_path: Path) -> None:
    lower = box((0.05, 0.05, 0.03), (0.0, 0.0, -0.015)) - box((0.03, 0.03, 0.03), (0.0, 0.0, 0.0))
    upper = box((0.05, 0.05, 0.03), (0.0, 0.0, 0.015)) - box((0.03, 0.03, 0.03), (0.0, 0.0, 0.0))
    found = look(tmp_path / "in", lower=lower, upper=upper, ball=Manifold.sphere(0.015, 48))
    assert kinds(found, "note")[0] == ("hidden", ("ball",))
    holed = look(tmp_path / "holed", lower=lower, upper=upper - rod(0.005, 0.1), ball=Manifold.sphere(0.015, 48))
    assert "hidden" not in dict(kinds(holed, "note"))


def test_groups_that_touch_nowhere(tmp_path: Path) -> None:
    cubes = {f"c{k}": box((0.01, 0.01, 0.01), (x, 0.0, 0.0)) for k, x in enumerate((0.0, 0.01, 0.05, 0.06, 0.07))}
    found = look(tmp_path / "in", **cubes)
    assert [kind for kind, _ in kinds(found, "warning")] == ["groups"]
    assert "2 groups that touch nowhere: 3 parts with c" in found.findings[0].message


@pytest.mark.parametrize(
    ("radius", "guess"),
    [(5.0 * 0.88, "thread"), (5.0 * 0.97, "press fit")],
)
def test_guesses_of_round_overlaps(radius: float, guess: str, tmp_path: Path) -> None:
    hole = box((0.03, 0.03, 0.02)) - rod(1e-3 * radius, 0.05, segments=96)
    found = look(tmp_path / "in", hole=hole, shaft=rod(0.005, 0.03, segments=96))
    assert [pair.guess for pair in found.overlaps] == [guess]
    assert found.overlaps[0].depth == pytest.approx(0.005 - 1e-3 * radius, rel=0.05)
    assert found.ok


def test_a_tiny_clearance_is_named_and_a_wide_one_is_not(tmp_path: Path) -> None:
    for gap, count in ((3e-5, 1), (1e-3, 0)):
        hole = box((0.03, 0.03, 0.02)) - rod(0.005 + gap, 0.05, segments=96)
        shaft, foot = rod(0.005, 0.02, segments=96), box((0.05, 0.05, 0.01), (0.0, 0.0, -0.015))
        found = look(tmp_path / str(gap), hole=hole, shaft=shaft, foot=foot)
        assert len(found.clearances) == count
        if count:
            assert found.clearances[0].gap == pytest.approx(gap, rel=0.1)


def test_fasteners_and_what_becomes_of_them(tmp_path: Path) -> None:
    m6 = screw(6 * MM, 20 * MM, "hex socket")
    found = look(tmp_path / "in", lid=plate(8 * MM, 6.6 * MM, -8 * MM), body=plate(20 * MM, 5 * MM, -28 * MM), m6=m6)
    assert [(each.part, each.size) for each in found.fasteners] == [("m6", "M6")]
    assert [pair.guess for pair in found.overlaps] == ["thread"]
    how = {each.part: each.how for each in found.treatments}
    assert how["m6"] == "screw M6: pushed along its axis, as no thread is drawn; --declare-threads turns it"


def test_a_unit_that_makes_it_too_large_or_screws_that_are_not_metric(tmp_path: Path) -> None:
    solids = {"base": box((0.04, 0.04, 0.01)), "block": box((0.02, 0.02, 0.02), (0.0, 0.0, 0.015))}
    found = examine(inspect_assembly(write_folder(tmp_path / "in", **solids), unit="m"))
    assert [kind for kind, _ in kinds(found, "warning")] == ["unit"]
    assert "It would be 40 × 40 × 30 mm in mm" in found.findings[0].message
    row = {f"s{k}": screw(6 * MM, 20 * MM, "hex socket").translate((k * 20 * MM, 0.0, 0.0)) for k in range(3)}
    folder = write_folder(tmp_path / "screws", base=box((0.1, 0.02, 0.01), (0.02, 0.0, -0.02)), **row)
    said = str(examine(inspect_assembly(folder, unit="in")).findings)
    assert "no screw has a metric size in in; in mm, 3 of 3 would" in said
    assert "metric" not in str(examine(inspect_assembly(folder, unit="mm")).findings)


def test_json_and_exit_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = write_folder(
        tmp_path / "in", base=box((0.04, 0.04, 0.01)), block=box((0.02, 0.02, 0.02), (0.0, 0.0, 0.015))
    )
    target = tmp_path / "out.json"
    assert run(["doctor", str(folder), "--json", str(target)]) == OK
    written = json.loads(target.read_text())
    assert written["format"] == "sashimono.doctor"
    assert written["ok"] is True
    assert written["size"] == pytest.approx([0.04, 0.04, 0.03])
    open_box(folder / "torn.obj", 10.0, (0.0, 0.0, 30.0))
    assert run(["doctor", str(folder), "--json", str(target)]) == DIFFERS
    written = json.loads(target.read_text())
    assert written == diagnosis_as_dict(examine(inspect_assembly(folder)))
    assert (written["findings"][0]["kind"], written["findings"][0]["severity"]) == ("surface", "error")
    capsys.readouterr()
    assert run(["doctor", str(folder), "--exclude", "torn"]) == OK
    assert "nothing stands in the way" in capsys.readouterr().out
    assert run(["doctor", str(folder), "--exclude", "nothing*"]) == BAD_INPUT


def test_every_part_is_broken(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for k in range(2):
        open_box(folder / f"torn{k}.obj", 10.0, (20.0 * k, 0.0, 0.0))
    found = examine(inspect_assembly(folder))
    assert not found.ok
    assert len(found.broken) == 2
    assert [each.planned for each in found.treatments] == [False, False]


def test_threads_that_are_drawn_are_turned(tmp_path: Path) -> None:
    head = cylinder(10 * MM, 6 * MM) - hexagon(5 * MM, 6 * MM, 3 * MM)
    m6 = threaded(6 * MM, 20 * MM, 1 * MM) + head
    found = look(tmp_path / "in", lid=plate(8 * MM, 6.6 * MM, -8 * MM), body=plate(20 * MM, 5 * MM, -28 * MM), m6=m6)
    how = {each.part: each.how for each in found.treatments}
    assert how["m6"] == "screw M6: turned along the thread that is drawn"


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    path = Path(__file__).resolve().parents[2] / "docs" / "headless_chromium.py"
    spec = importlib.util.spec_from_file_location("headless_chromium", path)
    assert spec is not None
    assert spec.loader is not None
    headless = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(headless)
    executable = headless.find_chromium()
    if executable is None:
        pytest.skip("no Chromium installed (Debian: apt-get install chromium)")
    with headless.Page(executable, width=700, height=450) as page:
        yield page


def test_the_page_shows_what_a_line_is_about(browser: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    base = box((0.3, 0.1, 0.01), (0.0, 0.0, -0.005))
    sunk = box((0.02, 0.02, 0.02), (-0.05, 0.0, 0.006))
    folder = write_folder(tmp_path / "in", base=base, sunk=sunk)
    open_box(folder / "torn <b> & 'x'.obj", 20.0, (50.0, 0.0, 10.0))
    page = tmp_path / "page.html"
    assert run(["doctor", str(folder), "--html", str(page)]) == DIFFERS
    assert str(page) in capsys.readouterr().out
    browser.open(page)
    browser.screenshot()
    assert browser.evaluate("sashimono.ready")
    torn = "torn <b> & 'x'"
    assert browser.evaluate("sashimono.names") == ["base", "sunk", torn]
    assert browser.evaluate("sashimono.shown") == "finding 0"
    assert browser.evaluate(f"sashimono.roleOf({json.dumps(torn)})") == "wrong"
    assert browser.evaluate("sashimono.roleOf('base')") == "faint"
    # every line and every button can be used
    keys = browser.evaluate("sashimono.keys")
    assert browser.evaluate("document.querySelectorAll('button.row').length") == len(keys)
    for k, key in enumerate(keys):
        browser.evaluate(f"document.querySelectorAll('button.row')[{k}].click()")
        assert browser.evaluate("sashimono.shown") == key
    browser.evaluate("sashimono.show('overlap 0')")
    assert browser.evaluate("sashimono.highlighted") == 12
    browser.evaluate("for (const tool of document.querySelectorAll('#tools button')) tool.click()")
    assert browser.evaluate("sashimono.shown") is None
    assert browser.evaluate("sashimono.roleOf('base')") == "plain"
    browser.screenshot()
    assert browser.errors == []
    assert all(url.startswith("file:") for url in browser.requests)


def test_the_public_function_says_the_same_and_shows_itself_shortly(tmp_path: Path) -> None:
    base = box((0.3, 0.1, 0.01), (0.0, 0.0, -0.005))
    folder = write_folder(tmp_path / "in", base=base, sunk=box((0.02, 0.02, 0.02), (0.0, 0.0, 0.006)))
    found = sashimono.doctor(folder, unit="mm")
    assert diagnosis_as_dict(found) == diagnosis_as_dict(examine(inspect_assembly(folder, unit="mm")))
    assert repr(found).startswith("Diagnosis(2 parts, 300 × 100 × ")
    assert len(repr(found)) < 160
    table = found._repr_html_()
    assert table.count("<tr>") == 1 + len(found.findings)
    assert sashimono.write_diagnosis(found, tmp_path / "page.html").stat().st_size > 0
