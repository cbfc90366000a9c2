from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from joshua.devices.actuator_node import ActuatorNode
from joshua.devices.errors import DeviceError
from joshua.devices.goal import RAMP_SPEED_RAD_S
from joshua.messages.make import joint_state
from joshua.node.verbs import RefusedError
from joshua.plan import JointRange, NodeKind, NodeSpec, TopicSpec
from joshua.plugins.targets import TargetError
from joshua.schema import config_pb2
from joshua.testing.recording_context import RecordingContext
from joshua_mock.settings import MockMotorSettings
from stepped_time import SteppedTime

STATE = TopicSpec(name="/arm/state", type_name="sensor_msgs/msg/JointState", rate_hz=200.0)
COMMAND = TopicSpec(name="/arm/command", type_name="sensor_msgs/msg/JointState")


def spec(role: str = "ACTION_FOLLOWER", block: dict[str, Any] | None = None, **fields: Any) -> NodeSpec:
    facts = fields.pop("facts", {})
    settings = MockMotorSettings.from_block(
        config_pb2.MockMotorConfig(**{"num_motors": 2, "position_max": 4095, **(block or {})}),
    )
    return NodeSpec(
        **{
            "name": "arm",
            "kind": NodeKind.ACTUATOR,
            "role": role,
            "behaviour": "joshua.devices.actuator_node:ActuatorNode",
            "implementation": "joshua_mock.actuator:MockActuator",
            "settings_type": "joshua_mock.settings:MockMotorSettings",
            "settings": settings.model_dump(mode="json"),
            "facts": {"joints": settings.joints(), "external": (COMMAND.name,), **facts},
            "frame_id": "base",
            "publishers": (STATE,),
            "subscriptions": (COMMAND,),
            **fields,
        }
    )


class Running:
    """A node that was configured and activated."""

    def __init__(self, node_spec: NodeSpec, clock: SteppedTime) -> None:
        self.clock = clock
        self.context = RecordingContext(node_spec)
        self.node = ActuatorNode(self.context)
        self.node.configure()
        self.node.activate()

    def cycles(self, count: int, send: Any = None, topic: str = "/arm/command", publisher: str = "") -> None:
        for _ in range(count):
            if send is not None:
                self.context.receive(topic, send, publisher)
            self.clock.sleep(0.005)
            self.context.tick("control")

    @property
    def states(self) -> list[Any]:
        return self.context.publishers["/arm/state"].messages

    @property
    def written(self) -> list[Any]:
        return self.context.publishers["~/applied_command"].messages

    @property
    def actuator(self) -> Any:
        return self.node._actuator

    def end(self) -> None:
        for _ in range(2):
            self.node.deactivate()
            self.context.stop()
            self.node.cleanup()


@pytest.fixture
def run(stepped_time: SteppedTime) -> Iterator[Any]:
    started: list[Running] = []

    def start(*args: Any, **fields: Any) -> Running:
        started.append(Running(spec(*args, **fields), stepped_time))
        return started[-1]

    yield start
    for running in started:
        running.end()


def test_the_state_is_published_each_cycle(run: Any) -> None:
    node = run()
    assert node.context.timers["control"][0] == 1 / 200
    node.cycles(3)
    assert len(node.states) == 3
    message = node.states[0]
    assert message.name == ["joint_1", "joint_2"]
    assert message.position == pytest.approx([0.0, 0.0], abs=1e-3)
    assert len(message.velocity) == len(message.effort) == 2
    assert message.header.frame_id == "base"
    assert abs(message.header.stamp.sec - time.time()) < 10


def test_a_command_is_followed_and_what_was_written_is_published(run: Any) -> None:
    node = run()
    goal = joint_state(["joint_2", "joint_1"], [0.05, -0.05])
    for _ in range(600):
        node.cycles(1, send=goal)
        if np.abs(node.states[-1].position - [-0.05, 0.05]).max() < 0.002:
            break
    assert node.states[-1].position == pytest.approx([-0.05, 0.05], abs=0.002)
    assert node.written[-1].position == pytest.approx([-0.05, 0.05])
    assert node.written[-1].name == ["joint_1", "joint_2"]
    assert node.written[-1].header.stamp.sec > 0
    assert len(node.written) == len(node.states)
    positions = np.array([message.position for message in node.written])
    assert np.abs(positions[0]).max() < 0.03, "the first goal is near where the joints were found"


