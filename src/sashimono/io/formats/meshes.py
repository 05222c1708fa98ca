"""Reading one mesh from an OBJ, STL or PLY file."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from jaxtyping import Int

from sashimono.errors import InputError
from sashimono.geometry.mesh.polygons import triangulate
from sashimono.io.formats.ply import parse_ply
from sashimono.io.raw import Mesh, linear_rgb

SUFFIXES = (".obj", ".stl", ".ply")
"""Mesh files that can stand in a folder."""


def read_mesh(path: Path, data: bytes) -> Mesh:
    """Return the triangles in a mesh file, in the file's unit.

    Raises InputError, naming the file, if it is broken, empty or holds numbers that are not finite.
    """
    suffix = path.suffix.lower()
    try:
        if suffix == ".obj":
            mesh = _parse_obj(data, path.parent)
        else:
            mesh = _parse_stl(data) if suffix == ".stl" else parse_ply(data)
    except (ValueError, IndexError, KeyError, TypeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable {path.suffix[1:].upper()} file ({reason}); export again") from error
    problem = mesh_problem(mesh)
    if problem:
        raise InputError(f"{path}: {problem}; export it again")
    return mesh


def mesh_problem(mesh: Mesh) -> str | None:
    """Return what makes the arrays unusable as a mesh, or None."""
    if len(mesh.faces) == 0:
        return "holds no triangles"
    if mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices):
        return f"a face names vertex {int(mesh.faces.max())}, but there are {len(mesh.vertices)}"
    if not np.isfinite(mesh.vertices[np.unique(mesh.faces)]).all():
        return "holds coordinates that are not finite numbers"
    return None


def _parse_obj(data: bytes, folder: Path) -> Mesh:
    points: list[str] = []
    polygons: list[str] = []
    seen: list[int] = []
    libraries: list[str] = []
    material: str | None = None
    for line in data.decode("utf-8", errors="replace").replace("\\\n", " ").splitlines():
        key, _, rest = line.strip().partition(" ")
        if key == "v":
            points.append(rest)
        elif key == "f":
            polygons.append(rest)
            seen.append(len(points))
        elif key == "mtllib":
            libraries.append(rest.strip())
        elif key == "usemtl" and material is None:
            material = rest.strip()
    vertices = _obj_vertices(points)
    return Mesh(
        vertices=vertices,
        faces=triangulate(vertices, _obj_polygons(polygons, seen)),
        color=_material_color(folder, libraries, material),
    )


def _obj_vertices(points: list[str]) -> np.ndarray:
    if not points:
        return np.zeros((0, 3))
    numbers = np.array(list(map(float, " ".join(points).split())))
    width = len(points[0].split())
    if len(numbers) == width * len(points) and width >= 3:
        return numbers.reshape(len(points), width)[:, :3].copy()
    return np.array([[float(x) for x in point.split()[:3]] for point in points]).reshape(-1, 3)


def _obj_polygons(polygons: list[str], seen: list[int]) -> Int[np.ndarray, "face 3"] | list[list[int]]:
    """Return zero-based corner indices: an array if all are triangles, else lists. Texture and normal indices go."""
    corners = [line.split() for line in (re.sub(r"/\S*", "", "\n".join(polygons)).split("\n") if polygons else [])]
    counts = [len(c) for c in corners]
    indices = [int(x) for c in corners for x in c]
    if 0 in indices:
        raise ValueError("a face names vertex 0; OBJ counts from 1")
    flat = np.array(indices, dtype=np.int64)
    flat = np.where(flat > 0, flat - 1, flat + np.repeat(np.array(seen, dtype=np.int64), counts))
    if all(count == 3 for count in counts):
        return flat.reshape(-1, 3)
    return [row.tolist() for row in np.split(flat, np.cumsum(counts)[:-1])]


def _material_color(folder: Path, libraries: list[str], material: str | None) -> tuple[float, float, float] | None:
    """Return the diffuse colour of the first material used, if its library is there."""
    for library in libraries:
        path = folder / library
        if material is None or not path.is_file():
            continue
        block = re.search(
            rf"newmtl[ \t]+{re.escape(material)}\s(.*?)(?:newmtl|\Z)", path.read_text("utf-8", "replace"), re.DOTALL
        )
        diffuse = re.search(r"^\s*Kd[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", block.group(1), re.MULTILINE) if block else None
        if diffuse:
            return linear_rgb(np.array(diffuse.groups(), dtype=np.float64))
    return None


def _parse_stl(data: bytes) -> Mesh:
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) == 84 + 50 * count:
        layout = [("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("flag", "<u2")]
        records = np.frombuffer(data, dtype=layout, offset=84)
        corners = records["corner"].astype(np.float64)
    elif re.match(rb"\s*solid\b", data) and b"endsolid" in data:
        found = re.findall(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", data)
        corners = np.array(found, dtype=np.float64).reshape(-1, 3, 3)
    else:
        raise ValueError(f"neither ASCII nor a binary STL of {max(count, 0)} triangles, perhaps cut short")
    return Mesh(vertices=corners.reshape(-1, 3), faces=np.arange(3 * len(corners)).reshape(-1, 3))
