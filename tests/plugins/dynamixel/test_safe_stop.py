from __future__ import annotations

import numpy as np
import pytest
from joshua.guardian.main import load_action
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_emulator import EmulatedBus
from joshua_servo.safe_stop import ServoStopRequest


@pytest.fixture
def request_for_release(arm_emulator: EmulatedBus, make_arm: object) -> ServoStopRequest:
    """An energised arm that its driver has left."""
    assert callable(make_arm)
    arm = make_arm(arm_emulator)
    assert isinstance(arm, DynamixelActuator)
    arm.connect()
    arm.enable()
    arm.write(np.full(6, 0.3))
    request = arm.safe_stop_request("RELEASE")
    arm.disconnect()
    return request


def test_a_servo_that_is_shut_down_is_released_with_the_others(
    arm_emulator: EmulatedBus, request_for_release: ServoStopRequest
) -> None:
    arm_emulator.fault("overload", 2)  # its replies carry the alert, which is no refusal
    report = request_for_release.run()
    assert report.complete
    assert set(report.joints.values()) == {"released"}


def test_the_guardian_runs_what_the_driver_has_prepared(
    arm_emulator: EmulatedBus, request_for_release: ServoStopRequest
) -> None:
    assert {servo["energised"] for servo in arm_emulator.servos()} == {True}
    report = load_action("joshua_dynamixel.safe_stop:DynamixelStopRequest")(request_for_release.to_values())
    assert report["complete"] is True
    assert {servo["energised"] for servo in arm_emulator.servos()} == {False}


def test_parking_sets_the_profile_velocity(arm_emulator: EmulatedBus, make_arm: object) -> None:
    assert callable(make_arm)
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    request = arm.safe_stop_request("PARK_THEN_RELEASE", park_pose_rad=[0.1] * 6, timeout_s=10.0)
    arm.disconnect()
    assert request.run().complete
    assert arm_emulator.ask("registers", id=1)["registers"]["profile_velocity"] == 31  # about 0.8 rad/s
