"""What a calibration reads from the servos and leaves in their EEPROM."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from joshua_calibration.target import StoredMotor
from joshua_emulator import EmulatedBus
from joshua_servo.calibration_target import ServoCalibrationTarget
from joshua_servo.errors import MotorCheckFailed
from servo_families import DYNAMIXEL_KIND


@pytest.fixture
def target(arm_emulator: EmulatedBus) -> Iterator[ServoCalibrationTarget]:
    target = DYNAMIXEL_KIND.target(arm_emulator)
    target.connect()
    yield target
    target.disconnect()


def test_a_calibration_puts_the_middle_at_2048(
    arm_emulator: EmulatedBus, target: ServoCalibrationTarget
) -> None:
    raw = target.raw_positions()[1]
    target.store(2, StoredMotor(raw - 2048, 5, 4090))
    assert target.stored()[1] == StoredMotor(raw - 2048, 5, 4090)
    assert arm_emulator.servo(2)["present_position"] == 2048


def test_a_servo_in_position_mode_takes_small_offsets_only(emulator: EmulatedBus) -> None:
    target = DYNAMIXEL_KIND.target(emulator, models=["xl330-m077", "xl430-w250", "xl430-w250"])
    target.connect()
    before = target.stored()
    with pytest.raises(
        MotorCheckFailed,
        match=r"id 1 is in mode 3 \(position\) and would ignore a homing offset of 1025 ticks",
    ):
        target.store(1, StoredMotor(1025, 0, 4095))
    assert target.stored() == before
    target.store(1, StoredMotor(1024, 0, 4095))
    assert target.stored()[0] == StoredMotor(1024, 0, 4095)
    target.disconnect()
