"""Bad input through every command: one line on standard error, exit status 2, soon, and nothing written."""

from __future__ import annotations

import io
import json
import os
import signal
import struct
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sashimono.cli import BAD_INPUT, run

SECONDS = 10.0
"""Processor time that a refusal may take."""

READERS = ("plan", "conditions", "fasteners", "explain", "doctor", "diff", "infer")
"""Commands that read a product."""

Make = Callable[[Path], Path]

# ------------------------------------------------------------------------------------------ files that are broken

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip


def obj_text(vertices: np.ndarray | None = None, faces: np.ndarray | None = None, more: str = "") -> str:
    vertices = 20.0 * CORNERS if vertices is None else vertices
    lines = ["v {} {} {}".format(*row) for row in vertices.tolist()]
    lines += ["f {} {} {}".format(*(row + 1)) for row in (FACES if faces is None else faces)]
    return "\n".join(lines) + "\n" + more


def stl_bytes(vertices: np.ndarray) -> bytes:
    records = np.zeros(len(FACES), dtype=[("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("flag", "<u2")])
    records["corner"] = vertices[FACES]
    return bytes(80) + struct.pack("<I", len(FACES)) + records.tobytes()


def ply_text(rows: int = 8, faces: int = 12) -> str:
    head = f"ply\nformat ascii 1.0\nelement vertex {rows}\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {faces}\nproperty list uchar int vertex_indices\nend_header\n"
    body = "\n".join(" ".join(map(str, row)) for row in (20.0 * CORNERS).tolist())
    return head + body + "\n" + "\n".join("3 {} {} {}".format(*row) for row in FACES[:faces])


def gltf(nodes: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    data = (0.02 * CORNERS).astype("<f4").tobytes() + FACES.astype("<u4").tobytes()
    import base64

    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [
            {"byteLength": len(data), "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": len(data) - 96},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
        **more,
    }


def glb_bytes(document: dict[str, Any]) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    return b"glTF" + struct.pack("<II", 2, 20 + len(text)) + struct.pack("<I4s", len(text), b"JSON") + text


CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
RELS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel" Target="/3D/m.model"/></Relationships>'
)


def model_xml(*, items: int = 2, unit: str = "millimeter", component: str = "") -> str:
    points = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*row) for row in (20.0 * CORNERS).tolist())
    corners = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*row) for row in FACES)
    mesh = f"<mesh><vertices>{points}</vertices><triangles>{corners}</triangles></mesh>"
    build = "".join('<item objectid="1"/>' for _ in range(items))
    return (
        f'<model unit="{unit}" xmlns="{CORE}"><resources><object id="1">{mesh}</object>{component}</resources>'
        f"<build>{build}</build></model>"
    )


