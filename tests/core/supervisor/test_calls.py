"""Calls from outside to nodes in real processes: each way in which one can end."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from joshua.ipc.client import CallError, RunningSystem, running_systems
from joshua.plan import RunReport

NODE = "/waver"


class Caller:
    """Somebody in another terminal, who calls while the run runs."""

    def __init__(self, robot: Any, work: Callable[[Caller], None]) -> None:
        self.robot = robot
        self.gate = robot.folder / "gate"
        self.system: Any = None
        self._work = work
        self._errors: list[BaseException] = []

    def run(self) -> RunReport:
        node = self.robot.node("Waver", module="verb_behaviours", settings={"gate": str(self.gate)})
        thread = threading.Thread(target=self._do)
        thread.start()
        try:
            report: RunReport = self.robot.run(node, self.robot.node("Ticking"), duration_s=90.0)
        finally:
            thread.join()
        if self._errors:
            raise self._errors[0]
        return report

    def _do(self) -> None:
        try:
            end_s = time.monotonic() + 60
            while self.system is None or self.state() != "ready":
                assert time.monotonic() < end_s
                if systems := running_systems(self.robot.options().run_base):
                    self.system = RunningSystem(*systems[0])
                time.sleep(0.02)
            self._work(self)
        except BaseException as error:  # noqa: BLE001 (raised again by the test's own thread)
            self._errors.append(error)
        finally:
            self.gate.touch()
            if self.system is not None:
                with contextlib.suppress(CallError):
                    self.system.stop()

    def state(self) -> str:
        with contextlib.suppress(CallError):
            return next(str(n.state) for n in self.system.status().nodes if n.full_name == NODE)
        return ""

    def call(self, verb: str, timeout_s: float = 60.0, **payload: Any) -> dict[str, Any]:
        reply: dict[str, Any] = self.system.call("waver", verb, payload, timeout_s=timeout_s)
        return reply

    def refused(self, verb: str, timeout_s: Any = 60.0, **payload: Any) -> CallError:
        with pytest.raises(CallError) as caught:
            self.call(verb, timeout_s, **payload)
        return caught.value


def test_a_verb_is_listed_called_and_logged(robot: Any) -> None:
    def work(user: Caller) -> None:
        names = [info.name for info in user.system.verbs(NODE)]
        assert names[:3] == ["chatter", "die", "doze"]
        assert user.system.verbs("ticking") == ()
        assert user.call("wave", times=3)["done"] == 3
        user.gate.touch()
        assert user.call("ponder")["thread"] == "ponder"

    report = Caller(robot, work).run()
    assert report.exit_code == 0, robot.ui.text()
    assert "WARNING /waver: wave: done" in robot.ui.text()
    assert "DEBUG /waver: ponder: done" in robot.ui.text()


def test_each_refusal_says_what_is_wrong(robot: Any) -> None:
    def work(user: Caller) -> None:
        for verb, payload, code, text in (
            ("wvae", {}, "unknown-verb", "/waver has no verb 'wvae'"),
            ("wave", {"times": "often"}, "invalid", "/waver: wave: times: Input should be a valid integer"),
            ("refuse", {}, "refused", "not today: ask tomorrow"),
            ("stumble", {}, "failed", "/waver failed: KeyError: 'shoelace'"),
            ("chatter", {}, "failed", "/waver: its reply has 2000"),
            ("mumble", {}, "failed", "/waver: its reply cannot be sent"),
        ):
            error = user.refused(verb, **payload)
            assert error.code == code
            assert text in str(error)
        assert user.refused("wvae").allowed[0] == "wave"
        assert user.state() == "ready"  # none of this has harmed the node

    report = Caller(robot, work).run()
    assert report.exit_code == 0, robot.ui.text()
    assert not any(node.restarts for node in report.nodes)


def test_a_defect_of_a_verb_that_moves_stops_the_node(robot: Any) -> None:
    def work(user: Caller) -> None:
        error = user.refused("fall")
        assert (error.code, str(error)) == ("failed", "/waver failed: KeyError: 'ladder'")

    Caller(robot, work).run()
    assert "ERROR /waver: failed in step active: KeyError: 'ladder'" in robot.ui.text()


def test_a_node_that_dies_is_an_answer(robot: Any) -> None:
    def work(user: Caller) -> None:
        error = user.refused("die")
        assert error.code == "gone"
        assert str(error).startswith(
            "/waver ended before it answered die: it failed: its process ended with exit status 7"
        )

    Caller(robot, work).run()


def test_a_node_that_stands_still_is_an_answer_and_does_nothing_late(robot: Any) -> None:
    def work(user: Caller) -> None:
        for verb in ("doze", "wave"):  # the second one waits behind the first
            error = user.refused(verb, 0.3)
            assert error.code == "timeout"
            assert f"/waver has not answered {verb} within 0.3 s: it is in its loop" in str(error)
        user.gate.touch()
        assert user.call("wave", times=7)["done"] == 7

    Caller(robot, work).run()
    assert [line for line in robot.noted() if "waved" in line] == ["waved 7"]


def test_only_one_call_runs_beside(robot: Any) -> None:
    def work(user: Caller) -> None:
        assert user.refused("ponder", 0.3).code == "timeout"
        error = user.refused("ponder")
        assert (error.code, str(error)) == ("refused", "/waver is not done with ponder yet: try again")
        assert user.call("wave")["done"] == 1

    Caller(robot, work).run()


def test_a_run_that_has_gone_is_named(robot: Any) -> None:
    def work(user: Caller) -> None:
        assert user.system.stop()
        error = user.refused("wave")
        assert error.code == "unreachable"
        assert str(error).startswith(f"process {user.system.info.process_id}, which runs ")
        assert "does not answer: " in str(error)

    Caller(robot, work).run()


def test_a_node_of_another_run_is_named(robot: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(user: Caller) -> None:
        other = RunningSystem(user.system.path, user.system.info)
        other.info = type(other.info)(**{**vars(other.info), "run": "other", "nodes": ("/leg",)})
        monkeypatch.setattr(RunningSystem, "all", lambda: [user.system, other])
        with pytest.raises(CallError) as caught:
            user.system.call("leg", "wave")
        assert str(caught.value).startswith(
            f"this run has no node 'leg': it is a node of another run: process {other.info.process_id}, which"
        )
        assert set(caught.value.allowed) == {"/ticking", "/waver"}

    Caller(robot, work).run()
