"""The presets that record and replay, without hardware: emulated, and simulated."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.testing.program import JoshuaProgram
from joshua_dataset.reader import Dataset

CONFIGS = Path(__file__).parents[2] / "configs"
SHORT = {"auto_start": "true", "num_episodes": "1", "episode_duration_s": "1"}


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
