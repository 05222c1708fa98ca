"""The readers of PLY and 3MF, written here, against trimesh's; and against broken files."""

from __future__ import annotations

import io
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from sashimono.errors import InputError
from sashimono.io.formats.meshes import read_mesh
from sashimono.io.formats.ply import parse_ply
from sashimono.io.formats.threemf import read_3mf
from sashimono.io.raw import Mesh

Read = TypeVar("Read")
ENCODINGS = ("ascii", "binary_little_endian", "binary_big_endian")
TYPES = {"float": "f4", "double": "f8", "uchar": "u1", "short": "i2", "int": "i4", "uint": "u4"}


@st.composite
def ply_files(draw: st.DrawFn, *, mixed: bool) -> bytes:
    """A PLY file: convex fans of 3 to 5 corners, coordinates and indices of any type, properties that nobody needs."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    encoding = draw(st.sampled_from(ENCODINGS))
    coordinate = draw(st.sampled_from(["float", "double"]))
    index, length = draw(st.sampled_from(["int", "uint", "short", "uchar"])), draw(st.sampled_from(["uchar", "int"]))
    extra = draw(st.lists(st.sampled_from(["before", "after"]), unique=True))
    list_name = draw(st.sampled_from(["vertex_indices", "vertex_index"]))
    newline = draw(st.sampled_from(["\n", "\r\n"])) if encoding == "ascii" else "\n"
    sides = draw(st.lists(st.integers(3, 5), min_size=1, max_size=6))
    if encoding != "ascii" and not mixed:
        sides = sides[:1] * len(sides)
    points, polygons = [], []
    for count in sides:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
        polygons.append(range(len(points), len(points) + count))
        points += [(np.cos(a), np.sin(a), float(len(polygons))) for a in angles]
    properties = [*(["uchar before"] if "before" in extra else []), *(f"{coordinate} {axis}" for axis in "xyz")]
    properties += ["short after"] if "after" in extra else []
    head = ["ply", f"format {encoding} 1.0", "comment made by a test", f"element vertex {len(points)}"]
    head += [f"property {each}" for each in properties]
    head += [f"element face {len(polygons)}", f"property list {length} {index} {list_name}", "end_header", ""]
    rows = [
        [*([7] if "before" in extra else []), *point, *([-3] if "after" in extra else [])]
        for point in np.array(points, dtype=TYPES[coordinate]).tolist()
    ]
    lists = [[len(polygon), *polygon] for polygon in polygons]
    if encoding == "ascii":
        body = newline.join(" ".join(map(repr, row)) for row in rows + lists) + newline
        return newline.join(head).encode() + body.encode()
    order = "<" if "little" in encoding else ">"
    codes = {"float": "f", "double": "d", "uchar": "B", "short": "h", "int": "i", "uint": "I"}
    of_row = order + "".join(codes[each.split()[0]] for each in properties)
    packed = [struct.pack(of_row, *row) for row in rows]
    packed += [struct.pack(f"{order}{codes[length]}{len(row) - 1}{codes[index]}", *row) for row in lists]
    return "\n".join(head).encode() + b"".join(packed)


def triangles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Corners of each triangle, by value: (triangle, 3, 3)."""
    return np.asarray(vertices, dtype=np.float64)[np.asarray(faces)]


@settings(max_examples=150)
@given(ply_files(mixed=False))  # trimesh reads no binary files whose faces differ in their number of corners
def test_ply_is_read_as_trimesh_reads_it(data: bytes) -> None:
    mine = parse_ply(data)
    theirs = trimesh.load_mesh(io.BytesIO(data), file_type="ply", process=False)
    mine_area, theirs_area = (
        trimesh.triangles.area(triangles(mesh.vertices, mesh.faces)).sum() for mesh in (mine, theirs)
    )
    assert mine.faces.shape == np.asarray(theirs.faces).shape
    np.testing.assert_allclose(mine.vertices, theirs.vertices, atol=1e-6)
    assert mine_area == pytest.approx(theirs_area, rel=1e-5)


@settings(max_examples=30)
@given(st.integers(0, 1000), st.sampled_from(["ascii", "binary"]))
def test_ply_as_trimesh_writes_it(seed: int, encoding: str) -> None:
    mesh = trimesh.creation.random_soup(20)
    mesh.vertices = np.random.default_rng(seed).normal(size=mesh.vertices.shape)
    mine = parse_ply(trimesh.exchange.ply.export_ply(mesh, encoding=encoding))
    np.testing.assert_array_equal(mine.faces, mesh.faces)
    np.testing.assert_allclose(mine.vertices, mesh.vertices, atol=1e-5)


