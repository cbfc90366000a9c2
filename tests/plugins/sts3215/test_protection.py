"""Protections of an arm, its torque as the servos tell it, and the check of an open arm."""

import time
from typing import Any

import numpy as np
import pytest
from joshua.devices.errors import DeviceError
from joshua_emulator import EmulatedBus
from joshua_servo.errors import MotorCheckFailed, NoReply, SafetyTripped
from joshua_sts3215.registers import StatusBit
from patience import BRISK_S


def energised(emulator: EmulatedBus) -> set[bool]:
    return {servo["energised"] for servo in emulator.servos()}


def test_overload_takes_the_torque_off_until_it_is_enabled_again(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault("overload", 3)
    with pytest.raises(
        SafetyTripped, match=r"elbow_flex: the servo reports: overloaded.*torque of this arm is off"
    ):
        arm.read()
    assert energised(arm_emulator) == {False}
    arm.read()
    with pytest.raises(SafetyTripped, match="Enable it again first"):
        arm.write(np.zeros(6))
    arm.enable()
    assert energised(arm_emulator) == {True}


def test_heat_trips_and_stays_until_it_is_over(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.ask("set", id=1, temperature_c=75)
    with pytest.raises(SafetyTripped, match="shoulder_pan"):
        arm.read()
    with pytest.raises(SafetyTripped, match="torque stays off: shoulder_pan"):
        arm.enable()
    assert energised(arm_emulator) == {False}
    arm_emulator.ask("set", id=1, temperature_c=30)
    arm.enable()  # the servo keeps its fault until its torque is written again
    assert energised(arm_emulator) == {True}


def test_a_fault_that_only_the_error_byte_of_a_reply_tells_counts(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm_emulator.fault("overload", 3)
    assert arm.bus.ping(3)
    assert arm.bus.status[3] & StatusBit.OVERLOAD
    blocks = [bytes(15)] * 6  # a status register that tells nothing
    assert [reading.status for reading in arm.parse(blocks)] == [0, 0, StatusBit.OVERLOAD, 0, 0, 0]


def test_torque_is_read_back(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    assert arm.read_torque() == dict.fromkeys(arm.joint_names, False)
    arm.enable()
    assert arm.read_torque() == dict.fromkeys(arm.joint_names, True)
    arm_emulator.ask("set_register", id=3, name="torque_enable", value=0)
    assert [joint for joint, torque in arm.read_torque().items() if not torque] == ["elbow_flex"]
    arm_emulator.fault("silent", 4)
    arm.bus.reply_margin_s = BRISK_S
    with pytest.raises(NoReply, match=r"wrist_flex \(id 4\) does not report its torque"):
        arm.read_torque()


def test_a_joint_beyond_its_servos_limits_gets_no_torque(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    """With torque the servo itself would jump to its limit, at full speed."""
    highest = arm_emulator.calibration()["motors"][1]["range_max"]
    arm_emulator.hand({2: highest})
    arm_emulator.ask("set_register", id=2, name="max_position_limit", value=highest - 600)
    arm = make_arm(arm_emulator, calibration=arm_emulator.calibration())
    arm.connect()
    with pytest.raises(SafetyTripped, match=r"shoulder_lift \(id 2\) is at \d+ ticks, outside the limits of"):
        arm.enable()
    assert energised(arm_emulator) == {False}
    arm_emulator.hand({2: highest - 590})
    arm.enable()
    assert energised(arm_emulator) == {True}


def test_an_open_arm_is_checked_again(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    with pytest.raises(DeviceError, match="the device is not open: call connect first"):
        arm.check()
    arm.connect()
    arm.check()
    arm_emulator.ask("set_register", id=2, name="mode", value=1)
    with pytest.raises(MotorCheckFailed, match="id 2 is in mode 1"):
        arm.check()
    assert arm.connected


def test_a_trip_says_whether_the_torque_is_off(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault("overload", 3)
    with pytest.raises(SafetyTripped) as caught:
        arm.read()
    assert caught.value.released


def test_a_power_cut_is_noticed_and_does_not_energise_again(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, velocity_ticks_s=800)
    arm.connect()
    arm.enable()
    arm.bus.reply_margin_s = BRISK_S  # it is silent while it boots
    arm_emulator.fault("brown_out", 4)
    deadline_s = time.monotonic() + 60
    with pytest.raises((SafetyTripped, NoReply)) as caught:  # noqa: PT012 - until the check has its turn
        while time.monotonic() < deadline_s:
            arm.read()
    while isinstance(caught.value, NoReply) and time.monotonic() < deadline_s:
        with pytest.raises((SafetyTripped, NoReply)) as caught:  # noqa: PT012
            while True:
                arm.read()
    assert "wrist_flex (id 4) lost torque or settings without a command" in str(caught.value)
    assert energised(arm_emulator) == {False}


def test_a_voltage_that_a_servo_reports_is_logged_once(
    arm_emulator: EmulatedBus, make_arm: Any, caplog: pytest.LogCaptureFixture
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm_emulator.ask("set", volts=3.0)
    for _ in range(5):
        arm.read()
    lines = [
        text for text in caplog.messages if "shoulder_pan reports its supply voltage as out of range" in text
    ]
    assert lines == [
        "shoulder_pan reports its supply voltage as out of range: 3.0 V. Check the supply and its cable"
    ]
    arm_emulator.ask("set", volts=12.0)
    arm.read()
    arm_emulator.ask("set", volts=3.0)
    arm.read()
    assert sum("shoulder_pan reports" in text for text in caplog.messages) == 2
