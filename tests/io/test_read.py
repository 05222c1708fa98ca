"""Reading: known files in, known parts out; bad input is one clear line."""

import json
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

from sashimono.errors import InputError
from sashimono.geometry.mesh import measures, topology
from sashimono.io.formats import step_to_glb
from sashimono.io.names import choose_name, unique_names
from sashimono.io.raw import ReadConfig
from sashimono.io.read import read_assembly


@pytest.fixture
def shared(truth_folder: Path, assemblies_folder: Path) -> Path:
    """The folder that holds both."""
    assert truth_folder.parent == assemblies_folder.parent
    return truth_folder.parent


def arrays(solid: Manifold) -> tuple[np.ndarray, np.ndarray]:
    out = solid.to_mesh64()
    return np.array(out.vert_properties[:, :3]), np.array(out.tri_verts).astype(np.int64)


def box(
    x: float = 10.0, y: float = 20.0, z: float = 30.0, at: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> tuple[np.ndarray, np.ndarray]:
    return arrays(Manifold.cube([x, y, z]).translate(at))


def obj(vertices: np.ndarray, faces: np.ndarray) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    return "\n".join(lines + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]) + "\n"


def binary_stl(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    out = [b"\0" * 80, struct.pack("<I", len(faces))]
    out += [struct.pack("<12fH", 0, 0, 0, *vertices[f].reshape(-1), 0) for f in faces]
    return b"".join(out)


def ascii_stl(vertices: np.ndarray, faces: np.ndarray) -> str:
    out = ["solid part"]
    for face in faces:
        corners = [f"vertex {x} {y} {z}" for x, y, z in vertices[face]]
        out += ["facet normal 0 0 0", "outer loop", *corners, "endloop", "endfacet"]
    return "\n".join([*out, "endsolid part"])


def ply(vertices: np.ndarray, faces: np.ndarray, encoding: str) -> bytes:
    head = (
        f"ply\nformat {encoding} 1.0\nelement vertex {len(vertices)}\nproperty float x\nproperty float y\n"
        f"property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    ).encode()
    if encoding == "ascii":
        rows = [f"{x} {y} {z} 255 0 0\n" for x, y, z in vertices] + [f"3 {a} {b} {c}\n" for a, b, c in faces]
        return head + "".join(rows).encode()
    order = "<" if "little" in encoding else ">"
    rows = [struct.pack(order + "3f3B", *v, 255, 0, 0) for v in vertices]
    return head + b"".join(rows + [struct.pack(order + "B3i", 3, *f) for f in faces])


def glb(parts: list[tuple[np.ndarray, np.ndarray]], nodes: list[dict], materials: list[dict] | None = None) -> bytes:
    """Return a GLB with these meshes (all with material 0, if there is one) and nodes; node 0 is the root."""
    blob, views, accessors, meshes = b"", [], [], []
    for vertices, faces in parts:
        ids = []
        points, indices = vertices.astype("<f4"), faces.reshape(-1).astype("<u4")
        for values, component, kind in ((points, 5126, "VEC3"), (indices, 5125, "SCALAR")):
            views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": values.nbytes})
            accessors.append({
                "bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind
            })  # fmt: skip
            ids.append(len(accessors) - 1)
            blob += values.tobytes()
        primitive = {"attributes": {"POSITION": ids[0]}, "indices": ids[1]} | ({"material": 0} if materials else {})
        meshes.append({"primitives": [primitive]})
    text = json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes, "meshes": meshes,
        "materials": materials or [], "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }).encode()  # fmt: skip
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def two_boxes(folder: Path) -> Path:
    (folder / "a.obj").write_text(obj(*box()))
    (folder / "b.obj").write_text(obj(*box(at=(20.0, 0.0, 0.0))))
    return folder


def test_folder_of_every_mesh_format_in_millimetres(tmp_path):
    shape = box()
    for k, encoding in enumerate(("ascii", "binary_little_endian", "binary_big_endian")):
        (tmp_path / f"ply_{k}.ply").write_bytes(ply(*shape, encoding))
    (tmp_path / "part_10.stl").write_bytes(binary_stl(*shape))
    (tmp_path / "part_2.STL").write_text(ascii_stl(*shape))
    (tmp_path / "part_1.obj").write_text(obj(*shape))
    (tmp_path / "meta.json").write_text("{}")
    assembly = read_assembly(tmp_path)
    assert assembly.names == ("part_1", "part_2", "part_10", "ply_0", "ply_1", "ply_2")
    assert any("millimetres assumed" in note for note in assembly.notes)
    assert assembly.source is not None
    assert assembly.source.unit == "mm"
    assert assembly.identical == (assembly.names,)
    for part in assembly.parts:
        assert measures.volume(part.vertices_part, part.faces) == pytest.approx(6e-6)
        np.testing.assert_array_equal(part.T_world_part, np.eye(4))
        np.testing.assert_allclose(part.bounds_world, [[0, 0, 0], [0.01, 0.02, 0.03]], atol=1e-9)
    assert assembly.part("ply_1").color == pytest.approx((1.0, 0.0, 0.0))


def test_unit_scales_and_is_not_remarked_on(tmp_path):
    assembly = read_assembly(two_boxes(tmp_path), unit="in")
    assert assembly.bounds_world[1, 0] == pytest.approx(30 * 0.0254)
    assert not assembly.notes
    with pytest.raises(InputError, match="unit 'parsec' is not known"):
        read_assembly(tmp_path, unit="parsec")


def test_implausible_size_is_noted(tmp_path):
    assert any("check the unit" in n for n in read_assembly(two_boxes(tmp_path), unit="um").notes)
    assert any(
        "check the unit" in n for n in read_assembly(tmp_path, unit="ft", config=ReadConfig(likely=(0.0, 1.0))).notes
    )


def test_obj_polygons_negative_indices_and_material(tmp_path):
    vertices, _ = box()
    corner = {tuple(v): k for k, v in enumerate(vertices.tolist())}
    x, y, z = 10.0, 20.0, 30.0
    quads = [
        [(0, 0, 0), (0, y, 0), (x, y, 0), (x, 0, 0)], [(0, 0, z), (x, 0, z), (x, y, z), (0, y, z)],
        [(0, 0, 0), (x, 0, 0), (x, 0, z), (0, 0, z)], [(0, y, 0), (0, y, z), (x, y, z), (x, y, 0)],
        [(0, 0, 0), (0, 0, z), (0, y, z), (0, y, 0)], [(x, 0, 0), (x, y, 0), (x, y, z), (x, 0, z)],
    ]  # fmt: skip
    lines = ["mtllib paint.mtl", "usemtl red"] + [f"v {a} {b} {c}" for a, b, c in vertices]
    for quad in quads:
        lines.append("f " + " ".join(f"{corner[p] - len(vertices)}//1" for p in quad))
    two_boxes(tmp_path)
    (tmp_path / "a.obj").write_text("\n".join(lines))
    (tmp_path / "paint.mtl").write_text("newmtl blue\nKd 0 0 1\nnewmtl red\nKd 1 0 0\n")
    part = read_assembly(tmp_path).part("a")
    assert len(part.faces) == 12
    assert measures.volume(part.vertices_part, part.faces) == pytest.approx(6e-6)
    assert part.color == (1.0, 0.0, 0.0)


def test_asap_and_assemble_them_all_poses(tmp_path):
    two_boxes(tmp_path)
    (tmp_path / "translation.json").write_text(json.dumps({"a": [1.0, 2.0, 3.0], "b": [0.0, 0.0, 100.0]}))
    assembly = read_assembly(tmp_path, unit="mm")
    np.testing.assert_allclose(assembly.part("a").T_world_part[:3, 3], [1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(assembly.part("a").vertices_part.min(axis=0), 0.0)
    before = assembly.source
    state = [12.245, 3.8152, 7.0889, 0.3, -0.2, 1.570796]
    (tmp_path / "config.json").write_text(json.dumps({"a": {"initial_state": [0, 0, 0], "final_state": state}}))
    assembly = read_assembly(tmp_path, unit="mm")
    T = assembly.part("a").T_world_part
    turns = zip(state[3:], np.eye(3), strict=True)
    rotations = [Rotation.from_rotvec(angle * axis).as_matrix() for angle, axis in turns]
    np.testing.assert_allclose(T[:3, :3], rotations[2] @ rotations[1] @ rotations[0], atol=1e-12)
    np.testing.assert_allclose(T[:3, 3], np.array(state[:3]) * 1e-3)
    np.testing.assert_array_equal(assembly.part("b").T_world_part, np.eye(4))
    assert "b: no pose in config.json; taken in place" in assembly.notes
    assert before is not None
    assert assembly.source is not None
    assert before.sha256 != assembly.source.sha256
    (tmp_path / "config.json").write_text(json.dumps({"a": {"final_state": [1, 2]}}))
    with pytest.raises(InputError, match="pose of a should be 3 or 6 finite numbers"):
        read_assembly(tmp_path)
    (tmp_path / "config.json").write_text(json.dumps({"editor": {"tab": 4}}))
    assert read_assembly(tmp_path).part("a").T_world_part[0, 3] == pytest.approx(1e-3)


def test_glb_tree_with_mirror_scale_and_instances(tmp_path):
    wedge = arrays(Manifold.hull_points(np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3.0]])))
    nodes = [
        {"name": "product", "children": [1, 2, 3, 4]},
        {"name": "wedge", "mesh": 0, "translation": [5.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.70710678, 0.70710678]},
        {"name": "wedge", "mesh": 0, "scale": [-1.0, 1.0, 1.0]},
        {"name": "group", "translation": [0.0, 0.0, 10.0], "children": [5]},
        {"name": "big", "mesh": 0, "scale": [2.0, 2.0, 2.0], "translation": [0.0, 20.0, 0.0]},
        {"mesh": 0},
    ]
    paint = {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1]}}
    (tmp_path / "scene.glb").write_bytes(glb([wedge], nodes, [paint]))
    assembly = read_assembly(tmp_path / "scene.glb", unit="mm")
    assert assembly.names == ("wedge_1", "wedge_2", "group", "big")
    assert any("unit mm not used" in note for note in assembly.notes)
    volumes = [measures.volume(p.vertices_part, p.faces) for p in assembly.parts]
    np.testing.assert_allclose(volumes, [1.0, 1.0, 1.0, 8.0], rtol=1e-6)
    assert assembly.identical == (("wedge_1", "group"),), "a mirrored part is another part"
    np.testing.assert_allclose(assembly.part("wedge_1").bounds_world, [[3, 0, 0], [5, 1, 3]], atol=1e-6)
    np.testing.assert_allclose(assembly.part("wedge_2").bounds_world, [[-1, 0, 0], [0, 2, 3]], atol=1e-6)
    np.testing.assert_allclose(assembly.part("group").bounds_world, [[0, 0, 10], [1, 2, 13]], atol=1e-6)
    assert all(p.color == pytest.approx((0.1, 0.2, 0.3)) for p in assembly.parts)


