"""Guardian and link, with a safe-stop action that writes what it is asked to into a file."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.guardian import main
from joshua.guardian.drop_order import DropOrder
from joshua.guardian.latch import EstopFiles, LatchFolder
from joshua.guardian.link import GuardianError, GuardianLink
from joshua.guardian.order import ARMED, DONE, GuardianOrder
from processes import children_of, parent_of
from stepped_time import SteppedTime

ACTION = """
import json, os, pathlib
from dataclasses import dataclass
from joshua.guardian.safe_stop import SafeStopRequest, SafeStopResult

@dataclass(frozen=True)
class act(SafeStopRequest):
    file: str = ""
    def run(self):
        pathlib.Path(self.file).write_text(json.dumps({**self.to_values(), "process_id": os.getpid()}))
        return SafeStopResult({"1": "released"})

class fail(act):
    def run(self):
        raise RuntimeError("no port")

class park(act):
    def run(self):
        import time
        super().run()
        time.sleep(0 if self.action == "RELEASE" else 60)
        return SafeStopResult({"1": "released" if self.action == "RELEASE" else "held"})

class held(act):
    def run(self):
        return SafeStopResult({"1": "held"})

class die(act):
    def run(self):
        import os
        os._exit(3)

class untyped(act):
    def run(self):
        return {"complete": True, "joints": {"1": "released"}}

def function(request):
    return {"complete": True}
