"""Training: resumed bit for bit, shared among processes, rehearsed as a campaign; configurations are strict."""

from __future__ import annotations

import csv
import json
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from learning_toy import toy_dataset

from sashimono.errors import InputError
from sashimono.learning.cloud_cache import CloudCache, CloudConfig, make_cache

torch = pytest.importorskip("torch", reason="the train extra is not installed")
torch.set_num_threads(1)  # tiny models: more threads only wait for one another

from sashimono.learning.campaign import read_campaign  # noqa: E402
from sashimono.learning.commands import campaign_command, evaluate_command, train_command  # noqa: E402
from sashimono.learning.config_files import TrainConfig, config_of, read_config, to_values  # noqa: E402
from sashimono.learning.devices import Place  # noqa: E402
from sashimono.learning.registry import shipped_configs  # noqa: E402
from sashimono.learning.schedule import BatchOrder, one_cycle, step_seed  # noqa: E402
from sashimono.learning.train import Trained, train  # noqa: E402
from sashimono.learning.weights import load_model, make_model, read_weights, write_weights  # noqa: E402

CLOUDS = CloudConfig(part_points=48, blueprint_points=64, states=8)

TINY = """
kind = "past"
log_every = 2

[model]
hidden = 16
blocks = 1
heads = 2
expansion = 2
dropout = 0.1

[model.encoder]
widths = [8, 16]
neighbours = 4

[batch]
blueprints = 4
states = 2
part_points = 24
target_points = 32
local = true
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> CloudCache:
    return make_cache(toy_dataset(12), tmp_path_factory.mktemp("cache"), config=CLOUDS)


@pytest.fixture
def tiny(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY, encoding="utf-8")
    return path


def run(config: TrainConfig, cache: CloudCache, out: Path, **options: Any) -> Trained:
    return train(config, cache, out, place=Place(device="cpu"), **options)


def rows_of(out: Path) -> list[dict[str, str]]:
    with (out / "log.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    timed = ("minutes", "states_per_second", "outside")
    return [{name: value for name, value in row.items() if name not in timed} for row in rows]


class Killed(Exception):
    """Stands for a process that is killed."""


def test_a_killed_run_goes_on_bit_for_bit(cache: CloudCache, tiny: Path, tmp_path: Path) -> None:
    config = read_config(tiny, steps=8, checkpoint_seconds=0.0)
    whole = run(config, cache, tmp_path / "whole")

    def kill(row: dict[str, Any]) -> None:
        if row["step"] == 6:
            raise Killed

    with pytest.raises(Killed):  # at step 6, when the last checkpoint is of step 5
        run(config, cache, tmp_path / "parts", report=kill)
    saved = torch.load(tmp_path / "parts" / "checkpoint.pt", weights_only=True)
    assert saved["done"]["step"] == 5
    resumed = run(config, cache, tmp_path / "parts")
    assert resumed.steps == whole.steps == 8
    assert resumed.states == whole.states == 8 * 8
    one, two = (torch.load(tmp_path / name / "checkpoint.pt", weights_only=True) for name in ("whole", "parts"))
    for part in ("model", "average"):
        for name, value in one[part].items():
            assert torch.equal(value, two[part][name]), (part, name)
    for key, state in one["optimizer"]["state"].items():
        for name, value in state.items():
            assert torch.equal(value, two["optimizer"]["state"][key][name]), (key, name)
    assert not torch.equal(one["model"]["norm_parts.weight"], one["average"]["norm_parts.weight"])
    # the line of steps 5 and 6 is a mean over both: only its last step was run again
    assert [row["step"] for row in rows_of(tmp_path / "whole")] == ["2", "4", "6", "8"]
    assert rows_of(tmp_path / "parts")[-1] == rows_of(tmp_path / "whole")[-1]


def test_another_configuration_does_not_go_on(cache: CloudCache, tiny: Path, tmp_path: Path) -> None:
    config = read_config(tiny, steps=1)
    run(config, cache, tmp_path / "run")
    other = replace(config, steps=2, batch=replace(config.batch, states=1))
    with pytest.raises(InputError, match="another batch"):
        run(other, cache, tmp_path / "run")


def test_weights_keep_half_precision_and_their_configuration(cache: CloudCache, tiny: Path, tmp_path: Path) -> None:
    config = read_config(tiny, steps=2)
    done = run(config, cache, tmp_path / "run", card={"data": "toy"})
    weights = read_weights(done.weights)
    assert weights.config == config
    assert weights.card["data"] == "toy"
    assert weights.card["steps"] == 2
    average = torch.load(tmp_path / "run" / "checkpoint.pt", weights_only=True)["average"]
    assert weights.state.keys() == average.keys()
    for name, value in weights.state.items():
        assert torch.allclose(value, average[name], rtol=1e-3, atol=1e-6), name
    model = load_model(weights)
    assert not model.training
    # begun with them, a run is where they are
    again = run(replace(config, steps=1), cache, tmp_path / "again", start=weights.state)
    moved = read_weights(again.weights).state
    fresh = make_model(config).state_dict()
    far = sum(float((moved[name] - fresh[name]).norm()) for name in moved)
    near = sum(float((moved[name] - weights.state[name]).norm()) for name in moved)
    assert near < 0.5 * far


def test_large_weights_go_into_several_files(tiny: Path, tmp_path: Path) -> None:
    config = read_config(tiny)
    state = make_model(config).state_dict()
    path = tmp_path / "big.npz"
    write_weights(path, config, state, {"steps": 1}, most=4000)
    assert {"big.npz", "big.2.npz", "big.3.npz"} <= {file.name for file in tmp_path.iterdir()}
    assert max(file.stat().st_size for file in tmp_path.glob("big*.npz")) < 25_000
    weights = read_weights(path)
    assert list(weights.state) == list(state)
    assert all(torch.equal(value, state[name].half().float()) for name, value in weights.state.items())
    with pytest.raises(InputError, match="name the first"):
        read_weights(tmp_path / "big.2.npz")
    kept = (tmp_path / "big.2.npz").read_bytes()
    write_weights(path, config, state, {"steps": 2}, most=4000)
    (tmp_path / "big.2.npz").write_bytes(kept)
    with pytest.raises(InputError, match="another moment"):
        read_weights(path)


def test_minutes_end_a_run_and_its_cycle(cache: CloudCache, tiny: Path, tmp_path: Path) -> None:
    config = read_config(tiny, log_every=10_000)
    done = run(config, cache, tmp_path / "run", minutes=0.02)
    assert done.minutes >= 0.02
    assert done.steps >= 1
    rates = [float(row["rate"]) for row in rows_of(tmp_path / "run")]
    assert rates == pytest.approx([config.optimizer.rate * config.optimizer.end])


def test_a_file_that_is_no_weights_is_named(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", a=np.zeros(2))
    for name in ("other.npz", "none.npz"):
        with pytest.raises(InputError, match=name):
            read_weights(tmp_path / name)


def test_the_rate_goes_up_and_down_once() -> None:
    config = config_of({"name": "x", "kind": "past"}, "test").optimizer
    rates = np.array([one_cycle(x, config) for x in np.linspace(0, 1, 101)])
    assert rates[0] == pytest.approx(config.rate * config.start)
    assert rates.argmax() == 10
    assert rates.max() == pytest.approx(config.rate)
    assert rates[-1] == pytest.approx(config.rate * config.end)
    assert (np.diff(rates[10:]) < 0).all()


def test_an_epoch_has_each_blueprint_once_and_little_padding() -> None:
    rng = np.random.default_rng(0)
    counts = rng.integers(2, 30, 640)
    order = BatchOrder(blueprints=np.arange(1000, 1640), counts=counts, size=16, seed=3)
    first, second = ([order.batch(epoch * 40 + k) for k in range(40)] for epoch in (0, 1))
    assert sorted(np.concatenate(first).tolist()) == list(range(1000, 1640))
    assert sorted(np.concatenate(second).tolist()) == list(range(1000, 1640))
    assert not np.array_equal(first, second)
    padding = np.mean([1 - counts[rows - 1000].mean() / counts[rows - 1000].max() for rows in first])
    assert padding < 0.15
    sizes = np.array([counts[rows - 1000].mean() for rows in first])
    assert abs(np.corrcoef(sizes[1:], sizes[:-1])[0, 1]) < 0.4, "batches are shuffled after sorting"


def test_fewer_blueprints_than_a_batch_are_repeated() -> None:
    order = BatchOrder(blueprints=np.arange(3), counts=np.array([2, 3, 4]), size=8, seed=0)
    assert sorted(set(order.batch(0).tolist())) == [0, 1, 2]
    assert len(order.batch(5)) == 8


def test_steps_and_processes_have_seeds_of_their_own() -> None:
    seeds = {step_seed(seed, step, rank) for seed in range(3) for step in range(50) for rank in range(3)}
    assert len(seeds) == 450
    assert all(0 <= seed < 2**63 for seed in seeds)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('kind = "none"', "no kind of model 'none'"),
        ("steps = 3", "kind is missing"),
        ('kind = "past"\nstep = 3', "no field 'step'"),
        ('kind = "past"\n[model]\nhiden = 3', "no field 'hiden'"),
        ('kind = "past"\n[model]\nhidden = "3"', "'3' is no int"),
        ('kind = "past"\n[model]\nauxiliary = "poses"', "'poses' is not one of"),
        ('kind = "past"\n[model.encoder]\nwidths = 3', "a list is wanted"),
        ("kind =", "no TOML"),
    ],
)
def test_configurations_are_strict(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_config(path)


@pytest.mark.parametrize("name", shipped_configs())
def test_shipped_configurations_are_read_and_written(name: str) -> None:
    config = read_config(name)
    assert config.name == name
    assert config_of(json.loads(json.dumps(to_values(config))), "test") == config


@pytest.mark.parametrize("name", ["rehearsal", "gpu", "gpu-past"])
def test_shipped_campaigns_name_shipped_configurations(name: str) -> None:
    for entry in read_campaign(name).model:
        assert entry.read().name == entry.name


def test_a_campaign_goes_on_where_it_ended(tiny: Path, tmp_path: Path) -> None:
    (tmp_path / "other.toml").write_text(TINY.replace("blocks = 1", "blocks = 2"), encoding="utf-8")
    campaign = tmp_path / "campaign.toml"
    entries = "".join(
        f'[[model]]\nconfig = "{tmp_path / name}.toml"\nlane = {k}\n' for k, name in enumerate(("tiny", "other"))
    )
    campaign.write_text(f"evaluated = 2\nstates = 2\n{entries}", encoding="utf-8")
    said: list[str] = []
    out = tmp_path / "out"
    for _ in range(2):
        status = campaign_command(
            str(campaign),
            0.05,
            out,
            data=partial(toy_dataset, 12),
            work=tmp_path / "work",
            device="cpu",
            clouds=CLOUDS,
            say=said.append,
        )
        assert status == 0
        assert sorted(path.name for path in out.iterdir()) == ["log.csv", "other.npz", "results.json", "tiny.npz"]
    card = read_weights(out / "tiny.npz").card
    assert card["states_before"] > 0
    assert card["minutes_before"] > 0
    results = json.loads((out / "results.json").read_text())
    assert {"tiny", "other", "rule", "random", "inside-out"} == set(results["overall"])
    assert any("| tiny |" in line for line in said)
    with (out / "log.csv").open(newline="") as file:
        assert {row["model"] for row in csv.DictReader(file)} == {"tiny", "other"}


def test_a_model_that_fails_leaves_the_others(tiny: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "wide.toml").write_text(TINY.replace("part_points = 24", "part_points = 9999"), encoding="utf-8")
    campaign = tmp_path / "campaign.toml"
    entries = "".join(f'[[model]]\nconfig = "{tmp_path / name}.toml"\n' for name in ("wide", "tiny"))
    campaign.write_text(f"evaluated = 2\nstates = 2\n{entries}", encoding="utf-8")
    out = tmp_path / "out"
    status = campaign_command(
        str(campaign), 0.05, out, data=partial(toy_dataset, 12), work=tmp_path / "work", device="cpu", clouds=CLOUDS
    )
    assert status == 1
    assert "wide failed" in capfd.readouterr().err
    assert sorted(path.name for path in out.iterdir()) == ["log.csv", "results.json", "tiny.npz"]


def test_a_campaign_names_each_model_once(tmp_path: Path) -> None:
    path = tmp_path / "twice.toml"
    path.write_text('[[model]]\nconfig = "past-small"\n[[model]]\nconfig = "past-small"\n', encoding="utf-8")
    with pytest.raises(InputError, match="once"):
        read_campaign(path)
    with pytest.raises(InputError, match="no campaign 'nowhere'"):
        read_campaign("nowhere")


def test_train_then_evaluate_by_command(tiny: Path, tmp_path: Path) -> None:
    said: list[str] = []
    data = partial(toy_dataset, 12)
    status = train_command(
        str(tiny), tmp_path / "run", data=data, steps=4, cache=tmp_path, device="cpu", clouds=CLOUDS, say=said.append
    )
    assert status == 0
    assert said[-1].startswith("4 steps, 32 states")
    status = evaluate_command(
        [tmp_path / "run" / "weights.npz"],
        tmp_path / "figures",
        data=data,
        splits=("val",),
        states=2,
        timed=2,
        cache=tmp_path,
        device="cpu",
        clouds=CLOUDS,
        say=said.append,
    )
    assert status == 0
    stems = [path.stem for path in (tmp_path / "figures").glob("*.json")]
    assert sorted(stems) == ["inside-out", "random", "rule", "weights"]
    evaluate_command(
        [], tmp_path / "figures", data=data, splits=("val",), cache=tmp_path, device="cpu", clouds=CLOUDS
    )  # what was evaluated before is in the table still
    table = (tmp_path / "figures" / "tables.md").read_text(encoding="utf-8")
    assert [line.split(" | ")[0] for line in table.splitlines()[2:6]] == [
        "| random",
        "| inside out",
        "| rule",
        "| weights",
    ]


def test_training_ours_writes_the_network_that_infer_takes(tmp_path: Path) -> None:
    pytest.importorskip("onnx", reason="the train extra is not installed")
    from sashimono.learning.infer import assembly_clouds, infer, load_network

    config = tmp_path / "ours.toml"
    config.write_text(
        'kind = "posed"\nprecision = "fp32"\n[model]\nwidth = 8\nheads = 2\n[batch]\nblueprints = 4\nstates = 2\n'
        'part_points = 1\ntarget_points = 1\nextras = ["paths", "pairs", "lines", "clauses"]\n',
        encoding="utf-8",
    )
    data = partial(toy_dataset, 12)
    train_command(str(config), tmp_path / "run", data=data, steps=2, device="cpu", clouds=CLOUDS)
    network = load_network(tmp_path / "run" / "network")
    blueprint = data().blueprints[0]
    found = infer(blueprint.parts, assembly_clouds(blueprint.assembly(), network.relations), network)
    assert sorted(found.order) == sorted(blueprint.parts)
    # its card learns what it is worth
    options: dict[str, Any] = {"device": "cpu", "clouds": CLOUDS, "states": 2, "timed": 1, "with_heuristics": False}
    weights = tmp_path / "run" / "weights.npz"
    evaluate_command([weights], tmp_path / "figures", data=data, splits=("val",), cache=tmp_path, **options)
    card = json.loads((tmp_path / "run" / "network" / "card.json").read_text(encoding="utf-8"))
    assert card["figures"]["val"]["blueprints"] > 0
    assert 0.0 <= card["figures"]["val"]["sequence"] <= 1.0


@pytest.mark.slow
def test_processes_share_the_batches(tiny: Path, tmp_path: Path) -> None:
    """Two processes under torchrun end with the same weights, and see twice the states."""
    script = tmp_path / "script.py"
    script.write_text(
        f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from functools import partial
from pathlib import Path
from learning_toy import toy_dataset
from sashimono.learning.cloud_cache import CloudConfig
from sashimono.learning.commands import train_command
clouds = CloudConfig(part_points=48, blueprint_points=64, states=8)
train_command({str(tiny)!r}, Path({str(tmp_path / "run")!r}), data=partial(toy_dataset, 12), steps=4, threads=1,
              device="cpu", clouds=clouds)
""",
        encoding="utf-8",
    )
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", str(script)]
    subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
    card = read_weights(tmp_path / "run" / "weights.npz").card
    assert card["steps"] == 4
    assert card["states"] == 4 * 2 * 4 * 2


def test_minutes_of_processor_time_leave_out_what_else_the_machine_does(
    cache: CloudCache, tiny: Path, tmp_path: Path
) -> None:
    seconds = iter(range(100))
    done = run(read_config(str(tiny), steps=10_000), cache, tmp_path / "run", minutes=0.5, clock=lambda: next(seconds))
    assert done.minutes >= 0.5
    assert done.steps < 40
