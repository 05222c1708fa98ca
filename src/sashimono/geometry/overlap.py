"""How deep two bodies overlap in one pose, from the exact body that they share."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from manifold3d import Error, Manifold, Mesh64

from sashimono.geometry import se3
from sashimono.geometry.body import Body

_POINTS = 2000
"""Points of the shared body's surface that are looked at, about, besides its corners: faces much larger than
the rest, as those of a peg in solid material, would hide how deep it is."""


def intersection_depth(first: Body, second: Body, T_second_first: Float[np.ndarray, "4 4"]) -> float | None:
    """Return the depth [m] of the deepest point that the two share, 0 if there is none; None if no boolean is had.

    Looks at the corners of the shared body, its edges cut to about even length: each lies on one of the two
    surfaces, and its distance to the other one is its depth.
    """
    solids = [Manifold(Mesh64(np.array(b.vertices), np.array(b.faces, np.uint64))) for b in (first, second)]
    if any(solid.status() != Error.NoError for solid in solids):
        return None
    common = solids[0].transform(np.ascontiguousarray(T_second_first[:3])) ^ solids[1]
    if common.is_empty() or common.volume() <= 0.0:
        return 0.0
    grain = float(np.sqrt(common.surface_area() / _POINTS))
    points = np.array(common.refine_to_length(grain).to_mesh64().vert_properties[:, :3])
    in_second = np.abs(second.signed_distance.query(points))
    in_first = np.abs(first.signed_distance.query(se3.apply(se3.inverse(T_second_first), points)))
    return float(np.maximum(in_first, in_second).max())
