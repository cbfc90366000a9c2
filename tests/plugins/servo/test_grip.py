"""Grip mode, against the emulated servo itself in emulated time, and once through the wire."""

from __future__ import annotations

import contextlib
import itertools
import time
from typing import Any

import numpy as np
import pytest
from joshua.devices.errors import DeviceSilent
from joshua_emulator import EmulatedBus
from joshua_emulator.feetech.servo import Servo
from joshua_emulator.joint import Joint
from joshua_emulator.servo_bus.servo import Supply
from joshua_servo.feedback import Feedback
from joshua_servo.grip import Grip, GripRule
from joshua_sts3215.feedback import parse_feedback
from joshua_sts3215.registers import FEEDBACK, GOAL_POSITION, TORQUE_LIMIT, StatusBit
from servo_families import STS3215_KIND

CYCLE_S = 0.02
OBJECT = 1900  # ticks; the jaw closes towards lower ones
FIVE_DEGREES = 57
RULE = GripRule(load=0.15, squeeze_ticks=33, trip_load=0.25, trip_s=2.0)


class Rig:
    """A gripper's servo, its registers written and read as a driver does, in emulated time."""

    def __init__(self, *, factory: bool = False) -> None:
        self.servo = Servo(Joint(2048.0, 0.0, 4095.0), Supply())
        if not factory:
            for name, value in (("overload_torque", 25), ("position_p", 16), ("torque_limit", 500)):
                self.servo.put(name, value)
        self.servo.joint.put_object(float(OBJECT))
        self.now_s = 100.0

    def write(self, goal: int) -> None:
        self.servo.write(GOAL_POSITION.address, GOAL_POSITION.encode(goal), self.now_s)

    def limit(self, value: int) -> None:
        self.servo.write(TORQUE_LIMIT.address, TORQUE_LIMIT.encode(value), self.now_s)

    def read(self) -> Feedback:
        self.now_s += CYCLE_S
        return parse_feedback(self.servo.read(*FEEDBACK, self.now_s))


def hold(rig: Rig, grip: Grip | None, seconds: float, wanted: int = OBJECT - FIVE_DEGREES) -> list[Feedback]:
    """Commands a goal beyond the object; with a grip as the driver does. Ends at the first overload."""
    readings: list[Feedback] = []
    rig.write(wanted)
    for _ in range(round(seconds / CYCLE_S)):
        reading = rig.read()
        readings.append(reading)
        if reading.status & StatusBit.OVERLOAD:
            break
        if grip is not None:
            grip.look(reading, wanted, rig.now_s)
            rig.limit(200 if grip.direction else 500)
            rig.write(grip.goal(wanted))
    return readings


@pytest.mark.parametrize("factory", [True, False], ids=["factory settings", "settings of a gripper"])
def test_without_grip_mode_a_closed_gripper_trips_within_three_seconds(factory: bool) -> None:
    rig = Rig(factory=factory)
    readings = hold(rig, None, 10)
    assert readings[-1].status & StatusBit.OVERLOAD
    assert 2.0 <= len(readings) * CYCLE_S <= 3.0


def test_an_object_is_held_for_five_minutes_without_a_trip() -> None:
    rig = Rig()
    grip = Grip(RULE)
    readings = hold(rig, grip, 300)
    assert not readings[-1].status
    assert len(readings) == 300 / CYCLE_S
    settled = readings[100:]
    assert {reading.position for reading in settled} == {OBJECT}
    assert all(0.15 <= abs(reading.load) <= 0.2 for reading in settled)
    assert max(reading.temperature_c for reading in readings) < 40
    assert grip.direction == -1


def test_opening_lets_go_and_another_object_is_held_again() -> None:
    rig = Rig()
    grip = Grip(RULE)
    hold(rig, grip, 1)
    assert grip.direction == -1
    hold(rig, grip, 1, wanted=OBJECT + 100)
    assert grip.direction == 0
    assert rig.read().position == OBJECT + 100
    hold(rig, grip, 1)
    assert grip.direction == -1


