"""A trained policy, from the files of a checkpoint, with NumPy alone: it runs without PyTorch."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from joshua.tools import parse_json
from joshua_training.run_folder import RunError

from joshua_ppo_trainer.normalise import LIMIT

#: The files of a policy in a checkpoint.
WEIGHTS, ABOUT = "policy.safetensors", "policy.json"

#: Types of numbers in a file.
_KINDS: dict[str, Any] = {"F32": np.dtype("<f4"), "F64": np.dtype("<f8"), "I64": np.dtype("<i8")}

#: Prefixes of the layers of the mean action in the networks of stable-baselines3: hidden ones, the last one.
_LAYERS = {"PPO": ("mlp_extractor.policy_net.", "action_net"), "SAC": ("actor.latent_pi.", "actor.mu")}


class Policy:
    """Mean action of a policy for the observations of an environment.

    Attributes:
        about: content of ``policy.json``: features, scales, the range of actions, normalisation.
        layers: weight and bias of each; squash: whether a tanh follows the last one.
        mean, spread: normalisation of observations, None without one; limit: of normalised values.
        low, high: of actions.
    """

    def __init__(self, about: dict[str, Any], weights: dict[str, Any]) -> None:
        self.about = about
        hidden, last = _LAYERS[about["algorithm"]]
        numbers = sorted({int(key[len(hidden) :].split(".")[0]) for key in weights if key.startswith(hidden)})
        names = [*(f"{hidden}{number}" for number in numbers), last]
        self.layers = [(weights[f"{name}.weight"], weights[f"{name}.bias"]) for name in names]
        self.squash = about["algorithm"] == "SAC"
        self.low, self.high = (np.asarray(about[f"action_{end}"], np.float32) for end in ("low", "high"))
        moments = about["normalisation"]
        self.mean = self.spread = None
        self.limit = LIMIT
        if moments is not None:
            self.mean = np.asarray(moments["mean"])
            self.spread = np.sqrt(np.asarray(moments["variance"]) + 1e-8)
        self._check(len(self.mean) if self.mean is not None else self.layers[0][0].shape[1])

    def _check(self, inputs: int) -> None:
        """Raise ValueError unless all numbers are finite and each layer fits the one before it."""
        for weight, bias in self.layers:
            if weight.shape != (len(bias), inputs):
                raise ValueError(f"a layer has the shape {weight.shape}, not {(len(bias), inputs)}")
            inputs = len(bias)
            if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
                raise ValueError("a weight is not a number")
        if inputs != len(self.low):
            raise ValueError(f"it returns {inputs} numbers, but has ranges of {len(self.low)}")

    @classmethod
    def load(cls, checkpoint: Path) -> Policy:
        """Read the policy of a checkpoint.

        Raises:
            RunError: a file is missing, truncated or not from this trainer.
        """
        try:
            about = parse_json((checkpoint / ABOUT).read_text(encoding="utf-8"))
            return cls(about, arrays_of((checkpoint / WEIGHTS).read_bytes()))
        except (OSError, ValueError, KeyError, TypeError, IndexError, AttributeError) as error:
            reason = f"{type(error).__name__}: {error}"
            raise RunError(
                f"{checkpoint} contains no policy of joshua-ppo-trainer: {reason}. Copy the checkpoint "
                "again, or name another one"
            ) from error

    def act(self, observations: Any) -> Any:
        """Return actions, shape (N, A), float32, for raw observations of the environment, shape (N, K)."""
        values = np.asarray(observations, np.float32)
        if self.mean is not None:
            scaled = (values - self.mean) / self.spread
            values = np.clip(scaled, -LIMIT, LIMIT).astype(np.float32)
        for weight, bias in self.layers[:-1]:
            values = self._activate(values @ weight.T + bias)
        weight, bias = self.layers[-1]
        values = values @ weight.T + bias
        if self.squash:
            values = self.low + 0.5 * (np.tanh(values) + 1.0) * (self.high - self.low)
        return np.clip(values, self.low, self.high)

    def _activate(self, values: Any) -> Any:
        kind = self.about["activation"]
        if kind == "tanh":
            return np.tanh(values)
        if kind == "relu":
            return np.maximum(values, 0.0)
        return np.where(values > 0, values, np.expm1(np.minimum(values, 0.0)))


def arrays_of(content: bytes) -> dict[str, Any]:
    """Parse the arrays of a safetensors file without its library. Raises ValueError for a truncated file."""
    start = 8 + int.from_bytes(content[:8], "little")
    if not 8 < start <= len(content):
        raise ValueError("the file is truncated")
    described = parse_json(content[8:start])
    found = {}
    for name, entry in described.items():
        if name != "__metadata__":
            begin, end = entry["data_offsets"]
            values = np.frombuffer(content[start + begin : start + end], _KINDS[entry["dtype"]])
            found[name] = values.reshape(entry["shape"])
    return found
