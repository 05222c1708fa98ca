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
SHARED = Path(os.environ.get("SASHIMONO_SHARED", REPOSITORY.parent / "shared"))


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
