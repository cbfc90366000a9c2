"""Calls on the control socket: what is passed on, and what is answered where nobody can."""

from __future__ import annotations

import os
import signal
import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest
from joshua.ipc import messages as ipc
from joshua.ipc.client import ask, running_systems
from joshua.supervisor.reactor import Reactor
from joshua.supervisor.run_requests import RunRequests

ARM = "/arm"


class Process:
    """A node's process."""

    alive, restart_timer = True, None

    def __init__(self, state: str = "ready", reason: str = "") -> None:
        self.records = {ARM: SimpleNamespace(state=state, reason=reason, doing="in its loop")}
        self.sent: list[Any] = []
        self.revived = 0

    def send(self, message: Any) -> None:
        self.sent.append(message)

    def revive(self) -> None:
        self.revived += 1


class Desk:
    """The requests of a run with one node, and what they wrote into the log."""

    def __init__(self, process: Process, phase: str = "running") -> None:
        self.lines: list[str] = []
        self.answers: list[dict[str, Any]] = []
        self.reactor = Reactor()
        status = SimpleNamespace(phase=phase, nodes=[SimpleNamespace(full_name=ARM)])
        processes: Any = [process]
        logbook: Any = SimpleNamespace(write=lambda level, text, node="": self.lines.append(text))
        run_status: Any = lambda: status  # noqa: E731
        self.requests = RunRequests(logbook, self.reactor, processes, run_status, self.lines.append)

    def call(self, **request: Any) -> Any:
        client: Any = SimpleNamespace(closed=False, send=self.answers.append)
        assert self.requests.handlers()["call"]({"node": "arm", "verb": "wave", **request}, client) is None
        return client

    def refused(self, **request: Any) -> dict[str, Any]:
        client: Any = None
        answer = self.requests.handlers()["call"]({"node": "arm", "verb": "wave", **request}, client)
        assert isinstance(answer, dict)
        return answer


LATCH = {
    "identifier": "e1",
    "robot": "desk",
    "source": "/desk.pbtxt",
    "domain_id": 7,
    "nodes": [ARM],
    "since": "today",
    "process_id": 1,
}


def estop(desk: Desk, **request: Any) -> tuple[Any, list[dict[str, Any]]]:
    """What an e-stop answers at once, and where its reports arrive."""
    reports: list[dict[str, Any]] = []
    client: Any = SimpleNamespace(closed=False, send=reports.append)
    return desk.requests.handlers()["estop"]({"process_id": 5, **request}, client), reports


def test_an_estop_reaches_the_nodes_and_their_reports_the_command() -> None:
    process = Process()
    desk = Desk(process)
    answer, reports = estop(desk, latch=LATCH)
    assert answer == {"noted": True}
    assert process.sent == [ipc.Estop(latch=LATCH, stored=True)]
    desk.requests.estopped(ipc.Estopped(node=ARM, report={"latch": "e1"}))
    assert reports == [{"report": {"latch": "e1"}}]
    desk.requests.ready(process)  # type: ignore[arg-type]
    assert len(process.sent) == 1, "a restarted node reads the file"
    assert estop(desk, released=True, held_only=True)[0] == {"noted": True, "held": False}
    assert len(process.sent) == 1, "nothing was held here, so nothing is released"


def test_an_estop_that_is_no_file_is_kept_for_restarted_nodes_until_its_release() -> None:
    process = Process()
    desk = Desk(process)
    told = ipc.Estop(latch=LATCH, stored=False)
    estop(desk, latch=LATCH, stored=False)
    desk.requests.ready(process)  # type: ignore[arg-type]
    assert process.sent == [told, told]
    assert estop(desk, released=True, held_only=True)[0] == {"noted": True, "held": True}
    assert process.sent[2:] == [ipc.Estop()]
    desk.requests.ready(process)  # type: ignore[arg-type]
    assert len(process.sent) == 3


@pytest.mark.parametrize("latch", [{}, {**LATCH, "more": 1}, {**LATCH, "nodes": 3}, 7, [LATCH]])
def test_an_estop_of_nonsense_is_refused_and_told_to_nobody(latch: Any) -> None:
    process = Process()
    desk = Desk(process)
    answer, _ = estop(desk, latch=latch)
    assert answer["code"] == "invalid"
    assert process.sent == []


@pytest.mark.parametrize(("waits", "sent"), [([True], 1), ([False], 0), ([False, True], 1)])
def test_a_node_is_asked_only_if_somebody_still_waits_for_it(waits: list[bool], sent: int) -> None:
    process = Process("restarting")
    desk = Desk(process)
    for still_waits in waits:
        desk.call(start=True).closed = not still_waits
    desk.requests.ready(process)  # type: ignore[arg-type]
    assert [message.node for message in process.sent] == [ARM] * sent
    assert process.revived == 0


