"""Weights as one plain file: arrays in half precision beside the configuration that they belong to."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from sashimono import __version__
from sashimono.errors import InputError
from sashimono.files import atomic_write
from sashimono.learning.config_files import TrainConfig, config_of, to_values
from sashimono.learning.registry import classes

HEAD = "__head__"
"""Name of the array that holds the configuration and where the weights come from, as JSON."""

PART_BYTES = 15 * 2**20
"""Size above which weights go into several files: some ways of carrying files have such a limit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Weights:
    """Weights of a model and where they come from."""

    config: TrainConfig
    """Of the run that made them."""
    state: Mapping[str, Tensor]
    """By name, in single precision."""
    card: Mapping[str, Any]
    """Data hash, version, steps, states seen, minutes, figures: what a model card says."""


def write_weights(
    path: Path, config: TrainConfig, state: Mapping[str, Tensor], card: Mapping[str, Any], *, most: int = PART_BYTES
) -> None:
    """Write weights in half precision; a file is whole at every moment.

    What is larger than ``most`` bytes goes into further files beside it: ``NAME.2.npz``, ``NAME.3.npz``, ...
    """
    parts: list[dict[str, np.ndarray]] = [{}]
    for name, value in state.items():
        array = _array(value)
        if parts[-1] and sum(other.nbytes for other in parts[-1].values()) + array.nbytes > most:
            parts.append({})
        parts[-1][name] = array
    card = {"version": __version__, **card}
    head = {"config": to_values(config), "card": card, "parts": len(parts)}
    for number, arrays in reversed(list(enumerate(parts, start=1))):
        # each part names its card, so that parts of two moments are not taken for one
        own = head if number == 1 else {"card": card}
        arrays[HEAD] = np.frombuffer(json.dumps(own, sort_keys=True).encode(), dtype=np.uint8)
        with atomic_write(_part(path, number)) as scratch, scratch.open("wb") as file:
            np.savez(file, **typed(arrays))


def read_weights(path: Path) -> Weights:
    """Return the weights in a file, and in the further ones beside it.

    Raises InputError if there are none, or they are of different moments.
    """
    head, arrays = _read_part(path)
    if "config" not in head:
        raise InputError(f"{path}: only a further part of weights; name the first")
    for number in range(2, head["parts"] + 1):
        other, more = _read_part(_part(path, number))
        if other["card"] != head["card"]:
            raise InputError(f"{_part(path, number)}: of another moment than {path}; copy both again")
        arrays |= more
    state = {
        name: torch.from_numpy(array.astype(np.float32) if array.dtype == np.float16 else array)
        for name, array in arrays.items()
    }
    return Weights(config=config_of(head["config"], str(path)), state=state, card=head["card"])


def make_model(config: TrainConfig) -> torch.nn.Module:
    """Return an untrained model, with the configuration's seed."""
    model_class, _ = classes(config.kind)
    torch.manual_seed(config.seed)
    return model_class(config.model)


def load_model(weights: Weights, device: str = "cpu") -> torch.nn.Module:
    """Return the model that weights belong to, ready for inference."""
    model = make_model(weights.config)
    model.load_state_dict(dict(weights.state))
    return model.to(device).eval()


def typed(arrays: Mapping[str, np.ndarray]) -> Mapping[str, Any]:
    """Return the same arrays, for `numpy.savez` and its type stub."""
    return arrays


def _part(path: Path, number: int) -> Path:
    return path if number == 1 else path.with_suffix(f".{number}.npz")


def _read_part(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    try:
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as file:
            arrays = {name: np.asarray(file[name]) for name in file.files}
        return json.loads(arrays.pop(HEAD).tobytes()), arrays
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: no weights: {error}") from error


def _array(value: Tensor) -> np.ndarray:
    value = value.detach().cpu()
    return (value.half() if value.is_floating_point() else value).numpy()
