"""The cache of clouds and states, and the batches made from it: exact, deterministic, padded, posed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from learning_toy import ToyBlueprint, ToyDataset, toy_dataset

from sashimono.d4pas.clouds import part_clouds
from sashimono.d4pas.states import all_states, is_reachable, right_next
from sashimono.errors import InputError
from sashimono.learning.cloud_cache import CloudCache, CloudConfig, cache_folder, make_cache, state_pool

torch = pytest.importorskip("torch", reason="the train extra is not installed")
torch.set_num_threads(1)  # tiny models: more threads only wait for one another

from sashimono.learning.batch import (  # noqa: E402
    BatchConfig,
    axis_angle_between,
    bits_of,
    make_batch,
    padded,
    random_quaternions,
    rotation_matrix,
    rotations_of,
)

CONFIG = CloudConfig(part_points=64, blueprint_points=128, states=16)
BATCH = BatchConfig(blueprints=4, states=4, part_points=32, target_points=48, local=True)


@pytest.fixture(scope="module")
def data() -> ToyDataset:
    return toy_dataset(8, least=3, most=6)


@pytest.fixture(scope="module")
def cache(data: ToyDataset, tmp_path_factory: pytest.TempPathFactory) -> CloudCache:
    return make_cache(data, tmp_path_factory.mktemp("cache"), config=CONFIG)


def random_masks(count: int, rng: np.random.Generator) -> tuple[tuple[int, ...], ...]:
    """Conditions of a product that comes apart in the order of its parts, with a few alternatives."""
    out = []
    for part in range(count):
        below = [int(rng.integers(0, 1 << part)) if part else 0 for _ in range(int(rng.integers(1, 3)))]
        out.append(tuple(below))
    return tuple(out)


@pytest.mark.parametrize("seed", range(6))
def test_pool_has_distinct_reachable_states_with_exact_answers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    masks = random_masks(9, rng)
    placed, right = state_pool(masks, 24, rng)
    everything = all_states(masks, limit=10_000)
    assert everything is not None
    wanted = [state for state in everything if state.bit_count() <= 7]
    assert len(placed) == min(24, len(wanted)) == len(set(placed.tolist()))
    for state, answer in zip(placed.tolist(), right.tolist(), strict=True):
        assert is_reachable(masks, state)
        assert answer == right_next(masks, state) == everything[state]
        assert answer
    levels = np.bitwise_count(placed)
    assert (np.diff(levels) >= 0).all()
    if len(wanted) > 24:
        have = np.bincount(levels, minlength=8)
        assert have.min() >= 1
        assert have.max() <= 24 // 8 + 2


def test_cache_is_the_same_with_more_workers_and_is_not_made_twice(data: ToyDataset, tmp_path: Path) -> None:
    one = make_cache(data, tmp_path / "one", config=CONFIG)
    two = make_cache(data, tmp_path / "two", config=CONFIG, workers=2)
    for name in ("part_points", "blueprint_points", "blueprint_part", "placed", "right", "part_class"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name
    stamp = (one.folder / "cache.json").stat().st_mtime_ns
    assert make_cache(data, tmp_path / "one", config=CONFIG).ids == one.ids
    assert (one.folder / "cache.json").stat().st_mtime_ns == stamp
    assert cache_folder(data, tmp_path, CONFIG) != cache_folder(data, tmp_path, replace(CONFIG, seed=1))
    assert cache_folder(data, tmp_path, CONFIG) != cache_folder(replace(data, hash="other"), tmp_path, CONFIG)


def test_clouds_are_those_of_the_meshes_in_the_unit_frame(data: ToyDataset, cache: CloudCache) -> None:
    for k, blueprint in enumerate(data.blueprints):
        points = np.asarray(cache.part_points[cache.parts_of(k)], dtype=float)
        assert np.linalg.norm(points[..., :3], axis=-1).max() == pytest.approx(1.0, abs=2e-3)
        assert np.linalg.norm(points[..., 3:], axis=-1) == pytest.approx(1.0, abs=2e-3)
        assembly = blueprint.assembly()
        fine = part_clouds(assembly, 2000, seed=1)[..., :3]
        scale = float(cache.blueprint_scale[k])
        spread = points[..., :3].std(axis=1) * scale
        assert spread == pytest.approx(fine.std(axis=1), rel=0.25, abs=0.02)
        owner = np.asarray(cache.blueprint_part[k])
        assert set(owner.tolist()) <= set(range(len(blueprint.parts)))
        for part in range(len(blueprint.parts)):
            mine = np.asarray(cache.blueprint_points[k], dtype=float)[owner == part, :3]
            low, high = points[part, :, :3].min(axis=0), points[part, :, :3].max(axis=0)
            assert ((mine > low - 0.1) & (mine < high + 0.1)).all()


def test_a_batch_says_what_the_conditions_say(data: ToyDataset, cache: CloudCache) -> None:
    clouds = cache.to("cpu")
    rows = [0, 3, 5, 3]
    for seed in range(5):
        batch = make_batch(clouds, rows, config=BATCH, seed=seed)
        weights = 1 << torch.arange(batch.present.shape[1])
        for b, row in enumerate(rows):
            blueprint = data.blueprints[row]
            assert int(batch.present[b].sum()) == len(blueprint.parts)
            for s in range(BATCH.states):
                placed = int((batch.placed[b, s] * weights).sum())
                assert is_reachable(blueprint.masks, placed)
                assert int((batch.y[b, s].long() * weights).sum()) == right_next(blueprint.masks, placed)
        assert not (batch.remaining & ~batch.present[:, None]).any()
        assert not (batch.y.bool() & ~batch.remaining).any()


def test_levels_weigh_the_same_in_batches(cache: CloudCache) -> None:
    row = int(cache.counts.argmax())
    clouds = cache.to("cpu")
    config = replace(BATCH, states=64)
    levels = torch.cat([make_batch(clouds, [row], config=config, seed=s).placed.sum(dim=2)[0] for s in range(20)])
    share = torch.bincount(levels, minlength=int(cache.counts[row]) - 1) / len(levels)
    assert share.numpy() == pytest.approx(np.full(len(share), 1 / len(share)), abs=0.01)


def test_batches_follow_from_their_seed(cache: CloudCache) -> None:
    clouds = cache.to("cpu")
    one, same, other = (make_batch(clouds, [1, 2], config=BATCH, seed=seed) for seed in (7, 7, 8))
    for name in ("parts", "target", "parts_local", "pose", "remaining", "y", "rotation"):
        assert torch.equal(getattr(one, name), getattr(same, name)), name
    for name in ("parts", "target", "parts_local", "rotation"):
        assert not torch.equal(getattr(one, name), getattr(other, name)), name


def test_blueprints_turn_as_a_whole_and_poses_bring_parts_into_place(cache: CloudCache) -> None:
    clouds = cache.to("cpu")
    quiet = replace(BATCH, jitter=0.0)
    batch = make_batch(clouds, [0, 2, 4], config=quiet, seed=3)
    still = make_batch(clouds, [0, 2, 4], config=replace(quiet, rotate=False), seed=3)
    assert torch.equal(still.rotation, torch.eye(3).expand(3, 3, 3))
    assert torch.allclose(torch.linalg.det(batch.rotation), torch.ones(3), atol=1e-5)
    assert batch.parts_local is not None
    assert batch.pose is not None
    turn = rotation_matrix(batch.pose[:, 3:])
    in_place = batch.parts_local[..., :3] @ turn.transpose(1, 2) + batch.pose[:, None, :3]
    assert torch.allclose(in_place, batch.parts[..., :3], atol=2e-5)
    assert torch.allclose(batch.parts_local[..., 3:] @ turn.transpose(1, 2), batch.parts[..., 3:], atol=2e-5)
    # every point of a blueprint lies near the cloud of its part
    full = replace(quiet, part_points=64, target_points=128)
    batch = make_batch(clouds, [0, 2, 4], config=full, seed=3)
    low, high = padded(batch.parts[..., :3].amin(dim=1), batch), padded(batch.parts[..., :3].amax(dim=1), batch)
    own = batch.target_part[..., None].expand(-1, -1, 3)
    assert (batch.target[..., :3] > low.gather(1, own) - 0.25).all()
    assert (batch.target[..., :3] < high.gather(1, own) + 0.25).all()


def test_padding_is_empty(cache: CloudCache) -> None:
    clouds = cache.to("cpu")
    counts = cache.counts
    rows = [int(counts.argmin()), int(counts.argmax())]
    batch = make_batch(clouds, rows, config=BATCH, seed=0, slots=9)
    assert batch.present.sum(dim=1).tolist() == counts[rows].tolist()
    assert batch.present.shape == (2, 9)
    assert len(batch.parts) == counts[rows].sum()
    values = padded(torch.ones(len(batch.owner), 2), batch)
    assert torch.equal(values[..., 0] == 1, batch.present)
    assert torch.equal(batch.shape_class >= 0, batch.present)


def test_states_can_be_given(cache: CloudCache) -> None:
    batch = make_batch(cache.to("cpu"), [0, 1], config=BATCH, seed=0, placed=[[0, 3], [1, 4]])
    assert torch.equal(bits_of(torch.tensor([[0, 3], [1, 4]]), 4), batch.placed[..., :4])


def test_added_arrays_come_along_at_their_places(data: ToyDataset, tmp_path: Path) -> None:
    cache = make_cache(data, tmp_path, config=CONFIG)
    parts, pairs = int(cache.first_part[-1]), int(cache.first_pair[-1])
    cache = cache.add_part_extra("number", np.arange(parts, dtype=np.float32)[:, None])
    cache = cache.add_pair_extra("pair", np.arange(pairs, dtype=np.float32)[:, None])
    config = replace(BATCH, extras=("number", "pair"))
    rows = [2, 5, 0]
    batch = make_batch(cache.to("cpu"), rows, config=config, seed=0)
    assert torch.equal(batch.part_extras["number"][:, 0].long(), batch.part_index)
    between = batch.pair_extras["pair"][..., 0]
    for b, row in enumerate(rows):
        n = int(cache.counts[row])
        wanted = torch.arange(n * n).reshape(n, n) + int(cache.first_pair[row])
        assert torch.equal(between[b, :n, :n].long(), wanted)
        assert not between[b, n:].any()
        assert not between[b, :, n:].any()


def test_rotations_between_are_exact_near_zero_and_near_pi() -> None:
    random = torch.Generator().manual_seed(0)
    after, before = random_quaternions(500, random).double(), random_quaternions(500, random).double()
    vectors = axis_angle_between(after, before)
    wanted = rotations_of(after) @ rotations_of(before).transpose(1, 2)
    assert torch.allclose(torch.linalg.det(wanted), torch.ones(500, dtype=torch.float64), atol=1e-6)
    assert torch.allclose(rotation_matrix(vectors), wanted, atol=1e-5)
    assert vectors.norm(dim=1).max() <= np.pi + 1e-6
    assert (vectors.norm(dim=1) > 0.9 * np.pi).any()
    axis = torch.nn.functional.normalize(torch.randn(500, 3, generator=random).double(), dim=1)
    for angle in (0.0, 1e-4, np.pi - 1e-3, np.pi):
        half = torch.full((500, 1), angle / 2, dtype=torch.float64)
        turn = torch.cat([half.cos(), half.sin() * axis], dim=1)
        found = axis_angle_between(turn, torch.tensor([[1.0, 0.0, 0.0, 0.0]], dtype=torch.float64).expand(500, 4))
        assert torch.allclose(rotation_matrix(found), rotation_matrix(axis * angle), atol=1e-6), angle


def test_a_recipe_that_makes_other_parts_is_refused(tmp_path: Path) -> None:
    class Renamed(ToyBlueprint):
        @property
        def parts(self) -> tuple[str, ...]:
            return tuple(f"other_{k}" for k in range(self.blocks))

    data = ToyDataset(blueprints=(Renamed(seed=0, blocks=3, order=(0, 1, 2)),))
    with pytest.raises(InputError, match="makes other parts"):
        make_cache(data, tmp_path, config=CONFIG)
    assert list(tmp_path.iterdir()) == []


def test_splits_are_limited_over_all_families_and_to_what_is_proven(tmp_path: Path) -> None:
    order = (0, 1, 2)
    blueprints = [
        ToyBlueprint(seed=seed, blocks=3, order=order, family=family, complete=seed % 2 == 0)
        for family in ("a", "b", "c")
        for seed in range(8)
    ]
    cache = make_cache(ToyDataset(blueprints=tuple(blueprints)), tmp_path, config=CONFIG)
    some = cache.split("train", limit=12)
    assert len(some) == 12
    assert {cache.families[k] for k in some} == {"a", "b", "c"}
    assert (np.diff(some) > 0).all()
    proven = cache.split("train", complete=True)
    assert len(proven) == 12
    assert all(blueprints[k].complete for k in proven)


def test_an_unknown_split_is_named(cache: CloudCache) -> None:
    with pytest.raises(InputError, match="no split 'tset'"):
        cache.split("tset")
