"""The jobs of a server in an embedded database: what was accepted is not lost, and no job is run by two."""

from __future__ import annotations

import json
import shutil
import sqlite3
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

State = Literal["waiting", "running", "complete", "partial", "failed", "cancelled"]

_TABLE = """
CREATE TABLE IF NOT EXISTS jobs (
    id TEXT PRIMARY KEY, name TEXT NOT NULL, state TEXT NOT NULL, created REAL NOT NULL, started REAL, finished REAL,
    runs INTEGER NOT NULL DEFAULT 0, options TEXT NOT NULL, stage TEXT NOT NULL DEFAULT '',
    done INTEGER NOT NULL DEFAULT 0, total INTEGER NOT NULL DEFAULT 0, message TEXT NOT NULL DEFAULT ''
)
"""


@dataclass(frozen=True, kw_only=True)
class Job:
    """One file to plan."""

    id: str
    name: str
    """The file's name, as it lies in the job's folder."""
    state: State
    created: float
    """Seconds since 1970, as are the next two."""
    started: float | None
    finished: float | None
    runs: int
    """How often it was begun: more than once only if the server was killed in between."""
    options: Mapping[str, Any]
    """As `sashimono.serve.options` understands them."""
    stage: str
    done: int
    total: int
    message: str
    """What went wrong, or what the plan's verdict is."""

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return dict(vars(self))


class JobStore:
    """Jobs and their folders. Safe to use from several threads."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._incoming, self._jobs = folder / "incoming", folder / "jobs"
        for each in (folder, self._incoming, self._jobs):
            each.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        self._database = sqlite3.connect(
            folder / "jobs.sqlite", check_same_thread=False, isolation_level=None, timeout=1.0
        )
        self._database.row_factory = sqlite3.Row
        with self._lock:
            # one server a folder: a second one is told that the database is locked
            self._database.execute("PRAGMA locking_mode=EXCLUSIVE")
            self._database.execute("PRAGMA journal_mode=WAL")
            self._database.execute("PRAGMA synchronous=FULL")
            self._database.execute(_TABLE)

    def close(self) -> None:
        """Close the database."""
        with self._lock:
            self._database.close()

    def folder_of(self, job: str) -> Path:
        """Return the folder of a job."""
        return self._jobs / job

    def output_of(self, job: str) -> Path:
        """Return the folder of what a job made; it is there once all of it is."""
        return self.folder_of(job) / "out"

    def new_folder(self, job: str) -> Path:
        """Return a new folder for what comes in of a job."""
        path = self._incoming / job
        path.mkdir()
        return path

    def drop_folder(self, job: str) -> None:
        """Remove what came in of a job that is not accepted."""
        shutil.rmtree(self._incoming / job, ignore_errors=True)

    def add(self, job: str, name: str, options: Mapping[str, Any]) -> Job:
        """Accept a job, whose files lie in its new folder; from here on it is not lost."""
        (self._incoming / job).rename(self.folder_of(job))
        self._run(
            "INSERT INTO jobs (id, name, state, created, options) VALUES (?, ?, 'waiting', ?, ?)",
            (job, name, time.time(), json.dumps(dict(options))),
        )
        found = self.find(job)
        assert found is not None, "it was just added"
        return found

    def find(self, job: str) -> Job | None:
        """Return a job by its id, or None."""
        rows = self._run("SELECT * FROM jobs WHERE id = ?", (job,))
        return _job(rows[0]) if rows else None

    def newest(self, most: int = 100) -> list[Job]:
        """Return the newest jobs, newest first."""
        return [_job(row) for row in self._run("SELECT * FROM jobs ORDER BY created DESC LIMIT ?", (most,))]

    def waiting(self) -> int:
        """Return how many jobs wait."""
        return int(self._run("SELECT COUNT(*) AS n FROM jobs WHERE state = 'waiting'")[0]["n"])

    def take(self) -> Job | None:
        """Return the job that has waited longest and mark it as running, in one step; None if none waits."""
        rows = self._run(
            "UPDATE jobs SET state = 'running', started = ?, runs = runs + 1, stage = '', done = 0, total = 0 WHERE id"
            " = (SELECT id FROM jobs WHERE state = 'waiting' ORDER BY created, id LIMIT 1) RETURNING *",
            (time.time(),),
        )
        return _job(rows[0]) if rows else None

    def progress(self, job: str, stage: str, done: int, total: int) -> None:
        """Note how far a running job is."""
        self._run(
            "UPDATE jobs SET stage = ?, done = ?, total = ? WHERE id = ? AND state = 'running'",
            (stage, done, total, job),
        )

    def finish(self, job: str, state: State, message: str) -> bool:
        """Note how a running job ended; return whether it was still running, and not cancelled."""
        sql = "UPDATE jobs SET state = ?, finished = ?, message = ? WHERE id = ? AND state = 'running' RETURNING id"
        return bool(self._run(sql, (state, time.time(), message, job)))

    def cancel(self, job: str) -> bool:
        """Cancel a job that waits or runs; return whether it did."""
        sql = (
            "UPDATE jobs SET state = 'cancelled', finished = ?, message = 'cancelled'"
            " WHERE id = ? AND state IN ('waiting', 'running') RETURNING id"
        )
        return bool(self._run(sql, (time.time(), job)))

    def remove(self, job: str) -> None:
        """Forget a job and remove its files."""
        self._run("DELETE FROM jobs WHERE id = ?", (job,))
        shutil.rmtree(self.folder_of(job), ignore_errors=True)

    def recover(self) -> int:
        """Put in order what a kill left behind; return how many jobs are begun anew.

        A job that had all its results is finished; one that was running waits again; files of no job are removed.
        """
        again = 0
        for row in self._run("SELECT * FROM jobs WHERE state = 'running'"):
            if (self.output_of(row["id"]) / "plan.json").is_file():
                self.finish(row["id"], *verdict_of(self.output_of(row["id"])))
                continue
            self._run("UPDATE jobs SET state = 'waiting' WHERE id = ?", (row["id"],))
            again += 1
        known = {row["id"] for row in self._run("SELECT id FROM jobs")}
        for folder in (*self._incoming.iterdir(), *(path for path in self._jobs.iterdir() if path.name not in known)):
            shutil.rmtree(folder, ignore_errors=True)
        return again

    def _run(self, sql: str, values: tuple[Any, ...] = ()) -> list[sqlite3.Row]:
        with self._lock:
            return self._database.execute(sql, values).fetchall()


def verdict_of(out: Path) -> tuple[State, str]:
    """Return the state and the verdict of a finished job from its plan."""
    from sashimono.io.plan_json import read_plan

    plan = read_plan(out / "plan.json")
    return ("complete" if plan.status == "complete" else "partial"), plan.verdict


def _job(row: sqlite3.Row) -> Job:
    values = dict(row)
    values["options"] = json.loads(values["options"])
    return Job(**values)
