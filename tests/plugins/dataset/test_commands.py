"""``joshua dataset`` and ``joshua record`` at the terminal, without a run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import pytest
from joshua.supervisor.tables import Screen
from joshua_dataset.commands import dataset, record
from small_dataset import write


def run(module: Any, *words: str) -> int:
    parser = argparse.ArgumentParser()
    module.add_arguments(parser)
    return int(module.run(parser.parse_args(words)))


def test_info_describes_a_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path)
    assert run(dataset, "info", str(tmp_path)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{tmp_path}: 2 episodes, 5 frames, 0.5 s at 10 Hz"
    assert lines[1] == "robot type: arm   layout: v3.0   pictures: video h264"
    assert "  action                       float32 2 rad   pan, lift" in lines
    assert lines[-2:] == ["  task 0: wave", "  task 1: point"]


@pytest.mark.parametrize("action", ["info", "stats"])
def test_tables_fit_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, action: str
) -> None:
    folder = tmp_path / "set"
    write(folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Screen, "of", lambda stream: Screen(50))
    assert run(dataset, action, "set") == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 50
    assert any("lift" in line for line in lines)


def test_a_folder_without_a_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for action in ("info", "repair"):
        assert run(dataset, action, str(tmp_path)) == 1
        expected = f"joshua dataset {action}: {tmp_path} is not a data set: it has no meta/info.json\n"
        assert capsys.readouterr().err == expected


def test_repair_of_a_complete_data_set(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path)
    assert run(dataset, "repair", str(tmp_path)) == 0
    assert capsys.readouterr().out == (
        f"{tmp_path} is complete: 2 episodes. `joshua dataset check` finds nothing serious: 2 episodes, 5 "
        "rows, the headers of 2 videos and 5 pictures were read\n"
    )


def test_record_without_a_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("JOSHUA_RUN_DIR", str(tmp_path))
    assert run(record, "start") == 1
    assert "no recorder is running: start a file with a data_store block" in capsys.readouterr().err
    assert run(record, "start", "now") == 2
    assert capsys.readouterr().err == "joshua record start: only `task` takes a text\n"


def test_the_screen_fits_the_terminal() -> None:
    status = {
        "phase": "recording",
        "task": "Put the red cube into the box " * 5,
        "episode": 3,
        "kept": 2,
        "wanted": 10,
        "frames": 91,
        "elapsed_s": 3.0,
        "remaining_s": 17.0,
        "rates_hz": {"observation.state": 50.0, "observation.images.top": 0.0, "action": 49.9},
        "worst_alignment_s": 0.012,
        "dropped": 1,
        "held": 0,
        "missing": ["action"],
        "queue_s": 0.1,
        "encoder_load": 0.31,
        "free_bytes": 83_000_000_000,
        "folder": "/data/waves",
        "message": "",
    }
    lines = record.screen(status, 80).splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0] == "episode 3  recording  3 s, 17 s left"
    assert "kept in this run: 2 of 10   frames: 91   dropped: 1   held: 0" in lines
    assert "worst alignment: 12.0 ms   queue: 0.1 s   encoders: 31 %" in lines
    assert any("observation.images.top" in line and line.endswith("no message") for line in lines)
    assert any("action" in line and line.endswith("missing in the last frame") for line in lines)
