from __future__ import annotations

import numpy as np
import pytest
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_dynamixel.safe_stop import run, stop
from joshua_emulator import EmulatedBus
from joshua_servo.safe_stop import SafeStopRequest


@pytest.fixture
def request_for_release(arm_emulator: EmulatedBus, make_arm: object) -> SafeStopRequest:
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
    arm_emulator: EmulatedBus, request_for_release: SafeStopRequest
) -> None:
    arm_emulator.fault("overload", 2)  # its replies carry the alert, which is no refusal
    report = run(request_for_release)
    assert report.complete
    assert set(report.joints.values()) == {"released"}


def test_the_guardian_runs_what_the_driver_has_prepared(
    arm_emulator: EmulatedBus, request_for_release: SafeStopRequest
) -> None:
    assert {servo["energised"] for servo in arm_emulator.servos()} == {True}
    report = stop(vars(request_for_release))
    assert report["complete"] is True
    assert {servo["energised"] for servo in arm_emulator.servos()} == {False}


def test_parking_sets_the_profile_velocity(arm_emulator: EmulatedBus, make_arm: object) -> None:
    assert callable(make_arm)
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    request = arm.safe_stop_request("PARK_THEN_RELEASE", park_pose_rad=[0.1] * 6, timeout_s=10.0)
    arm.disconnect()
    assert run(request).complete
    assert arm_emulator.ask("registers", id=1)["registers"]["profile_velocity"] == 31  # about 0.8 rad/s
