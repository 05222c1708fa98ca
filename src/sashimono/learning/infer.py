"""Sequence inference without PyTorch: clouds of parts in place, in; an assembly order with probabilities, out.

The order comes from taking the product apart, the surest part first, and turning that round: taking apart never
dead-ends. The probabilities are those that PAST gives: of each remaining part, that it is right next.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from sashimono.assembly import Assembly
from sashimono.d4pas.clouds import normalised, part_clouds, unit_frame
from sashimono.errors import InputError
from sashimono.io.formats.ply import parse_points
from sashimono.learning.relations import VERSION, RelationConfig, find_relations

DEFAULT = "past-posed"
"""The network in the package."""

FEWEST_POINTS = 64
"""Fewest points that a part's cloud must have."""


@dataclass(frozen=True, kw_only=True)
class Step:
    """One choice of the network."""

    placed: tuple[str, ...]
    """Parts placed before, in order."""
    probabilities: Mapping[str, float]
    """Of each remaining part, that it is right next."""
    chosen: str

    @property
    def runner_up(self) -> str | None:
        """The likeliest of the other parts, if there are any."""
        others = [name for name in self.probabilities if name != self.chosen]
        return max(others, key=lambda name: self.probabilities[name], default=None)


@dataclass(frozen=True, kw_only=True)
class Inference:
    """An order, and what the network said on the way."""

    model: str
    parts: tuple[str, ...]
    order: tuple[str, ...]
    """Base part first."""
    steps: tuple[Step, ...]
    encode_milliseconds: float
    """Relations of the parts, and the first graph."""
    sequence_milliseconds: float
    """The whole order; the encoding is part of it."""

    def to_json(self) -> str:
        """Return it as `sashimono infer` writes it."""
        value = {
            "model": self.model,
            "parts": list(self.parts),
            "order": list(self.order),
            "steps": [
                {
                    "placed": list(step.placed),
                    "probabilities": {name: round(p, 6) for name, p in step.probabilities.items()},
                    "chosen": step.chosen,
                }
                for step in self.steps
            ],
            "milliseconds": {
                "encode": round(self.encode_milliseconds, 3),
                "sequence": round(self.sequence_milliseconds, 3),
            },
        }
        return json.dumps(value, indent=1, ensure_ascii=False) + "\n"


class Network:
    """The graphs of an exported network."""

    def __init__(self, folder: Path, *, threads: int = 2) -> None:
        try:
            self.card: dict[str, Any] = json.loads((folder / "card.json").read_text(encoding="utf-8"))
            self._graphs = {name: (folder / f"{name}.onnx").read_bytes() for name in ("encode", "score")}
        except OSError as error:
            raise InputError(f"{folder}: no exported network: {error.strerror}") from error
        relations = dict(self.card["relations"])
        if relations.pop("version") != VERSION:
            raise InputError(f"{folder}: made for relations of another release; export the weights again")
        self.relations = RelationConfig(**relations)
        self.threads = threads

    @property
    def name(self) -> str:
        """What it is called."""
        return self.card["name"]

    @cached_property
    def encode(self) -> Graph:
        """Run once a product."""
        return Graph(self._graphs["encode"], self.threads)

    @cached_property
    def score(self) -> Graph:
        """Run for any number of states."""
        return Graph(self._graphs["score"], self.threads)


class Graph:
    """An ONNX graph that takes and returns arrays by name."""

    def __init__(self, data: bytes, threads: int) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.log_severity_level = 3
        self.session = onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
        self.inputs = [value.name for value in self.session.get_inputs()]
        self.outputs = [value.name for value in self.session.get_outputs()]

    def __call__(self, **arrays: np.ndarray) -> dict[str, np.ndarray]:
        """Return the outputs; arrays that the graph does not take are left out."""
        values: Sequence[Any] = self.session.run(None, {name: arrays[name] for name in self.inputs})
        return dict(zip(self.outputs, values, strict=True))


def load_network(model: str | Path = DEFAULT, *, threads: int = 2) -> Network:
    """Return a network: a shipped one by its name, or one in a folder.

    Raises InputError if there is none.
    """
    if Path(model).is_dir():
        return Network(Path(model), threads=threads)
    shipped = files("sashimono.learning") / "models"
    names = sorted(item.name for item in shipped.iterdir() if item.is_dir()) if shipped.is_dir() else []
    if str(model) not in names:
        raise InputError(f"no network {str(model)!r}; give a folder or one of: {', '.join(names) or 'none is shipped'}")
    with as_file(shipped / str(model)) as folder:
        return Network(folder, threads=threads)


def assembly_clouds(assembly: Assembly, config: RelationConfig, *, seed: int = 0) -> Float[np.ndarray, "part point 6"]:
    """Return the clouds of an assembly's parts in its unit frame."""
    clouds = part_clouds(assembly, config.points, seed=seed)
    center, scale = unit_frame(clouds[..., :3])
    return normalised(clouds, center.tolist(), scale)


