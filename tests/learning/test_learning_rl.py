"""The assembly game: right steps by brute force, Gymnasium's checker, a policy trained, resumed and judged."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from learning_toy import ToyDataset, toy_dataset

from sashimono.cli import run
from sashimono.d4pas.states import is_right_order, right_next
from sashimono.errors import InputError
from sashimono.learning.baselines.ata import simulate
from sashimono.learning.baselines.episode import RIGHT, WHOLE, WRONG, Bench, Episode, make_bench
from sashimono.learning.baselines.ways import AXES, Ways, find_ways, is_right_step
from sashimono.learning.cloud_cache import CloudCache, CloudConfig, make_cache
from sashimono.learning.evaluate import evaluate, over_seeds, read_evaluation

torch = pytest.importorskip("torch", reason="the train extra is not installed")
torch.set_num_threads(1)  # tiny models: more threads only wait for one another

needs_rl = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("gymnasium", "stable_baselines3")),
    reason="the rl extra is not installed",
)
CLOUDS = CloudConfig(part_points=32, blueprint_points=64, states=16)

TINY = """
kind = "ppo"
log_every = 32

[model]
widths = [16]
hidden = 16
blocks = 1
heads = 2

[model.ppo]
envs = 4
rollout = 8
batch = 16
epochs = 2

[batch]
part_points = 16
target_points = 24

