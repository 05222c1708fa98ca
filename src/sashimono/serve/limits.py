"""What one server takes on. Everything that comes from outside is held to these."""

from __future__ import annotations

from dataclasses import dataclass

MEGABYTE = 1_000_000


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limits of a server."""

    upload: int = 200 * MEGABYTE
    """Largest file that is taken [bytes]."""
    unpacked: int = 1_000 * MEGABYTE
    """Most that the files of an archive may come to [bytes]."""
    files: int = 5_000
    """Most files in an archive."""
    seconds: float = 900.0
    """Longest that one job may run."""
    memory: int = 8_000 * MEGABYTE
    """Address space of a job's process [bytes]."""
    waiting: int = 200
    """Most jobs that wait."""
    jobs: int = 1
    """Jobs that run at once."""
