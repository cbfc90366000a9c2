"""A recorder apart from a run: the thread of its writer, and how a session comes to its end."""

from __future__ import annotations

import errno
import os
import queue
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.api import RefusedError
from joshua.api.nodes import ServiceFacts
from joshua.features import Feature
from joshua.messages.make import joint_state
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.testing.recording_context import RecordingContext
from joshua_dataset.changes import Change
from joshua_dataset.reader import Dataset
from joshua_dataset.recorder import Recorder
from joshua_dataset.repair import repair
from joshua_dataset.session import Phase
from joshua_dataset.settings import StoreSettings
from joshua_dataset.writer import DatasetWriter

TOPIC = "/arm/joint_states"


class Context:
    """Counts the thread's signs of life: a thread that does not ask counts as hung after a while."""

    asked = 0

    @property
    def stopping(self) -> bool:
        self.asked += 1
        return True


def test_a_writer_that_always_has_work_shows_signs_of_life() -> None:
    context, work = Context(), queue.Queue[Any]()
    done: list[int] = []
    for number in range(200):
        work.put(lambda number=number: done.append(number))
    parts = SimpleNamespace(
        _context=context, _work=work, _session=SimpleNamespace(phase=Phase.DONE), _writer=None, _busy=(0, 0)
    )
    Recorder._write(parts)  # type: ignore[arg-type]
    assert len(done) == 200
    assert context.asked >= 200


class Cell:
    """A recorder of one arm that starts by itself and records one episode of 0.2 s."""

    def __init__(self, folder: Path) -> None:
        store = "joshua_dataset.node:DataStore"
        topics = (TopicSpec(name=TOPIC, type_name="sensor_msgs/msg/JointState"),)
        names = {"behaviour": store, "implementation": store}
        spec = NodeSpec(name="data_store", kind=NodeKind.SERVICE, subscriptions=topics, **names)
        self.context = RecordingContext(spec)
        ends = {"num_episodes": 1, "episode_duration_s": 0.2, "reset_duration_s": 0.0, "auto_start": True}
        settings = StoreSettings(folder=str(folder), fps=20, **ends)
        feature = Feature.joints("observation.state", ("pan",), topic=TOPIC)
        self.recorder = Recorder(self.context, settings, ServiceFacts(features=(feature,)))
        self.recorder.configure()
        self.recorder.activate()

    def feed(self) -> None:
        self.context.receive(TOPIC, joint_state(("pan",), [0.0], at_ns=time.time_ns()))

    def run_until(self, look: Callable[[], object], *, fed: bool = True) -> None:
        deadline_s = time.monotonic() + 30
        while not look():
            assert time.monotonic() < deadline_s
            if fed:
                self.feed()
            self.context.tick("frames")
            time.sleep(0.01)

    @property
    def phase(self) -> str:
        return self.recorder.status().phase


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Cell]:
    made = Cell(tmp_path / "waves")
    yield made
    made.recorder.deactivate()
    made.context.stop()
    made.recorder.cleanup()


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """A disk that takes an episode when the event is set."""
    ready = threading.Event()
    written = DatasetWriter.end_episode

    def end_episode(writer: DatasetWriter, *arguments: Any) -> None:
        ready.wait()
        written(writer, *arguments)

    monkeypatch.setattr(DatasetWriter, "end_episode", end_episode)
    yield ready
    ready.set()


def test_a_run_ends_when_its_last_episode_is_on_the_disk(
    disk: threading.Event, cell: Cell, tmp_path: Path
) -> None:
    cell.run_until(lambda: cell.phase == "done")
    cell.context.tick("frames", 5)
    assert cell.context.ends == []
    disk.set()
    cell.run_until(lambda: cell.context.ends)
    assert cell.context.ends[0] == f"1 episodes are in {tmp_path / 'waves'}"
    assert Dataset.read(tmp_path / "waves").episodes == 1


def test_a_stop_waits_for_the_disk(disk: threading.Event, cell: Cell, tmp_path: Path) -> None:
    cell.run_until(lambda: cell.phase == "done")
    late = threading.Timer(0.2, disk.set)
    late.start()
    cell.recorder.deactivate()  # an upload of all episodes follows
    assert Dataset.read(tmp_path / "waves").episodes == 1
    late.join()


def test_a_last_episode_without_a_frame_is_recorded_anew(cell: Cell, tmp_path: Path) -> None:
    cell.feed()
    cell.run_until(lambda: "has no frame" in cell.recorder.status().message, fed=False)
    assert cell.recorder.status().kept == 0
    cell.run_until(lambda: cell.context.ends)
    assert cell.context.ends[0] == f"1 episodes are in {tmp_path / 'waves'}"
    assert Dataset.read(tmp_path / "waves").episodes == 1


def test_an_episode_that_the_disk_refuses_waits_until_it_is_kept(
    cell: Cell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(change: Change) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def refusal() -> str:
        """Starts an episode, again if the messages became stale meanwhile; returns why it is refused."""
        while True:
            cell.feed()
            with pytest.raises(RefusedError) as refused:
                cell.recorder.start()
            if "every topic" not in str(refused.value):
                return str(refused.value)

    with monkeypatch.context() as patch:
        patch.setattr(Change, "commit", refuse)
        cell.run_until(lambda: "No space left" in cell.recorder.status().message)
        found = cell.recorder.status()
        assert (found.phase, found.kept) == ("stopped", 0)
        assert found.frames > 0
        folder = tmp_path / "waves"
        assert found.message == (
            f"{folder}: the episode cannot be kept: No space left on device. Nothing of it was removed: "
            f"it is in {folder}/.joshua/open. Free some space, then run `joshua record keep`"
        )
        with pytest.raises(RefusedError, match="No space left"):
            cell.recorder.keep()
        assert "No space left" in refusal()  # it keeps the waiting one first
        again = cell.recorder.status()
        assert (again.phase, again.kept, again.frames) == ("stopped", 0, found.frames)
    assert cell.context.ends == []
    assert cell.recorder.keep().startswith(f"episode 0 is kept: {found.frames} frames")
    cell.run_until(lambda: cell.context.ends)
    assert Dataset.read(folder).frames == found.frames


def test_an_episode_that_no_disk_takes_is_left_for_a_repair(
    cell: Cell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def refuse(change: Change) -> None:
        raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))

    folder = tmp_path / "waves"
    with monkeypatch.context() as patch:
        patch.setattr(Change, "commit", refuse)
        cell.run_until(lambda: "quota" in cell.recorder.status().message)
        frames = cell.recorder.status().frames
        cell.recorder.deactivate()
        assert cell.recorder.status().message.endswith(
            f"Free some space, or have your disk quota raised, then run `joshua dataset repair {folder}`"
        )
        cell.context.stop()
        cell.recorder.cleanup()
    assert f"episode 0 is completed with {frames} frames" in str(repair(folder))
    assert Dataset.read(folder).frames == frames
