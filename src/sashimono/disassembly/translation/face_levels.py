"""Where a leg may end: displacements at which faces of the part come level with faces of an obstacle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from sashimono.disassembly.placed_parts import PlacedParts


class FaceLevels:
    """Coordinates of parts' flat faces along lines, worked out as they are asked for."""

    def __init__(self, parts: PlacedParts, *, most: int, grain: float) -> None:
        """Keep the ends of a part along a line, and the levels of its ``most`` largest faces.

        Levels nearer than ``grain``, relative to the part's smallest extent, are one.
        """
        self._parts = parts
        self._most = most
        self._grain = grain
        self._faces: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}
        self._levels: dict[tuple[int, bytes], np.ndarray] = {}

    def of(self, part: int, line: Float[np.ndarray, "3"]) -> Float[np.ndarray, "level"]:
        """Return the coordinates along a line of a part's ends and of its faces across it, assembled [m]."""
        key = (part, line.tobytes())
        if key not in self._levels:
            normals, areas, centers = self._normals(part)
            across = np.abs(normals @ line) > 1.0 - 1e-6
            ends = self._parts.bounds_along(part, line)
            merge = 1e-6 * float(self._parts.sizes[part])
            at, group = np.unique(np.round((centers[across] @ line - ends[0]) / merge), return_inverse=True)
            weight = np.bincount(group.reshape(-1), weights=areas[across], minlength=len(at))
            largest = at[np.argsort(-np.round(weight / areas.sum(), 9), kind="stable")[: self._most]]
            self._levels[key] = np.unique(np.concatenate([ends, ends[0] + merge * largest]))
        return self._levels[key]

    def differences(
        self, part: int, others: Sequence[int], lines: Float[np.ndarray, "line 3"]
    ) -> list[Float[np.ndarray, "_"]]:
        """Return, by line, how far the part must go along it for one of its faces to come level with an obstacle's."""
        grain = self._grain * float(self._parts.sizes[part])
        out = []
        for line in lines:
            own = self.of(part, line)
            theirs = np.unique(np.concatenate([self.of(other, line) for other in others]))
            out.append(grain * np.unique(np.round((theirs[:, None] - own[None, :]).ravel() / grain)))
        return out

    def _normals(self, part: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        if part not in self._faces:
            triangles = self._parts.vertices[part][self._parts.faces[part]]
            normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
            areas = np.linalg.norm(normals, axis=1)
            fine = areas > 1e-12 * areas.max()
            self._faces[part] = (
                normals[fine] / areas[fine, None], areas[fine], triangles[fine].mean(axis=1)
            )  # fmt: skip
        return self._faces[part]


def level_travels(
    differences: Sequence[Float[np.ndarray, "_"]],
    lines: Float[np.ndarray, "line 3"],
    offset: Float[np.ndarray, "3"],
    direction: Float[np.ndarray, "3"],
    travel: float,
    most: int,
) -> Float[np.ndarray, "halt"]:
    """Return the travels, up to the given one, at which faces come level, from a displacement on [m].

    If there are more than ``most``, evenly spread ones are returned.
    """
    found = []
    for line, levels in zip(lines, differences, strict=True):
        slope = float(line @ direction)
        if abs(slope) > 0.1:
            found.append((levels - float(line @ offset)) / slope)
    times = np.concatenate(found) if found else np.zeros(0)
    times = np.sort(times[(times > 0.0) & (times <= travel)])
    if len(times) > most:
        times = times[np.linspace(0, len(times) - 1, most).astype(int)]
    return times
