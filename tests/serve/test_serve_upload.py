"""What comes from outside: hostile names, archives that lie or lead elsewhere, more bytes than allowed."""

import asyncio
import io
import stat
import zipfile
from pathlib import Path

import pytest

from sashimono.errors import InputError
from sashimono.serve.limits import Limits
from sashimono.serve.options import arguments, checked
from sashimono.serve.upload import TooLargeError, receive, safe_name, unpack

LIMITS = Limits(upload=1000, unpacked=2000, files=5)


@pytest.mark.parametrize(
    ("name", "safe"),
    [
        ("gear box.STEP", "gear box.step"),
        ("../../etc/passwd.step", "passwd.step"),
        ("C:\\windows\\x.glb", "x.glb"),
        ("a/b\x00c\n.stp", "b_c_.stp"),
        ("<script>.3mf", "_script_.3mf"),
        ("é" * 300 + ".zip", "é" * 96 + ".zip"),
        ("..hidden.step", "hidden.step"),
    ],
)
def test_a_name_is_one_file_of_harmless_characters(name, safe):
    assert safe_name(name) == safe


@pytest.mark.parametrize("name", ["", "x", "x.exe", ".step", "../", "..", "x.step/", "x.html", "x.json"])
def test_other_names_are_refused(name):
    with pytest.raises(InputError, match="cannot be planned"):
        safe_name(name)


def packed(path: Path, entries: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as out:
        for name, content in entries.items():
            out.writestr(name, content)
    return path


def test_meshes_come_out_by_their_own_names_only(tmp_path):
    entries = {
        "../../up.obj": b"1",
        "/etc/root.obj": b"2",
        "deep/er/c.stl": b"3",
        "..\\win.ply": b"4",
        "readme.txt": b"5",
    }
    folder = unpack(packed(tmp_path / "a.zip", entries), tmp_path / "parts", LIMITS)
    assert folder == tmp_path / "parts"
    assert sorted(path.name for path in folder.iterdir()) == ["c.stl", "root.obj", "up.obj", "win.ply"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.zip", "parts"]


def test_one_scene_in_an_archive_is_the_input(tmp_path):
    found = unpack(packed(tmp_path / "a.zip", {"cad/x.step": b"ISO"}), tmp_path / "parts", LIMITS)
    assert found == tmp_path / "parts" / "x.step"


def link(path: Path) -> Path:
    entry = zipfile.ZipInfo("a.obj")
    entry.external_attr = (stat.S_IFLNK | 0o777) << 16
    with zipfile.ZipFile(path, "w") as out:
        out.writestr(entry, "/etc/passwd")
    return path


def lying(path: Path) -> Path:
    """An archive whose directory says that a large file is small."""
    packed(path, {"a.obj": b"0" * 100_000})
    content = bytearray(path.read_bytes())
    at = content.rindex(b"PK\x01\x02")
    content[at + 24 : at + 28] = (10).to_bytes(4, "little")
    path.write_bytes(content)
    return path


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda path: packed(path, {"a.obj": b"0" * 3000}), "unpacks to more than"),
        (lambda path: packed(path, {f"{k}.obj": b"0" for k in range(6)}), "6 files"),
        (lambda path: packed(path, {"a.obj": b"0", "b/a.obj": b"1"}), "two files are called"),
        (lambda path: packed(path, {"a.txt": b"0"}), "should hold the meshes"),
        (lambda path: packed(path, {"a.step": b"0", "b.step": b"0"}), "should hold the meshes"),
        (link, "is a link"),
        (lying, "not a readable archive"),
        (lambda path: path.write_bytes(b"PK\x03\x04nothing") and path, "not a readable archive"),
        (
            lambda path: path.write_bytes(packed(path, {"a.obj": b"0" * 500}).read_bytes()[:60]) and path,
            "not a readable",
        ),
    ],
)
def test_bad_archives_are_refused_in_one_line(make, said, tmp_path):
    with pytest.raises(InputError, match=said) as error:
        unpack(make(tmp_path / "a.zip"), tmp_path / "parts", LIMITS)
    assert "\n" not in str(error.value)


async def _pieces(count: int):
    for _ in range(count):
        yield b"0" * 100


def test_a_stream_that_is_too_long_leaves_no_file(tmp_path):
    assert asyncio.run(receive(_pieces(10), tmp_path / "a.step", LIMITS)) == 1000
    with pytest.raises(TooLargeError):
        asyncio.run(receive(_pieces(11), tmp_path / "b.step", LIMITS))
    with pytest.raises(InputError, match="empty"):
        asyncio.run(receive(_pieces(0), tmp_path / "c.step", LIMITS))
    assert [path.name for path in tmp_path.iterdir()] == ["a.step"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "JSON object"),
        ({"out": "/etc"}, "is no option"),
        ({"unit": "mile"}, "none of"),
        ({"unit": ["mm"]}, "none of"),
        ({"seed": True}, "no whole number"),
        ({"hands": 0}, "no whole number"),
        ({"constraints": "base = 3"}, "constraints"),
        ({"constraints": 3}, "TOML"),
        ({"constraints": "base = ["}, "constraints"),
    ],
)
def test_options_that_cannot_be_used_are_refused(options, said):
    with pytest.raises(InputError, match=said) as error:
        checked(options)
    assert "/tmp" not in str(error.value)


def test_options_become_a_command_line(tmp_path):
    options = checked({"unit": "mm", "hands": 1, "constraints": 'base = "case"\n'})
    written = tmp_path / "constraints.toml"
    assert arguments(options, tmp_path) == ["--unit", "mm", "--hands", "1", "--constraints", str(written)]
    assert written.read_text() == 'base = "case"\n'


def test_a_name_in_an_archive_cannot_be_an_option(tmp_path):
    found = unpack(packed(tmp_path / "a.zip", {"--out.step": b"ISO"}), tmp_path / "parts", LIMITS)
    assert found.is_absolute(), "so that it is never read as an option"
    assert io.BytesIO(found.read_bytes()).read() == b"ISO"
