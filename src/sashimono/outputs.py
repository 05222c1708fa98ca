"""Files that are written whole or not at all, and places refused before any work."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from sashimono.errors import SashimonoError


def write_json(path: Path, value: object) -> None:
    """Write a value as indented JSON, whole or not at all; SashimonoError if the file cannot be written."""
    with replacing_together(path.parent) as folder:
        (folder / path.name).write_text(json.dumps(value, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def refuse_bad_files(targets: Mapping[str, Path | None]) -> None:
    """Raise SashimonoError before any work if one of the files to be written, by option, cannot be."""
    for option, path in targets.items():
        if path is None:
            continue
        if _is_folder(path):
            raise SashimonoError(f"{option} {path} is a folder. Name a file.")
        refuse_unwritable(path.parent, option=option)


@contextmanager
def replacing_together(out: Path) -> Iterator[Path]:
    """Yield a temporary folder within ``out``; move its files into ``out`` at the end, unless an error cut in."""
    made = not out.exists()
    try:
        out.mkdir(parents=True, exist_ok=True)
        try:
            with tempfile.TemporaryDirectory(dir=out, prefix=".sashimono-") as temporary:
                yield Path(temporary)
                finished = sorted(Path(temporary).iterdir())
                for file in finished:
                    if (out / file.name).is_dir():
                        raise SashimonoError(f"cannot write {out / file.name}: it is a folder. Choose another --out.")
                for file in finished:
                    os.replace(file, out / file.name)
        except BaseException:
            if made:
                with suppress(OSError):  # not empty: some file had been moved already
                    out.rmdir()
            raise
    except OSError as error:
        _fail_to_write(error)


def _fail_to_write(error: OSError) -> NoReturn:
    where = error.filename or "the result"
    raise SashimonoError(f"cannot write {where}: {error.strerror}. Choose another folder.") from error


def refuse_unwritable(out: Path, option: str = "--out", *, files: Sequence[str] = ()) -> None:
    """Raise SashimonoError before any work if the folder, or one of these files in it, cannot be made or written."""
    for name in files:
        if _is_folder(out / name):
            raise SashimonoError(f"{option} {out}: {out / name} is a folder. Choose another {option}.")
    try:
        if out.exists() and not out.is_dir():
            raise SashimonoError(f"{option} {out} is a file. Name a folder.")
        existing = next(parent for parent in (out.absolute(), *out.absolute().parents) if parent.exists())
        with tempfile.TemporaryFile(dir=existing):  # the rights alone do not tell: a disk may be full or read-only
            pass
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise SashimonoError(f"{option} {out}: cannot be written to ({reason}). Choose another folder.") from error


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):  # a name that no file can have: `refuse_unwritable` says so
        return False
