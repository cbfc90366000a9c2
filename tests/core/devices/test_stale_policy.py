"""What an actuator does when its commands stop and stay away: at its node, and in the plan's words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from joshua.devices.actuator import JointLimits
from joshua.devices.actuator_node import ActuatorNode
from joshua.devices.errors import DeviceDisconnected
from joshua.devices.goal import GoalGenerator, GoalState, StalePolicy
from joshua.devices.joint_command import JointCommand
from joshua.messages.make import joint_state
from joshua.plan import ActuatorFacts, NodeKind, NodeSpec, OnStale, TopicSpec
from joshua.schema import config_pb2
from joshua.testing.recording_context import RecordingContext
from joshua_mock.settings import MockMotorSettings

STATE = TopicSpec(name="/arm/state", type_name="sensor_msgs/msg/JointState", rate_hz=100.0)
COMMAND = TopicSpec(name="/arm/command", type_name="sensor_msgs/msg/JointState")
MS = 1_000_000


class Loop:
    """Goals that joints follow at once, 100 times a second on a clock of their own."""

    def __init__(self, action: str, **values: Any) -> None:
        limits = JointLimits(np.full(2, -1.0), np.full(2, 1.0), np.full(2, 5.0))
        self.goals = GoalGenerator(limits, 0.01)
        self.goals.seed(np.zeros(2))
        settings = {"after_s": 2.0, "pose_rad": (0.4, -3.0), "timeout_s": 5.0, **values}
        self.policy = StalePolicy(self.goals, OnStale(action, **settings))
        self.now_ns = 0
        self.stuck = False

    def send(self, *positions: float) -> None:
        self.goals.command(JointCommand(np.arange(len(positions)), np.array(positions)), self.now_ns)

    def run(self, seconds: float) -> tuple[float, str]:
        """Until the torque must go; returns after how many seconds, and why ("" where it need not)."""
        for cycle in range(round(seconds * 100)):
            self.now_ns += 10 * MS
            self.position = self.goals.step(self.now_ns)
            shown = np.zeros(2) if self.stuck else self.position
            if reason := self.policy.look(shown, self.now_ns / 1e9):
                return (cycle + 1) / 100, reason
        return seconds, ""


def test_joints_hold_first_and_then_let_go() -> None:
    loop = Loop("RELEASE")
    loop.send(0.1, 0.1)
    took_s, reason = loop.run(10.0)
    assert took_s == pytest.approx(2.5, abs=0.03), "half a second until it is stale, two of holding"
    assert reason == "commands did not resume within 2 s: torque was switched off"


def test_before_the_first_command_and_after_an_order_to_stay_nothing_is_stale() -> None:
    loop = Loop("RELEASE")
    assert loop.run(10.0)[1] == ""
    loop.goals.state = GoalState.HOLDING  # as a trajectory without points leaves it
    assert loop.run(10.0)[1] == ""


def test_commands_that_come_back_in_time_change_nothing() -> None:
    loop = Loop("RELEASE")
    for _ in range(4):
        loop.send(0.1, 0.1)
        assert loop.run(2.0)[1] == ""


def test_joints_are_parked_slowly_within_their_limits() -> None:
    loop = Loop("PARK_THEN_RELEASE")
    loop.send(0.1, 0.1)
    took_s, reason = loop.run(20.0)
    assert reason == "commands did not resume: the joints were parked and torque was switched off"
    assert loop.position == pytest.approx([0.4, -1.0], abs=0.06)
    assert took_s > 2.5 + 1.0, "1.1 rad at 1 rad/s at most"


def test_a_command_during_a_park_is_approached_slowly_again() -> None:
    loop = Loop("PARK_THEN_RELEASE")
    loop.send(0.1, 0.1)
    assert loop.run(3.0)[1] == ""
    assert loop.goals.state is GoalState.PARKING
    loop.send(0.1)
    second = loop.position[1]
    loop.run(0.02)
    assert loop.goals.ramping
    assert loop.position[1] == pytest.approx(second), "a joint that is not commanded stays"
    assert loop.goals.state is GoalState.FOLLOWING


def test_a_pose_that_is_not_reached_ends_in_a_release() -> None:
    loop = Loop("PARK_THEN_RELEASE")
    loop.send(0.1, 0.1)
    loop.stuck = True
    took_s, reason = loop.run(20.0)
    assert reason.endswith("the park pose was not reached within 5 s")
    assert took_s == pytest.approx(7.5, abs=0.05)


@pytest.fixture
def node() -> Iterator[ActuatorNode]:
    settings = MockMotorSettings.from_block(config_pb2.MockMotorConfig(num_motors=2, position_max=4095))
    spec = NodeSpec(
        name="arm",
        kind=NodeKind.ACTUATOR,
        role="ACTION_FOLLOWER",
        behaviour="",
        implementation="joshua_mock.actuator:MockActuator",
        settings_type="joshua_mock.settings:MockMotorSettings",
        settings=settings.model_dump(mode="json"),
        facts=ActuatorFacts(
            joints=settings.joints(),
            external=(COMMAND.name,),
            stale_after_s=0.0,
            on_stale=OnStale("RELEASE", 0.0, (), 5.0),
        ),
        publishers=(STATE,),
        subscriptions=(COMMAND,),
    )
    node = ActuatorNode(RecordingContext(spec))
    node.configure()
    node.activate()
    yield node
    node.deactivate()
    node.cleanup()


def stop_commanding(node: ActuatorNode) -> RecordingContext:
    context = node.context
    assert isinstance(context, RecordingContext)
    context.receive("/arm/command", joint_state(["joint_1"], [0.2]))
    for _ in range(3):
        context.tick("control")
    return context


def test_the_node_is_in_fault_until_it_is_resumed(node: ActuatorNode) -> None:
    context = stop_commanding(node)
    assert node._actuator is not None
    assert set((node._actuator.read_torque() or {}).values()) == {False}
    assert context.faults == [
        "commands did not resume within 0 s: torque was switched off. "
        "Run `joshua resume arm` to re-enable torque"
    ]
    written = len(context.publishers["~/applied_command"].messages)
    context.receive("/arm/command", joint_state(["joint_1"], [0.2]))
    context.tick("control")
    assert len(context.publishers["~/applied_command"].messages) == written, "it does not come back by itself"
    assert "approach the next command slowly" in node.resume()
    assert set((node._actuator.read_torque() or {}).values()) == {True}


def test_a_release_that_is_not_confirmed_fails_the_node(
    node: ActuatorNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    def release() -> None:
        raise DeviceDisconnected("joint_1 does not confirm")

    monkeypatch.setattr(node._actuator, "release", release)
    with pytest.raises(DeviceDisconnected):
        stop_commanding(node)
    monkeypatch.undo()
    node.deactivate()
    assert node._actuator is not None
    assert set((node._actuator.read_torque() or {}).values()) == {False}, "not held, as it is otherwise"