@st.composite
def scenes(draw: st.DrawFn) -> trimesh.Scene:
    """A scene of boxes, some of them the same mesh twice, turned and moved."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    scene = trimesh.Scene()
    for k in range(draw(st.integers(1, 3))):
        mesh = trimesh.creation.box(rng.uniform(1.0, 5.0, 3))
        for copy in range(draw(st.integers(1, 2))):
            T = trimesh.transformations.random_rotation_matrix(rng.random(3))
            T[:3, 3] = rng.uniform(-20.0, 20.0, 3)
            scene.add_geometry(mesh, node_name=f"node_{k}_{copy}", geom_name=f"box_{k}", transform=T)
    return scene


@settings(max_examples=40)
@given(scenes())
def test_3mf_is_read_as_trimesh_reads_it(scene: trimesh.Scene) -> None:
    data = trimesh.exchange.threemf.export_3MF(scene)
    placed, unit = read_3mf(data, "scene.3mf", most=100)
    theirs = trimesh.load_scene(io.BytesIO(data), file_type="3mf", process=False)
    expected = [mesh for mesh in theirs.dump() if len(mesh.faces)]
    assert unit == "mm"
    assert len(placed) == len(expected) == len(scene.graph.nodes_geometry)

    def corners(vertices: np.ndarray) -> np.ndarray:
        rounded = np.round(vertices, 4) + 0.0
        return rounded[np.lexsort(rounded.T)]

    mine = [corners(p.vertices @ p.T_world_mesh[:3, :3].T + p.T_world_mesh[:3, 3]) for p in placed]
    other = [corners(np.asarray(mesh.vertices)) for mesh in expected]
    for points in mine:
        assert any(points.shape == o.shape and np.allclose(points, o, atol=1e-3) for o in other)


def mesh_or_complaint(read: Callable[[], Read]) -> Read | str:
    """Return what is read, or what the reader complains of; any other error fails the test."""
    try:
        return read()
    except InputError as error:
        return str(error)


def is_clear(complaint: str, name: str) -> bool:
    return "\n" not in complaint and name in complaint


@settings(max_examples=300)
@given(data=ply_files(mixed=True), at=st.floats(0.0, 1.0), byte=st.integers(0, 255), cut=st.booleans())
def test_a_broken_ply_file_is_one_clear_line_or_a_mesh(data: bytes, at: float, byte: int, cut: bool) -> None:
    place = int(at * (len(data) - 1))
    broken = data[:place] if cut else data[:place] + bytes([byte]) + data[place + 1 :]
    found = mesh_or_complaint(lambda: read_mesh(Path("broken.ply"), broken))
    assert len(found.faces) if isinstance(found, Mesh) else is_clear(found, "broken.ply")


@pytest.fixture(scope="module")
def package() -> bytes:
    return trimesh.exchange.threemf.export_3MF(trimesh.Scene(trimesh.creation.box((1.0, 2.0, 3.0))))


@settings(max_examples=150)
@given(at=st.floats(0.0, 1.0), byte=st.integers(0, 255), inside=st.booleans())
def test_a_broken_3mf_file_is_one_clear_line_or_meshes(package: bytes, at: float, byte: int, inside: bool) -> None:
    """Broken as a package, or as a model within a sound one."""

    def break_in(data: bytes) -> bytes:
        place = int(at * (len(data) - 1))
        return data[:place] + bytes([byte]) + data[place + 1 :]

    if inside:
        made = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(package)) as old, zipfile.ZipFile(made, "w") as new:
            for name in old.namelist():
                new.writestr(name, break_in(old.read(name)) if name.endswith(".model") else old.read(name))
        broken = made.getvalue()
    else:
        broken = break_in(package)
    found = mesh_or_complaint(lambda: read_3mf(broken, "broken.3mf", most=100)[0])
    assert is_clear(found, "broken.3mf") if isinstance(found, str) else all(len(each.faces) for each in found)


@pytest.mark.parametrize(
    ("rows", "says"),
    [("0 0 0\n1 0 0\n0 1 0\n4 0 1 2\n", "not as long as it says"), ("0 0 0\n1 0 0\n0 1 0\n-1 0 1 2\n", "not as long")],
)
def test_a_list_of_another_length_than_it_says_is_refused(rows: str, says: str) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 1\nproperty list char int vertex_indices\nend_header\n"
    with pytest.raises(InputError, match=says):
        read_mesh(Path("list.ply"), (head + rows).encode())
