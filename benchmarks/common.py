"""What the benchmarks share: where the data is, what machine this is, how results are written."""

from __future__ import annotations

import argparse
import datetime
import json
import math
import os
import platform
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("SASHIMONO_SHARED", REPOSITORY.parent / "shared")).resolve()
"""Folder with ``truth/`` and ``assemblies/``; they are not part of the repository."""

FURNITURE = ("clvr_", "ikea_", "furniturebench_")
PAIRS = ("automate_", "factory_")
PUZZLES = ("burr_",)


def kind_of(name: str, parts: int) -> str:
    """Return the kind under which an assembly is reported."""
    if name.startswith(PUZZLES):
        return "puzzles"
    if name.startswith(FURNITURE):
        return "furniture"
    return "pairs" if parts < 3 or name.startswith(PAIRS) else "mechanical"


def parser(description: str | None, result: str) -> argparse.ArgumentParser:
    """Return an argument parser with the options that all benchmarks have."""
    out = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    out.add_argument("names", nargs="*", help="only these assemblies (shell patterns); all by default")
    out.add_argument("--json", type=Path, default=REPOSITORY / "benchmarks" / "results" / result, help="result file")
    return out


def chosen(folder: Path, patterns: Sequence[str]) -> list[Path]:
    """Return the assembly folders that match any of the patterns; leaves with a clear line if there are none."""
    if not folder.is_dir():
        raise SystemExit(f"{folder} is absent; set SASHIMONO_SHARED to the folder that holds {folder.name}/")
    found = sorted({path for pattern in patterns or ["*"] for path in folder.glob(pattern) if path.is_dir()})
    if not found:
        raise SystemExit(f"nothing in {folder} matches {' '.join(patterns)}")
    return found


def machine() -> dict[str, object]:
    """Return hardware, date and commit, to be written beside every figure."""
    model = next(
        (line.split(":", 1)[1].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")),
        platform.processor() or platform.machine(),
    )
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=REPOSITORY, capture_output=True, text=True, check=False
    ).stdout.strip()
    return {
        "processor": model,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "date": datetime.date.today().isoformat(),
        "commit": commit,
    }


class Ran(NamedTuple):
    """One run of the command line."""

    exit: int | None
    """None if it was stopped because it took too long."""
    cpu_s: float
    wall_s: float
    peak_mb: int
    errors: list[str]
    """Lines on standard error."""

    @property
    def figures(self) -> dict[str, object]:
        """Return what goes into a row of results."""
        return {
            "exit": self.exit,
            "cpu_s": round(self.cpu_s, 2),
            "wall_s": round(self.wall_s, 2),
            "peak_mb": self.peak_mb,
        }


def run_sashimono(arguments: Sequence[str], *, limit: float = math.inf, **environment: str) -> Ran:
    """Run the command line in a process of its own, at most so many seconds of wall time."""
    values = os.environ | {"COLUMNS": "200"} | environment
    # as where it is installed: modules are compiled once, not by every process
    values.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-m", "sashimono", *arguments]
    with tempfile.TemporaryFile("w+") as said:
        start = time.perf_counter()
        process = subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=said, env=values, cwd=tempfile.gettempdir()
        )
        stop = threading.Timer(limit, process.kill) if math.isfinite(limit) else None
        if stop is not None:
            stop.start()
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.perf_counter() - start
        if stop is not None:
            stop.cancel()
        process.returncode = os.waitstatus_to_exitcode(status)
        said.seek(0)
        return Ran(
            exit=None if wall >= limit else process.returncode,
            cpu_s=usage.ru_utime + usage.ru_stime,
            wall_s=wall,
            peak_mb=round(usage.ru_maxrss / 1024),
            errors=said.read().strip().splitlines(),
        )


def write_json(path: Path, content: dict[str, object]) -> None:
    """Write a result file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(path.suffix + ".part")
    temporary.write_text(json.dumps(content, indent=1) + "\n")
    temporary.replace(path)


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def _lines(path: str) -> list[str]:
    try:
        return Path(path).read_text().splitlines()
    except OSError:
        return []
