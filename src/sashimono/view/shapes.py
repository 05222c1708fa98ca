"""Each shape is stored once, however many parts have it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sashimono.assembly import Part
from sashimono.geometry import se3
from sashimono.view.config import ViewConfig
from sashimono.view.display_mesh import DisplayMesh, make_display_mesh


@dataclass(frozen=True, kw_only=True, eq=False)
class ShapeUse:
    """Which shape a part is drawn with."""

    shape: int
    T_part_shape: Float[np.ndarray, "4 4"]
    """Pose of the shape in the part's frame."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shapes:
    """Distinct shapes, and for each part the one it has."""

    meshes: tuple[DisplayMesh, ...]
    uses: tuple[ShapeUse, ...]
    """In part order."""
    decimated: bool
    """Whether detail was dropped to keep the file small."""


def fit_rigid(
    source: Float[np.ndarray, "n 3"], target: Float[np.ndarray, "n 3"], tolerance: float
) -> Float[np.ndarray, "4 4"] | None:
    """Return the pose that takes each source point to its target within ``tolerance`` [m], or None (Kabsch 1976)."""
    centre_s, centre_t = source.mean(axis=0), target.mean(axis=0)
    U, _, Vt = np.linalg.svd((target - centre_t).T @ (source - centre_s))
    R = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    T = se3.make(R, centre_t - R @ centre_s)
    return T if np.abs(se3.apply(T, source) - target).max() <= tolerance else None


def _share(parts: tuple[Part, ...]) -> tuple[list[int], list[ShapeUse]]:
    """Return the part that represents each shape, and the use of each part."""
    representatives: list[int] = []
    by_faces: dict[bytes, list[int]] = {}
    uses = []
    for k, part in enumerate(parts):
        tolerance = 1e-6 * float(np.ptp(part.vertices_part, axis=0).max())
        known = by_faces.setdefault(part.faces.tobytes(), [])
        for shape in known:
            other = parts[representatives[shape]]
            if other.vertices_part.shape != part.vertices_part.shape:
                continue
            if np.array_equal(other.vertices_part, part.vertices_part):
                T_part_shape = np.eye(4)
            else:
                T_part_shape = fit_rigid(other.vertices_part, part.vertices_part, tolerance)
            if T_part_shape is not None:
                uses.append(ShapeUse(shape=shape, T_part_shape=T_part_shape))
                break
        else:
            known.append(len(representatives))
            uses.append(ShapeUse(shape=len(representatives), T_part_shape=np.eye(4)))
            representatives.append(k)
    return representatives, uses


def make_shapes(parts: tuple[Part, ...], config: ViewConfig) -> Shapes:
    """Return the display meshes of the parts, shared where one is a rigid copy of another.

    If they have more than ``config.max_faces`` faces together, the welding grid is coarsened, down to 64
    cells a side, until they have not.
    """
    representatives, uses = _share(parts)
    bits = 16
    meshes: list[DisplayMesh] = []
    for bits in (16, 12, 11, 10, 9, 8, 7, 6):
        meshes = [
            make_display_mesh(parts[k].vertices_part, parts[k].faces, crease_angle=config.crease_angle, bits=bits)
            for k in representatives
        ]
        if sum(len(mesh.faces) for mesh in meshes) <= config.max_faces:
            break
    return Shapes(meshes=tuple(meshes), uses=tuple(uses), decimated=bits < 16)
