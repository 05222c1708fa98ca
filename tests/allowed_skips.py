"""The only skips that continuous integration accepts, each with its reason; `conftest.py` fails the run for others."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

STRICT = "SASHIMONO_STRICT_SKIPS"
"""Environment variable: set to 1, a skip that is not on the list fails the run. ``.ci/run`` sets it."""

SHARED = Path(os.environ.get("SASHIMONO_SHARED", Path(__file__).resolve().parents[2] / "shared"))
"""Where real CAD and the large truth set lie, if anywhere."""


@dataclass(frozen=True, kw_only=True)
class AllowedSkip:
    """A group of tests that may skip."""

    says: str
    """What the reason of the skip contains."""
    why: str
    """Why that is no defect."""
    holds: bool = True
    """Whether the cause is present on this machine: where it is not, the skip is a defect."""


ALLOWED = (
    AllowedSkip(
        says="set SASHIMONO_SHARED to the folder",
        why="real CAD of other people may not be copied into the repository; tests/truth stands in for it",
        holds=not (SHARED / "truth").is_dir(),
    ),
    AllowedSkip(
        says="no Chromium installed",
        why="a browser is no Python package; .ci/run installs it where it may",
        holds=shutil.which("chromium") is None,
    ),
    AllowedSkip(
        says="the simulator is no dependency",
        why="MuJoCo reads what is exported; the files are also checked without it",
    ),
    AllowedSkip(
        says="the extra 'distributed' is not installed",
        why="Ray is large, and the README's test line leaves it out; the local workers run the same code",
    ),
)


def is_allowed(reason: str) -> bool:
    """Return whether a skip with this reason is on the list, and its cause is present."""
    return any(entry.holds and entry.says in reason for entry in ALLOWED)
