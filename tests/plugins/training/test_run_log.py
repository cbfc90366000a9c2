"""The log in the folder of a run, written by a node that works on its thread."""

from __future__ import annotations

import json
import logging
from pathlib import Path

import pytest
from joshua.api import NodeContext
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from joshua_training.run_folder import RunError, RunFolder
from joshua_training.run_log import RunLog
from joshua_training.trainer import RunNode


class Work(RunNode):
    """Reports all that a run can, or fails."""

    def __init__(self, context: NodeContext, parent: Path, failure: Exception | None = None) -> None:
        super().__init__(context)
        self._parent, self._failure = parent, failure

    def configure(self) -> None:
        """Begin a run."""
        self.context.log.info("computes on a CPU")
        self.begin(str(self._parent), "run", {})

    def work(self) -> None:
        """Report."""
        self.context.log.debug("nobody keeps this")
        self.warn("a worker is lost")
        if self._failure is not None:
            raise self._failure
        self.end_run("10 steps learned")


@pytest.fixture
def context(caplog: pytest.LogCaptureFixture) -> RecordingContext:
    spec = NodeSpec(name="worker", kind=NodeKind.SERVICE, behaviour="", implementation="")
    made = RecordingContext(spec)
    caplog.set_level(logging.DEBUG, made.log.name)
    return made


def worked(node: Work, context: RecordingContext) -> list[str]:
    """Run a node to its end, and return the lines of its log without the time."""
    node.configure()
    node.activate()
    assert node._ended.wait(60)
    try:
        context.stop()
    finally:
        node.cleanup()
        context.log.info("this is after the end")
    return said(node.folder.path)


def said(run: Path) -> list[str]:
    return [line.partition(" ")[2] for line in (run / "run.log").read_text().splitlines()]


def test_a_run_keeps_what_its_node_reports_and_how_it_ended(
    tmp_path: Path, context: RecordingContext
) -> None:
    node = Work(context, tmp_path)
    assert worked(node, context) == [
        "INFO computes on a CPU",
        f"INFO this run is in {node.folder.path}",
        "WARNING a worker is lost",
        "INFO 10 steps learned",
    ]
    assert (context.warnings, context.ends) == (["a worker is lost"], ["10 steps learned"])
    began = json.loads((node.folder.path / "run.json").read_text())["started"]
    time, _, _ = (node.folder.path / "run.log").read_text().partition(" ")
    assert len(time) == len(began)
    assert time[:13] >= began[:13]
    continued = RunLog(context.log)
    continued.open(RunFolder.open(node.folder.path))
    context.log.info("continuing after 10 steps")
    continued.close()
    continued.close()
    assert said(node.folder.path)[-2:] == ["INFO 10 steps learned", "INFO continuing after 10 steps"]


def test_a_failure_is_the_last_line(tmp_path: Path, context: RecordingContext) -> None:
    node = Work(context, tmp_path, RunError("the loss is not a number: lower learning_rate"))
    with pytest.raises(RunError):
        worked(node, context)
    assert said(node.folder.path)[-1] == "ERROR the loss is not a number: lower learning_rate"


def test_a_defect_is_written_with_its_place(tmp_path: Path, context: RecordingContext) -> None:
    node = Work(context, tmp_path, ZeroDivisionError("division by zero"))
    with pytest.raises(ZeroDivisionError):
        worked(node, context)
    text = (node.folder.path / "run.log").read_text()
    assert "ERROR ZeroDivisionError: division by zero\nTraceback (most recent call last):" in text
    assert "in work\n    raise self._failure" in text


def test_a_log_that_cannot_be_written_says_so(tmp_path: Path, context: RecordingContext) -> None:
    log = RunLog(context.log)
    folder = RunFolder(tmp_path / "gone")
    with pytest.raises(RunError, match=r"gone/run\.log cannot be written: No such file .*: create it again"):
        log.open(folder)
    log.close()
