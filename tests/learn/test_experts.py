"""The demonstrator of pick-and-place from 100 random starts: at least 95, randomised physics too."""

from __future__ import annotations

from typing import Any

import pytest
from joshua_mujoco_sim.envs import make_environment
from joshua_mujoco_sim.envs.experts import EXPERTS

PICK_PLACE = "joshua/SoArm100PickPlace-v0"


@pytest.mark.parametrize("randomise", [False, True])
def test_the_cube_is_placed(randomise: bool) -> None:
    environment: Any = make_environment(PICK_PLACE, randomise=randomise).unwrapped
    expert: Any = EXPERTS[PICK_PLACE](environment)
    placed = 0
    for seed in range(100):
        environment.reset(seed=seed)
        expert.reset()
        for _ in range(environment.task.max_steps):
            *_, terminated, _, info = environment.step(expert.act())
            if terminated:
                break
        placed += info["is_success"]
    print(f"placed from {placed} of 100 starts, randomise={randomise}")
    assert placed >= 95
