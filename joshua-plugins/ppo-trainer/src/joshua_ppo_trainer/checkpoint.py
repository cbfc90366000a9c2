"""State of a learner without pickle: weights, optimiser, normalisation, random generators, environments."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from joshua_training.run_folder import RunError
from safetensors import SafetensorError
from safetensors.numpy import load as load_arrays
from safetensors.numpy import save as save_arrays

from joshua_ppo_trainer.policy import ABOUT, WEIGHTS

Arrays = dict[str, Any]

TRAINING, STATE = "training.safetensors", "state.json"


def weights_of(module: torch.nn.Module, prefix: str = "") -> Arrays:
    """Return a copy of the weights of a network by name."""
    return {
        f"{prefix}{key}": value.detach().cpu().numpy().copy() for key, value in module.state_dict().items()
    }


def load_weights(module: torch.nn.Module, arrays: Mapping[str, Any], prefix: str = "") -> None:
    """Load weights into a network. Raises RunError if they do not fit."""
    found = {
        key[len(prefix) :]: torch.from_numpy(np.array(v))
        for key, v in arrays.items()
        if key.startswith(prefix)
    }
    try:
        module.load_state_dict(found)
    except RuntimeError as error:
        reason = str(error).splitlines()[-1].strip()
        raise RunError(f"the weights do not fit the network of this file: {reason}") from error


def optimiser_arrays(optimiser: torch.optim.Optimizer, prefix: str = "optimiser") -> Arrays:
    """Return the state of an optimiser for each weight."""
    arrays = {}
    for index, memory in optimiser.state_dict()["state"].items():
        for name, value in memory.items():
            arrays[f"{prefix}.{index}.{name}"] = torch.as_tensor(value).cpu().numpy().copy()
    return arrays


def load_optimiser(
    optimiser: torch.optim.Optimizer, arrays: Mapping[str, Any], prefix: str = "optimiser"
) -> None:
    """Load the state of an optimiser."""
    memory: dict[int, dict[str, Any]] = {}
    for key, value in arrays.items():
        kind, _, rest = key.partition(".")
        if kind == prefix:
            index, _, name = rest.partition(".")
            memory.setdefault(int(index), {})[name] = torch.from_numpy(np.array(value))
    whole = optimiser.state_dict()
    whole["state"] = memory
    optimiser.load_state_dict(whole)


def generator_arrays() -> Arrays:
    """Return the random generators of torch and NumPy; NumPy's global one shuffles the mini-batches."""
    _, keys, position, has_gauss, gauss = np.random.get_state()
    return {
        "generator.torch": torch.get_rng_state().numpy().copy(),
        "generator.numpy": np.array(keys, np.uint32),
        "generator.numpy_more": np.array([position, has_gauss, gauss], np.float64),
    }


def load_generators(arrays: Mapping[str, Any]) -> None:
    """Load the random generators."""
    torch.set_rng_state(torch.from_numpy(np.array(arrays["generator.torch"])))
    position, has_gauss, gauss = arrays["generator.numpy_more"]
    state = ("MT19937", arrays["generator.numpy"], int(position), int(has_gauss), float(gauss))
    np.random.set_state(state)


def space_state(space: Any) -> dict[str, Any]:
    """Return the random generator of a Gymnasium space as JSON; SAC draws its first actions from it."""
    state: dict[str, Any] = space.np_random.bit_generator.state
    return state


def load_space(space: Any, state: Mapping[str, Any]) -> None:
    """Load the random generator of a space."""
    space.np_random.bit_generator.state = dict(state)


def packed(arrays: Mapping[str, Any]) -> bytes:
    """Serialise arrays as safetensors."""
    content: bytes = save_arrays({name: np.ascontiguousarray(value) for name, value in arrays.items()})
    return content


def as_files(
    policy: Arrays, training: Arrays, state: Mapping[str, Any], about: Mapping[str, Any]
) -> dict[str, bytes]:
    """Return the files of a checkpoint by name; ``about`` describes the policy."""
    return {
        ABOUT: json.dumps(about, indent=2, sort_keys=True).encode() + b"\n",
        WEIGHTS: packed(policy),
        TRAINING: packed(training),
        STATE: json.dumps(state, indent=2, sort_keys=True).encode() + b"\n",
    }


def read(folder: Path) -> tuple[Arrays, Arrays, dict[str, Any]]:
    """Read a checkpoint: weights, further arrays of the training, and the state.

    Raises:
        RunError: a file is missing, truncated or not from this trainer.
    """
    try:
        policy = load_arrays((folder / WEIGHTS).read_bytes())
        training = load_arrays((folder / TRAINING).read_bytes())
        state = json.loads((folder / STATE).read_text(encoding="utf-8"))
        if not isinstance(state, dict) or "steps" not in state:
            raise ValueError(f"{STATE} has no steps")
    except (OSError, ValueError, SafetensorError) as error:
        raise RunError(
            f"the checkpoint {folder} cannot be used: {error}: remove it to continue from an older one"
        ) from error
    return policy, training, state
