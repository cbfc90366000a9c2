"""State of a learner in PyTorch as arrays: weights, optimiser, random generators."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from joshua_training.run_folder import RunError

from joshua_ppo_trainer.files import STATE as STATE
from joshua_ppo_trainer.files import TRAINING as TRAINING
from joshua_ppo_trainer.files import as_files as as_files
from joshua_ppo_trainer.files import packed as packed
from joshua_ppo_trainer.files import read as read

Arrays = dict[str, Any]


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
