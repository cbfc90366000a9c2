"""What a calibration reads from servos of any family and leaves in their EEPROM."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from joshua.devices.errors import DeviceDisconnected
from joshua_calibration.target import StoredMotor
from joshua_emulator import EmulatedBus
from joshua_servo.calibration_target import ServoCalibrationTarget
from patience import BRISK_S
from servo_families import Kind


@pytest.fixture
def target(kind: Kind, arm_emulator: EmulatedBus) -> Iterator[ServoCalibrationTarget]:
    target = kind.target(arm_emulator)
    target.connect()
    yield target
    target.disconnect()


def test_raw_positions_do_not_depend_on_the_offset(
    kind: Kind, arm_emulator: EmulatedBus, target: ServoCalibrationTarget
) -> None:
    truth = [round(servo["angle"]) % 4096 for servo in arm_emulator.servos()]
    assert list(target.raw_positions()) == truth
    for servo_id in range(1, 7):
        target.store(servo_id, StoredMotor(-900, 100, 4000))
    assert list(target.raw_positions()) == truth
    assert [servo["homing_offset"] for servo in arm_emulator.servos()] == [-900 * kind.offset_sign] * 6
    assert {motor["homing_offset"] for motor in arm_emulator.calibration()["motors"]} == {-900}


def test_release_takes_torque_off_and_nothing_puts_it_on(
    arm_emulator: EmulatedBus, target: ServoCalibrationTarget
) -> None:
    arm_emulator.ask("set_register", name="torque_enable", value=1)
    target.release()
    target.raw_positions()
    target.store(1, StoredMotor(7, 100, 4000))
    assert {servo["torque_enable"] for servo in arm_emulator.servos()} == {0}
    assert not [entry for entry in arm_emulator.log("torque") if entry["on"]]


def test_a_silent_servo_is_named(arm_emulator: EmulatedBus, target: ServoCalibrationTarget) -> None:
    arm_emulator.fault("silent", 4)
    target._bus.reply_margin_s = BRISK_S
    with pytest.raises(DeviceDisconnected, match=r"wrist_flex \(id 4\)"):
        target.raw_positions()
