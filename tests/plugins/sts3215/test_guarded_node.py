"""The node of an arm where its driver cannot say which joints have torque, or the bus is silent for a moment.

A guardian kills its driver, so nodes that have one run in a process of their own.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from typing import Any

import pytest
from joshua.devices.actuator_node import ActuatorNode
from joshua.devices.errors import DeviceSilent
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.testing.recording_context import RecordingContext
from joshua_emulator import EmulatedBus
from joshua_servo.errors import NoReply
from joshua_sts3215.registers import GOAL_POSITION

STATE = TopicSpec(name="/arm/state", type_name="sensor_msgs/msg/JointState", rate_hz=50.0)
COMMAND = TopicSpec(name="/arm/command", type_name="sensor_msgs/msg/JointState")
STOP = {
    "implementation": "joshua_sts3215.safe_stop:Sts3215StopRequest",
    "state": "HOLD",
    "park_pose_rad": [],
    "timeout_s": 10.0,
}

BEGIN = """
import logging, sys
from joshua.devices.actuator_node import ActuatorNode
from joshua_servo.errors import NoReply
from joshua.plan import NodeSpec
from joshua.testing.recording_context import RecordingContext
logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stdout)
context = RecordingContext(NodeSpec.model_validate_json(sys.argv[1]))
node = ActuatorNode(context)
node.configure()
torque = node._actuator._torque
def lost(*values):
    raise NoReply("wrist_flex (id 4) does not confirm")
"""
END = """
node.deactivate()
node.cleanup()
"""
TRIP = """
node.activate()
torque.switch_off = lost
print("energised", flush=True)
while True:
    node._watch()
    try:
        context.tick("control")
    except Exception as error:
        print(error, flush=True)
        break
"""
HALF_ON = """
switch_on = torque.switch_on
def half(*values):
    switch_on(*values)
    node._actuator.bus.try_write(4, node._actuator.family.torque_enable, 0)
    lost()
torque.switch_on = half
try:
    node.activate()
except NoReply as error:
    print(error, flush=True)
"""


def spec(emulator: EmulatedBus, make_arm: Any, **facts: Any) -> NodeSpec:
    return NodeSpec(
        name="arm",
        kind=NodeKind.ACTUATOR,
        role="ACTION_FOLLOWER",
        behaviour="",
        implementation="joshua_sts3215.actuator:Sts3215Actuator",
        settings_type="joshua_sts3215.settings:Sts3215Settings",
        settings=make_arm(emulator).settings.model_dump(mode="json"),
        facts={"safe_state": "HOLD", **facts},
        publishers=(STATE,),
        subscriptions=(COMMAND,),
    )


def energised(emulator: EmulatedBus) -> set[bool]:
    return {servo["energised"] for servo in emulator.servos()}


@pytest.mark.timing  # a driver that a busy machine lets wait for 0.2 s counts as hung
def test_a_trip_that_is_not_confirmed_ends_in_a_release_although_the_safe_state_is_to_hold(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    command = [sys.executable, "-c", BEGIN + TRIP + END]
    command.append(spec(arm_emulator, make_arm, safe_stop=STOP).model_dump_json())
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while process.stdout.readline() not in ("energised\n", ""):
            pass
        assert energised(arm_emulator) == {True}
        arm_emulator.fault("overload", 3)
        output = process.stdout.read()
    assert "torque could not be verified as off: wrist_flex (id 4) does not confirm" in output
    assert "safe state RELEASE: 1 released, 2 released" in output
    assert energised(arm_emulator) == {False}


def test_torque_that_was_perhaps_given_is_left_to_the_guardian(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    command = [sys.executable, "-c", BEGIN + HALF_ON + END]
    command.append(spec(arm_emulator, make_arm, safe_stop=STOP).model_dump_json())
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert "safe state HOLD: 1 held, 2 held, 3 held, 4 was off, 5 held, 6 held" in result.stdout, result


def test_a_bus_that_stands_still_for_a_moment_is_borne(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    """As on a machine that gives the emulator no time, or behind a hub that settles: every reply is late."""
    context = RecordingContext(spec(arm_emulator, make_arm))
    node = ActuatorNode(context)
    node.configure()
    node.activate()
    states = context.publishers["/arm/state"].messages
    os.kill(arm_emulator.pid, signal.SIGSTOP)
    try:
        context.tick("control")
    finally:
        os.kill(arm_emulator.pid, signal.SIGCONT)
    assert states == []
    while not states:
        context.tick("control")
    positions = [servo["present_position"] for servo in arm_emulator.servos()]
    assert states[0].position == pytest.approx([(ticks - 2048) * math.tau / 4096 for ticks in positions])
    context.tick("diagnostics")
    rows = context.publishers["/diagnostics"].messages[-1].status
    assert "readings failed since the last report" in rows[0].message
    assert int(next(pair.value for pair in rows[-1].values if pair.key == "retries")) > 0
    node.deactivate()
    node.cleanup()


@pytest.mark.timing
def test_a_mute_servo_among_six_delays_the_hold_of_the_others_by_a_second_at_most(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    context = RecordingContext(spec(arm_emulator, make_arm))
    node = ActuatorNode(context)
    node.configure()
    node.activate()
    context.tick("control")
    arm_emulator.fault("silent", 3)
    mute_ns = time.monotonic_ns()

    def control() -> None:
        while True:
            context.tick("control")
            time.sleep(0.02)

    with pytest.raises(DeviceSilent, match=r"elbow_flex \(id 3\) no longer answers"):
        control()
    with pytest.raises(NoReply):  # after the others hold
        node.deactivate()
    # Nothing acknowledges the goals. The reply to a later request says that the emulator has read them.
    assert node._actuator.bus.ping(1)
    writes = arm_emulator.log("sync_write")
    rows = bytes.fromhex(writes[-1]["parameters"])
    assert rows[0] == GOAL_POSITION.address
    assert list(rows[2::3]) == [1, 2, 4, 5, 6]
    assert writes[-1]["wire_end_ns"] - mute_ns < 1.2e9  # 0.5 s where the machine is not busy
    node.cleanup()
