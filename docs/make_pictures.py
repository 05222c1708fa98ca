"""Make a picture of a plan: ``python docs/make_pictures.py plan.html picture.png --at 0.6``."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from headless_chromium import Page, find_chromium


def make_picture(
    page_file: Path, picture: Path, *, at: float, view: dict[str, object], dark: bool, width: int, height: int
) -> None:
    """Write a PNG of the viewer page at a share ``at`` in [0, 1] of its time. RuntimeError without Chromium."""
    executable = find_chromium()
    if executable is None:
        raise RuntimeError("no Chromium found; on Debian: apt-get install chromium")
    with Page(executable, width=width, height=height, dark=dark) as page:
        page.open(page_file)
        page.evaluate(f"sashimono.setTime({at} * sashimono.duration)")
        page.evaluate(f"sashimono.setView({json.dumps(view)})")
        picture.write_bytes(page.screenshot())


def main() -> int:
    """Read the command line, make the picture, return the exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("page", type=Path, help="a plan.html")
    parser.add_argument("picture", type=Path, help="the PNG to write")
    parser.add_argument("--at", type=float, default=0.6, help="share of the animation's time, 0 to 1")
    parser.add_argument("--explode", type=float, default=0.0, help="exploded view, 0 to 1")
    parser.add_argument("--see-through", action="store_true", help="make placed parts transparent")
    parser.add_argument("--no-contacts", action="store_true")
    parser.add_argument("--dark", action="store_true", help="dark colour scheme")
    parser.add_argument("--size", default="1400x900", help="width and height [pixels]")
    options = parser.parse_args()
    width, height = map(int, options.size.split("x"))
    view = {"explode": options.explode, "xray": options.see_through, "contacts": not options.no_contacts}
    try:
        make_picture(
            options.page, options.picture, at=options.at, view=view, dark=options.dark, width=width, height=height
        )
    except RuntimeError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
