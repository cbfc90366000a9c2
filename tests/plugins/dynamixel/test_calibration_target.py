"""What a calibration reads from the servos and leaves in their EEPROM."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from joshua.devices.errors import DeviceDisconnected
from joshua_calibration.target import StoredMotor
from joshua_dynamixel.calibration_target import DynamixelCalibrationTarget
from joshua_dynamixel.settings import DynamixelSettings
from joshua_emulator import EmulatedBus
from joshua_servo.errors import MotorCheckFailed
from patience import BRISK_S, patient


def target_of(emulator: EmulatedBus, *models: str) -> DynamixelCalibrationTarget:
    settings = {
        "port": emulator.port,
        "device_root": str(emulator.root),
        "motor_ids": [servo["id"] for servo in emulator.servos()],
        "models": models or ("xl330-m077",),
    }
    target = DynamixelCalibrationTarget(DynamixelSettings.model_validate(settings))
    patient(target._bus)
    return target


@pytest.fixture
def target(arm_emulator: EmulatedBus) -> Iterator[DynamixelCalibrationTarget]:
    target = target_of(arm_emulator)
    target.connect()
    yield target
    target.disconnect()


def test_raw_positions_do_not_depend_on_the_offset(
    arm_emulator: EmulatedBus, target: DynamixelCalibrationTarget
) -> None:
    truth = [round(servo["angle"]) % 4096 for servo in arm_emulator.servos()]
    assert list(target.raw_positions()) == truth
    for servo_id in range(1, 7):
        target.store(servo_id, StoredMotor(-900, 100, 4000))
    assert list(target.raw_positions()) == truth
    assert [servo["homing_offset"] for servo in arm_emulator.servos()] == [900] * 6  # the servo adds it
    assert {motor["homing_offset"] for motor in arm_emulator.calibration()["motors"]} == {-900}


def test_a_calibration_puts_the_middle_at_2048(
    arm_emulator: EmulatedBus, target: DynamixelCalibrationTarget
) -> None:
    raw = target.raw_positions()[1]
    target.store(2, StoredMotor(raw - 2048, 5, 4090))
    assert target.stored()[1] == StoredMotor(raw - 2048, 5, 4090)
    assert arm_emulator.servo(2)["present_position"] == 2048


def test_a_servo_in_position_mode_takes_small_offsets_only(emulator: EmulatedBus) -> None:
    target = target_of(emulator, "xl330-m077", "xl430-w250", "xl430-w250")
    target.connect()
    before = target.stored()
    with pytest.raises(
        MotorCheckFailed,
        match=r"id 1 works in mode 3 \(position\) and would ignore a homing offset of 1025 ticks",
    ):
        target.store(1, StoredMotor(1025, 0, 4095))
    assert target.stored() == before
    target.store(1, StoredMotor(1024, 0, 4095))
    assert target.stored()[0] == StoredMotor(1024, 0, 4095)
    target.disconnect()


def test_release_takes_torque_off_and_nothing_puts_it_on(
    arm_emulator: EmulatedBus, target: DynamixelCalibrationTarget
) -> None:
    arm_emulator.ask("set_register", name="torque_enable", value=1)
    target.release()
    target.store(1, StoredMotor(7, 100, 4000))
    assert {servo["torque_enable"] for servo in arm_emulator.servos()} == {0}
    assert not [entry for entry in arm_emulator.log("torque") if entry["on"]]


def test_a_silent_servo_is_named(arm_emulator: EmulatedBus, target: DynamixelCalibrationTarget) -> None:
    arm_emulator.fault("silent", 4)
    target._bus.reply_margin_s = BRISK_S
    with pytest.raises(DeviceDisconnected, match=r"wrist_flex \(id 4\)"):
        target.raw_positions()
