"""The web application: a page, jobs as JSON, and what they made."""

from __future__ import annotations

import json
import mimetypes
import uuid
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from sashimono.errors import InputError, SashimonoError
from sashimono.serve.jobs import Job, JobStore
from sashimono.serve.limits import MEGABYTE, Limits
from sashimono.serve.options import CONSTRAINTS, checked
from sashimono.serve.upload import TooLargeError, receive, safe_name
from sashimono.serve.workers import Workers, result_names

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response

OWN_PAGE = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'"
"""What the page itself may load."""
RESULT = (
    "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; img-src data: blob:;"
    " font-src data:; connect-src data: blob:; worker-src blob:; sandbox allow-scripts allow-downloads"
)
"""What a page that was made from somebody's file may do: draw, and reach nothing of this server."""


def require_starlette() -> None:
    """Raise SashimonoError, which names the extra, if the web framework is missing."""
    try:
        import starlette  # noqa: F401
        import uvicorn  # noqa: F401
    except ImportError:
        raise SashimonoError(
            "serving needs a web framework; install the extra: pip install 'sashimono[serve]'"
        ) from None


def make_web(store: JobStore, limits: Limits, *, hosts: Sequence[str]) -> Starlette:
    """Return the web application over a store, with its workers.

    Args:
        store: Where jobs are kept.
        limits: What it takes on.
        hosts: Names under which it may be called, so that no other page can reach it through a name of its own.
    """
    require_starlette()
    from starlette.applications import Starlette
    from starlette.middleware import Middleware
    from starlette.middleware.trustedhost import TrustedHostMiddleware
    from starlette.routing import Route

    workers = Workers(store, limits)
    site = _Site(store, workers, limits)

    @asynccontextmanager
    async def life(_: Starlette) -> AsyncIterator[None]:
        store.recover()
        workers.start()
        yield
        workers.stop()

    routes = [
        Route("/", site.page),
        Route("/static/{name}", site.static),
        Route("/api/jobs", site.jobs, methods=["GET"]),
        Route("/api/jobs", site.accept, methods=["POST"]),
        Route("/api/jobs/{job}", site.job, methods=["GET"]),
        Route("/api/jobs/{job}", site.remove, methods=["DELETE"]),
        Route("/api/jobs/{job}/again", site.again, methods=["POST"]),
        Route("/api/jobs/{job}/constraints", site.constraints, methods=["GET"]),
        Route("/jobs/{job}/{name:path}", site.result, methods=["GET"]),
    ]
    allowed = [Middleware(TrustedHostMiddleware, allowed_hosts=list(hosts), www_redirect=False)]
    handlers: dict[Any, Callable[..., Any]] = {InputError: _refuse, SashimonoError: _refuse}
    return Starlette(routes=routes, middleware=allowed, lifespan=life, exception_handlers=handlers)


def _refuse(_: Request, error: Exception) -> Response:
    from starlette.responses import JSONResponse

    return JSONResponse({"error": str(error)}, status_code=413 if isinstance(error, TooLargeError) else 400)