def test_3mf_components_and_unit(tmp_path):
    vertices, faces = box(1.0, 1.0, 1.0)
    points = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in vertices)
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces)
    model = f"""<?xml version="1.0"?><model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
      <resources><basematerials id="9"><base name="green" displaycolor="#00FF00FF"/></basematerials>
        <object id="1" name="cube" pid="9" pindex="0"><mesh><vertices>{points}</vertices>
          <triangles>{triangles}</triangles></mesh></object>
        <object id="2" name="pair"><components><component objectid="1"/>
          <component objectid="1" transform="1 0 0 0 1 0 0 0 1 3 0 0"/></components></object></resources>
      <build><item objectid="2" transform="0 1 0 -1 0 0 0 0 1 0 0 5"/></build></model>"""
    relations = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
        'Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
    )
    with zipfile.ZipFile(tmp_path / "two.3mf", "w") as archive:
        archive.writestr("_rels/.rels", relations)
        archive.writestr("3D/3dmodel.model", model)
    assembly = read_assembly(tmp_path / "two.3mf")
    assert assembly.names == ("cube_1", "cube_2")
    assert assembly.identical == (("cube_1", "cube_2"),)
    assert assembly.source is not None
    assert assembly.source.unit == "in"
    np.testing.assert_allclose(assembly.part("cube_2").bounds_world / 0.0254, [[-1, 3, 5], [0, 4, 6]], atol=1e-9)
    assert assembly.part("cube_1").color == (0.0, 1.0, 0.0)


