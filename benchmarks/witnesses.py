"""The motions behind removal conditions, checked without the code that found them: by `verify`, and by booleans."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import manifold3d
import numpy as np
from jaxtyping import Float

from sashimono.assembly import Assembly, Part
from sashimono.disassembly.masks import bits
from sashimono.disassembly.removal import Removal
from sashimono.geometry import se3
from sashimono.verify.motions import MotionCheck


class Witnesses:
    """Checks removals of one assembly."""

    def __init__(self, assembly: Assembly) -> None:
        self._parts = assembly.parts
        self._check = MotionCheck(assembly)
        self._solids = [_solid(part) for part in assembly.parts]

    def problems(self, part: int, others: int, removal: Removal) -> list[str]:
        """Return what `verify` has against a removal of a part past others (a mask); nothing if it holds."""
        # as it is put together: the assembled pose last
        path = removal.displacements[::-1] @ self._parts[part].T_world_part
        return self._check.problems(part, bits(others), path)

    def clearance(self, part: int, others: int, removal: Removal, *, poses: int = 400) -> Clearance:
        """Return what exact booleans say at many poses on the way: a route of their own, for few removals."""
        way = _resampled(removal.displacements, poses)
        solid = self._solids[part]
        share = 0.0
        for other in (self._solids[k] for k in bits(others)):
            smaller = min(float(solid.volume()), float(other.volume()))
            for D in way:
                common = solid.transform(np.ascontiguousarray(D[:3])) ^ other
                share = max(share, float(common.volume()) / smaller)
        return Clearance(share=share)


@dataclass(frozen=True, kw_only=True)
class Clearance:
    """Intersections on the way, by booleans."""

    share: float
    """Largest volume shared with one other part, over the smaller one's."""

    @property
    def is_free(self) -> bool:
        """Whether nothing is shared beyond what faces that slide on one another share by rounding."""
        return self.share <= 1e-5


def _solid(part: Part) -> manifold3d.Manifold:
    """The part in the assembled pose."""
    vertices, faces = np.array(part.vertices_world), np.array(part.faces, np.uint64)  # writable, as the library wants
    mesh = manifold3d.Mesh64(vert_properties=vertices, tri_verts=faces)
    mesh.merge()
    return manifold3d.Manifold(mesh)


def _resampled(displacements: Float[np.ndarray, "waypoint 4 4"], poses: int) -> list[Float[np.ndarray, "4 4"]]:
    """Return about so many displacements along the geodesics, spread by the number of legs."""
    out = [displacements[0]]
    share = -(-poses // (len(displacements) - 1))
    for a, b in pairwise(displacements):
        twist = se3.log(se3.inverse(a) @ b)
        out += [a @ se3.exp(u * twist) for u in np.linspace(0.0, 1.0, share + 1)[1:]]
    return out
