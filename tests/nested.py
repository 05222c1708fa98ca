"""Files with a product tree, written by hand: GLB and 3MF, in metres and millimetres."""

from __future__ import annotations

import json
import struct
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from manifold3d import Manifold

Node = tuple[str, "Manifold | Sequence[Node]"]
"""A name, and a solid in place [m], or what is inside."""


def write_glb(path: Path, root: Node) -> Path:
    """Write a tree of solids as GLB, one node a name, and return the path."""
    blob = b""
    views: list[dict] = []
    accessors: list[dict] = []
    meshes: list[dict] = []
    nodes: list[dict] = []

    def accessor(values: np.ndarray, component: int, kind: str) -> int:
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": values.nbytes})
        entry = {"bufferView": len(views) - 1, "componentType": component, "count": len(values), "type": kind}
        if kind == "VEC3":
            entry |= {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}
        accessors.append(entry)
        blob += values.tobytes()
        return len(accessors) - 1

    def add(node: Node) -> int:
        name, content = node
        place = len(nodes)
        nodes.append({"name": name})
        if isinstance(content, Manifold):
            mesh = content.to_mesh64()
            points = np.array(mesh.vert_properties[:, :3], dtype="<f4")
            corners = np.array(mesh.tri_verts, dtype="<u4").reshape(-1)
            primitive = {
                "attributes": {"POSITION": accessor(points, 5126, "VEC3")},
                "indices": accessor(corners, 5125, "SCALAR"),
            }
            meshes.append({"name": name, "primitives": [primitive]})
            nodes[place]["mesh"] = len(meshes) - 1
        else:
            nodes[place]["children"] = [add(child) for child in content]
        return place

    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [add(root)]}],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path


def write_3mf(path: Path, root: Node) -> Path:
    """Write a tree of solids as 3MF, one object a name, and return the path."""
    objects: list[str] = []

    def add(node: Node) -> int:
        name, content = node
        if isinstance(content, Manifold):
            mesh = content.to_mesh64()
            points = "".join(
                f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in (1e3 * mesh.vert_properties[:, :3]).tolist()
            )
            corners = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.tri_verts.tolist())
            inside = f"<mesh><vertices>{points}</vertices><triangles>{corners}</triangles></mesh>"
        else:
            uses = "".join(f'<component objectid="{add(child)}"/>' for child in content)
            inside = f"<components>{uses}</components>"
        objects.append(f'<object id="{len(objects) + 1}" name="{name}" type="model">{inside}</object>')
        return len(objects)

    top = add(root)
    core = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    model = (
        f'<model unit="millimeter" xmlns="{core}"><resources>{"".join(objects)}</resources>'
        f'<build><item objectid="{top}"/></build></model>'
    )
    relations = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship Id="r" '
        'Target="/3D/3dmodel.model" Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("_rels/.rels", relations)
        archive.writestr("3D/3dmodel.model", model)
    return path
