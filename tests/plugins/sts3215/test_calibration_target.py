"""What a calibration reads from the servos and leaves in their EEPROM."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
from joshua.devices.errors import DeviceDisconnected, DeviceError
from joshua_calibration.target import StoredMotor
from joshua_emulator import EmulatedBus
from joshua_servo.calibration_target import ServoCalibrationTarget
from servo_families import STS3215_KIND


@pytest.fixture
def target(arm_emulator: EmulatedBus) -> Iterator[ServoCalibrationTarget]:
    target = STS3215_KIND.target(arm_emulator)
    target.connect()
    yield target
    target.disconnect()


def test_six_servos_are_an_arm_whose_roll_goes_round(target: ServoCalibrationTarget) -> None:
    names = [motor.joint_name for motor in target.motors]
    assert names == ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
    assert [motor.joint_name for motor in target.motors if motor.full_turn] == ["wrist_roll"]
    assert target.identity == "usb:ARM1"


def test_other_arms_have_numbered_joints(emulator: EmulatedBus) -> None:
    assert [motor.joint_name for motor in STS3215_KIND.target(emulator).motors] == [
        "joint_1",
        "joint_2",
        "joint_3",
    ]


def test_what_is_stored_is_read_back_and_the_lock_is_on_again(
    arm_emulator: EmulatedBus, target: ServoCalibrationTarget
) -> None:
    target.store(3, StoredMotor(-2047, 5, 4090))
    assert target.stored()[2] == StoredMotor(-2047, 5, 4090)
    registers = arm_emulator.ask("registers", id=3)["registers"]
    assert (registers["homing_offset"], registers["lock"]) == (-2047, 1)


@pytest.mark.parametrize("offset", [2048, -2048])
def test_an_offset_beyond_the_register_is_refused_before_anything_is_written(
    target: ServoCalibrationTarget, offset: int
) -> None:
    before = target.stored()
    with pytest.raises(DeviceError, match=rf"-2047 to 2047, found {offset}; repeat this joint"):
        target.store(1, StoredMotor(offset, 0, 4095))
    assert target.stored() == before


def test_connecting_asks_for_no_calibration_and_writes_nothing() -> None:
    with EmulatedBus(arm="so_arm100", identity="NEW") as emulator:
        emulator.ask("set_register", id=2, name="max_position_limit", value=10)
        target = STS3215_KIND.target(emulator)
        target.connect()
        assert [stored.homing_offset for stored in target.stored()] == [0] * 6
        target.disconnect()
        target.disconnect()


def test_the_same_adapter_is_found_under_another_name(
    arm_emulator: EmulatedBus, target: ServoCalibrationTarget
) -> None:
    arm_emulator.ask("fault", kind="unplug", name="ttyACM7", replug_after_s=0.2)
    with pytest.raises(DeviceDisconnected):
        target.raw_positions()
    target.disconnect()
    arm_emulator.wait_for(["plug"], since=1)
    target.connect()
    assert len(target.raw_positions()) == 6


@pytest.mark.parametrize("slot", range(6))
def test_the_emulated_hand_moves_one_joint_through_its_range(
    arm_emulator: EmulatedBus, target: ServoCalibrationTarget, slot: int
) -> None:
    rest = [servo["angle"] for servo in arm_emulator.servos()]
    registers = arm_emulator.ask("registers", slot=slot)["registers"]
    expected = (registers["max_position_limit"] - registers["min_position_limit"]) / 2
    seen = [rest[slot]]
    deadline_s = time.monotonic() + 60
    while max(seen) - min(seen) < 2 * (expected - 3) and time.monotonic() < deadline_s:
        arm_emulator.guide(slot, 0.6)  # again where this process was held up while the joint stood at an end
        end_s = time.monotonic() + 0.7
        while time.monotonic() < end_s:
            seen.append(arm_emulator.servos()[slot]["angle"])
    assert (max(seen) - min(seen)) / 2 == pytest.approx(expected, abs=3)

    def away() -> float:
        now = [servo["angle"] for servo in arm_emulator.servos()]
        return max(abs(angle - before) for angle, before in zip(now, rest, strict=True))

    while away() > 2:  # the hand waits for an eye that was held up
        assert time.monotonic() < deadline_s
