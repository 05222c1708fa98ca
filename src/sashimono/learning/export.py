"""A trained `past-posed` as two ONNX graphs and a card: what inference without PyTorch needs.

``encode.onnx`` is run once a blueprint, ``score.onnx`` once for any number of states. Matrices are stored in half
precision and computed with in single precision.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from sashimono import __version__
from sashimono.errors import InputError
from sashimono.files import atomic_write
from sashimono.learning.config_files import TrainConfig, to_values
from sashimono.learning.evaluate import Evaluation
from sashimono.learning.posed import Encoded, Posed
from sashimono.learning.relations import (
    LINE_FEATURES,
    PAIR_FEATURES,
    PATH_FEATURES,
    VERSION,
    RelationConfig,
)
from sashimono.learning.weights import Weights, load_model

OPSET = 17
"""Of the ONNX operators: fixed, so that a new PyTorch writes the same."""

ENCODED = ("free", "seen", "pair", "token")
"""What the first graph hands to the second."""


def export_posed(weights: Weights, folder: Path, *, relations: RelationConfig | None = None) -> Path:
    """Write the graphs and the card of trained weights into a folder, and return it.

    Raises InputError if the weights are of another kind of model.
    """
    if weights.config.kind != "posed":
        raise InputError(f"only models of kind 'posed' are exported, not {weights.config.kind!r}")
    model = load_model(weights)
    assert isinstance(model, Posed)
    folder.mkdir(parents=True, exist_ok=True)
    relations = relations or RelationConfig()
    write_graphs(model, folder, relations)
    write_card(folder, weights.config, weights.card, relations)
    return folder


def write_card(folder: Path, config: TrainConfig, card: Mapping[str, Any], relations: RelationConfig) -> None:
    """Write ``card.json``: name, version, how relations are measured, and where the weights come from."""
    value = {
        "name": config.name,
        "version": __version__,
        "relations": {"version": VERSION, **to_values(relations)},
        "training": to_values(config),
        "weights": dict(card),
    }
    _save_card(folder / "card.json", value)


def note_figures(folder: Path, evaluation: Evaluation) -> None:
    """Write what an evaluation found into the card of a network, by split; no card there: nothing."""
    path = folder / "card.json"
    if not path.is_file():
        return
    card = json.loads(path.read_text(encoding="utf-8"))
    for split, found in evaluation.by_split.items():
        card.setdefault("figures", {})[split] = {
            "data": evaluation.data,
            "blueprints": int(found["blueprints"].value),
            **{name: round(found[name].value, 4) for name in ("argmax", "expected", "sequence", "sequence_exchange")},
        }
    _save_card(path, card)


def _save_card(path: Path, value: Mapping[str, Any]) -> None:
    with atomic_write(path) as partial:
        partial.write_text(json.dumps(value, indent=1, sort_keys=True) + "\n", encoding="utf-8")


def write_graphs(model: Posed, folder: Path, relations: RelationConfig) -> None:
    """Write both graphs of a model; parts and states may be any number."""
    parts, states, K = 4, 3, relations.directions
    example = (
        torch.rand(parts, parts, K, len(PATH_FEATURES)),
        torch.rand(parts, parts, len(PAIR_FEATURES)),
        torch.rand(parts, K, len(LINE_FEATURES)),
    )
    encode, score = EncodeGraph(model).eval(), ScoreGraph(model).eval()
    part = {0: "part", 1: "part"}
    _write(
        encode,
        example,
        folder / "encode.onnx",
        inputs={"paths": part, "pairs": part, "lines": {0: "part"}},
        outputs={"free": part, "seen": part, "pair": {2: "part", 3: "part"}, "token": {0: "part"}},
    )
    with torch.no_grad():
        encoded = encode(*example)
    placed = torch.rand(states, parts) < 0.5
    state = {0: "state", 1: "part"}
    _write(
        score,
        (*encoded, placed, torch.zeros(states, parts)),
        folder / "score.onnx",
        inputs={
            "free": part,
            "seen": part,
            "pair": {2: "part", 3: "part"},
            "token": {0: "part"},
            "placed": state,
            "reach": state,
        },
        outputs={"leaving": state, "logits": state},
    )


class EncodeGraph(nn.Module):
    """Of one blueprint: relations to what is known before any state is asked about."""

    def __init__(self, model: Posed) -> None:
        super().__init__()
        self.model = model

    def forward(self, paths: Tensor, pairs: Tensor, lines: Tensor) -> tuple[Tensor, ...]:
        present = torch.ones_like(lines[None, :, 0, 0]) > 0.5
        encoded = self.model.relate(paths[None], pairs[None], lines[None], present)
        return tuple(getattr(encoded, name)[0] for name in ENCODED)


class ScoreGraph(nn.Module):
    """Of one blueprint: states to logits that parts can leave and that they are right next."""

    def __init__(self, model: Posed) -> None:
        super().__init__()
        self.model = model

    def forward(
        self, free: Tensor, seen: Tensor, pair: Tensor, token: Tensor, placed: Tensor, reach: Tensor
    ) -> tuple[Tensor, Tensor]:
        present = torch.ones_like(free[None, 0, :, 0]) > 0.5
        encoded = Encoded(present=present, free=free[None], seen=seen[None], pair=pair[None], token=token[None])
        leaving, added = self.model.leaving(encoded, placed[None])
        return leaving[0], self.model.combine(leaving, added, reach[None])[0]


def _write(
    graph: nn.Module,
    example: tuple[Tensor, ...],
    path: Path,
    *,
    inputs: dict[str, dict[int, str]],
    outputs: dict[str, dict[int, str]],
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the exporter, about itself
        torch.onnx.export(
            graph,
            example,
            str(path),
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_axes={**inputs, **outputs},
            opset_version=OPSET,
            dynamo=False,
        )
    halve(path)


def halve(path: Path) -> None:
    """Store the matrices of a graph in half precision; it casts them where it uses them."""
    import onnx
    from onnx import TensorProto, helper, numpy_helper

    graph: Any = onnx.load(str(path))
    casts = []
    for tensor in graph.graph.initializer:
        if tensor.data_type != TensorProto.FLOAT or len(tensor.dims) < 2:
            continue
        name = tensor.name
        half = numpy_helper.from_array(numpy_helper.to_array(tensor).astype("float16"), f"{name}.half")
        tensor.CopyFrom(half)
        casts.append(helper.make_node("Cast", [f"{name}.half"], [name], to=TensorProto.FLOAT))
    for node in reversed(casts):
        graph.graph.node.insert(0, node)
    onnx.checker.check_model(graph)
    onnx.save(graph, str(path))
