"""The second road to the safe state: real drivers and guardians that are killed under a server of orders."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from joshua.guardian.drop_order import DropOrder

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs a subreaper")

ACTION = """
import json, os, signal, sys
from dataclasses import dataclass
from joshua.guardian.safe_stop import SafeStopRequest, SafeStopResult

@dataclass(frozen=True)
class act(SafeStopRequest):
    file: str = ""
    def run(self):
        act = {"action": self.action, "forked": "mark_of_the_server" in sys.modules}
        with open(self.file, "a") as file:
            file.write(json.dumps(act) + "\\n")
        return SafeStopResult({"1": "released"})

class killer(act):
    def run(self):
        super().run()
        os.kill(os.getppid(), signal.SIGKILL)
        return SafeStopResult({"1": "released"})
"""

#: A server with one driver, which ends in the way of each test.
SERVER = """
import os, selectors, signal, socket, sys, threading, time, types
from dataclasses import replace
from joshua.guardian import standby
from joshua.guardian.link import GuardianLink
from joshua.guardian.order import GuardianOrder
from joshua.supervisor.standby import Standby

sys.modules["mark_of_the_server"] = types.ModuleType("mark_of_the_server")
orders = Standby(selectors.DefaultSelector())
ours, theirs = socket.socketpair(type=socket.SOCK_SEQPACKET)
driver = os.fork()
if driver == 0:
    standby.adopt(theirs.detach())
    order = GuardianOrder.from_line(sys.argv[1].encode())
    order = replace(order, process_id=os.getpid(), thread_id=threading.get_native_id())
    link = GuardianLink(order)
    link.armed()
    guardian = link.process_id
    exec(sys.argv[2])
    os.kill(os.getpid(), signal.SIGKILL)
theirs.close()
orders.add(driver, ours)
while True:
    try:
        process_id, status = os.waitpid(-1, os.WNOHANG)
    except ChildProcessError:
        break
    if process_id:
        orders.ended(process_id, status)
    else:
        orders.look()
        time.sleep(0.01)
print(orders.busy)
"""


def acts(
    tmp_path: Path, ending: str, action: str = "a_standby_action:act", safe_state: str = "HOLD"
) -> list[dict[str, Any]]:
    """Runs a driver that is killed after ``ending``. Returns what was applied, in order."""
    (tmp_path / "a_standby_action.py").write_text(ACTION)
    order = {
        "node": "/arm",
        "implementation": action,
        "request": {"action": safe_state, "file": str(tmp_path / "acts")},
        "release_request": {"action": "RELEASE", "file": str(tmp_path / "acts")},
        "timeout_s": 30.0,
        "process_id": 0,
        "thread_id": 0,
        "hang_limit_s": 30.0,
        "log": str(tmp_path / "log.jsonl"),
        "estop_files": str(tmp_path / "files"),
        "energised_record": str(tmp_path / "record"),
    }
    result = subprocess.run(
        [sys.executable, "-c", SERVER, json.dumps(order), ending],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        stdout=subprocess.PIPE,
        text=True,
        timeout=120,
    )
    assert (result.returncode, result.stdout) == (0, "False\n")
    file = tmp_path / "acts"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def reported(tmp_path: Path) -> list[str]:
    """Texts of the reports in the log."""
    return [json.loads(line)["text"] for line in (tmp_path / "log.jsonl").read_text().splitlines()]


KILL_GUARDIAN = "os.kill(guardian, signal.SIGKILL)"
BOTH_ENDED = "guardian: the driver and its guardian ended without a safe stop"


def test_the_server_acts_without_a_fresh_interpreter_when_driver_and_guardian_are_killed(
    tmp_path: Path,
) -> None:
    assert acts(tmp_path, KILL_GUARDIAN) == [{"action": "HOLD", "forked": True}]
    assert reported(tmp_path) == [f"{BOTH_ENDED}; 1 released"]


def test_a_guardian_that_acts_is_not_doubled(tmp_path: Path) -> None:
    assert acts(tmp_path, "") == [{"action": "HOLD", "forked": False}]
    assert reported(tmp_path) == ["guardian: the driver ended without a safe stop; 1 released"]


def test_a_driver_in_its_safe_state_leaves_nothing_to_do(tmp_path: Path) -> None:
    assert acts(tmp_path, "link.done()") == []


def test_a_tripped_device_is_released_by_the_server_too(tmp_path: Path) -> None:
    assert acts(tmp_path, f"link.release_only(); {KILL_GUARDIAN}") == [{"action": "RELEASE", "forked": True}]


def test_the_server_forgets_the_torque_that_it_took_off(tmp_path: Path) -> None:
    (tmp_path / "record").touch()
    acts(tmp_path, KILL_GUARDIAN, safe_state="RELEASE")
    assert not (tmp_path / "record").exists()


def test_the_server_does_not_park_after_the_order_to_drop(tmp_path: Path) -> None:
    DropOrder(str(tmp_path / "files")).give()
    dropped = [{"action": "RELEASE", "forked": True}]
    assert acts(tmp_path, KILL_GUARDIAN, safe_state="PARK_THEN_RELEASE") == dropped


def test_a_stopped_guardian_is_replaced(tmp_path: Path) -> None:
    stop = "os.kill(guardian, signal.SIGSTOP)"
    assert acts(tmp_path, stop) == [{"action": "HOLD", "forked": True}]


def test_a_guardian_that_its_driver_has_reaped_counts_as_ended(tmp_path: Path) -> None:
    reap = f"{KILL_GUARDIAN}; os.waitpid(guardian, 0)"
    assert acts(tmp_path, reap) == [{"action": "HOLD", "forked": True}]


def test_a_forked_guardian_that_is_killed_is_replaced_a_few_times(tmp_path: Path) -> None:
    assert (
        acts(tmp_path, KILL_GUARDIAN, "a_standby_action:killer") == [{"action": "HOLD", "forked": True}] * 3
    )


def test_an_action_that_cannot_be_imported_is_reported(tmp_path: Path) -> None:
    other = "standby.keep(replace(order, implementation='gone:act'), guardian)"
    ending = f"{other}; {KILL_GUARDIAN}"
    assert acts(tmp_path, ending) == []
    (text,) = reported(tmp_path)
    assert text.startswith(f"{BOTH_ENDED}; no joint confirmed its safe state; the safe-stop action failed: ")
    assert "No module named 'gone'" in text
