import contextlib
import time
from typing import Any

import numpy as np
import pytest
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua_emulator import EmulatedBus
from joshua_servo.bus import REPLY_MARGIN_S
from joshua_servo.errors import (
    CalibrationMismatch,
    MotorCheckFailed,
    NoReply,
)
from patience import BRISK_S, PATIENT_S
from servo_families import drive_to, energised

POSE = np.array([0.3, -0.2, 0.25, -0.3, 0.2, 0.1])


def test_enabling_is_all_or_nothing_on_a_bad_line(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    for _ in range(8):
        arm_emulator.fault("drop_request", 0.5)
        arm.bus.reply_margin_s = REPLY_MARGIN_S
        try:
            arm.enable()
        except DeviceError:
            assert not arm.enabled
        else:
            assert energised(arm_emulator) == {True}
        arm_emulator.ask("clear_faults")
        arm.bus.reply_margin_s = PATIENT_S
        arm.release()
        assert energised(arm_emulator) == {False}
    goals = [servo["goal_position"] for servo in arm_emulator.servos()]
    assert goals == [2048] * 6


def test_the_tightest_limit_holds(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm_emulator.ask("set_register", id=2, name="max_position_limit", value=2300)
    calibration = arm_emulator.calibration()
    calibration["motors"][0]["range_max"] = 2500
    arm = make_arm(arm_emulator, calibration=calibration, position_max_ticks=2700)
    arm.connect()
    ends = np.rint(arm.limits.position_max_rad * 4096 / (2 * np.pi) + 2048).astype(int)
    assert ends.tolist()[:3] == [2500, 2300, 2700]


def test_a_goal_far_away_is_approached_at_the_allowed_speed(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, velocity_ticks_s=500)
    arm.connect()
    arm.enable()
    start = arm.read().position_rad
    start_s = time.monotonic()
    written = arm.write(start + 1.0)
    elapsed_s = time.monotonic() - start_s + 0.5  # enable was a moment ago; the window is at most this
    assert (written - start <= 500 * 2 * np.pi / 4096 * elapsed_s + 0.002).all()
    assert (written < start + 0.9).all()


def test_a_motion_of_less_than_a_tick_a_cycle_still_arrives(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, velocity_ticks_s=20)
    arm.connect()
    arm.enable()
    start = arm.read().position_rad
    deadline_s = time.monotonic() + 60
    while np.abs(arm.write(start + 0.015) - start - 0.015).max() > 0.001:  # 10 ticks, half a second
        assert time.monotonic() < deadline_s
        arm.read()  # paces the loop by the line


@pytest.mark.parametrize("goal", [np.zeros(5), np.zeros((6, 1)), np.array([0, 0, 0, 0, 0, np.nan])])
def test_a_wrong_goal_is_refused(goal: Any, arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    with pytest.raises(ValueError, match=r"Sts3215Actuator\.write: the goal"):
        arm.write(goal)


def test_hold_stops_a_motion(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, velocity_ticks_s=300)
    arm.connect()
    arm.enable()
    for _ in range(10):
        arm.write(np.full(6, 0.6))
    arm.hold()
    goals = np.array([servo["goal_position"] for servo in arm_emulator.servos()])
    assert (np.abs(goals - 2048) < 380).all()
    assert energised(arm_emulator) == {True}


def test_servos_calibrated_anew_need_a_new_file(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    old = arm_emulator.calibration()
    arm_emulator.ask("set_register", id=3, name="homing_offset", value=77)
    with pytest.raises(
        CalibrationMismatch, match=r"have been recalibrated.*\n.*elbow_flex \(id 3\).*77 in the servo"
    ):
        make_arm(arm_emulator, calibration=old).connect()


def test_a_calibration_wider_than_the_servo_allows_is_refused(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    calibration = arm_emulator.calibration()
    calibration["motors"][1]["range_max"] += 5
    with pytest.raises(CalibrationMismatch, match=r"shoulder_lift \(id 2\): range 959 to 3142 in the cal"):
        make_arm(arm_emulator, calibration=calibration).connect()


def test_another_adapter_is_refused_even_with_the_same_values(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    calibration = arm_emulator.calibration()
    calibration["device_identity"] = "usb:ARM9"
    with pytest.raises(
        CalibrationMismatch,
        match=r'for usb:ARM9, and this is usb:ARM1(.|\n)*write device_identity: "usb:ARM1"',
    ):
        make_arm(arm_emulator, calibration=calibration).connect()


def test_servos_set_up_for_something_else_are_refused(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm_emulator.ask("set_register", id=2, name="mode", value=1)
    with pytest.raises(MotorCheckFailed, match=r"id 2 is in mode 1, expected 0 \(position\)"):
        arm.connect()
    arm_emulator.ask("set_register", id=2, name="mode", value=0)
    arm_emulator.ask("set_register", id=2, name="max_position_limit", value=0)
    with pytest.raises(MotorCheckFailed, match=r"joint_2 \(id 2\): \d+ to \d+ allowed by the configuration"):
        make_arm(arm_emulator, calibrated=False).connect()


def test_a_calibrated_arm_that_was_moved_is_found_by_a_new_driver(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm = make_arm(arm_emulator)  # named by its path, as a node that is started again
    arm_emulator.fault("unplug")
    arm_emulator.fault("replug", name="ttyACM4")
    arm.connect()
    assert arm.identity == "usb:ARM1"
    assert arm.safe_stop_request("HOLD").path.endswith("ttyACM4")


def test_a_driver_that_is_started_again_knows_the_adapter_of_the_one_before(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    """Named by its path and not calibrated, so that nothing but this run knows whose adapter it was."""
    arm = make_arm(arm_emulator, calibrated=False)
    arm.connect()
    request = arm.safe_stop_request("RELEASE").to_values()
    arm.disconnect()
    arm_emulator.fault("unplug")
    arm_emulator.fault("replug", name="ttyACM4")
    with pytest.raises(DeviceError, match="no such serial port"):
        make_arm(arm_emulator, calibrated=False).connect()
    again = make_arm(arm_emulator, calibrated=False, remembered=request)
    again.connect()
    assert again.identity == "usb:ARM1"


def test_a_servo_that_falls_silent_is_named(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm_emulator.fault("break_after", 4)
    arm.bus.reply_margin_s = 0.5
    with pytest.raises(
        DeviceDisconnected, match=r"wrist_roll \(id 5\), gripper \(id 6\).*the chain breaks after id 4"
    ):
        arm.read()
    arm_emulator.fault("silent")
    with pytest.raises(DeviceDisconnected, match=r"no servo answers\. Check the supply"):
        arm.read()


def test_a_release_that_is_not_confirmed_is_reported(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault("silent", 2)
    arm.bus.reply_margin_s = BRISK_S
    with pytest.raises(NoReply, match=r"shoulder_lift \(id 2\) does not confirm.*Cut the arm's supply"):
        arm.release()
    assert [servo["energised"] for servo in arm_emulator.servos()] == [
        False,
        True,
        False,
        False,
        False,
        False,
    ]


def test_line_faults_change_no_position(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    drive_to(arm, POSE)
    arm.bus.reply_margin_s = REPLY_MARGIN_S
    for kind in ("drop", "corrupt", "late"):
        arm_emulator.fault(kind, 0.02)
    for _ in range(60):
        with contextlib.suppress(NoReply):  # several times in a row: the node leaves the cycle out
            assert arm.read().position_rad == pytest.approx(POSE, abs=0.006)
        arm.write(POSE)
    assert sum(arm.bus.counters.lost.values()) > 0
    assert any("replies lost" in row.message for row in arm.diagnostics() if row.name == "bus")


def test_diagnostics_before_and_after_reading(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    assert [row.name for row in arm.diagnostics()] == ["bus"]
    arm.read()
    rows = arm.diagnostics()
    assert [row.name for row in rows] == [*arm.joint_names, "bus"]
    assert rows[0].hardware_id == "usb:ARM1 id 1"
    assert {row.level for row in rows} == {0}


def test_calls_on_a_closed_device(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    for verb in (arm.read, arm.enable, arm.hold, lambda: arm.write(POSE)):
        with pytest.raises(DeviceError, match="the device is not open: call connect first"):
            verb()
    arm.release()
    arm.disconnect()
    arm.disconnect()
    assert arm.limits.position_min_rad.shape == (6,)
