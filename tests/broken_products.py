"""Products that no command can use: files that are broken, cut short, hostile or absurd, and what makes them."""

from __future__ import annotations

import io
import json
import os
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

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
