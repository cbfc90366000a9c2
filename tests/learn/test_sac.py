"""SAC: what its replay buffer holds, continued trainings, stops, and memory."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from joshua_mujoco_sim.envs import make_vector_environment
from joshua_ppo_trainer import checkpoint
from joshua_training.run_folder import RunError, RunFolder
from learner_behaviours import differ
from test_ppo_trainer import REACH, learner, rows, weights

SMALL: dict[str, Any] = {
    "algorithm": "SAC",
    "learning_starts": 300,
    "updates_per_step": 1,
    "hidden_sizes": [16],
    "normalize_observations": True,
    "normalize_rewards": True,
}

torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def short_iterations(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("joshua_ppo_trainer.learner.SAC_STEPS", 120)


def test_the_replay_buffer_holds_the_values_of_the_environments() -> None:
    made = learner(**{**SMALL, "learning_starts": 10**6, "total_timesteps": 400})
    rows(made, 4)
    buffer = made._model.replay_buffer
    again: Any = make_vector_environment(REACH, num_envs=4, seed=5, autoreset_mode="SameStep")
    seen, _ = again.reset()
    ended = 0
    for at in range(buffer.pos):
        assert buffer.observations[at] == pytest.approx(seen, abs=1e-4)
        step = again.advance(buffer.actions[at])
        following = np.array(step.observations)
        for index, final in step.final.items():
            following[index] = final
            ended += 1
        assert buffer.rewards[at] == pytest.approx(step.rewards, abs=1e-4)
        assert buffer.next_observations[at] == pytest.approx(following, abs=1e-4)
        seen = step.observations
    assert ended >= 4


def test_batches_and_the_policy_are_normalised_with_the_present_moments() -> None:
    made = learner(**SMALL)
    rows(made, 2)
    buffer, normaliser = made._model.replay_buffer, made.normaliser
    np.random.seed(3)
    batch = buffer.sample(50)
    np.random.seed(3)
    steps = np.random.randint(0, buffer.pos, size=50)
    environments = np.random.randint(0, high=4, size=(50,))
    spread = np.sqrt(normaliser.returned.variance + 1e-8)
    assert not 0.5 < spread < 2.0
    rewards = np.clip(buffer.rewards[steps, environments] / spread, -10.0, 10.0)
    assert batch.rewards.numpy()[:, 0] == pytest.approx(rewards, rel=1e-5)
    for stored, used in (
        ("observations", batch.observations),
        ("next_observations", batch.next_observations),
    ):
        values = getattr(buffer, stored)[steps, environments]
        assert differ({"": values}, {"": used.numpy()})
        assert np.array_equal(used.numpy(), normaliser.shown(values))
    seen = made._model._last_obs
    acted, _ = made._model.predict(seen, deterministic=True)
    expected, _ = made.policy.predict(normaliser.shown(seen), deterministic=True)
    assert np.array_equal(acted, expected)


@pytest.mark.parametrize("buffer_size", [400, 4000], ids=["full", "filling"])
def test_a_learner_of_sac_goes_on_with_its_replay_buffer(buffer_size: int, tmp_path: Path) -> None:
    fields = SMALL | {"buffer_size": buffer_size}
    whole = learner(**fields)
    expected = rows(whole, 6)
    for before_it in (1, 4):  # while actions are drawn at random, and after
        before = learner(**fields)
        rows(before, before_it)
        files = checkpoint.as_files(*before.snapshot(), {"algorithm": "SAC"})
        folder = RunFolder.create(tmp_path, "run", {}).save(before.steps, files)
        torch.manual_seed(99)
        np.random.seed(99)
        after = learner(**fields)
        after.restore(*checkpoint.read(folder))
        assert rows(after, 6 - before_it) == expected[before_it:]
        assert not differ(weights(whole), weights(after))
    smaller = learner(**{**fields, "buffer_size": 40})
    with pytest.raises(
        RunError, match="replay buffer of the checkpoint does not fit: continue with the buff"
    ):
        smaller.restore(*checkpoint.read(folder))
    policy, training, state = checkpoint.read(folder)
    with pytest.raises(RunError, match="has format 1, but this version continues SAC from format 2 only: st"):
        learner(**fields).restore(policy, training, state | {"format": 1})


@pytest.mark.parametrize("buffer_size", [80, 400, 4000], ids=["small", "full", "filling"])
def test_a_stop_in_the_middle_keeps_the_replay_of_the_last_iteration(buffer_size: int) -> None:
    left = [10**9]

    def asked() -> bool:
        left[0] -= 1
        return left[0] < 0

    made = learner(asked=asked, **SMALL, buffer_size=buffer_size)
    rows(made, 4)
    _, training, state = made.snapshot()
    assert np.shares_memory(training["replay.rewards"], made._model.replay_buffer.rewards)
    kept = {name: np.array(values) for name, values in training.items()}
    left[0] = 25
    assert made.iterate() is None
    assert made._model.replay_buffer.pos != state["replay"]["position"]
    _, training, after = made.snapshot()
    assert not differ(kept, training)
    assert after == state
    assert made._model.replay_buffer.state() == state["replay"]


def test_the_memory_of_a_checkpoint_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    needed: list[int] = []
    monkeypatch.setattr("joshua_ppo_trainer.learner.require", lambda count, *_: needed.append(count))
    made = learner(**SMALL, buffer_size=400)
    rows(made, 4)
    replay = [values for name, values in made.snapshot()[1].items() if name.startswith("replay.")]
    assert needed == [3 * sum(values.nbytes for values in replay)]
