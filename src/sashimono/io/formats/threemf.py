"""Reading the parts of a 3MF package: one part for each mesh that the build places.

3MF Core Specification 1.3 (units, items, components) and the path attribute of the Production Extension.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float, Int

from sashimono.errors import InputError
from sashimono.io.raw import Occurrence, linear_rgb

_CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
_RELATIONS = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_UNITS = {"micron": "um", "millimeter": "mm", "centimeter": "cm", "inch": "in", "foot": "ft", "meter": "m"}
_DEEPEST = 100
_LARGEST = 1_000_000_000
"""Bytes to which one file of the package may unpack."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """A mesh at its place in the build, in the package's unit."""

    names: tuple[str, ...]
    """Names from the mesh's object outward."""
    above: tuple[Occurrence, ...]
    """The objects that it is a component of, the outermost first."""
    T_world_mesh: Float[np.ndarray, "4 4"]
    vertices: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]
    color: tuple[float, float, float] | None
    shape: tuple


@dataclass
class _Package:
    archive: zipfile.ZipFile
    most: int
    """Most meshes that it may place."""
    models: dict[str, ElementTree.Element] = field(default_factory=dict)
    objects: dict[str, dict[str | None, ElementTree.Element]] = field(default_factory=dict)
    meshes: dict[tuple[str, str], tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)
    uses: int = 0
    """How many objects were placed so far."""

    def model(self, path: str) -> ElementTree.Element:
        if path not in self.models:
            self.models[path] = ElementTree.fromstring(_read(self.archive, path))
        return self.models[path]

    def find(self, path: str, object_id: str) -> ElementTree.Element:
        if path not in self.objects:
            found = self.model(path).iterfind(f"{_CORE}resources/{_CORE}object")
            self.objects[path] = {element.get("id"): element for element in found}
        if object_id not in self.objects[path]:
            raise ValueError(f"no object {object_id} in {path}")
        return self.objects[path][object_id]

    def place(
        self,
        path: str,
        object_id: str,
        T: Float[np.ndarray, "4 4"],
        above: tuple[Occurrence, ...],
        out: list[Placed],
    ) -> None:
        """Append the meshes of an object, and of the objects it is composed of."""
        if len(above) > _DEEPEST:
            raise ValueError("its components do not form a tree")
        element = self.find(path, object_id)
        self.uses += 1
        own = Occurrence(number=self.uses, name=element.get("name", ""))
        names = (own.name, *(each.name for each in reversed(above)))
        mesh = element.find(f"{_CORE}mesh")
        if mesh is not None:
            vertices, faces = self._mesh(path, object_id, mesh)
            if len(faces):
                if len(out) == self.most:
                    raise ValueError(f"it places more than {self.most} meshes")
                out.append(Placed(
                    names=names, above=above, T_world_mesh=T, vertices=vertices, faces=faces,
                    color=self._color(path, element), shape=(path, object_id),
                ))  # fmt: skip
        for component in element.iterfind(f"{_CORE}components/{_CORE}component"):
            inner = component.get(_PATH, path).lstrip("/")
            self.place(inner, component.attrib["objectid"], T @ _transform(component), (*above, own), out)

    def _mesh(self, path: str, object_id: str, mesh: ElementTree.Element) -> tuple[np.ndarray, np.ndarray]:
        if (path, object_id) not in self.meshes:
            points = [[float(v.attrib[a]) for a in "xyz"] for v in mesh.iterfind(f"{_CORE}vertices/{_CORE}vertex")]
            corners = [
                [int(t.attrib[a]) for a in ("v1", "v2", "v3")]
                for t in mesh.iterfind(f"{_CORE}triangles/{_CORE}triangle")
            ]
            vertices = np.array(points, dtype=np.float64).reshape(-1, 3)
            self.meshes[path, object_id] = vertices, np.array(corners, dtype=np.int64).reshape(-1, 3)
        return self.meshes[path, object_id]

    def _color(self, path: str, element: ElementTree.Element) -> tuple[float, float, float] | None:
        """Return the object's base material, if it has one."""
        group, index = element.get("pid"), int(element.get("pindex", "0"))
        for materials in self.model(path).iterfind(f"{_CORE}resources/{_CORE}basematerials"):
            if materials.get("id") == group:
                text = list(materials)[index].get("displaycolor", "").lstrip("#")
                return linear_rgb(np.frombuffer(bytes.fromhex(text[:6]), np.uint8) / 255.0) if text else None
        return None


def read_3mf(data: bytes, where: str, *, most: int) -> tuple[list[Placed], str]:
    """Return the placed meshes of a 3MF package in build order, and the name of its unit.

    Raises InputError, naming ``where``, if the package is broken, or places more than ``most`` meshes.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            package = _Package(archive, most)
            root = _root_path(archive)
            model = package.model(root)
            unit = _UNITS[model.get("unit", "millimeter")]
            out: list[Placed] = []
            for item in model.iterfind(f"{_CORE}build/{_CORE}item"):
                package.place(item.get(_PATH, root).lstrip("/"), item.attrib["objectid"], _transform(item), (), out)
            return out, unit
    except (
        zipfile.BadZipFile, zlib.error, ElementTree.ParseError, ValueError, LookupError, EOFError, NotImplementedError,
    ) as error:  # fmt: skip
        reason = " ".join(str(error).split())
        raise InputError(f"{where}: not a readable 3MF file ({reason}); export it again") from error


def _read(archive: zipfile.ZipFile, path: str) -> bytes:
    """Return one file of the package; ValueError if it would unpack to more than a mesh ever takes."""
    size = archive.getinfo(path).file_size
    if size > _LARGEST:
        raise ValueError(f"{path} unpacks to {size / 1e9:.3g} GB")
    return archive.read(path)


def _root_path(archive: zipfile.ZipFile) -> str:
    """Return the path of the package's main model."""
    for relation in ElementTree.fromstring(_read(archive, "_rels/.rels")).iterfind(_RELATIONS):
        if relation.get("Type") == _MODEL:
            return relation.attrib["Target"].lstrip("/")
    raise ValueError("no 3D model in the package")


def _transform(element: ElementTree.Element) -> Float[np.ndarray, "4 4"]:
    """Return an element's placement; 3MF writes 4x3 matrices for row vectors."""
    T = np.eye(4)
    if "transform" in element.attrib:
        T[:3] = np.array(element.attrib["transform"].split(), dtype=np.float64).reshape(4, 3).T
    return T
