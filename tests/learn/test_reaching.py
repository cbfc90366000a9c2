"""PPO learns to reach with the preset ``training_rl_ppo``."""

from __future__ import annotations

import time

import pytest
import torch
from bench_ppo import STEPS, judged, made

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
