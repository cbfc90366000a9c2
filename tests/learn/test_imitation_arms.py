"""A recording of two arms teaches one policy, which names the joints as a model of two arms does."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
from joshua_dataset.reader import Dataset
from joshua_imitation.build import build
from joshua_imitation.data import Recording, open_dataset
from joshua_imitation.learner import POLICY
from joshua_imitation.settings import ImitationSettings
from joshua_lerobot.settings import LeRobotSettings
from joshua_training.run_folder import RunFolder
from tiny_recordings import JOINTS, write_recording

ARMS = ("left_arm", "right_arm")
NAMES = tuple(f"{side}_{joint}" for side in ("left", "right") for joint in JOINTS)


def test_two_arms_are_read_as_one(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "two", arms=ARMS)
    plain = Dataset.read(folder)
    joined, _ = open_dataset(str(folder))
    for key in ("observation.state", "action"):
        assert key not in plain.features
        assert joined.features[key].names == NAMES
        assert not [other for other in joined.features if other.startswith(f"{key}.")]
        statistics, parts = joined.statistics()[key], [plain.statistics()[f"{key}.{arm}"] for arm in ARMS]
        assert np.array_equal(statistics["std"], np.concatenate([part["std"] for part in parts]))
        assert statistics["count"] == parts[0]["count"]
    numbers = Recording(joined).numbers["action"]
    episodes = [plain.columns(episode) for episode in plain.episode_list()]
    for at, arm in enumerate(ARMS):
        own = np.concatenate([columns[f"action.{arm}"] for columns in episodes])
        assert np.array_equal(numbers[:, 6 * at : 6 * at + 6], own)


def test_the_policy_of_two_arms_names_their_joints(tmp_path: Path) -> None:
    folder = write_recording(tmp_path / "two", arms=ARMS)
    settings = ImitationSettings(
        dataset=str(folder),
        num_epochs=1,
        batch_size=8,
        max_steps=2,
        learning_rate=1e-3,
        chunk_size=8,
        hidden_size=32,
        feedforward_size=32,
        encoder_layers=1,
        validation_share=0.0,
        workers=1,
        device="cpu",
    )
    built = build(settings)
    assert (built.features["observation.state"], built.features["action"]) == ([12], [12])
    with contextlib.closing(built.album):
        built.album.fill(lambda count: True)
        learner = built.learner(RunFolder.create(tmp_path, "run", {}))
        while learner.steps < learner.total:
            learner.update()
        checkpoint = learner.save() / POLICY
        learner.close()
    needs = LeRobotSettings(weights=str(checkpoint)).needs()
    assert needs.action is not None
    assert needs.action.names == NAMES
    assert next(item for item in needs.features or () if item.key == "observation.state").names == NAMES