def package(**files: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    return out.getvalue()


def threemf(xml: str) -> bytes:
    return package(**{"_rels/.rels": RELS, "3D/m.model": xml})


def a_bomb() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("_rels/.rels", RELS)
        with archive.open("3D/m.model", "w", force_zip64=True) as model:
            for _ in range(1100):
                model.write(bytes(1_000_000))
    return out.getvalue()


STEP = b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n"


def file(name: str, content: bytes | str | dict[str, Any] | list[Any]) -> Make:
    """Return what writes one file."""

    def make(folder: Path) -> Path:
        path = folder / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    return make


def folder_with(name: str = "b.obj", content: bytes | str = "", *, beside: bool = True, **more: str) -> Make:
    """Return what writes a folder of meshes: a good one (`a.obj`), a bad one and other files."""

    def make(folder: Path) -> Path:
        place = folder / "parts"
        place.mkdir()
        if beside:
            (place / "a.obj").write_text(obj_text())
        if name:
            (place / name).write_bytes(content if isinstance(content, bytes) else content.encode())
        for other, text in more.items():
            (place / other.replace("__", ".")).write_text(text)
        return place

    return make


def many_files(folder: Path) -> Path:
    place = folder / "parts"
    place.mkdir()
    (place / "p0.obj").write_text(obj_text())
    for k in range(1, 10_000):
        (place / f"p{k}.obj").hardlink_to(place / "p0.obj")
    return place


def special(kind: str) -> Make:
    def make(folder: Path) -> Path:
        path = folder / "product.step"
        if kind == "pipe":
            os.mkfifo(path)
        elif kind == "broken link":
            path.symlink_to(folder / "nowhere")
        elif kind == "loop":
            path.symlink_to(path)
        elif kind == "device":
            path.symlink_to("/dev/zero")
        return path

    return make


SHIFTED = 20.0 * CORNERS + [0.0, 0.0, 20.0]
HUGE, NAN, INF = SHIFTED.copy(), SHIFTED.copy(), SHIFTED.copy()
HUGE[3, 1], NAN[3, 1], INF[3, 1] = 1e30, np.nan, np.inf
FLAT = SHIFTED * [1.0, 1.0, 0.0]
CUBES = [{"mesh": 0, "name": "a"}, {"mesh": 0, "name": "b", "translation": [0.0, 0.0, 0.02]}]

PRODUCTS: dict[str, tuple[Make, str]] = {
    "absent": (lambda folder: folder / "absent.step", "no such file"),
    "name too long": (lambda folder: folder / f"{'n' * 300}.step", "File name too long"),
    "empty STEP": (file("e.step", b""), "empty"),
    "no STEP": (file("n.step", "solid nothing\n"), "not a STEP file"),
    "STEP cut short": (file("c.step", STEP), "broken or cut short"),
    "STEP of rubbish": (file("r.step", STEP + bytes(range(256)) * 9), "broken or cut short"),
    "STEP of 10,000 parts": (file("m.step", STEP + b"NEXT_ASSEMBLY_USAGE_OCCURRENCE\n" * 10_000), "10000 parts"),
    "pipe": (special("pipe"), "neither a file nor a folder"),
    "device": (special("device"), "neither a file nor a folder"),
    "broken link": (special("broken link"), "no such file"),
    "link to itself": (special("loop"), "product.step"),
    "no suffix": (file("product", "x"), "without suffix"),
    "unknown suffix": (file("product.docx", "x"), ".docx is not supported"),
    "a single mesh": (file("a.obj", obj_text()), "a mesh file is a single part"),
    "empty folder": (folder_with("", beside=False), "the folder is empty"),
    "folder of text": (folder_with("read.txt", "me", beside=False), "no .obj, .stl or .ply file"),
    "folder of a STEP": (folder_with("a.step", STEP, beside=False), "itself"),
    "one part": (folder_with(""), "at least 2"),
    "one name twice": (folder_with("a.stl", stl_bytes(SHIFTED)), "name the same part a"),
    "10,000 files": (many_files, "10000 parts"),
    "OBJ empty": (folder_with("b.obj", ""), "no triangles"),
    "OBJ of rubbish": (folder_with("b.obj", bytes(range(256))), "b.obj"),
    "OBJ without faces": (folder_with("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), "no triangles"),
    "OBJ of words": (folder_with("b.obj", "v one two three\nf 1 1 1\n"), "not a readable OBJ"),
    "OBJ names vertex 99": (folder_with("b.obj", obj_text(more="f 1 2 99\n")), "names vertex"),
    "OBJ names vertex 0": (folder_with("b.obj", obj_text(more="f 0 1 2\n")), "counts from 1"),
    "OBJ names vertex -99": (folder_with("b.obj", obj_text(more="f -99 1 2\n")), "names vertex"),
    "OBJ with NaN": (folder_with("b.obj", obj_text(NAN)), "not finite"),
    "OBJ with infinity": (folder_with("b.obj", obj_text(INF)), "not finite"),
    "OBJ with 1e30": (folder_with("b.obj", obj_text(HUGE)), "1e+27 m"),
    "OBJ with 1e300": (folder_with("b.obj", obj_text(SHIFTED * 1e299)), "m; nothing so large"),
    "OBJ flat": (folder_with("b.obj", obj_text(FLAT)), "b"),
    "OBJ in a point": (folder_with("b.obj", obj_text(SHIFTED * 0.0)), "coincide"),
    "OBJ with a path in its material": (folder_with("b.obj", "mtllib ../../x.mtl\nusemtl x\n"), "no triangles"),
    "STL cut short": (folder_with("b.stl", stl_bytes(SHIFTED)[:-30]), "cut short"),
    "STL empty": (folder_with("b.stl", b""), "neither ASCII nor a binary STL"),
    "STL says 4 billion": (folder_with("b.stl", bytes(80) + b"\xff\xff\xff\xff"), "cut short"),
    "STL without facets": (folder_with("b.stl", "solid b\nendsolid b\n"), "no triangles"),
    "STL with NaN": (folder_with("b.stl", stl_bytes(NAN)), "not finite"),
    "STL with 1e30": (folder_with("b.stl", stl_bytes(HUGE)), "nothing so large"),
    "PLY without a header": (folder_with("b.ply", "x"), "no PLY header"),
    "PLY cut short": (folder_with("b.ply", ply_text()[:-40]), "not a readable PLY"),
    "PLY says a billion": (folder_with("b.ply", ply_text(rows=1_000_000_000)), "not a readable PLY"),
    "PLY binary cut short": (
        folder_with("b.ply", ply_text().replace("ascii", "binary_little_endian")), "not a readable PLY"
    ),
    "PLY without faces": (folder_with("b.ply", ply_text(faces=0)), "no triangles"),
    "poses of rubbish": (folder_with("b.obj", obj_text(SHIFTED), config__json="{"), "not readable JSON"),
    "poses of two numbers": (
        folder_with("b.obj", obj_text(SHIFTED), translation__json='{"b": [1, 2]}'), "3 or 6 finite numbers"
    ),
    "poses of NaN": (
        folder_with("b.obj", obj_text(SHIFTED), translation__json='{"b": [NaN, 0, 0]}'), "3 or 6 finite numbers"
    ),
    "poses far away": (
        folder_with("b.obj", obj_text(SHIFTED), translation__json='{"b": [1e30, 0, 0]}'), "nothing so large"
    ),
    "Fusion of rubbish": (folder_with("b.obj", obj_text(SHIFTED), assembly__json="{"), "not readable JSON"),
    "GLB empty": (file("p.glb", b""), "empty"),
    "GLB cut short": (file("p.glb", glb_bytes(gltf(CUBES))[:-400]), "cut short"),
    "GLB of version 7": (file("p.glb", b"glTF" + struct.pack("<II", 7, 12)), "version 7"),
    "GLB without JSON": (file("p.glb", b"glTF" + struct.pack("<II", 2, 12)), "no JSON chunk"),
    "glTF that is a list": (file("p.gltf", "[]"), "not a readable glTF"),
    "glTF of rubbish": (file("p.gltf", "{"), "not a readable glTF"),
    "glTF without meshes": (file("p.gltf", {"asset": {"version": "2.0"}}), "no part"),
    "glTF without its buffer": (file("p.gltf", gltf(CUBES, buffers=[{"byteLength": 9, "uri": "x"}])), "missing"),
    "glTF past its buffer": (
        file("p.gltf", gltf(CUBES, bufferViews=[{"buffer": 0, "byteOffset": 1 << 40, "byteLength": 1}] * 2)), "past"
    ),
    "glTF in a circle": (file("p.gltf", gltf([{"mesh": 0, "children": [0]}])), "tree"),
    "glTF flattened": (file("p.gltf", gltf([CUBES[0], {"mesh": 0, "scale": [1, 1, 0]}])), "no usable transform"),
    "glTF far away": (file("p.gltf", gltf([CUBES[0], {"mesh": 0, "translation": [1e30, 0, 0]}])), "nothing so large"),
    "glTF of 10,000 nodes": (file("p.gltf", gltf([CUBES[0]] * 10_000)), "more than 2000 meshes"),
    "glTF compressed": (file("p.gltf", gltf(CUBES, extensionsRequired=["KHR_draco_mesh_compression"])), "draco"),
    "3MF that is no zip": (file("p.3mf", b"PK rubbish"), "not a readable 3MF"),
    "3MF zip of nothing": (file("p.3mf", package()), "not a readable 3MF"),
    "3MF without a model": (file("p.3mf", package(**{"_rels/.rels": RELS})), "not a readable 3MF"),
    "3MF of broken XML": (file("p.3mf", threemf("<model")), "not a readable 3MF"),
    "3MF in furlongs": (file("p.3mf", threemf(model_xml(unit="furlong"))), "not a readable 3MF"),
    "3MF in a circle": (
        file("p.3mf", threemf(model_xml(component='<object id="2"><components><component objectid="2"/></components>'
                                        "</object>").replace('item objectid="1"', 'item objectid="2"'))),
        "tree",
    ),
    "3MF of 10,000 items": (file("p.3mf", threemf(model_xml(items=10_000))), "more than 2000 meshes"),
    "3MF bomb": (file("p.3mf", a_bomb()), "unpacks to 1.1 GB"),
}  # fmt: skip
"""What a product may be that no command can use: what makes it, and what the line says."""

LOOKED_AT = {"OBJ flat", "OBJ in a point"}
"""Products at which the doctor looks, as it looks at open meshes: it says what is wrong, with exit status 1."""

CUTS = {"3MF bomb", "10,000 files", "3MF of 10,000 items"}
"""Cases that take a second each to make: through one command."""


def spread_over_commands() -> list[tuple[str, str]]:
    """Every product through `plan`, and in turn through one of the other commands."""
    pairs = []
    for k, name in enumerate(PRODUCTS):
        pairs.append((name, "plan"))
        if name not in CUTS:
            command = READERS[1 + k % (len(READERS) - 1)]
            pairs.append((name, "explain" if command == "doctor" and name in LOOKED_AT else command))
    return pairs


def reading(command: str, path: Path) -> list[str]:
    """Return the arguments of a command that reads a product."""
    return {
        "plan": ["plan", str(path), "--out", "out"],
        "conditions": ["conditions", str(path), "--json", "c.json"],
        "fasteners": ["fasteners", str(path), "--json", "f.json"],
        "explain": ["explain", str(path), "--html", "e.html"],
        "doctor": ["doctor", str(path), "--json", "d.json", "--html", "d.html"],
        "diff": ["diff", str(path), str(path), "--json", "d.json"],
        "infer": ["infer", str(path), "--json", "i.json"],
    }[command]


def refused(arguments: list[str], capsys: pytest.CaptureFixture[str], place: Path) -> str:
    """Return the one line that a command says; it must have exit status 2, be quick, and write nothing."""
    capsys.readouterr()
    before = sorted(str(path) for path in place.rglob("*"))
    start = time.process_time()
    signal.setitimer(signal.ITIMER_VIRTUAL, 3.0 * SECONDS)  # what hangs fails, and does not hold up the others
    try:
        status = run(arguments)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    took = time.process_time() - start
    captured = capsys.readouterr()
    lines = captured.err.splitlines()
    assert status == BAD_INPUT, captured
    assert captured.out == ""
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("sashimono: ")
    assert sorted(str(path) for path in place.rglob("*")) == before, "something was written"
    assert took < SECONDS
    return lines[0]


def _stop(*_: object) -> None:
    raise TimeoutError("no answer")


@pytest.fixture
def work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in; beside it is one for what is read."""
    place = tmp_path / "work"
    place.mkdir()
    monkeypatch.chdir(place)
    signal.signal(signal.SIGVTALRM, _stop)
    return place


@pytest.mark.parametrize(("name", "command"), spread_over_commands())
def test_products_that_cannot_be_used(
    name: str, command: str, work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make, says = PRODUCTS[name]
    inputs = tmp_path / "in"
    inputs.mkdir()
    path = make(inputs)
    assert says in refused(reading(command, path), capsys, work)


# ------------------------------------------------------------------------------------------------ bad options

GRIPPER = {
    "name": "g", "max_opening": 0.1, "finger_width": 0.01, "finger_thickness": 0.01, "finger_length": 0.05,
    "tip_reach": 0.0, "pad_thickness": 0.0, "patch_radius": 0.005, "open_margin": 0.01, "palm_width": 0.1,
    "palm_depth": 0.1, "palm_length": 0.1,
}  # fmt: skip
TABLE = {"normal": [0, 0, 1], "offset": 0}

FILES: dict[str, str] = {
    "rubbish.json": "{",
    "list.json": "[]",
    "half.json": json.dumps({"name": "g"}),
    "negative.json": json.dumps({**GRIPPER, "finger_width": -1.0}),
    "word.json": json.dumps({**GRIPPER, "finger_width": "wide"}),
    "nan.json": json.dumps({**GRIPPER, "finger_width": float("nan")}),
    "bad.toml": "base = ",
    "unknown.toml": "bsae = 'a'",
    "type.toml": "base = 3",
    "pairs.toml": "before = ['a']",
    "up.toml": "up = [0, 0]",
    "far.toml": "up = [inf, 0, 0]",
    "names.toml": "exclude = 'a'",
    "no_table.json": json.dumps({"parts": {}}),
    "no_part.json": json.dumps({"table": TABLE, "parts": {"z": np.eye(4).tolist()}}),
    "no_pose.json": json.dumps({"table": TABLE, "parts": {"b": [1, 2]}}),
    "stretched.json": json.dumps({"table": TABLE, "parts": {"b": (2 * np.eye(4)).tolist()}}),
    "flat_table.json": json.dumps({"table": {"normal": [0, 0, 0], "offset": 0}, "parts": {"b": np.eye(4).tolist()}}),
    "config.toml": "steps = 'many'",
    "zip.npz": "PK\x03\x04",
    "recipe.toml": "families = 3",
}

PLAN = ["plan", "IN", "--out", "out"]
OPTIONS: list[tuple[list[str], str]] = [
    (["assemble"], "No such command"),
    (["plan"], "Missing argument"),
    (["plan", "IN"], "Missing option"),
    (["plan", "IN", "more", "--out", "out"], "unexpected extra argument"),
    ([*PLAN, "--colour"], "No such option"),
    ([*PLAN, "--seed", "one"], "--seed"),
    ([*PLAN, "--seed", "-1"], "--seed"),
    ([*PLAN, "--seed", "1.5"], "--seed"),
    ([*PLAN, "--seed"], "--seed"),
    ([*PLAN, "--unit", "parsec"], "unit 'parsec' is not known"),
    ([*PLAN, "--split", "half"], "--split half is not known"),
    ([*PLAN, "--method", "magic"], "--method magic"),
    ([*PLAN, "--motion", "fly"], "--motion fly"),
    ([*PLAN, "--device", "cuda:0"], "--device cuda:0 is for --method physics"),
    ([*PLAN, "--hands", "0"], "--hands"),
    ([*PLAN, "--gripper", "claw"], "gripper 'claw' is not known"),
    ([*PLAN, "--gripper", "absent.json"], "absent.json"),
    ([*PLAN, "--gripper", "rubbish.json"], "cannot be read as a gripper"),
    ([*PLAN, "--gripper", "list.json"], "not one JSON object"),
    ([*PLAN, "--gripper", "half.json"], "is missing, or no field"),
    ([*PLAN, "--gripper", "negative.json"], "not a length"),
    ([*PLAN, "--gripper", "word.json"], "not a length"),
    ([*PLAN, "--gripper", "nan.json"], "not a length"),
    ([*PLAN, "--grippers", "claw"], "claw"),
    ([*PLAN, "--base", "z"], "z"),
    ([*PLAN, "--up", "1,2"], "not X,Y,Z"),
    ([*PLAN, "--up", "a,b,c"], "not X,Y,Z"),
    ([*PLAN, "--up", "0,0,0"], "not a direction"),
    ([*PLAN, "--up", "nan,0,1"], "not a direction"),
    ([*PLAN, "--before", "a"], "not A:B"),
    ([*PLAN, "--before", "a:z"], "z"),
    ([*PLAN, "--before", "a:b", "--before", "b:a"], "no order does it all"),
    ([*PLAN, "--before", "a:b", "--base", "b"], "b"),
    ([*PLAN, "--exclude", "z*"], "no part is called so"),
    ([*PLAN, "--exclude", "*"], "leaves 0 of 2"),
    ([*PLAN, "--method", "physics", "--base", "a"], "--base"),
    ([*PLAN, "--constraints", "absent.toml"], "cannot be read as TOML"),
    ([*PLAN, "--constraints", "bad.toml"], "cannot be read as TOML"),
    ([*PLAN, "--constraints", "."], "cannot be read as TOML"),
    ([*PLAN, "--constraints", "unknown.toml"], "bsae is not known"),
    ([*PLAN, "--constraints", "type.toml"], "base is no name"),
    ([*PLAN, "--constraints", "pairs.toml"], "list of pairs"),
    ([*PLAN, "--constraints", "up.toml"], "three numbers"),
    ([*PLAN, "--constraints", "far.toml"], "not a direction"),
    ([*PLAN, "--constraints", "names.toml"], "no list of names"),
    ([*PLAN, "--resting", "absent.json"], "absent.json"),
    ([*PLAN, "--resting", "rubbish.json"], "rubbish.json"),
    ([*PLAN, "--resting", "no_table.json"], "table"),
    ([*PLAN, "--resting", "no_part.json"], "z"),
    ([*PLAN, "--resting", "no_pose.json"], "b"),
    ([*PLAN, "--resting", "stretched.json"], "b"),
    ([*PLAN, "--resting", "flat_table.json"], "normal"),
    (["plan", "IN", "--out", "taken"], "is a file"),
    (["plan", "IN", "--out", "taken/below"], "cannot be written to"),
    (["plan", "IN", "--out", "/proc/1/out"], "cannot be written to"),
    (["plan", "IN", "--out", "full"], "plan.html is a folder"),
    (["demo", "--out", "taken"], "is a file"),
    (["demo", "--seed", "x"], "--seed"),
    (["conditions", "IN", "--thorough", "-1"], "--thorough"),
    (["conditions", "IN", "--json", "."], "is a folder"),
    (["conditions", "IN", "--graph", "."], "is a folder"),
    (["conditions", "IN", "--graph", "taken/g.json"], "--graph"),
    (["fasteners", "IN", "--json", "."], "is a folder"),
    (["explain", "IN", "--part", "z"], "there is no part 'z'"),
    (["explain", "IN", "--fixed", "z"], "there is no part 'z'"),
    (["explain", "IN", "--fixed", ""], "--fixed"),
    (["explain", "IN", "--html", "."], "is a folder"),
    (["doctor", "IN", "--html", "."], "is a folder"),
    (["doctor", "IN", "--exclude", "z"], "no part is called so"),
    (["doctor"], "Missing argument"),
    (["diff", "IN"], "Missing argument"),
    (["diff", "IN", "absent.step"], "no such file"),
    (["diff", "absent.json", "IN"], "cannot be read as a plan"),
    (["diff", "IN", "list.json"], "list.json"),
    (["diff", "IN", "IN", "--json", "."], "is a folder"),
    (["verify"], "Missing argument"),
    (["verify", "absent.json"], "cannot be read as a plan"),
    (["verify", "."], "cannot be read as a plan"),
    (["verify", "IN"], "cannot be read as a plan"),
    (["verify", "rubbish.json"], "not JSON"),
    (["verify", "list.json"], "list.json"),
    (["verify", "half.json"], "half.json"),
    (["infer", "IN", "--json", "i.json", "--model", "oracle"], "oracle"),
    (["infer", "IN", "--json", "."], "is a folder"),
    (["infer", "IN"], "Missing option"),
    (["evaluate", "--out", "out"], "WEIGHTS"),
    (["evaluate", "absent.npz", "--out", "out"], "no such file"),
    (["evaluate", "rubbish.json", "--out", "out"], "rubbish.json"),
    (["evaluate", "--ata", "0", "--out", "out"], "--ata"),
    (["evaluate", "zip.npz", "--out", "out"], "no weights"),
    (["evaluate", "--ata", "1", "--data", "oracle", "--out", "out"], "oracle"),
    (["evaluate", "--ata", "1", "--split", "oracle", "--out", "out"], "no split 'oracle'"),
    (["evaluate", "--ata", "1", "--device", "warp9", "--out", "out"], "warp9"),
    (["train", "past", "--device", "warp9", "--out", "out"], "warp9"),
    (["train", "past", "--data", "oracle", "--out", "out"], "oracle"),
    (["train", "past", "--from", "rubbish.json", "--out", "out"], "no weights"),
    (["train", "past", "--steps", "0", "--out", "out"], "--steps"),
    (["train", "--out", "out"], "either CONFIG or --campaign"),
    (["train", "past", "--campaign", "x", "--out", "out"], "either CONFIG or --campaign"),
    (["train", "oracle", "--out", "out"], "oracle"),
    (["train", "bad.toml", "--out", "out"], "bad.toml"),
    (["train", "config.toml", "--out", "out"], "config.toml"),
    (["train", "--campaign", "gpu", "--out", "out"], "--minutes"),
    (["train", "past", "--out", "taken"], "is a file"),
    (["dataset", "make", "oracle", "--out", "out"], "oracle"),
    (["dataset", "make", "recipe.toml", "--out", "out"], "recipe.toml"),
    (["dataset", "make", "bad.toml", "--out", "out"], "bad.toml"),
    (["dataset", "make", "tiny", "--out", "taken"], "is a file"),
    (["dataset", "make", "tiny", "--out", "out", "--limit", "0"], "--limit"),
    (["dataset", "make", "tiny", "--out", "out", "--ray", "auto", "--workers", "2"], "--ray"),
    (["dataset", "stats", "oracle"], "oracle"),
    (["dataset", "stats", "."], "."),
    (["dataset", "show", "oracle", "--out", "out"], "oracle"),
    (["dataset", "export", "oracle", "--out", "out"], "oracle"),
    (["dataset", "check", "oracle"], "oracle"),
    (["dataset", "burn"], "No such command"),
]
"""Arguments in a folder with `FILES`, a file `taken`, a folder `full/plan.html`; IN is a product of parts a and b."""


@pytest.mark.parametrize(
    ("arguments", "says"), OPTIONS, ids=lambda value: " ".join(value) if isinstance(value, list) else ""
)
def test_options_that_cannot_be_used(
    arguments: list[str], says: str, work: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in FILES.items():
        (work / name).write_text(text)
    (work / "taken").write_text("mine")
    (work / "full" / "plan.html").mkdir(parents=True)
    product = folder_with("b.obj", obj_text(SHIFTED))(tmp_path)
    assert says in refused([str(product) if each == "IN" else each for each in arguments], capsys, work)
    assert (work / "taken").read_text() == "mine"


# ------------------------------------------------------------------------------------------------ broken plans


@pytest.fixture(scope="module")
def good_plan(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    place = tmp_path_factory.mktemp("good")
    product = folder_with("b.obj", obj_text(SHIFTED))(place)
    assert run(["plan", str(product), "--out", str(place / "out"), "-q"]) == 0
    return json.loads((place / "out" / "plan.json").read_text())


def without(*keys: str | int) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        del document[keys[-1]]

    return change


def with_value(value: Any, *keys: str | int) -> Callable[[Any], None]:
    def change(document: Any) -> None:
        for key in keys[:-1]:
            document = document[key]
        document[keys[-1]] = value

    return change


PLANS: list[tuple[Callable[[Any], None], str]] = [
    (without("format"), "format"),
    (with_value("other.plan", "format"), "format"),
    (with_value(99, "version"), "version"),
    (without("steps"), "steps"),
    (with_value("all", "steps"), "steps"),
    (with_value("maybe", "status"), "status"),
    (without("steps", 1, "path"), "path"),
    (with_value([[1, 2], [3, 4]], "steps", 1, "path", "T_world_part"), "T_world_part"),
    (with_value("nan", "steps", 1, "path", "T_world_part", 0, 0, 0), "T_world_part"),
    (with_value(float("nan"), "steps", 1, "path", "T_world_part", 0, 0, 0), "NaN"),
    (with_value({"kind": "kiss"}, "steps", 1, "contact"), "contact"),
    (without("source", "sha256"), "sha256"),
    (with_value("nowhere", "source", "path"), "nowhere"),
    (with_value("parsec", "source", "unit"), "parsec"),
    (with_value({"normal": "up"}, "table"), "table"),
    (with_value([3], "order"), "order"),
]


@pytest.mark.parametrize(("change", "says"), PLANS, ids=[f"{k} {says}" for k, (_, says) in enumerate(PLANS)])
def test_plans_that_cannot_be_read(
    change: Callable[[Any], None], says: str, good_plan: dict[str, Any], work: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    document = json.loads(json.dumps(good_plan))
    document["source"]["path"] = str(folder_with("b.obj", obj_text(SHIFTED))(tmp_path))
    change(document)
    (work / "plan.json").write_text(json.dumps(document))
    assert says in refused(["verify", "plan.json"], capsys, work)


def test_there_are_enough_cases_and_every_command_is_there() -> None:
    assert len(spread_over_commands()) + len(OPTIONS) + len(PLANS) >= 80
    asked = {arguments[0] for arguments, _ in OPTIONS}
    assert asked >= {*READERS, "demo", "verify", "train", "evaluate", "dataset"}
