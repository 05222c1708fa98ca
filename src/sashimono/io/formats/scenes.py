"""Scenes with placed, named parts: glTF, 3MF, and what the STEP converter makes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from sashimono.errors import InputError
from sashimono.geometry import se3
from sashimono.io.formats.gltf import read_gltf
from sashimono.io.formats.threemf import read_3mf
from sashimono.io.names import choose_name
from sashimono.io.raw import METRES, Occurrence, RawAssembly, RawPart


def read_gltf_scene(path: Path, data: bytes, *, most: int) -> RawAssembly:
    """Return the parts of a .glb or .gltf file, named by their nodes; InputError if it is broken or has too many."""
    leaves, buffers = read_gltf(data, path.parent, str(path), most=most)
    shapes = number_shapes([leaf.shape for leaf in leaves])
    parts = [
        place(
            name=choose_name((leaf.node, leaf.mesh, *leaf.ancestors)), where=str(path), T=leaf.T_world_node,
            vertices=leaf.vertices, faces=leaf.faces, color=leaf.color, shape=shape, products=leaf.above[::-1],
        )
        for leaf, shape in zip(leaves, shapes, strict=True)
    ]  # fmt: skip
    return RawAssembly(parts=tuple(parts), unit="m", files={path.name: data, **buffers}, split_single=True)


def read_3mf_scene(path: Path, data: bytes, *, most: int) -> RawAssembly:
    """Return the parts of a .3mf file, named by their objects; InputError if it is broken or has too many."""
    placed, unit = read_3mf(data, str(path), most=most)
    shapes = number_shapes([p.shape for p in placed])
    parts = []
    for p, shape in zip(placed, shapes, strict=True):
        T = p.T_world_mesh.copy()
        T[:3, 3] *= METRES[unit]
        parts.append(place(
            name=choose_name(p.names), where=str(path), T=T, vertices=p.vertices * METRES[unit], faces=p.faces,
            color=p.color, shape=shape, products=p.above,
        ))  # fmt: skip
    return RawAssembly(parts=tuple(parts), unit=unit, files={path.name: data}, split_single=True)


def number_shapes(keys: Sequence[tuple]) -> list[int]:
    """Return a number for each key, equal for equal keys."""
    numbers: dict[tuple, int] = {}
    return [numbers.setdefault(key, len(numbers)) for key in keys]


def place(
    *,
    name: str,
    where: str,
    T: Float[np.ndarray, "4 4"],
    vertices: Float[np.ndarray, "vertex 3"],
    faces: Int[np.ndarray, "face 3"],
    color: tuple[float, float, float] | None,
    shape: int,
    products: tuple[Occurrence, ...] = (),
) -> RawPart:
    """Return a part with a rigid pose: scale, shear and mirroring of the placement go into the vertices.

    Raises InputError if the placement flattens the part or is not finite.
    """
    linear = T[:3, :3]
    if not np.isfinite(T).all() or abs(np.linalg.det(linear)) < 1e-12:
        raise InputError(f"{where}: the placement of {name} is no usable transform; export it again")
    U, scales, Vt = np.linalg.svd(linear)
    rotation = U @ Vt
    if np.linalg.det(rotation) > 0.0 and np.abs(scales - 1.0).max() < 1e-5:
        return RawPart(
            name=name, where=where, vertices=vertices, faces=faces, color=color, shape=shape,
            T_world_part=se3.make(rotation, T[:3, 3]), products=products,
        )  # fmt: skip
    if np.linalg.det(rotation) < 0.0:
        rotation, faces = -rotation, faces[:, ::-1]
    return RawPart(
        name=name, where=where, vertices=vertices @ (rotation.T @ linear).T, faces=faces, color=color, shape=None,
        T_world_part=se3.make(rotation, T[:3, 3]), products=products,
    )  # fmt: skip
