"""Observation, model and action side by side: while a model computes, neither of the others waits."""

from __future__ import annotations

import os
import sys
import threading
import time
import types
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from joshua.api import FloatArray, Model, Observation
from joshua.features import Feature
from joshua.messages import message_class
from joshua.plan import JointRange, NodeKind, NodeSpec, TopicSpec
from joshua.testing.recording_context import RecordingContext
from joshua_inference.node import InferenceNode
from joshua_inference.priority import nicer

NUMBER = message_class("std_msgs/msg/Int64")


class Slow(Model):
    """Answers when the test lets it; keeps what it saw, and the priority of its thread."""

    def __init__(self, *words: Any) -> None:
        super().__init__(*words)
        self.seen: list[int] = []
        self.nice: list[int] = []
        self.gate = threading.Event()
        self.gate.set()

    load = reset = close = lambda self: None

    def act(self, observation: Observation) -> FloatArray:
        self.seen.append(int(observation["observation.seen"][0]))
        self.nice.append(os.getpriority(os.PRIO_PROCESS, threading.get_native_id()))
        self.gate.wait(30)
        return np.zeros((1, 1))


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[RecordingContext, InferenceNode, Slow]]:
    module = types.ModuleType("joshua_slow_model")
    module.Slow = Slow  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    context = RecordingContext(
        NodeSpec(
            name="policy",
            kind=NodeKind.MODEL,
            behaviour="",
            implementation="joshua_slow_model:Slow",
            facts={
                "joints": [JointRange("a", -1.0, 1.0)],
                "features": [Feature("observation.seen", "int64", (1,), topic="/seen")],
                "compute": {"warm_up": 0},
            },
            publishers=(TopicSpec(name="/action", type_name="sensor_msgs/msg/JointState", rate_hz=50.0),),
            subscriptions=(TopicSpec(name="/seen", type_name="std_msgs/msg/Int64"),),
        )
    )
    node = InferenceNode(context)
    node.configure()
    node.activate()
    model = node._model
    assert isinstance(model, Slow)
    yield context, node, model
    model.gate.set()
    node.deactivate()
    context.stop()
    node.cleanup()


def wait_until(condition: Callable[[], object], meanwhile: Callable[[], object]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "the condition did not come true in 30 s"
        meanwhile()
        time.sleep(0.002)


def test_observations_and_actions_go_on_while_the_model_computes(run: Any) -> None:
    context, _, model = run
    see = lambda number: context.receive("/seen", NUMBER(number))  # noqa: E731
    tick = lambda: context.tick("actions")  # noqa: E731
    see(1)
    wait_until(lambda: model.seen, tick)
    model.gate.clear()
    wait_until(lambda: len(model.seen) > 1, tick)
    count, published = len(model.seen), len(context.publishers["/action"].messages)
    for number in range(2, 9):
        see(number)
        tick()
    assert len(context.publishers["/action"].messages) == published + 7, "the hold is published"
    assert len(model.seen) == count
    model.gate.set()
    wait_until(lambda: len(model.seen) > count, tick)
    assert model.seen[count] == 8, "the newest, none of those before"


@pytest.mark.skipif(sys.platform != "linux", reason="threads have priorities of their own on Linux")
def test_the_model_computes_below_the_loop(run: Any) -> None:
    context, _, model = run
    own = os.getpriority(os.PRIO_PROCESS, threading.get_native_id())
    threads = [thread.native_id for thread in context._threads]
    assert [os.getpriority(os.PRIO_PROCESS, thread) for thread in threads] == [own + nicer()], "at once"
    context.receive("/seen", NUMBER(1))
    wait_until(lambda: model.nice, lambda: context.tick("actions"))
    assert set(model.nice) == {own + nicer()}
