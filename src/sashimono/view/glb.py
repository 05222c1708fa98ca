"""The animated glTF file: a node a part, with translation and rotation over time."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly
from sashimono.files import atomic_write
from sashimono.plan import AssemblyPlan
from sashimono.view.appearance import linear_rgb, part_colors
from sashimono.view.config import ViewConfig
from sashimono.view.display_mesh import DisplayMesh
from sashimono.view.keyframes import Keyframes, make_keyframes, quaternion_xyzw, rotation_between
from sashimono.view.playback import UP, played_steps
from sashimono.view.shapes import make_shapes
from sashimono.view.timeline import make_timeline, scene_diagonal, tracks

_FLOAT, _UINT = 5126, 5125
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963


class _Document:
    """A glTF document and its binary buffer, built up piece by piece."""

    def __init__(self) -> None:
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.buffer = bytearray()

    def accessor(self, array: np.ndarray, kind: str, *, target: int | None = None) -> int:
        """Append float32 or uint32 values, with their bounds, and return the accessor's index."""
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": array.nbytes}
        if target is not None:
            view["target"] = target
        self.views.append(view)
        self.buffer += array.tobytes()
        table = array.reshape(len(array), -1)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": _UINT if array.dtype == np.dtype("<u4") else _FLOAT,
                "count": len(array),
                "type": kind,
                "min": table.min(axis=0).tolist(),
                "max": table.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def pack(self, document: dict[str, Any]) -> bytes:
        """Return the GLB file: header, JSON chunk, binary chunk, each padded to 4 bytes."""
        document = {
            **document,
            "buffers": [{"byteLength": len(self.buffer)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
        }
        text = json.dumps(document, allow_nan=False, separators=(",", ":")).encode("utf-8")
        text += b" " * (-len(text) % 4)
        binary = bytes(self.buffer) + b"\0" * (-len(self.buffer) % 4)
        header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(binary))
        return b"".join(
            [header, struct.pack("<I4s", len(text), b"JSON"), text, struct.pack("<I4s", len(binary), b"BIN\0"), binary]
        )


def _add_shape(document: _Document, mesh: DisplayMesh) -> dict[str, Any]:
    """Append the mesh's arrays and return the primitive without its material."""
    positions = document.accessor(mesh.positions.astype("<f4"), "VEC3", target=_ARRAY_BUFFER)
    normals = document.accessor(mesh.normals.astype("<f4"), "VEC3", target=_ARRAY_BUFFER)
    indices = document.accessor(mesh.faces.astype("<u4").reshape(-1), "SCALAR", target=_ELEMENT_ARRAY_BUFFER)
    return {"attributes": {"POSITION": positions, "NORMAL": normals}, "indices": indices}


def _add_animation(document: _Document, animation: dict[str, Any], node: int, frames: Keyframes) -> None:
    times = document.accessor(frames.times, "SCALAR")
    for path, values, kind in (
        ("translation", frames.translations, "VEC3"),
        ("rotation", frames.quaternions_xyzw, "VEC4"),
    ):
        output = document.accessor(values, kind)
        animation["channels"].append({"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}})
        animation["samplers"].append({"input": times, "output": output, "interpolation": "LINEAR"})


def _placed(T: Float[np.ndarray, "4 4"]) -> dict[str, Any]:
    return {"translation": T[:3, 3].tolist(), "rotation": quaternion_xyzw(T[:3, :3]).tolist()}


def _material(color: str, solved: bool) -> dict[str, Any]:
    material: dict[str, Any] = {
        "name": color,
        "pbrMetallicRoughness": {
            "baseColorFactor": [*linear_rgb(color), 1.0 if solved else 0.45],
            "metallicFactor": 0.1,
            "roughnessFactor": 0.6,
        },
    }
    return material if solved else {**material, "alphaMode": "BLEND"}


def render_glb(plan: AssemblyPlan, assembly: Assembly, *, config: ViewConfig | None = None) -> bytes:
    """Return the GLB file as bytes; see `write_glb`."""
    config = config or ViewConfig()
    shapes = make_shapes(assembly.parts, config)
    played = played_steps(plan, assembly, config)
    timeline = make_timeline(plan, played, assembly, config)
    max_deviation = config.max_deviation * scene_diagonal(plan, assembly)
    colors = part_colors(plan, assembly)
    solved = set(plan.placed)
    document = _Document()
    primitives = [_add_shape(document, mesh) for mesh in shapes.meshes]
    palette = sorted({(colors[name], name in solved) for name in assembly.names})
    material_index = {key: k for k, key in enumerate(palette)}

    up = np.array(UP) if plan.table is None else plan.table.normal
    root = {"name": "assembly", "rotation": rotation_between(up, np.array([0.0, 1.0, 0.0])).tolist()}
    nodes: list[dict[str, Any]] = [root]
    meshes: list[dict[str, Any]] = []
    mesh_index: dict[tuple[int, int], int] = {}
    node_of: dict[str, int] = {}
    for part, use in zip(assembly.parts, shapes.uses, strict=True):
        key = (use.shape, material_index[colors[part.name], part.name in solved])
        if key not in mesh_index:
            mesh_index[key] = len(meshes)
            meshes.append({"primitives": [{**primitives[use.shape], "material": key[1]}]})
        node_of[part.name] = len(nodes)
        node = {"name": part.name, **_placed(plan.parts[part.name])}
        nodes.append(node)
        if np.array_equal(use.T_part_shape, np.eye(4)):
            node["mesh"] = mesh_index[key]
        else:
            node["children"] = [len(nodes)]
            nodes.append({"mesh": mesh_index[key], **_placed(use.T_part_shape)})
    root["children"] = list(node_of.values())

    animation: dict[str, Any] = {"name": "assembly", "channels": [], "samplers": []}
    for name, (poses, times) in tracks(played, timeline, plan).items():
        if len(poses) > 1:
            frames = make_keyframes(poses, times, timeline.duration, max_deviation)
            _add_animation(document, animation, node_of[name], frames)
    content: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": f"sashimono {plan.version}".strip()},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes,
        "meshes": meshes,
        "materials": [_material(color, is_solved) for color, is_solved in palette],
    }
    if animation["channels"]:
        content["animations"] = [animation]
    return document.pack(content)


def write_glb(plan: AssemblyPlan, assembly: Assembly, path: str | Path, *, config: ViewConfig | None = None) -> Path:
    """Write an animated glTF 2.0 file that any viewer plays, and return its path.

    Y is up, as glTF asks: a root node turns the table's normal there. Below it there is one node a part, named
    like it, at its assembled pose; its animation has the same times as the HTML viewer. Screw motions are
    resampled so that linear interpolation stays within `ViewConfig.max_deviation`. A subassembly is put together
    beside the others first, and then its parts move alike.

    Raises OSError if ``path`` cannot be written; an earlier file is then still whole.
    """
    with atomic_write(path) as scratch:
        scratch.write_bytes(render_glb(plan, assembly, config=config))
    return Path(path)
