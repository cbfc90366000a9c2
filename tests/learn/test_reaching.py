"""PPO learns to reach with the preset ``training_rl_ppo``, and SAC with its defaults."""

from __future__ import annotations

import time

import pytest
import torch
from bench_ppo import REACH, STEPS, judged, made
from joshua.schema import config_pb2 as pb
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer.learner import Learner
from joshua_ppo_trainer.settings import TrainerSettings

torch.set_num_threads(1)


@pytest.mark.parametrize("seed", [1, 1001, 2001])
def test_reaching_is_learned(seed: int, capsys: pytest.CaptureFixture[str]) -> None:
    """The mean action succeeds from 0.95 of 200 starts that the training did not have."""
    begun_s = time.perf_counter()
    learner = made(seed)
    while learner.steps < STEPS:
        assert learner.iterate() is not None
    took_s = time.perf_counter() - begun_s
    success = judged(learner)
    with capsys.disabled():
        print(f"\nreach, seed {seed}: success {success:.3f} after {learner.steps} steps and {took_s:.0f} s")
    assert success >= 0.95


def test_reaching_is_learned_by_sac(capsys: pytest.CaptureFixture[str]) -> None:
    """The mean action succeeds from 0.9 of 200 starts that the training did not have."""
    config = pb.RLConfig(
        algorithm="SAC",
        num_envs=16,
        total_timesteps=18_000,
        learning_rate=0.002,
        gamma=0.95,
        batch_size=256,
        updates_per_step=8,
    )
    block = pb.Training(environment=pb.ENV_SIMULATION, rl_config=config)
    settings = TrainerSettings.from_block(block).suitable(REACH)
    environment = make_vector_environment(REACH, num_envs=16, seed=1001, autoreset_mode="SameStep", threads=1)
    learner = Learner(settings, environment, 1001)
    begun_s = time.process_time()
    while learner.steps < settings.total_timesteps:
        assert learner.iterate() is not None
    took_s, success = time.process_time() - begun_s, judged(learner)
    with capsys.disabled():
        print(f"\nreach by SAC: success {success:.3f} after {learner.steps} steps and {took_s:.0f} s of CPU")
    assert success >= 0.9
