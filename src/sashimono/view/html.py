"""The viewer page: one file that plays a plan without a network."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

from sashimono.assembly import Assembly
from sashimono.files import atomic_write
from sashimono.plan import AssemblyPlan
from sashimono.view.config import ViewConfig
from sashimono.view.scene import ViewerScene, make_scene

SCRIPTS = (
    "se3.js", "data.js", "timeline.js", "bodies.js", "contacts.js", "stage.js", "outline.js", "section.js",
    "surfaces.js", "panel.js", "measure.js", "main.js",
)  # fmt: skip
"""The page's own scripts, in the order in which they are joined; each uses only names of those before it."""


def _asset(name: str) -> str:
    return resources.files("sashimono.view").joinpath("viewer", name).read_text(encoding="utf-8")


def _json_for_script(value: object) -> str:
    """Return JSON that is safe inside a script element: no "<" that could close it, ASCII only."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def render_html(plan: AssemblyPlan, assembly: Assembly, *, config: ViewConfig | None = None) -> str:
    """Return the viewer page as text; see `write_html`."""
    scene = make_scene(plan, assembly, config or ViewConfig())
    return render_page(scene, title=f"{scene.json['title']} · assembly plan", scripts=SCRIPTS)


def render_page(scene: ViewerScene, *, title: str, scripts: Sequence[str]) -> str:
    """Return one self-contained page that shows a scene with these scripts of the ``viewer`` folder."""
    own = "\n".join(_asset(name) for name in scripts)
    pieces = {
        "TITLE": html.escape(title),
        "STYLE": _asset("viewer.css"),
        "DATA": _json_for_script(scene.json),
        "GEOMETRY": base64.b64encode(scene.geometry).decode("ascii"),
        "THREE_LICENSE": _asset("three.LICENSE").strip(),
        "THREE": _asset("three.bundle.min.js"),
        "VIEWER": own,
    }
    # split at the marks once: a piece may contain the mark of another
    chunks = _asset("page.html").split("%%")
    chunks[1::2] = [pieces[name] for name in chunks[1::2]]
    return "".join(chunks)


def write_html(plan: AssemblyPlan, assembly: Assembly, path: str | Path, *, config: ViewConfig | None = None) -> Path:
    """Write one self-contained page that plays the plan, and return its path.

    It opens from disk and asks nothing of a network. ``assembly`` holds the geometry of the plan's parts.
    Positions are rounded to 1/65535 of a part's extent, and very large assemblies are simplified
    (`ViewConfig.max_faces`), for display only. Part names may be any text.

    Raises OSError if ``path`` cannot be written; an earlier file is then still whole.
    """
    with atomic_write(path) as scratch:
        scratch.write_bytes(render_html(plan, assembly, config=config).encode("utf-8"))
    return Path(path)