def test_a_late_reply_is_nobodys_answer() -> None:
    process = Process()
    desk = Desk(process)
    desk.call(timeout_s=0.01)
    while not desk.answers:
        desk.reactor.turn()
    assert desk.answers == [
        {
            "error": "/arm has not answered wave within 0.01 s: it is in its loop; a later answer is dropped",
            "code": "timeout",
        }
    ]
    desk.call(timeout_s=60.0)
    first, second = process.sent
    assert first.id != second.id
    assert first.deadline_ns < time.monotonic_ns() < second.deadline_ns
    desk.requests.replied(ipc.CallReply(id=first.id, node=ARM, ok=True, payload={"text": "late"}))
    assert len(desk.answers) == 1
    desk.requests.replied(ipc.CallReply(id=second.id, node=ARM, ok=True, payload={"text": "waved"}))
    assert desk.answers[1:] == [{"reply": {"text": "waved"}, "node": ARM}]
    assert desk.lines[-2:] == [f"late answer to call {first.id}: ", "wave: waved"]


def test_a_node_that_ends_meanwhile_is_named_with_its_reason() -> None:
    process = Process(reason="it hung")
    desk = Desk(process)
    desk.call()
    desk.requests.ended(process)  # type: ignore[arg-type]
    assert desk.answers == [
        {
            "error": "/arm ended before it answered wave: it failed: it hung",
            "code": "gone",
        }
    ]


def test_a_node_that_stays_down_is_started_only_on_demand() -> None:
    process = Process("failed", "the cable is gone")
    process.alive = False
    desk = Desk(process)
    assert desk.refused() == {"error": "/arm stays down: the cable is gone", "code": "not-running"}
    desk.call(start=True)
    assert process.revived == 1
    assert process.sent == []


@pytest.mark.parametrize(
    ("phase", "state", "text"),
    [
        ("running", "starting", "/arm is starting: try again"),
        ("running", "restarting", "/arm is restarting: try again"),
        ("stopping", "ready", "the run is stopping and /arm is not running: start the run again"),
    ],
)
def test_a_node_that_cannot_answer_now_is_said(phase: str, state: str, text: str) -> None:
    assert Desk(Process(state), phase).refused() == {"error": text, "code": "not-running"}


def test_what_is_no_call_is_said() -> None:
    desk = Desk(Process())
    assert desk.refused(node="amr") == {
        "error": "this run has no node 'amr'",
        "code": "unknown-node",
        "allowed": [ARM],
    }
    for request in ({"node": 1}, {"verb": None}, {"payload": []}):
        assert desk.refused(**request) == {
            "error": "a call needs the names of node and verb, and an object as payload",
            "code": "invalid",
        }
    for timeout_s in (0, -1, 1e9, "1", float("nan")):
        assert desk.refused(timeout_s=timeout_s)["error"].startswith(f"timeout_s is {timeout_s!r}; allowed")


def test_what_a_node_could_not_read_does_not_reach_it() -> None:
    process = Process()
    desk = Desk(process)
    deep: Any = []
    for _ in range(500):
        deep = [deep]
    for payload in ({"text": "\ud800"}, {"deep": deep}):
        assert desk.refused(payload=payload)["error"].startswith("the call cannot be passed on: ")
    assert process.sent == []


@pytest.mark.parametrize("announced_s", [0.0, 0.5], ids=["before the end", "after the end"])
def test_why_a_guardian_killed_a_driver_is_the_reason_of_its_failure(robot: Any, announced_s: float) -> None:
    def act_as_guardian(table: Any) -> None:
        def act() -> None:
            ((path, _),) = running_systems(robot.options().run_base)
            announcement = {"request": "guardian", "node": "/quiet", "kills": "the driver hung"}
            if not announced_s:
                assert ask(path / "control.sock", announcement, 60.0) == {"written": True}
            os.kill(table.nodes[0].process_id, signal.SIGKILL)
            if announced_s:
                while "was killed by SIGKILL" not in robot.ui.text():
                    time.sleep(0.01)
                assert ask(path / "control.sock", announcement, 60.0) == {"written": True}

        threading.Thread(target=act).start()

    robot.ui.on_ready = act_as_guardian
    reason = "its guardian killed it: the driver hung"
    robot.run_until(
        lambda: any(node.reason == reason for status in robot.ui.statuses for node in status.nodes),
        robot.node("Quiet", restart="never"),
        robot.node("Quiet", "other"),
    )
    report = robot.ui.reports[-1]
    assert report.nodes[0].reason == reason
