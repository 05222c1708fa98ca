"""Training by proximal policy optimisation (stable-baselines3); needs the extra ``rl``.

A run is a row of rounds, each a rollout from new episodes and an update. All that is random in a round follows from its
number, so a run of so many steps that was killed and resumed is the uninterrupted one, on the same machine.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.distributions import CategoricalDistribution, Distribution
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import DummyVecEnv
from torch import Tensor

from sashimono.errors import InputError
from sashimono.files import atomic_write
from sashimono.learning.baselines.episode import Bench
from sashimono.learning.baselines.picker import Picker, PickerConfig, PpoConfig
from sashimono.learning.baselines.rl_env import AssemblySequence
from sashimono.learning.config_files import TrainConfig, to_values
from sashimono.learning.schedule import step_seed
from sashimono.learning.train import CHECKPOINT, WEIGHTS, Clock, LogWriter, Row, Trained
from sashimono.learning.weights import write_weights

SLOWEST = 0.1
"""Learning rate at the end over that at the beginning; it falls linearly."""

log = logging.getLogger(__name__)


class PickerPolicy(ActorCriticPolicy):
    """`Picker` as stable-baselines3 wants a policy: logits of all steps, and a value, from one network."""

    def __init__(self, *arguments: Any, picker: PickerConfig, **options: Any) -> None:
        self._config = picker
        super().__init__(*arguments, **options)

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        self.picker = Picker(self._config)
        self.optimizer = torch.optim.AdamW(self.picker.parameters(), lr=lr_schedule(1), weight_decay=1e-4, eps=1e-5)

    def forward(self, obs: Any, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Return steps (B,), values (B, 1) and log-probabilities of the steps (B,)."""
        said, values = self._said(obs)
        actions = said.get_actions(deterministic=deterministic)
        return actions, values, said.log_prob(actions)

    def evaluate_actions(self, obs: Any, actions: Tensor) -> tuple[Tensor, Tensor, Tensor | None]:
        """Return values (B, 1), log-probabilities of these steps (B,) and entropies (B,)."""
        said, values = self._said(obs)
        return values, said.log_prob(actions), said.entropy()

    def get_distribution(self, obs: Any) -> Distribution:
        """Return the distribution over steps."""
        return self._said(obs)[0]

    def predict_values(self, obs: Any) -> Tensor:
        """Return values (B, 1)."""
        return self._said(obs)[1]

    def _said(self, obs: Mapping[str, Tensor]) -> tuple[Distribution, Tensor]:
        logits, values = self.picker(obs)
        found = CategoricalDistribution(int(logits[0].numel())).proba_distribution(logits.flatten(1))
        return found, values[:, None]


