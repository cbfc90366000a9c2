"""Returns of PPO on ``joshua/Ant-v0`` and of stable-baselines3 on ``Ant-v5``, fifteen seeds each.

Both have the same settings, the same number of steps and one process a seed. Ends with 1 if the median of
our first five seeds is outside the interquartile range of theirs, which five seeds would not determine. A
rank test compares all of our seeds with all of theirs.
Run: python tests/learn/soak_ant.py [STEPS] [PROCESSES]
"""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import gymnasium
import numpy as np
import torch
from joshua.schema import config_pb2 as pb
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer.learner import Learner
from joshua_ppo_trainer.settings import TrainerSettings
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize

SEEDS = range(1, 16)

#: Our seeds whose median is judged.
JUDGED = 5
STEPS = 150_000
ENVIRONMENTS = 16
BATCH, LEARNING_RATE = 256, 3e-4

#: Episodes at the end of the training whose mean return counts.
LAST = 50


def settings(steps: int) -> TrainerSettings:
    """The defaults of the environment, with the few values that the file must give."""
    rl_config = pb.RLConfig(
        algorithm="PPO",
        num_envs=ENVIRONMENTS,
        total_timesteps=steps,
        learning_rate=LEARNING_RATE,
        gamma=0.99,
        batch_size=BATCH,
    )
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=rl_config)
    return TrainerSettings.from_block(block).suitable("joshua/Ant-v0")


def ours(seed: int, steps: int) -> float:
    """Mean return of the last episodes of our training."""
    torch.set_num_threads(1)
    environment = make_vector_environment(
        "joshua/Ant-v0", num_envs=ENVIRONMENTS, seed=seed, autoreset_mode="SameStep", threads=1
    )
    learner = Learner(settings(steps), environment, seed)
    while learner.steps < steps:
        learner.iterate()
    return float(np.mean([returned for returned, *_ in list(learner.vec_env.episodes)[-LAST:]]))


def theirs(seed: int, steps: int) -> float:
    """Mean return of the last episodes of stable-baselines3's training."""
    torch.set_num_threads(1)
    same = settings(steps)
    environment = VecNormalize(make_vec_env("Ant-v5", ENVIRONMENTS, seed=seed), gamma=same.gamma)
    model: Any = PPO(
        "MlpPolicy",
        environment,
        learning_rate=same.learning_rate,
        n_steps=same.n_steps or 1,
        batch_size=same.batch_size,
        n_epochs=same.n_epochs or 1,
        gamma=same.gamma,
        gae_lambda=0.95 if same.gae_lambda is None else same.gae_lambda,
        clip_range=same.clip_range,
        ent_coef=same.entropy_weight or 0.0,
        vf_coef=same.value_weight,
        max_grad_norm=same.max_grad_norm,
        policy_kwargs={
            "net_arch": list(same.hidden_sizes),
            "activation_fn": torch.nn.Tanh,
            "log_std_init": same.initial_log_std,
        },
        stats_window_size=LAST,
        seed=seed,
        device="cpu",
    )
    model.learn(steps)
    return float(np.mean([episode["r"] for episode in model.ep_info_buffer]))


def chance(mine: list[float], theirs: list[float], draws: int = 20_000) -> float:
    """Share of random divisions of all returns whose rank sums differ at least as much as those found."""
    ranks = np.argsort(np.argsort(mine + theirs)) + 1.0
    middle = ranks.mean() * len(mine)
    rng = np.random.default_rng(0)
    divided = np.array([rng.permutation(ranks)[: len(mine)].sum() for _ in range(draws)])
    return float((np.abs(divided - middle) >= abs(ranks[: len(mine)].sum() - middle) - 1e-9).mean())


def main() -> int:
    """Train, and compare."""
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else STEPS
    processes = int(sys.argv[2]) if len(sys.argv) > 2 else os.cpu_count()
    begun_s = time.monotonic()
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        sides: dict[str, list[Future[float]]] = {
            "joshua/Ant-v0": [pool.submit(ours, seed, steps) for seed in SEEDS],
            "Ant-v5": [pool.submit(theirs, seed, steps) for seed in SEEDS],
        }
        found: dict[str, list[float]] = {}
        for name, trainings in sides.items():
            found[name] = []
            for seed, training in enumerate(trainings, 1):
                found[name].append(training.result())
                print(f"{name}, seed {seed}: {found[name][-1]:.0f}", flush=True)
    low, high = np.quantile(found["Ant-v5"], [0.25, 0.75])
    mine = found["joshua/Ant-v0"]
    median = float(np.median(mine[:JUDGED]))
    inside = bool(low <= median <= high)
    print(
        f"{steps} steps, {time.monotonic() - begun_s:.0f} s: median of our first {JUDGED} {median:.0f}, "
        f"their interquartile range {low:.0f} to {high:.0f}: {'inside' if inside else 'outside'}"
    )
    medians = " and ".join(f"{np.median(returns):.0f}" for returns in found.values())
    print(f"medians of all {medians}, rank test p = {chance(mine, found['Ant-v5']):.2f}")
    return int(not inside)


if __name__ == "__main__":
    gymnasium.logger.min_level = gymnasium.logger.ERROR
    sys.exit(main())
