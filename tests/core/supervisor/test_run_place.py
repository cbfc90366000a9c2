"""A run whose directory is removed, as the system does at the last log-out of a user."""

from __future__ import annotations

import contextlib
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from joshua.ipc.client import ask, running_systems
from joshua.supervisor.run_directory import NodesInUseError, RunDirectory

READY = "all nodes ready after"
LOST = "joshua estop and stop do not find this run"


def wait_until(condition: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.01)


def wait_for_run(base: Any) -> Any:
    wait_until(lambda: any((path / "control.sock").exists() for path, _ in running_systems(base)))
    return running_systems(base)[0]


def put_in_the_way(base: Path, text: str) -> None:
    """Removes a folder and puts a file there, however often the run is faster and makes it anew."""
    deadline_s = time.monotonic() + 60
    while not base.is_file():
        assert time.monotonic() < deadline_s
        with contextlib.suppress(OSError):
            shutil.rmtree(base, ignore_errors=True)
            base.write_text(text)


def test_a_run_makes_its_place_anew_and_is_found_again(robot: Any) -> None:
    base, seen = robot.options().run_base, []

    def remove_and_stop() -> None:
        path, info = wait_for_run(base)
        wait_until(lambda: READY in robot.ui.text())  # a stop during the start may kill the node
        put_in_the_way(base, "for a moment")
        wait_until(lambda: LOST in robot.ui.text())
        base.unlink()
        again, _ = wait_for_run(base)
        seen.append((again, (again / "log.jsonl").exists()))
        with pytest.raises(NodesInUseError):
            RunDirectory.create(base, "/other.pbtxt", info.domain_id, ["/quiet"])
        assert ask(again / "control.sock", {"request": "stop"}, 60.0) == {"stopping": True}
        seen.append(path)

    thread = threading.Thread(target=remove_and_stop)
    thread.start()
    report = robot.run(robot.node("Quiet"), duration_s=90.0, status_period_s=0.1)
    thread.join()
    assert seen[0] == (seen[1], True)
    assert report.exit_code == 0, robot.ui.text()
    text = robot.ui.text()
    assert text.count(LOST) == 1
    assert "the directory of this run was removed and has been created again" in text
    assert running_systems(base) == []


def test_a_place_that_cannot_be_made_anew_stops_no_node(robot: Any) -> None:
    base = robot.options().run_base

    def spoil() -> None:
        wait_for_run(base)
        wait_until(lambda: READY in robot.ui.text())  # the links between nodes start there
        put_in_the_way(base, "for good")

    thread = threading.Thread(target=spoil)
    thread.start()
    looks: list[None] = []

    def reached() -> bool:
        """It was said, and looked for again several times since."""
        if LOST in robot.ui.text():
            looks.append(None)
        return len(looks) > 10

    report = robot.run_until(reached, robot.node("Quiet"))
    thread.join()
    assert report.exit_code == 0, robot.ui.text()
    assert robot.ui.text().count(LOST) == 1


def test_a_control_socket_that_is_removed_comes_back(robot: Any) -> None:
    base = robot.options().run_base

    def remove_and_stop() -> None:
        path, _ = wait_for_run(base)
        wait_until(lambda: READY in robot.ui.text())
        (path / "control.sock").unlink()
        again, _ = wait_for_run(base)
        assert ask(again / "control.sock", {"request": "stop"}, 60.0) == {"stopping": True}

    thread = threading.Thread(target=remove_and_stop)
    thread.start()
    report = robot.run(robot.node("Quiet"), duration_s=90.0, status_period_s=0.1)
    thread.join()
    assert report.exit_code == 0, robot.ui.text()
    assert "stopped by `joshua stop`" in robot.ui.text()
