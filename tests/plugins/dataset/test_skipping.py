"""One damaged episode does not refuse the others."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import damaged_sets
import lerobot_sets
import pytest
from joshua_dataset.checking import check
from joshua_dataset.commands import dataset as command
from joshua_dataset.lock import PRIVATE
from joshua_dataset.reader import Dataset
from lerobot_sets import LENGTHS, V21, V30
from small_dataset import TOP, write


def run(*words: str) -> int:
    import argparse

    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return int(command.run(parser.parse_args(words)))


def lengths(folder: Path) -> list[int]:
    assert not [str(problem) for problem in check(folder, workers=1) if problem.serious]
    return [episode.length for episode in Dataset.read(folder).episode_list()]


@pytest.fixture(params=["rows torn", "rows missing", "state not a number", "video torn", "video missing"])
def torn(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """Return a data set whose second episode is damaged."""
    folder = tmp_path / f"{request.param.replace(' ', '_')}_set"
    lerobot_sets.make(folder, V21)
    damaged_sets.damage(folder, V21, request.param)
    return folder


COMMANDS: dict[str, tuple[tuple[str, ...], list[int]]] = {
    "convert": (("convert", "SET", "TARGET"), [6, 7, 4]),
    "convert to another codec": (("convert", "SET", "TARGET", "--codec", "hevc"), [6, 7, 4]),
    "split": (("split", "SET", "TARGET", "--episodes", "1-2"), [7]),
    "merge": (("merge", "SET", "SET", "--into", "TARGET"), [6, 7, 4] * 2),
    "delete": (("delete", "SET", "--episodes", "0"), [7, 4]),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_a_damaged_episode_is_named_and_left_out(
    torn: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    if name == "delete" and "state" in torn.name:
        pytest.skip("the other episodes can be read, and stay as they are")
    words, expected = COMMANDS[name]
    places = {"SET": str(torn), "TARGET": str(tmp_path / "target")}
    chosen = [places.get(word, word) for word in words]
    assert run(*chosen, "--workers", "1") == 1
    said = capsys.readouterr().err
    again = f"joshua dataset {shlex.join(chosen)} --skip-damaged"
    assert f"`{again}`" in said, said
    assert "episode 1" in said
    assert not (tmp_path / "target").exists()
    assert run(*again.split()[2:], "--workers", "1") == 0
    said = capsys.readouterr().out
    assert f"left out: episode 1 of {torn}: " in said
    made = torn if name == "delete" else tmp_path / "target"
    assert lengths(made) == expected
    if name == "delete":
        (aside,) = (torn / PRIVATE / "aside").iterdir()
        assert (aside / "data/chunk-000/episode_000000.parquet").is_file()


def test_damage_of_the_whole_data_set_is_repaired(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "set"
    lerobot_sets.make(folder, V30)
    damaged_sets.damage(folder, V30, "tasks missing")
    assert run("convert", str(folder), str(tmp_path / "target"), "--skip-damaged", "--workers", "1") == 1
    said = capsys.readouterr().err
    assert "has damage that is not in single episodes, so none can be left out for it: " in said
    assert said.endswith(f"Run `joshua dataset repair {folder}`\n")


def test_nothing_is_left_out_of_a_data_set_without_damage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "set"
    lerobot_sets.make(folder, V30)
    assert run("convert", str(folder), str(tmp_path / "target"), "--skip-damaged", "--workers", "1") == 0
    assert capsys.readouterr().out == f"{tmp_path / 'target'}: 4 episodes\n"
    assert lengths(tmp_path / "target") == list(LENGTHS)


def test_a_torn_video_of_our_own_is_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Videos of the recorder are copied without being decoded."""
    folder = tmp_path / "set"
    write(folder, lengths=(3, 2, 4))
    video = folder / f"videos/{TOP}/chunk-000/file-001.mp4"
    content: Any = bytearray(video.read_bytes())
    content[len(content) // 3 : len(content) // 3 + 200] = bytes(200)
    video.write_bytes(content)
    assert run("convert", str(folder), str(tmp_path / "target"), "--skip-damaged", "--workers", "1") == 0
    assert f"left out: episode 1 of {folder}: " in capsys.readouterr().out
    assert lengths(tmp_path / "target") == [3, 4]
