"""Make the pictures of the page "How it works".

python docs/make_page_pictures.py      (needs Chromium, and Pillow in the `dev` extra)
"""

from __future__ import annotations

import io
import sys
import tempfile
from importlib.resources import as_file, files
from pathlib import Path

from headless_chromium import Page, find_chromium
from PIL import Image

import sashimono

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "examples"))
SHARE_OF_TIME = {"how_motion.webp": 0.47, "how_contact.webp": 0.755}
"""The pictures of a plan, and when in it they are taken."""


def save(picture: bytes, name: str) -> None:
    """Write a screenshot as WebP among the documents' pictures."""
    Image.open(io.BytesIO(picture)).convert("RGB").save(HERE / "images" / name, quality=70, method=6)


def main() -> int:
    """Plan, draw, and return the exit status."""
    from common import screwed_lid

    executable = find_chromium()
    if executable is None:
        sys.stderr.write("no Chromium found; on Debian: apt-get install chromium\n")
        return 1
    with as_file(files("sashimono") / "examples" / "gearbox.step") as example:
        gearbox = sashimono.read_assembly(example)
    lid = screwed_lid()
    with tempfile.TemporaryDirectory() as folder, Page(executable, width=1100, height=620) as page:
        page.open(sashimono.write_explanation(sashimono.explain(lid, "board"), lid, Path(folder, "why.html")))
        page.evaluate("sashimono.show(0, 1)")
        save(page.screenshot(), "how_explain.webp")
        page.open(sashimono.write_html(sashimono.plan_assembly(gearbox), gearbox, Path(folder, "plan.html")))
        for name, share in SHARE_OF_TIME.items():
            page.evaluate(f"sashimono.setTime({share} * sashimono.duration)")
            save(page.screenshot(), name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