def train_ppo(
    config: TrainConfig,
    bench: Bench,
    out: Path,
    *,
    device: str = "cpu",
    minutes: float | None = None,
    clock: Clock = time.perf_counter,
    start: Mapping[str, Tensor] | None = None,
    card: Mapping[str, Any] | None = None,
    report: Callable[[Row], None] = lambda row: None,
) -> Trained:
    """Train, from the newest checkpoint in ``out`` if there is one, and return what came of it.

    Writes ``checkpoint.pt``, ``log.csv`` and ``weights.npz`` into ``out``; each is whole at every moment. Steps are
    those of the environment, and are counted as states.

    Args:
        config: The run; of the kind ``ppo``.
        bench: Blueprints to train on.
        out: Folder to write into.
        device: Where the network is.
        minutes: Train that long, whatever the steps; the learning rate follows the clock.
        clock: What ``minutes`` are counted by, in seconds.
        start: Weights to begin with.
        card: What else the weights' card says.
        report: Called with each line of the log.

    Raises InputError if the checkpoint is of another run.
    """
    out.mkdir(parents=True, exist_ok=True)
    model = make_ppo(config, bench, device=device)
    policy = model.policy
    assert isinstance(policy, PickerPolicy)
    if start is not None:
        policy.picker.load_state_dict(dict(start))
    steps, before = _restored(out / CHECKPOINT, config, policy, device)
    ppo = config.model.ppo
    size = ppo.envs * ppo.rollout
    writer = LogWriter(out, steps)
    begun = saved = time.perf_counter()
    clock_begun = clock()
    first, row = steps, {"loss": float("nan")}

    def passed() -> float:
        return before + (clock() - clock_begun) / 60

    def over() -> float:
        return steps / config.steps if minutes is None else passed() / minutes

    def save() -> None:
        content = {
            "config": to_values(config),
            "model": policy.picker.state_dict(),
            "optimizer": policy.optimizer.state_dict(),
            "done": {"steps": steps, "minutes": passed()},
        }
        with atomic_write(out / CHECKPOINT) as scratch:
            torch.save(content, scratch)
        done = {"steps": steps, "states": steps, "minutes": round(passed(), 3)}
        write_weights(out / WEIGHTS, config, policy.picker.state_dict(), {**(card or {}), **done})

    while (progress := over()) < 1.0:
        rate = config.optimizer.rate * (1 - (1 - SLOWEST) * progress)
        row = _round(model, config, steps // size, rate, steps)
        steps += size
        now = time.perf_counter()
        speed = (steps - first) / (now - begun)
        line = {"step": steps, "minutes": round(passed(), 4), "states": steps, "states_per_second": round(speed, 1)}
        row = {**line, "rate": rate, **row}
        if steps // config.log_every > (steps - size) // config.log_every:
            writer.write(row)
            report(row)
        if now - saved > config.checkpoint_seconds:
            save()
            saved = now
    save()
    writer.close()
    seconds = max(time.perf_counter() - begun, 1e-9)
    return Trained(
        steps=steps,
        states=steps,
        minutes=passed(),
        states_per_second=(steps - first) / seconds,
        outside=0.0,
        loss=float(row["loss"]),
        weights=out / WEIGHTS,
    )


def make_ppo(config: TrainConfig, bench: Bench, *, device: str = "cpu") -> PPO:
    """Return stable-baselines3's PPO on environments of this bench, with a new network of the configuration's seed."""
    ppo: PpoConfig = config.model.ppo

    def make() -> Monitor:
        env = AssemblySequence(
            bench=bench,
            points=config.batch.part_points,
            target_points=config.batch.target_points,
            retries=ppo.retries,
            episodes=ppo.episodes,
        )
        return Monitor(env)

    model = PPO(
        PickerPolicy,
        DummyVecEnv([make for _ in range(ppo.envs)]),
        learning_rate=config.optimizer.rate,
        n_steps=ppo.rollout,
        batch_size=min(ppo.batch, ppo.envs * ppo.rollout),
        n_epochs=ppo.epochs,
        gamma=ppo.discount,
        gae_lambda=ppo.smoothing,
        clip_range=ppo.clip,
        ent_coef=ppo.entropy,
        vf_coef=ppo.value,
        max_grad_norm=config.optimizer.clip,
        target_kl=ppo.target_kl,
        policy_kwargs={"picker": config.model},
        device=device,
        seed=config.seed,
    )
    model.set_logger(Logger(folder=None, output_formats=[]))
    return model


def _round(model: PPO, config: TrainConfig, number: int, rate: float, steps: int) -> Row:
    """Do a rollout from new episodes, and an update; return what the log says of them."""
    ppo: PpoConfig = config.model.ppo
    model.set_random_seed(step_seed(config.seed, number, 0) % 2**31)
    model.lr_schedule = lambda _: rate
    model.num_timesteps = steps
    model._last_obs = None  # new episodes
    model.ep_info_buffer = model.ep_success_buffer = None
    model.logger.name_to_value.clear()
    # its annotation leaves out None, which its code takes for "never"
    never: Any = None
    model.learn(ppo.envs * ppo.rollout, reset_num_timesteps=False, log_interval=never)
    said = model.logger.name_to_value
    episodes, whole = list(model.ep_info_buffer or []), list(model.ep_success_buffer or [])
    return {
        "loss": float(said["train/loss"]),
        "reward": float(np.mean([episode["r"] for episode in episodes])) if episodes else float("nan"),
        "length": float(np.mean([episode["l"] for episode in episodes])) if episodes else float("nan"),
        "whole": float(np.mean(whole)) if whole else float("nan"),
        "entropy": -float(said["train/entropy_loss"]),
        "kl": float(said["train/approx_kl"]),
        "explained": float(said["train/explained_variance"]),
    }


def _restored(path: Path, config: TrainConfig, policy: PickerPolicy, device: str) -> tuple[int, float]:
    """Load a checkpoint, if there is one; return steps and minutes so far."""
    if not path.exists():
        return 0, 0.0
    saved = torch.load(path, map_location=device, weights_only=True)
    asked, had = to_values(config), saved["config"]
    changed = [name for name in ("kind", "model", "batch", "seed") if asked[name] != had[name]]
    if changed:
        raise InputError(f"{path} is of a run with another {changed[0]}. Choose another folder, or that configuration.")
    policy.picker.load_state_dict(saved["model"])
    policy.optimizer.load_state_dict(saved["optimizer"])
    log.info("goes on from step %d of %s", saved["done"]["steps"], path)
    return int(saved["done"]["steps"]), float(saved["done"]["minutes"])