"""


@pytest.fixture
def order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    (tmp_path / "a_device_action.py").write_text(ACTION)
    monkeypatch.syspath_prepend(str(tmp_path))

    def make(action: str = "a_device_action:act") -> GuardianOrder:
        return GuardianOrder(
            "/arm",
            action,
            {"action": "HOLD", "file": str(tmp_path / "done")},
            30.0,
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


def test_a_result_of_another_type_is_no_safe_state(order: Any) -> None:
    report = GuardianLink(order("a_device_action:untyped")).execute()
    assert not report["complete"]
    assert "untyped.run returned dict, not a SafeStopResult" in report["detail"]
    with pytest.raises(GuardianError, match="a_device_action:function is not a SafeStopRequest"):
        GuardianLink(order("a_device_action:function"))


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
    assert entry["text"] == "guardian: the driver ended without a safe stop; 1 released"
    assert entry["node"] == "/arm"


@pytest.mark.parametrize(
    "blocks", ["time.sleep(60)", "while True: pass", "os.kill(os.getpid(), signal.SIGSTOP)"]
)
def test_a_driver_that_blocks_is_killed_after_its_limit(order: Any, tmp_path: Path, blocks: str) -> None:
    program = (
        "import sys, os, signal, threading, time, dataclasses\n"
        "from joshua.guardian.link import GuardianLink\n"
        "from joshua.guardian.order import BEAT_S, GuardianOrder\n"
        "order = GuardianOrder.from_line(sys.argv[1].encode())\n"
        "ids = {'process_id': os.getpid(), 'thread_id': threading.get_native_id(), 'hang_limit_s': 0.3}\n"
        "link = GuardianLink(dataclasses.replace(order, **ids))\n"
        "link.armed()\n"
        "for _ in range(10):\n"
        "    link.beat()\n"
        "    time.sleep(BEAT_S)\n"
        f"{blocks}\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", program, order().to_line().decode()],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        timeout=60,
    )
    assert result.returncode == -signal.SIGKILL
    log = tmp_path / "log.jsonl"
    while not (log.exists() and log.read_text().endswith("\n")):
        time.sleep(0.01)
    text = "guardian: the driver hung: no heartbeat for 0.3 s; 1 released"
    assert json.loads(log.read_text())["text"] == text


def latched(order: GuardianOrder, tmp_path: Path) -> tuple[GuardianOrder, LatchFolder]:
    """An order of a robot that can be stopped."""
    release = {**order.request, "action": "RELEASE"}
    return replace(
        order,
        release_request=release,
        robot="desk",
        latch_folder=str(tmp_path / "estop"),
        estop_files=str(tmp_path / "files"),
    ), LatchFolder(tmp_path / "estop")


def done(tmp_path: Path) -> dict[str, Any]:
    values: dict[str, Any] = json.loads((tmp_path / "done").read_text())
    return values


def test_without_an_estop_the_safe_state_is_applied(order: Any, tmp_path: Path) -> None:
    GuardianLink(latched(order(), tmp_path)[0]).execute()
    assert done(tmp_path)["action"] == "HOLD"


def test_a_tripped_device_is_released_whatever_its_safe_state_is(order: Any, tmp_path: Path) -> None:
    link = GuardianLink(latched(order(), tmp_path)[0])
    link.release_only()
    assert link.execute()["complete"]
    assert done(tmp_path)["action"] == "RELEASE"


def test_an_estop_is_a_release_and_is_reported(order: Any, tmp_path: Path) -> None:
    guarded, folder = latched(order(), tmp_path)
    link = GuardianLink(guarded)
    latch = folder.set("desk", "/desk.pbtxt", 0, ["/arm"])
    assert link.execute()["complete"]
    assert done(tmp_path)["action"] == "RELEASE"
    report = EstopFiles(guarded.estop_files).read_report("/arm", latch.identifier)
    assert report is not None
    assert (report.by, report.complete, report.joints) == ("guardian", True, {"1": "released"})


def test_an_estop_ends_a_parking(order: Any, tmp_path: Path) -> None:
    guarded, folder = latched(order("a_device_action:park"), tmp_path)
    link = GuardianLink(replace(guarded, timeout_s=50.0))
    reports: list[dict[str, Any]] = []
    thread = threading.Thread(target=lambda: reports.append(link.execute()))
    thread.start()
    while not (tmp_path / "done").exists():
        time.sleep(0.01)
    folder.set("desk", "/desk.pbtxt", 0, ["/arm"])
    thread.join(60.0)
    assert reports[0]["joints"] == {"1": "released"}


def test_the_order_to_drop_ends_a_parking(order: Any, tmp_path: Path) -> None:
    guarded = latched(order("a_device_action:park"), tmp_path)[0]
    parks = {**guarded.request, "action": "PARK_THEN_RELEASE"}
    link = GuardianLink(replace(guarded, request=parks, timeout_s=50.0))
    reports: list[dict[str, Any]] = []
    thread = threading.Thread(target=lambda: reports.append(link.execute()))
    thread.start()
    while not (tmp_path / "done").exists():
        time.sleep(0.01)
    DropOrder(guarded.estop_files).give()
    thread.join(60.0)
    assert reports[0]["joints"] == {"1": "released"}


def test_the_order_to_drop_does_not_concern_an_arm_that_holds(order: Any, tmp_path: Path) -> None:
    guarded = latched(order(), tmp_path)[0]
    DropOrder(guarded.estop_files).give()
    assert GuardianLink(guarded).execute()["complete"]
    assert done(tmp_path)["action"] == "HOLD"


@pytest.mark.parametrize(
    ("action", "left"),
    [("a_device_action:act", []), ("a_device_action:held", ["record"]), ("a_device_action:fail", ["record"])],
)
def test_the_record_of_torque_goes_with_the_torque(
    order: Any, tmp_path: Path, action: str, left: list[str]
) -> None:
    records = tmp_path / "energised"
    records.mkdir()
    (records / "record").touch()
    link = GuardianLink(replace(order(action), energised_record=str(records / "record")))
    link.execute()
    assert [path.name for path in records.iterdir()] == left


def test_an_estop_that_fails_is_reported_as_failed(order: Any, tmp_path: Path) -> None:
    guarded, folder = latched(order("a_device_action:fail"), tmp_path)
    link = GuardianLink(guarded)
    latch = folder.set("desk", "/desk.pbtxt", 0, ["/arm"])
    assert not link.execute()["complete"]
    report = EstopFiles(guarded.estop_files).read_report("/arm", latch.identifier)
    assert report is not None
    assert not report.complete
    assert "no port" in report.detail


@pytest.mark.parametrize(
    ("action", "detail"),
    [
        ("a_device_action:park", "the safe-stop action did not return within 1.6 s"),
        ("a_device_action:die", "the safe-stop action ended its process without a report"),
    ],
)
def test_an_action_that_never_reports_is_ended(order: Any, action: str, detail: str) -> None:
    report = GuardianLink(replace(order(action), timeout_s=0.1)).execute()
    assert (report["complete"], report["detail"]) == (False, detail)


def test_the_process_of_the_action_exists_before_it_is_needed(order: Any, tmp_path: Path) -> None:
    link = GuardianLink(order())
    (waiting,) = children_of(link.process_id)
    assert b"joshua-guardian: safe-stop action" in Path(f"/proc/{waiting}/cmdline").read_bytes()
    assert link.execute()["complete"]
    assert done(tmp_path)["process_id"] == waiting
    assert parent_of(waiting) == 0


def test_an_action_whose_waiting_process_was_killed_is_carried_out(order: Any, tmp_path: Path) -> None:
    link = GuardianLink(order())
    (waiting,) = children_of(link.process_id)
    os.kill(waiting, signal.SIGKILL)
    assert link.execute()["complete"]
    assert done(tmp_path)["action"] == "HOLD"


def test_the_waiting_process_ends_with_its_guardian(order: Any) -> None:
    link = GuardianLink(order())
    (waiting,) = children_of(link.process_id)
    os.kill(link.process_id, signal.SIGKILL)
    with pytest.raises(GuardianError, match="has ended"):  # noqa: PT012 (the fork knew the link)
        while True:
            link.beat()
            time.sleep(0.01)
    while parent_of(waiting):
        time.sleep(0.01)
    link.done()


def test_a_guardian_that_does_not_listen_guards_nobody(order: Any) -> None:
    link = GuardianLink(order())
    link.armed()
    os.kill(link.process_id, signal.SIGSTOP)
    with pytest.raises(GuardianError, match="has not read for some seconds"):  # noqa: PT012
        for _ in range(600):
            link.beat()
    os.kill(link.process_id, signal.SIGKILL)
    link.done()


@pytest.mark.parametrize("steps", [[7.0], [0.0] * 60])
def test_only_time_in_which_a_guardian_could_look_counts_before_the_first_beat(
    monkeypatch: pytest.MonkeyPatch, steps: list[float]
) -> None:
    ours, theirs = socket.socketpair()
    clock, left = SteppedTime(), [*steps]

    def select_(reading: list[Any], _writing: Any, _errors: Any, pause_s: float) -> Any:
        if left:
            clock.sleep(pause_s + left.pop())
            return [], [], []
        ours.send(DONE)
        return reading, [], []

    monkeypatch.setattr(main, "time", clock)
    order = GuardianOrder("/arm", "a:b", {}, 5.0, os.getpid(), threading.get_native_id())
    with ours, theirs:
        ours.send(ARMED)
        guardian = main.Guardian(theirs, order, lambda request: {})
        reads = iter([([theirs], [], [])])
        looks = SimpleNamespace(select=lambda *words: next(reads, None) or select_(*words))
        monkeypatch.setattr(main, "select", looks)
        hung = "the driver hung while it switched torque on or off"
        assert guardian._watch() == ("" if len(steps) == 1 else hung)
