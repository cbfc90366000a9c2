"""Weights that cannot run are refused when they are loaded, not in the middle of an episode."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from joshua_ppo_trainer.policy import Policy
from joshua_training.run_folder import RunError
from safetensors.numpy import load_file, save_file
from trained_policies import write_policy


def torn(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-5])


def not_a_number(path: Path) -> None:
    values = load_file(path)
    save_file(values | {"action_net.bias": values["action_net.bias"] * np.nan}, path)


def narrow(path: Path) -> None:
    values = load_file(path)
    save_file(values | {"action_net.weight": values["action_net.weight"][:, :-1].copy()}, path)


def no_object(path: Path) -> None:
    path.write_bytes((2).to_bytes(8, "little") + b"[]")


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (torn, "ValueError: .*"),
        (not_a_number, "ValueError: a weight is not a number"),
        (narrow, r"ValueError: a layer has the shape \(6, 7\), not \(6, 8\)"),
        (no_object, "AttributeError: .*"),
    ],
)
def test_weights_that_cannot_run_are_named(tmp_path: Path, damage: Callable[[Path], None], said: str) -> None:
    folder = write_policy(tmp_path / "policy")
    Policy.load(folder)
    damage(folder / "policy.safetensors")
    with pytest.raises(
        RunError,
        match=rf"policy contains no policy of joshua-ppo-trainer: {said}\. Copy the checkpoint again",
    ):
        Policy.load(folder)
