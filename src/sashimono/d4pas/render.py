"""A picture of an assembly: parallel view, soft light, thin edges, outer parts of glass where they hide others.

Drawn on the processor, without a window. The image is drawn larger and averaged down.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, UInt8
from scipy import ndimage

from sashimono.assembly import Assembly
from sashimono.raster.colors import to_srgb
from sashimono.raster.shading import blur, paint, stretch, view_rotation
from sashimono.raster.zbuffer import NOTHING, Layer, draw, empty_layer, smooth_normals


@dataclass(frozen=True, kw_only=True)
class RenderConfig:
    """How an assembly is drawn."""

    width: int = 480
    height: int = 420
    supersample: int = 3
    """Pixels drawn for each one of the image, along each side."""
    margin: float = 0.07
    """Left free at each side, over the shorter side."""
    azimuth: float | None = None
    """Where the viewer stands, about z [rad]; None: where most parts are seen."""
    elevation: float = 0.5
    """How high the viewer stands [rad]."""
    see_through: bool = True
    """Whether parts that hide others are drawn as glass."""
    hidden: float = 0.15
    """A part of which less than this share is seen is hidden."""
    glass: float = 0.26
    """Opacity of glass seen straight on; it grows towards its rims."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """An image, and where its parts are."""

    pixels: UInt8[np.ndarray, "row column 3"]
    """sRGB."""
    anchors: dict[int, tuple[float, float, float]]
    """By part: column and row well inside of what is seen of it, and how far that is from its rim [pixels]."""


def render(
    assembly: Assembly,
    colors: Float[np.ndarray, "part 3"],
    *,
    offsets: Float[np.ndarray, "part 3"] | None = None,
    config: RenderConfig | None = None,
) -> Picture:
    """Return a picture of an assembly on white.

    Args:
        assembly: What to draw.
        colors: Linear RGB of each part.
        offsets: How far each part is displaced [m], as in an exploded view.
        config: How to draw.
    """
    config = config or RenderConfig()
    moves = np.zeros((len(assembly), 3)) if offsets is None else offsets
    solids = [part.vertices_world + move for part, move in zip(assembly.parts, moves, strict=True)]
    faces = [part.faces for part in assembly.parts]
    azimuth = _best_azimuth(solids, faces, config) if config.azimuth is None else config.azimuth
    R = view_rotation(azimuth, config.elevation)
    glass = _choose_glass(solids, faces, R, config) if config.see_through else set()

    scale = config.supersample
    rows, columns = config.height * scale, config.width * scale
    points, place = _to_screen(solids, R, rows, columns, config.margin)
    opaque, clear = empty_layer(rows, columns), empty_layer(rows, columns)
    for k, (screen, triangles) in enumerate(zip(points, faces, strict=True)):
        seen = screen * [1.0, -1.0, -1.0]
        draw(clear if k in glass else opaque, k, screen, triangles, smooth_normals(seen, triangles))

    image = np.empty((rows, columns, 3), dtype=np.float32)
    image[:] = 1.0 - np.float32(0.30) * _shadow(solids, faces, R, place, rows, columns)[..., None]
    paint(image, opaque, clear, colors.astype(np.float32), config.glass)
    small = image.reshape(config.height, scale, config.width, scale, 3).mean(axis=(1, 3))
    pixels = np.round(255.0 * to_srgb(small)).astype(np.uint8)
    return Picture(pixels=pixels, anchors=_anchors(opaque, clear, len(assembly), scale))


Solids = Sequence[np.ndarray]
Triangles = Sequence[np.ndarray]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Place:
    scale: float
    middle: Float[np.ndarray, "3"]


def _to_screen(
    solids: Solids, R: Float[np.ndarray, "3 3"], rows: int, columns: int, margin: float
) -> tuple[list[np.ndarray], _Place]:
    seen = [solid @ R.T for solid in solids]
    low, high = np.min([s.min(axis=0) for s in seen], axis=0), np.max([s.max(axis=0) for s in seen], axis=0)
    free = np.array([columns, rows]) - 2.0 * margin * min(rows, columns)
    place = _Place(scale=float((free / np.maximum(high - low, 1e-12)[:2]).min()), middle=0.5 * (low + high))
    return [_project(s, place, rows, columns) for s in seen], place


def _project(seen: np.ndarray, place: _Place, rows: int, columns: int) -> np.ndarray:
    x, y, z = ((seen - place.middle) * place.scale).T
    return np.stack([0.5 * columns + x - 0.5, 0.5 * rows - y - 0.5, -z], axis=1)


def _shadow(
    solids: Solids, faces: Triangles, R: Float[np.ndarray, "3 3"], place: _Place, rows: int, columns: int
) -> np.ndarray:
    """Return a soft shadow on the ground, in [0, 1]: nearly below the parts, a little to the right."""
    ground = min(float(solid[:, 2].min()) for solid in solids)
    small = 4
    layer = empty_layer(rows // small, columns // small)
    slant = 0.10 * (R[0] - R[2]) * [1.0, 1.0, 0.0]
    for solid, triangles in zip(solids, faces, strict=True):
        height = solid[:, 2:] - ground
        flat = np.concatenate([(solid + height * slant)[:, :2], np.full((len(solid), 1), ground)], axis=1)
        points = _project(flat @ R.T, place, rows, columns) / [small, small, 1.0]
        draw(layer, 0, points, triangles, np.zeros((len(triangles), 3, 3)))
    soft = blur(layer.covered.astype(np.float32), 0.022 * min(layer.part.shape))
    fade = [np.clip((0.5 - np.abs((np.arange(n) + 0.5) / n - 0.5)) / 0.06, 0.0, 1.0) for n in soft.shape]
    return stretch((soft * np.outer(*fade)).astype(np.float32), (rows, columns))


def _own_depths(solids: Solids, faces: Triangles, R: Float[np.ndarray, "3 3"], size: int) -> np.ndarray:
    """Return each part's depth alone, (part, row, column), infinite where it is not."""
    points, _ = _to_screen(solids, R, size, size, 0.02)
    out = []
    for screen, triangles in zip(points, faces, strict=True):
        layer = empty_layer(size, size)
        draw(layer, 0, screen, triangles, np.zeros((len(triangles), 3, 3)))
        out.append(layer.depth)
    return np.stack(out)


