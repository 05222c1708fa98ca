"""Parts of several solids in one mesh: taken apart where nothing can hold them together."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from solids import box, part, rod

from sashimono.assembly import Part
from sashimono.geometry.mesh import measures
from sashimono.io.mending.split import split_parts
from sashimono.io.raw import ReadConfig


def pins_and_bearing() -> list[Part]:
    """Two pins of different length; a ball in a ring; a box around a cavity."""
    pins = rod(1e-3, 6e-3, at=(9e-3, 0.0, 0.0)) + rod(1e-3, 9e-3)
    bearing = (rod(5e-3, 2e-3) - rod(4e-3, 4e-3)) + rod(1e-3, 2e-3)
    shell = box((8e-3, 8e-3, 8e-3)) - box((4e-3, 4e-3, 4e-3))
    return [part("pins", pins), part("bearing", bearing), part("shell", shell)]


@pytest.mark.parametrize(
    ("split", "names"),
    [
        ("auto", ["pins_1", "pins_2", "bearing", "shell"]),
        ("all", ["pins_1", "pins_2", "bearing_1", "bearing_2", "shell"]),
        ("none", ["pins", "bearing", "shell"]),
    ],
)
def test_solids_that_lie_apart_become_parts(split: Literal["auto", "all", "none"], names: list[str]) -> None:
    given = pins_and_bearing()
    parts, _, notes = split_parts(given, config=ReadConfig(split=split))
    assert [p.name for p in parts] == names
    assert len(notes) == 2
    before, after = (sum(measures.volume(p.vertices_part, p.faces) for p in parts_) for parts_ in (given, parts))
    assert after == pytest.approx(before)
    if split != "none":
        assert np.ptp(parts[0].vertices_part[:, 2]) > np.ptp(parts[1].vertices_part[:, 2])
