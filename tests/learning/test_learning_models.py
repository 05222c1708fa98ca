"""PAST, its ablations and baselines: golden values, permutations, masks, and whether they can learn at all."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from learning_toy import ToyDataset, toy_dataset

from sashimono.learning.cloud_cache import CloudCache, CloudConfig, make_cache

torch = pytest.importorskip("torch", reason="the train extra is not installed")
torch.set_num_threads(1)  # tiny models: more threads only wait for one another

from sashimono.learning.batch import Batch, BatchConfig, DeviceClouds, make_batch  # noqa: E402
from sashimono.learning.config_files import TrainConfig, config_of  # noqa: E402
from sashimono.learning.devices import Place  # noqa: E402
from sashimono.learning.evaluate import evaluate  # noqa: E402
from sashimono.learning.past import Dgcnn, DgcnnConfig, EdgeConv, gathered, nearest  # noqa: E402
from sashimono.learning.predictor import NetworkPredictor  # noqa: E402
from sashimono.learning.train import train  # noqa: E402
from sashimono.learning.weights import load_model, make_model, read_weights  # noqa: E402

GOLDEN = Path(__file__).with_name("learning_golden.json")
"""Written by ``make_learning_golden.py`` beside it."""

ENCODER = {"widths": [16, 32], "neighbours": 6, "norm_edges": False}
SIZES: dict[str, dict[str, Any]] = {
    "past": {"hidden": 32, "blocks": 2, "expansion": 2, "dropout": 0.0, "encoder": ENCODER},
    "nsm": {"hidden": 32, "layers": 2, "expansion": 2, "encoder": ENCODER},
    "dgl": {"hidden": 32, "iterations": 2, "pointnet": [16, 32, 32], "dgcnn": ENCODER},
}
VARIANTS: dict[str, tuple[str, dict[str, Any]]] = {
    "past": ("past", {}),
    "past-published": (
        "past",
        {"encoder": {**ENCODER, "norm_edges": True}, "cross": "sequential", "probability": "bce"},
    ),
    "noaux": ("past", {"auxiliary": "none"}),
    "seg": ("past", {"auxiliary": "segmentation", "pretraining": 0.3}),
    "seg-placed": ("past", {"auxiliary": "segmentation", "pretraining": 0.3, "segment_placed": True}),
    "nsm": ("nsm", {}),
    "nsm-target": ("nsm", {"sees_target": True}),
    "dgl": ("dgl", {}),
    "dgl-dgcnn": ("dgl", {"encoder": "dgcnn"}),
}
CLOUDS = CloudConfig(part_points=64, blueprint_points=128, states=16)
BATCH = BatchConfig(blueprints=8, states=4, part_points=32, target_points=64, local=True)


def config_for(variant: str, **changes: Any) -> TrainConfig:
    """Return a tiny configuration of a variant."""
    kind, fields = VARIANTS[variant]
    values = {"name": variant, "kind": kind, "model": {**SIZES[kind], **fields}}
    return replace(config_of(values, variant), batch=BATCH, **changes)


@pytest.fixture(scope="module")
def data() -> ToyDataset:
    return toy_dataset(11)


@pytest.fixture(scope="module")
def cache(data: ToyDataset, tmp_path_factory: pytest.TempPathFactory) -> CloudCache:
    return make_cache(data, tmp_path_factory.mktemp("cache"), config=CLOUDS)


@pytest.fixture(scope="module")
def clouds(cache: CloudCache) -> DeviceClouds:
    return cache.to("cpu")


def golden_values(variant: str, clouds: DeviceClouds) -> dict[str, Any]:
    """Return what a tiny model with a fixed seed says and learns from a fixed batch."""
    config = config_for(variant)
    model = make_model(config)
    batch = make_batch(clouds, [0, 1, 2, 5], config=config.batch, seed=11, progress=0.1)
    loss, terms = model.loss(batch)
    loss.backward()
    norms = {
        name: float(parameter.grad.norm())
        for name, parameter in model.named_parameters()
        if parameter.grad is not None and parameter.dim() > 1
    }
    scores = model.score(model.encode(batch), batch.remaining)
    return {
        "logits": scores.logits[batch.remaining].detach()[:12].tolist(),
        "pose": None if scores.pose is None else scores.pose[batch.remaining].detach()[0].tolist(),
        "terms": {name: float(value.detach()) for name, value in terms.items()},
        "gradients": norms,
    }


def assert_close(found: Any, wanted: Any, where: str) -> None:
    """Numbers agree to three digits, wherever they are."""
    if isinstance(wanted, dict):
        assert found.keys() == wanted.keys(), where
        for name in wanted:
            assert_close(found[name], wanted[name], f"{where}.{name}")
    elif wanted is not None:
        assert found == pytest.approx(wanted, rel=2e-3, abs=2e-4), where


@pytest.mark.parametrize("variant", VARIANTS)
def test_golden_outputs_and_gradients(variant: str, clouds: DeviceClouds) -> None:
    wanted = json.loads(GOLDEN.read_text(encoding="utf-8"))[variant]
    assert_close(golden_values(variant, clouds), wanted, variant)


@pytest.mark.parametrize("variant", VARIANTS)
def test_every_parameter_is_trained_in_each_phase(variant: str, clouds: DeviceClouds) -> None:
    model = make_model(config_for(variant))
    for progress in (0.0, 0.9):
        model.zero_grad()
        model.loss(make_batch(clouds, [0, 1], config=BATCH, seed=0, progress=progress))[0].backward()
        assert [name for name, parameter in model.named_parameters() if parameter.grad is None] == []


def reordered(batch: Batch, order: np.ndarray) -> Batch:
    """Return a batch with each blueprint's slots in another order; all blueprints have as many parts."""
    parts = torch.cat([torch.as_tensor(order) + b * len(order) for b in range(len(batch.present))])
    back = torch.as_tensor(np.argsort(order))
    assert batch.parts_local is not None
    assert batch.pose is not None
    return replace(
        batch,
        parts=batch.parts[parts],
        parts_local=batch.parts_local[parts],
        pose=batch.pose[parts],
        target_part=back[batch.target_part],
        shape_class=batch.shape_class[:, order],
        remaining=batch.remaining[..., order],
        y=batch.y[..., order],
    )


