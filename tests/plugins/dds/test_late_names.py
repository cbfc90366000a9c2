"""Over DDS, a participant announces its nodes apart from its writers, so their names may arrive late."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from joshua.devices.actuator import JointLimits
from joshua.devices.command_intake import Commanders, CommandIntake
from joshua.devices.goal import GoalGenerator
from joshua.devices.joint_command import CommandReader
from joshua.messages import encode, make
from joshua.node.endpoints import Endpoints
from joshua.plan import NodeKind, NodeSpec, QosProfile, TopicSpec, TransportSettings
from joshua.testing.recording_context import RecordingContext
from joshua.transport import Transport

pytest.importorskip("cyclonedds")

from joshua_dds.transport import DdsNode

JOINT_STATE = "sensor_msgs/msg/JointState"
COMMAND = TopicSpec(name="/command", type_name=JOINT_STATE)
SPEC = NodeSpec(name="arm", kind=NodeKind.ACTUATOR, behaviour="", implementation="")


class LateNode(DdsNode):
    """A node that announces its endpoints when it is told to."""

    announces = False

    def _endpoints_changed(self) -> None:
        if self.announces:
            super()._endpoints_changed()

    def announce(self) -> None:
        self.announces = True
        self._endpoints_changed()


def test_a_program_whose_name_arrives_after_its_messages_is_not_refused(
    dds_spec: TransportSettings,
    opener: Callable[[TransportSettings], Transport],
    eventually: Callable[..., Any],
    caplog: pytest.LogCaptureFixture,
) -> None:
    near: Any = opener(dds_spec)
    far: Any = opener(dds_spec)
    log = logging.getLogger("test_late_names")
    goals = GoalGenerator(JointLimits(np.full(1, -2.0), np.full(1, 2.0), np.full(1, 5.0)), 0.01)
    goals.seed(np.zeros(1))
    commanders = Commanders((), (COMMAND.name,), goals, log)
    arrived: list[int] = []
    intake = CommandIntake(RecordingContext(SPEC), goals, commanders, arrived.append)
    reader = CommandReader(COMMAND.name, ("a",), log)
    errors: list[BaseException] = []
    endpoints = Endpoints(near.create_node("arm"), SPEC, lambda _: None, errors.append, log)
    endpoints.subscribe_with_writer(
        COMMAND, lambda message, _, writer: intake.joint_state(reader, message, writer)
    )
    talker = LateNode(far, "talker", "/")
    publisher = talker.create_publisher(COMMAND.name, JOINT_STATE, QosProfile())
    stop = threading.Event()

    def publish() -> None:
        while not stop.wait(0.02):
            publisher.publish(encode(make.joint_state(["a"], [0.5])))

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        eventually(lambda: len(arrived) > 5, what="a command without a name")
        assert commanders.current == ""
        talker.announce()
        eventually(lambda: commanders.current == "/talker", what="the name")
        count = len(arrived)
        eventually(lambda: len(arrived) > count + 50, what="further commands")
    finally:
        stop.set()
        thread.join()
        endpoints.close()
        talker.close()
    assert errors == []
    assert commanders.refused == {}
    assert not [text for text in caplog.messages if "refused" in text]


def test_publishers_that_dds_does_not_name_are_told_apart(
    dds_spec: TransportSettings, opener: Callable[[TransportSettings], Transport]
) -> None:
    """A publisher that has left is not matched any more when its last message is taken."""
    node = opener(dds_spec).create_node("arm")
    subscription: Any = node.create_subscription(COMMAND.name, JOINT_STATE, QosProfile(), lambda _: None)
    first, second = (subscription._look_up(handle) for handle in (2**63 + 5, 7))
    assert len(first) == len(second) == 16
    assert first != second
    assert first[:8] == second[:8] == bytes(8), "no GUID"
