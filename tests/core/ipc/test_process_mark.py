"""Marks of processes: a mark kills its own process, and no other that has its id."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from joshua.ipc.process_mark import ProcessMark

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="this system has no /proc")


@pytest.fixture
def sleeper() -> Iterator[subprocess.Popen[str]]:
    """A process that has one child, whose id it prints."""
    code = (
        "import subprocess, sys, time\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'])\n"
        "print(child.pid, flush=True)\n"
        "time.sleep(600)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        yield process
        process.kill()


def await_state(mark: ProcessMark, state: str) -> None:
    deadline_s = time.monotonic() + 60
    while mark.state != state:
        assert time.monotonic() < deadline_s, mark.state
        time.sleep(0.01)


def test_a_mark_follows_its_process(sleeper: subprocess.Popen[str]) -> None:
    mark = ProcessMark.of(sleeper.pid, "driver")
    assert ProcessMark.from_values(mark.to_values()) == mark
    assert str(mark) == f"driver (process {sleeper.pid})"
    assert mark.state == "running"
    os.kill(sleeper.pid, signal.SIGSTOP)
    await_state(mark, "stopped")
    sleeper.kill()
    await_state(mark, "gone")  # a zombie, until it is waited for
    sleeper.wait()
    assert mark.state == "gone"


@pytest.mark.parametrize("with_children", [False, True])
def test_a_stopped_process_is_killed_with_its_children_if_wanted(
    sleeper: subprocess.Popen[str], with_children: bool
) -> None:
    assert sleeper.stdout is not None
    child = ProcessMark.of(int(sleeper.stdout.readline()), "action")
    mark = ProcessMark.of(sleeper.pid, "guardian")
    os.kill(sleeper.pid, signal.SIGSTOP)
    await_state(mark, "stopped")
    assert mark.kill(60.0, with_children=with_children)
    assert mark.state == "gone"
    assert child.state == ("gone" if with_children else "running")
    assert child.kill(60.0)


@pytest.mark.parametrize(
    ("other", "state"),
    [
        (lambda mark: replace(mark, started=mark.started - 1), "gone"),
        (lambda mark: replace(mark, boot="another"), "gone"),
        (lambda mark: replace(mark, namespace="pid:[1]"), "unknown"),
        (lambda mark: replace(mark, started=-1), "unknown"),
    ],
    ids=["used again", "before a restart of the system", "in another container", "without a start"],
)
def test_another_process_with_the_same_id_is_not_killed(
    sleeper: subprocess.Popen[str], other: Callable[[ProcessMark], ProcessMark], state: str
) -> None:
    mark = ProcessMark.of(sleeper.pid, "driver")
    recycled = other(mark)
    assert recycled.state == state
    assert recycled.kill(0.1, with_children=True) == (state == "gone")
    assert mark.state == "running"