@pytest.mark.parametrize("variant", VARIANTS)
def test_parts_in_another_order_have_the_same_answers(variant: str, cache: CloudCache, clouds: DeviceClouds) -> None:
    rows = np.flatnonzero(cache.counts == 5)[:3]
    batch = make_batch(clouds, rows, config=BATCH, seed=0, progress=0.1)
    order = np.array([3, 0, 4, 1, 2])
    other = reordered(batch, order)
    model = make_model(config_for(variant)).eval()
    with torch.no_grad():
        one = model.score(model.encode(batch), batch.remaining)
        two = model.score(model.encode(other), other.remaining)
        assert torch.allclose(one.logits[..., order][other.remaining], two.logits[other.remaining], atol=1e-4)
        if one.pose is not None:
            assert two.pose is not None
            assert torch.allclose(one.pose[:, :, order][other.remaining], two.pose[other.remaining], atol=1e-4)
        if not variant.startswith("nsm"):  # its discriminator draws points by slot
            assert float(model.loss(batch)[0]) == pytest.approx(float(model.loss(other)[0]), rel=1e-4)


@pytest.mark.parametrize("variant", VARIANTS)
def test_masks_do_not_leak(variant: str, cache: CloudCache, clouds: DeviceClouds) -> None:
    """Neither placed parts, nor padding, nor the other blueprints of a batch change an answer."""
    small, large = int(cache.counts.argmin()), int(cache.counts.argmax())
    model = make_model(config_for(variant)).eval()
    count = int(cache.counts[small])
    placed = [[1, 2], [1, 2]]
    batch = make_batch(clouds, [small, large], config=BATCH, seed=4, placed=placed)
    assert batch.parts_local is not None
    with torch.no_grad():
        encoded = model.encode(batch)
        wanted = model.score(encoded, batch.remaining).logits[0, :, :count]
        # garbage in the place of a placed part
        is_placed = (batch.owner == 0) & (batch.slot == 0)
        garbage = torch.where(is_placed[:, None, None], torch.full_like(batch.parts_local, 3.0), batch.parts_local)
        seen = model.score(model.encode(replace(batch, parts_local=garbage)), batch.remaining).logits[0, :, :count]
        assert torch.allclose(seen[0, 1:], wanted[0, 1:], atol=1e-5)
        assert not torch.allclose(seen[1, 1:], wanted[1, 1:], atol=1e-5), "where it remains it is seen"
        # alone, without padding
        own = batch.owner == 0
        assert batch.pose is not None
        alone = replace(
            batch,
            parts=batch.parts[own],
            parts_local=batch.parts_local[own],
            pose=batch.pose[own],
            owner=batch.owner[own],
            slot=batch.slot[own],
            present=batch.present[:1, :count],
            shape_class=batch.shape_class[:1, :count],
            target=batch.target[:1],
            target_part=batch.target_part[:1],
            remaining=batch.remaining[:1, :, :count],
            y=batch.y[:1, :, :count],
        )
        lone = model.score(model.encode(alone), alone.remaining).logits[0]
        assert torch.allclose(lone[alone.remaining[0]], wanted[alone.remaining[0]], atol=1e-5)


