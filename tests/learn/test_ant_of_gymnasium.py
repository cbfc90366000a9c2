"""``joshua/Ant-v0`` beside Gymnasium's own ``Ant-v5``: the same starts, states, observations and rewards."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from joshua_mujoco_sim.envs import TASKS, TermVectorEnv, make_environment

TERMS = {
    "forward": "reward_forward",
    "healthy": "reward_survive",
    "control": "reward_ctrl",
    "contact": "reward_contact",
}


def torques(seed: int) -> Any:
    """Waves that keep the ant up and moving, so that episodes are long, with noise."""
    chance = np.random.default_rng(seed)
    phases = chance.uniform(0, 2 * np.pi, 8)
    for step in range(1000):
        yield np.clip(0.35 * np.sin(0.35 * step + phases) + 0.1 * chance.standard_normal(8), -1.0, 1.0)


def test_whole_episodes_are_equal() -> None:
    ours: Any = make_environment("joshua/Ant-v0")
    theirs: Any = gymnasium.make("Ant-v5")
    lengths = []
    for seed in range(4):
        shown, _ = ours.reset(seed=seed)
        expected, _ = theirs.reset(seed=seed)
        assert shown == pytest.approx(expected.astype(np.float32), abs=0)
        for step, action in enumerate(torques(seed), 1):
            observation, reward, terminated, truncated, info = ours.step(action)
            expected, wanted, *ends, details = theirs.step(action)
            data = theirs.unwrapped.data
            assert np.array_equal(ours.unwrapped.state.qpos[0], data.qpos), (seed, step)
            assert np.array_equal(ours.unwrapped.state.qvel[0], data.qvel), (seed, step)
            assert np.array_equal(observation, expected.astype(np.float32)), (seed, step)
            assert reward == pytest.approx(wanted, abs=1e-12), (seed, step)
            for name, key in TERMS.items():
                assert info["reward_terms"][name] == pytest.approx(details[key], abs=1e-12)
            assert [terminated, truncated] == ends
            if terminated or truncated:
                break
        lengths.append(step)
    assert max(lengths) > 300


def test_many_are_equal_to_theirs_as_well() -> None:
    ours = TermVectorEnv(TASKS["joshua/Ant-v0"], 2)
    theirs: Any = gymnasium.make("Ant-v5")
    ours.reset(seed=5)
    theirs.reset(seed=6)
    for action in torques(0):
        observations, rewards, ended, _, _ = ours.step(np.stack([action, action]))
        expected, reward, terminated, _, _ = theirs.step(action)
        assert np.array_equal(observations[1], expected.astype(np.float32))
        assert rewards[1] == pytest.approx(reward, abs=1e-12)
        if ended.any() or terminated:
            assert bool(ended[1]) == terminated
            break
