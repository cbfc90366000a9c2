"""What every arm of servos does, whatever their protocol."""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import pytest
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua_emulator import EmulatedBus
from joshua_serial.errors import PortDisconnected
from joshua_servo.errors import CalibrationMismatch, NoReply, NotCalibrated, NotEnabled, SafetyTripped
from patience import BRISK_S
from servo_families import Kind, drive_to, energised

POSE = np.array([0.3, -0.2, 0.25, -0.3, 0.2, 0.1])


def test_connecting_reads_and_moves_nothing(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm_emulator.hand({1: 2200})
    arm = make_arm(arm_emulator)
    assert arm.joint_names[:2] == ("shoulder_pan", "shoulder_lift")
    before = arm.limits
    arm.connect()
    (write,) = arm_emulator.log("write", "sync_write")
    assert write["parameters"].strip("0") == "", "the echo probe writes nothing"
    reading = arm.read()
    assert reading.position_rad[0] == pytest.approx((2200 - 2048) * 2 * np.pi / 4096)
    assert reading.position_rad.shape == reading.velocity_rad_s.shape == reading.effort.shape == (6,)
    assert abs(reading.stamp_ns - time.time_ns()) < 60e9
    assert (arm.limits.position_min_rad >= before.position_min_rad).all()
    assert energised(arm_emulator) == {False}
    assert arm.identity == "usb:ARM1"
    with pytest.raises(DeviceError, match="already open"):
        arm.connect()


def test_enabling_seeds_the_goal_where_the_arm_is(
    kind: Kind, arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm_emulator.hand({1: 2300, 6: 1900})  # goals in the servos are stale now
    settings, registers = kind.paced
    arm = make_arm(arm_emulator, **settings)
    arm.connect()
    arm.enable()
    servos = arm_emulator.servos()
    assert energised(arm_emulator) == {True}
    assert [servo["goal_position"] for servo in servos] == [servo["present_position"] for servo in servos]
    assert servos[0]["present_position"] == 2300
    held = arm_emulator.ask("registers", id=1)["registers"]
    assert {name: held[name] for name in registers} == registers


@pytest.mark.parametrize("volts", [2.0, 20.0])
def test_a_wrong_supply_voltage_gets_no_torque(
    volts: float, arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    """While it runs, an arm tolerates a brief dip; that is no reason to begin with a wrong voltage."""
    arm = make_arm(arm_emulator)
    arm.connect()
    usual_volts = arm_emulator.ask("state")["volts"]
    arm_emulator.ask("set", volts=volts)
    with pytest.raises(SafetyTripped, match=rf"torque stays off: shoulder_pan.* {volts:.1f} V"):
        arm.enable()
    assert not any(entry["on"] for entry in arm_emulator.log("torque"))
    assert not arm.enabled
    arm_emulator.ask("set", volts=usual_volts)
    arm.enable()
    assert energised(arm_emulator) == {True}


@pytest.mark.parametrize(("bad", "is_refused"), [(1, False), (2, False), (3, True)])
def test_as_many_samples_as_a_protection_needs_are_read_before_torque(
    bad: int, is_refused: bool, arm_emulator: EmulatedBus, make_arm: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.prepare()
    read = arm._state.settled_feedback
    left = [bad]

    def dips() -> Any:
        readings = read()
        if left[0] > 0 and not any(entry["on"] for entry in arm_emulator.log("torque")):
            left[0] -= 1
            return [readings[0]._replace(voltage_v=1.0), *readings[1:]]
        return readings

    monkeypatch.setattr(arm, "prepare", lambda: None)
    monkeypatch.setattr(arm._state, "settled_feedback", dips)
    if is_refused:
        with pytest.raises(SafetyTripped, match=r"torque stays off: shoulder_pan: 1\.0 V, allowed"):
            arm.enable()
        assert energised(arm_emulator) == {False}
    else:
        arm.enable()
        assert energised(arm_emulator) == {True}


def test_a_voltage_that_is_wrong_now_and_then_gets_no_torque(
    arm_emulator: EmulatedBus, make_arm: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    read = arm._state.settled_feedback
    turn = itertools.cycle((0, 0, 1, 1))

    def flickers() -> Any:
        readings = read()
        readings[next(turn)] = readings[0]._replace(voltage_v=1.0)
        return readings

    monkeypatch.setattr(arm._state, "settled_feedback", flickers)
    with pytest.raises(SafetyTripped, match="the supply voltage leaves its allowed range again and again"):
        arm.enable()
    assert energised(arm_emulator) == {False}


def test_enabling_without_a_first_reading_energises_nothing(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm_emulator.fault("silent", 3)
    arm.bus.reply_margin_s = 0.5
    with pytest.raises(NoReply, match=r"elbow_flex \(id 3\) no longer answers"):
        arm.enable()
    assert energised(arm_emulator) == {False}


def test_writing_moves_within_limits_and_returns_what_was_written(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    drive_to(arm, POSE)
    assert arm.write(POSE) == pytest.approx(POSE, abs=0.001)
    top = arm.limits.position_max_rad
    drive_to(arm, top)
    assert arm.write(np.full(6, 9.0)) == pytest.approx(top, abs=1e-9)
    goals = [servo["goal_position"] for servo in arm_emulator.servos()]
    assert goals == [motor["range_max"] for motor in arm_emulator.calibration()["motors"]]


def test_without_torque_no_goal_is_sent(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    with pytest.raises(NotEnabled, match="call enable first"):
        arm.write(POSE)
    arm.enable()
    arm.release()
    assert energised(arm_emulator) == {False}
    with pytest.raises(NotEnabled):
        arm.write(POSE)
    arm.hold()
    assert energised(arm_emulator) == {False}


def test_an_uncalibrated_arm_is_read_but_not_energised(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, calibrated=False, position_min_ticks=1000, position_max_ticks=3000)
    arm.connect()
    assert arm.joint_names[0] == "joint_1"
    assert arm.read().position_rad[0] == pytest.approx(48 * 2 * np.pi / 4096)  # about 2000, the middle
    with pytest.raises(NotCalibrated, match=r"not calibrated(.|\n)*MODE_CALIBRATION.*--allow-uncalibrated"):
        arm.enable()
    assert energised(arm_emulator) == {False}
    arm.disconnect()
    waived = make_arm(arm_emulator, {"allow_uncalibrated": True}, calibrated=False)
    waived.connect()
    waived.enable()
    assert energised(arm_emulator) == {True}


def test_a_dry_run_does_everything_with_torque_off(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, {"dry_run": True})
    arm.connect()
    arm.enable()
    assert arm.write(np.zeros(6)) == pytest.approx(np.zeros(6))
    arm.hold()
    arm.read()
    assert energised(arm_emulator) == {False}
    assert {entry["on"] for entry in arm_emulator.log("torque")} <= {False}


def test_a_calibration_of_another_arm_is_refused(
    kind: Kind, arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    with kind.emulated_arm("ARM2") as other:
        foreign = other.calibration()
    foreign["motors"][0]["homing_offset"] += 7
    arm = make_arm(arm_emulator, calibration=foreign)
    with pytest.raises(CalibrationMismatch) as caught:
        arm.connect()
    text = str(caught.value)
    assert "it was made for usb:ARM2, and this is usb:ARM1" in text
    assert "shoulder_pan (id 1): homing_offset" in text
    assert "joshua calibrate --check" in text
    assert not arm.connected


def test_unplugging_disconnects_and_the_arm_is_found_under_another_name(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault("unplug")
    arm_emulator.wait_for(["unplug"])
    with pytest.raises(PortDisconnected, match="the adapter is gone"):
        arm.read()
    with pytest.raises(DeviceDisconnected):  # what cannot be verified is not claimed
        arm.release()
    arm.disconnect()
    arm.release()
    with pytest.raises(DeviceError, match=r"ARM1.*: no adapter with this identity"):
        arm.connect()
    arm_emulator.fault("replug", name="ttyACM4")
    arm.connect()
    assert arm.read().position_rad.shape == (6,)
    with pytest.raises(NotEnabled):  # it never comes back energised by itself
        arm.write(np.zeros(6))


def test_a_joint_beyond_its_range_stays_until_it_is_told_and_comes_back_slowly(
    kind: Kind, arm_emulator: EmulatedBus
) -> None:
    calibration = arm_emulator.calibration()
    motor = calibration["motors"][1]
    start = motor["range_max"]
    motor["range_max"] -= 600
    arm_emulator.hand({2: start})
    arm = kind.driver(arm_emulator, calibration=calibration)
    arm.connect()
    try:
        arm.enable()
        here = arm.read().position_rad
        assert here[1] > arm.limits.position_max_rad[1] + 0.8
        for _ in range(5):
            np.testing.assert_allclose(arm.write(here), here, atol=0.001)
        began_s = time.monotonic()
        further = arm.write(here + 0.5)
        assert further[1] <= here[1] + 0.001, "no farther out"
        assert arm_emulator.servo(2)["goal_position"] == start
        back = arm.write(np.zeros(6))
        fastest = arm.limits.velocity_max_rad_s[1] * (time.monotonic() - began_s + 0.5)
        assert here[1] - back[1] <= fastest, "no faster than the joint may move"
        arm.hold()
    finally:
        arm.disconnect()


def test_a_mute_servo_does_not_keep_the_others_from_holding(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    far = arm.read().position_rad + 0.4
    arm.write(far)
    time.sleep(0.5)  # the next goal may be half a second of full speed away
    arm.write(far)
    arm_emulator.fault("silent", 3)
    arm.bus.reply_margin_s = BRISK_S
    arm.bus.patience_s = 10.0
    with pytest.raises(NoReply, match=r"elbow_flex \(id 3\) no longer answers"):
        arm.hold()
    assert arm.bus.counters.lost[3] <= 10, "however many retries there are"
    for servo in arm_emulator.servos():
        if servo["id"] != 3:
            assert abs(servo["goal_position"] - servo["present_position"]) < 250
