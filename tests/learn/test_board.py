"""Metrics that TensorBoard shows."""

from __future__ import annotations

import resource
from collections.abc import Mapping
from pathlib import Path

import pytest
from joshua.api import NodeContext
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from joshua_training.board import Board
from joshua_training.summaries import read_rows
from joshua_training.trainer import LearningNode
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


class Learns(LearningNode):
    """Learns 30 steps, loses what is after 10 of them, and learns to 40."""

    total = 40
    steps = 0

    def __init__(self, context: NodeContext, parent: Path) -> None:
        super().__init__(context)
        self._parent, self._lost = parent, False

    def configure(self) -> None:
        """Begin a run."""
        self.begin(str(self._parent), "run", {})

    def advance(self) -> Mapping[str, float]:
        """Learn ten steps."""
        if self.steps == 30 and not self._lost:
            self._lost, self.steps = True, 10
            self.rewind(10)
        self.steps += 10
        return {"steps": self.steps, "loss/train": 2.0 if self._lost else 1.0}

    def save(self) -> Path:
        """Write a checkpoint."""
        return self.folder.save(self.steps, {"weights": b"1"})


def test_a_run_that_begins_again_supersedes_what_it_computes_again(tmp_path: Path) -> None:
    spec = NodeSpec(name="worker", kind=NodeKind.SERVICE, behaviour="", implementation="")
    node = Learns(RecordingContext(spec), tmp_path)
    node.configure()
    node.work()
    node.cleanup()
    expected = [(10, 1.0), (20, 2.0), (30, 2.0), (40, 2.0)]
    assert [(row["steps"], row["loss/train"]) for row in read_rows(node.folder)] == expected
    read = EventAccumulator(str(node.folder.path / "tensorboard"))
    read.Reload()
    assert [(event.step, event.value) for event in read.Scalars("loss/train")] == expected


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
