"""`past-posed`: the algebra of its rule, what must not matter to it, and that its exported graphs say the same."""

from __future__ import annotations

import json
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from learning_toy import toy_dataset

from sashimono.d4pas.states import can_leave as can_leave_exactly
from sashimono.d4pas.states import is_reachable, is_right_order
from sashimono.errors import InputError
from sashimono.learning import infer
from sashimono.learning.cloud_cache import CloudCache, CloudConfig, make_cache
from sashimono.learning.relations import LINE_FEATURES, PAIR_FEATURES, PATH_FEATURES, RelationConfig, find_relations

torch = pytest.importorskip("torch", reason="the train extra is not installed")

from sashimono.learning import posed  # noqa: E402
from sashimono.learning.batch import BatchConfig, make_batch  # noqa: E402
from sashimono.learning.config_files import read_config  # noqa: E402
from sashimono.learning.relation_cache import EXTRAS, add_relations, clause_table  # noqa: E402

CLOUDS = CloudConfig(part_points=192, blueprint_points=64, states=8)
BATCH = BatchConfig(blueprints=4, states=3, part_points=1, target_points=1, rotate=False, jitter=0.0, extras=EXTRAS)
TINY = posed.PosedConfig(width=16, depth=1, looks=1, rounds=1, heads=2)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> CloudCache:
    data = toy_dataset(8)
    made = make_cache(data, tmp_path_factory.mktemp("cache"), config=CLOUDS)
    return add_relations(made, data, workers=2)


@pytest.fixture
def model() -> posed.Posed:
    torch.manual_seed(0)
    made = posed.Posed(TINY).eval()
    with torch.no_grad():  # what begins as zero would hide mistakes
        for parameter in made.parameters():
            parameter.copy_((parameter + 0.1 * torch.randn(parameter.shape)).half().float())
    return made


def test_any_and_both_are_those_of_probabilities() -> None:
    p = torch.tensor([[0.9, 0.2, 1e-7], [1e-9, 1e-8, 1e-7], [0.5, 0.5, 0.999999]], dtype=torch.float64)
    some = 1 - (1 - p).prod(dim=1)
    torch.testing.assert_close(posed.any_of(-p.log()), torch.logit(some), rtol=1e-5, atol=1e-5)
    a, b = torch.tensor([2.0, -20.0, 9.0]), torch.tensor([-1.0, 5.0, 9.0])
    torch.testing.assert_close(
        posed.both_of(a, b), torch.logit(torch.sigmoid(a) * torch.sigmoid(b)), rtol=1e-4, atol=1e-4
    )


def random_system(rng: np.random.Generator, parts: int, ways: int) -> tuple[np.ndarray, tuple[tuple[int, ...], ...]]:
    """Random logits that j is not in the way of i, and the conditions that their signs mean."""
    free = rng.normal(1.0, 3.0, (parts, parts, ways)).astype(np.float32)
    free[np.arange(parts), np.arange(parts)] = 30.0
    masks = tuple(
        tuple(sum(1 << j for j in range(parts) if free[i, j, k] < 0) for k in range(ways)) for i in range(parts)
    )
    return free, masks


def test_reached_is_reachability() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        free, masks = random_system(rng, 5, 2)
        placed = rng.random((4, 5)) < 0.4
        said = posed.reached(torch.from_numpy(free)[None], torch.ones(1, 5).bool(), torch.from_numpy(placed)[None])[0]
        np.testing.assert_array_equal(said.numpy(), infer.reached(free, placed))
        for state, row in zip(placed, said, strict=True):
            mask = sum(1 << int(k) for k in np.flatnonzero(state))
            assert [bool(value > 0) for value in row] == [is_reachable(masks, mask | 1 << i) for i in range(5)]


def test_parts_that_are_not_there_do_not_matter_to_what_is_reached() -> None:
    free, _ = random_system(np.random.default_rng(1), 4, 2)
    wide = np.full((6, 6, 2), -5.0, np.float32)
    wide[:4, :4] = free
    placed = torch.tensor([[[True, False, False, False], [False, True, True, False]]])
    alone = posed.reached(torch.from_numpy(free)[None], torch.ones(1, 4).bool(), placed)
    padded = posed.reached(
        torch.from_numpy(wide)[None],
        torch.tensor([[True] * 4 + [False] * 2]),
        torch.nn.functional.pad(placed, (0, 2)),
    )
    torch.testing.assert_close(padded[..., :4], alone)


def test_can_leave_is_that_of_the_clauses() -> None:
    masks = ((0b1010, 0b100), (0b1,), (0,), (0b111,))
    sets = list(range(16))
    placed = torch.tensor([[[bool(mask >> k & 1) for k in range(4)] for mask in sets]])
    said = posed.can_leave(torch.from_numpy(clause_table(masks))[None], placed)[0]
    for mask, row in zip(sets, said.tolist(), strict=True):
        assert row == [can_leave_exactly(masks, part, mask & ~(1 << part)) for part in range(4)]


