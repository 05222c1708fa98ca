"""Make a picture, or a film, of a plan.

python docs/make_pictures.py plan.html picture.png --at 0.6
python docs/make_pictures.py plan.html film.webp --frames 150      (needs Pillow, in the `dev` extra)
"""

from __future__ import annotations

import argparse
import io
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from headless_chromium import Page, find_chromium

FRAME_MS = 80


def make_frames(
    page_file: Path, times: Sequence[float], *, view: dict[str, object], dark: bool, width: int, height: int
) -> list[bytes]:
    """Return PNGs of the viewer page at these shares in [0, 1] of its time. RuntimeError without Chromium."""
    executable = find_chromium()
    if executable is None:
        raise RuntimeError("no Chromium found; on Debian: apt-get install chromium")
    frames = []
    with Page(executable, width=width, height=height, dark=dark) as page:
        page.open(page_file)
        page.evaluate(f"sashimono.setView({json.dumps(view)})")
        for time in times:
            page.evaluate(f"sashimono.setTime({time} * sashimono.duration)")
            frames.append(page.screenshot())
    return frames


def write_film(frames: Sequence[bytes], film: Path) -> None:
    """Write an endless animated WebP; the last frame stays a while."""
    from PIL import Image

    images = [Image.open(io.BytesIO(frame)).convert("RGB") for frame in frames]
    durations = [FRAME_MS] * (len(images) - 1) + [2500]
    images[0].save(film, save_all=True, append_images=images[1:], duration=durations, loop=0, quality=60, method=4)


def main() -> int:
    """Read the command line, make the picture, return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", type=Path, help="a plan.html")
    parser.add_argument("picture", type=Path, help="the .png, or the .webp film, to write")
    parser.add_argument("--at", type=float, default=0.6, help="share of the animation's time, 0 to 1")
    parser.add_argument("--frames", type=int, default=150, help="frames of a film over the whole time")
    parser.add_argument("--explode", type=float, default=0.0, help="exploded view, 0 to 1")
    parser.add_argument("--see-through", action="store_true", help="make placed parts transparent")
    parser.add_argument("--no-contacts", action="store_true")
    parser.add_argument("--dark", action="store_true", help="dark colour scheme")
    parser.add_argument("--size", default="1400x900", help="width and height [pixels]")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    view = {"explode": options.explode, "xray": options.see_through, "contacts": not options.no_contacts}
    film = options.picture.suffix == ".webp"
    times = [k / (options.frames - 1) for k in range(options.frames)] if film else [options.at]
    try:
        frames = make_frames(options.page, times, view=view, dark=options.dark, width=width, height=height)
    except RuntimeError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    if film:
        write_film(frames, options.picture)
    else:
        options.picture.write_bytes(frames[0])
    return 0


if __name__ == "__main__":
    sys.exit(main())
