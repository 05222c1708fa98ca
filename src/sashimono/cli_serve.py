"""The command line: ``sashimono serve``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from sashimono.cli_common import command, make_app
from sashimono.errors import SashimonoError

serve_app = make_app()


@command(serve_app, "serve")
def serve_command(
    folder: Annotated[
        Path,
        typer.Option(
            "-o", "--out", metavar="DIR", help="folder for jobs and their results; gone on from if it has any"
        ),
    ] = Path("sashimono_jobs"),
    port: Annotated[int, typer.Option(min=0, max=65535, help="port to listen on; 0: any that is free")] = 8000,
    host: Annotated[
        str, typer.Option(metavar="NAME", help="address to listen on; this machine only, if not given")
    ] = "127.0.0.1",
    names: Annotated[
        list[str] | None,
        typer.Option("--name", metavar="HOST", help="a name under which it is called, behind a proxy; repeatable"),
    ] = None,
    jobs: Annotated[int, typer.Option(min=1, metavar="N", help="jobs that run at once")] = max(
        1, (os.cpu_count() or 2) // 2
    ),
    seconds: Annotated[float, typer.Option(min=1.0, metavar="S", help="longest that a job may run")] = 900.0,
    upload: Annotated[int, typer.Option(min=1, metavar="MB", help="largest file that is taken")] = 200,
    memory: Annotated[
        int, typer.Option(min=0, metavar="MB", help="most memory of a job; 0: as much as there is")
    ] = 8000,
) -> int:
    """Serve a page to drop files on: each is planned, and its page, animation and plan can be fetched."""
    from sashimono.serve.limits import MEGABYTE, Limits
    from sashimono.serve.server import run_server

    limits = Limits(jobs=jobs, seconds=seconds, upload=upload * MEGABYTE, memory=memory * MEGABYTE)
    if folder.exists() and not folder.is_dir():
        raise SashimonoError(f"--out {folder} is a file. Name a folder.")
    return run_server(folder, limits, host=host, port=port, names=names or ())