def test_relations_turn_with_the_parts_and_do_not_depend_on_threads(cache: CloudCache) -> None:
    clouds = np.asarray(cache.part_points[cache.parts_of(3)], dtype=np.float32)
    one = find_relations(clouds)
    many = find_relations(clouds, workers=3)
    for name in ("directions", "paths", "pairs", "lines"):
        np.testing.assert_array_equal(getattr(one, name), getattr(many, name))
    order = np.random.default_rng(0).permutation(len(clouds))
    mixed = find_relations(clouds[order])
    np.testing.assert_allclose(mixed.pairs, one.pairs[np.ix_(order, order)], atol=1e-6)
    turn = random_turn(1)
    turned = find_relations(np.concatenate([clouds[..., :3] @ turn.T, clouds[..., 3:] @ turn.T], axis=2))
    np.testing.assert_allclose(turned.pairs, one.pairs, atol=1e-3)
    # equally fit lines may come in another order
    cosines = np.einsum("ikc,ilc->ikl", turned.directions, one.directions @ turn.T)
    same = cosines.argmax(axis=2)
    assert cosines.max(axis=2).min() > 0.9999
    for i, order in enumerate(same):
        np.testing.assert_allclose(turned.lines[i], one.lines[i, order], atol=2e-3)
        off = np.abs(turned.paths[i] - one.paths[i][:, order])
        assert off.mean() < 1e-3


def random_turn(seed: int) -> np.ndarray:
    """A rotation drawn evenly."""
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return (turn * np.sign(np.linalg.det(turn))).astype(np.float32)


def test_a_block_in_a_tube_is_free_upward_only() -> None:
    """The lowest block of a pile: walls beside it, a floor below, the others above."""
    data = toy_dataset(8)
    blueprint = max(data.blueprints, key=lambda b: len(b.parts))
    network = RelationConfig()
    clouds = infer.assembly_clouds(blueprint.assembly(), network)
    found = find_relations(clouds, config=network)
    top, below = blueprint.order[-1], blueprint.order[-2]
    up = int(found.directions[top][:, 2].argmax())
    assert found.directions[top, up, 2] > 0.999
    down = int(found.directions[top][:, 2].argmin())
    entry = PATH_FEATURES.index("entry_one")
    assert found.paths[top, below, up, entry] == 0.0
    assert found.paths[top, below, down, entry] > 0.5
    assert found.paths.shape[2:] == (network.directions, len(PATH_FEATURES))
    assert found.pairs.shape[2] == len(PAIR_FEATURES)
    assert found.lines.shape[2] == len(LINE_FEATURES)


def test_empty_slots_do_not_matter(cache: CloudCache, model: posed.Posed) -> None:
    clouds = cache.to("cpu")
    alone = make_batch(clouds, [1, 2], config=BATCH, seed=5)
    wide = make_batch(clouds, [1, 2], config=BATCH, seed=5, slots=alone.present.shape[1] + 3)
    M = alone.present.shape[1]
    a = model.score(model.encode(alone), alone.remaining).logits
    b = model.score(model.encode(wide), wide.remaining).logits[..., :M]
    kept = alone.remaining
    torch.testing.assert_close(b[kept], a[kept], rtol=1e-4, atol=1e-4)


def test_permuted_parts_permute_what_is_said(cache: CloudCache, model: posed.Posed) -> None:
    batch = make_batch(cache.to("cpu"), [3], config=BATCH, seed=0)
    M = batch.present.shape[1]
    order = torch.randperm(M, generator=torch.Generator().manual_seed(1))
    paths, pairs = (batch.pair_extras[name].float() for name in ("paths", "pairs"))
    lines = batch.part_extras["lines"].float()[None]
    plain = model.relate(paths, pairs, lines, batch.present)
    mixed = model.relate(paths[:, order][:, :, order], pairs[:, order][:, :, order], lines[:, order], batch.present)
    a = model.score(plain, batch.remaining).logits
    b = model.score(mixed, batch.remaining[..., order]).logits
    torch.testing.assert_close(b, a[..., order], rtol=1e-4, atol=1e-4)


def test_gone_parts_do_not_matter_to_the_rule(cache: CloudCache) -> None:
    """Whether a part can leave depends on the parts that are there alone."""
    torch.manual_seed(0)
    model = posed.Posed(posed.PosedConfig(width=16, depth=1, looks=0, rounds=0, heads=2))
    batch = make_batch(cache.to("cpu"), [3], config=BATCH, seed=0)
    encoded = model.encode(batch)
    M = batch.present.shape[1]
    sets = [torch.tensor([k in kept for k in range(M)]) for kept in combinations(range(M), 2)]
    said, _ = model.leaving(encoded, torch.stack(sets)[None])
    more, _ = model.leaving(encoded, batch.present[:, None].expand(1, len(sets), M))
    assert (said >= more - 1e-4).all()  # fewer parts never block more


