"""How much the command line says, and in which form: lines, nothing, or one JSON value a line."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Reporting:
    """What the user wants to hear."""

    verbose: int = 0
    """1: what is done; 2: everything."""
    quiet: bool = False
    """Nothing but errors: the exit status and the files tell the rest."""
    json_lines: bool = False
    """Standard output holds one JSON value a line, progress included, and nothing else."""


_wanted: ContextVar[Reporting | None] = ContextVar("reporting", default=None)


def reporting() -> Reporting:
    """Return what the command that runs was asked for."""
    return _wanted.get() or Reporting()


@contextmanager
def fresh_reporting() -> Iterator[None]:
    """Forget at the end of the block what was asked for within it."""
    token = _wanted.set(Reporting())
    try:
        yield
    finally:
        _wanted.reset(token)


def set_reporting(wanted: Reporting) -> None:
    """Hold to this until the end of the `fresh_reporting` block."""
    _wanted.set(wanted)


def say(line: str) -> None:
    """Print a line of the answer to standard output."""
    if reporting().json_lines:
        event("text", text=line)
    elif not reporting().quiet:
        sys.stdout.write(line + "\n")


def note(line: str) -> None:
    """Print a remark to standard error; with ``--json-lines`` to standard output."""
    if reporting().json_lines:
        event("note", text=line)
    elif not reporting().quiet:
        sys.stderr.write(f"note: {line}\n")


def event(kind: str, **fields: object) -> None:
    """Print one JSON object with ``event`` and these fields, if the user wants JSON lines; else nothing."""
    if reporting().json_lines:
        sys.stdout.write(json.dumps({"event": kind, **fields}, ensure_ascii=False) + "\n")
        sys.stdout.flush()
