import time
from typing import Any

import numpy as np
import pytest
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua_dynamixel.actuator import DynamixelActuator
from joshua_emulator import EmulatedBus
from joshua_servo.errors import (
    MotorCheckFailed,
    NoReply,
    SafetyTripped,
)
from patience import BRISK_S, PATIENT_S
from servo_families import drive_to, energised

MIXED = ["xl330-m077", "xl430-w250", "xl430-w250"]
POSE = np.array([0.3, -0.2, 0.25, -0.3, 0.2, 0.1])


def brisk(arm: DynamixelActuator) -> DynamixelActuator:
    """Where a servo does not answer, or boots: who waits long for it waits in vain."""
    arm.bus.reply_margin_s = BRISK_S
    return arm


def read_until_it_trips(arm: DynamixelActuator) -> str:
    deadline_s = time.monotonic() + 60
    while time.monotonic() < deadline_s:
        try:
            arm.read()
        except SafetyTripped as trip:
            return str(trip)
        except NoReply:
            continue  # servos that start anew are silent for a moment
    raise AssertionError("nothing tripped")


def beyond_the_turn(emulator: EmulatedBus) -> dict[int, int]:
    """Positions of joints whose range crosses the end of the encoder's turn."""
    beyond = {}
    for motor in emulator.calibration()["motors"]:
        for position in (motor["range_min"] + 20, motor["range_max"] - 20):
            if not 0 <= position + motor["homing_offset"] < 4096:
                beyond[motor["id"]] = position
    assert beyond
    return beyond


