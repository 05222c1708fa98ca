"""A hook of mkdocs: the notebook among the examples becomes a page, with the outputs that are stored in it.

A test runs the notebook and compares its outputs with these. The viewer is in no stored output (it is a megabyte);
the page shows a picture in its place.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

NOTEBOOK = Path(__file__).resolve().parent.parent / "examples" / "08_notebook.ipynb"
PAGE = "notebook.md"
VIEWER = "![The viewer, in place](images/how_motion.webp)"


def on_files(files: Files, config: Any) -> Files:
    """Add the page."""
    files.append(File.generated(config, PAGE, content=page_of(NOTEBOOK)))
    return files


def page_of(path: Path) -> str:
    """Return a notebook as Markdown."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        parts += [shown for output in cell["outputs"] if (shown := _shown(output))]
    where = "The notebook is `examples/08_notebook.ipynb`; its viewer is a picture here, and can be turned there.\n\n"
    return "\n\n".join([parts[0], where.strip(), *parts[1:]]) + "\n"


def _shown(output: dict[str, Any]) -> str:
    data = output.get("data", {})
    if "text/html" in data:
        return "".join(data["text/html"])
    text = "".join(output.get("text", "") or data.get("text/plain", ""))
    if text.startswith("Page("):
        return VIEWER
    return f"```text\n{text.rstrip()}\n```" if text.strip() else ""
