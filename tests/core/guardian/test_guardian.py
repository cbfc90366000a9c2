"""Guardian and link, with a safe-stop action that writes what it is asked to into a file."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from joshua.guardian.driver_process import DriverProcess
from joshua.guardian.link import GuardianError, GuardianLink
from joshua.guardian.order import GuardianOrder
from joshua.guardian.silence import TICK_S, SilenceWatch

ACTION = """
import json, pathlib
def act(request):
    pathlib.Path(request["file"]).write_text(json.dumps(request))
    return {"complete": True, "joints": {"1": "released"}}
def fail(request):
    raise RuntimeError("no port")
"""


@pytest.fixture
def order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    (tmp_path / "a_device_action.py").write_text(ACTION)
    monkeypatch.syspath_prepend(str(tmp_path))

    def make(action: str = "a_device_action:act") -> GuardianOrder:
        return GuardianOrder(
            "/arm",
            action,
            {"file": str(tmp_path / "done")},
            5.0,
            os.getpid(),
            threading.get_native_id(),
            hang_limit_s=30.0,
            log=str(tmp_path / "log.jsonl"),
        )

    return make


def test_it_ends_without_acting_when_the_safe_state_stands(order: Any, tmp_path: Path) -> None:
    link = GuardianLink(order())
    link.armed()
    link.beat()
    link.stopping()
    link.done()
    link.done()
    assert not (tmp_path / "done").exists()
    assert not Path(f"/proc/{link.process_id}").exists()


def test_it_acts_on_request_and_answers(order: Any, tmp_path: Path) -> None:
    link = GuardianLink(order())
    link.armed()
    report = link.execute()
    assert report["complete"]
    assert report["joints"] == {"1": "released"}
    assert (tmp_path / "done").exists()


def test_an_action_that_fails_is_reported(order: Any) -> None:
    report = GuardianLink(order("a_device_action:fail")).execute()
    assert not report["complete"]
    assert "the safe-stop action failed: RuntimeError('no port')" in report["detail"]


def test_an_action_that_is_missing_is_an_error_before_torque(order: Any) -> None:
    with pytest.raises(GuardianError, match="has no attribute 'melt'"):
        GuardianLink(order("a_device_action:melt"))


def test_a_report_reaches_the_log_of_a_run_without_supervisor(order: Any, tmp_path: Path) -> None:
    program = (
        "import sys, os, threading, dataclasses\n"
        "from joshua.guardian.link import GuardianLink\n"
        "from joshua.guardian.order import GuardianOrder\n"
        "order = GuardianOrder.from_line(sys.argv[1].encode())\n"
        "ids = {'process_id': os.getpid(), 'thread_id': threading.get_native_id()}\n"
        "link = GuardianLink(dataclasses.replace(order, **ids))\n"
        "link.armed()\n"
        "print(link.process_id, flush=True)\n"
        "os._exit(9)\n"
    )
    line = order().to_line().decode()
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    result = subprocess.run(
        [sys.executable, "-c", program, line], capture_output=True, text=True, env=environment, timeout=60
    )
    assert result.returncode == 9, result.stderr
    log = tmp_path / "log.jsonl"
    waiting = threading.Event()
    for _ in range(600):
        if log.exists() and log.read_text().endswith("\n"):
            break
        waiting.wait(0.05)
    entry = json.loads(log.read_text())
    assert entry["text"] == "guardian: the driver ended without letting go; 1 released"
    assert entry["node"] == "/arm"


class Driver(DriverProcess):
    """A driver whose share of the processor is given."""

    def __init__(self) -> None:
        self.times: tuple[int, int] | None = (0, 0)
        self.runnable = False

    def processor_ns(self) -> tuple[int, int] | None:
        return self.times

    def is_runnable(self) -> bool:
        return self.runnable


def silent_until(watch: SilenceWatch, begin_s: float, end_s: float, step_s: float = TICK_S) -> bool:
    now_s = begin_s
    while now_s < end_s:
        now_s += step_s
        if watch.hung(now_s):
            return True
    return False


def test_silence_beyond_the_limit_is_a_hang() -> None:
    watch = SilenceWatch(Driver(), 0.2)
    watch.heard(1.0)
    assert not silent_until(watch, 1.0, 1.1)
    assert silent_until(watch, 1.12, 1.3)


def test_a_machine_that_stood_still_is_no_hang() -> None:
    watch = SilenceWatch(Driver(), 0.2)
    watch.heard(1.0)
    assert not watch.hung(1.9)


def test_a_driver_that_waits_for_a_processor_does_not_hang_yet() -> None:
    driver = Driver()
    watch = SilenceWatch(driver, 0.2)
    watch.heard(1.0)
    driver.runnable = True
    assert not silent_until(watch, 1.0, 1.8)
    assert silent_until(watch, 1.8, 2.2)  # but not for ever


def test_a_driver_that_is_busy_with_something_else_hangs() -> None:
    driver = Driver()
    watch = SilenceWatch(driver, 0.2)
    watch.heard(1.0)
    driver.runnable, driver.times = True, (200_000_000, 0)
    assert silent_until(watch, 1.0, 1.3)
