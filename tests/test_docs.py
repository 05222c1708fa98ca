"""The pages: every public name is described, and they build without a warning."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import sashimono

REPOSITORY = Path(__file__).resolve().parents[1]


def test_every_public_name_is_on_the_api_page_once() -> None:
    text = (REPOSITORY / "docs" / "api.md").read_text(encoding="utf-8")
    listed = re.findall(r"^::: sashimono\.(\w+)$", text, re.MULTILINE)
    assert sorted(listed) == sorted(set(sashimono.__all__) - {"__version__"})


def test_public_functions_with_many_parameters_describe_them() -> None:
    import inspect

    for name in sashimono.__all__:
        value = getattr(sashimono, name)
        if inspect.isfunction(value) and len(inspect.signature(value).parameters) >= 5:
            doc = inspect.getdoc(value) or ""
            missing = [each for each in inspect.signature(value).parameters if f"\n    {each}: " not in doc]
            assert missing == [], name


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("site")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(out)],
        cwd=REPOSITORY, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def test_each_name_has_its_place(site: Path) -> None:
    page = (site / "api.html").read_text(encoding="utf-8")
    for name in set(sashimono.__all__) - {"__version__"}:
        assert re.search(rf'id="sashimono(\.\w+)*\.{name}"', page), name


def test_pictures_are_there_and_nothing_comes_from_a_network(site: Path) -> None:
    for page in set(site.glob("*.html")) - {site / "404.html"}:
        text = page.read_text(encoding="utf-8")
        for source in re.findall(r'<(?:img|script|link)[^>]*?(?:src|href)="([^"]+)"', text):
            assert not source.startswith("http"), f"{page.name}: {source}"
            assert (site / source.split("?")[0].split("#")[0]).exists(), f"{page.name}: {source}"
