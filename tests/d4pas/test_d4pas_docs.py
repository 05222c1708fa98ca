"""The page on the dataset: its table names every column, and its snippet without our code gives our labels."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("pyarrow", reason="the extra 'dataset' is not installed")

from sashimono.d4pas.dataset import load
from sashimono.d4pas.make import make_dataset
from sashimono.d4pas.tables import schemas

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "dataset.md").read_text(encoding="utf-8")


def test_every_column_is_described() -> None:
    for name, schema in schemas().items():
        start = PAGE.index(f"`{name}.parquet`")
        section = PAGE[start : PAGE.index("\n\n", PAGE.index("`id`", start))]
        assert [column for column in schema.names if f"`{column}`" not in section] == [], name


def test_labels_without_our_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    book = tmp_path / "one.toml"
    book.write_text('name = "one"\n[families]\nbolted_plates = 1\n')
    make_dataset(str(book), tmp_path / "data")
    monkeypatch.chdir(tmp_path / "data")
    (snippet,) = (text for text in re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL) if "pyarrow" in text)
    names: dict[str, Any] = {}
    exec(snippet, names)
    blueprint = load(tmp_path / "data")[0]
    (base,) = names["placed"]
    right = blueprint.state(1 << base)
    assert names["y"] == {part: right >> part & 1 for part in range(len(blueprint)) if part != base}
    assert sum(names["y"].values()) > 0
