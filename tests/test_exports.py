"""The manual and the tables as the command line makes them: files, refusals, nothing half-written."""

from __future__ import annotations

import csv
import importlib.util
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from test_cli import one_line, write_box

from sashimono import exports
from sashimono.cli import BAD_INPUT, OK, run
from sashimono.fasteners.recognise import find_fasteners
from sashimono.view.clip import ClipConfig
from sashimono.view.manual import pdf


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A plan.json of a plate with a block on it, beside its input."""
    folder = tmp_path_factory.mktemp("planned")
    (folder / "boxes").mkdir()
    write_box(folder / "boxes" / "plate.obj", (0, 0, 0), (40, 40, 10))
    write_box(folder / "boxes" / "=block.obj", (10, 10, 10), (30, 30, 30))
    assert run(["plan", str(folder / "boxes"), "--out", str(folder), "--unit", "mm"]) == OK
    return folder / "plan.json"


def read_csv(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text(encoding="utf-8-sig"))))


def test_tables_say_what_the_plan_says(planned: Path, tmp_path: Path) -> None:
    bom, steps = tmp_path / "bom.csv", tmp_path / "steps.csv"
    assert run(["export", str(planned), "--bom", str(bom), "--steps", str(steps)]) == OK
    rows = read_csv(bom)
    # a name that a spreadsheet would run as a formula is quoted
    assert sorted((row["part"], row["quantity"], row["length_mm"]) for row in rows) == [
        ("'=block", "1", "20.0"),
        ("plate", "1", "40.0"),
    ]
    first, second = read_csv(steps)
    assert (first["step"], first["contact"], first["direction_x"]) == ("1", "base", "")
    assert sum(float(second[f"direction_{axis}"]) ** 2 for axis in "xyz") == pytest.approx(1.0)
    assert float(second["length_mm"]) > 0.0
    assert float(second["turns"]) == 0.0


def test_a_workbook_has_the_same_rows(planned: Path, tmp_path: Path) -> None:
    book = tmp_path / "steps.xlsx"
    assert run(["export", str(planned), "--steps", str(book)]) == OK
    with zipfile.ZipFile(book) as archive:
        sheet = etree.fromstring(archive.read("xl/worksheets/sheet1.xml"))
        shared = etree.fromstring(archive.read("xl/sharedStrings.xml"))
    name = "{http://schemas.openxmlformats.org/spreadsheetml/2006/main}"
    texts = ["".join(entry.itertext()) for entry in shared.iter(f"{name}si")]
    cells = [
        [texts[int(cell[0].text)] if cell.get("t") == "s" else float(cell[0].text) for cell in row if len(cell)]
        for row in sheet.iter(f"{name}row")
    ]
    plan, assembly = exports.read_plan_and_input(planned)
    wanted = exports.step_table(plan, assembly, find_fasteners(assembly))
    assert [[cell for cell in row if cell != ""] for row in cells] == [
        [cell for cell in row if cell != ""] for row in wanted
    ]


def test_a_workbook_without_its_library_is_one_line(
    planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(exports, "find_spec", lambda name: None if name == "xlsxwriter" else real(name))
    assert run(["export", str(planned), "--bom", str(tmp_path / "b.xlsx")]) == BAD_INPUT
    assert "sashimono[tables]" in one_line(capsys.readouterr().err)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["export", "PLAN"], "nothing to write"),
        (["export", "PLAN", "--bom", "b.txt"], "not a table"),
        (["export", "PLAN", "--clip", "c.mp4"], "not a clip"),
        (["export", "PLAN", "--clip", "c.webp", "--step", "9"], "--step 9: no step that moves. Choose one of: 2"),
        (["export", "PLAN", "--step", "2"], "--step is for --clip"),
        (["export", "PLAN", "--mtc", "PLAN"], "is a file"),
        (["export", "PLAN", "--bom", "b.csv", "--input", "nowhere"], "nowhere"),
        (["export", "absent.json", "--bom", "b.csv"], "absent.json"),
        (["manual", "PLAN", "--out", "m", "--language", "fr"], "--language fr is not known"),
        (["manual", "absent.json", "--out", "m"], "absent.json"),
        (["manual", "PLAN", "--out", "PLAN"], "is a file"),
        (["manual", "PLAN"], "--out"),
    ],
)
def test_bad_usage_is_one_line_and_writes_nothing(
    planned: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    says: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run([str(planned) if argument == "PLAN" else argument for argument in arguments]) == BAD_INPUT
    assert says in one_line(capsys.readouterr().err)
    assert list(tmp_path.iterdir()) == []


def test_an_input_with_other_parts_is_refused(
    planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "other").mkdir()
    write_box(tmp_path / "other" / "plate.obj", (0, 0, 0), (40, 40, 10))
    write_box(tmp_path / "other" / "lid.obj", (0, 0, 10), (40, 40, 20))
    command = ["export", str(planned), "--bom", str(tmp_path / "b.csv"), "--input", str(tmp_path / "other")]
    assert run(command) == BAD_INPUT
    assert "has no part '=block'" in one_line(capsys.readouterr().err)


def test_a_manual_without_a_browser_is_a_page_and_a_line(
    planned: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pdf, "BROWSERS", ())
    assert run(["manual", str(planned), "--out", str(tmp_path), "--language", "de"]) == OK
    assert [path.name for path in tmp_path.iterdir()] == ["manual.html"]
    assert "Montageanleitung" in (tmp_path / "manual.html").read_text(encoding="utf-8")
    assert "no Chromium or Chrome found" in caplog.text
    assert run(["manual", str(planned), "--out", str(tmp_path / "pdf"), "--pdf"]) == BAD_INPUT
    assert not (tmp_path / "pdf").exists()


def test_a_scene_has_each_part_and_a_keyframe_after_each_step(planned: Path, tmp_path: Path) -> None:
    assert run(["export", str(planned), "--mjcf", str(tmp_path / "scene")]) == OK
    root = etree.parse(tmp_path / "scene" / "scene.xml").getroot()
    plan, assembly = exports.read_plan_and_input(planned)
    assert [body.get("name") for body in root.iter("body")] == list(assembly.names)
    keys = {key.get("name"): [float(x) for x in key.get("qpos").split()] for key in root.iter("key")}
    assert list(keys) == ["start", f"1 {plan.order[0]}", f"2 {plan.order[1]}"]
    for k, name in enumerate(assembly.names):
        own = slice(7 * k, 7 * k + 3)
        assert keys[f"2 {plan.order[1]}"][own] == pytest.approx(plan.parts[name][:3, 3], abs=1e-9)
        assert keys["start"][own] == pytest.approx(
            plan.steps[plan.order.index(name)].motion.T_world_part[0][:3, 3], abs=1e-9
        )
    for mesh in root.iter("mesh"):
        lines = (tmp_path / "scene" / mesh.get("file")).read_text().splitlines()
        part = assembly.part(mesh.get("name"))
        assert [line[0] for line in lines].count("f") == len(part.faces)
        corners = [[float(x) for x in line.split()[1:]] for line in lines if line[0] == "v"]
        assert corners == pytest.approx(part.vertices_part, abs=1e-9)


def test_a_scene_loads_in_the_simulator(planned: Path, tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="the simulator is no dependency: exports are XML and OBJ")
    assert run(["export", str(planned), "--mjcf", str(tmp_path)]) == OK
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.nkey - 1)
    before = data.qpos.copy()
    for _ in range(100):
        mujoco.mj_step(model, data)
    assert data.qpos == pytest.approx(before, abs=1e-6), "nothing falls and nothing is pushed apart"


def test_a_clip_shows_the_way_in(planned: Path, tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")
    file = tmp_path / "step.webp"
    assert run(["export", str(planned), "--clip", str(file), "--step", "2"]) == OK
    with image.open(file) as clip:
        assert clip.n_frames == ClipConfig().frames
        assert clip.info["loop"] == 0
        frames = []
        for k in (0, clip.n_frames - 1):
            clip.seek(k)
            frames.append(np.asarray(clip.convert("RGB"), dtype=np.int64))
    assert frames[0].shape == (ClipConfig().height, ClipConfig().width, 3)
    # what comes is orange, and comes down
    orange = [(frame[..., 0] > 200) & (frame[..., 2] < 110) for frame in frames]
    assert all(mask.sum() > 500 for mask in orange)
    heights = [np.nonzero(mask)[0].mean() for mask in orange]
    assert abs(heights[1] - heights[0]) > 5.0
    assert [path.name for path in tmp_path.iterdir()] == ["step.webp"]


def test_a_clip_without_its_library_is_one_line(
    planned: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(exports, "find_spec", lambda name: None if name == "PIL" else real(name))
    assert run(["export", str(planned), "--clip", str(tmp_path / "c.webp")]) == BAD_INPUT
    assert "sashimono[render]" in one_line(capsys.readouterr().err)
    assert list(tmp_path.iterdir()) == []
