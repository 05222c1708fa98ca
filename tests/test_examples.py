"""The numbered examples run as a user runs them, and say what they should."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SAYS = {
    "01_plan.py": ["AssemblyPlan(complete, 5 of 5 parts placed", "verified: 5 steps hold", "plan.html"],
    "02_conditions.py": ["base can leave at once", "or without screw_1 and screw_2", "orders: 30"],
    "03_explain.py": ["board is proven to be blocked for translations", "stopped by lid", "remove first: "],
    "04_grippers.py": ["lid: robotiq-2f85", "screw_1: franka-hand"],
    "05_rrt_connect.py": ["a path of"],
    "06_doctor_and_diff.py": [
        "Diagnosis(5 parts, ",
        "Revision(1 of 5 parts changed, the old plan works)",
        "lid: changed",
    ],
}


READER = "07_read_plan.py"
NOTEBOOK = "08_notebook.ipynb"


def test_every_numbered_example_is_here_and_in_the_course() -> None:
    names = sorted(path.name for path in EXAMPLES.glob("[0-9]*"))
    assert names == sorted([*SAYS, READER, NOTEBOOK])
    course = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    assert [name for name in names if f"`{name}`" not in course] == []


def run_example(name: str, folder: Path) -> Path:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name)], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    for words in SAYS[name]:
        assert words in done.stdout, done.stdout
    return folder


@pytest.fixture(scope="module")
def planned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plan that the first example writes."""
    return run_example("01_plan.py", tmp_path_factory.mktemp("first")) / "plan" / "plan.json"


@pytest.mark.parametrize("name", sorted(set(SAYS) - {"01_plan.py"}))
def test_an_example_runs(name: str, tmp_path: Path) -> None:
    run_example(name, tmp_path)


def test_a_plan_is_read_with_numpy_alone(planned: Path) -> None:
    """In an interpreter that finds neither the package nor what it depends on, but NumPy."""
    block = "import sys; sys.modules.update(dict.fromkeys(['sashimono', 'scipy', 'numba', 'jaxtyping'])); "
    run = f"import runpy; sys.argv = ['', {str(planned)!r}]; runpy.run_path({str(EXAMPLES / READER)!r})"
    done = subprocess.run([sys.executable, "-c", block + run], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert [line.split(":")[0] for line in lines] == json.loads(planned.read_text(encoding="utf-8"))["order"]
    assert lines[0].endswith("1 poses, not held")
    assert all(line.endswith("poses, grasp") for line in lines[1:])
    assert len((EXAMPLES / READER).read_text(encoding="utf-8").splitlines()) <= 25


def test_the_notebook_runs_and_says_what_is_stored_in_it() -> None:
    """Outputs are compared as text: what the pages show of the notebook is what it says now."""
    stored = nbformat.read(EXAMPLES / NOTEBOOK, as_version=4)
    made = nbformat.read(EXAMPLES / NOTEBOOK, as_version=4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # those of the kernel's own libraries
        NotebookClient(
            made, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(EXAMPLES)}}
        ).execute()
    code = [cell for cell in made.cells if cell.cell_type == "code"]
    assert any("iframe" in str(output) for cell in code for output in cell.outputs), "the viewer is shown in place"
    for old, new in zip(stored.cells, made.cells, strict=True):
        assert texts(new) == texts(old), new.source


def texts(cell: Any) -> list[str]:
    """What a cell said, as text without its numbers; pages in 3D are left out."""
    said = []
    for output in cell.get("outputs", ()):
        text = output.get("text") or output.get("data", {}).get("text/plain", "")
        said.append(re.sub(r"\d+(\.\d+)?", "#", "".join(text)).strip())
    return said


def test_the_package_imports() -> None:
    done = subprocess.run([sys.executable, "-c", "import sashimono"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
