"""What a long run has done so far: a line an item, written at once, so that it goes on where it was killed."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from sashimono.errors import InputError


class Journal:
    """A file of JSON lines, the first of which says what run it belongs to."""

    def __init__(self, path: Path, run: Mapping[str, Any]) -> None:
        """Open the journal of a run, new or begun.

        Raises InputError if the file belongs to another run, or another process has it open.
        """
        self._path = path
        self.done: dict[str, dict[str, Any]] = {}
        """Results so far, by key."""
        self._file = path.open("a", encoding="utf-8")
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            self._file.close()
            raise InputError(
                f"{path.parent}: another run is at work here; wait for it, or name another folder"
            ) from error
        try:
            self._read(json.dumps({"run": run}, sort_keys=True))
        except BaseException:
            self._file.close()
            raise

    def _read(self, head: str) -> None:
        content = self._path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):  # killed in the middle of a line
            os.truncate(self._path, whole)
        lines = content[:whole].decode("utf-8").splitlines()
        if not lines:
            self._file.write(head + "\n")
            self._file.flush()
            return
        if lines[0] != head:
            raise InputError(
                f"{self._path.parent}: holds the beginning of another run ({self._path.name});"
                f" name another folder, or remove {self._path.name} to begin anew"
            )
        for line in lines[1:]:
            entry = json.loads(line)
            self.done[entry["key"]] = entry

    def add(self, key: str, entry: Mapping[str, Any]) -> None:
        """Write one result."""
        line = {"key": key, **entry}
        self.done[key] = line
        self._file.write(json.dumps(line, sort_keys=True) + "\n")
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def remove(self) -> None:
        """Remove and close the file: the run is finished."""
        self._path.unlink()
        self.close()
