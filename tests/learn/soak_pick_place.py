"""Success of PPO on ``joshua/SoArm100PickPlace-v0`` after a given time on two cores.

The settings are those of docs/guides/learning.md. The mean action is judged from 200 starts that the training
did not have. ``./test -s learn -- soak_pick_place [--seconds 1200] [--seed 1]`` runs it.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
import torch
from joshua.schema import config_pb2 as pb
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer.learner import Learner
from joshua_ppo_trainer.settings import TrainerSettings

TASK = "joshua/SoArm100PickPlace-v0"
CORES, STARTS = 2, 200
SECONDS = 20 * 60

#: Seed of the first judged start; the training has smaller ones.
JUDGED = 1_000_000


def settings() -> TrainerSettings:
    """The defaults of the environment, with the values that the guide names."""
    rl_config = pb.RLConfig(
        algorithm="PPO",
        num_envs=128,
        total_timesteps=2_000_000_000,
        learning_rate=0.0005,
        gamma=0.99,
        batch_size=1024,
        entropy_weight=0.003,
    )
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=rl_config)
    return TrainerSettings.from_block(block).suitable(TASK)


def environments(count: int, seed: int) -> Any:
    """Environments whose physics takes both cores."""
    return make_vector_environment(TASK, num_envs=count, seed=seed, autoreset_mode="SameStep", threads=CORES)


def judged(learner: Learner) -> float:
    """Share of fresh starts from which the mean action succeeds."""
    made = environments(STARTS, JUDGED)
    observations, _ = made.reset(seed=JUDGED)
    ended, successes = np.zeros(STARTS, bool), np.zeros(STARTS, bool)
    while not ended.all():
        actions, _ = learner.policy.predict(learner.normaliser.shown(observations), deterministic=True)
        step = made.advance(actions)
        observations, over = step.observations, step.terminated | step.truncated
        successes |= step.success & over & ~ended
        ended |= over
    return float(successes.mean())


def main() -> None:
    """Train for the given time, and print what was reached."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="wall time of the training")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    chosen = settings()
    learner = Learner(chosen, environments(chosen.num_envs, arguments.seed), arguments.seed)
    begun_s, begun_cpu_s = time.monotonic(), time.process_time()
    while time.monotonic() - begun_s < arguments.seconds:
        learner.iterate()
    took_s, cpu_s = time.monotonic() - begun_s, time.process_time() - begun_cpu_s
    success = judged(learner)
    print(
        f"pick and place, seed {arguments.seed}: success {success:.3f} of {STARTS} fresh starts after "
        f"{learner.steps} steps, {took_s:.0f} s and {cpu_s:.0f} s of computing time"
    )


if __name__ == "__main__":
    main()
