"""Contact sheets: many blueprints on one page, coloured and numbered by assembly order, with a colour bar."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from sashimono.assembly import Assembly
from sashimono.d4pas.dataset import Blueprint
from sashimono.d4pas.exploded import explosion, ways_out
from sashimono.d4pas.palette import order_colors, ramp, to_bytes
from sashimono.d4pas.recipe import ROTATION
from sashimono.d4pas.render import Picture, RenderConfig, render
from sashimono.errors import SashimonoError
from sashimono.raster.colors import to_srgb

if TYPE_CHECKING:
    from PIL import Image, ImageDraw

TEXT = (58, 66, 78)
PALE = (132, 140, 152)


@dataclass(frozen=True, kw_only=True, eq=False)
class Entry:
    """One picture of a sheet."""

    assembly: Assembly
    order: Sequence[int]
    """Assembly order, base first."""
    title: str = ""
    note: str = ""
    ways_out: Mapping[int, Float[np.ndarray, "3"]] = field(default_factory=dict)
    """Directions in which parts leave, for the exploded view (`sashimono.d4pas.exploded.ways_out`)."""


@dataclass(frozen=True, kw_only=True)
class SheetConfig:
    """How a sheet looks."""

    picture: RenderConfig = field(default_factory=lambda: RenderConfig(width=420, height=360))
    explode: float = 0.5
    """Exploded view: 0 in place, 1 all parts clear of each other."""
    most_numbered: int = 24
    """Assemblies of more parts have no numbers: they would hide the parts."""
    text: int = 17
    """Size of the titles [pixels]."""


def order_picture(entry: Entry, *, config: SheetConfig | None = None) -> Image.Image:
    """Return a picture of an assembly, coloured and numbered by its order. Needs Pillow."""
    pil, config = _require_pillow(), config or SheetConfig()
    colors = np.zeros((len(entry.assembly), 3))
    colors[list(entry.order)] = order_colors(len(entry.order))
    moves = explosion(entry.assembly, entry.order, entry.ways_out, share=config.explode) if config.explode else None
    picture = render(entry.assembly, colors, offsets=moves, config=config.picture)
    image = pil.Image.fromarray(picture.pixels)
    if len(entry.order) <= config.most_numbered:
        _number(image, picture, entry.order, colors)
    return image


def contact_sheet(entries: Iterable[Entry], path: Path, *, columns: int = 6, config: SheetConfig | None = None) -> None:
    """Write a page of pictures in rows, with their titles and a colour bar below: PNG or WebP, by the file's name.

    Needs Pillow, the extra ``render``.
    """
    pil, config = _require_pillow(), config or SheetConfig()
    entries = list(entries)
    width, height = config.picture.width, config.picture.height
    caption, foot, pad = round(3.1 * config.text), round(4.2 * config.text), config.text
    rows = -(-len(entries) // columns)
    columns = min(columns, max(1, len(entries)))
    page = pil.Image.new("RGB", (columns * width + 2 * pad, rows * (height + caption) + foot + 2 * pad), "white")
    pen = pil.ImageDraw.Draw(page)
    title, note = pil.ImageFont.load_default(config.text), pil.ImageFont.load_default(0.82 * config.text)
    for k, entry in enumerate(entries):
        left, top = pad + k % columns * width, pad + k // columns * (height + caption)
        page.paste(order_picture(entry, config=config), (left, top))
        middle = left + width // 2
        pen.text((middle, top + height + 0.55 * config.text), entry.title, TEXT, font=title, anchor="mm")
        pen.text((middle, top + height + 1.75 * config.text), entry.note, PALE, font=note, anchor="mm")
    _color_bar(page, pen, title, config.text)
    page.save(path, **({"quality": 88, "method": 6} if path.suffix.lower() == ".webp" else {"optimize": True}))


def entry_of(blueprint: Blueprint, steps: Sequence[Mapping[str, Any]] = ()) -> Entry:
    """Return the entry of a blueprint with its first listed order; upright, where its recipe turned it.

    Args:
        blueprint: One that has an order.
        steps: Its rows of the table of steps, by which parts are drawn apart.
    """
    upright = _upright(blueprint.params)
    first = [row for row in steps if row["order_index"] == 0]
    assembly = blueprint.assembly()
    turned = tuple(replace(part, T_world_part=upright @ part.T_world_part) for part in assembly.parts)
    count = len(blueprint.parts)
    orders = "" if blueprint.orders is None else f", {_short(blueprint.orders)} order{'s' * (blueprint.orders != 1)}"
    return Entry(
        assembly=Assembly(parts=turned, identical=assembly.identical),
        order=blueprint.sequences[0],
        title=blueprint.family.replace("_", " "),
        note=f"{count} parts{orders}",
        ways_out={part: upright[:3, :3] @ way for part, way in ways_out(first).items()},
    )


def _upright(params: Mapping[str, Any]) -> Float[np.ndarray, "4 4"]:
    """Return the turn that undoes the one of the recipe."""
    T = np.eye(4)
    if params.get(ROTATION) is not None:
        T[:3, :3] = Rotation.from_quat(params[ROTATION], scalar_first=True).as_matrix().T
    return T


def _short(number: int) -> str:
    """A number of at most five digits, or with its power of ten: "12,345", "3.1e9"."""
    if number < 100_000:
        return f"{number:,}"
    digits = len(str(number)) - 1
    return f"{number // 10 ** (digits - 1) / 10:.1f}e{digits}"


def _number(image: Image.Image, picture: Picture, order: Sequence[int], colors: Float[np.ndarray, "part 3"]) -> None:
    """Write each part's place in the order on it, or beside it with a line where it is too small."""
    pil = _require_pillow()
    big = 4  # drawn larger and averaged down: Pillow's lines have steps
    layer = pil.Image.new("RGBA", (image.width * big, image.height * big), (255, 255, 255, 0))
    pen = pil.ImageDraw.Draw(layer)
    size = max(10.5, (0.034 if len(order) <= 12 else 0.030) * min(image.size))
    font = pil.ImageFont.load_default(size * big)
    radius = 0.78 * size
    places = _places(picture, order, radius, image.size)
    for part, (x, y) in places.items():
        ax, ay, _ = picture.anchors[part]
        if (x - ax) ** 2 + (y - ay) ** 2 > 1.0:
            pen.line([(ax * big, ay * big), (x * big, y * big)], (40, 46, 56, 220), width=round(0.9 * big))
            dot = 1.6
            box = [(ax - dot) * big, (ay - dot) * big, (ax + dot) * big, (ay + dot) * big]
            pen.ellipse(box, (40, 46, 56, 255))
    for number, part in enumerate(order, start=1):
        if part not in places:
            continue
        x, y = places[part]
        box = [(x - radius) * big, (y - radius) * big, (x + radius) * big, (y + radius) * big]
        rim = to_bytes(colors[part] * 0.72)
        pen.ellipse(box, (255, 255, 255, 242), outline=(*rim, 255), width=round(1.3 * big))
        pen.text((x * big, y * big), str(number), (34, 40, 50, 255), font=font, anchor="mm")
    small = layer.resize(image.size, pil.Image.Resampling.LANCZOS)
    image.paste(small, (0, 0), small)


