"""What the viewer files hold, without a browser."""

from __future__ import annotations

import base64
import json
import os
import re
import struct
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from view_example import HOSTILE_NAMES, NAMES, box, paired_blocks, stacked_blocks

from sashimono.assembly import Assembly, Part
from sashimono.geometry import se3
from sashimono.plan import Motion, Segment, Step, Table
from sashimono.view import ViewConfig, write_glb, write_html
from sashimono.view.appearance import linear_rgb, srgb_hex
from sashimono.view.display_mesh import make_display_mesh
from sashimono.view.explode import explode, explosion_offsets
from sashimono.view.glb import render_glb
from sashimono.view.html import render_html
from sashimono.view.keyframes import make_keyframes, rotation_between
from sashimono.view.lookout import step_lookouts
from sashimono.view.playback import played_steps
from sashimono.view.scene import make_scene, pack_octahedral
from sashimono.view.shapes import fit_rigid, make_shapes
from sashimono.view.timeline import bounds_at, make_timeline, path_lengths, tracks

CREASE = ViewConfig().crease_angle


def read_glb(content: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the binary chunk, after checking the container."""
    magic, version, length = struct.unpack_from("<4sII", content)
    assert (magic, version, length) == (b"glTF", 2, len(content))
    json_length, kind = struct.unpack_from("<I4s", content, 12)
    assert kind == b"JSON"
    binary_length, kind = struct.unpack_from("<I4s", content, 20 + json_length)
    assert kind == b"BIN\0"
    assert json_length % 4 == binary_length % 4 == 0
    return json.loads(content[20 : 20 + json_length]), content[28 + json_length :]


def read_accessor(document: dict[str, Any], binary: bytes, index: int) -> np.ndarray:
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    assert view["byteOffset"] % 4 == 0
    dtype = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
    values = np.frombuffer(binary, dtype, accessor["count"] * width, view["byteOffset"]).reshape(-1, width)
    assert values.nbytes == view["byteLength"]
    assert np.array_equal(values.min(axis=0), np.array(accessor["min"], dtype))
    assert np.array_equal(values.max(axis=0), np.array(accessor["max"], dtype))
    return values


def test_cube_keeps_its_twelve_edges_and_flat_faces() -> None:
    vertices, faces = box((1.0, 2.0, 3.0))
    mesh = make_display_mesh(vertices, faces, crease_angle=CREASE)
    assert len(mesh.positions) == 24
    assert len(mesh.faces) == 12
    assert len(mesh.edges) == 12
    assert np.allclose(np.abs(mesh.normals).max(axis=1), 1.0)
    assert np.allclose(np.linalg.norm(np.diff(mesh.positions[mesh.edges], axis=1)[:, 0], axis=1).sum(), 24.0)


def test_cylinder_is_smooth_around_and_sharp_at_its_rims() -> None:
    cylinder = trimesh.creation.cylinder(radius=1.0, height=2.0, sections=48)
    mesh = make_display_mesh(cylinder.vertices, cylinder.faces, crease_angle=CREASE)
    assert len(mesh.edges) == 96
    side = np.abs(mesh.normals[:, 2]) < 0.5
    radial = mesh.positions[side, :2]
    assert np.allclose(mesh.normals[side, :2], radial, atol=1e-3)
    assert np.allclose(np.abs(mesh.normals[~side, 2]), 1.0)


def test_seams_are_welded_and_slivers_do_no_harm() -> None:
    vertices, faces = box((1.0, 1.0, 1.0))
    soup = vertices[faces].reshape(-1, 3)
    soup_faces = np.vstack([np.arange(36).reshape(-1, 3), [[0, 0, 1], [0, 1, 0]]])
    mesh = make_display_mesh(soup, soup_faces, crease_angle=CREASE)
    assert len(mesh.faces) == 12
    assert len(mesh.edges) == 12
    assert np.isfinite(mesh.normals).all()


def test_large_meshes_are_simplified_for_display() -> None:
    sphere = trimesh.creation.icosphere(subdivisions=6)
    part = Part(name="ball", vertices_part=sphere.vertices, faces=sphere.faces, T_world_part=np.eye(4))
    full = make_shapes((part,), ViewConfig())
    small = make_shapes((part,), ViewConfig(max_faces=15_000))
    assert not full.decimated
    assert len(full.meshes[0].faces) == len(sphere.faces)
    assert small.decimated
    assert 10_000 < len(small.meshes[0].faces) < 0.6 * len(sphere.faces)
    assert np.abs(np.linalg.norm(small.meshes[0].positions, axis=1) - 1.0).max() < 1e-6


@given(st.integers(0, 2**32 - 1))
def test_octahedral_normals_survive(seed: int) -> None:
    normals = np.random.default_rng(seed).normal(size=(20, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    packed = pack_octahedral(np.vstack([normals, np.eye(3), -np.eye(3)])) / 32767.0
    z = 1.0 - np.abs(packed).sum(axis=1)
    folded = (1.0 - np.abs(packed[:, ::-1])) * np.where(packed < 0.0, -1.0, 1.0)
    back = np.column_stack([np.where(z[:, None] < 0.0, folded, packed), z])
    back /= np.linalg.norm(back, axis=1, keepdims=True)
    assert np.abs(back - np.vstack([normals, np.eye(3), -np.eye(3)])).max() < 2e-4


def test_rigid_copies_share_a_shape_and_mirror_images_do_not() -> None:
    rng = np.random.default_rng(3)
    vertices, faces = rng.normal(size=(9, 3)), np.array([[0, 1, 2], [3, 4, 5], [6, 7, 8]])
    T = se3.exp(np.array([1.0, 2.0, 3.0, 0.5, -1.0, 2.0]))
    copies = (vertices, se3.apply(T, vertices), vertices * [1, 1, -1], 1.1 * vertices)
    parts = tuple(Part(name=str(k), vertices_part=v, faces=faces, T_world_part=np.eye(4)) for k, v in enumerate(copies))
    shapes = make_shapes(parts, ViewConfig())
    assert [use.shape for use in shapes.uses] == [0, 0, 1, 2]
    assert np.allclose(shapes.uses[1].T_part_shape, T)
    assert fit_rigid(vertices, 1.1 * vertices, 1e-3) is None


def test_times_follow_path_length_and_insertions_are_slower() -> None:
    plan, assembly = stacked_blocks()
    config = ViewConfig(min_move_seconds=0.0)
    timeline = make_timeline(plan, played_steps(plan, assembly, config), assembly, config)
    for step, timing in zip(plan.steps[1:], timeline.steps[1:], strict=True):
        speed = path_lengths(step.motion.T_world_part, assembly.part(step.part)) / np.diff(timing.pose_times)
        assert speed[0] == pytest.approx(speed[1])
        assert speed[2] == pytest.approx(speed[0] / config.insertion_slowdown)
        assert timing.start + config.hold_seconds == pytest.approx(timing.pose_times[0])
    starts = [timing.start for timing in timeline.steps]
    assert starts[1:] == [timing.stop for timing in timeline.steps[:-1]]
    assert timeline.duration == timeline.steps[-1].stop


def test_a_subassembly_is_put_together_beside_the_others_and_goes_on_from_there() -> None:
    plan, assembly = paired_blocks()
    config = ViewConfig()
    played = played_steps(plan, assembly, config)
    assert [(entry.label, entry.depth) for entry in played] == [("1", 0), ("2", 0), ("3.1", 1), ("3.2", 1), ("3", 0)]
    shown = tracks(played, make_timeline(plan, played, assembly, config), plan)
    pair = plan.steps[-1]
    for name in pair.members:
        poses, times = shown[name]
        assert (np.diff(times) > 0.0).all()
        np.testing.assert_allclose(poses[-1], plan.parts[name], atol=1e-12)
    # what follows a step begins where the step has left each part
    inner, whole = played[3], played[4]
    np.testing.assert_allclose(whole.member_poses(pair.members[1], plan.parts)[0], inner.poses[-1], atol=1e-12)
    carry = whole.segments[0]
    assert carry.kind == "carry"
    np.testing.assert_allclose(whole.poses[carry.stop :], pair.motion.T_world_part, atol=1e-12)
    # nothing else is where it is put together, on the table
    bench = [bounds_at(assembly.part(e.step.part), T) for e in played[2:4] for T in e.poses]
    low, high = np.min(bench, axis=0)[0], np.max(bench, axis=0)[1]
    assert plan.table is not None
    assert low @ plan.table.normal == pytest.approx(plan.table.offset)
    for step in (*plan.steps[:2], pair):
        for T in step.motion.T_world_part[[0, -1]]:
            box_ = bounds_at(assembly.part(step.part), T)
            assert (box_[0] > high).any() or (box_[1] < low).any()


def test_a_turn_in_place_and_a_repeated_pose_take_time() -> None:
    vertices, faces = box((1.0, 1.0, 1.0))
    part = Part(name="a", vertices_part=vertices, faces=faces, T_world_part=np.eye(4))
    turned = se3.make(se3.exp_so3(np.array([0.0, 0.0, 0.5])))
    motion = Motion(
        T_world_part=np.array([turned, turned, np.eye(4)]), segments=(Segment(kind="transit", start=0, stop=2),)
    )
    assert np.allclose(path_lengths(motion.T_world_part, part), [0.0, 0.5 * np.sqrt(0.75)])


def test_explosion_clears_every_part_and_keeps_the_base() -> None:
    plan, assembly = stacked_blocks()
    offsets = explosion_offsets(plan, assembly, ViewConfig())
    assert not offsets[NAMES[0]].any()
    bottoms = [part.bounds_world[:, 2] + offsets[part.name][2] for part in assembly.parts]
    for below, above in pairwise(bottoms):
        assert above[0] > below[1] + 1e-3


def test_drawn_apart_parts_stay_on_the_axis_of_what_they_sit_on() -> None:
    """A plate pushed on from the side, a pin from above through it into the base: the pin stays over its hole."""
    vertices, faces = box((0.04, 0.04, 0.02))
    thin, _ = box((0.005, 0.005, 0.06))
    plan, _ = stacked_blocks()
    sizes = {
        "base": (vertices, (0.0, 0.0, 0.01)),
        "plate": (vertices, (0.0, 0.0, 0.03)),
        "pin": (thin, (0.0, 0.0, 0.05)),
    }
    parts = tuple(
        Part(name=name, vertices_part=v, faces=faces, T_world_part=se3.make(translation=np.array(at)))
        for name, (v, at) in sizes.items()
    )
    assembly = Assembly(parts=parts)

    def way(part: Part, back: tuple[float, float, float]) -> Motion:
        poses = np.array([se3.make(translation=np.array(back)) @ part.T_world_part, part.T_world_part])
        return Motion(T_world_part=poses, segments=(Segment(kind="insertion", start=0, stop=1),))

    steps = (
        Step(part="base", fixed=(), motion=Motion(T_world_part=parts[0].T_world_part[None], segments=()), contact=None),
        Step(part="plate", fixed=("base",), motion=way(parts[1], (0.2, 0.0, 0.0)), contact=None),
        Step(part="pin", fixed=("base", "plate"), motion=way(parts[2], (0.0, 0.0, 0.2)), contact=None),
    )
    plan = replace(
        plan, parts={part.name: part.T_world_part for part in parts}, order=assembly.names, steps=steps, unsolved=()
    )
    found = explode(plan, assembly, ViewConfig())
    assert found.seats["plate"] == "base"
    assert found.pulls["base"] == ()
    seat = found.seats["pin"]
    apart = found.offset("pin") - found.offset(seat)
    np.testing.assert_allclose(apart[:2], 0.0, atol=1e-12)
    # beyond the part it sits on, never below it
    assert (parts[2].bounds_world[0] + found.offset("pin"))[2] > (
        assembly.part(seat).bounds_world[1] + found.offset(seat)
    )[2]
    assert found.offset("plate")[0] > 0.04
    assert [pull.turn for pull in found.pulls["pin"]] == sorted(pull.turn for pull in found.pulls["pin"])


def test_what_is_drawn_out_of_a_turned_part_goes_no_farther_than_out_of_a_straight_one() -> None:
    """A pin in the side of a long bar: the box about a slanting bar is many times as deep as the bar."""
    vertices, faces = box((0.2, 0.02, 0.02))
    thin, _ = box((0.004, 0.01, 0.004))
    plan, _ = stacked_blocks()
    travel = []
    for angle in (0.0, np.radians(40.0)):
        turn = se3.make(se3.exp_so3(np.array([0.0, 0.0, angle])))
        bar = Part(name="bar", vertices_part=vertices, faces=faces, T_world_part=turn)
        T = turn @ se3.make(translation=np.array([0.0, 0.006, 0.0]))
        pin = Part(name="pin", vertices_part=thin, faces=faces, T_world_part=T)
        back = T @ se3.make(translation=np.array([0.0, 0.03, 0.0]))
        steps = (
            Step(part="bar", fixed=(), motion=Motion(T_world_part=turn[None], segments=()), contact=None),
            Step(
                part="pin",
                fixed=("bar",),
                motion=Motion(T_world_part=np.array([back, T]), segments=(Segment(kind="insertion", start=0, stop=1),)),
                contact=None,
            ),
        )
        made = replace(plan, parts={"bar": turn, "pin": T}, order=("bar", "pin"), steps=steps, unsolved=())
        out = explode(made, Assembly(parts=(bar, pin)), replace(ViewConfig(), explode_gap=0.0)).offset("pin")
        travel.append(float(np.linalg.norm(out)))
    assert travel[1] == pytest.approx(travel[0])
    assert travel[0] == pytest.approx(0.01), "its own length"


def test_a_subassembly_is_drawn_apart_in_itself_too() -> None:
    plan, assembly = paired_blocks()
    found = explode(plan, assembly, ViewConfig())
    lower, upper = plan.steps[-1].members
    assert found.seats[lower] == found.seats[lower] == plan.steps[1].part
    group = found.pulls[lower]
    assert found.pulls[upper][: len(group)] == group
    assert (found.offset(upper) - found.offset(lower))[2] > 0.0
    assert [pull.turn for pull in found.pulls[upper]] == [1, 4, 3]


@given(st.integers(0, 2**32 - 1), st.floats(0.0, np.pi - 1e-3))
def test_keyframes_follow_the_screw(seed: int, angle: float) -> None:
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    a = se3.exp(rng.normal(size=6))
    b = a @ se3.exp(np.concatenate([rng.normal(size=3), angle * axis / np.linalg.norm(axis)]))
    frames = make_keyframes(np.array([a, b]), np.array([0.5, 2.5]), 3.0, 1e-3)
    assert (np.diff(frames.times) > 0.0).all()
    assert frames.times[0] == 0.0
    assert frames.times[-1] == 3.0
    q = frames.quaternions_xyzw
    assert np.allclose(np.linalg.norm(q, axis=1), 1.0, atol=1e-6)
    assert ((q[1:] * q[:-1]).sum(axis=1) > 0.5).all()
    for t in rng.uniform(0.0, 3.0, 5):
        expected = se3.interpolate(a, b, float(np.clip((t - 0.5) / 2.0, 0.0, 1.0)))
        k = int(np.searchsorted(frames.times, t)) - 1
        u = (t - frames.times[k]) / (frames.times[k + 1] - frames.times[k])
        position = (1 - u) * frames.translations[k] + u * frames.translations[k + 1]
        assert np.linalg.norm(position - expected[:3, 3]) < 1.1e-3
        turn = Rotation.from_quat(q[k]).inv() * Rotation.from_quat(q[k + 1])
        rotation = Rotation.from_quat(q[k]) * Rotation.from_rotvec(u * turn.as_rotvec())
        assert np.allclose(rotation.as_matrix(), expected[:3, :3], atol=1e-5)


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0), (1.0, 2.0, -3.0)])
def test_rotation_between_directions(up: tuple[float, float, float]) -> None:
    rotation = Rotation.from_quat(rotation_between(np.array(up), np.array([0.0, 1.0, 0.0])))
    assert np.allclose(rotation.apply(up) / np.linalg.norm(up), [0.0, 1.0, 0.0])


def test_glb_is_valid_and_ends_assembled(tmp_path: Path) -> None:
    plan, assembly = stacked_blocks(unsolved=1)
    document, binary = read_glb(write_glb(plan, assembly, tmp_path / "plan.glb").read_bytes())
    for k in range(len(document["accessors"])):
        read_accessor(document, binary, k)
    nodes = document["nodes"]
    root = Rotation.from_quat(nodes[0]["rotation"])
    assert np.allclose(root.apply([0.0, 0.0, 1.0]), [0.0, 1.0, 0.0])
    assert [nodes[k]["name"] for k in nodes[0]["children"]] == list(NAMES)
    duration = make_timeline(plan, played_steps(plan, assembly, ViewConfig()), assembly, ViewConfig()).duration
    (animation,) = document["animations"]
    assert len(animation["channels"]) == 2 * (len(plan.steps) - 1)
    for channel in animation["channels"]:
        sampler = animation["samplers"][channel["sampler"]]
        times = read_accessor(document, binary, sampler["input"])[:, 0]
        values = read_accessor(document, binary, sampler["output"])
        node = nodes[channel["target"]["node"]]
        step = next(step for step in plan.steps if step.part == node["name"])
        assert (np.diff(times) > 0.0).all()
        assert times[-1] == pytest.approx(duration, abs=1e-5)
        assert len(values) == len(times)
        path = channel["target"]["path"]
        if path == "translation":
            assert np.allclose(values[0], step.motion.T_world_part[0][:3, 3], atol=1e-6)
        assert np.allclose(np.abs(values[-1]), np.abs(node[path]), atol=1e-6)
    assert [material.get("alphaMode") for material in document["materials"]].count("BLEND") == 1
    assert len(document["meshes"]) == 3, "base, moved and unsolved blocks: one shape in three colours"


def test_glb_is_read_by_trimesh(tmp_path: Path) -> None:
    plan, assembly = stacked_blocks()
    scene = trimesh.load_scene(write_glb(plan, assembly, tmp_path / "plan.glb"))
    lower, upper = assembly.bounds_world
    # z up becomes y up
    expected = np.array([[lower[0], lower[2], -upper[1]], [upper[0], upper[2], -lower[1]]])
    assert np.allclose(scene.bounds, expected, atol=1e-6)


def test_html_is_one_file_that_needs_nothing_else(tmp_path: Path) -> None:
    plan, assembly = stacked_blocks()
    text = write_html(plan, assembly, tmp_path / "plan.html").read_text(encoding="utf-8")
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", text)
    assert "default-src 'none'" in text
    assert len(text) < 1_000_000
    assert "%%" not in text.replace("%%=", "")


def test_html_holds_names_safely_and_whole() -> None:
    plan, assembly = stacked_blocks(names=HOSTILE_NAMES, unsolved=1)
    text = render_html(plan, assembly)
    assert "window.broken" in text
    assert "<script>window.broken" not in text
    assert "<img" not in text
    data = re.search(r'<script type="application/json" id="plan">(.*?)</script>', text, re.DOTALL)
    assert data is not None
    scene = json.loads(data.group(1))
    assert tuple(part["name"] for part in scene["parts"]) == HOSTILE_NAMES
    assert scene["title"] == "blocks"
    assert "somewhere" not in text


def test_geometry_in_the_page_is_the_geometry() -> None:
    plan, assembly = stacked_blocks()
    scene = make_scene(plan, assembly, ViewConfig())
    (shape,) = scene.json["shapes"]
    cells = np.frombuffer(scene.geometry, "<u2", 3 * shape["vertices"], shape["positionAt"]).reshape(-1, 3)
    positions = np.array(shape["origin"]) + cells * np.array(shape["cell"])
    faces = np.frombuffer(scene.geometry, "<u2", 3 * shape["faces"], shape["faceAt"]).reshape(-1, 3)
    mesh = trimesh.Trimesh(positions, faces)
    assert mesh.volume == pytest.approx(0.04 * 0.03 * 0.02, rel=1e-3)
    assert base64.b64encode(scene.geometry).decode() in render_html(plan, assembly)


def test_files_are_whole_or_absent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan, assembly = stacked_blocks()
    target = tmp_path / "plan.glb"
    target.write_bytes(b"earlier")

    def refuse(*_: object) -> None:
        raise OSError("no")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OSError, match="no"):
        write_glb(plan, assembly, target)
    assert [path.name for path in tmp_path.iterdir()] == ["plan.glb"]
    assert target.read_bytes() == b"earlier"


def test_a_plan_without_any_step_is_shown() -> None:
    plan, assembly = stacked_blocks(unsolved=4)
    assert "animations" not in read_glb(render_glb(plan, assembly))[0]
    scene = make_scene(plan, assembly, ViewConfig())
    assert scene.json["duration"] > 0.0
    assert [row["answer"] for row in scene.json["unsolved"]] == ["PROVEN_BLOCKED"] * 4


def test_same_plan_same_bytes() -> None:
    plan, assembly = stacked_blocks()
    assert render_glb(plan, assembly) == render_glb(*stacked_blocks())
    assert render_html(plan, assembly) == render_html(*stacked_blocks())


@given(st.integers(0, 0xFFFFFF))
def test_colours_survive_the_way_to_linear_and_back(value: int) -> None:
    color = f"#{value:06x}"
    assert srgb_hex(linear_rgb(color)) == color


def test_each_step_is_seen_from_above_its_table_and_its_way_is_told_from_there() -> None:
    plan, assembly = paired_blocks()
    pair = plan.steps[-1]
    assert pair.subassembly is not None
    # the inside is put together upside down
    below = replace(pair.subassembly, table=Table(normal=np.array([0.0, 0.0, -1.0]), offset=-0.1))
    plan = replace(plan, steps=(*plan.steps[:-1], replace(pair, subassembly=below)))
    played = played_steps(plan, assembly, ViewConfig())
    lookouts = step_lookouts(plan, played, assembly)
    assert [found is None for found in lookouts] == [not entry.step.moves for entry in played]
    for found in lookouts:
        if found is not None:
            assert np.linalg.norm(found.toward) == pytest.approx(1.0)
            assert found.toward[2] > 0.1
            assert set(found.hiding) <= set(assembly.names)
    steps = {step["label"]: step for step in make_scene(plan, assembly, ViewConfig()).json["steps"]}
    assert steps["2"]["way"].startswith("down")
    assert steps["3.2"]["way"].startswith("up")  # on its bench the same way is turned over
    assert steps["1"]["look"] is None
