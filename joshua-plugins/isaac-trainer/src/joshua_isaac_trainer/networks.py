"""A policy of rsl_rl in the files of joshua-ppo-trainer, which run without PyTorch."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import numpy as np

#: EmpiricalNormalization of rsl_rl adds this to the spread.
EPSILON = 0.01


def policy_weights(actor: Mapping[str, Any]) -> dict[str, Any]:
    """Return the mean action of an actor under the names of stable-baselines3, as float32 arrays.

    Its normalisation of observations becomes part of the first layer, which computes the same.

    Args:
        actor: ``state_dict`` of rsl_rl's ActorCritic as arrays: ``actor.0.weight``, …,
            ``actor_obs_normalizer._mean``, ….

    Raises:
        ValueError: it has no layers.
    """
    numbers = sorted(
        int(found.group(1)) for key in actor if (found := re.fullmatch(r"actor\.(\d+)\.weight", key))
    )
    if not numbers:
        raise ValueError("the network has no layers")
    weights = {}
    for number in numbers:
        weight = np.asarray(actor[f"actor.{number}.weight"], np.float64)
        bias = np.asarray(actor[f"actor.{number}.bias"], np.float64)
        if number == numbers[0] and "actor_obs_normalizer._mean" in actor:
            mean, spread = (
                np.asarray(actor[f"actor_obs_normalizer.{name}"], np.float64).reshape(-1)
                for name in ("_mean", "_std")
            )
            weight = weight / (spread + EPSILON)
            bias = bias - weight @ mean
        name = "action_net" if number == numbers[-1] else f"mlp_extractor.policy_net.{number}"
        weights[f"{name}.weight"] = weight.astype(np.float32)
        weights[f"{name}.bias"] = bias.astype(np.float32)
    return weights


def policy_facts(environment_id: str, evaluator: Any, rate_hz: float, activation: str) -> dict[str, Any]:
    """Return ``policy.json``: inputs and outputs of a policy in physical units.

    Args:
        evaluator: of the task; rate_hz: of the actions.
    """
    space = evaluator.action_space
    return {
        "format": 1,
        "algorithm": "PPO",
        "environment": environment_id,
        "features": {
            key: {"shape": list(feature.shape), "names": list(feature.names), "unit": feature.unit}
            for key, feature in evaluator.features.items()
        },
        "rate_hz": rate_hz,
        "observation_offset": evaluator.offset.tolist(),
        "observation_scale": evaluator.scale.tolist(),
        "action_low": space.low.tolist(),
        "action_high": space.high.tolist(),
        "activation": activation,
        "normalisation": None,
        "simulator": "isaac",
    }
