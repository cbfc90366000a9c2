"""Policies of LeRobot as models: the same actions as LeRobot's own, and messages that say what to do."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny_policies
import torch
from joshua.api import JointRange, JointSpace, Observation
from joshua.api.models import Compute
from joshua.features import JointUnits, Unit
from joshua_lerobot.policy import LeRobotModel
from joshua_lerobot.settings import LeRobotSettings
from joshua_smolvla.model import SmolVla
from joshua_smolvla.settings import SmolVlaSettings

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
ENDS = np.array([[-1.9, 1.9], [-1.7, 1.6], [-1.6, 1.6], [-1.65, 1.65], [-2.7, 2.8], [-0.2, 1.7]])
JOINTS = JointSpace(NAMES, ENDS[:, 0], ENDS[:, 1])
UNITS = JointUnits.from_ranges(JointRange(name, *ends) for name, ends in zip(NAMES, ENDS, strict=True))


@pytest.fixture(scope="session")
def act(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("act")
    return folder, *tiny_policies.make_act(folder)


@pytest.fixture(scope="session")
def smolvla(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("smolvla")
    return folder, *tiny_policies.make_smolvla(folder)


def model_of(kind: Any, settings: Any, folder: Path, **chosen: Any) -> Any:
    model = kind(settings(weights=str(folder), rate_hz=30.0, **chosen), JOINTS)
    model.load()
    model.reset()
    return model


def observation(seed: int = 1, task: str = "") -> Observation:
    draw = np.random.default_rng(seed)
    values: dict[str, Any] = {
        f"observation.images.{name}": draw.integers(0, 255, (96, 96, 3), np.uint8)
        for name in ("top", "wrist")
    }
    values["observation.state"] = draw.uniform(ENDS[:, 0], ENDS[:, 1]).astype(np.float32)
    return Observation(10**18 + seed, values, {}, task=task)


def by_lerobot(parts: Any, seen: Observation, steps: int) -> Any:
    """The actions that LeRobot's own loop takes, in radians."""
    from lerobot.policies.utils import prepare_observation_for_inference

    policy, before, after = parts
    values = dict(seen.values)
    values["observation.state"] = UNITS.from_radians(values["observation.state"], Unit.LEROBOT).astype(
        np.float32
    )
    policy.reset()
    torch.manual_seed(3)
    actions = []
    with torch.inference_mode():
        for _ in range(steps):
            batch = prepare_observation_for_inference(dict(values), torch.device("cpu"), seen.task)
            actions.append(after(policy.select_action(before(batch))).numpy()[0])
    return UNITS.to_radians(np.array(actions), Unit.LEROBOT)


def test_act_acts_as_with_lerobot(act: Any) -> None:
    folder, *parts = act
    model = model_of(LeRobotModel, LeRobotSettings, folder)
    actions = model.act(observation())
    assert actions.shape == (20, 6)
    np.testing.assert_allclose(actions, by_lerobot(parts, observation(), 20), atol=1e-5, rtol=0)
    model.close()


def test_smolvla_acts_as_with_lerobot(smolvla: Any) -> None:
    folder, *parts = smolvla
    model = model_of(SmolVla, SmolVlaSettings, folder, compute=Compute(seed=3))
    seen = observation(task="put the red cube into the box")
    actions = model.act(seen)
    assert actions.shape == (10, 6)
    np.testing.assert_allclose(actions, by_lerobot(parts, seen, 10), atol=1e-5, rtol=0)
    model.reset()
    np.testing.assert_array_equal(model.act(seen), actions)  # the seed draws the same noise
    assert np.abs(model.act(observation(task="reach the cube")) - actions).max() > 1e-6
    model.close()