def test_a_speed_above_the_servos_limit_is_lowered_to_it(emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(
        emulator, {"allow_uncalibrated": True}, calibrated=False, velocity=400,
        models=MIXED,
    )  # fmt: skip
    arm.connect()
    arm.enable()
    speeds = [emulator.ask("registers", id=i)["registers"]["profile_velocity"] for i in (1, 2, 3)]
    assert speeds == [400, 265, 265]
    assert arm.limits.velocity_max_rad_s == pytest.approx([9.592, 6.355, 6.355], rel=1e-3)


def test_the_servos_limits_hold_in_position_mode(emulator: EmulatedBus, make_arm: Any) -> None:
    emulator.ask("set_register", id=2, name="max_position_limit", value=2300)
    arm = make_arm(emulator, calibrated=False, position_max_ticks=2700, models=MIXED)
    arm.connect()
    ends = np.rint(arm.limits.position_max_rad * 4096 / (2 * np.pi) + 1350).astype(int)
    assert ends.tolist() == [2700, 2300, 2700]


def test_a_position_a_turn_away_is_taken_for_that_of_the_range(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    """Turns are forgotten without power: a joint beyond the encoder's end comes back a whole turn away."""
    beyond = beyond_the_turn(arm_emulator)
    arm_emulator.hand(beyond)
    arm_emulator.fault("brown_out")
    found = {servo["id"]: servo["present_position"] for servo in arm_emulator.servos()}
    assert {abs(found[i] - position) for i, position in beyond.items()} == {4096}
    arm = brisk(make_arm(arm_emulator))
    arm.connect()
    arm.bus.reply_margin_s = PATIENT_S
    shown = dict(zip(arm.settings.motor_ids, arm.read().position_rad, strict=True))
    for servo_id, position in beyond.items():
        assert shown[servo_id] == pytest.approx((position - 2048) * 2 * np.pi / 4096, abs=0.002)
    arm.enable()
    drive_to(arm, np.zeros(6))
    park = arm.safe_stop_request("PARK_THEN_RELEASE", park_pose_rad=[0.0] * 6).park_ticks
    for servo_id, position in beyond.items():
        assert park[servo_id] - 2048 == found[servo_id] - position


def test_a_guardian_parks_by_the_turn_that_servos_count_in_after_their_reboot(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    """A reboot that ends a hardware error makes a servo forget its turns; the guardian is told after it."""
    servo_id, position = next(iter(beyond_the_turn(arm_emulator).items()))
    arm = make_arm(arm_emulator)
    arm.connect()
    arm_emulator.hand({servo_id: position})
    arm_emulator.fault("overload", servo_id)
    before = arm_emulator.servo(servo_id)["present_position"]
    arm.check()
    brisk(arm).prepare()
    arm.bus.reply_margin_s = PATIENT_S
    assert abs(arm_emulator.servo(servo_id)["present_position"] - before) == 4096
    here = arm.read().position_rad
    park = arm.safe_stop_request("PARK_THEN_RELEASE", park_pose_rad=here.tolist()).park_ticks
    arm.enable()
    present = {servo["id"]: servo["present_position"] for servo in arm_emulator.servos()}
    assert all(abs(park[number] - ticks) < 20 for number, ticks in present.items())


def test_a_joint_beyond_its_servos_limits_gets_no_torque(emulator: EmulatedBus, make_arm: Any) -> None:
    emulator.ask("set_register", id=1, name="max_position_limit", value=2000)
    arm = make_arm(
        emulator,
        {"allow_uncalibrated": True},
        calibrated=False,
        models=MIXED,
    )
    arm.connect()
    with pytest.raises(
        DeviceError, match=r"joint_1 \(id 1\) is at 2048 ticks, outside the limits of its servo, 0 to 2000"
    ):
        arm.enable()
    assert energised(emulator) == {False}


def test_a_hardware_error_trips_and_enabling_reboots(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault("overload", 3)
    reason = read_until_it_trips(arm)
    assert "elbow_flex: the servo reports: overloaded" in reason
    assert "The torque of this arm is off" in reason
    assert energised(arm_emulator) == {False}
    with pytest.raises(SafetyTripped, match="Enable it again first"):
        arm.write(POSE)
    arm.read()  # reading goes on
    assert any(row.message == "overloaded" for row in arm.diagnostics())
    brisk(arm).enable()
    assert energised(arm_emulator) == {True}
    assert [entry["id"] for entry in arm_emulator.log("reboot")] == [3]


def test_heat_keeps_the_torque_off_even_after_a_reboot(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm_emulator.fault("over_temperature", 2)
    with pytest.raises(SafetyTripped, match=r"torque stays off: shoulder_lift: .*(too hot|85 °C)"):
        brisk(arm).enable()
    assert energised(arm_emulator) == {False}


@pytest.mark.parametrize("fault", ["under_voltage", "brown_out"])
def test_a_weak_supply_trips(fault: str, arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault(fault)
    reason = read_until_it_trips(brisk(arm))
    assert "V, allowed 3.5 to 7.0 V" in reason or "the supply was interrupted" in reason
    assert energised(arm_emulator) == {False}


@pytest.mark.parametrize(
    ("register", "value", "text"),
    [
        ("operating_mode", 1, r"id 2 is in mode 1, expected 3 \(position\), 4 \(extended position\) or 5"),
        ("operating_mode", 3, r"id 2 cannot apply its homing offset of -?\d+ ticks in mode 3 \(position\)"),
        ("drive_mode", 4, r"id 2 has time-based profiles enabled \(drive mode bit 2\), expected 0"),
        ("status_level", 1, r"id 2 does not acknowledge writes \(status level 1\), expected 2"),
    ],
)
def test_servos_that_are_set_up_for_something_else(
    register: str, value: int, text: str, arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm_emulator.ask("set_register", id=2, name="homing_offset", value=-1500)
    arm_emulator.ask("set_register", id=2, name=register, value=value)
    with pytest.raises(MotorCheckFailed, match=text):
        make_arm(arm_emulator).connect()


def test_the_motor_check_names_models_and_the_break(emulator: EmulatedBus, make_arm: Any) -> None:
    with pytest.raises(MotorCheckFailed) as caught:
        brisk(make_arm(emulator, calibrated=False)).connect()
    text = str(caught.value)
    assert "wrong model: id 2 is a xl430-w250, expected xl330-m077" in text
    assert "expected: 1 (xl330-m077), 2 (xl330-m077), 3 (xl330-m077)\n" in text
    emulator.fault("break_after", 1)
    with pytest.raises(MotorCheckFailed) as caught:
        brisk(make_arm(emulator, calibrated=False, motor_ids=[1, 2, 3])).connect()
    assert "missing ids: 2, 3\n  the chain breaks after id 1: check the cable" in str(caught.value)
    assert "found: 1 (xl330-m077, firmware 46)" in str(caught.value)


def test_two_motors_with_one_id(emulator: EmulatedBus, make_arm: Any) -> None:
    emulator.fault("duplicate", 2)
    with pytest.raises(MotorCheckFailed, match=r"two motors share the id 2: connect one alone") as caught:
        brisk(make_arm(emulator, calibrated=False, models=MIXED, motor_ids=[1, 2, 3])).connect()
    assert "missing" not in str(caught.value)


def test_an_unplug_while_the_arm_moves_ends_the_write(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, velocity=20)
    arm.connect()
    arm.enable()
    arm.write(POSE)
    arm_emulator.fault("unplug")
    arm_emulator.wait_for(["unplug"])
    with pytest.raises(DeviceDisconnected, match=r"the adapter is gone.*finds it again by its identity"):
        arm.write(POSE)
    arm.disconnect()
    arm.release()  # stop-first: works in every state


def test_another_line_speed_is_found(make_arm: Any) -> None:
    with (
        EmulatedBus("dynamixel", ids=(1, 2), baudrate=57_600) as emulator,
        pytest.raises(MotorCheckFailed, match=r"but ids 1, 2 answer at 57600: set baudrate: 57600"),
    ):
        brisk(make_arm(emulator, calibrated=False)).connect()
