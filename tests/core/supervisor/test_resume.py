"""``resume`` through the control socket of a run, and the state ``fault`` of a node."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from joshua.ipc.client import ask, running_systems
from joshua.plan import NodeKind, RunReport
from joshua.supervisor.heartbeats import HANG_AFTER_S
from joshua.supervisor.policies import LadderTimes

ARM = "/arm"
RESUMED = {"reply": {"text": "has torque again"}, "node": ARM}


class RunIsOverError(Exception):
    """Nobody is there to be asked any more."""


class User:
    """Somebody in another terminal, who works while the run runs."""

    def __init__(self, robot: Any, work: Callable[[User], None]) -> None:
        self.robot = robot
        self.wish = robot.folder / "wish"
        self.will("resume")
        self._work = work
        self._over = threading.Event()
        self._errors: list[BaseException] = []

    def run(self, *others: Any, **options: Any) -> RunReport:
        settings = {"wish": str(self.wish)}
        node = self.robot.node(
            "Faulty", "arm", kind=NodeKind.ACTUATOR, module="resume_behaviours", settings=settings
        )
        thread = threading.Thread(target=self._do)
        thread.start()
        try:
            report: RunReport = self.robot.run(node, *others, duration_s=90.0, **options)
        finally:
            self._over.set()
            thread.join()
        if self._errors:
            raise self._errors[0]
        return report

    def _do(self) -> None:
        try:
            self.wait_for("fault")
            try:
                self._work(self)
            finally:
                with contextlib.suppress(RunIsOverError):
                    self.ask({"request": "stop"})
        except BaseException as error:  # noqa: BLE001 (raised again by the test's own thread)
            self._errors.append(error)

    def will(self, wish: str) -> None:
        """Lets the arm do something from now on; it never reads half a word."""
        whole = self.wish.with_suffix(".new")
        whole.write_text(wish)
        whole.replace(self.wish)

    def ask(self, request: dict[str, Any]) -> dict[str, Any]:
        base: Path = self.robot.options().run_base
        while not self._over.is_set():
            if systems := running_systems(base):
                with contextlib.suppress(FileNotFoundError, ConnectionError):  # not yet, or not any more
                    return ask(systems[0][0] / "control.sock", request, 60.0)
            time.sleep(0.01)
        raise RunIsOverError

    def resume(self, node: str = ARM) -> dict[str, Any]:
        """What the command asks for: a driver that stays down is started first."""
        return self.ask({"request": "call", "node": node, "verb": "resume", "timeout_s": 45.0, "start": True})

    def arm(self) -> dict[str, Any]:
        status = self.ask({"request": "status"})["status"]
        return next(dict(node) for node in status["nodes"] if node["full_name"] == ARM)

    def wait_for(self, state: str) -> dict[str, Any]:
        deadline_s = time.monotonic() + 60
        while (arm := self.arm())["state"] != state:
            assert time.monotonic() < deadline_s, arm
            time.sleep(0.01)
        return arm


def test_a_fault_is_a_state_of_its_own_and_ends_by_resume(robot: Any) -> None:
    def work(user: User) -> None:
        assert user.arm()["reason"] == "tripped"
        assert user.resume() == RESUMED
        assert user.wait_for("ready")["reason"] == ""

    report = User(robot, work).run()
    assert report.exit_code == 0, robot.ui.text()
    assert "fault" in robot.ui.kinds(ARM)
    assert "WARNING /arm: resume: has torque again" in robot.ui.text()


def test_a_refusal_changes_nothing_and_the_run_ends_with_1(robot: Any) -> None:
    def work(user: User) -> None:
        user.will("refuse")
        assert user.resume() == {"error": "still too hot", "code": "refused"}
        assert user.wait_for("fault")["restarts"] == 0

    report = User(robot, work).run()
    assert report.exit_code == 1
    assert report.nodes[0].reason == "tripped"


def test_a_failure_while_resuming_is_answered_and_restarts_the_node(robot: Any) -> None:
    def work(user: User) -> None:
        user.will("fail")
        answer = user.resume()
        assert answer == {"error": "/arm failed: the cable is gone", "code": "failed"}
        user.will("resume")
        deadline_s = time.monotonic() + 60
        while user.arm()["restarts"] == 0:
            assert time.monotonic() < deadline_s
            time.sleep(0.01)
        user.wait_for("fault")
        assert user.resume() == RESUMED

    User(robot, work).run()


def test_nothing_is_started_again_while_the_run_stops(robot: Any) -> None:
    gate = robot.folder / "gate"

    def work(user: User) -> None:
        try:
            user.ask({"request": "stop"})
            user.wait_for("stopped")
            answer = user.resume()
            assert "the run is stopping" in answer["error"]
        finally:
            gate.touch()

    waits = robot.node("StopsLate", module="resume_behaviours", settings={"gate": str(gate)})
    report = User(robot, work).run(waits, ladder=LadderTimes(40.0, 10.0))
    assert {node.full_name: node.state for node in report.nodes} == {ARM: "stopped", "/stopslate": "stopped"}


def test_resuming_may_take_longer_than_a_loop_may_be_silent(
    robot: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(HANG_AFTER_S, NodeKind.ACTUATOR, 1.0)

    def work(user: User) -> None:
        user.will("slow")
        assert user.resume() == RESUMED
        assert user.wait_for("ready")["restarts"] == 0

    report = User(robot, work).run()
    assert report.exit_code == 0, robot.ui.text()


def test_two_users_at_once_get_the_same_answer(robot: Any) -> None:
    def work(user: User) -> None:
        user.will("wait")
        answers: list[dict[str, Any]] = []
        threads = [threading.Thread(target=lambda: answers.append(user.resume())) for _ in range(2)]
        for thread in threads:
            thread.start()
        user.wait_for("resuming")
        time.sleep(0.5)  # the other one asks, too; where it does so later, there is nothing to resume
        user.will("resume")
        for thread in threads:
            thread.join()
        assert answers == [RESUMED] * 2

    User(robot, work).run()


def test_a_node_that_stays_down_is_started_again(robot: Any) -> None:
    def work(user: User) -> None:
        user.will("gone")
        user.resume()
        deadline_s = time.monotonic() + 60
        while "stays down" not in robot.ui.text():
            assert time.monotonic() < deadline_s
            time.sleep(0.01)
        refused = user.resume()
        assert refused["code"] == "gone"
        assert refused["error"] == "/arm ended before it answered resume: it failed: the arm is not there"
        user.will("resume")
        while user.resume() != RESUMED:  # unless it starts just now
            assert time.monotonic() < deadline_s
        user.wait_for("ready")

    report = User(robot, work).run(robot.node("Ticking"))
    assert report.exit_code == 0, robot.ui.text()


def test_what_cannot_be_resumed_is_said(robot: Any) -> None:
    def work(user: User) -> None:
        leg = user.resume("/leg")
        assert leg == {
            "error": "this run has no node '/leg'",
            "code": "unknown-node",
            "allowed": ["/arm", "/ticking"],
        }
        assert user.resume("/ticking") == {"error": "/ticking has no verb 'resume'", "code": "unknown-verb"}

    User(robot, work).run(robot.node("Ticking"))


def test_an_estop_is_noted_in_the_log(robot: Any) -> None:
    def work(user: User) -> None:
        assert user.ask({"request": "estop", "process_id": 77}) == {"noted": True}
        user.ask({"request": "estop", "process_id": 78, "released": True})

    User(robot, work).run()
    assert "CRITICAL : the e-stop is latched by process 77" in robot.ui.text()
    assert "CRITICAL : the e-stop is released by process 78" in robot.ui.text()