def _seen_shares(depths: np.ndarray) -> Float[np.ndarray, "part"]:
    own = np.isfinite(depths)
    nearest = depths.min(axis=0)
    return (own & (depths <= nearest + 1e-3)).sum(axis=(1, 2)) / np.maximum(own.sum(axis=(1, 2)), 1)


def _best_azimuth(solids: Solids, faces: Triangles, config: RenderConfig) -> float:
    """Return the place from which most of the parts are seen, among eight, the first of them in front."""
    best, most = 0.0, -1.0
    for k in range(8):
        azimuth = np.radians(-58.0 + 45.0 * (k if k < 5 else k - 8))
        shares = _seen_shares(_own_depths(solids, faces, view_rotation(azimuth, config.elevation), 96))
        score = float(np.minimum(shares, 0.4).sum()) - 0.02 * len(solids) * abs(k if k < 5 else k - 8) / 4.0
        if score > most + 1e-9:
            best, most = azimuth, score
    return best


def _choose_glass(solids: Solids, faces: Triangles, R: Float[np.ndarray, "3 3"], config: RenderConfig) -> set[int]:
    """Return parts that hide others: those that cover most of what is hidden, one after the other."""
    depths = _own_depths(solids, faces, R, 160)
    own = np.isfinite(depths)
    glass: set[int] = set()
    for _ in range(len(solids) // 2):
        left = [k for k in range(len(solids)) if k not in glass]
        shares = dict(zip(left, _seen_shares(depths[left]), strict=True))
        hidden = [k for k in left if shares[k] < config.hidden]
        if not hidden:
            break
        covers = {
            k: sum(float((own[h] & (depths[k] < depths[h] - 1e-3)).sum() / max(1, own[h].sum())) for h in hidden)
            for k in left
            if k not in hidden
        }
        if not covers or max(covers.values()) <= 0.0:
            break
        glass.add(max(covers, key=lambda k: covers[k]))
    return glass


def _anchors(opaque: Layer, clear: Layer, count: int, scale: int) -> dict[int, tuple[float, float, float]]:
    middle = scale // 2
    solid, glass = (layer.part[middle::scale, middle::scale] for layer in (opaque, clear))
    out = {}
    for k in range(count):
        for seen in (solid == k, (glass == k) & (solid == NOTHING), glass == k):
            rows, columns = np.nonzero(seen)
            if len(rows):
                top, left = int(rows.min()), int(columns.min())
                crop = np.pad(seen[top : rows.max() + 1, left : columns.max() + 1], 1)
                inside = np.asarray(ndimage.distance_transform_edt(crop))
                row, column = np.unravel_index(int(np.argmax(inside)), inside.shape)
                out[k] = (left + float(column) - 0.5, top + float(row) - 0.5, float(inside[row, column]))
                break
    return out
