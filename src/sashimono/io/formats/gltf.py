"""Reading the parts of a glTF 2.0 scene (.glb, .gltf): one part for each node that has a mesh."""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial.transform import Rotation

from sashimono.errors import InputError
from sashimono.io.raw import Occurrence

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_HARMLESS = ("KHR_mesh_quantization", "KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")


@dataclass(frozen=True, kw_only=True, eq=False)
class Leaf:
    """A node with triangles, at its place in the tree."""

    node: str
    """The node's own name, or empty."""
    mesh: str
    """The mesh's name (the product, in a STEP file), or empty."""
    above: tuple[Occurrence, ...]
    """The nodes above, nearest first."""
    T_world_node: Float[np.ndarray, "4 4"]
    """Product of the placements, perhaps with scale or mirroring [m]."""
    vertices: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]
    color: tuple[float, float, float] | None
    shape: tuple
    """Equal for nodes that show the same geometry."""

    @property
    def ancestors(self) -> tuple[str, ...]:
        """Names of the nodes above, nearest first."""
        return tuple(node.name for node in self.above)


class Document:
    """A parsed glTF file: its JSON and its buffers."""

    def __init__(self, data: bytes, folder: Path | None) -> None:
        self.json, binary = _split(data)
        self.files: dict[str, bytes] = {}
        """Buffers in files of their own, by name."""
        self.buffers = [self._buffer(b, binary, folder) for b in self.json.get("buffers", [])]
        self._cache: dict[tuple, tuple[np.ndarray, np.ndarray]] = {}

    def _buffer(self, buffer: dict, binary: bytes, folder: Path | None) -> bytes:
        uri = buffer.get("uri")
        if uri is None:
            data = binary
        elif uri.startswith("data:"):
            data = base64.b64decode(uri.partition(",")[2], validate=True)
        else:
            path = (folder or Path()) / unquote(uri)
            if folder is None or not path.is_file():
                raise ValueError(f"its buffer {uri} is missing")
            data = self.files[uri] = path.read_bytes()
        if len(data) < buffer["byteLength"]:
            raise ValueError("cut short")
        return data

    def accessor(self, index: int) -> np.ndarray:
        """Return an accessor's values, one row each; normalised integers as floats."""
        a = self.json["accessors"][index]
        dtype, width, count = np.dtype(_COMPONENTS[a["componentType"]]), _WIDTHS[a["type"]], a["count"]
        if "sparse" in a:
            raise ValueError("sparse accessors are not supported")
        if "bufferView" not in a:
            raise ValueError("an accessor has no data")
        view = self.json["bufferViews"][a["bufferView"]]
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        stride = view.get("byteStride", dtype.itemsize * width)
        data = self.buffers[view["buffer"]]
        if start + stride * (count - 1) + dtype.itemsize * width > len(data):
            raise ValueError("an accessor reaches past its buffer")
        values = np.ndarray((count, width), dtype, data, start, (stride, dtype.itemsize))
        if a.get("normalized") and dtype.kind in "iu":
            return np.maximum(values / float(np.iinfo(dtype).max), -1.0)
        return values

    def mesh(self, index: int) -> tuple[np.ndarray, np.ndarray, tuple[float, float, float] | None, tuple]:
        """Return vertices, faces, colour and identity of a mesh; only its triangles count."""
        vertices, faces, key, sizes = [], [], [], []
        total = 0
        for primitive in self.json["meshes"][index]["primitives"]:
            mode = primitive.get("mode", 4)
            if mode < 4 or "POSITION" not in primitive["attributes"]:
                continue
            token = (primitive["attributes"]["POSITION"], primitive.get("indices"), mode)
            if token not in self._cache:
                self._cache[token] = self._primitive(*token)
            points, triangles = self._cache[token]
            vertices.append(points)
            faces.append(triangles + total)
            total += len(points)
            key.append(token)
            sizes.append((len(triangles), -len(sizes), primitive.get("material")))
        if not faces:
            return np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64), None, ()
        return np.concatenate(vertices), np.concatenate(faces), self._color(max(sizes)[2]), tuple(key)

    def _primitive(self, position: int, indices: int | None, mode: int) -> tuple[np.ndarray, np.ndarray]:
        points = self.accessor(position).astype(np.float64)
        flat = np.arange(len(points)) if indices is None else self.accessor(indices)[:, 0].astype(np.int64)
        if mode == 4:
            return points, flat[: len(flat) // 3 * 3].reshape(-1, 3)
        if mode == 5:
            strip = np.column_stack([flat[:-2], flat[1:-1], flat[2:]])
            strip[1::2] = strip[1::2][:, [1, 0, 2]]
            return points, strip
        return points, np.column_stack([np.full(max(len(flat) - 2, 0), flat[0]), flat[1:-1], flat[2:]])

    def _color(self, material: int | None) -> tuple[float, float, float] | None:
        if material is None:
            return None
        pbr = self.json["materials"][material].get("pbrMetallicRoughness", {})
        r, g, b = (min(max(float(x), 0.0), 1.0) for x in pbr.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0))[:3])
        return r, g, b

    def leaves(self) -> Iterator[Leaf]:
        """Yield the nodes with triangles, depth first in file order."""
        scenes = self.json.get("scenes", [])
        nodes = self.json.get("nodes", [])
        below = {c for node in nodes for c in node.get("children", ())}
        roots = scenes[self.json.get("scene", 0)].get("nodes", []) if scenes else sorted(set(range(len(nodes))) - below)
        stack: list[tuple[int, np.ndarray, tuple[Occurrence, ...]]] = [(k, np.eye(4), ()) for k in reversed(roots)]
        visited = 0
        while stack:
            index, T_world_parent, above = stack.pop()
            visited += 1
            if visited > len(nodes):
                raise ValueError("its nodes do not form a tree")
            node = nodes[index]
            T_world_node = T_world_parent @ _local(node)
            name = str(node.get("name", ""))
            own = Occurrence(number=visited, name=name)
            stack += [(c, T_world_node, (own, *above)) for c in reversed(node.get("children", []))]
            if "mesh" not in node:
                continue
            vertices, faces, color, shape = self.mesh(node["mesh"])
            if len(faces):
                yield Leaf(
                    node=name, mesh=str(self.json["meshes"][node["mesh"]].get("name", "")), above=above,
                    T_world_node=T_world_node, vertices=vertices, faces=faces, color=color, shape=shape,
                )  # fmt: skip


