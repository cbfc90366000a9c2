"""Policy and value function: two networks, whose weights are named and shaped as in joshua-ppo-trainer."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
from joshua_ppo_trainer.settings import TrainerSettings

Weights = dict[str, Any]

_ACTIVATIONS = {"tanh": jnp.tanh, "relu": jax.nn.relu, "elu": jax.nn.elu}

#: Prefix of the hidden layers, and the last layer, of each network.
_POLICY = ("mlp_extractor.policy_net.", "action_net")
_VALUE = ("mlp_extractor.value_net.", "value_net")


def first_weights(key: Any, width: int, actions: int, settings: TrainerSettings) -> Weights:
    """Return orthogonal weights for observations of some width, and the spread of the actions."""
    found: Weights = {"log_std": jnp.full(actions, settings.initial_log_std, jnp.float32)}
    for (hidden, last), size, gain in ((_POLICY, actions, 0.01), (_VALUE, 1, 1.0)):
        sizes = (width, *settings.hidden_sizes)
        layers = [(f"{hidden}{2 * i}", sizes[i], sizes[i + 1], math.sqrt(2)) for i in range(len(sizes) - 1)]
        for name, inputs, outputs, scale in (*layers, (last, sizes[-1], size, gain)):
            key, own = jax.random.split(key)
            made = jax.nn.initializers.orthogonal(scale)
            found[f"{name}.weight"] = made(own, (outputs, inputs), jnp.float32)
            found[f"{name}.bias"] = jnp.zeros(outputs, jnp.float32)
    return found


def mean_action(weights: Weights, observations: Any, settings: TrainerSettings) -> Any:
    """Return the mean of the actions, shape (…, A), for normalised observations, shape (…, K)."""
    return _forward(weights, observations, _POLICY, settings)


def value(weights: Weights, observations: Any, settings: TrainerSettings) -> Any:
    """Return the expected return of normalised observations, shape (…,)."""
    return _forward(weights, observations, _VALUE, settings)[..., 0]


def log_probability(actions: Any, mean: Any, log_std: Any) -> Any:
    """Return the logarithm of the density of actions, shape (…,)."""
    away = (actions - mean) / jnp.exp(log_std)
    return -(0.5 * away * away + log_std + 0.5 * math.log(2 * math.pi)).sum(axis=-1)


def entropy(log_std: Any) -> Any:
    """Return the entropy of the actions."""
    return (log_std + 0.5 * math.log(2 * math.pi * math.e)).sum()


def adam(
    weights: Weights, gradient: Weights, memory: Mapping[str, Any], settings: TrainerSettings
) -> tuple[Weights, dict[str, Any]]:
    """Return weights and memory after a step of Adam, whose gradient is clipped to ``max_grad_norm``."""
    norm = jnp.sqrt(sum((values * values).sum() for values in gradient.values()))
    share = jnp.minimum(1.0, settings.max_grad_norm / (norm + 1e-6))
    count = memory["count"] + 1
    steps = count.astype(jnp.float32)
    following: dict[str, Any] = {"count": count, "mean": {}, "square": {}}
    changed = {}
    for name, values in gradient.items():
        values = values * share
        mean = 0.9 * memory["mean"][name] + 0.1 * values
        square = 0.999 * memory["square"][name] + 0.001 * values * values
        step = mean / (1 - 0.9**steps) / (jnp.sqrt(square / (1 - 0.999**steps)) + 1e-5)
        following["mean"][name], following["square"][name] = mean, square
        changed[name] = weights[name] - settings.learning_rate * step
    return changed, following


def first_memory(weights: Weights) -> dict[str, Any]:
    """Return the memory of Adam before its first step."""
    zeros = {name: jnp.zeros_like(values) for name, values in weights.items()}
    return {"count": jnp.int32(0), "mean": zeros, "square": dict(zeros)}


def _forward(weights: Weights, values: Any, names: tuple[str, str], settings: TrainerSettings) -> Any:
    hidden, last = names
    activate = _ACTIVATIONS[settings.activation]
    for index in range(len(settings.hidden_sizes)):
        name = f"{hidden}{2 * index}"
        values = activate(values @ weights[f"{name}.weight"].T + weights[f"{name}.bias"])
    return values @ weights[f"{last}.weight"].T + weights[f"{last}.bias"]
