from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.devices.errors import DeviceError
from joshua.devices.units import rad_to_ticks, ticks_to_rad
from joshua.schema import config_pb2
from joshua_mock.actuator import VELOCITY_MAX_RAD_S, follow
from stepped_time import SteppedTime


def test_it_starts_in_the_middle_of_its_range(mock_arm: Any) -> None:
    arm = mock_arm(position_min=2048, position_max=3072)
    arm.connect()
    reading = arm.read()
    assert reading.position_rad == pytest.approx(np.full(3, math.pi / 4), abs=1e-3)
    assert (reading.effort == 0).all()
    assert abs(reading.stamp_ns - time.time_ns()) < 5e9
    arm.disconnect()


def test_it_moves_to_its_goal_and_stops_there(mock_arm: Any, stepped_time: SteppedTime) -> None:
    arm = mock_arm()
    arm.connect()
    arm.enable()
    goal = np.array([0.5, -0.5, 0.1])
    assert arm.write(goal) == pytest.approx(goal)
    moving = False
    for _ in range(5000):
        reading = arm.read()
        moving |= bool((np.abs(reading.effort) > 0.01).any())
        if np.abs(reading.position_rad - goal).max() < 0.002 and np.abs(reading.effort).max() < 0.01:
            break
        stepped_time.sleep(0.002)
    assert moving
    assert reading.position_rad == pytest.approx(goal, abs=0.002)
    assert np.abs(reading.velocity_rad_s).max() < 0.1
    arm.disconnect()


def test_goals_are_clamped_to_the_range(mock_arm: Any) -> None:
    arm = mock_arm(position_min=1024, position_max=3072)
    arm.connect()
    arm.enable()
    assert arm.write(np.array([9.0, -9.0, 0.0])) == pytest.approx([math.pi / 2, -math.pi / 2, 0.0])


def test_readings_are_whole_ticks(mock_arm: Any) -> None:
    arm = mock_arm()
    arm.connect()
    arm.enable()
    arm.write(np.array([1.0, 0.5, 0.2]))
    for _ in range(20):
        for value in arm.read().position_rad:
            assert value == ticks_to_rad(rad_to_ticks(value))


def test_hold_stops_on_the_way(mock_arm: Any, stepped_time: SteppedTime) -> None:
    arm = mock_arm(time_constant_s=10.0)
    arm.connect()
    arm.enable()
    arm.write(np.full(3, 1.5))
    stepped_time.sleep(0.01)
    arm.hold()
    stopped = arm.read().position_rad
    stepped_time.sleep(0.05)
    assert arm.read().position_rad == pytest.approx(stopped, abs=1e-9)


def test_without_torque_nothing_can_be_commanded(mock_arm: Any) -> None:
    arm = mock_arm()
    with pytest.raises(DeviceError, match=r"MockActuator\.read: the device is not open: call connect first"):
        arm.read()
    arm.connect()
    with pytest.raises(DeviceError, match="torque is off: call enable first"):
        arm.write(np.zeros(3))


@pytest.mark.parametrize(
    ("goal", "message"),
    [
        (np.zeros(2), r"the goal has shape \(2,\); 3 joints \(joint_1, joint_2, joint_3\) need \(3,\)"),
        (np.array([0, math.nan, 0]), "the goal of joint_2 is nan; a position in radians is a finite number"),
        (np.array([0, 0, math.inf]), "the goal of joint_3 is inf"),
    ],
)
def test_what_cannot_be_a_goal_is_refused(mock_arm: Any, goal: Any, message: str) -> None:
    arm = mock_arm()
    arm.connect()
    arm.enable()
    with pytest.raises(ValueError, match=message):
        arm.write(goal)
    assert arm.read().position_rad == pytest.approx(np.zeros(3), abs=1e-3)


