"""Writing whole files: readers see the old file or the new one, never half of it."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_write(path: str | Path) -> Iterator[Path]:
    """Yield a new, empty file beside ``path``; at the end of the block it takes the place of ``path``.

    The block fills the file that it is given. An error in the block removes that file and leaves ``path`` as it was.
    The file has the permissions of any new file. Raises OSError if the folder is absent or not writable.
    """
    path = Path(path)
    scratch = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    # the kernel subtracts the umask: to ask for it would mean to change it, for all threads
    os.close(os.open(scratch, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        yield scratch
        os.replace(scratch, path)
    except BaseException:
        scratch.unlink(missing_ok=True)
        raise
