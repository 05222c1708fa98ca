"""Training configurations as TOML: fields by name, strictly."""

from __future__ import annotations

import tomllib
import types
import typing
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar

from sashimono.errors import InputError
from sashimono.learning.batch import BatchConfig
from sashimono.learning.registry import classes, config_text

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class OptimizerConfig:
    """How parameters are changed: AdamW with one cycle of the learning rate."""

    rate: float = 1e-3
    """Highest learning rate."""
    warmup: float = 0.1
    """Share of the training until then."""
    start: float = 0.04
    """Learning rate at the beginning, over the highest."""
    end: float = 0.002
    """Learning rate at the end, over the highest."""
    decay: float = 0.02
    """Weight decay; of matrices only."""
    beta2: float = 0.98
    """Memory of the squared gradients."""
    clip: float = 1.0
    """Largest norm of all gradients together."""
    average: float = 0.999
    """Memory of the moving average of the weights, which is what is evaluated and written."""


@dataclass(frozen=True, kw_only=True)
class TrainConfig:
    """One training run."""

    name: str
    kind: str
    """Kind of model (`sashimono.learning.registry`)."""
    model: Any
    """Its configuration."""
    batch: BatchConfig = field(default_factory=BatchConfig)
    optimizer: OptimizerConfig = field(default_factory=OptimizerConfig)
    steps: int = 20_000
    """Steps of the whole run, unless minutes are given."""
    seed: int = 0
    precision: str = "bf16"
    """Of products on a GPU: bf16 or fp32. CPUs use fp32."""
    compile: bool = False
    """Whether the network is compiled by torch."""
    split: str = "train"
    """What is trained on."""
    limit: int | None = None
    """Only so many blueprints of the split, over all families."""
    incomplete: bool = False
    """Whether blueprints are trained on whose conditions are not proven to be all: some of their y may be wrong."""
    log_every: int = 50
    """Steps between two lines of the log."""
    checkpoint_seconds: float = 60.0
    """Seconds between two checkpoints."""


def read_config(name: str | Path, **changes: Any) -> TrainConfig:
    """Return a training configuration: of a .toml file, or a shipped one by its name; with some fields changed.

    Raises InputError for unknown fields or values of another type.
    """
    title, text = config_text(name)
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name}: no TOML: {error}") from error
    return config_of({"name": title, **values, **changes}, str(name))


def config_of(values: Mapping[str, Any], where: str) -> TrainConfig:
    """Return a training configuration from plain values.

    Raises InputError for unknown fields or values of another type.
    """
    if "kind" not in values:
        raise InputError(f"{where}: kind is missing")
    _, model_config = classes(str(values["kind"]))
    model = from_values(model_config, values.get("model", {}), f"{where}: model")
    return from_values(TrainConfig, {**values, "model": model}, where)


def to_values(config: Any) -> dict[str, Any]:
    """Return a configuration as plain values that JSON can hold and `from_values` takes back."""
    return asdict(config)


def from_values(cls: type[T], values: Mapping[str, Any], where: str) -> T:
    """Return a frozen configuration from plain values, nested ones included.

    Raises InputError for unknown fields or values of another type.
    """
    hints = typing.get_type_hints(cls)
    known = {f.name for f in fields(typing.cast(Any, cls))}
    unknown = sorted(set(values) - known)
    if unknown:
        raise InputError(f"{where}: no field {unknown[0]!r}; there are {', '.join(sorted(known))}")
    made = {name: _value(hints[name], value, f"{where}: {name}") for name, value in values.items()}
    try:
        return cls(**made)
    except TypeError as error:
        raise InputError(f"{where}: {error}") from error


def _value(hint: Any, value: Any, where: str) -> Any:
    if hint is Any:
        return value
    if is_dataclass(hint):
        if isinstance(value, Mapping):
            return from_values(typing.cast(Any, hint), value, where)
        if isinstance(value, typing.cast(type, hint)):
            return value
        raise InputError(f"{where}: a table is wanted")
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in arguments:
            return None
        return _value(next(a for a in arguments if a is not type(None)), value, where)
    if origin is typing.Literal:
        if value not in arguments:
            raise InputError(f"{where}: {value!r} is not one of {', '.join(map(repr, arguments))}")
        return value
    if origin is tuple:
        if not isinstance(value, (list, tuple)):
            raise InputError(f"{where}: a list is wanted")
        return tuple(_value(arguments[0], item, where) for item in value)
    if hint is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, hint) or (hint is int and isinstance(value, bool)):
        raise InputError(f"{where}: {value!r} is no {hint.__name__}")
    return value
