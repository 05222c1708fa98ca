"""The numbered examples run as a user runs them, and say what they should."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SAYS = {
    "01_plan.py": ["AssemblyPlan(complete, 5 of 5 parts placed", "verified: 5 steps hold", "plan.html"],
    "02_conditions.py": ["base can leave at once", "or without screw_1 and screw_2", "orders: 30"],
    "03_explain.py": ["board is proven to be blocked for translations", "stopped by lid", "remove first: "],
    "04_grippers.py": ["lid: robotiq-2f85", "screw_1: franka-hand"],
    "05_rrt_connect.py": ["a path of"],
}


def test_every_numbered_example_is_here() -> None:
    assert sorted(path.name for path in EXAMPLES.glob("[0-9]*.py")) == sorted(SAYS)


@pytest.mark.parametrize("name", SAYS)
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name)], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for words in SAYS[name]:
        assert words in done.stdout, done.stdout


def test_the_package_imports() -> None:
    done = subprocess.run([sys.executable, "-c", "import sashimono"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
