"""Opening an arm: motor check, and comparison of the servos' EEPROM with the calibration."""

from __future__ import annotations

from collections.abc import Sequence

from joshua_servo.inspection import ServoSetup, check_setups, refuse_setup
from joshua_servo.motor_check import check_motors
from joshua_servo.register import Register
from joshua_servo.watch import HealthLimits

from joshua_dynamixel.bus import Bus
from joshua_dynamixel.registers import (
    DRIVE_MODE,
    HOMING_OFFSET,
    LARGEST_JOINT_OFFSET,
    MAX_POSITION,
    MAX_TEMPERATURE,
    MAX_VOLTAGE,
    MIN_POSITION,
    MIN_VOLTAGE,
    OPERATING_MODE,
    STATUS_LEVEL,
    TIME_BASED,
    VELOCITY_LIMIT,
    VELOCITY_TICKS_S,
    OperatingMode,
)
from joshua_dynamixel.settings import DynamixelSettings

NO_LIMIT = 1 << 30  # ticks; servos that count turns have no position limits


def inspect(bus: Bus, settings: DynamixelSettings) -> list[ServoSetup]:
    """Check motors, working mode and calibration of an open bus, without writing.

    Raises:
        MotorCheckFailed: a motor is missing, is of the wrong model, or has the wrong settings.
        CalibrationMismatch: the calibration does not belong to these servos.
        DeviceDisconnected: a servo or the adapter was disconnected during the check.
    """
    bus.detect_echo()
    check_motors(bus, settings.models_by_id)
    setups = read_setups(bus, settings.motor_ids)
    check_setups(bus, settings, setups)
    return setups


def read_setups(bus: Bus, ids: Sequence[int]) -> list[ServoSetup]:
    """Read the EEPROM of all servos. Raises MotorCheckFailed if one is in the wrong operating mode."""
    blocks = bus.read_setups(ids)
    missing = [servo_id for servo_id in ids if servo_id not in blocks]
    if missing:
        listed = ", ".join(map(str, missing))
        raise bus.no_reply(f"ids {listed} do not reply", "Check their cables and the supply.")
    problems: list[str] = []
    setups = [_setup(servo_id, blocks[servo_id], problems) for servo_id in ids]
    refuse_setup(bus, problems)
    return setups


def _setup(servo_id: int, block: bytes, problems: list[str]) -> ServoSetup:
    def value(register: Register) -> int:
        return register.decode(block[register.address :])

    mode, offset = value(OPERATING_MODE), value(HOMING_OFFSET)
    if mode not in OperatingMode.ALL:
        problems.append(
            f"id {servo_id} is in mode {mode}, expected 3 (position), 4 (extended position) or 5 "
            "(current-based position)"
        )
    if mode == OperatingMode.POSITION and abs(offset) > LARGEST_JOINT_OFFSET:
        problems.append(
            f"id {servo_id} cannot apply its homing offset of {-offset} ticks in mode 3 (position), which "
            f"allows {-LARGEST_JOINT_OFFSET} to {LARGEST_JOINT_OFFSET}; expected mode 4 (extended position)"
        )
    if value(DRIVE_MODE) & TIME_BASED:
        problems.append(f"id {servo_id} has time-based profiles enabled (drive mode bit 2), expected 0")
    if value(STATUS_LEVEL) != 2:
        problems.append(
            f"id {servo_id} does not acknowledge writes (status level {value(STATUS_LEVEL)}), expected 2"
        )
    turns = mode in OperatingMode.MULTI_TURN
    return ServoSetup(
        servo_id,
        -NO_LIMIT if turns else value(MIN_POSITION),
        NO_LIMIT if turns else value(MAX_POSITION),
        -offset,  # the calibration subtracts, the servo adds
        HealthLimits(value(MAX_TEMPERATURE), value(MIN_VOLTAGE) / 10, value(MAX_VOLTAGE) / 10),
        value(VELOCITY_LIMIT) * VELOCITY_TICKS_S,
        turns,
    )
