"""The presets that record and replay, without hardware: emulated, and simulated."""

from __future__ import annotations

import fcntl
import os
import time
from pathlib import Path

import numpy as np
import pytest
from joshua.testing.program import JoshuaProgram
from joshua.tools import RunningSystem
from joshua_dataset.reader import Dataset

CONFIGS = Path(__file__).parents[2] / "configs"

#: At 10 Hz, since other tests may keep the processor from drawing two pictures of 640 x 480 at 30 Hz.
SHORT = {"auto_start": "true", "num_episodes": "1", "episode_duration_s": "2", "fps": "10"}


@pytest.mark.parametrize("how", ["--emulate", "--sim"])
def test_an_episode_is_recorded_and_replayed(joshua_run: JoshuaProgram, tmp_path: Path, how: str) -> None:
    folder = tmp_path / "demos"
    place = f"ai.data_store.local_path={folder}"
    words = [word for name, value in SHORT.items() for word in ("--set", f"ai.data_store.{name}={value}")]
    recorded = joshua_run("--config", str(CONFIGS / "data_store_record.pbtxt"), how, "--set", place, *words)
    assert recorded.returncode == 0, recorded.stdout + recorded.stderr
    (episode,) = Dataset.read(folder).episode_list()
    assert episode.length >= 10
    assert len(episode.pictures) == 2
    replayed = joshua_run("--config", str(CONFIGS / "data_store_replay.pbtxt"), how, "--set", place)
    text = replayed.stdout + replayed.stderr
    assert replayed.returncode == 0, text
    assert "tracking error of episode 0" in text
    assert "ended with 0: /data_store: 1 episodes are replayed" in text


def test_an_expert_shows_a_task_to_the_recorder(joshua_run: JoshuaProgram, tmp_path: Path) -> None:
    folder = tmp_path / "demos"
    changes = {
        "simulation.model_path": '"so_arm100/reach.xml"',
        "robot.actions[expert].sim_config.demonstrate": '"joshua/SoArm100Reach-v0"',
        "robot.perceptions[camera_work].sim_camera_config.camera": '"top"',
        "ai.data_store.local_path": str(folder),
    }
    words = [word for path, value in changes.items() for word in ("--set", f"{path}={value}")]
    run = joshua_run.start("--config", str(CONFIGS / "data_store_demonstrations.pbtxt"), *words)
    until_s = time.monotonic() + 120
    shown = joshua_run("demonstrate", "--run", "--episodes", "1")
    while shown.returncode != 0 and time.monotonic() < until_s and run.poll() is None:
        time.sleep(0.5)  # the run is not there yet, or has no message of a camera yet
        shown = joshua_run("demonstrate", "--run", "--episodes", "1")
    (system,) = RunningSystem.all(joshua_run.environment)
    other = os.open(system.path, os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)  # as another command does while it shows episodes
    refused = joshua_run("demonstrate", "--run")
    os.close(other)
    said, errors = joshua_run.stop(run)
    assert shown.returncode == 0, shown.stderr + said + errors
    assert "episode 1 of 1\n1 episodes recorded" in shown.stdout
    assert refused.returncode == 1
    assert "another `joshua demonstrate --run` shows episodes to process" in refused.stderr
    assert "wait until it ends, or stop it with Ctrl-C" in refused.stderr
    recorded = Dataset.read(folder)
    first = next(iter(recorded.episode_list()))
    assert sorted(first.pictures) == ["observation.images.work", "observation.images.wrist"]
    assert set(recorded.features) == {"acquisition_ns", "observation.state", "action", *first.pictures}
    assert recorded.fps == 25
    columns = recorded.columns(first)
    assert columns["stamp_ns"][-1] < 1000e9, "simulated time, as the preset says"
    assert "the stamps of" not in said + errors
    assert columns["action"].shape == columns["observation.state"].shape == (first.length, 6)
    moved = np.abs(columns["action"][-1] - columns["action"][0]).max()
    assert moved > 2  # of 200 in the units of LeRobot
    assert np.abs(columns["action"] - columns["observation.state"]).max() < 60