def test_overlap_is_measured_and_touching_is_not(tmp_path):
    (tmp_path / "a.obj").write_text(obj(*box()))
    (tmp_path / "b.obj").write_text(obj(*box(at=(9.0, 0.0, 0.0))))
    (tmp_path / "c.obj").write_text(obj(*box(5.0, 5.0, 5.0, at=(0.0, 0.0, 30.0))))
    (tmp_path / "d.obj").write_text(obj(*box(1.0, 1.0, 1.0, at=(2.0, 2.0, 2.0))))
    overlaps = read_assembly(tmp_path).overlaps
    assert [(o.first, o.second) for o in overlaps] == [("a", "d"), ("a", "b")]
    assert overlaps[0].fraction == pytest.approx(1.0)
    assert overlaps[1].volume == pytest.approx(600e-9)
    assert overlaps[1].fraction == pytest.approx(0.1)


def test_bad_input_is_one_clear_line(tmp_path, capfd):
    def refused(path: Path, pattern: str) -> None:
        with pytest.raises(InputError, match=pattern) as caught:
            read_assembly(path)
        assert "\n" not in str(caught.value)
        assert path.name in str(caught.value)

    refused(tmp_path / "nothing.step", "no such file")
    (tmp_path / "part.obj").write_text(obj(*box()))
    refused(tmp_path / "part.obj", "give the folder")
    for name, content, pattern in [
        ("notes.txt", b"hello", "not supported"),
        ("empty.glb", b"", "empty"),
        ("text.step", b"this is no STEP file", "not a STEP file"),
        ("broken.STP", b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=OOPS(;\n", "broken or cut short"),
        ("hollow.step", b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n", "broken or cut short"),
        ("short.glb", glb([box()], [{"mesh": 0}])[:-100], "cut short"),
        ("random.glb", bytes(range(256)), "not a readable glTF"),
        ("list.gltf", b"[1, 2]", "not a readable glTF"),
        ("draco.gltf", b'{"extensionsRequired": ["KHR_draco_mesh_compression"]}', "KHR_draco_mesh_compression"),
        ("one.glb", glb([box()], [{"mesh": 0, "name": "lid"}]), r"1 part \(lid\); an assembly needs at least 2"),
        ("random.3mf", b"PK but no zip", "not a readable 3MF"),
    ]:
        (tmp_path / name).write_bytes(content)
        refused(tmp_path / name, pattern)
    out, err = capfd.readouterr()
    assert out == err == "", "the STEP converter's own messages stay off the terminal"


@pytest.mark.parametrize(
    ("name", "content", "pattern"),
    [
        ("b.obj", obj(*box()).replace("10.0", "nan", 1), "b.obj: holds coordinates that are not finite"),
        ("b.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "names vertex 8, but there are 3"),
        ("b.obj", "v 0 0 zero\nf 1 1 1\n", "not a readable OBJ"),
        ("b.obj", "# nothing\n", "holds no triangles"),
        ("b.stl", "solid b\nfacet", "not a readable STL"),
        ("b.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nend_header\n1\n", "not a readable PLY"),
        ("a.stl", ascii_stl(*box()), "a.obj and a.stl name the same part"),
    ],
)
def test_bad_mesh_is_named(tmp_path, name, content, pattern):
    (tmp_path / "a.obj").write_text(obj(*box()))
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=pattern):
        read_assembly(tmp_path)


def test_folder_without_meshes_says_what_it_found(tmp_path):
    with pytest.raises(InputError, match="empty"):
        read_assembly(tmp_path)
    (tmp_path / "product.step").write_text("")
    (tmp_path / "readme.txt").write_text("")
    with pytest.raises(InputError, match=r"found product.step, readme.txt\); give .*product.step itself"):
        read_assembly(tmp_path)


def test_all_open_parts_are_named_in_one_line(tmp_path):
    vertices, faces = box()
    for name in ("lid", "base"):
        (tmp_path / f"{name}.obj").write_text(obj(vertices, faces[:-1]))
    (tmp_path / "good.obj").write_text(obj(vertices, faces))
    with pytest.raises(InputError, match=r"2 parts are not closed: base \(mesh has 3 open edges\), lid \(mesh has 3"):
        read_assembly(tmp_path)
    (tmp_path / "base.obj").write_text(obj(vertices, faces))
    with pytest.raises(InputError, match=r"lid\.obj: mesh has 3 open edges; separation needs a closed surface"):
        read_assembly(tmp_path)


def test_names():
    assert unique_names(["bolt", "nut", "bolt"]) == ["bolt_1", "nut", "bolt_2"]
    assert unique_names(["bolt", "bolt", "bolt_1"]) == ["bolt_2", "bolt_3", "bolt_1"]
    assert unique_names(["a", "a", "a_1", "a_1"]) == ["a_1", "a_2", "a_1_1", "a_1_2"]
    assert choose_name(["SOLID", "=>[0:1:1:3]", "NAUO12", " lid\n"]) == "lid"
    assert choose_name(["", "COMPOUND"]) == "part"


def test_digest_is_of_content_and_names(tmp_path):
    def digest(path: Path) -> str:
        source = read_assembly(path).source
        assert source is not None
        return source.sha256

    one, two = tmp_path / "one", tmp_path / "two"
    for folder in (one, two):
        folder.mkdir()
        two_boxes(folder)
    (two / "readme.txt").write_text("not used")
    assert digest(one) == digest(two)
    (two / "b.obj").rename(two / "c.obj")
    assert digest(one) != digest(two)


def test_step_product_tree(shared):
    assembly = read_assembly(shared / "assemblies/pythonocc_demos_as1_oc_214/source.step")
    assert len(assembly) == 18
    assert assembly.names[:4] == ("nut_1", "nut_2", "rod", "bolt_1")
    assert sorted(map(len, assembly.identical)) == [2, 6, 8]
    assert assembly.source is not None
    assert assembly.source.unit == "mm"
    rod = assembly.part("rod")
    assert np.ptp(rod.vertices_part, axis=0).max() == pytest.approx(0.2, rel=1e-3)
    assert assembly.part("nut_1").color is not None
    folder = read_assembly(shared / "assemblies/pythonocc_demos_as1_oc_214", unit="mm")
    np.testing.assert_allclose(assembly.bounds_world, folder.bounds_world, atol=2e-5)


def test_step_with_one_product_comes_apart_into_solids(shared):
    assembly = read_assembly(shared / "assemblies/opendogv3_jig/source.step")
    assert assembly.names == ("jig v4_1", "jig v4_2")
    assert any("holds 2 solids" in note for note in assembly.notes)


def test_step_cut_short(shared, tmp_path):
    data = (shared / "assemblies/opendogv3_jig/source.step").read_bytes()
    (tmp_path / "half.step").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match="broken or cut short"):
        read_assembly(tmp_path / "half.step")


@pytest.mark.slow
def test_every_shared_assembly_loads(shared):
    folders = sorted((shared / "truth").iterdir()) + sorted((shared / "assemblies").iterdir())
    for folder in folders:
        for part in read_assembly(folder).parts:
            assert topology.is_closed(part.faces), f"{folder.name}/{part.name}"
            assert measures.volume(part.vertices_part, part.faces) > 0.0


def step_file(folder: Path) -> Path:
    """The shipped example, under a name of its own."""
    example = Path(__file__).resolve().parents[2] / "src" / "sashimono" / "examples" / "gearbox.step"
    (folder / "gearbox.step").write_bytes(example.read_bytes())
    return folder / "gearbox.step"


@pytest.mark.parametrize(
    ("script", "error", "says"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", InputError, "crashed on it"),
        ("print('ERR: a face has no edges')\nimport sys; open(sys.argv[1], 'wb')", InputError, "a face has no edges"),
        ("import a_package_that_is_absent", RuntimeError, "a_package_that_is_absent"),
    ],
)
def test_the_step_converter_runs_apart(tmp_path, monkeypatch, capfd, script: str, error: type, says: str) -> None:
    """What it prints, and how it dies, stays with it."""
    (tmp_path / "stand_in.py").write_text(script)
    monkeypatch.setattr(step_to_glb, "__file__", str(tmp_path / "stand_in.py"))
    with pytest.raises(error, match=says):
        read_assembly(step_file(tmp_path))
    assert capfd.readouterr() == ("", "")
