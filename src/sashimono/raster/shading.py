"""From what is nearest at each pixel to colours: soft light, lines at rims and creases. All on the processor."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from sashimono.raster.zbuffer import NOTHING, Layer

INK = np.array([0.012, 0.016, 0.024], dtype=np.float32)
"""Of edges, linear RGB."""


def view_rotation(azimuth: float, elevation: float) -> Float[np.ndarray, "3 3"]:
    """Return the rows right, up and towards the viewer, in the world."""
    ca, sa, ce, se = np.cos(azimuth), np.sin(azimuth), np.cos(elevation), np.sin(elevation)
    return np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])


def paint(image: np.ndarray, opaque: Layer, clear: Layer, colors: np.ndarray, glass: float) -> None:
    """Paint the layers over an image: what is solid, its edges, then the glass before it."""
    extent = float(min(image.shape[:2]))
    used = np.nonzero(opaque.covered | clear.covered)
    box = tuple(slice(int(axis.min()), int(axis.max()) + 1) for axis in used)
    image, opaque, clear = image[box], opaque.cut(box), clear.cut(box)
    solid = opaque.covered
    image[solid] = shade(opaque, solid, colors, extent)
    lines = edges(opaque)
    image[lines] += 0.78 * (INK - image[lines])
    front = clear.covered & (clear.depth < opaque.depth)
    if not front.any():
        return
    facing = np.clip(clear.normal[front][:, 2:], 0.0, 1.0)
    alpha = glass + 0.42 * (1.0 - facing) ** 2.5
    image[front] += alpha * (shade(clear, front, colors, extent) - image[front])
    lines = edges(clear) & front
    image[lines] += 0.62 * (0.35 * colors[clear.part[lines]] - image[lines])


def shade(layer: Layer, where: np.ndarray, colors: np.ndarray, extent: float) -> np.ndarray:
    """Return the linear colours of these pixels: light from the sky, a soft key light from the upper left."""
    n = layer.normal[where]
    key = np.array([-0.48, 0.62, 0.62], dtype=np.float32)
    key /= np.linalg.norm(key)
    half = key + np.array([0.0, 0.0, 1.0], dtype=np.float32)
    half /= np.linalg.norm(half)
    light = 0.54 + 0.14 * n[:, 1] + 0.62 * np.clip(n @ key, 0.0, 1.0)
    shine = 0.10 * np.clip(n @ half, 0.0, 1.0) ** 32
    light *= openness(layer, extent)[where]
    return np.clip(colors[layer.part[where]] * light[:, None] + shine[:, None], 0.0, 1.0)


def openness(layer: Layer, extent: float) -> np.ndarray:
    """Return how open each pixel lies, in (0, 1]: less where its surroundings are nearer to the viewer.

    The surroundings' mean depth is smooth, and so found on a coarser grid.
    """
    covered = layer.covered
    depth = np.where(covered, layer.depth, np.float32(0.0))
    coarse = 3
    few_depth, few_mask = (shrink(values.astype(np.float32), coarse) for values in (depth, covered))
    out = np.ones(depth.shape, dtype=np.float32)
    for share, strength in ((0.008, 0.32), (0.03, 0.42)):
        sigma = share * extent
        around = blur(few_depth, sigma / coarse) / np.maximum(blur(few_mask, sigma / coarse), 1e-3)
        out *= 1.0 - strength * np.clip((depth - stretch(around, depth.shape)) / (2.0 * sigma), 0.0, 1.0)
    return out


def edges(layer: Layer) -> np.ndarray:
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


def blur(values: np.ndarray, sigma: float) -> np.ndarray:
    """A fast blur: three box filters are nearly a Gaussian one."""
    width = max(1, round(2.0 * sigma))
    for _ in range(3):
        values = ndimage.uniform_filter(values, width, mode="nearest")
    return values


def shrink(values: np.ndarray, by: int) -> np.ndarray:
    rows, columns = (-(-n // by) * by for n in values.shape)
    padded = np.pad(values, ((0, rows - values.shape[0]), (0, columns - values.shape[1])), mode="edge")
    return padded.reshape(rows // by, by, columns // by, by).mean(axis=(1, 3))


def stretch(values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Return values on a finer grid, linear between."""
    for axis, count in enumerate(shape):
        at = np.clip((np.arange(count) + 0.5) * values.shape[axis] / count - 0.5, 0.0, values.shape[axis] - 1.0)
        low = np.minimum(at.astype(int), max(0, values.shape[axis] - 2))
        part = (at - low).astype(np.float32)
        part = part[:, None] if axis == 0 else part[None, :]
        high = np.minimum(low + 1, values.shape[axis] - 1)
        values = values.take(low, axis=axis) * (1.0 - part) + values.take(high, axis=axis) * part
    return values