def _places(
    picture: Picture, order: Sequence[int], radius: float, size: tuple[int, int]
) -> dict[int, tuple[float, float]]:
    """Return where the numbers go: on the parts that have room, then around them, none over another."""
    anchors = picture.anchors
    middle = np.mean([anchors[part][:2] for part in order if part in anchors], axis=0).tolist()
    places: dict[int, tuple[float, float]] = {}

    def is_free(x: float, y: float, part: int) -> bool:
        inside = radius + 1 < x < size[0] - radius - 1 and radius + 1 < y < size[1] - radius - 1
        apart = all((x - u) ** 2 + (y - v) ** 2 > (2.2 * radius) ** 2 for u, v in places.values())
        clear = all((x - a[0]) ** 2 + (y - a[1]) ** 2 > (1.2 * radius) ** 2 for k, a in anchors.items() if k != part)
        return inside and apart and clear

    roomy = sorted((part for part in order if part in anchors), key=lambda part: -anchors[part][2])
    for part in roomy:
        ax, ay, room = anchors[part]
        if room > 1.25 * radius and is_free(ax, ay, part):
            places[part] = (ax, ay)
    for part in roomy:
        if part in places:
            continue
        ax, ay, _ = anchors[part]
        outward = math.atan2(ay - middle[1], ax - middle[0])
        spots = [
            (ax + reach * radius * math.cos(outward + turn), ay + reach * radius * math.sin(outward + turn))
            for reach in (2.2, 3.0, 4.0, 5.2, 6.8, 9.0)
            for turn in (0.0, 0.45, -0.45, 0.9, -0.9, 1.4, -1.4, 2.0, -2.0, 2.6, -2.6)
        ]
        free = next(((x, y) for x, y in spots if is_free(x, y, part)), None)
        if free is not None:
            places[part] = free
    return places


def _color_bar(page: Image.Image, pen: ImageDraw.ImageDraw, font: Any, text: int) -> None:
    pil = _require_pillow()
    width, height = round(min(0.36 * page.width, 26 * text)), round(0.8 * text)
    left, top = (page.width - width) // 2, page.height - round(2.6 * text)
    colors = np.round(255.0 * to_srgb(ramp(np.linspace(0.0, 1.0, width)))).astype(np.uint8)
    page.paste(pil.Image.fromarray(np.tile(colors[None], (height, 1, 1))), (left, top))
    pen.rectangle([left, top, left + width - 1, top + height - 1], outline=(110, 118, 130))
    middle = top + height // 2
    pen.text((left - text, middle), "first", TEXT, font=font, anchor="rm")
    pen.text((left + width + text, middle), "last", TEXT, font=font, anchor="lm")


def _require_pillow() -> Any:
    try:
        import PIL
        import PIL.Image
        import PIL.ImageDraw
        import PIL.ImageFont
    except ImportError:
        raise SashimonoError(
            "drawing pictures needs Pillow; install the extra: pip install 'sashimono[render]'"
        ) from None
    return PIL
