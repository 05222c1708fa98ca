"""Parts on paper: a parallel view, solid parts and parts of glass, and where points of the world are in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int, UInt8
from scipy import ndimage

from sashimono.raster.colors import to_srgb
from sashimono.raster.shading import paint, view_rotation
from sashimono.raster.zbuffer import Layer, draw, empty_layer, smooth_normals


@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """A surface where it is drawn."""

    points: Float[np.ndarray, "vertex 3"]
    """World frame [m]."""
    faces: Int[np.ndarray, "face 3"]
    color: Float[np.ndarray, "3"]
    """Linear RGB."""
    glass: bool = False
    corners: Int[np.ndarray, "corner"] | None = None
    """Vertices between which all others lie; None if nobody looked."""

    @property
    def outermost(self) -> Float[np.ndarray, "n 3"]:
        """The points between which all others lie."""
        return self.points if self.corners is None else self.points[self.corners]


def merged(solids: Sequence[Solid]) -> Solid:
    """Return solids as one, of no colour."""
    first = np.cumsum([0, *(len(solid.points) for solid in solids)])
    faces = [solid.faces + start for solid, start in zip(solids, first[:-1], strict=True)]
    return Solid(
        points=np.concatenate([np.zeros((0, 3)), *(solid.points for solid in solids)]),
        faces=np.concatenate([np.zeros((0, 3), dtype=np.int64), *faces]),
        color=np.ones(3),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """From where, and which window of the world."""

    R: Float[np.ndarray, "3 3"]
    """Rows: right, up, towards the viewer, in the world."""
    middle: Float[np.ndarray, "2"]
    """Right and up of the window's middle [m]."""
    scale: float
    """Pixels a metre."""
    width: int
    height: int

    def pixel(self, points: Float[np.ndarray, "*any 3"]) -> Float[np.ndarray, "*any 2"]:
        """Return column and row of points of the world."""
        seen = (points @ self.R[:2].T - self.middle) * self.scale * [1.0, -1.0]
        return seen + np.array([0.5 * self.width, 0.5 * self.height])


def look_from(up: Float[np.ndarray, "3"], azimuth: float, elevation: float) -> Float[np.ndarray, "3 3"]:
    """Return the rows right, up and towards the viewer, for one who stands about ``up`` [rad]."""
    ahead = np.array([1.0, 0.0, 0.0]) if abs(up[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    ahead = ahead - (ahead @ up) * up
    ahead /= np.linalg.norm(ahead)
    return view_rotation(azimuth, elevation) @ np.array([ahead, np.cross(up, ahead), up])


def fit_view(
    points: Float[np.ndarray, "n 3"], R: Float[np.ndarray, "3 3"], width: int, height: int, margin: float = 0.06
) -> View:
    """Return the window that shows these points, ``margin`` of the shorter side free around them."""
    flat = points @ R[:2].T
    low, high = flat.min(axis=0), flat.max(axis=0)
    free = np.array([width, height]) - 2.0 * margin * min(width, height)
    scale = float((free / np.maximum(high - low, 1e-9)).min())
    return View(R=R, middle=0.5 * (low + high), scale=scale, width=width, height=height)


def layer_of(solids: Sequence[Solid], view: View, *, shaded: bool = True, times: int = 1) -> Layer:
    """Return what is nearest at each pixel; numbers are places in ``solids``. Depths are in pixels."""
    layer = empty_layer(view.height * times, view.width * times)
    for k, solid in enumerate(solids):
        _draw(layer, k, solid, view, shaded, times)
    return layer


def _draw(layer: Layer, k: int, solid: Solid, view: View, shaded: bool, times: int) -> None:
    place = view.pixel(solid.points) * times - 0.5
    depth = -(solid.points @ view.R[2]) * view.scale * times
    screen = np.concatenate([place, depth[:, None]], axis=1)
    normals = smooth_normals(screen * [1.0, -1.0, -1.0], solid.faces) if shaded else np.zeros((0, 3, 3))
    draw(layer, k, screen, solid.faces, normals)


def draw_picture(
    solids: Sequence[Solid], view: View, *, outlined: Sequence[Solid] = (), times: int = 2
) -> UInt8[np.ndarray, "row column 3"]:
    """Return an sRGB picture on white; glass is drawn over what is behind it.

    Of the ``outlined`` solids there is a dashed outline in their colour, over everything else.
    The image is drawn ``times`` larger and averaged down.
    """
    opaque, clear = (empty_layer(view.height * times, view.width * times) for _ in range(2))
    for k, solid in enumerate(solids):
        _draw(clear if solid.glass else opaque, k, solid, view, True, times)
    image = np.ones((view.height * times, view.width * times, 3), dtype=np.float32)
    if (opaque.covered | clear.covered).any():
        paint(image, opaque, clear, np.array([solid.color for solid in solids], dtype=np.float32), 0.16)
    for solid in outlined:
        image[_dashes(layer_of([solid], view, shaded=False, times=times).covered, times)] = solid.color
    small = image.reshape(view.height, times, view.width, times, 3).mean(axis=(1, 3))
    return np.round(255.0 * to_srgb(small)).astype(np.uint8)


def _dashes(mask: Bool[np.ndarray, "row column"], times: int) -> Bool[np.ndarray, "row column"]:
    """Return a dashed line along the inner rim of a mask."""
    rim = mask & np.logical_not(ndimage.binary_erosion(mask, iterations=2 * times))
    rows, columns = np.arange(mask.shape[0])[:, None], np.arange(mask.shape[1])[None, :]
    return rim & (((columns + 2 * rows) // (9 * times)) % 2 == 0)
