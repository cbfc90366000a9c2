from __future__ import annotations

import numpy as np
import pytest
from joshua.models.model import JointSpace, ModelError, Observation
from joshua.schema import config_pb2
from joshua_inference.random_noise import RandomNoise
from joshua_inference.random_noise_settings import RandomNoiseSettings

JOINTS = JointSpace(("a", "b"), np.array([-1.0, 0.0]), np.array([1.0, 0.1]))
NOTHING = Observation(0)


def noise(**fields: float) -> RandomNoise:
    settings = RandomNoiseSettings.from_block(config_pb2.RandomNoiseConfig(**fields))  # type: ignore[arg-type]
    model = RandomNoise(settings, JOINTS)
    model.load()
    return model


def test_actions_are_uniform_and_clipped_to_the_limits() -> None:
    model = noise(seed=3)
    actions = np.vstack([model.act(NOTHING) for _ in range(2000)])
    assert actions.shape == (2000, 2)
    assert np.abs(actions[:, 0]).max() <= 0.5
    assert abs(actions[:, 0].mean()) < 0.03
    assert actions[:, 0].std() == pytest.approx(0.5 / np.sqrt(3), rel=0.05)
    assert actions[:, 1].min() == 0.0
    assert actions[:, 1].max() == pytest.approx(0.1)


def test_the_same_seed_gives_the_same_actions() -> None:
    first, second, other = noise(seed=1), noise(seed=1), noise(seed=2)
    one = [first.act(NOTHING).tolist() for _ in range(5)]
    assert [second.act(NOTHING).tolist() for _ in range(5)] == one
    assert [other.act(NOTHING).tolist() for _ in range(5)] != one
    first.reset()
    assert [first.act(NOTHING).tolist() for _ in range(5)] == one


def test_omitted_settings_mean_what_the_schema_says() -> None:
    settings = RandomNoiseSettings.from_block(config_pb2.RandomNoiseConfig())
    assert (settings.seed, settings.amplitude_rad) == (0, 0.5)


def test_a_model_that_is_not_loaded_says_so() -> None:
    model = noise()
    model.close()
    model.close()
    with pytest.raises(ModelError, match="the model is not loaded: call load first"):
        model.act(NOTHING)
