"""A shrunk part and its shrunk obstacles drawn on one lattice, each pair only where the two can meet.

So a small screw in a wide lid takes few lattice points, however fine the lattice.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Bool, Float, Int

from sashimono.disassembly.placed_parts import PlacedParts
from sashimono.disassembly.translation.eroded_lattice import eroded_lattice, grown_lattice
from sashimono.disassembly.translation.lattice_scene import Drawn, shell


class KeptSolids:
    """Solids drawn on one part's lattices: another window of a lattice has most of them where the first one had."""

    def __init__(self, *, most: int) -> None:
        """Keep solids of so many lattice points in sum, those that were drawn last."""
        self._most = most
        self._cells = 0
        self._kept: dict[tuple[object, ...], tuple[Bool[np.ndarray, "x y z"], Int[np.ndarray, "point 3"]]] = {}

    def get(
        self, key: tuple[object, ...], draw: Callable[[], Bool[np.ndarray, "x y z"]]
    ) -> tuple[Bool[np.ndarray, "x y z"], Int[np.ndarray, "point 3"]]:
        """Return the solid of a key, drawn if it is not kept, and its shell."""
        if key not in self._kept:
            solid = draw()
            self._kept[key] = solid, shell(solid)
            self._cells += solid.size
            while self._cells > self._most and len(self._kept) > 1:
                self._cells -= self._kept.pop(next(iter(self._kept)))[0].size
        return self._kept[key]


class Drawing:
    """Draws pairs as they are asked for; the part, where it is wanted whole again, once."""

    def __init__(
        self,
        parts: PlacedParts,
        part: int,
        rotation: Float[np.ndarray, "3 3"],
        *,
        spacing: float,
        window: Int[np.ndarray, "2 3"],
        kept: KeptSolids,
        grown: bool = False,
    ) -> None:
        """Take in the lattice: its axes (rows), its spacing, and the steps that the displacements reach down and up.

        ``grown``: the solids are grown so that where they are apart no displacement that rounds to it has them meet.
        ``kept`` may be shared by all lattices of the part.
        """
        self._parts, self._part, self._rotation = parts, part, rotation
        self._spacing = spacing
        self._kept = kept
        self._grown, self._pad = grown, 2 if grown else 1
        self._boxes = parts.boxes_in(rotation)
        low, high = self._boxes[part]
        self._count = np.floor((high - low) / spacing).astype(int) + 1
        self._corner = low + 0.5 * ((high - low) - (self._count - 1) * spacing)
        self._first = window[0]
        self._origin = self._corner - window[0] * spacing
        self._own, self._theirs = self._regions(window.sum(axis=0))
        sizes = np.stack([self._own[:, 1] - self._own[:, 0], self._theirs[:, 1] - self._theirs[:, 0]], axis=1)
        meets = sizes.min(axis=(1, 2)) > 2
        points = np.minimum(sizes.prod(axis=2, dtype=float).sum(axis=1), 1e18)  # of a foil, more than a word counts
        self.cells: list[int] = np.where(meets, points, 0.0).astype(np.int64).tolist()
        """By part: lattice points that tell whether the part meets it; 0 if it cannot."""

    def _regions(self, reach: Int[np.ndarray, "3"]) -> tuple[Int[np.ndarray, "part 2 3"], Int[np.ndarray, "part 2 3"]]:
        """Where the part and each obstacle can meet: boxes of the lattice, with a layer around.

        Each is its first point and the one past its last: the part's from its own corner, the obstacle's from where
        the part's corner is at the first displacement.
        """
        boxes = (self._boxes - self._origin) / self._spacing
        pad = self._pad
        first = np.maximum(np.floor(boxes[:, 0]).astype(int), 1 - pad) - pad
        last = np.minimum(np.ceil(boxes[:, 1]).astype(int) + 1, self._count + reach + pad - 1) + pad
        own = np.stack([np.maximum(first - reach, -pad), np.minimum(last, self._count + pad)], axis=1)
        return own, np.stack([first, last], axis=1)

    def draw(self, other: int) -> tuple[Drawn, Drawn]:
        """Return the part and the obstacle where they can meet, shrunk by what a proof needs in all (or grown)."""
        parts = self._parts
        tolerance = parts.tolerances.plan
        half = 0.25 * np.sqrt(3.0) * self._spacing * (1.0 + 1e-6)
        share = 0.0 if self._grown else tolerance * float(parts.sizes[self._part])
        own = self._solid(self._part, np.zeros(3, dtype=int), self._own[other], half + share)
        radius = half
        if not self._grown:
            depth = tolerance * parts.smaller_size(self._part, other)
            depth = max(depth + parts.overlaps[self._part, other], parts.fits[self._part, other])
            radius += max(2.0 * depth - share, 0.0)
        return own, self._solid(other, -self._first, self._theirs[other], radius)

    def _solid(self, part: int, start: Int[np.ndarray, "3"], box: Int[np.ndarray, "2 3"], radius: float) -> Drawn:
        """Draw a box of lattice points, counted from so many steps after the part's corner."""
        first, shape = start + box[0], tuple((box[1] - box[0]).tolist())
        solid, rim = self._kept.get(
            (part, self._grown, self._spacing, radius, *first.tolist(), *shape),
            lambda: (grown_lattice if self._grown else eroded_lattice)(
                self._parts.vertices[part] @ self._rotation.T,
                self._parts.faces[part],
                origin=self._corner + first * self._spacing,
                spacing=self._spacing,
                shape=shape,
                radius=radius,
            ),
        )
        return Drawn(solid, box[0], rim)
