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
from sashimono.d4pas.palette import to_srgb
from sashimono.d4pas.zbuffer import NOTHING, Layer, draw, empty_layer, smooth_normals

INK = np.array([0.012, 0.016, 0.024], dtype=np.float32)
"""Of edges, linear RGB."""


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
    _paint(image, opaque, clear, colors.astype(np.float32), config.glass)
    small = image.reshape(config.height, scale, config.width, scale, 3).mean(axis=(1, 3))
    pixels = np.round(255.0 * to_srgb(small)).astype(np.uint8)
    return Picture(pixels=pixels, anchors=_anchors(opaque, clear, len(assembly), scale))


def view_rotation(azimuth: float, elevation: float) -> Float[np.ndarray, "3 3"]:
    """Return the rows right, up and towards the viewer, in the world."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def _paint(image: np.ndarray, opaque: Layer, clear: Layer, colors: np.ndarray, glass: float) -> None:
    """Paint the layers over an image: what is solid, its edges, then the glass before it."""
    extent = float(min(image.shape[:2]))
    used = np.nonzero(opaque.covered | clear.covered)
    box = tuple(slice(int(axis.min()), int(axis.max()) + 1) for axis in used)
    image, opaque, clear = image[box], opaque.cut(box), clear.cut(box)
    solid = opaque.covered
    image[solid] = _shade(opaque, solid, colors, extent)
    lines = _edges(opaque)
    image[lines] += 0.78 * (INK - image[lines])
    front = clear.covered & (clear.depth < opaque.depth)
    if not front.any():
        return
    facing = np.clip(clear.normal[front][:, 2:], 0.0, 1.0)
    alpha = glass + 0.42 * (1.0 - facing) ** 2.5
    image[front] += alpha * (_shade(clear, front, colors, extent) - image[front])
    lines = _edges(clear) & front
    image[lines] += 0.62 * (0.35 * colors[clear.part[lines]] - image[lines])


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


def _shade(layer: Layer, where: np.ndarray, colors: np.ndarray, extent: float) -> np.ndarray:
    """Return the linear colours of these pixels: light from the sky, a soft key light from the upper left."""
    n = layer.normal[where]
    key = np.array([-0.48, 0.62, 0.62], dtype=np.float32)
    key /= np.linalg.norm(key)
    half = key + np.array([0.0, 0.0, 1.0], dtype=np.float32)
    half /= np.linalg.norm(half)
    light = 0.54 + 0.14 * n[:, 1] + 0.62 * np.clip(n @ key, 0.0, 1.0)
    shine = 0.10 * np.clip(n @ half, 0.0, 1.0) ** 32
    light *= _openness(layer, extent)[where]
    return np.clip(colors[layer.part[where]] * light[:, None] + shine[:, None], 0.0, 1.0)


def _openness(layer: Layer, extent: float) -> np.ndarray:
    """Return how open each pixel lies, in (0, 1]: less where its surroundings are nearer to the viewer.

    The surroundings' mean depth is smooth, and so found on a coarser grid.
    """
    covered = layer.covered
    depth = np.where(covered, layer.depth, np.float32(0.0))
    coarse = 3
    few_depth, few_mask = (_shrink(values.astype(np.float32), coarse) for values in (depth, covered))
    out = np.ones(depth.shape, dtype=np.float32)
    for share, strength in ((0.008, 0.32), (0.03, 0.42)):
        sigma = share * extent
        around = _blur(few_depth, sigma / coarse) / np.maximum(_blur(few_mask, sigma / coarse), 1e-3)
        out *= 1.0 - strength * np.clip((depth - _stretch(around, depth.shape)) / (2.0 * sigma), 0.0, 1.0)
    return out


def _shrink(values: np.ndarray, by: int) -> np.ndarray:
    rows, columns = (-(-n // by) * by for n in values.shape)
    padded = np.pad(values, ((0, rows - values.shape[0]), (0, columns - values.shape[1])), mode="edge")
    return padded.reshape(rows // by, by, columns // by, by).mean(axis=(1, 3))


def _stretch(values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return values on a finer grid, linear between."""
    for axis, count in enumerate(shape):
        at = np.clip((np.arange(count) + 0.5) * values.shape[axis] / count - 0.5, 0.0, values.shape[axis] - 1.0)
        low = np.minimum(at.astype(int), max(0, values.shape[axis] - 2))
        part = (at - low).astype(np.float32)
        part = part[:, None] if axis == 0 else part[None, :]
        high = np.minimum(low + 1, values.shape[axis] - 1)
        values = values.take(low, axis=axis) * (1.0 - part) + values.take(high, axis=axis) * part
    return values


def _blur(values: np.ndarray, sigma: float) -> np.ndarray:
    """A fast blur: three box filters are nearly a Gaussian one."""
    width = max(1, round(2.0 * sigma))
    for _ in range(3):
        values = ndimage.uniform_filter(values, width, mode="nearest")
    return values


def _edges(layer: Layer) -> np.ndarray:
    """Return where a line is drawn: rims of parts, steps in depth, creases."""
    found = np.zeros(layer.part.shape, dtype=bool)
    for axis in (0, 1):
        a = [slice(None)] * 2
        b = [slice(None)] * 2
        a[axis], b[axis] = slice(None, -1), slice(1, None)
        first, second = tuple(a), tuple(b)
        other = layer.part[first] != layer.part[second]
        n, m = layer.normal[first], layer.normal[second]
        bent = n[..., 0] * m[..., 0] + n[..., 1] * m[..., 1] + n[..., 2] * m[..., 2] < 0.86
        with np.errstate(invalid="ignore"):  # of two pixels that show nothing
            jump = np.abs(layer.depth[first] - layer.depth[second])
        step = jump > 3.0 + 2.5 / np.maximum(np.minimum(n[..., 2], m[..., 2]), 0.05)
        line = other | ((bent | step) & (layer.part[first] != NOTHING))
        found[first] |= line
        found[second] |= line
    return found


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
    soft = _blur(layer.covered.astype(np.float32), 0.022 * min(layer.part.shape))
    fade = [np.clip((0.5 - np.abs((np.arange(n) + 0.5) / n - 0.5)) / 0.06, 0.0, 1.0) for n in soft.shape]
    return _stretch((soft * np.outer(*fade)).astype(np.float32), (rows, columns))


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
