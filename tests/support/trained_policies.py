"""Writes the policy of a trainer without training: as trainers lay it out, fitted to the demonstrator."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from safetensors.numpy import save_file

REACH = "joshua/SoArm100Reach-v0"


def write_policy(
    folder: Path,
    *,
    environment: str = REACH,
    seed: int = 0,
    weights: dict[str, Any] | None = None,
    **about: Any,
) -> Path:
    """A checkpoint with the weights of a network with one hidden layer, random ones without any."""
    from joshua_mujoco_sim.envs import make_vector_environment

    made: Any = make_vector_environment(environment, num_envs=1)
    offset, scale = made.observation_scaling
    space = made.single_action_space
    if weights is None:
        generator = np.random.default_rng(seed)
        weights = network(
            generator.normal(0, 0.3, (8, len(offset))), generator.normal(0, 0.3, (space.shape[0], 8))
        )
    folder.mkdir(parents=True, exist_ok=True)
    save_file(
        {name: np.ascontiguousarray(value, np.float32) for name, value in weights.items()},
        folder / "policy.safetensors",
    )
    content = {
        "format": 1,
        "algorithm": "PPO",
        "activation": "tanh",
        "normalisation": None,
        "environment": environment,
        "features": {
            key: {"shape": list(feature.shape), "names": list(feature.names), "unit": feature.unit}
            for key, feature in made.features.items()
        },
        "observation_offset": offset.tolist(),
        "observation_scale": scale.tolist(),
        "action_low": space.low.tolist(),
        "action_high": space.high.tolist(),
    }
    (folder / "policy.json").write_text(json.dumps(content | about))
    return folder


def network(hidden: Any, last: Any, bias: Any = None) -> dict[str, Any]:
    """The weights by the names of stable-baselines3."""
    return {
        "mlp_extractor.policy_net.0.weight": hidden,
        "mlp_extractor.policy_net.0.bias": np.zeros(len(hidden)) if bias is None else bias,
        "action_net.weight": last,
        "action_net.bias": np.zeros(len(last)),
    }


def write_reaching_policy(folder: Path, episodes: int = 25) -> Path:
    """A policy that reaches the goal in some episodes: random tanh features, fitted to the demonstrator."""
    from joshua_mujoco_sim.envs import make_environment
    from joshua_mujoco_sim.envs.experts import EXPERTS

    environment: Any = make_environment(REACH, action_mode="absolute", disable_env_checker=True).unwrapped
    played: Any = make_environment(REACH, disable_env_checker=True).unwrapped
    expert = EXPERTS[REACH](environment, noise_rad=0.02, seed=0)
    seen, done = [], []
    for seed in range(episodes):
        observation, _ = environment.reset(seed=50_000 + seed)
        expert.reset()
        for _ in range(60):
            before = environment.state.ctrl[0].copy()
            action = expert.act()
            seen.append(environment.physical(observation))
            done.append(np.clip((np.asarray(action) - before) / 0.1, -1, 1))
            observation, _, terminated, _, _ = environment.step(action)
            if terminated:
                break
    offset, scale = played.observation_scaling  # those of the mode in which the policy acts
    inputs, outputs = (np.array(seen) - offset) / scale, np.array(done)
    generator = np.random.default_rng(0)
    hidden = generator.normal(0, 0.5, (256, inputs.shape[1]))
    # the action before is what the two modes of actions disagree about
    hidden[:, _last_action(environment)] = 0.0
    bias = generator.normal(0, 0.5, 256)
    features = np.tanh(inputs @ hidden.T + bias)
    last = np.linalg.solve(features.T @ features + 0.1 * np.eye(256), features.T @ outputs).T
    return write_policy(folder, weights=network(hidden, last, bias))


def _last_action(environment: Any) -> slice:
    at = 0
    for key, feature in environment.features.items():
        if key == "observation.last_action":
            return slice(at, at + feature.shape[0])
        at += feature.shape[0]
    raise AssertionError("the task observes no last action")
