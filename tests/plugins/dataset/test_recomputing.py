"""Statistics are replaced wherever a layout keeps them, and only by numbers."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path

import damaged_sets
import lerobot_sets
import pytest
from joshua_dataset.checking import check
from joshua_dataset.metadata import EPISODES_STATS, STATS
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.recomputing import recompute, recomputed
from joshua_dataset.writer import LeRobotWriter
from lerobot_sets import V21, V30
from small_dataset import frame, layout


@pytest.mark.parametrize("version", [V30, V21])
@pytest.mark.parametrize(
    "name", ["statistics missing", "statistics torn", "statistics wrong", "statistics not a number"]
)
def test_statistics_are_made_again(tmp_path: Path, version: str, name: str) -> None:
    lerobot_sets.make(tmp_path, version)
    before = Dataset.read(tmp_path).statistics()
    damaged_sets.damage(tmp_path, version, name)
    recompute(tmp_path, workers=1)
    after = Dataset.read(tmp_path).statistics()
    assert set(after) == set(before)
    for key, values in before.items():
        assert after[key]["max"].tolist() == values["max"].tolist(), key
    assert not [str(problem) for problem in check(tmp_path, workers=1)]
    assert (tmp_path / EPISODES_STATS).exists() == (version == V21)
    assert (tmp_path / STATS).exists() == (version == V30)


def test_statistics_of_episodes_are_made_again(tmp_path: Path) -> None:
    lerobot_sets.make(tmp_path, V30)
    damaged_sets.damage(tmp_path, V30, "statistics of an episode")
    assert [str(problem) for problem in check(tmp_path, workers=1)]
    recompute(tmp_path, workers=1)
    assert not [str(problem) for problem in check(tmp_path, workers=1)]


@pytest.mark.parametrize("version", [V30, V21])
@pytest.mark.parametrize("name", ["state not a number", "action infinite"])
def test_no_statistic_is_written_that_is_not_a_number(tmp_path: Path, version: str, name: str) -> None:
    lerobot_sets.make(tmp_path, version)
    damaged_sets.damage(tmp_path, version, name)
    path = tmp_path / (STATS if version == V30 else EPISODES_STATS)
    before = path.read_bytes()
    key, frame = ("observation.state", 2) if "state" in name else ("action", 3)
    expected = (
        rf"{key} has values that are not finite numbers in episode 1 of .*, frame {frame}, so .*Run `joshua"
    )
    for compute in (recompute, recomputed):
        with pytest.raises(DatasetError, match=expected):
            compute(tmp_path, workers=1)
    assert path.read_bytes() == before


def refused(text: str) -> float:
    raise AssertionError(f"{text} is no JSON")


def test_json_of_the_statistics_is_json(tmp_path: Path) -> None:
    lerobot_sets.make(tmp_path, V30)
    json.loads((tmp_path / STATS).read_text(), parse_constant=refused)


def test_a_recorded_value_that_is_no_number_is_null_in_the_statistics(tmp_path: Path) -> None:
    with contextlib.closing(LeRobotWriter(layout(tmp_path))) as writer:
        writer.open()
        for number in range(3):
            changes = {"action": [0.5, float("nan")]} if number == 1 else {}
            writer.add_frame(frame(number, 1000 + number, changes))
        writer.end_episode("wave")
    stored = json.loads((tmp_path / STATS).read_text(), parse_constant=refused)
    assert stored["action"]["max"] == [2.5, None]
    assert any("action" in problem.text for problem in check(tmp_path, workers=1) if problem.serious)
