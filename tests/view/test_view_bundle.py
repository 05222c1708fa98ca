"""The viewer's scripts use nothing of three.js that its bundle does not hold."""

from __future__ import annotations

import re
from importlib import resources

VIEWER = resources.files("sashimono.view").joinpath("viewer")


def test_what_the_scripts_use_is_in_the_bundle() -> None:
    exported = VIEWER.joinpath("three_exports.js").read_text(encoding="utf-8")
    known = set(re.findall(r"\w+", " ".join(re.findall(r"export \{([^}]*)\}", exported))))
    bundle = VIEWER.joinpath("three.bundle.min.js").read_text(encoding="utf-8")
    used = {
        name
        for script in VIEWER.iterdir()
        if script.name.endswith(".js") and not script.name.startswith("three")
        for name in re.findall(r"\bTHREE\.(\w+)", script.read_text(encoding="utf-8"))
    }
    assert len(used) > 20
    assert used - known == set()
    assert {name for name in used if f"{name}:()=>" not in bundle} == set()
