"""What exactly is in the way of a part along a direction: faces, free travel, and how much would have to go.

Both parts are looked at along the direction on one fine grid of lines. Where a front face of the part has
a face of the obstacle ahead of it, that line is obstructed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit
from scipy import ndimage

from sashimono.assembly import frozen_array
from sashimono.geometry.features.directions import frame_along


@dataclass(frozen=True, kw_only=True)
class ObstructionConfig:
    """How closely an obstruction is looked at."""

    resolution: int = 400
    """Lines across the longer side of the two parts' common shadow."""
    strip: int = 3
    """Lines drawn as one strip in pictures."""
    rim: float = 1.5
    """Lines this near the outline of either part count as contact along a wall, if there are others [lines]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Obstruction:
    """How one part stops another along one direction."""

    travel: float
    """How far the part gets before it touches [m]."""
    depth: float
    """How much of the obstacle lies ahead of the part, along the direction [m]."""
    area: float
    """Area in which they would meet, seen along the direction [m²]."""
    lateral_part: float
    """How far the part's outline must give way to pass [m]; infinite where it has no edge there."""
    lateral_obstacle: float
    """How far the obstacle's outline must give way to let the part pass [m]; infinite where it has no edge there."""
    opening_part: bool
    """Whether the part has an opening there, so that its inner outline may be what is in the way."""
    opening_obstacle: bool
    """Whether the obstacle has an opening there."""
    faces_part: Int[np.ndarray, "face"]
    """Faces of the part that would meet the obstacle, by index."""
    faces_obstacle: Int[np.ndarray, "other"]
    """Faces of the obstacle that the part would meet, by index."""

    patch: Float[np.ndarray, "strip 4 3"]
    """Where the part would meet the obstacle, as strips in the world frame [m]: for pictures."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "patch", frozen_array(self.patch, np.float64))
        for name in ("faces_part", "faces_obstacle"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), np.int64))

    @property
    def lateral(self) -> float:
        """The smaller change of the two [m]."""
        return min(self.lateral_part, self.lateral_obstacle)


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Where the grid's lines cross some faces: by line, then by height."""

    line: Int[np.ndarray, "crossing"]
    height: Float[np.ndarray, "crossing"]
    face: Int[np.ndarray, "crossing"]


@dataclass(frozen=True, eq=False)
class _Grid:
    """Lines along the direction, over the window where both parts cast a shadow."""

    corner: Float[np.ndarray, "2"]
    pixel: float
    shape: tuple[int, int]

    def crossings(self, vertices: Float[np.ndarray, "vertex 3"], faces: np.ndarray, *, front: bool) -> _Crossings:
        """Return where lines cross the faces that look along the direction (or, not ``front``, against it)."""
        a, b, c = (vertices[faces[:, k], :2] for k in range(3))
        turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
        chosen = np.flatnonzero(turn > 0.0 if front else turn < 0.0)
        none = (np.zeros(0, np.int64), np.zeros(0), np.zeros(0, np.int64))
        arguments = (vertices, faces[chosen], self.corner, self.pixel, self.shape)
        count = _cross(*arguments, *none)
        line, height, face = np.zeros(count, np.int64), np.zeros(count), np.zeros(count, np.int64)
        _cross(*arguments, line, height, face)
        order = np.lexsort((height, line))
        return _Crossings(line[order], height[order], chosen[face[order]])

    def mask(self, lines: Int[np.ndarray, "crossing"]) -> Bool[np.ndarray, "row column"]:
        """Return the picture of some lines."""
        out = np.zeros(self.shape, bool)
        out.reshape(-1)[lines] = True
        return out


def find_obstruction(
    part: tuple[Float[np.ndarray, "vertex 3"], np.ndarray],
    obstacle: tuple[Float[np.ndarray, "other 3"], np.ndarray],
    direction: Float[np.ndarray, "3"],
    *,
    slack: float,
    config: ObstructionConfig,
) -> Obstruction | None:
    """Return how the obstacle stops the part along a unit direction; None if no line of the grid shows it.

    Both are (vertices, faces) in the world frame [m]. An obstacle's face counts as ahead from ``slack`` [m]
    behind the part's front on: what they overlap in the assembled pose.
    """
    rotation = frame_along(direction).T
    mine, theirs = part[0] @ rotation, obstacle[0] @ rotation
    grid = _common_grid(mine, theirs, config.resolution)
    if grid is None:
        return None
    fronts = grid.crossings(mine, part[1], front=True)
    entries = grid.crossings(theirs, obstacle[1], front=False)
    meets, ahead = _next_ahead(fronts, entries, slack)
    if not len(meets):
        return None
    # outlines: of what the part has before the obstacle, and of what the obstacle has beyond the part
    backs = grid.crossings(mine, part[1], front=False)
    exits = grid.crossings(theirs, obstacle[1], front=True)
    outline = grid.mask(backs.line[backs.height < entries.height[ahead].max()])
    material = grid.mask(exits.line[exits.height > fronts.height[meets].min()])
    into_part, into_obstacle = _inside(outline), _inside(material)
    lines = fronts.line[meets]
    lateral_part = grid.pixel * (float(into_part.reshape(-1)[lines].max()) - 0.5)
    lateral_obstacle = grid.pixel * (float(into_obstacle.reshape(-1)[lines].max()) - 0.5)
    inner = np.minimum(into_part, into_obstacle).reshape(-1)[lines] > config.rim
    if inner.any():
        meets, ahead, lines = meets[inner], ahead[inner], lines[inner]
    top = np.full(grid.shape[0] * grid.shape[1], -np.inf)
    np.maximum.at(top, exits.line, exits.height)
    behind = top[entries.line[ahead]] - entries.height[ahead]
    return Obstruction(
        travel=max(0.0, float((entries.height[ahead] - fronts.height[meets]).min())),
        depth=max(0.0, float(behind.max())),
        area=len(np.unique(lines)) * grid.pixel**2,
        lateral_part=lateral_part,
        lateral_obstacle=lateral_obstacle,
        opening_part=bool((_filled(outline) & ~outline).any()),
        opening_obstacle=bool((_filled(material) & ~material).any()),
        faces_part=np.unique(fronts.face[meets]),
        faces_obstacle=np.unique(entries.face[ahead]),
        patch=_strips(grid, lines, entries.height[ahead], config.strip) @ rotation.T,
    )