[optimizer]
rate = 0.002
"""


@pytest.fixture(scope="module")
def data() -> ToyDataset:
    return toy_dataset(12)


@pytest.fixture(scope="module")
def cache(data: ToyDataset, tmp_path_factory: pytest.TempPathFactory) -> CloudCache:
    return make_cache(data, tmp_path_factory.mktemp("cache"), config=CLOUDS)


@pytest.fixture(scope="module")
def bench(data: ToyDataset, cache: CloudCache) -> Bench:
    return make_bench(cache, data, np.arange(len(cache)))


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny-ppo.toml"
    path.write_text(TINY, encoding="utf-8")
    return path


def downward(ways: Ways, part: int) -> int:
    return int(np.argmin(ways.axes[part] @ [0.0, 0.0, 1.0]))


def test_a_block_goes_onto_a_pile_from_above_and_from_the_sides(data: ToyDataset) -> None:
    for blueprint in data.blueprints[:3]:
        ways = find_ways(blueprint.assembly())
        assert np.linalg.norm(ways.axes, axis=2) == pytest.approx(1.0)
        assert ways.axes[:, ::2] == pytest.approx(-ways.axes[:, 1::2])
        lowest, second, *_ = blueprint.order
        assert ways.open(lowest, 0) == tuple(range(AXES))  # nothing there yet
        down = downward(ways, second)
        assert ways.open(second, 1 << lowest) == tuple(axis for axis in range(AXES) if axis != down ^ 1)
        # seen from below: the lowest block comes under the pile from anywhere but above
        assert downward(ways, lowest) not in ways.open(lowest, 1 << second)


def test_an_axis_is_not_asked_for_where_no_straight_way_is_open() -> None:
    ways = Ways(axes=np.zeros((1, AXES, 3)), blockers=(((0b10,), (0b100, 0b1000), (), (), (), ()),))
    assert ways.open(0, 0b100) == (0, 1)
    assert ways.open(0, 0b10) == (1,)
    assert [ways.allows(0, axis, 0b10) for axis in range(3)] == [False, True, False]
    assert ways.open(0, 0b1110) == ()
    assert all(ways.allows(0, axis, 0b1110) for axis in range(AXES))


def test_ways_are_found_once(data: ToyDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = make_cache(data, tmp_path, config=CLOUDS)
    one = make_bench(made, data, [0, 1])
    monkeypatch.setattr("sashimono.learning.baselines.ways.find_ways", lambda assembly: pytest.fail("found again"))
    two = make_bench(made, data, [1])
    assert two.ways[1].blockers == one.ways[1].blockers
    assert np.array_equal(two.ways[1].axes, one.ways[1].axes)


def test_steps_are_right_by_the_exact_conditions_and_the_axis(bench: Bench) -> None:
    for row in bench.rows[:6].tolist():
        masks, ways = bench.masks[row], bench.ways[row]
        for state in range(1 << len(masks)):
            game = Episode(masks, ways)
            game.placed = state
            for part in range(len(masks)):
                wanted = bool(right_next(masks, state) >> part & 1)
                for axis in range(AXES):
                    right = wanted and (axis in ways.open(part, state) or not ways.open(part, state))
                    assert game.is_right(part, axis) == right == is_right_step(masks, ways, state, part, axis)
        assert not Episode(masks, ways).is_right(len(masks), 0)


def test_a_strict_episode_ends_at_the_first_wrong_step_and_others_go_on(bench: Bench) -> None:
    row = int(bench.rows[0])
    masks, ways = bench.masks[row], bench.ways[row]
    right = [
        (part, axis) for part in range(len(masks)) for axis in range(AXES) if Episode(masks, ways).is_right(part, axis)
    ]
    wrong = next((part, 0) for part in range(len(masks)) if not right_next(masks, 0) >> part & 1)
    strict = Episode(masks, ways)
    assert strict.step(*wrong) == WRONG
    assert strict.is_over
    assert not strict.is_whole
    patient = Episode(masks, ways, retries=1)
    patient.step(*wrong)
    assert not patient.is_over
    assert patient.tried.sum() == patient.tried[wrong] == 1
    assert patient.step(*right[0]) == RIGHT
    assert patient.tried.sum() == 0
    rewards = []
    while not patient.is_over:
        rewards.append(
            patient.step(*next((p, a) for p in range(len(masks)) for a in range(AXES) if patient.is_right(p, a)))
        )
    assert patient.is_whole
    assert rewards == [RIGHT] * (len(masks) - 2) + [RIGHT + WHOLE]


@needs_rl
def test_the_environment_passes_gymnasiums_checker(bench: Bench) -> None:
    import gymnasium
    from gymnasium.utils.env_checker import check_env

    name = "sashimono.learning.baselines.rl_env:sashimono/AssemblySequence-v0"
    for retries in (0, 2):
        env = gymnasium.make(name, bench=bench, retries=retries, points=16, target_points=24, render_mode="ansi")
        check_env(env.unwrapped)
        env.reset(seed=0)
        assert isinstance(env.render(), str)
        env.close()


@needs_rl
def test_the_environment_shows_the_product_and_plays_it(bench: Bench, data: ToyDataset) -> None:
    from sashimono.learning.baselines.rl_env import AssemblySequence

    env = AssemblySequence(bench=bench, slots=9, points=16, target_points=24)
    blueprint = data.blueprints[2]
    seen, info = env.reset(seed=0, options={"blueprint": blueprint.id})
    assert info["id"] == blueprint.id
    count = len(blueprint.parts)
    assert seen["remaining"].tolist() == [1] * count + [0] * (9 - count)
    assert not seen["parts"][count:].any()
    ways, total, over = bench.ways[2], 0.0, False
    for part in blueprint.order:
        assert not over
        seen, reward, over, cut, info = env.step(AXES * part + ways.open(part, sum(1 << p for p in info["order"]))[0])
        assert info["right"]
        assert seen["placed"].sum() == len(info["order"])
        total += reward
        assert not cut
    assert over
    assert info["is_success"]
    assert total == count * RIGHT + WHOLE
    env.reset(options={"blueprint": blueprint.id})
    seen, reward, over, _, info = env.step(AXES * 8)  # an empty slot
    assert (reward, over, info["is_success"]) == (WRONG, True, False)
    with pytest.raises(InputError, match="no blueprint"):
        env.reset(options={"blueprint": "none"})
    with pytest.raises(InputError, match="2 slots"):
        AssemblySequence(bench=bench, slots=2)
    with pytest.raises(InputError, match="cache=FOLDER"):
        AssemblySequence()


@needs_rl
def test_a_blueprint_stays_for_so_many_episodes(bench: Bench) -> None:
    from sashimono.learning.baselines.rl_env import AssemblySequence

    env = AssemblySequence(bench=bench, points=8, target_points=8, episodes=3)
    ids = [env.reset(seed=1)[1]["id"], *(env.reset()[1]["id"] for _ in range(29))]
    assert all(len(set(ids[k : k + 3])) == 1 for k in range(0, 30, 3))
    assert len(set(ids)) > 2
    assert ids[:4] == [env.reset(seed=1)[1]["id"], *(env.reset()[1]["id"] for _ in range(3))]


def picker(**options: Any) -> Any:
    from sashimono.learning.baselines.picker import Picker, PickerConfig

    torch.manual_seed(0)
    return Picker(PickerConfig(widths=(16,), hidden=16, blocks=1, heads=2, **options)).eval()


@needs_rl
def test_the_policy_does_not_depend_on_slots_on_order_or_on_what_it_is_asked_with(bench: Bench) -> None:
    from sashimono.learning.baselines.picker import as_observation
    from sashimono.learning.baselines.rl_env import AssemblySequence

    model = picker()
    alone, together = [], []
    for slots in (5, 7):
        env = AssemblySequence(bench=bench, slots=slots, points=16, target_points=24)
        for blueprint in ("pile-000000", "pile-000002", "pile-000001", "pile-000002"):
            seen, _ = env.reset(options={"blueprint": blueprint})
            if slots == 7:
                together.append(seen)
            alone.append(model(as_observation({name: array[None] for name, array in seen.items()})))
    logits, values = model(as_observation({name: np.stack([s[name] for s in together]) for name in together[0]}))
    for k in range(4):
        for other in (alone[k], alone[4 + k]):
            assert torch.allclose(other[0][0], logits[k, : other[0].shape[1]], atol=1e-5)
            assert torch.allclose(other[1][0], values[k], atol=1e-5)
    swapped = {name: array.copy() for name, array in together[0].items()}
    for name in ("parts", "axes"):
        swapped[name][[0, 1]] = swapped[name][[1, 0]]
    other, _ = model(as_observation({name: array[None] for name, array in swapped.items()}))
    assert torch.allclose(other[0, [1, 0, 2]], logits[0, :3], atol=1e-5)
    assert (logits[0, 3:] < -1e8).all()  # empty slots


def test_a_policy_is_three_methods_that_agree(bench: Bench, data: ToyDataset, cache: CloudCache) -> None:
    """With retries without end each game is won; a strict game is won only if the order of its parts is right."""
    from sashimono.learning.baselines.playing import PickerPredictor, playing_rows
    from sashimono.learning.batch import BatchConfig

    model, batch = picker(), BatchConfig(part_points=16, target_points=24)
    rows = playing_rows("rl-0", model, bench, batch, "cpu")
    assert list(rows) == ["rl-0", "rl-0-axes", "rl-0-retries"]
    found = {
        name: evaluate(name, method, data, cache, np.arange(len(cache)), states=4, timed=2)
        for name, method in rows.items()
    }
    won = {name: [record.sequence for record in evaluation.records] for name, evaluation in found.items()}
    assert all(b <= a for a, b in zip(won["rl-0-retries"], won["rl-0-axes"], strict=True))
    assert found["rl-0"].overall["argmax"] == found["rl-0-axes"].overall["argmax"]
    patient = PickerPredictor(model=model, bench=bench, batch=batch, retries=1000)
    assert evaluate("patient", patient, data, cache, np.arange(6)).overall["sequence"].value == 1.0
    encoded = patient.encode(np.array([0, 1]))
    said = patient.probabilities(encoded, np.array([[0b001], [0b011]]))
    assert said.sum(axis=2) == pytest.approx(1.0)
    assert said[0, 0, 0] == 0.0


def test_seeds_are_summed_up_as_mean_and_spread(bench: Bench, data: ToyDataset, cache: CloudCache) -> None:
    from sashimono.learning.evaluate import heuristics

    methods = [heuristics(cache, seed=seed)["random"] for seed in range(3)]
    each = [evaluate("random", method, data, cache, np.arange(len(cache))) for method in methods]
    both = over_seeds("random", each)
    values = np.array([evaluation.overall["argmax"].value for evaluation in each])
    interval = both.overall["argmax"]
    assert interval.value == pytest.approx(values.mean())
    assert interval.high - interval.low == pytest.approx(2 * values.std(ddof=1))
    assert len(both.records) == 3 * len(each[0].records)
    assert over_seeds("one", each[:1]).overall == each[0].overall


def test_assemble_them_all_is_judged_and_timed(data: ToyDataset, cache: CloudCache) -> None:
    """Without a tube around the pile it may pull blocks out sideways: all parts leave, not always in a right order."""
    method = simulate(cache, data, [0, 1], seconds=3600.0)
    found = evaluate("ata", method, data, cache, np.arange(2))
    orders = method.encode(np.arange(2))
    assert [sorted(order) for order in orders] == [list(range(len(data.blueprints[k].parts))) for k in range(2)]
    for k, record in enumerate(found.records):
        assert record.sequence == is_right_order(data.blueprints[k].masks, orders[k])
    said = method.probabilities(orders, np.array([[0], [0]]))
    assert [int(said[k, 0].argmax()) for k in range(2)] == [order[0] for order in orders]
    assert set(found.milliseconds) == {"median", "90 %", "mean"}
    again = simulate(cache, data, [0, 1], seconds=3600.0)
    assert again.found == method.found, "times to the last digit: nothing is simulated twice"


def test_assemble_them_all_stops_in_time_and_stays_in_the_denominator(data: ToyDataset, cache: CloudCache) -> None:
    method = simulate(cache, data, [0, 1, 2], seconds=1e-4)
    found = evaluate("ata", method, data, cache, np.arange(3))
    assert found.overall["blueprints"].value == 3
    assert found.overall["sequence"].value == found.overall["argmax"].value == 0.0
    assert found.milliseconds["median"] >= 0.1


@needs_rl
def test_a_killed_run_goes_on_bit_for_bit(bench: Bench, tiny: Path, tmp_path: Path) -> None:
    from sashimono.learning.baselines.ppo import train_ppo
    from sashimono.learning.config_files import read_config

    class Killed(Exception):
        """Stands for a process that is killed."""

    def kill(row: dict[str, Any]) -> None:
        if row["step"] == 96:
            raise Killed

    config = read_config(tiny, steps=128, checkpoint_seconds=0.0)
    whole = train_ppo(config, bench, tmp_path / "whole")
    with pytest.raises(Killed):  # in the third round, when the last checkpoint is of the second
        train_ppo(config, bench, tmp_path / "parts", report=kill)
    assert torch.load(tmp_path / "parts" / "checkpoint.pt", weights_only=True)["done"]["steps"] == 64
    resumed = train_ppo(config, bench, tmp_path / "parts")
    assert resumed.steps == whole.steps == 128
    one, two = (torch.load(tmp_path / name / "checkpoint.pt", weights_only=True) for name in ("whole", "parts"))
    for name, value in one["model"].items():
        assert torch.equal(value, two["model"][name]), name
    lines = [(tmp_path / name / "log.csv").read_text().splitlines() for name in ("whole", "parts")]
    assert len(lines[0]) == len(lines[1]) == 5
    with pytest.raises(InputError, match="another seed"):
        train_ppo(read_config(tiny, steps=160, seed=1), bench, tmp_path / "parts")


@needs_rl
def test_policies_are_trained_and_evaluated_by_command(tiny: Path, tmp_path: Path, data: ToyDataset) -> None:
    from sashimono.learning.commands import evaluate_command, train_command

    said: list[str] = []
    shared: dict[str, Any] = {"data": lambda: data, "clouds": CLOUDS, "cache": tmp_path / "clouds", "say": said.append}
    for seed in (0, 1):
        assert train_command(str(tiny), tmp_path / f"rl-{seed}", steps=32, seed=seed, device="cpu", **shared) == 0
    models = [tmp_path / f"rl-{seed}" / "weights.npz" for seed in (0, 1)]
    options: dict[str, Any] = {"splits": ("val",), "timed": 1, "states": 2, "ata": 60.0, "device": "cpu"}
    assert evaluate_command(models, tmp_path / "figures", **options, **shared) == 0
    kinds = {f"rl{seed}{kind}" for seed in ("", "-0", "-1") for kind in ("", "-axes", "-retries")}
    names = {path.stem for path in (tmp_path / "figures").glob("*.json")}
    assert names == kinds | {"ata", "random", "inside-out", "rule"}
    table = next(text for text in said if text.startswith("| method"))
    assert "| rl |  | 63.9 |" in table
    assert "| ata |  |  | 24313.0 |" in table
    both = read_evaluation(tmp_path / "figures" / "rl-retries.json").overall["sequence"].value
    each = [json.loads((tmp_path / "figures" / f"rl-{k}-retries.json").read_text()) for k in (0, 1)]
    assert both == pytest.approx(np.mean([e["overall"]["sequence"]["value"] for e in each]))


def test_without_the_extra_one_line_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "gymnasium" else real(name, *rest)
    )
    assert run(["train", "ppo", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "pip install 'sashimono[rl]'" in said[0]


def test_evaluate_wants_something_to_evaluate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["evaluate", "--out", str(tmp_path / "out")]) == 2
    assert "--ata SECONDS" in capsys.readouterr().err


@needs_rl
def test_a_campaign_refuses_a_policy() -> None:
    from sashimono.learning.campaign import Entry

    with pytest.raises(InputError, match="sashimono train ppo"):
        Entry(config="ppo").read()


@needs_rl
@pytest.mark.slow
def test_piles_are_learned(data: ToyDataset, cache: CloudCache, bench: Bench, tiny: Path, tmp_path: Path) -> None:
    """Far better than at random on the piles that it was trained on, in a minute or two."""
    from sashimono.learning.baselines.playing import playing_rows
    from sashimono.learning.baselines.ppo import train_ppo
    from sashimono.learning.config_files import read_config
    from sashimono.learning.weights import load_model, read_weights

    tiny.write_text(TINY.replace("rollout = 8", "rollout = 64").replace("batch = 16", "batch = 64"), encoding="utf-8")
    config = read_config(tiny, steps=60_000)
    train_ppo(config, bench, tmp_path / "run")
    model: Any = load_model(read_weights(tmp_path / "run" / "weights.npz"))
    rows = playing_rows("rl-0", model, bench, config.batch, "cpu")
    found = evaluate("rl-0-axes", rows["rl-0-axes"], data, cache, np.arange(len(cache)))
    assert found.overall["sequence"].value > 0.7
