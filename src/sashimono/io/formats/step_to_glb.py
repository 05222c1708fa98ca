"""STEP to GLB by OpenCASCADE, as a program of its own: run by `sashimono.io.formats.step`, and of no other use.

    python step_to_glb.py OUT LINEAR ANGULAR < FILE.step

OpenCASCADE prints to the process's own output, and may crash on a broken file. A process of its own keeps both away
from the caller and from the caller's threads. Nothing of this package is imported here.
"""

from __future__ import annotations

import sys
from pathlib import Path


def convert(data: bytes, linear: float, angular: float) -> bytes:
    """Return a STEP file as GLB, empty if it cannot be read.

    ``linear`` is the chord error of the tessellation, relative to the size of each edge; ``angular`` is the greatest
    angle between neighbouring facets [rad].
    """
    import cascadio

    return cascadio.load(
        data, tol_linear=linear, tol_angular=angular, tol_relative=True, merge_primitives=True, use_parallel=False
    )


if __name__ == "__main__":
    out, linear, angular = sys.argv[1:]
    Path(out).write_bytes(convert(sys.stdin.buffer.read(), float(linear), float(angular)))
