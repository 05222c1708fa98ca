"""A mesh as text."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float, Int


def obj_text(vertices: Float[np.ndarray, "vertex 3"], faces: Int[np.ndarray, "face 3"]) -> str:
    """Return the surface as OBJ, in the unit of its vertices."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    return "\n".join(lines) + "\n"
