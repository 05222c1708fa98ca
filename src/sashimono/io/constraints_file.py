"""The user's wishes as a TOML file: read, and written beside a plan so that they can be changed and planned again."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sashimono.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What the user decides. Names may be patterns (``bolt*``)."""

    base: str | None = None
    """The part that everything is put on."""
    up: tuple[float, float, float] | None = None
    """Away from the table, in the file's frame."""
    before: tuple[tuple[str, str], ...] = ()
    """Pairs (first, later) of parts: the first is placed earlier."""
    together: tuple[tuple[str, ...], ...] = ()
    """Groups of parts that are placed one after the other."""
    exclude: tuple[str, ...] = ()
    """Parts that are left out."""
    keep: tuple[str, ...] = ()
    """Products that stay one part each."""
    flat: bool = False
    """Whether the product tree is not looked at."""

    def __post_init__(self) -> None:
        if self.up is not None and not (all(math.isfinite(x) for x in self.up) and math.hypot(*self.up) > 1e-6):
            raise InputError(f"up is {self.up}: not a direction. Give three numbers, not all 0.")

    def and_then(self, more: Wishes) -> Wishes:
        """Return these with others added; of base and up, the others' hold."""
        return Wishes(
            base=more.base if more.base is not None else self.base,
            up=more.up if more.up is not None else self.up,
            before=tuple(dict.fromkeys((*self.before, *more.before))),
            together=tuple(dict.fromkeys((*self.together, *more.together))),
            exclude=tuple(dict.fromkeys((*self.exclude, *more.exclude))),
            keep=tuple(dict.fromkeys((*self.keep, *more.keep))),
            flat=self.flat or more.flat,
        )


def read_wishes(path: str | Path) -> Wishes:
    """Return the wishes in a TOML file, whose fields are those of `Wishes`, any of them.

    InputError, naming file and field, for anything else.
    """
    path = Path(path)
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read as TOML: {error}") from error
    known = ("base", "up", "before", "together", "exclude", "keep", "flat")
    if unknown := sorted(set(document) - set(known)):
        raise InputError(f"{path}: {unknown[0]} is not known. It may have {', '.join(known)}.")
    base = document.get("base")
    if base is not None and not isinstance(base, str):
        raise InputError(f"{path}: base is no name of a part.")
    flat = document.get("flat", False)
    if not isinstance(flat, bool):
        raise InputError(f"{path}: flat is neither true nor false.")
    return Wishes(
        base=base,
        up=_up(document, path),
        before=_before(document, path),
        together=_together(document, path),
        exclude=_names(document, path, "exclude"),
        keep=_names(document, path, "keep"),
        flat=flat,
    )


def _up(document: Mapping[str, Any], path: Path) -> tuple[float, float, float] | None:
    value = document.get("up")
    if value is None:
        return None
    if not isinstance(value, list) or len(value) != 3 or not all(isinstance(x, int | float) for x in value):
        raise InputError(f"{path}: up is no list of three numbers.")
    return (float(value[0]), float(value[1]), float(value[2]))


def _before(document: Mapping[str, Any], path: Path) -> tuple[tuple[str, str], ...]:
    value = document.get("before", [])
    good = isinstance(value, list) and all(
        isinstance(pair, list) and len(pair) == 2 and all(isinstance(name, str) for name in pair) for pair in value
    )
    if not good:
        raise InputError(f'{path}: before is no list of pairs of names, like [["frame", "bolt*"]].')
    return tuple((first, later) for first, later in value)


def _together(document: Mapping[str, Any], path: Path) -> tuple[tuple[str, ...], ...]:
    value = document.get("together", [])
    good = isinstance(value, list) and all(
        isinstance(group, list) and group and all(isinstance(name, str) for name in group) for group in value
    )
    if not good:
        raise InputError(f'{path}: together is no list of lists of names, like [["gear*", "shaft"]].')
    return tuple(tuple(group) for group in value)


def _names(document: Mapping[str, Any], path: Path, field: str) -> tuple[str, ...]:
    value = document.get(field, [])
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise InputError(f"{path}: {field} is no list of names.")
    return tuple(value)


def wishes_to_toml(wishes: Wishes) -> str:
    """Return the wishes as TOML, what is not wished for as comments that say how."""

    def quoted(value: Any) -> str:
        return json.dumps(value, ensure_ascii=False)

    base = f"base = {quoted(wishes.base)}" if wishes.base is not None else '# base = "frame"'
    up = f"up = {list(wishes.up)}" if wishes.up is not None else "# up = [0.0, 0.0, 1.0]"
    pairs = "".join(f"    [{quoted(first)}, {quoted(later)}],\n" for first, later in wishes.before)
    before = f"before = [\n{pairs}]" if wishes.before else '# before = [["bearing*", "shaft"]]'
    groups = "".join(f"    {quoted(list(group))},\n" for group in wishes.together)
    together = f"together = [\n{groups}]" if wishes.together else '# together = [["gear*", "shaft"]]'
    exclude = f"exclude = {quoted(list(wishes.exclude))}" if wishes.exclude else '# exclude = ["cable*"]'
    keep = f"keep = {quoted(list(wishes.keep))}" if wishes.keep else '# keep = ["motor*"]'
    flat = "flat = true" if wishes.flat else "# flat = true"
    return (
        "# What you decide about the plan: change it, then plan again with --constraints.\n"
        f"# the part that everything is put on\n{base}\n"
        f"# away from the table, in the frame of the file\n{up}\n"
        f"# pairs: the first is placed before the second; patterns stand for all that match\n{before}\n"
        f"# groups whose parts are placed one after the other\n{together}\n"
        f"# parts that are left out\n{exclude}\n"
        f"# products of the file's tree that stay one part each\n{keep}\n"
        f"# all parts side by side, whatever the product tree says\n{flat}\n"
    )