def test_gradients_reach_every_parameter(cache: CloudCache, model: posed.Posed) -> None:
    loss, terms = model.loss(make_batch(cache.to("cpu"), [1, 2, 3], config=BATCH, seed=2))
    loss.backward()
    assert set(terms) == {"right", "leave", "pick"}
    missing = [name for name, p in model.named_parameters() if p.grad is None or not p.grad.abs().sum() > 0]
    assert missing == []


def test_it_learns_piles_by_heart(cache: CloudCache) -> None:
    torch.manual_seed(0)
    model = posed.Posed(posed.PosedConfig(width=24, depth=1, looks=1, rounds=1, heads=2))
    optimizer = torch.optim.AdamW(model.parameters(), lr=1e-2)
    clouds = cache.to("cpu")
    rows = cache.split("train")
    for step in range(40):
        loss, _ = model.loss(make_batch(clouds, rows, config=BATCH, seed=step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    model.eval()
    batch = make_batch(clouds, rows, config=BATCH, seed=0)
    orders = model.orders(model.encode(batch))
    blueprints = toy_dataset(8).blueprints
    assert all(is_right_order(blueprints[row].masks, order) for row, order in zip(rows, orders, strict=True))


@pytest.mark.parametrize("surer", [0.0, 20.0])
def test_exported_graphs_say_what_the_model_says(
    tmp_path: Path, cache: CloudCache, model: posed.Posed, surer: float
) -> None:
    """Also where probabilities are 1 to all digits: logits must not be lost there."""
    with torch.no_grad():
        model.free.bias += surer
    pytest.importorskip("onnx", reason="the train extra is not installed")
    pytest.importorskip("onnxruntime")
    from sashimono.learning.export import write_card, write_graphs

    write_graphs(model, tmp_path, RelationConfig())
    write_card(tmp_path, read_config("past-posed"), {}, RelationConfig())
    network = infer.load_network(tmp_path)
    data = toy_dataset(8)
    clouds = cache.to("cpu")
    for row in (0, 3, 5):
        batch = make_batch(clouds, [row], config=BATCH, seed=0)
        encoded = model.encode(batch)
        arrays = network.encode(
            paths=batch.pair_extras["paths"][0].float().numpy(),
            pairs=batch.pair_extras["pairs"][0].float().numpy(),
            lines=batch.part_extras["lines"].float().numpy(),
        )
        order = infer.take_apart(arrays, network)[::-1]
        assert order == model.orders(encoded)[0]
        said = infer.next_probabilities(arrays, order, network)
        for n in range(len(order)):
            remaining = torch.tensor([[[k in order[n:] for k in range(len(order))]]])
            wanted = torch.sigmoid(model.score(encoded, remaining).logits)[0, 0] * remaining[0, 0]
            np.testing.assert_allclose(said[n], wanted.detach().numpy(), atol=1e-3)
        result = infer.infer(
            data.blueprints[row].parts, np.asarray(cache.part_points[cache.parts_of(row)], np.float32), network
        )
        assert sorted(result.order) == sorted(data.blueprints[row].parts)
        value = json.loads(result.to_json())
        assert set(value) == {"model", "parts", "order", "steps", "milliseconds"}
        assert [step["chosen"] for step in value["steps"]] == value["order"]
        assert value["steps"][1]["placed"] == value["order"][:1]
        assert set(value["steps"][1]["probabilities"]) == set(value["order"][1:])
        assert result.steps[-1].runner_up is None


def test_scans_are_read_from_points_with_normals(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    head = "ply\nformat ascii 1.0\nelement vertex {}\n{}end_header\n"
    names = [f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz")]

    def write(name: str, count: int, columns: int) -> None:
        normals = rng.normal(size=(count, 3))
        rows = np.concatenate([rng.random((count, 3)), normals], axis=1)[:, :columns]
        body = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in rows)
        (tmp_path / f"{name}.ply").write_text(head.format(count, "".join(names[:columns])) + body + "\n")

    write("lid", 300, 6)
    write("base", 700, 6)
    read, clouds = infer.read_scan(tmp_path, RelationConfig())
    assert read == ("base", "lid")
    assert clouds.shape == (2, 300, 6)
    assert np.linalg.norm(clouds[..., :3], axis=2).max() <= 1.0 + 1e-9
    np.testing.assert_allclose(np.linalg.norm(clouds[..., 3:], axis=2), 1.0, atol=1e-6)
    write("base", 700, 3)
    with pytest.raises(InputError, match="no normals"):
        infer.read_scan(tmp_path, RelationConfig())
    write("base", 9, 6)
    with pytest.raises(InputError, match="9 points"):
        infer.read_scan(tmp_path, RelationConfig())
    with pytest.raises(InputError, match=r"no \.ply files"):
        infer.read_scan(tmp_path / "nothing", RelationConfig())
    with pytest.raises(InputError, match="no network"):
        infer.load_network("no-such")