def test_values_that_cannot_be_trusted_are_never_written(run: Any) -> None:
    node = run()
    node.cycles(20, send=joint_state(["joint_1"], [math.nan]))
    node.cycles(20, send=joint_state(["joint_1", "joint_2"], [0.1, math.inf]))
    assert all(np.isfinite(message.position).all() for message in node.written)
    assert node.written[-1].position == pytest.approx([0.0, 0.0], abs=1e-3)
    rows = {check: (passed, measured) for check, passed, measured in node.node.test_results()}
    assert rows["commands on /arm/command"] == (False, "0 at " + rows["commands on /arm/command"][1][5:])
    assert "40 refused" in rows["commands on /arm/command"][1]


def test_what_holds_the_process_up_after_a_write_is_not_in_the_stamp_of_the_goal(run: Any) -> None:
    """Else the next goal would seem to be too far away for the time between both stamps."""
    node = run()
    node.context.now_ns = node.clock.time_ns
    node.cycles(10, send=joint_state(["joint_1"], [1.0]))
    write = node.actuator.write

    def write_and_stand_still(goal: Any) -> Any:
        written = write(goal)
        node.clock.sleep(0.3)
        return written

    node.actuator.write = write_and_stand_still
    node.cycles(1)
    node.actuator.write = write
    node.cycles(3)
    seconds = [stamp.sec + stamp.nanosec / 1e9 for stamp in (m.header.stamp for m in node.written)]
    steps = np.diff([message.position[0] for message in node.written])
    assert (steps <= RAMP_SPEED_RAD_S * np.diff(seconds) + 0.002).all(), "a tick is 0.0015 rad"
    assert np.diff(seconds).max() == pytest.approx(0.305, abs=1e-3), "the time does pass"


