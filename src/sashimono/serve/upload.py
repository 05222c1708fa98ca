"""What comes from outside becomes files: safe names, no more bytes than allowed, archives that stay in their folder."""

from __future__ import annotations

import os
import re
import stat
import unicodedata
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path, PurePosixPath

from sashimono.errors import InputError
from sashimono.io.formats.meshes import SUFFIXES as MESHES
from sashimono.serve.limits import MEGABYTE, Limits

SCENES = (".step", ".stp", ".glb", ".3mf")
"""Files that hold a whole assembly."""
ARCHIVE = ".zip"

_CHUNK = 1 << 20
_LONGEST = 100


class TooLargeError(InputError):
    """More bytes than the server takes."""


def safe_name(name: str) -> str:
    """Return the name of a file without any folder, of harmless characters only.

    Raises InputError if it is not the name of a file that can be planned.
    """
    base = unicodedata.normalize("NFC", name).replace("\\", "/").rsplit("/", 1)[-1]
    base = re.sub(r"[^\w.\- ()+]", "_", base).strip(" .")
    stem, suffix = os.path.splitext(base)
    suffix = suffix.lower()
    if not stem or suffix not in (*SCENES, ARCHIVE):
        kinds = ", ".join((*SCENES, ARCHIVE))
        raise InputError(
            f"{base or 'no name'}: cannot be planned. Send one of {kinds} (of {', '.join(MESHES)} in place)."
        )
    return stem[: _LONGEST - len(suffix)] + suffix


async def receive(stream: AsyncIterator[bytes], path: Path, limits: Limits) -> int:
    """Write a stream to a file and return its size; TooLargeError, and no file, if it is more than allowed."""
    size = 0
    try:
        with path.open("xb") as out:
            async for chunk in stream:
                size += len(chunk)
                if size > limits.upload:
                    raise TooLargeError(
                        f"{path.name}: larger than {limits.upload // MEGABYTE} MB. Send a smaller file."
                    )
                out.write(chunk)
            out.flush()
            os.fsync(out.fileno())
        if size == 0:
            raise InputError(f"{path.name}: empty. Send the file itself.")
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return size


def unpack(archive: Path, folder: Path, limits: Limits) -> Path:
    """Unpack the assembly in an archive and return what is to be planned: one scene file, or the folder of its meshes.

    Only files that can be part of an assembly are taken, by their own name alone, so nothing can be written anywhere
    else. Raises InputError for an archive that is none, is encrypted, has links or two files of one name, or is too
    large.
    """
    try:
        with zipfile.ZipFile(archive) as opened:
            wanted = _wanted(opened, archive.name, limits)
            folder.mkdir()
            left = limits.unpacked
            for name, entry in wanted.items():
                left -= _copy(opened, entry, folder / name, left, archive.name)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(f"{archive.name}: not a readable archive ({error}). Pack it anew.") from error
    scenes = [name for name in wanted if name.lower().endswith(SCENES)]
    return folder / scenes[0] if scenes else folder


def _wanted(opened: zipfile.ZipFile, archive: str, limits: Limits) -> dict[str, zipfile.ZipInfo]:
    entries = [entry for entry in opened.infolist() if not entry.is_dir()]
    if len(entries) > limits.files:
        raise TooLargeError(f"{archive}: {len(entries)} files, more than {limits.files}. Send fewer.")
    if sum(entry.file_size for entry in entries) > limits.unpacked:
        raise _too_large(archive, limits.unpacked)
    out: dict[str, zipfile.ZipInfo] = {}
    for entry in entries:
        path = PurePosixPath(entry.filename.replace("\\", "/"))
        if path.suffix.lower() not in (*MESHES, *SCENES) or path.name.startswith(".") or "__MACOSX" in path.parts:
            continue
        if entry.flag_bits & 0x1:
            raise InputError(f"{archive}: encrypted. Send it without a password.")
        if stat.S_ISLNK(entry.external_attr >> 16):
            raise InputError(f"{archive}: {path.name} is a link. Pack the file itself.")
        name = re.sub(r"[^\w.\- ()+]", "_", path.name)
        if name in out:
            raise InputError(f"{archive}: two files are called {name}. Give each a name of its own.")
        out[name] = entry
    scenes = [name for name in out if name.lower().endswith(SCENES)]
    if not out or len(scenes) > 1 or (scenes and len(out) > 1):
        raise InputError(
            f"{archive}: should hold the meshes of one assembly ({', '.join(MESHES)}), or one {SCENES[0]}."
        )
    return out


def _copy(opened: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path, left: int, archive: str) -> int:
    """Write one file; what its header says of its size is not believed."""
    size = 0
    with opened.open(entry) as source, path.open("xb") as out:
        while chunk := source.read(_CHUNK):
            size += len(chunk)
            if size > left:
                raise _too_large(archive, left)
            out.write(chunk)
    return size


def _too_large(archive: str, most: int) -> TooLargeError:
    return TooLargeError(f"{archive}: unpacks to more than {most // MEGABYTE} MB. Send fewer or coarser parts.")
