"""Opening an arm: motor check, and comparison of the servos' EEPROM with the calibration."""

from __future__ import annotations

from collections.abc import Sequence

from joshua_servo.bus_tools import FoundMotor
from joshua_servo.inspection import ServoSetup, check_setups, refuse_setup
from joshua_servo.motor_check import check_motors
from joshua_servo.register import Register
from joshua_servo.watch import HealthLimits

from joshua_sts3215.bus import Bus
from joshua_sts3215.registers import (
    EEPROM_SETUP,
    HOMING_OFFSET,
    MAX_POSITION,
    MAX_SPEED_TICKS_S,
    MAX_TEMPERATURE,
    MAX_VOLTAGE,
    MIN_POSITION,
    MIN_VOLTAGE,
    MODE,
    POSITION_MODE,
    STATUS_LEVEL,
    TICKS_PER_TURN,
)
from joshua_sts3215.settings import Sts3215Settings


def inspect(bus: Bus, settings: Sts3215Settings) -> tuple[list[FoundMotor], list[ServoSetup]]:
    """Check motors, working mode and calibration of an open bus, without writing.

    Raises:
        MotorCheckFailed: a motor is missing, is of the wrong model, or has the wrong settings.
        CalibrationMismatch: the calibration does not belong to these servos.
        DeviceDisconnected: a servo or the adapter was disconnected during the check.
    """
    bus.detect_echo()
    motors = check_motors(bus, settings.models)
    setups = read_setups(bus, settings.motor_ids)
    check_setups(bus, settings, setups)
    return motors, setups


def read_setups(bus: Bus, ids: Sequence[int]) -> list[ServoSetup]:
    """Read the EEPROM of all servos. Raises MotorCheckFailed if one is in the wrong operating mode."""
    problems: list[str] = []
    setups = [_read_setup(bus, servo_id, problems) for servo_id in ids]
    refuse_setup(bus, problems)
    return setups


def _read_setup(bus: Bus, servo_id: int, problems: list[str]) -> ServoSetup:
    start, length = EEPROM_SETUP
    block = bus.read_block(servo_id, start, length)

    def value(register: Register) -> int:
        return register.decode(block[register.address - start :])

    low, high = value(MIN_POSITION), value(MAX_POSITION)
    if low == high == 0:  # how the servo encodes "no limits"
        high = TICKS_PER_TURN - 1
    if value(MODE) != POSITION_MODE:
        problems.append(f"id {servo_id} is in mode {value(MODE)}, expected {POSITION_MODE} (position)")
    if value(STATUS_LEVEL) != 1:
        problems.append(
            f"id {servo_id} does not acknowledge writes (status level {value(STATUS_LEVEL)}), expected 1"
        )
    health = HealthLimits(value(MAX_TEMPERATURE), value(MIN_VOLTAGE) / 10, value(MAX_VOLTAGE) / 10)
    return ServoSetup(servo_id, low, high, value(HOMING_OFFSET), health, MAX_SPEED_TICKS_S)