def test_joints_hold_when_commands_stop(run: Any, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    node = run(facts={"stale_after_s": 0.05})
    node.cycles(5, send=joint_state(["joint_1"], [1.0]))
    node.clock.sleep(0.06)
    node.cycles(2)
    held = node.written[-1].position.copy()
    node.cycles(10)
    assert (node.written[-1].position == held).all()
    assert caplog.messages == ["commands stopped: the joints hold their position"]
    node.cycles(2, send=joint_state(["joint_1"], [1.0]))
    assert caplog.messages[1:] == ["commands resumed: the joints approach them slowly"]


def test_a_follower_takes_the_fraction_of_its_leaders_range(run: Any) -> None:
    leader = {
        "node": "/leader",
        "topic": "/arm/command",
        "joints": [
            JointRange("l1", 0.0, 1.0),
            JointRange("l2", 0.0, 1.0),
        ],
    }
    node = run(block={"position_min": 2048, "position_max": 2148}, facts={"commanders": [leader]})
    high = node.actuator.limits.position_max_rad[0]
    for _ in range(600):
        node.cycles(1, send=joint_state(["l1", "l2"], [0.5, 1.0]), publisher="/leader")
        if np.abs(node.written[-1].position - [high / 2, high]).max() < 1e-6:
            break
    assert node.written[-1].position == pytest.approx([high / 2, high])


def test_only_the_leaders_own_topic_is_mapped(run: Any) -> None:
    leader = {
        "node": "/leader",
        "topic": "/leader/state",
        "joints": [JointRange("joint_1", 0.0, 1.0)],
    }
    other = TopicSpec(name="/leader/state", type_name="sensor_msgs/msg/JointState")
    node = run(facts={"commanders": [leader]}, subscriptions=(COMMAND, other))
    for _ in range(600):
        node.cycles(1, send=joint_state(["joint_1"], [0.02]))
        if abs(node.written[-1].position[0] - 0.02) < 1e-6:
            break
    assert node.written[-1].position[0] == pytest.approx(0.02)


def test_an_override_takes_control_and_gives_it_back_by_a_verb(
    run: Any, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO")
    override = {"node": "/gamepad", "topic": "/arm/command", "override": True}
    commanders = [override, {"node": "/model", "topic": "/arm/command"}]
    node = run(facts={"commanders": commanders, "external": (), "intervention": True})
    marks = node.context.publishers["~/intervention"].messages
    model, person = joint_state(["joint_1"], [0.4]), joint_state(["joint_1"], [-0.4])
    node.cycles(600, send=model, publisher="/model")
    assert node.written[-1].position[0] == pytest.approx(0.4)
    before = len(node.written)
    for _ in range(20):
        node.cycles(1, send=person, publisher="/gamepad")
        node.cycles(1, send=model, publisher="/model")
    turned = np.array([message.position[0] for message in node.written[before:]])
    assert (np.diff(turned) < 0).all(), "nothing of the model gets through"
    assert marks[-1].data
    assert np.diff(turned).min() > -0.011, "the override is approached at the speed of a first command"
    with pytest.raises(RefusedError, match=r"the override /gamepad still publishes\. Stop it first"):
        node.node.release_override()
    node.clock.sleep(0.25)
    node.context.tick("safety")
    held = node.written[-1].position[0]
    node.cycles(200, send=model, publisher="/model")
    assert node.written[-1].position[0] == held
    assert marks[-1].data, "until it is released"
    node.context.tick("diagnostics")
    assert node.context.shown == "override /gamepad stopped publishing: holding"
    assert node.node.release_override() == (
        "/arm: the override /gamepad is released; the joints approach the next command slowly"
    )
    before = len(node.written)
    node.cycles(20, send=model, publisher="/model")
    turned = np.array([message.position[0] for message in node.written[before:]])
    assert 0.004 < np.diff(turned).max() < 0.0065, "1 rad/s at 200 Hz, in whole ticks"
    assert not marks[-1].data
    with pytest.raises(RefusedError, match="/arm has no override to release"):
        node.node.release_override()
    assert not any("commands stopped" in message for message in caplog.messages), "one line for one event"


def test_a_stranger_is_refused_and_shown(run: Any) -> None:
    node = run(facts={"commanders": [{"node": "/leader", "topic": "/arm/command"}], "external": ()})
    node.cycles(20, send=joint_state(["joint_1"], [1.0]), publisher="/talker")
    assert np.ptp([message.position[0] for message in node.written]) == 0
    node.context.tick("diagnostics")
    assert node.context.shown == "20 commands refused from /talker"
    (row, *_) = node.context.publishers["/diagnostics"].messages[-1].status
    assert {"commander": "", "commands_refused": "20"}.items() <= {v.key: v.value for v in row.values}.items()


def test_a_leader_without_a_range_is_refused() -> None:
    leader = {
        "node": "/l",
        "topic": "/arm/command",
        "joints": [JointRange("a", 1.0, 1.0)],
    }
    context = RecordingContext(spec(facts={"commanders": [leader]}))
    node = ActuatorNode(context)
    with pytest.raises(DeviceError, match="/arm cannot follow /l: joint a of the leader has no range"):
        node.configure()
    node.cleanup()


def test_a_leader_never_gets_torque(run: Any) -> None:
    node = run("ACTION_LEADER", block={"motion": config_pb2.MOCK_MOTION_SINE, "motion_frequency_hz": 5.0})
    node.cycles(20)
    assert "~/applied_command" not in node.context.publishers
    assert not node.context.subscriptions
    assert node.context.warnings == ["/arm: a leader is moved by hand, so /arm/command has no effect"]
    positions = np.array([message.position for message in node.states])
    assert np.ptp(positions, axis=0).max() > 0.05
    assert all((message.effort == 0).all() for message in node.states)


def test_an_actuator_that_nobody_commands_gets_no_torque(run: Any) -> None:
    node = run("ACTION_SINGLE", subscriptions=())
    node.cycles(3)
    with pytest.raises(DeviceError, match="torque is off"):
        node.actuator.write(np.zeros(2))


def test_the_safe_state_of_a_follower_is_to_hold(run: Any) -> None:
    node = run()
    node.cycles(10, send=joint_state(["joint_1"], [0.5]))
    node.node.deactivate()
    before = node.actuator.read().position_rad
    node.clock.sleep(0.05)
    assert node.actuator.read().position_rad == pytest.approx(before, abs=2e-3)
    node.actuator.write(np.zeros(2))  # torque is on, else this raises
    count = len(node.written)
    node.cycles(3)
    assert len(node.written) == count, "nothing is written after the stop"
    node.node.cleanup()
    assert not node.actuator.connected


def test_after_a_failure_nothing_moves_without_consent(run: Any) -> None:
    node = run(facts={"restarted": True})
    node.cycles(10, send=joint_state(["joint_1"], [0.5]))
    assert node.written == []
    assert len(node.states) == 10
    assert node.context.faults == [
        "restarted after a failure, with torque off. Check the arm. "
        "Run `joshua resume arm` to follow commands again"
    ]
    with pytest.raises(DeviceError, match="torque is off"):
        node.actuator.write(np.zeros(2))
    assert node.node.resume() == "/arm: torque is on again; the joints approach the next command slowly"
    assert node.context.faults[-1] == ""
    node.cycles(3, send=joint_state(["joint_1"], [0.5]))
    assert len(node.written) == 3
    assert node.written[-1].position[0] < 0.1, "approached slowly from where the joint was"


def test_the_test_table_of_a_healthy_follower(run: Any) -> None:
    node = run(publishers=(STATE.model_copy(update={"rate_hz": 50.0}),))
    for _ in range(60):
        node.context.receive("/arm/command", joint_state(["joint_1", "joint_2"], [0.02, 0.0]))
        node.clock.sleep(0.02)
        node.context.tick("control")
    results = node.node.test_results()
    assert [check for check, _, _ in results] == [
        "rate of /arm/state",
        "positions",
        "commands on /arm/command",
        "tracking error",
    ]
    assert all(passed for check, passed, _ in results if not check.startswith("rate")), results


def test_the_test_table_of_a_silent_follower(run: Any) -> None:
    node = run()
    node.cycles(3)
    failed = {check: measured for check, passed, measured in node.node.test_results() if not passed}
    assert failed["commands on /arm/command"] == "0 at 0 Hz"
    assert failed["tracking error"] == "no cycle followed a command"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"publishers": (TopicSpec(name="/x", type_name="sensor_msgs/msg/Imu", rate_hz=1.0),)},
            r"/arm cannot publish sensor_msgs/msg/Imu on /x: .*set data_type: JOINT_STATE",
        ),
        (
            {"subscriptions": (TopicSpec(name="/x", type_name="sensor_msgs/msg/Imu"),)},
            r"/arm cannot follow sensor_msgs/msg/Imu on /x: .*JOINT_STATE or JOINT_TRAJECTORY",
        ),
    ],
)
def test_types_that_an_actuator_does_not_speak_are_refused(fields: dict[str, Any], message: str) -> None:
    context = RecordingContext(spec(**fields))
    with pytest.raises(DeviceError, match=message):
        ActuatorNode(context).configure()


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"implementation": "acme_gone.driver:Arm", "plugin": "acme-arm"},
            r"/arm: acme_gone\.driver:Arm cannot be imported: .*pip install acme-arm",
        ),
        (
            {"implementation": "joshua_mock.sensors:MockCamera"},
            "does not derive from joshua.devices.actuator",
        ),
    ],
)
def test_a_driver_that_is_none_is_named(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(TargetError, match=message) as caught:
        ActuatorNode(RecordingContext(spec(**fields))).configure()
    assert caught.value.exit_code == 3


def test_an_arm_that_nothing_stops_is_named_in_the_table(run: Any) -> None:
    assert run(facts={"keeps_last_goal": True}).context.warnings == [
        "/arm: no safe stop: if this driver dies, the joints keep their last goal"
    ]
    assert run("ACTION_LEADER", facts={"keeps_last_goal": True}, subscriptions=()).context.warnings == []


def test_joints_that_change_with_the_connection_are_refused() -> None:
    context = RecordingContext(spec(facts={"joints": [JointRange("pan", -1.0, 1.0)]}))
    node = ActuatorNode(context)
    with pytest.raises(
        DeviceError, match="/arm: its joints changed: pan in its settings, joint_1, joint_2 once connected"
    ):
        node.configure()
    node.cleanup()