def test_two_part_blueprints_train_the_pose_only(tmp_path: Path) -> None:
    cache = make_cache(toy_dataset(4, least=2, most=2), tmp_path, config=CLOUDS)
    batch = make_batch(cache.to("cpu"), [0, 1, 2], config=BATCH, seed=0)
    loss, terms = make_model(config_for("past")).loss(batch)
    assert terms["probability"].item() == 0.0
    assert loss.item() == terms["pose"].item() > 0.1


def test_edge_convolution_is_the_one_over_edges() -> None:
    """Products by point give what the published form over edges gives."""
    torch.manual_seed(0)
    x = torch.randn(3, 20, 5)
    layer = EdgeConv(5, 7, norm_edges=True)
    neighbours = nearest(x, 6)
    centre = x[:, :, None].expand(-1, -1, 6, -1)
    difference = gathered(x, neighbours) - centre
    A, B = layer.of_neighbour.weight, layer.of_self.weight
    edges = difference @ A.T + centre @ (A + B).T + layer.of_self.bias
    wanted = torch.nn.functional.leaky_relu(layer.norm(edges), 0.2).amax(dim=2)
    assert torch.allclose(layer(x, neighbours), wanted, atol=1e-5)


def test_neighbours_are_the_nearest() -> None:
    x = torch.randn(2, 30, 3, generator=torch.Generator().manual_seed(0))
    wanted = torch.cdist(x, x).topk(5, largest=False).indices
    assert torch.equal(nearest(x, 5).sort(dim=-1).values, wanted.sort(dim=-1).values)
    assert (nearest(x, 5) == torch.arange(30)[:, None]).any(dim=-1).all(), "a point is a neighbour of itself"
    assert nearest(x, 100).shape == (2, 30, 30)


def test_the_encoder_does_not_know_the_order_of_points() -> None:
    torch.manual_seed(0)
    encoder = Dgcnn(DgcnnConfig(widths=(8, 16), neighbours=4), 12)
    x = torch.randn(2, 24, 6)
    order = torch.randperm(24)
    assert torch.allclose(encoder(x)[:, order], encoder(x[:, order]), atol=1e-5)


@pytest.mark.parametrize("variant", VARIANTS)
def test_half_precision_runs(variant: str, clouds: DeviceClouds) -> None:
    """What a GPU runs under autocast has the right types, and gives about the same loss."""
    model = make_model(config_for(variant))
    batch = make_batch(clouds, [0, 1, 2], config=BATCH, seed=0, progress=0.1)
    wanted = model.loss(batch)[0].item()
    with torch.autocast("cpu", dtype=torch.bfloat16):
        loss, _ = model.loss(batch)
    loss.backward()
    assert loss.item() == pytest.approx(wanted, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("variant", VARIANTS)
def test_eight_blueprints_are_learned_by_heart(
    variant: str, data: ToyDataset, cache: CloudCache, clouds: DeviceClouds, tmp_path: Path
) -> None:
    weight = {"past": "auxiliary_weight"}.get(VARIANTS[variant][0], "pose_weight")
    # NSM does not see the blueprint; 2000 steps of PAST leave one of the eight to chance
    steps = {"nsm": 5000, "past": 3000}.get(VARIANTS[variant][0], 2000)
    config = config_for(variant, steps=steps, limit=8)
    config = replace(
        config,
        # whole clouds: what is learned by heart must be there to be recognised
        batch=replace(BATCH, part_points=CLOUDS.part_points, target_points=CLOUDS.blueprint_points),
        model=replace(config.model, **{weight: 0.1}),
        optimizer=replace(config.optimizer, rate=3e-3, average=0.99),
    )
    done = train(config, cache, tmp_path, place=Place(device="cpu"), clouds=clouds)
    weights = read_weights(done.weights)
    predictor = NetworkPredictor(model=load_model(weights), clouds=clouds, batch=config.batch)
    found = evaluate(variant, predictor, data, cache, cache.split("train", limit=8))
    assert found.overall["sequence_exchange"].value == 1.0
