"""What the file readers hand over, and the options of reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float, Int

from sashimono.assembly import Kept
from sashimono.errors import InputError

METRES: Mapping[str, float] = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 1e-2,
    "mm": 1e-3,
    "um": 1e-6,
    "in": 0.0254,
    "ft": 0.3048,
}
"""Length units by the name that ``--unit`` takes, in metres."""


@dataclass(frozen=True, kw_only=True)
class ReadConfig:
    """Options of reading an assembly."""

    step_linear: float = 0.003
    """Tessellation of STEP: largest sag of a chord over the size of its edge. Relative, so that a 2 mm watch
    and a 2 m machine get equally many triangles, and equal circles equal facets."""
    step_angular: float = 0.3
    """Tessellation of STEP: largest turn between neighbouring chords [rad]."""
    step_retries: tuple[float, ...] = (1.7, 3.0, 0.6)
    """The converter may leave out faces of a part. Then the tessellation is tried again, this many times as coarse."""
    split: Literal["auto", "all", "none"] = "auto"
    """Which parts of several solids are taken apart: those whose solids' boxes do not meet, so that nothing can hold
    them together (auto); all; or none."""
    exclude: tuple[str, ...] = ()
    """Names of parts that are left out, or patterns of names (``cable*``)."""
    stand_ins: bool = False
    """Whether a part whose surface cannot be closed is replaced by a closed body that contains it; else it is refused.
    """
    kept: tuple[Kept, ...] = ()
    """Products of the file's tree, and sets of parts, that become one part each."""
    weld: float = 1e-5
    """Where a surface is not closed, vertices nearer than this are welded; relative to the part's diagonal."""
    hole_area: float = 0.02
    """Area of the largest hole that is filled, relative to the part's surface area."""
    hole_flatness: float = 0.02
    """A hole is filled if its rim stays this near to a plane; relative to the rim's diagonal."""
    overlap: float = 1e-6
    """Overlaps below this fraction of the smaller part's volume count as rounding. They are not reported."""
    fold_angle: float = 0.4
    """Two neighbouring triangles lie back to back if the angle between them is smaller than this [rad]."""
    fold_step: float = 1e-3
    """The winding number is taken this far before and behind such a triangle, over √(2 area)."""
    max_folds: int = 400
    """Most triangles of one part for which it is taken. A part with more of them is not drawn anew either."""
    plausible: tuple[float, float] = (1e-3, 100.0)
    """Assemblies with a smaller or larger diagonal [m] get a note to check the unit, though the file states it."""
    likely: tuple[float, float] = (3e-3, 30.0)
    """The same where the file states no unit: then the user's, or millimetres, are more often wrong."""
    farthest: float = 1e7
    """No coordinate is larger than this [m]: beyond, a file is broken."""
    max_parts: int = 2000
    """Files of more parts are refused: planning them together would take hours."""


@dataclass(frozen=True, kw_only=True)
class Occurrence:
    """One use of a product in the file's tree."""

    number: int
    """Different for each use."""
    name: str
    """As the file has it, perhaps empty or not unique."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RawPart:
    """One part as its file has it, in metres, not yet checked."""

    name: str
    """Part name, perhaps not unique."""
    where: str
    """File, or place in the file, for messages."""
    vertices: Float[np.ndarray, "vertex 3"]
    """Points in the part's frame [m]."""
    faces: Int[np.ndarray, "face 3"]
    T_world_part: Float[np.ndarray, "4 4"]
    color: tuple[float, float, float] | None = None
    """Linear RGB in [0, 1]."""
    shape: int | None = None
    """Parts with the same number are instances of one mesh in the file."""
    products: tuple[Occurrence, ...] = ()
    """The products around it in the file's tree, the outermost first."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RawAssembly:
    """All parts of a source, in file order."""

    parts: tuple[RawPart, ...]
    unit: str
    """Unit of the source's coordinates."""
    files: Mapping[str, bytes]
    """Content of every file that was used, by name relative to the source."""
    split_single: bool = False
    """Whether a lone part may be taken apart into its solids (scenes and CAD, whose parts are named inside)."""
    notes: tuple[str, ...] = field(default=())
    unit_stated: bool = True
    """Whether the source says in which unit it is."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mesh:
    """Triangles as a mesh file has them, in the file's unit."""

    vertices: Float[np.ndarray, "vertex 3"]
    faces: Int[np.ndarray, "face 3"]
    color: tuple[float, float, float] | None = None
    """Linear RGB in [0, 1]."""


def refuse_many(count: int, where: str, most: int) -> None:
    """Raise InputError for a source of more parts than are planned together."""
    if count > most:
        raise InputError(
            f"{where}: holds {count} parts; at most {most} are planned together. Plan its subassemblies one by one."
        )


def linear_rgb(srgb: Float[np.ndarray, "3"]) -> tuple[float, float, float]:
    """Return the linear RGB of an sRGB colour, both in [0, 1]."""
    c = np.clip(srgb, 0.0, 1.0)
    r, g, b = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(r), float(g), float(b)
