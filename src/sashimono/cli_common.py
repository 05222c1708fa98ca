"""What all commands of the command line share: options that each takes, values that the shell completes."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any, TypeVar

import typer

from sashimono.reporting import Reporting, reporting, set_reporting

METHODS = ("cascade", "physics", "past")
"""What ``--method`` takes."""

UNITS = ("m", "dm", "cm", "mm", "um", "in", "ft")
"""What ``--unit`` takes."""

GRIPPERS = ("robotiq-hand-e", "robotiq-2f85", "franka-hand")
"""Grippers that have a name. They are written here too, so that help needs no planner; a test compares."""

Verbose = Annotated[int, typer.Option("-v", "--verbose", count=True, help="say more; twice for everything")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="say nothing but errors")]
JsonLines = Annotated[
    bool, typer.Option("--json-lines", help="progress and answers on standard output as JSON, one object a line")
]
SHARED = {"verbose": (Verbose, 0), "quiet": (Quiet, False), "json_lines": (JsonLines, False)}
"""Options that stand before or after every command: type and default."""

_F = TypeVar("_F", bound=Callable[..., int])


def make_app(**options: Any) -> typer.Typer:
    """Return an application or a group of commands, with ``-h``."""
    return typer.Typer(
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        **options,
    )


def command(app: typer.Typer, name: str | None = None) -> Callable[[_F], _F]:
    """Return a decorator that makes a function a command of the application, with the shared options added.

    The function itself comes back as it was.
    """

    def register(function: _F) -> _F:
        own = inspect.signature(function, eval_str=True)
        shared = [
            inspect.Parameter(key, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
            for key, (kind, default) in SHARED.items()
        ]

        @wraps(function)
        def run(**values: Any) -> int:
            listen(**{key: values.pop(key) for key in SHARED})
            return function(**values)

        del run.__wrapped__  # else its signature would be taken
        parameters = [*own.parameters.values(), *shared]
        run.__signature__ = own.replace(parameters=parameters)  # pyright: ignore[reportAttributeAccessIssue]
        run.__annotations__ = {each.name: each.annotation for each in parameters}
        app.command(name)(run)
        return function

    return register


def listen(*, verbose: int, quiet: bool, json_lines: bool) -> None:
    """Hold to how much the user wants to hear, added to what stood before the command."""
    before = reporting()
    wanted = Reporting(
        verbose=before.verbose + verbose, quiet=before.quiet or quiet, json_lines=before.json_lines or json_lines
    )
    set_reporting(wanted)
    logging.basicConfig(format="%(name)s: %(message)s", level=logging.WARNING)
    level = (logging.WARNING, logging.INFO, logging.DEBUG)[min(wanted.verbose, 2)]
    logging.getLogger("sashimono").setLevel(logging.ERROR if wanted.quiet else level)


def choices(*values: str) -> Callable[[str], list[str]]:
    """Return what a shell asks for the values that begin with what was typed."""
    return lambda incomplete: [value for value in values if value.startswith(incomplete)]
