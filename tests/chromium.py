"""A page in headless Chromium for tests, and axe-core, which says what on it shuts people out."""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

AXE_OPTIONS = (
    "{resultTypes: ['violations'], runOnly: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa', 'best-practice']}"
)


def headless() -> ModuleType:
    """Return the module that drives Chromium; it lies with the documents, whose pictures it takes."""
    path = Path(__file__).resolve().parent.parent / "docs" / "headless_chromium.py"
    spec = importlib.util.spec_from_file_location("headless_chromium", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@contextmanager
def open_browser(**options: Any) -> Iterator[Any]:
    """Yield a page of a new browser; skips where there is no Chromium."""
    module = headless()
    executable = module.find_chromium()
    if executable is None:
        pytest.skip("no Chromium installed (Debian: apt-get install chromium)")
    with module.Page(executable, **options) as page:
        yield page


def set_size(page: Any, width: int, height: int) -> None:
    """Give the page another size [pixels], and wait until it is drawn so."""
    page.send("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
    page.screenshot()


def axe_findings(page: Any) -> list[str]:
    """Return what axe-core finds on the page as it stands: a line a finding, with the elements."""
    if not page.evaluate("typeof axe !== 'undefined'"):
        page.evaluate(files("axe_playwright_python").joinpath("axe.min.js").read_text(encoding="utf-8") + ";1")
    found = page.evaluate(f"axe.run(document, {AXE_OPTIONS})")
    return [
        f"{entry['id']}: {node['target']} {node['html'][:120]} ({node.get('failureSummary', '')[:300]})"
        for entry in found["violations"]
        for node in entry["nodes"]
    ]


CONTROLS = (
    "[...document.querySelectorAll('button, select, input, summary, a[href], textarea, [tabindex]')]"
    ".filter((node) => node.checkVisibility({visibilityProperty: true}) && !node.disabled && node.tabIndex >= 0)"
)
"""Everything that can be pressed, chosen or typed into."""

DESCRIBE = (
    "((node) => (node.id || node.getAttribute('aria-label') || node.title || node.textContent || node.tagName)"
    ".trim().slice(0, 60))"
)
"""How a control is named in what a test says."""


def unreached_by_tab(page: Any) -> list[str]:
    """Return the controls that the Tab key does not come to."""
    page.evaluate(f"window.wanted = {CONTROLS}; window.reached = new Set(); document.activeElement.blur()")
    for _ in range(int(page.evaluate("window.wanted.length")) + 3):
        page.press("Tab", "Tab")
        page.evaluate("void window.reached.add(document.activeElement)")
    return page.evaluate(f"window.wanted.filter((node) => !window.reached.has(node)).map({DESCRIBE})")


def covered_by_others(page: Any) -> list[str]:
    """Return the controls that a mouse cannot press in their middle, each scrolled to where it is seen."""
    return page.evaluate(
        f"{CONTROLS}.filter((node) => {{ node.scrollIntoView({{block: 'center', behavior: 'instant'}});"
        " const box = node.getBoundingClientRect();"
        " const met = document.elementFromPoint(box.left + box.width / 2, box.top + box.height / 2);"
        f" return !met || !(node.contains(met) || met.contains(node)); }}).map({DESCRIBE})"
    )
