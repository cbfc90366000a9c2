"""Reaching learned from three seeds, and PPO's steps a second beside stable-baselines3's own environments.

``--curves FILE`` writes what ``tools/draw_learning_curve.py`` draws. Exit code 1 if the target is missed.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import torch
from google.protobuf import text_format
from joshua.schema import config_pb2 as pb
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer.learner import Learner
from joshua_ppo_trainer.settings import TrainerSettings
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

PRESET = Path(__file__).parents[2] / "configs/training_rl_ppo.pbtxt"
TRAINING = text_format.Parse(PRESET.read_text(encoding="utf-8"), pb.Config()).ai.training
#: Least steps a second, as a multiple of those of stable-baselines3.
TARGET = 1.4

REACH, STEPS = TRAINING.environment_id, TRAINING.rl_config.total_timesteps


def made(seed: int) -> Learner:
    """The learner of the preset ``training_rl_ppo``."""
    settings = TrainerSettings.from_block(TRAINING).suitable(REACH)
    environment = make_vector_environment(
        REACH,
        reward_function=TRAINING.rl_config.reward_function,
        num_envs=settings.num_envs,
        seed=seed,
        autoreset_mode="SameStep",
    )
    return Learner(settings, environment, seed)


def judged(learner: Learner) -> float:
    """Success of the mean action from 200 fresh starts."""
    environment: Any = make_vector_environment(REACH, num_envs=200, seed=10_000, autoreset_mode="SameStep")
    observations, _ = environment.reset(seed=10_000)
    first = np.full(200, -1)
    for _ in range(75):
        actions, _ = learner.policy.predict(learner.normaliser.shown(observations), deterministic=True)
        step = environment.advance(actions)
        observations = step.observations
        ended = (first < 0) & (step.terminated | step.truncated)
        first[ended] = step.success[ended]
    return float((first == 1).mean())


def learning(curves: Path | None) -> None:
    """Learns from three seeds."""
    found = []
    for seed in (1, 1001, 2001):
        learner = made(seed)
        begun_s, begun_cpu_s = time.perf_counter(), time.process_time()
        curve, reached = [], ""
        while learner.steps < STEPS:
            row = learner.iterate()
            assert row is not None
            elapsed_s = time.perf_counter() - begun_s
            success = row.get("episode/success_rate", 0.0)
            if row["episodes"] >= 200:  # the first ones to end are those that succeed
                curve.append((learner.steps, success, elapsed_s))
            if success >= 0.95 and row["episodes"] >= 400 and not reached:
                reached = f"0.95 after {learner.steps} steps and {elapsed_s:.0f} s"
        wall_s, cpu_s = time.perf_counter() - begun_s, time.process_time() - begun_cpu_s
        print(
            f"seed {seed:<5} {STEPS} steps in {wall_s:.0f} s, {cpu_s:.0f} s of CPU; {reached}; "
            f"success of the mean action {judged(learner):.3f}",
            flush=True,
        )
        found.append({"seed": seed, "curve": curve})
    if curves is not None:
        curves.write_text(json.dumps(found), encoding="utf-8")


def theirs() -> Any:
    """PPO of stable-baselines3 with the same settings, on eight single environments."""

    def make() -> Any:
        return gymnasium.make(REACH)

    policy = {"net_arch": [64, 64], "log_std_init": -0.5}
    return PPO(
        "MlpPolicy",
        DummyVecEnv([make] * 8),
        n_steps=256,
        batch_size=512,
        n_epochs=8,
        learning_rate=0.001,
        gamma=0.95,
        policy_kwargs=policy,
        device="cpu",
    )


def rates(rounds: int) -> float:
    """Alternately, as many steps of each. Returns the median ratio."""
    ours, other = made(1), theirs()
    ratios = []
    for _ in range(rounds):
        other.num_timesteps = 0
        rate = []
        for count, learn in (
            (10_240, lambda: other.learn(10_240, reset_num_timesteps=True)),
            (10_240, lambda: [ours.iterate() for _ in range(5)]),
        ):
            begun_s, begun_cpu_s = time.perf_counter(), time.process_time()
            learn()
            wall_s, cpu_s = time.perf_counter() - begun_s, time.process_time() - begun_cpu_s
            rate.append((count / wall_s, count / cpu_s))
        ratios.append(rate[1][0] / rate[0][0])
        print(
            f"steps/s: DummyVecEnv x8 {rate[0][0]:.0f}, ours x64 {rate[1][0]:.0f}, ratio {ratios[-1]:.2f}; "
            f"per second of CPU: {rate[0][1]:.0f}, {rate[1][1]:.0f}",
            flush=True,
        )
    print(f"median ratio {np.median(ratios):.2f}, least {min(ratios):.2f}", flush=True)
    return float(np.median(ratios))


def main() -> int:
    """Measure what was asked for. Returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--curves", type=Path)
    parser.add_argument("--only", choices=("learning", "rates"))
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    print(f"load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    ratio = rates(arguments.rounds) if arguments.only != "learning" else None
    if arguments.only != "rates":
        learning(arguments.curves)
    if ratio is None:
        return 0
    verdict = "met" if ratio >= TARGET else "missed"
    print(f"{verdict}: median ratio of the steps a second {ratio:.2f}, target >= {TARGET}")
    return int(ratio < TARGET)


if __name__ == "__main__":
    sys.exit(main())
