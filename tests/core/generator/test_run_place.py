"""A run whose directory is removed, as the system does at the last log-out of a user."""

from __future__ import annotations

import shutil
import threading
import time
from typing import Any

import pytest
from joshua.generator.control_server import ask
from joshua.generator.run_directory import NodesInUseError, RunDirectory, running_systems


def wait_for_run(base: Any) -> Any:
    deadline_s = time.monotonic() + 30
    while not (systems := running_systems(base)) or not (systems[0][0] / "control.sock").exists():
        assert time.monotonic() < deadline_s
        time.sleep(0.01)
    return systems[0]


def test_a_run_makes_its_place_anew_and_is_found_again(robot: Any) -> None:
    base, seen = robot.options().run_base, []

    def remove_and_stop() -> None:
        path, info = wait_for_run(base)
        shutil.rmtree(base)
        base.write_text("in the way for a moment")
        time.sleep(0.3)
        base.unlink()
        again, _ = wait_for_run(base)
        seen.append((again, (again / "log.jsonl").exists()))
        with pytest.raises(NodesInUseError):
            RunDirectory.create(base, "/other.pbtxt", info.domain_id, ["/quiet"])
        assert ask(again / "control.sock", {"request": "stop"}) == {"stopping": True}
        seen.append(path)

    thread = threading.Thread(target=remove_and_stop)
    thread.start()
    report = robot.run(robot.node("Quiet"), duration_s=60.0, status_period_s=0.1)
    thread.join()
    assert seen[0] == (seen[1], True)
    assert report.exit_code == 0, robot.ui.text()
    text = robot.ui.text()
    assert text.count("joshua estop and stop do not find this run") == 1
    assert "the directory of this run was removed, and is made anew" in text
    assert running_systems(base) == []


def test_a_place_that_cannot_be_made_anew_stops_no_node(robot: Any) -> None:
    base = robot.options().run_base

    def spoil() -> None:
        wait_for_run(base)
        shutil.rmtree(base)
        base.write_text("in the way for good")

    thread = threading.Thread(target=spoil)
    thread.start()
    report = robot.run(robot.node("Quiet"), duration_s=0.6, status_period_s=0.1)
    thread.join()
    assert report.exit_code == 0, robot.ui.text()
    assert robot.ui.text().count("joshua estop and stop do not find this run") == 1