def _strips(
    grid: _Grid, lines: Int[np.ndarray, "meeting"], heights: Float[np.ndarray, "meeting"], step: int
) -> Float[np.ndarray, "strip 4 3"]:
    """Every ``step``-th row of the lines as strips that wide, one for each run without a gap or a jump in height."""
    lines, first = np.unique(lines, return_index=True)
    rows, columns = np.divmod(lines, grid.shape[1])
    kept = rows % step == 0
    rows, columns, heights = rows[kept], columns[kept], heights[first][kept]
    breaks = np.flatnonzero(
        (np.diff(rows) != 0) | (np.diff(columns) != 1) | (np.abs(np.diff(heights)) > 2.0 * grid.pixel)
    )
    starts = np.concatenate([[0], breaks + 1]) if len(rows) else breaks
    stops = np.concatenate([breaks, [len(rows) - 1]]) if len(rows) else breaks
    corners = [
        np.column_stack([columns[k] + right, rows[k] + up, np.zeros(len(k))])
        for k, right, up in ((starts, 0, 0), (stops, 1, 0), (stops, 1, step), (starts, 0, step))
    ]
    strips = grid.pixel * np.stack(corners, axis=1) + np.append(grid.corner, 0.0)
    strips[:, [0, 3], 2], strips[:, [1, 2], 2] = heights[starts, None], heights[stops, None]
    return strips


def _filled(picture: Bool[np.ndarray, "row column"]) -> Bool[np.ndarray, "row column"]:
    return np.asarray(ndimage.binary_fill_holes(picture))


def _inside(picture: Bool[np.ndarray, "row column"]) -> Float[np.ndarray, "row column"]:
    """Distance of each line from the nearest one outside [lines]; infinite if there is none outside."""
    if picture.all():
        return np.full(picture.shape, np.inf)
    return np.asarray(ndimage.distance_transform_edt(picture))


def _common_grid(
    mine: Float[np.ndarray, "vertex 3"], theirs: Float[np.ndarray, "other 3"], resolution: int
) -> _Grid | None:
    low = np.maximum(mine[:, :2].min(axis=0), theirs[:, :2].min(axis=0))
    high = np.minimum(mine[:, :2].max(axis=0), theirs[:, :2].max(axis=0))
    longest = float((high - low).max())
    if (high <= low).any():
        return None
    pixel = longest / resolution
    # two lines more all round, so that outlines that end with the window are seen to end
    columns, rows = (int(n) + 5 for n in (high - low) / pixel)
    return _Grid(low - np.array([2.013, 2.017]) * pixel, pixel, (rows, columns))


def _next_ahead(
    fronts: _Crossings, entries: _Crossings, slack: float
) -> tuple[Int[np.ndarray, "meeting"], Int[np.ndarray, "meeting"]]:
    """For each front crossing with an entry ahead on its line: its index, and that of the first such entry."""
    if not len(fronts.line) or not len(entries.line):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    low = min(fronts.height.min() - slack, entries.height.min())
    span = 2.0 * (max(fronts.height.max(), entries.height.max()) - low) + 1e-300
    place = np.searchsorted(
        entries.line + (entries.height - low) / span, fronts.line + (fronts.height - slack - low) / span
    )
    found = place < len(entries.line)
    found[found] = entries.line[place[found]] == fronts.line[found]
    return np.flatnonzero(found), place[found]


@njit(cache=True, nogil=True)
def _cross(vertices, faces, corner, pixel, shape, line, height, face):  # pragma: no cover - compiled
    """List the crossings of lines and triangles; with empty lists, only count them."""
    count = 0
    for f in range(faces.shape[0]):
        i, j, k = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay = (vertices[i, 0] - corner[0]) / pixel - 0.5, (vertices[i, 1] - corner[1]) / pixel - 0.5
        bx, by = (vertices[j, 0] - corner[0]) / pixel - 0.5, (vertices[j, 1] - corner[1]) / pixel - 0.5
        cx, cy = (vertices[k, 0] - corner[0]) / pixel - 0.5, (vertices[k, 1] - corner[1]) / pixel - 0.5
        det = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if abs(det) < 1e-12:
            continue
        for y in range(max(0, int(np.ceil(min(ay, by, cy)))), min(shape[0] - 1, int(np.floor(max(ay, by, cy)))) + 1):
            for x in range(
                max(0, int(np.ceil(min(ax, bx, cx)))), min(shape[1] - 1, int(np.floor(max(ax, bx, cx)))) + 1
            ):
                u = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / det
                v = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / det
                if u < 0.0 or v < 0.0 or u + v > 1.0:
                    continue
                if len(line):
                    line[count] = y * shape[1] + x
                    height[count] = (
                        vertices[i, 2] + u * (vertices[j, 2] - vertices[i, 2]) + v * (vertices[k, 2] - vertices[i, 2])
                    )
                    face[count] = f
                count += 1
    return count