def test_the_motion_is_the_exact_solution_whatever_the_step() -> None:
    start, goal = np.array([0.0, 0.0, 1.0]), np.array([2.0, 0.01, -1.0])
    once = follow(start, goal, 0.3, 0.05)
    stepwise = start
    for _ in range(300):
        stepwise = follow(stepwise, goal, 0.001, 0.05)
    assert stepwise == pytest.approx(once, abs=1e-9)
    assert follow(start, goal, 0.1, 0.05)[0] == pytest.approx(0.1 * VELOCITY_MAX_RAD_S)
    assert follow(start, goal, 100.0, 0.05) == pytest.approx(goal)
    assert (follow(goal, goal, 1.0, 0.05) == goal).all()


def test_a_sine_moves_joints_that_have_no_torque(mock_arm: Any, stepped_time: SteppedTime) -> None:
    arm = mock_arm(motion=config_pb2.MOCK_MOTION_SINE, motion_frequency_hz=5.0, motion_amplitude_rad=0.3)
    arm.connect()
    positions = []
    for _ in range(100):
        positions.append(arm.read().position_rad)
        stepped_time.sleep(0.003)
    swing = np.ptp(np.array(positions), axis=0)
    assert (swing > 0.4).all()
    assert (swing < 0.61).all()
    arm.enable()
    held = arm.read().position_rad
    stepped_time.sleep(0.05)
    assert arm.read().position_rad == pytest.approx(held), "torque holds against the hand"


def test_a_sine_stays_within_the_range(mock_arm: Any, stepped_time: SteppedTime) -> None:
    arm = mock_arm(
        position_min=2000, position_max=2100, motion=config_pb2.MOCK_MOTION_SINE, motion_frequency_hz=10.0
    )
    arm.connect()
    low, high = arm.limits.position_min_rad, arm.limits.position_max_rad
    for _ in range(50):
        position = arm.read().position_rad
        assert (position >= low - 1e-9).all()
        assert (position <= high + 1e-9).all()
        stepped_time.sleep(0.002)


def test_a_file_is_replayed_and_held_at_its_end(
    mock_arm: Any, tmp_path: Path, stepped_time: SteppedTime
) -> None:
    file = tmp_path / "motion.csv"
    file.write_text("time_s,joint_2,joint_1,joint_3\n0,0,0,0\n0.05,0.2,0.1,0.3\n", encoding="utf-8")
    arm = mock_arm(motion=config_pb2.MOCK_MOTION_FILE, motion_file=str(file))
    arm.connect()
    stepped_time.sleep(0.08)
    assert arm.read().position_rad == pytest.approx([0.1, 0.2, 0.3], abs=1e-3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: no column time_s, joint_1, joint_2, joint_3; found nothing"),
        ("time_s,joint_1,joint_2\n", "line 1: no column joint_3; found time_s, joint_1, joint_2"),
        ("time_s,joint_1,joint_2,joint_3\n", "contains no sample"),
        ("time_s,joint_1,joint_2,joint_3\n0,0,0\n", "line 2: 4 numbers are needed, found '0,0,0'"),
        ("time_s,joint_1,joint_2,joint_3\n0,0,0,nan\n", "line 2: a value is not finite"),
        ("time_s,joint_1,joint_2,joint_3\n0,0,0,0\n\n0,0,0,0\n", "line 4: time_s does not increase"),
    ],
)
def test_a_bad_motion_file_is_named_with_its_line(
    mock_arm: Any, tmp_path: Path, text: str, message: str
) -> None:
    file = tmp_path / "motion.csv"
    file.write_text(text, encoding="utf-8")
    arm = mock_arm(motion=config_pb2.MOCK_MOTION_FILE, motion_file=str(file))
    with pytest.raises(DeviceError, match=message):
        arm.connect()
    assert not arm.connected


def test_an_absent_motion_file_is_named(mock_arm: Any, tmp_path: Path) -> None:
    arm = mock_arm(motion=config_pb2.MOCK_MOTION_FILE, motion_file=str(tmp_path / "nowhere.csv"))
    with pytest.raises(
        DeviceError, match=r"nowhere\.csv cannot be read: .*No such file.*columns time_s,joint_1"
    ):
        arm.connect()
