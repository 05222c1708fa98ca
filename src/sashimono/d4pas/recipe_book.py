"""Recipe books: which families, how many members of each, and how they are split. Shipped ones, or a TOML file."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from sashimono.d4pas.families import families
from sashimono.d4pas.splits import SplitConfig
from sashimono.errors import InputError

SHIPPED = ("v1", "tiny")
"""Books in the package."""


@dataclass(frozen=True, kw_only=True)
class RecipeBook:
    """What a dataset is made of."""

    name: str
    version: str
    counts: Mapping[str, int]
    """Members asked for of each family."""
    pairs: Mapping[str, int] = field(default_factory=dict)
    """Two-part blueprints of each family: two parts of a member that touch."""
    first_seed: int = 0
    turned: float = 0.25
    """Share of blueprints that are turned out of the axes."""
    whole: float = 1.0
    """Share of blueprints that are whole products; the others are some parts of one that hang together."""
    max_sequences: int = 16
    """Most sequences listed of a blueprint."""
    max_steps: int = 1
    """Sequences of a blueprint with motions and contacts."""
    split: SplitConfig = field(default_factory=SplitConfig)

    def items(self) -> Iterator[tuple[str, int, bool]]:
        """Yield (family, seed, whether two parts of it are meant): families in turn, so that a limit cuts all alike."""
        most = max([*self.counts.values(), *self.pairs.values()], default=0)
        for k in range(most):
            for pair, counts in ((False, self.counts), (True, self.pairs)):
                for family, count in counts.items():
                    if k < count:
                        yield family, self.first_seed + k, pair


def read_book(name: str) -> RecipeBook:
    """Return a shipped book by its name, or one in a TOML file; InputError, one line, for anything else."""
    if name in SHIPPED:
        text, where = (files("sashimono.d4pas") / "recipes" / f"{name}.toml").read_text(encoding="utf-8"), name
    else:
        path = Path(name)
        if not path.is_file():
            raise InputError(f"{name}: no such recipe. Name one of {', '.join(SHIPPED)}, or a TOML file.")
        try:
            text, where = path.read_text(encoding="utf-8"), str(path)
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read ({error}); check the file") from error
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not readable TOML ({error}); mend it") from error
    return _book(content, where)


COUNTS = {"first_seed": 0, "max_sequences": 1, "max_steps": 0}
"""Options that are whole numbers, with the least."""
SHARES = ("turned", "whole")
"""Options that are numbers from 0 to 1."""
MOST = 2**31 - 1


def _book(content: dict, where: str) -> RecipeBook:
    _refuse_unknown(content, {"name", "version", "families", "pairs", "split", *COUNTS, *SHARES}, where)
    counts = _counts(content.get("families"), f"{where}: [families]")
    if not counts:
        raise InputError(f"{where}: [families] names no family; add lines like 'bolted_plates = 10'")
    options: dict[str, Any] = {
        key: _whole(content[key], least, f"{where}: {key}") for key, least in COUNTS.items() if key in content
    }
    options |= {key: _share(content[key], f"{where}: {key}") for key in SHARES if key in content}
    return RecipeBook(
        name=str(content.get("name", "custom")),
        version=str(content.get("version", "0")),
        counts=counts,
        pairs=_counts(content.get("pairs", {}), f"{where}: [pairs]"),
        split=_split(content.get("split", {}), f"{where}: [split]"),
        **options,
    )


def _counts(section: object, where: str) -> dict[str, int]:
    if not isinstance(section, dict):
        raise InputError(f"{where} is missing or no table; add lines like 'bolted_plates = 10' under it")
    for family, count in section.items():
        if family != "all":
            _refuse_unknown_family(family, where)
        _whole(count, 0, f"{where} {family}")
    every = section.get("all")
    counts: dict[str, int] = {} if every is None else dict.fromkeys(families(), int(every))
    return counts | {family: count for family, count in section.items() if family != "all"}


def _split(section: object, where: str) -> SplitConfig:
    _refuse_unknown(section, set(SplitConfig.__dataclass_fields__), where)
    assert isinstance(section, dict)
    values: dict[str, Any] = {
        key: _whole(section[key], 0, f"{where} {key}") for key in ("test", "val") if key in section
    }
    values |= {key: _share(section[key], f"{where} {key}") for key in ("most_share", "near") if key in section}
    unseen = section.get("unseen", [])
    if not isinstance(unseen, list):
        raise InputError(f"{where} unseen = {unseen!r} should be a list of families; mend it")
    for family in unseen:
        _refuse_unknown_family(family, f"{where} unseen")
    return SplitConfig(**values, unseen=tuple(unseen))


def _whole(value: Any, least: int, where: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= MOST:
        raise InputError(f"{where} = {value!r} should be a whole number of {least} or more; mend it")
    return value


def _share(value: Any, where: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool) or not 0.0 <= value <= 1.0:
        raise InputError(f"{where} = {value!r} should be a number from 0 to 1; mend it")
    return float(value)


def _refuse_unknown(section: object, known: set[str], where: str) -> None:
    if not isinstance(section, dict):
        raise InputError(f"{where} is no table; mend it")
    for key in section:
        if key not in known:
            raise InputError(f"{where}: {key} is not known; use {', '.join(sorted(known))}")


def _refuse_unknown_family(family: str, where: str) -> None:
    if family not in families():
        raise InputError(f"{where}: family {family!r} is not known; choose from {', '.join(families())}")
