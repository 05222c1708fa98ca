"""Models by name: which class and configuration each kind has, and the configurations that are shipped."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from importlib.resources import files
from pathlib import Path
from typing import Any

from sashimono.errors import InputError
from sashimono.learning.cloud_cache import CloudCache, Dataset


@dataclass(frozen=True, kw_only=True)
class Kind:
    """Where a kind of model is."""

    module: str
    model: str
    """Name of its class there."""
    config: str
    """Name of its configuration there."""
    prepare: str | None = None
    """What adds to a cache of clouds all else that it needs, as ``module:function``; called with the cache, the dataset
    and the number of workers."""


KINDS = {
    "past": Kind(module="sashimono.learning.past", model="Past", config="PastConfig"),
    "posed": Kind(
        module="sashimono.learning.posed",
        model="Posed",
        config="PosedConfig",
        prepare="sashimono.learning.relation_cache:add_relations",
    ),
    "nsm": Kind(module="sashimono.learning.baselines.nsm", model="Nsm", config="NsmConfig"),
    "dgl": Kind(module="sashimono.learning.baselines.dgl", model="Dgl", config="DglConfig"),
    "ppo": Kind(module="sashimono.learning.baselines.picker", model="Picker", config="PickerConfig"),
}
"""All kinds; a module is imported when one of its kind is asked for."""


def classes(kind: str) -> tuple[Any, Any]:
    """Return the model's class and its configuration's.

    Raises InputError for an unknown kind.
    """
    if kind not in KINDS:
        raise InputError(f"no kind of model {kind!r}; choose from {', '.join(KINDS)}")
    found = KINDS[kind]
    module = import_module(found.module)
    return getattr(module, found.model), getattr(module, found.config)


BY_REWARD = "ppo"
"""The kind that is trained by reinforcement, not by `sashimono.learning.train`."""


def needs_more(kinds: Iterable[str]) -> bool:
    """Return whether a model of these kinds needs more than clouds."""
    return any(KINDS[kind].prepare is not None for kind in kinds)


def prepared(cache: CloudCache, data: Dataset, kinds: Iterable[str], *, workers: int = 1) -> CloudCache:
    """Return a cache with all that models of these kinds need; made now if it is not there."""
    for kind in dict.fromkeys(kinds):
        where = KINDS[kind].prepare
        if where is not None:
            module, function = where.split(":")
            cache = getattr(import_module(module), function)(cache, data, workers=workers)
    return cache


def shipped_configs() -> list[str]:
    """Return the names of the shipped training configurations."""
    return sorted(item.name.removesuffix(".toml") for item in _folder().iterdir() if item.name.endswith(".toml"))


def config_text(name: str | Path) -> tuple[str, str]:
    """Return name and text of a training configuration: a file's, or a shipped one's.

    Raises InputError if there is none.
    """
    path = Path(name)
    if path.suffix == ".toml":
        try:
            return path.stem, path.read_text(encoding="utf-8")
        except OSError as error:
            raise InputError(f"{path}: cannot be read: {error.strerror}") from error
    if str(name) not in shipped_configs():
        raise InputError(
            f"no training configuration {str(name)!r}; give a .toml file or {', '.join(shipped_configs())}"
        )
    return str(name), (_folder() / f"{name}.toml").read_text(encoding="utf-8")


def _folder() -> Any:
    return files("sashimono.learning") / "configs"
