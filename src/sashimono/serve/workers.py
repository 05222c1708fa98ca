"""Threads that take jobs and run each in a process of its own, within its time and memory."""

from __future__ import annotations

import contextlib
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sashimono.errors import SashimonoError
from sashimono.serve.jobs import Job, JobStore, State, verdict_of
from sashimono.serve.limits import Limits
from sashimono.serve.options import arguments
from sashimono.serve.upload import ARCHIVE, unpack

logger = logging.getLogger(__name__)

_COMPLETE, _NO_PLAN = 0, 3
_EVERY = 0.2
"""Least time between two notes of progress [s]."""


class Workers:
    """Runs the jobs of a store until it is stopped."""

    def __init__(self, store: JobStore, limits: Limits) -> None:
        self._store, self._limits = store, limits
        self._wake, self._stopped = threading.Condition(), False
        self._running: dict[str, subprocess.Popen[str]] = {}
        self._threads = [threading.Thread(target=self._work, daemon=True) for _ in range(limits.jobs)]

    def start(self) -> None:
        """Begin to work."""
        for thread in self._threads:
            thread.start()

    def wake(self) -> None:
        """Tell that there is a new job."""
        with self._wake:
            self._wake.notify_all()

    def stop(self) -> None:
        """Stop. What runs is stopped too, and waits again in a store that is opened anew."""
        with self._wake:
            self._stopped = True
            self._wake.notify_all()
            for process in self._running.values():
                _kill(process)
        for thread in self._threads:
            thread.join(timeout=10.0)

    def cancel(self, job: str) -> None:
        """Stop the process of a job that was cancelled."""
        with self._wake:
            process = self._running.get(job)
        if process is not None:
            _kill(process)

    def _work(self) -> None:
        while True:
            with self._wake:
                if self._stopped:
                    return
            job = self._store.take()
            if job is None:
                with self._wake:
                    if not self._stopped:
                        self._wake.wait(timeout=5.0)
                continue
            try:
                state, message = self._run(job)
            except SashimonoError as error:  # an archive that is refused
                state, message = "failed", str(error)
            except Exception as error:  # a fault of ours is told with the job, and the server goes on
                logger.exception("job %s", job.id)
                state, message = "failed", f"{type(error).__name__}: {error}"
            with self._wake:
                if self._stopped:
                    return  # it is begun anew by the next server
            self._store.finish(job.id, state, message)

    def _run(self, job: Job) -> tuple[State, str]:
        folder, out = self._store.folder_of(job.id), self._store.output_of(job.id)
        scratch = folder / "scratch"
        shutil.rmtree(scratch, ignore_errors=True)
        source = folder / job.name
        if source.suffix == ARCHIVE:
            parts = folder / "parts"
            shutil.rmtree(parts, ignore_errors=True)
            source = unpack(folder / job.name, parts, self._limits)
        wanted = arguments(job.options, folder)
        end = time.monotonic() + self._limits.seconds
        status, said = self._call(job, ["plan", str(source), "--out", str(scratch), *wanted], end)
        if status not in (_COMPLETE, _NO_PLAN) or not (scratch / "plan.json").is_file():
            shutil.rmtree(scratch, ignore_errors=True)
            return "failed", said.replace(f"{folder}{os.sep}", "") or f"the planner stopped with status {status}"
        # a plan without its instructions is a plan too
        plan = ["manual", str(scratch / "plan.json"), "--input", str(source), "--out", str(scratch), "--no-pdf"]
        instructed, _ = self._call(job, plan, end)
        if instructed != _COMPLETE:
            logger.warning("job %s: no work instructions (status %s)", job.id, instructed)
        scratch.rename(out)
        return verdict_of(out)

    def _call(self, job: Job, command: list[str], end: float) -> tuple[int, str]:
        """Run the command line, until a moment of the clock at most; return its status and its last complaint."""
        start = [sys.executable, "-m", "sashimono.serve_child", str(os.getpid()), str(self._limits.memory)]
        process = subprocess.Popen(
            [*start, *command, "--json-lines"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        )
        with self._wake:
            self._running[job.id] = process
            if self._stopped:
                _kill(process)
        found = self._store.find(job.id)
        if found is None or found.state != "running":  # cancelled before there was a process to stop
            _kill(process)
        late = threading.Event()
        timer = threading.Timer(max(0.0, end - time.monotonic()), lambda: (late.set(), _kill(process)))
        timer.start()
        try:
            said = self._listen(job, process)
            status = process.wait()
        finally:
            timer.cancel()
            _kill(process)
            with self._wake:
                self._running.pop(job.id, None)
        if late.is_set():
            said = f"took longer than {self._limits.seconds:.0f} s. Plan it on the command line, or leave parts out."
        return status, said

    def _listen(self, job: Job, process: subprocess.Popen[str]) -> str:
        """Note progress as the process tells it; return its last complaint."""
        said, last = "", 0.0
        assert process.stdout is not None, "it is a pipe"
        with process.stdout:
            for line in process.stdout:
                event = _event(line)
                if event.get("event") == "error":
                    said = str(event.get("text", ""))
                if event.get("event") == "progress" and time.monotonic() - last > _EVERY:
                    last = time.monotonic()
                    done, total = int(event.get("done", 0)), int(event.get("total", 0))
                    self._store.progress(job.id, str(event.get("stage", "")), done, total)
        return said


def _event(line: str) -> Mapping[str, Any]:
    with contextlib.suppress(ValueError):
        value = json.loads(line)
        if isinstance(value, dict):
            return value
    return {}


def _kill(process: subprocess.Popen[str]) -> None:
    """Kill a process and what it started."""
    if process.poll() is not None:
        return
    if sys.platform == "win32":
        process.kill()
    else:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def result_names(out: Path) -> list[str]:
    """Return the files of a finished job that can be fetched, by their paths within its folder."""
    if not out.is_dir():
        return []
    return sorted(path.relative_to(out).as_posix() for path in out.rglob("*") if path.is_file())