class _Site:
    def __init__(self, store: JobStore, workers: Workers, limits: Limits) -> None:
        self._store, self._workers, self._limits = store, workers, limits
        self._names: dict[str, list[str]] = {}
        """Files of jobs that have some. They come all at once, and stay as they are."""

    async def page(self, _: Request) -> Response:
        return _own("page.html")

    async def static(self, request: Request) -> Response:
        name = request.path_params["name"]
        return _own(name) if name in ("page.css", "page.js") else _missing()

    async def jobs(self, _: Request) -> Response:
        return self._answer([self._shown(job) for job in self._store.newest()])

    async def job(self, request: Request) -> Response:
        found = self._store.find(request.path_params["job"])
        return _missing() if found is None else self._answer(self._shown(found))

    async def accept(self, request: Request) -> Response:
        """Take the file that is the body of the request; its name and the options are in the query."""
        _refuse_foreign(request)
        name = safe_name(request.query_params.get("name", ""))
        options = checked(_parsed(request.query_params.get("options", "{}")))
        self._refuse_too_many()
        if int(request.headers.get("content-length", "0") or 0) > self._limits.upload:
            raise TooLargeError(f"{name}: larger than {self._limits.upload // MEGABYTE} MB. Send a smaller file.")
        job = uuid.uuid4().hex
        folder = self._store.new_folder(job)
        try:
            await receive(request.stream(), folder / name, self._limits)
        except BaseException:
            self._store.drop_folder(job)
            raise
        return self._added(self._store.add(job, name, options))

    async def again(self, request: Request) -> Response:
        """Plan a job's file again with other options."""
        _refuse_foreign(request)
        found = self._store.find(request.path_params["job"])
        if found is None:
            return _missing()
        options = checked(_parsed((await request.body())[:1_000_000].decode("utf-8", "replace")))
        self._refuse_too_many()
        job = uuid.uuid4().hex
        (self._store.new_folder(job) / found.name).hardlink_to(self._store.folder_of(found.id) / found.name)
        return self._added(self._store.add(job, found.name, options))

    async def remove(self, request: Request) -> Response:
        """Cancel a job that waits or runs; remove one that has ended."""
        _refuse_foreign(request)
        found = self._store.find(request.path_params["job"])
        if found is None:
            return _missing()
        if self._store.cancel(found.id):
            self._workers.cancel(found.id)
        else:
            self._store.remove(found.id)
            self._names.pop(found.id, None)
        return self._answer({"id": found.id})

    async def constraints(self, request: Request) -> Response:
        """Return the constraints with which a job was planned, as text to edit."""
        from starlette.responses import PlainTextResponse

        found = self._store.find(request.path_params["job"])
        if found is None:
            return _missing()
        written = self._store.output_of(found.id) / CONSTRAINTS
        text = written.read_text(encoding="utf-8") if written.is_file() else found.options.get("constraints", "")
        return PlainTextResponse(text)

    async def result(self, request: Request) -> Response:
        """Return a file that a job made: one of those that it lists, so that no path leads elsewhere."""
        from starlette.responses import FileResponse

        found = self._store.find(request.path_params["job"])
        name = request.path_params["name"]
        if found is None or name not in self._files_of(found.id):
            return _missing()
        path = self._store.output_of(found.id) / name
        kind = {".glb": "model/gltf-binary"}.get(path.suffix) or mimetypes.guess_type(path.name)[0]
        headers = {"Content-Security-Policy": RESULT, "X-Content-Type-Options": "nosniff"}
        return FileResponse(path, media_type=kind or "application/octet-stream", headers=headers)

    def _added(self, job: Job) -> Response:
        self._workers.wake()
        return self._answer(self._shown(job), status=201)

    def _refuse_too_many(self) -> None:
        if self._store.waiting() >= self._limits.waiting:
            raise InputError(f"{self._limits.waiting} jobs wait already. Try again later.")

    def _shown(self, job: Job) -> dict[str, Any]:
        return {**job.as_dict(), "files": self._files_of(job.id)}

    def _files_of(self, job: str) -> list[str]:
        """Return the files that a job made, looked up once: the page asks for all jobs every second."""
        if job not in self._names:
            found = result_names(self._store.output_of(job))
            if not found:
                return []
            self._names[job] = found
        return self._names[job]

    def _answer(self, value: Any, status: int = 200) -> Response:
        from starlette.responses import JSONResponse

        return JSONResponse(value, status_code=status, headers={"Cache-Control": "no-store"})


def _own(name: str) -> Response:
    from starlette.responses import Response

    content = (files("sashimono.serve") / "static" / name).read_bytes()
    headers = {
        "Content-Security-Policy": OWN_PAGE,
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
    }
    kind = {".html": "text/html", ".css": "text/css", ".js": "text/javascript"}[Path(name).suffix]
    return Response(content, media_type=kind, headers=headers)


def _missing() -> Response:
    from starlette.responses import JSONResponse

    return JSONResponse({"error": "there is no such thing here"}, status_code=404)


def _refuse_foreign(request: Request) -> None:
    """Refuse what another site's page sends in the user's name."""
    origin = request.headers.get("origin")
    if origin is not None and urlsplit(origin).netloc != request.headers.get("host"):
        raise InputError("this request comes from another site's page. Open the page of this server.")


def _parsed(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError as error:
        raise InputError(f"options: not readable JSON ({error}). Send an object.") from error
