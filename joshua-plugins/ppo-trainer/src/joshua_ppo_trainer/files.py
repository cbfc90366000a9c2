"""Files of a checkpoint, without pickle and whatever computes the training: safetensors and JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from joshua_training.run_folder import RunError, read_part

from joshua_ppo_trainer.policy import ABOUT, WEIGHTS

Arrays = dict[str, Any]

TRAINING, STATE = "training.safetensors", "state.json"


class DivergedError(RunError):
    """The loss is not a number."""


def packed(arrays: Mapping[str, Any]) -> bytes:
    """Serialise arrays as safetensors."""
    from safetensors.numpy import save

    content: bytes = save({name: np.ascontiguousarray(value) for name, value in arrays.items()})
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
    from safetensors.numpy import load

    policy = read_part(folder, WEIGHTS, load)
    training = read_part(folder, TRAINING, load)
    state = read_part(folder, STATE, json.loads, "steps", "iterations", "episodes", "episodes_done")
    return policy, training, state
