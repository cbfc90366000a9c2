"""Calls at a node: who may ask, what waits for the loop, and what is not served late."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

from joshua.ipc.messages import Call, CallReply
from joshua.node.calls import Calls
from joshua.node.verbs import Caller, verb


class Arm:
    def __init__(self) -> None:
        self.waved = 0

    @verb(moves=True)
    def wave(self) -> str:
        self.waved += 1
        return "waved"

    @verb(moves=False)
    def greet(self) -> str:
        return "hello"


class Node:
    """The calls of a node without its process."""

    def __init__(self) -> None:
        self.arm = Arm()
        self.sent: list[Any] = []
        self.woken = 0
        log = SimpleNamespace(error=lambda *_, **__: None)
        context: Any = SimpleNamespace(spec=SimpleNamespace(full_name="/arm"), log=log)
        self.calls = Calls(context, self.sent.append, self._wake, str)

    def _wake(self) -> None:
        self.woken += 1

    def take(self, name: str, in_s: float = 60.0, **options: Any) -> list[Any]:
        deadline_ns = time.monotonic_ns() + round(in_s * 1e9)
        call = Call(id=len(self.sent), node="/arm", verb=name, deadline_ns=deadline_ns)
        self.calls.take(call, (self.arm,), **{"active": True, **options})
        return self.sent


def test_a_call_waits_for_the_loop_and_wakes_it() -> None:
    node = Node()
    assert node.take("wave") == []
    assert (node.woken, node.arm.waved) == (1, 0)
    job = node.calls.next()
    assert job is not None
    reply, error = node.calls.serve(job)
    assert (reply, error) == (
        CallReply(id=0, node="/arm", ok=True, payload={"text": "waved"}, moves=True),
        None,
    )


def test_what_nobody_waits_for_any_more_is_not_done() -> None:
    node = Node()
    node.take("wave", in_s=-1.0)
    assert node.calls.next() is None
    assert node.arm.waved == 0


def test_a_stranger_may_ask_but_move_nothing() -> None:
    node = Node()
    stranger = Caller("network", "somebody")
    (reply,) = node.take("wave", caller=stranger)
    assert (reply.ok, reply.code) == (False, "not-allowed")
    assert reply.text.startswith("/arm: wave enables torque or moves a joint: only the user who runs")
    node.take("greet", caller=stranger)
    job = node.calls.next()
    assert job is not None
    assert node.calls.serve(job)[0].payload == {"text": "hello"}


def test_a_node_that_does_not_run_says_so() -> None:
    (reply,) = Node().take("wave", active=False)
    assert (reply.code, reply.text) == ("not-running", "/arm is starting or stopping: try again")


def test_the_list_is_answered_while_the_loop_is_busy() -> None:
    (reply,) = Node().take("verbs", active=False)
    assert [info["name"] for info in reply.payload["verbs"]] == ["greet", "wave"]
