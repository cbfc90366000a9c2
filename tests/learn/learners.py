"""Learners of small policies on a tiny data set, and what they learn."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import torch
from joshua_imitation.build import build
from joshua_imitation.learner import Learner
from joshua_imitation.settings import ImitationSettings
from joshua_training.run_folder import RunFolder
from tiny_recordings import write_recording

SMALL: dict[str, Any] = {
    "num_epochs": 3,
    "batch_size": 6,
    "learning_rate": 1e-3,
    "chunk_size": 8,
    "hidden_size": 32,
    "feedforward_size": 32,
    "encoder_layers": 1,
    "report_steps": 2,
    "validation_steps": 3,
    "workers": 1,
    "device": "cpu",
}
DIFFUSION: dict[str, Any] = {"hidden_size": 16, "feedforward_size": None, "encoder_layers": None}

torch.set_num_threads(1)


@pytest.fixture(scope="session")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("recording") / "set")


@pytest.fixture
def learner(recording: Path, tmp_path: Path) -> Iterator[Callable[..., Learner]]:
    """Makes learners, each with a run of its own."""
    made = []

    def make(continued: Path | None = None, **fields: Any) -> Learner:
        built = build(settings(recording, **fields), continued)
        made.append(built)
        built.album.fill(lambda count: True)
        found = built.learner(RunFolder.create(tmp_path, "run", {}))
        if continued is not None:
            found.restore(continued)
        return found

    yield make
    for built in made:
        built.album.close()


def settings(recording: Path, **fields: Any) -> ImitationSettings:
    return ImitationSettings(dataset=str(recording), **{**SMALL, **fields})


def rows(made: Learner, last: int = 10**9) -> list[dict[str, float]]:
    found = []
    while made.steps < min(last, made.total):
        row = made.update()
        if row is not None:
            found.append({key: value for key, value in row.items() if not key.startswith("rate/")})
    made.close()
    return found


def weights(made: Learner) -> dict[str, Any]:
    return {key: value.clone() for key, value in made.parts.policy.state_dict().items()}


def differ(one: dict[str, Any], other: dict[str, Any]) -> bool:
    return one.keys() != other.keys() or any(not torch.equal(one[key], other[key]) for key in one)
