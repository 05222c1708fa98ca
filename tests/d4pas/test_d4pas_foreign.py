"""Other people's assemblies: found, told apart, read in their own units, and labelled like ours."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import manifold3d
import numpy as np
import pytest
import solids

from sashimono.d4pas.dataset import load
from sashimono.d4pas.foreign import find_assemblies, foreign_rows, read_foreign
from sashimono.d4pas.make import make_dataset
from sashimono.d4pas.rows import RowConfig
from sashimono.d4pas.tables import read_manifest, read_table
from sashimono.errors import InputError
from sashimono.io.read import read_assembly

Manifold = manifold3d.Manifold


def write_obj(path: Path, solid: Manifold, *, scale: float, edges: bool = False) -> None:
    """Write a solid [m] as an OBJ in another unit; with edges as polylines, as the Fusion 360 Gallery has them."""
    mesh = solid.to_mesh64()
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (np.array(mesh.vert_properties[:, :3]) * scale).tolist()]
    lines += ["g face 1"] + [f"f {a} {b} {c}" for a, b, c in (np.array(mesh.tri_verts) + 1).tolist()]
    if edges:
        lines += ["v 900 900 900", "g halfedge 0 edge 0", f"l 1 {len(mesh.vert_properties) + 1}"]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


def plate_and_peg() -> dict[str, Manifold]:
    plate = solids.box((0.06, 0.06, 0.02)) - solids.rod(0.005, 0.04)
    return {"0": plate, "1": solids.rod(0.005, 0.04)}


def write_folder(folder: Path, *, scale: float = 1000.0) -> Path:
    for name, solid in plate_and_peg().items():
        write_obj(folder / f"{name}.obj", solid, scale=scale)
    return folder


def transform(origin: tuple[float, float, float], *axes: tuple[float, float, float]) -> dict[str, Any]:
    named = zip(("x_axis", "y_axis", "z_axis"), axes or np.eye(3).tolist(), strict=True)
    vectors = {"origin": origin, **dict(named)}
    return {key: dict(zip("xyz", vector, strict=True)) for key, vector in vectors.items()}


def write_gallery(folder: Path) -> Path:
    """A plate in the root; below it a turned module at (0, 0, 5) cm, in which the peg lies; hidden bodies.

    The module's x is the world's z, its z the world's y: the peg, along its own z, is turned back by its occurrence.
    """
    peg = solids.rod(0.005, 0.04)
    write_obj(folder / "b-plate.obj", plate_and_peg()["0"], scale=100.0, edges=True)
    write_obj(folder / "b-peg.obj", peg, scale=100.0, edges=True)
    write_obj(folder / "b-clip.obj", peg, scale=100.0)
    write_obj(folder / "assembly.obj", peg, scale=100.0)
    bodies = {key: {"name": key[2:].title(), "type": "BRepBody", "obj": f"{key}.obj"} for key in ("b-plate", "b-peg")}
    bodies["b-clip"] = {"name": "Clip", "type": "BRepBody", "obj": "b-clip.obj"}
    module = transform((0.0, 0.0, 5.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    # in the module, the world's z is x, its x is y, its y is z; its origin lies at x = -5
    peg_in_module = transform((-5.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    shown = {"is_visible": True}
    pin = {"name": "pin", "component": "c-pin", "bodies": {"b-peg": shown}, "transform": peg_in_module, **shown}
    content = {
        "tree": {"root": {"o-module": {"o-pin": {}}, "o-spare": {"o-below": {}}}},
        "root": {"component": "c-root", "bodies": {"b-plate": shown, "b-clip": {"is_visible": False}}},
        "occurrences": {
            "o-module": {"name": "module", "component": "c-module", "bodies": {}, "transform": module, **shown},
            "o-pin": pin,
            "o-spare": {**pin, "name": "spare", "transform": transform((9.0, 0.0, 0.0)), "is_visible": False},
            "o-below": {**pin, "name": "below", "transform": None},
        },
        "components": {
            "c-root": {"name": "root", "bodies": ["b-plate", "b-clip"]},
            "c-module": {"name": "module", "bodies": []},
            "c-pin": {"name": "pin", "bodies": ["b-peg"]},
        },
        "bodies": bodies,
        "joints": None,
        "contacts": [],
    }
    (folder / "assembly.json").write_text(json.dumps(content))
    return folder


def test_gallery_composes_transforms_in_centimetres(tmp_path: Path) -> None:
    assembly = read_assembly(write_gallery(tmp_path))
    assert assembly.names == ("Plate", "pin")
    np.testing.assert_allclose(assembly.part("pin").bounds_world, [[-0.005, -0.005, -0.02], [0.005, 0.005, 0.02]])
    assert assembly.source is not None
    assert assembly.source.unit == "cm"
    assert assembly.overlaps == ()
    assert "hidden in the design, left out: Clip, spare" in assembly.notes


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        ({"tree": {"root": {"o-lost": {}}}}, "no 'o-lost'"),
        ({"bodies": {"b-plate": {"name": "Plate", "obj": "../plate.obj"}, "b-clip": {}, "b-peg": {}}}, "in the folder"),
        ({"bodies": {"b-plate": {"name": "Plate", "obj": "gone.obj"}, "b-clip": {}, "b-peg": {}}}, "is missing"),
    ],
)
def test_broken_gallery_assembly_is_one_clear_line(tmp_path: Path, edit: dict[str, Any], said: str) -> None:
    path = write_gallery(tmp_path) / "assembly.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | edit))
    with pytest.raises(InputError, match=said) as caught:
        read_assembly(tmp_path)
    assert "\n" not in str(caught.value)


def test_assembly_json_of_something_else_is_left_alone(tmp_path: Path) -> None:
    write_folder(tmp_path)
    (tmp_path / "assembly.json").write_text('{"author": "somebody"}')
    assert read_assembly(tmp_path, unit="mm").names == ("0", "1")


def test_each_form_is_found_with_its_unit(tmp_path: Path) -> None:
    write_folder(tmp_path / "multi_assembly" / "00042", scale=100.0)
    write_folder(tmp_path / "beam assembly", scale=100.0)
    states = {"0": {"final_state": [0, 0, 0]}, "1": {"final_state": [0, 0, 0, 0, 0, 0]}}
    (tmp_path / "beam assembly" / "config.json").write_text(json.dumps(states))
    write_folder(tmp_path / "two" / "00007", scale=100.0)
    (tmp_path / "two" / "00007" / "translation.json").write_text(json.dumps({"0": [0, 0, 0], "1": [0, 0, 0]}))
    write_gallery(tmp_path / "100_ab")
    write_folder(tmp_path / "mine", scale=1.0)
    (tmp_path / "mine" / "meta.json").write_text(json.dumps({"units": "m (as made)"}))
    write_folder(tmp_path / "plain")
    (tmp_path / "plain" / "config.json").write_text(json.dumps({"editor": {"tab": 4}}))
    (tmp_path / ".hidden").mkdir()
    items = find_assemblies(tmp_path)
    assert [(item.key, item.family, item.unit) for item in items] == [
        ("100_ab", "fusion360", "cm"),
        ("beam-assembly-" + items[1].key[-8:], "asap", "cm"),
        ("mine", "folder", "m"),
        ("multi_assembly-00042-" + items[3].key[-8:], "assemble-them-all", "cm"),
        ("plain", "folder", "mm"),
        ("two-00007-" + items[5].key[-8:], "assemble-them-all", "cm"),
    ]
    assert items == find_assemblies(tmp_path)
    for item in items:
        assembly = read_foreign(tmp_path / item.params["path"], item.params)
        np.testing.assert_allclose(assembly.bounds_world, [[-0.03, -0.03, -0.02], [0.03, 0.03, 0.02]], atol=1e-9)
    (alone,) = find_assemblies(tmp_path / "mine")
    assert alone.key == "mine"
    assert read_foreign(tmp_path / "mine", alone.params).names == ("0", "1")
    (tmp_path / "mine" / "1.obj").write_text("# gone\n")
    with pytest.raises(InputError, match="has changed"):
        read_foreign(tmp_path / "mine", alone.params)


def test_names_that_collide_stay_apart(tmp_path: Path) -> None:
    for name in ("a-b", "a b", "a/b"):
        write_folder(tmp_path / name)
    keys = [item.key for item in find_assemblies(tmp_path)]
    assert len({key.casefold() for key in keys}) == 3
    assert "a-b" in keys


def test_folders_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        find_assemblies(tmp_path / "absent")
    (tmp_path / "empty" / "below").mkdir(parents=True)
    (tmp_path / "empty" / "below" / "up").symlink_to(tmp_path / "empty")
    (tmp_path / "empty" / "notes.txt").write_text("nothing")
    with pytest.raises(InputError, match="holds no assembly") as caught:
        find_assemblies(tmp_path / "empty")
    assert "\n" not in str(caught.value)


def test_a_broken_assembly_is_a_row_with_its_reason(tmp_path: Path) -> None:
    source = tmp_path / "theirs"
    write_folder(source / "good")
    write_gallery(source / "gallery")
    write_folder(source / "torn")
    (source / "torn" / "1.obj").write_text("v 0 0 x\n")
    write_obj(source / "lone" / "part.obj", solids.box((0.01, 0.01, 0.01)), scale=1000.0)
    for name, solid in zip("ab", (solids.linked_rings().part(key) for key in ("first", "second")), strict=True):
        mesh = manifold3d.Mesh64(
            np.array(solid.vertices_world, dtype=np.float64), np.array(solid.faces, dtype=np.uint64)
        )
        write_obj(source / "rings" / f"{name}.obj", Manifold(mesh), scale=1000.0)
    made = make_dataset(str(source), tmp_path / "out")
    assert (made.blueprints, made.failures) == (2, 3)
    rows = {row["id"]: row for row in read_table(tmp_path / "out", "blueprints")}
    assert {key: row["split"] for key, row in rows.items()} == {"good": "real", "gallery": "real"}
    assert rows["gallery"]["parts"] == ["Plate", "pin"]
    assert rows["gallery"]["orders"] == "2"
    assert len(read_table(tmp_path / "out", "steps")) == 4
    assert load(tmp_path / "out")["good"].assembly().names == ("0", "1")  # whatever the current folder
    failures = {row["id"]: row["reason"] for row in read_table(tmp_path / "out", "failures")}
    assert failures["lone"] == "lone: holds 1 part (part); an assembly needs at least 2"
    assert failures["torn"].startswith("torn/1.obj: not a readable OBJ file")
    assert failures["rings"] == "not solved one part at a time: a, b"
    assert str(tmp_path) not in json.dumps(failures)
    assert read_manifest(tmp_path / "out")["counts"]["real"] == 2
    assert make_dataset(str(source), tmp_path / "out") == made
    write_folder(source / "torn")
    with pytest.raises(InputError, match="holds another finished dataset"):
        make_dataset(str(source), tmp_path / "out")


def test_an_assembly_of_the_test_data(assemblies_folder: Path) -> None:
    (item,) = find_assemblies(assemblies_folder / "asap_beam_assembly")
    assert (item.key, item.unit) == ("asap_beam_assembly", "cm")
    outcome = foreign_rows(item, config=RowConfig())
    assert outcome.rows is not None
    assert outcome.rows["blueprint"]["n_parts"] == 5
    assert outcome.rows["blueprint"]["id"] == "asap_beam_assembly"