def read_scan(folder: Path, config: RelationConfig) -> tuple[tuple[str, ...], Float[np.ndarray, "part point 6"]]:
    """Return names and clouds, in their unit frame, of a folder of point clouds in place: a .ply file each part.

    Raises InputError if there are none, or they have too few points or no normals.
    """
    paths = sorted(folder.glob("*.ply"))
    if not paths:
        raise InputError(f"{folder}: no .ply files; give a folder with a cloud of points of each part, in place")
    clouds = [_read_points(path) for path in paths]
    count = min(config.points, *(len(cloud) for cloud in clouds)) if len(clouds) > 1 else config.points
    rng = np.random.default_rng(0)
    stacked = np.stack([cloud[rng.permutation(len(cloud))[:count]] for cloud in clouds])
    center, scale = unit_frame(stacked[..., :3])
    return tuple(path.stem for path in paths), normalised(stacked, center.tolist(), scale)


def _read_points(path: Path) -> np.ndarray:
    try:
        points = parse_points(path.read_bytes())
    except (OSError, ValueError, IndexError, KeyError) as error:
        raise InputError(f"{path}: not a PLY file of points: {error}") from error
    if points.shape[1] != 6:
        raise InputError(f"{path}: the points have no normals nx, ny, nz; estimate them, outward, before")
    if len(points) < FEWEST_POINTS or not np.isfinite(points).all():
        raise InputError(f"{path}: {len(points)} points; {FEWEST_POINTS} finite ones are needed")
    points[:, 3:] /= np.maximum(np.linalg.norm(points[:, 3:], axis=1, keepdims=True), 1e-12)
    return points


def infer(names: Sequence[str], clouds: Float[np.ndarray, "part point 6"], network: Network) -> Inference:
    """Return the order in which a network puts parts together, given as clouds in place in their unit frame."""
    begun = time.perf_counter()
    encoded = encode_clouds(clouds, network)
    encode_seconds = time.perf_counter() - begun
    order = take_apart(encoded, network)[::-1]
    probabilities = next_probabilities(encoded, order, network)
    sequence_seconds = time.perf_counter() - begun
    steps = [
        Step(
            placed=tuple(names[k] for k in order[:n]),
            probabilities={names[k]: float(probabilities[n, k]) for k in sorted(order[n:])},
            chosen=names[order[n]],
        )
        for n in range(len(order))
    ]
    return Inference(
        model=network.name,
        parts=tuple(names),
        order=tuple(names[k] for k in order),
        steps=tuple(steps),
        encode_milliseconds=1e3 * encode_seconds,
        sequence_milliseconds=1e3 * sequence_seconds,
    )


def encode_clouds(clouds: Float[np.ndarray, "part point 6"], network: Network) -> dict[str, np.ndarray]:
    """Return what a network knows of parts before any state is asked about."""
    relations = find_relations(clouds, config=network.relations, workers=network.threads)
    return network.encode(paths=relations.paths, pairs=relations.pairs, lines=relations.lines)


def take_apart(encoded: Mapping[str, np.ndarray], network: Network) -> list[int]:
    """Return the parts in the order in which they leave, the surest first."""
    count = len(encoded["free"])
    placed = np.ones((1, count), dtype=bool)
    reach = np.zeros((1, count), dtype=np.float32)
    order = []
    for _ in range(count):
        leaving = network.score(**encoded, placed=placed, reach=reach)["leaving"][0]
        part = int(np.where(placed[0], leaving, -np.inf).argmax())
        placed[0, part] = False
        order.append(part)
    return order


def next_probabilities(
    encoded: Mapping[str, np.ndarray], order: Sequence[int], network: Network
) -> Float[np.ndarray, "step part"]:
    """Return the probabilities that each part is right next, along an order; of parts already placed, 0."""
    count = len(order)
    placed = np.zeros((count, count), dtype=bool)
    for n in range(1, count):
        placed[n] = placed[n - 1]
        placed[n, order[n - 1]] = True
    reach = reached(encoded["free"], placed)
    logits = network.score(**encoded, placed=placed, reach=reach)["logits"]
    return np.where(placed, 0.0, 1.0 / (1.0 + np.exp(-logits.astype(np.float64))))


def reached(free: Float[np.ndarray, "part part way"], placed: Bool[np.ndarray, "state part"]) -> np.ndarray:
    """Return the logit that placed parts with one more can be reached (state, part), as `posed.reached` does."""
    count, never = len(free), -30.0
    out = np.empty(placed.shape, np.float32)
    for s, state in enumerate(placed):
        stays = state | np.eye(count, dtype=bool)  # (part, j)
        w = np.full((count, count), never, np.float32)
        for _ in range(count):
            # (part, j, other, way)
            step = np.maximum(free[None], w[:, None, :, None]).min(axis=2).max(axis=2)
            new = np.where(stays, never, step)
            if np.array_equal(new, w):
                break
            w = new
        out[s] = np.where(stays, -never, w).min(axis=1)
    return out