def test_an_object_that_is_taken_away_ends_the_grip_and_the_jaw_closes() -> None:
    rig = Rig()
    grip = Grip(RULE)
    hold(rig, grip, 1)
    rig.servo.joint.put_object(None)
    readings = hold(rig, grip, 3)
    assert grip.direction == 0
    assert readings[-1].position == OBJECT - FIVE_DEGREES


def test_a_joint_on_its_way_grips_nothing() -> None:
    grip = Grip(RULE)
    for step in range(100):
        grip.look(Feedback(2000 + 8 * step, 400.0, 0.4, 12.0, 30, 0, True, 0.2), 3000, step * CYCLE_S)
    assert grip.direction == 0


def test_the_grip_gives_way_before_a_servo_that_ignores_its_limit_trips() -> None:
    """As where the write of the torque limit is lost each time."""
    rig = Rig()
    rig.servo.put("position_p", 100)
    grip = Grip(RULE)
    wanted, loads = OBJECT - FIVE_DEGREES, []
    rig.write(wanted)
    for _ in range(round(20 / CYCLE_S)):
        reading = rig.read()
        assert not reading.status & StatusBit.OVERLOAD
        loads.append(abs(reading.load))
        grip.look(reading, wanted, rig.now_s)
        rig.write(grip.goal(wanted))
    longest = max(len(list(run)) for over, run in itertools.groupby(loads, lambda load: load >= 0.25) if over)
    assert longest * CYCLE_S < 2.0


def read(arm: Any) -> None:
    """Reads as a node does, which tolerates a moment without a reply."""
    with contextlib.suppress(DeviceSilent):
        arm.read()


def closing(arm: Any) -> np.ndarray:
    goal = arm.read().position_rad
    goal[5] -= 0.6
    return goal


@pytest.fixture
def arm_with_an_object() -> Any:
    with STS3215_KIND.emulated_arm() as emulator:
        emulator.ask("set", id=6, object_ticks=emulator.servo(6)["present_position"] - 50)
        yield emulator


@pytest.mark.timing
def test_a_driven_gripper_holds_where_one_without_grip_mode_drops_its_object(
    arm_with_an_object: EmulatedBus,
) -> None:
    without: dict[str, Any] = {"joint": [{"motor_id": 6, "grip_load_percent": 0}]}
    arm = STS3215_KIND.driver(arm_with_an_object, **without)
    arm.connect()
    try:
        arm.enable()
        goal = closing(arm)
        deadline_s = time.monotonic() + 60
        while not arm.relaxed:
            assert time.monotonic() < deadline_s
            arm.write(goal)
            read(arm)
        assert "overloaded" in arm.relaxed["gripper"]
    finally:
        arm.disconnect()

    arm = STS3215_KIND.driver(arm_with_an_object)
    arm.connect()
    try:
        arm.enable()
        goal = closing(arm)
        end_s = time.monotonic() + 4
        while time.monotonic() < end_s:
            arm.write(goal)
            read(arm)
        servo = arm_with_an_object.servo(6)
        assert servo["energised"]
        assert 150 <= abs(servo["present_load"]) <= 200
        registers = arm_with_an_object.ask("registers", id=6)["registers"]
        assert registers["torque_limit"] == 200
        arm.hold()
        held = arm_with_an_object.servo(6)
        assert held["goal_position"] < held["present_position"], "a hold keeps the object"
        goal[5] += 0.6
        while arm_with_an_object.ask("registers", id=6)["registers"]["torque_limit"] != 500:
            assert time.monotonic() < end_s + 60
            arm.write(goal)
            read(arm)
    finally:
        arm.disconnect()


@pytest.mark.parametrize(
    ("joint", "problem"),
    [
        ({"motor_id": 6, "gripper": True, "grip_torque_percent": 30}, "30 % torque, but its limit is 50 %"),
        ({"motor_id": 6, "gripper": True, "torque_limit_percent": 10}, "20 % torque, but its limit is 10 %"),
        ({"motor_id": 6, "grip_load_percent": 15}, "grip_load_percent, but lacks other settings"),
    ],
)
def test_a_grip_that_would_trip_is_refused(joint: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        STS3215_KIND.settings_type.model_validate(
            {"port": "/dev/ttyACM0", "motor_ids": [6], "joint": [joint]}
        )
