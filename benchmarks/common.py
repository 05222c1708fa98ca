"""What the benchmarks share: where the data is, what machine this is, how results are written."""

from __future__ import annotations

import argparse
import datetime
import json
import os
import platform
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
SHARED = Path(os.environ.get("SASHIMONO_SHARED", REPOSITORY.parent / "shared"))
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
