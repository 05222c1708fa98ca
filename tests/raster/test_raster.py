"""PNG files read back by an independent reader; what is nearest wins."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from view.view_example import box

from sashimono.raster.colors import to_linear, to_srgb
from sashimono.raster.png import png_bytes
from sashimono.view.manual.drawing import Solid, draw_picture, fit_view, layer_of, look_from

UP = np.array([0.0, 0.0, 1.0])


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**31))
def test_png_reads_back_as_it_was(rows: int, columns: int, seed: int) -> None:
    image = pytest.importorskip("PIL.Image")
    pixels = np.random.default_rng(seed).integers(0, 256, (rows, columns, 3), dtype=np.uint8)
    read = image.open(io.BytesIO(png_bytes(pixels)))
    assert read.mode == "RGB"
    assert np.array_equal(np.asarray(read), pixels)


def test_srgb_and_back() -> None:
    values = np.linspace(0.0, 1.0, 33).reshape(11, 3)
    assert to_linear(to_srgb(values)) == pytest.approx(values, abs=1e-12)


def cube(at: tuple[float, float, float], color: tuple[float, float, float]) -> Solid:
    points, faces = box((0.02, 0.02, 0.02))
    return Solid(points=points + np.array(at), faces=faces, color=np.array(color))


def test_the_nearer_of_two_boxes_is_seen() -> None:
    low, high = cube((0.0, 0.0, 0.0), (0.2, 0.4, 0.6)), cube((0.0, 0.0, 0.05), (0.8, 0.2, 0.1))
    points = np.concatenate([low.points, high.points])
    above = fit_view(points, look_from(UP, 0.7, 1.5), 60, 60)
    below = fit_view(points, look_from(UP, 0.7, -1.5), 60, 60)
    for view, first in ((above, 1), (below, 0)):
        middle = np.round(view.pixel(np.zeros(3))).astype(int)
        assert layer_of([low, high], view).part[middle[1], middle[0]] == first


@given(st.floats(-3.1, 3.1), st.floats(-1.4, 1.4), st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3))
def test_a_view_is_a_rotation_whatever_is_up(azimuth: float, elevation: float, up: list[float]) -> None:
    normal = np.array(up)
    if np.linalg.norm(normal) < 0.1:
        return
    normal = normal / np.linalg.norm(normal)
    R = look_from(normal, azimuth, elevation)
    assert pytest.approx(np.eye(3), abs=1e-9) == R @ R.T
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert R[0] @ normal == pytest.approx(0.0, abs=1e-9)  # what is right is level
    assert R[1] @ normal == pytest.approx(np.cos(elevation), abs=1e-9)  # up is up in the picture


def test_glass_shows_what_is_behind_and_an_outline_lies_over_all() -> None:
    inside, around = cube((0.0, 0.0, 0.0), (0.9, 0.1, 0.1)), cube((0.0, 0.0, 0.0), (0.2, 0.2, 0.9))
    big = Solid(points=2.0 * around.points, faces=around.faces, color=around.color)
    view = fit_view(big.points, look_from(UP, 0.7, 0.5), 80, 80)
    solid = draw_picture([inside, big], view)
    glass = draw_picture([inside, Solid(points=big.points, faces=big.faces, color=big.color, glass=True)], view)
    outlined = draw_picture([big], view, outlined=[inside])
    redness = [float((image[..., 0].astype(int) - image[..., 2]).max()) for image in (solid, glass, outlined)]
    assert redness[0] < 30 < min(redness[1:])
