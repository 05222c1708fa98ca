"""Files appear whole or not at all, with the permissions of any new file."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from sashimono.files import atomic_write


def test_a_file_takes_its_place_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("old")
    with atomic_write(path) as scratch:
        scratch.write_text("new")
        assert path.read_text() == "old"
        assert scratch.parent == tmp_path
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_leaves_all_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text("old")

    def interrupted() -> None:
        with atomic_write(path) as scratch:
            scratch.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_no_folder_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_write(tmp_path / "absent" / "plan.json"):
        pass


@pytest.mark.parametrize("umask", [0o022, 0o077, 0o002])
def test_the_umask_decides_who_may_read(tmp_path: Path, umask: int) -> None:
    """In a process of its own, because a umask is everybody's."""
    path = tmp_path / "plan.json"
    code = (
        f"import os, sys; os.umask({umask}); from sashimono.files import atomic_write\n"
        "with atomic_write(sys.argv[1]) as scratch: scratch.write_text('x')"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=True)
    assert stat.S_IMODE(os.stat(path).st_mode) == 0o666 & ~umask


def test_nothing_in_the_package_writes_by_itself() -> None:
    """One `atomic_write`: no other file renames into place, sets the umask, or redirects the process's output."""
    package = Path(__file__).resolve().parents[1] / "src" / "sashimono"
    kept = {"files.py", "outputs.py", "d4pas/export.py", "cli.py"}
    """Whole folders of files at once; and the end of the command line, when nothing else runs."""
    found = {
        str(path.relative_to(package)): word
        for path in package.rglob("*.py")
        for word in ("os.replace(", "os.umask(", "os.dup2(")
        if word in path.read_text(encoding="utf-8")
    }
    assert set(found) <= kept, found