def read_gltf(data: bytes, folder: Path | None, where: str, *, most: int) -> tuple[list[Leaf], dict[str, bytes]]:
    """Return the leaves of a .glb or .gltf file in tree order, and the buffer files it uses.

    Raises InputError, naming ``where``, if it is broken, needs an extension that is not supported, or has more than
    ``most`` leaves.
    """
    try:
        document = Document(data, folder)
        unknown = [e for e in document.json.get("extensionsRequired", []) if not str(e).startswith(_HARMLESS)]
        if unknown:
            raise ValueError(f"it needs {', '.join(unknown)}, which is not supported")
        leaves = list(islice(document.leaves(), most + 1))
        if len(leaves) > most:
            raise ValueError(f"it places more than {most} meshes")
        return leaves, document.files
    except (
        ValueError, IndexError, KeyError, TypeError, AttributeError, struct.error, binascii.Error, RecursionError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split())
        raise InputError(f"{where}: not a readable glTF file ({reason}); export it again") from error


def _split(data: bytes) -> tuple[dict[str, Any], bytes]:
    """Return the JSON and the binary chunk of a glTF file."""
    if data[:4] != b"glTF":
        return json.loads(data), b""
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2 or length > len(data):
        raise ValueError("cut short" if version == 2 else f"GLB version {version}")
    at, document, binary = 12, None, b""
    while at + 8 <= length:
        size, kind = struct.unpack_from("<I4s", data, at)
        chunk = data[at + 8 : at + 8 + size]
        if kind == b"JSON":
            document = json.loads(chunk)
        elif kind == b"BIN\0":
            binary = chunk
        at += 8 + size
    if document is None:
        raise ValueError("no JSON chunk")
    return document, binary


def _local(node: dict[str, Any]) -> Float[np.ndarray, "4 4"]:
    """Return a node's own placement."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    T = np.eye(4)
    rotation = Rotation.from_quat(node.get("rotation", (0.0, 0.0, 0.0, 1.0))).as_matrix()
    T[:3, :3] = rotation * np.array(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    T[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return T
