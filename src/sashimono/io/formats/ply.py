"""Reading a mesh from a PLY file, ASCII or binary (Turk, 1994)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sashimono.geometry.mesh.polygons import triangulate
from sashimono.io.raw import Mesh, linear_rgb

_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True)
class _Property:
    name: str
    dtype: str
    count_dtype: str | None = None
    """Type of the length in front of a list; None for a single value."""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: tuple[_Property, ...]


def parse_ply(data: bytes) -> Mesh:
    """Return the mesh in a PLY file; ValueError, IndexError or KeyError if it is broken."""
    encoding, elements, body = _parse_header(data)
    tables = _read_ascii(elements, body) if encoding == "ascii" else _read_binary(elements, body, encoding)
    vertex, face = tables["vertex"], tables["face"]
    vertices = np.column_stack([np.asarray(vertex[axis], dtype=np.float64) for axis in "xyz"])
    polygons = face["vertex_indices"] if "vertex_indices" in face else face["vertex_index"]
    color = None
    for table in (face, vertex):
        if color is None and len(vertices) and all(name in table for name in ("red", "green", "blue")):
            rgb = np.array([np.mean(np.asarray(table[name], dtype=np.float64)) for name in ("red", "green", "blue")])
            color = linear_rgb(rgb / 255.0 if np.asarray(table["red"]).dtype.kind in "iu" else rgb)
    return Mesh(vertices=vertices, faces=triangulate(vertices, polygons), color=color)


def parse_points(data: bytes) -> np.ndarray:
    """Return the points of a PLY file, x, y, z, and their normals if it has them: (point, 3 or 6).

    ValueError, IndexError or KeyError if it is broken.
    """
    encoding, elements, body = _parse_header(data)
    tables = _read_ascii(elements, body) if encoding == "ascii" else _read_binary(elements, body, encoding)
    vertex = tables["vertex"]
    names = [*"xyz", *(("nx", "ny", "nz") if "nx" in vertex else ())]
    return np.column_stack([np.asarray(vertex[name], dtype=np.float64) for name in names])


def _parse_header(data: bytes) -> tuple[str, list[_Element], bytes]:
    head, marker, body = data.partition(b"end_header")
    if not head.startswith(b"ply") or not marker:
        raise ValueError("no PLY header")
    body = body[2:] if body.startswith(b"\r\n") else body[1:]
    encoding, elements = "", []
    for line in head.decode("ascii", errors="replace").splitlines():
        words = line.split()
        if words[:1] == ["format"]:
            encoding = words[1]
        elif words[:1] == ["element"]:
            elements.append(_Element(words[1], int(words[2]), ()))
        elif words[:1] == ["property"]:
            last = elements[-1]
            new = (
                _Property(words[4], _TYPES[words[3]], _TYPES[words[2]])
                if words[1] == "list"
                else _Property(words[2], _TYPES[words[1]])
            )
            elements[-1] = _Element(last.name, last.count, (*last.properties, new))
    if encoding not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise ValueError(f"unknown PLY encoding {encoding!r}")
    return encoding, elements, body


def _read_ascii(elements: list[_Element], body: bytes) -> dict[str, dict]:
    lines = iter(line.split() for line in body.decode("ascii", errors="replace").splitlines() if line.strip())
    tables: dict[str, dict] = {}
    for element in elements:
        rows: dict[str, list] = {p.name: [] for p in element.properties}
        for _ in range(element.count):
            words = next(lines, None)
            if words is None:
                raise ValueError(f"cut short in its {element.name} list")
            at = 0
            for p in element.properties:
                kind = float if p.dtype[0] == "f" else int
                if p.count_dtype is None:
                    rows[p.name].append(kind(words[at]))
                    at += 1
                else:
                    length = int(words[at])
                    if not 0 <= length < len(words) - at:
                        raise ValueError(f"a list of its {element.name} list is not as long as it says")
                    rows[p.name].append([kind(w) for w in words[at + 1 : at + 1 + length]])
                    at += 1 + length
        tables[element.name] = {p.name: _column(rows[p.name], p) for p in element.properties}
    return tables


def _column(values: list, p: _Property) -> list | np.ndarray:
    return np.array(values, dtype=p.dtype) if p.count_dtype is None else values


def _read_binary(elements: list[_Element], body: bytes, encoding: str) -> dict[str, dict]:
    order = "<" if encoding == "binary_little_endian" else ">"
    tables: dict[str, dict] = {}
    at = 0
    for element in elements:
        table, at = _binary_rows(element, body, at, order)
        tables[element.name] = table
    return tables


def _binary_rows(element: _Element, body: bytes, at: int, order: str) -> tuple[dict, int]:
    """Return one element's columns. If all its lists are as long as in the first row, NumPy reads them at once."""
    fields = []
    probe = at
    for p in element.properties:
        if p.count_dtype is None:
            fields.append((p.name, order + p.dtype))
            probe += np.dtype(p.dtype).itemsize
        elif element.count:
            length = int(np.frombuffer(body, order + p.count_dtype, 1, probe)[0])
            fields += [(p.name + " length", order + p.count_dtype), (p.name, order + p.dtype, (length,))]
            probe += np.dtype(p.count_dtype).itemsize + length * np.dtype(p.dtype).itemsize
    if element.count == 0:
        return {p.name: _column([], p) for p in element.properties}, at
    row = np.dtype(fields)
    lists = [p for p in element.properties if p.count_dtype is not None]
    if at + element.count * row.itemsize <= len(body):
        table = np.frombuffer(body, row, element.count, at)
        if all((table[p.name + " length"] == row[p.name].shape[0]).all() for p in lists):
            columns = {p.name: table[p.name] for p in element.properties}
            return {k: v.tolist() if v.ndim > 1 else v for k, v in columns.items()}, at + element.count * row.itemsize
    elif not lists:
        raise ValueError(f"cut short in its {element.name} list")
    return _binary_rows_one_by_one(element, body, at, order)


def _binary_rows_one_by_one(element: _Element, body: bytes, at: int, order: str) -> tuple[dict, int]:
    rows: dict[str, list] = {p.name: [] for p in element.properties}
    for _ in range(element.count):
        for p in element.properties:
            length = 1
            if p.count_dtype is not None:
                length = int(np.frombuffer(body, order + p.count_dtype, 1, at)[0])
                if length < 0:  # which NumPy would take as "all the rest"
                    raise ValueError(f"a list of its {element.name} list has {length} items")
                at += np.dtype(p.count_dtype).itemsize
            values = np.frombuffer(body, order + p.dtype, length, at)
            at += values.nbytes
            rows[p.name].append(values.tolist() if p.count_dtype is not None else values[0])
    return {p.name: _column(rows[p.name], p) for p in element.properties}, at
