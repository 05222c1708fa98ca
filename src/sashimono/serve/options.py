"""Options of a job: what a request may ask for, and the command line that it becomes."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sashimono.cli_common import GRIPPERS, UNITS
from sashimono.errors import InputError
from sashimono.io.constraints_file import read_wishes

CONSTRAINTS = "constraints.toml"
"""The user's wishes, in the job's folder."""

_LONGEST = 100_000
_CHOICES = {
    "unit": UNITS,
    "split": ("auto", "all", "none"),
    "gripper": ("fingertips", "auto", *GRIPPERS),
    "grippers": ("none", "all"),
}
_NUMBERS = {"seed": (0, 2**31 - 1), "hands": (1, 100)}


def checked(options: Any) -> dict[str, Any]:
    """Return a request's options if all of them can be used; InputError, one line, if not.

    ``unit``, ``split``, ``gripper``, ``grippers``, ``seed``, ``hands`` are those of ``sashimono plan``; ``constraints``
    is the text of its TOML file.
    """
    if not isinstance(options, Mapping):
        raise InputError("options: should be a JSON object. Leave them out, or send one.")
    for key, value in options.items():
        if key in _CHOICES:
            if value not in _CHOICES[key]:
                raise InputError(f"{key}: {str(value)[:40]!r} is none of {', '.join(_CHOICES[key])}.")
        elif key in _NUMBERS:
            low, high = _NUMBERS[key]
            if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
                raise InputError(f"{key}: {str(value)[:40]!r} is no whole number from {low} to {high}.")
        elif key == "constraints":
            _check_constraints(value)
        else:
            known = ", ".join((*_CHOICES, *_NUMBERS, "constraints"))
            raise InputError(f"{str(key)[:40]!r} is no option. Options are {known}.")
    return dict(options)


def _check_constraints(text: Any) -> None:
    if not isinstance(text, str) or len(text) > _LONGEST:
        raise InputError("constraints: should be the text of a TOML file. See the docs of 'sashimono plan'.")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / CONSTRAINTS
        path.write_text(text, encoding="utf-8")
        try:
            read_wishes(path)
        except InputError as error:
            raise InputError(str(error).replace(str(path), "constraints")) from error


def arguments(options: Mapping[str, Any], folder: Path) -> list[str]:
    """Return the options as arguments of ``sashimono plan``; constraints are written into the job's folder."""
    out = []
    for key, value in options.items():
        if key == "constraints":
            path = folder / CONSTRAINTS
            path.write_text(value, encoding="utf-8")
            out += ["--constraints", str(path)]
        else:
            out += [f"--{key}", str(value)]
    return out
