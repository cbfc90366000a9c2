"""An overload of the gripper alone: its torque goes, the arm stands."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from eventually import eventually
from joshua.devices.errors import DeviceError
from joshua_emulator import EmulatedBus
from joshua_servo.errors import SafetyTripped
from patience import BRISK_S
from servo_families import Kind, energised

ARM, GRIPPER = (1, 2, 3, 4, 5), 6


def torque(emulator: EmulatedBus) -> list[bool]:
    return [servo["energised"] for servo in emulator.servos()]


@pytest.fixture
def relaxed_arm(arm_emulator: EmulatedBus, make_arm: Any) -> Any:
    """An arm whose gripper has been overloaded."""
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault("overload", GRIPPER)
    arm.read()
    return arm


def test_an_overload_of_the_gripper_relaxes_the_gripper_alone(
    arm_emulator: EmulatedBus, relaxed_arm: Any
) -> None:
    assert torque(arm_emulator) == [True] * 5 + [False]
    assert relaxed_arm.enabled
    (reason,) = relaxed_arm.relaxed.values()
    assert reason.startswith("gripper: the servo reports: overloaded (load ")


def test_no_goal_is_written_to_it_until_it_rejoins(arm_emulator: EmulatedBus, relaxed_arm: Any) -> None:
    goal = relaxed_arm.read().position_rad
    before = arm_emulator.servo(GRIPPER)["goal_position"]
    for _ in range(20):
        relaxed_arm.read()
        relaxed_arm.write(goal + 0.05)
    relaxed_arm.hold()
    assert arm_emulator.servo(GRIPPER)["goal_position"] == before
    assert torque(arm_emulator) == [True] * 5 + [False]

    arm_emulator.hand({GRIPPER: 2200})
    relaxed_arm.rejoin()
    assert energised(arm_emulator) == {True}
    assert arm_emulator.servo(GRIPPER)["goal_position"] == 2200, "seeded where it is"
    assert relaxed_arm.relaxed == {}
    start = relaxed_arm.read().position_rad
    assert relaxed_arm.write(start)[5] == pytest.approx(start[5], abs=0.01)


def test_the_torque_check_leaves_it_out(arm_emulator: EmulatedBus, relaxed_arm: Any) -> None:
    def looks_again() -> None:
        relaxed_arm._torque_checked_s = 0.0
        relaxed_arm.read()

    looks_again()
    arm_emulator.ask("set_register", id=2, name="torque_enable", value=0)
    # a look is left out while a late reply could be taken for its answer
    with pytest.raises(SafetyTripped, match=r"shoulder_lift \(id 2\) lost torque"):
        eventually(looks_again)


def test_another_joint_still_takes_the_torque_off_the_whole_arm(
    arm_emulator: EmulatedBus, relaxed_arm: Any
) -> None:
    arm_emulator.fault("overload", 3)
    with pytest.raises(SafetyTripped, match="elbow_flex: the servo reports: overloaded"):
        relaxed_arm.read()
    assert energised(arm_emulator) == {False}
    relaxed_arm.enable()
    assert energised(arm_emulator) == {True}
    assert relaxed_arm.relaxed == {}


def test_both_at_once_take_the_torque_off_the_whole_arm(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.fault("overload", GRIPPER)
    arm_emulator.fault("overload", 3)
    with pytest.raises(SafetyTripped, match="elbow_flex: the servo reports: overloaded"):
        arm.read()
    assert energised(arm_emulator) == {False}


def test_heat_of_the_gripper_takes_the_torque_off_the_whole_arm(
    arm_emulator: EmulatedBus, make_arm: Any
) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm_emulator.ask("set", id=GRIPPER, temperature_c=85)
    with pytest.raises(SafetyTripped, match="gripper"):
        arm.read()
    assert energised(arm_emulator) == {False}


def test_a_gripper_that_is_still_too_hot_stays_relaxed(arm_emulator: EmulatedBus, relaxed_arm: Any) -> None:
    arm_emulator.ask("set", id=GRIPPER, temperature_c=85)
    with pytest.raises(DeviceError, match=r"gripper: .*Remove the cause, then try again"):
        relaxed_arm.rejoin()
    assert torque(arm_emulator) == [True] * 5 + [False]
    arm_emulator.ask("set", id=GRIPPER, temperature_c=30)
    relaxed_arm.rejoin()
    assert energised(arm_emulator) == {True}


def test_a_gripper_that_does_not_confirm_fails_the_arm(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator)
    arm.connect()
    arm.enable()
    arm.bus.reply_margin_s = BRISK_S
    arm_emulator.fault("silent", GRIPPER)
    with pytest.raises(SafetyTripped, match=r"overloaded\. Its torque may still be on") as caught:
        arm._relax({5: "gripper: the servo reports: overloaded"})
    assert not caught.value.released


def test_the_guardian_leaves_a_relaxed_gripper_without_torque(
    kind: Kind, arm_emulator: EmulatedBus, relaxed_arm: Any
) -> None:
    request = relaxed_arm.safe_stop_request("HOLD")
    relaxed_arm._port.close()
    report = kind.stop(request)
    assert report.joints == {**dict.fromkeys(ARM, "held"), GRIPPER: "was off"}
    assert torque(arm_emulator) == [True] * 5 + [False]


def test_goals_of_the_arm_still_move_it(relaxed_arm: Any) -> None:
    goal = relaxed_arm.read().position_rad + np.array([0.1, 0, 0, 0, 0, 0])
    while abs(relaxed_arm.read().position_rad[0] - goal[0]) > 0.01:
        relaxed_arm.write(goal)


UNCALIBRATED = {"allow_uncalibrated": True, "external": ("/arm/command",)}
WARNING = (
    "the arm is not calibrated, so it is unknown which joint is the gripper. A joint that stalls loses its "
    "torque alone, and the others keep theirs. Name the gripper in the file, for example "
    "joint { motor_id: 6 gripper: true }, or calibrate the arm"
)


@pytest.mark.parametrize("stalled", [3, GRIPPER])
def test_without_a_calibration_the_joint_that_stalls_relaxes_alone_and_the_start_says_so(
    stalled: int, arm_emulator: EmulatedBus, make_arm: Any, caplog: pytest.LogCaptureFixture
) -> None:
    arm = make_arm(arm_emulator, UNCALIBRATED, calibrated=False)
    arm.connect()
    assert [text.partition(": ")[2] for text in caplog.messages] == [WARNING]
    arm.enable()
    arm_emulator.fault("overload", stalled)
    arm.read()
    assert torque(arm_emulator) == [servo_id != stalled for servo_id in (*ARM, GRIPPER)]
    assert list(arm.relaxed) == [arm.joint_names[stalled - 1]]
    arm.rejoin()
    assert energised(arm_emulator) == {True}


def test_heat_takes_the_torque_off_an_uncalibrated_arm(arm_emulator: EmulatedBus, make_arm: Any) -> None:
    arm = make_arm(arm_emulator, UNCALIBRATED, calibrated=False)
    arm.connect()
    arm.enable()
    arm_emulator.ask("set", id=3, temperature_c=85)
    with pytest.raises(SafetyTripped, match="joint_3"):
        arm.read()
    assert energised(arm_emulator) == {False}


@pytest.mark.parametrize(
    "joint", [{"motor_id": GRIPPER, "gripper": True}, {"gripper": False}], ids=["named", "none"]
)
def test_a_file_that_says_which_joint_is_a_gripper_is_obeyed(
    joint: dict[str, Any], arm_emulator: EmulatedBus, make_arm: Any, caplog: pytest.LogCaptureFixture
) -> None:
    arm = make_arm(arm_emulator, UNCALIBRATED, calibrated=False, joint=[joint])
    arm.connect()
    assert caplog.messages == []
    arm.enable()
    arm_emulator.fault("overload", 3)
    with pytest.raises(SafetyTripped, match="joint_3: the servo reports: overloaded"):
        arm.read()
    assert energised(arm_emulator) == {False}


def test_a_leader_without_a_calibration_has_nothing_to_relax(
    arm_emulator: EmulatedBus, make_arm: Any, caplog: pytest.LogCaptureFixture
) -> None:
    make_arm(arm_emulator, {"allow_uncalibrated": True}, calibrated=False).connect()
    assert caplog.messages == []
