"""Metrics that TensorBoard shows."""

from __future__ import annotations

import resource
from pathlib import Path

import pytest
from joshua_training.board import Board
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator


def test_a_continued_run_supersedes_what_came_after_its_checkpoint(tmp_path: Path) -> None:
    first = Board(tmp_path)
    for steps in (10, 20, 30):
        first.add({"loss/train": 1.0 / steps, "steps": steps}, steps)
    first.close()
    second = Board(tmp_path, 20)
    second.add({"loss/train": 0.5}, 25)
    second.close()
    read = EventAccumulator(str(tmp_path))
    read.Reload()
    assert read.Tags()["scalars"] == ["loss/train"]
    assert [event.step for event in read.Scalars("loss/train")] == [10, 20, 25]


def test_a_full_disk_is_an_error_where_a_row_is_added(tmp_path: Path) -> None:
    board = Board(tmp_path)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60, before[1]))
    try:
        with pytest.raises(OSError, match="File too large"):
            board.add({"loss/train": 1.0}, 1)
        board.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
