"""What every test shares: shape checks, reproducible random tests, the optional test data."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis
import numba
import pytest
from allowed_skips import SHARED, STRICT, is_allowed
from jaxtyping import install_import_hook

# Array shapes are checked while testing, not in production; must come before the first import of the package.
install_import_hook("sashimono", "typecheck.check")

_njit = numba.njit


def _njit_unwrapped(*args: Any, **options: Any) -> Any:
    """Compile the function itself: the hook's checks around it are Python, which numba cannot compile."""
    if args and callable(args[0]):
        return _njit(inspect.unwrap(args[0]), *args[1:], **options)
    decorate: Callable[[Callable[..., Any]], Any] = _njit(*args, **options)
    return lambda function: decorate(inspect.unwrap(function))


numba.njit = _njit_unwrapped

hypothesis.settings.register_profile("reproducible", derandomize=True, deadline=None, print_blob=True)
hypothesis.settings.load_profile("reproducible")

REPOSITORY = Path(__file__).resolve().parent.parent


pytest_plugins = ["pytester"]

_refused: list[str] = []


def _note_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    """Keep a skip that is not on the list of those allowed; an expected failure is no skip."""
    if not report.skipped or hasattr(report, "wasxfail"):
        return
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
    if not is_allowed(reason):
        _refused.append(f"{report.nodeid}: {reason}")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _note_skip(report)


def pytest_collectreport(report: pytest.CollectReport) -> None:
    _note_skip(report)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail the run for skips that are not on the list, where that is asked for."""
    if _refused and os.environ.get(STRICT) == "1" and session.exitstatus in (0, 5):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any) -> None:
    if _refused and os.environ.get(STRICT) == "1":
        terminalreporter.section("skips that tests/allowed_skips.py does not list")
        for line in _refused:
            terminalreporter.line(line)


def _shared_folder(name: str) -> Path:
    folder = SHARED / name
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent; set SASHIMONO_SHARED to the folder that holds {name}/")
    return folder


@pytest.fixture(scope="session")
def truth_folder() -> Path:
    """Synthetic assemblies with exact removal conditions, or skip where they are absent."""
    return _shared_folder("truth")


@pytest.fixture(scope="session")
def assemblies_folder() -> Path:
    """Real CAD assemblies from public repositories, or skip where they are absent."""
    return _shared_folder("assemblies")


@pytest.fixture(scope="session")
def gearbox_step() -> Path:
    """The shipped example."""
    return REPOSITORY / "src" / "sashimono" / "examples" / "gearbox.step"
