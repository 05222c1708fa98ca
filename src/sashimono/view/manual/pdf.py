"""The page on paper: printed by a Chromium or Chrome that is installed, without a window."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from sashimono.errors import SashimonoError
from sashimono.files import atomic_write

BROWSERS = (
    "chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "microsoft-edge",
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    "/Applications/Chromium.app/Contents/MacOS/Chromium",
)  # fmt: skip
"""What is looked for, first to last."""


def find_browser() -> str | None:
    """Return the path of an installed Chromium, Chrome or Edge; None if there is none."""
    return next((path for name in BROWSERS if (path := shutil.which(name))), None)


def print_page(page: str | Path, path: str | Path, *, browser: str | None = None, seconds: float = 300.0) -> Path:
    """Print an HTML file as PDF, whole or not at all, and return the PDF's path.

    Args:
        page: The file.
        path: The PDF to write.
        browser: The Chromium to print with; the one that is installed if None.
        seconds: After so long the browser counts as stuck.

    Raises SashimonoError where there is no browser, or where it prints nothing.
    """
    browser = browser or find_browser()
    if browser is None:
        raise SashimonoError(no_browser_words(page))
    # a sandbox needs a user other than root; the page is our own, and loads nothing
    sandbox = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with atomic_write(path) as scratch, tempfile.TemporaryDirectory(prefix="sashimono-print-") as profile:
        command = [
            browser, "--headless", "--disable-gpu", "--no-first-run", "--disable-extensions", "--disable-sync",
            "--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage",
            *sandbox, f"--user-data-dir={profile}", "--no-pdf-header-footer",
            f"--print-to-pdf={scratch.resolve()}", Path(page).resolve().as_uri(),
        ]  # fmt: skip
        try:
            done = subprocess.run(command, capture_output=True, timeout=seconds, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise SashimonoError(f"{browser} did not print {page}: {error}. Print it from a browser.") from error
        if scratch.stat().st_size == 0:
            said = done.stderr.decode("utf-8", "replace").strip().split("\n")[-1]
            raise SashimonoError(f"{browser} did not print {page} ({said}). Print it from a browser.")
    return Path(path)


def no_browser_words(page: str | Path) -> str:
    """Return what to do where no browser was found."""
    return f"no Chromium or Chrome found to print a PDF: install one, or print {page} from any browser"
