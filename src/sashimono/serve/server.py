"""One server on one folder, until it is interrupted."""

from __future__ import annotations

import socket
import sqlite3
from collections.abc import Sequence
from pathlib import Path

from sashimono.errors import SashimonoError
from sashimono.reporting import event, say
from sashimono.serve.jobs import JobStore
from sashimono.serve.limits import Limits
from sashimono.serve.web import make_web, require_starlette

_ANY = ("0.0.0.0", "::", "")


def run_server(folder: Path, limits: Limits, *, host: str, port: int, names: Sequence[str]) -> int:
    """Serve until interrupted and return the exit status, 0.

    SashimonoError if the folder cannot be used, another server has it, or the port is taken.
    """
    require_starlette()
    import uvicorn

    listening = _listen(host, port)  # first, so that nothing is written where there is no port
    try:
        store = JobStore(folder)
    except (OSError, sqlite3.Error) as error:
        listening.close()
        raise SashimonoError(
            f"{folder}: cannot be used ({error}). Is another server on it? Name another --out."
        ) from error
    try:
        port = listening.getsockname()[1]
        hosts = ["*"] if host in _ANY and not names else ["localhost", "127.0.0.1", "[::1]", host, *names]
        web = make_web(store, limits, hosts=hosts)
        url = f"http://{'localhost' if host in _ANY else f'[{host}]' if ':' in host else host}:{port}/"
        say(f"open in a browser: {url}    (stop: Ctrl-C; jobs are kept in {folder})")
        event("serving", url=url)
        config = uvicorn.Config(web, log_level="warning", access_log=False, timeout_graceful_shutdown=5)
        uvicorn.Server(config).run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    finally:
        store.close()
    return 0


def _listen(host: str, port: int) -> socket.socket:
    try:
        family, *_, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listening = socket.socket(family, socket.SOCK_STREAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(128)  # from here on a call waits, so that the page can be opened as soon as it is named
    except OSError as error:
        raise SashimonoError(f"--host {host} --port {port}: cannot listen there ({error}). Choose another.") from error
    return listening
