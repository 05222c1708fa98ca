"""Pictures: what is in front is seen, what hides others is glass, colours follow the order, pages are written."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import solids

from sashimono.assembly import Assembly
from sashimono.d4pas.exploded import explosion
from sashimono.d4pas.palette import order_colors
from sashimono.d4pas.render import RenderConfig, render
from sashimono.d4pas.sheets import Entry, SheetConfig, contact_sheet
from sashimono.raster.colors import to_linear, to_srgb

REPOSITORY = Path(__file__).resolve().parents[2]
SMALL = RenderConfig(width=120, height=100)


def stands_out(pixels: np.ndarray, channel: int) -> int:
    """Return how many pixels are of this colour: 0 red, 2 blue."""
    values = pixels.astype(int)
    return int((values[..., channel] > 1.2 * np.delete(values, channel, axis=2).max(axis=2) + 10).sum())


def test_colours_are_of_like_lightness_and_distinct() -> None:
    colors = order_colors(12)
    luminance = colors @ [0.2126, 0.7152, 0.0722]
    assert luminance.min() > 0.12
    assert luminance.max() < 0.6
    gaps = np.linalg.norm(np.diff(to_srgb(colors), axis=0), axis=1)
    assert gaps.min() > 0.05
    np.testing.assert_allclose(to_linear(to_srgb(colors)), colors, atol=1e-12)
    assert order_colors(1).shape == (1, 3)


def test_the_nearer_part_is_seen() -> None:
    assembly = solids.assembly(low=solids.box((0.1, 0.1, 0.02)), high=solids.box((0.1, 0.1, 0.02), (0.0, 0.0, 0.02)))
    colors = np.array([[0.6, 0.05, 0.05], [0.05, 0.05, 0.6]])
    picture = render(assembly, colors, config=replace(SMALL, elevation=1.2, see_through=False))
    assert stands_out(picture.pixels, 2) > 3 * stands_out(picture.pixels, 0) > 0
    assert (picture.pixels[0] == 255).all()
    assert set(picture.anchors) == {0, 1}
    x, y, room = picture.anchors[1]
    assert room > 10.0
    assert picture.pixels[round(y), round(x)].argmax() == 2


def test_what_is_inside_is_seen_through_glass() -> None:
    assembly = solids.box_with_lid()
    colors = np.array([[0.3, 0.3, 0.3], [0.7, 0.02, 0.02], [0.3, 0.3, 0.3]])
    red = [
        stands_out(render(assembly, colors, config=replace(SMALL, see_through=through)).pixels, 0)
        for through in (False, True)
    ]
    assert red[0] == 0
    assert red[1] > 50


def test_same_picture_each_time() -> None:
    assembly = solids.peg_in_plate()
    first, second = (render(assembly, order_colors(2), config=SMALL).pixels for _ in range(2))
    assert (first == second).all()


def test_explosion_clears_each_part_of_those_before() -> None:
    assembly: Assembly = solids.box_with_lid()
    up = np.array([0.0, 0.0, 1.0])
    offsets = explosion(assembly, (0, 1, 2), {1: up, 2: up})
    boxes = [part.bounds_world + offset for part, offset in zip(assembly.parts, offsets, strict=True)]
    assert not offsets[0].any()
    assert boxes[1][0, 2] > boxes[0][1, 2]
    assert boxes[2][0, 2] > boxes[1][1, 2]
    np.testing.assert_allclose(explosion(assembly, (0, 1, 2), {1: up, 2: up}, share=0.5), 0.5 * offsets)


@pytest.mark.parametrize("name", ["sheet.png", "sheet.webp"])
def test_contact_sheet(tmp_path: Path, name: str) -> None:
    image = pytest.importorskip("PIL.Image")
    entries = [
        Entry(assembly=solids.peg_in_plate(), order=(0, 1), title="peg in plate", note="2 parts"),
        Entry(assembly=solids.box_with_lid(), order=(0, 1, 2), title="box with lid"),
        Entry(assembly=solids.pair_in_pair(), order=(0, 1, 2, 3)),
    ]
    contact_sheet(entries, tmp_path / name, columns=2, config=SheetConfig(picture=SMALL))
    with image.open(tmp_path / name) as page:
        page.load()
        assert page.width >= 240
        assert page.height >= 200
        pixels = np.asarray(page.convert("RGB"))
    assert (pixels[:, :, 2].astype(int) > pixels[:, :, 0] + 40).any(), "the first part's colour"
    assert (pixels[:, :, 0].astype(int) > pixels[:, :, 2] + 40).any(), "the last part's colour"


def test_example_draws_a_state(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    image = pytest.importorskip("PIL.Image")
    from sashimono.d4pas.make import make_dataset

    book = tmp_path / "one.toml"
    book.write_text('name = "one"\n[families]\nbolted_plates = 1\n')
    make_dataset(str(book), tmp_path / "data")
    out = tmp_path / "states.png"
    command = [sys.executable, str(REPOSITORY / "examples" / "d4pas_states.py"), str(tmp_path / "data"), "--out", out]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "bolted_plates-000000: 8 parts" in done.stderr
    assert "y of the 4 parts left: [" in done.stderr
    with image.open(out) as page:
        assert page.size == (1280, 560)
