import subprocess
import sys
import time
from typing import Any

import numpy as np
import pytest
from joshua.devices.servo.safe_stop import SafeStopRequest
from joshua_dynamixel.safe_stop import run, stop
from joshua_emulator import EmulatedBus


def request_for(emulator: EmulatedBus, action: str, **values: Any) -> SafeStopRequest:
    return SafeStopRequest(
        action,
        (1, 2, 3, 4, 5, 6),
        path=emulator.port,
        device_root=str(emulator.root),
        **{"timeout_s": 10.0, **values},
    )


def energised(emulator: EmulatedBus) -> set[bool]:
    return {servo["energised"] for servo in emulator.servos()}


@pytest.fixture
def moving_arm(arm_emulator: EmulatedBus, make_arm: Any) -> EmulatedBus:
    """An arm with torque on that moves towards far goals, and no driver any more."""
    arm = make_arm(arm_emulator, velocity=15)
    arm.connect()
    arm.enable()
    for _ in range(20):
        arm.write(np.full(6, 0.5))
    arm.disconnect()
    return arm_emulator


def test_hold_stops_where_the_arm_is(moving_arm: EmulatedBus) -> None:
    report = run(request_for(moving_arm, "HOLD"))
    assert set(report.joints.values()) == {"held"}
    assert energised(moving_arm) == {True}
    goals = [servo["goal_position"] for servo in moving_arm.servos()]
    deadline_s = time.monotonic() + 10
    while [servo["present_position"] for servo in moving_arm.servos()] != goals:
        assert time.monotonic() < deadline_s


def test_hold_does_not_energise_what_is_off(arm_emulator: EmulatedBus) -> None:
    report = run(request_for(arm_emulator, "HOLD"))
    assert report.complete
    assert set(report.joints.values()) == {"was off"}
    assert energised(arm_emulator) == {False}


def test_park_goes_to_the_pose_and_lets_go(moving_arm: EmulatedBus) -> None:
    pose = dict.fromkeys(range(1, 7), 2100)
    report = run(request_for(moving_arm, "PARK_THEN_RELEASE", park_ticks=pose))
    assert set(report.joints.values()) == {"released"}
    assert report.detail == ""
    assert energised(moving_arm) == {False}
    assert all(abs(servo["present_position"] - 2100) <= 60 for servo in moving_arm.servos())
    assert moving_arm.ask("registers", id=1)["registers"]["profile_velocity"] == 31  # about 0.8 rad/s


def test_a_silent_servo_and_one_that_is_shut_down(moving_arm: EmulatedBus) -> None:
    moving_arm.fault("silent", 5)
    moving_arm.fault("overload", 2)  # its replies carry the alert, which is no refusal
    report = run(request_for(moving_arm, "RELEASE", timeout_s=0.3))
    assert not report.complete
    assert report.joints[5] == "not verified"
    assert {report.joints[i] for i in (1, 2, 3, 4, 6)} == {"released"}
    assert report.detail == "ids 5 did not confirm; cut the arm's supply by hand if it holds"


def test_lost_packets_do_not_stop_it(moving_arm: EmulatedBus) -> None:
    for kind in ("drop", "drop_request", "corrupt"):
        moving_arm.fault(kind, 0.2)
    report = run(request_for(moving_arm, "RELEASE"))
    assert report.complete
    moving_arm.ask("clear_faults")
    assert energised(moving_arm) == {False}


def test_the_driver_prepares_what_the_guardian_runs(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    request = arm.safe_stop_request("RELEASE")
    arm.disconnect()
    assert energised(arm_emulator) == {True}
    report = stop(vars(request))
    assert report["complete"] is True
    assert energised(arm_emulator) == {False}


def test_it_imports_nothing_heavy() -> None:
    program = (
        "import sys, joshua_dynamixel.safe_stop\n"
        "print(sorted({'numpy', 'pydantic', 'google.protobuf', 'zenoh', 'rich'} & set(sys.modules)))\n"
    )
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"
