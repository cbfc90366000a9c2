"""Opening an arm: port, motor check, and what the servos' EEPROM says against the calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from joshua.devices.servo.errors import CalibrationMismatch, MotorCheckFailed

from joshua_sts3215.bus import Bus
from joshua_sts3215.motor_check import FoundMotor, check_motors
from joshua_sts3215.registers import (
    EEPROM_SETUP,
    HOMING_OFFSET,
    MAX_POSITION,
    MAX_TEMPERATURE,
    MAX_VOLTAGE,
    MIN_POSITION,
    MIN_VOLTAGE,
    MODE,
    POSITION_MODE,
    STATUS_LEVEL,
    TICKS_PER_TURN,
    Register,
)
from joshua_sts3215.settings import Sts3215Settings
from joshua_sts3215.watch import HealthLimits


@dataclass(frozen=True)
class ServoSetup:
    """What one servo's EEPROM says; positions in ticks."""

    servo_id: int
    min_position: int
    max_position: int
    homing_offset: int
    mode: int
    status_level: int
    health: HealthLimits


def inspect(bus: Bus, settings: Sts3215Settings) -> tuple[list[FoundMotor], list[ServoSetup]]:
    """Checks motors, working mode and calibration of an open bus; writes nothing.

    Raises:
        MotorCheckFailed: a motor is missing, of another model, or set up for something else.
        CalibrationMismatch: the calibration is not that of these servos.
        DeviceDisconnected: a servo or the port went away meanwhile.
    """
    bus.detect_echo()
    motors = check_motors(bus, settings.motor_ids)
    setups = [read_setup(bus, servo_id) for servo_id in settings.motor_ids]
    check_working_mode(bus, setups)
    _check_calibration(bus, settings, setups)
    _check_ranges(bus, settings, setups)
    return motors, setups


def read_setup(bus: Bus, servo_id: int) -> ServoSetup:
    """Reads the EEPROM of one servo. Raises NoReply and PortDisconnected."""
    start, length = EEPROM_SETUP
    block = bus.read_block(servo_id, start, length)

    def value(register: Register) -> int:
        return register.decode(block[register.address - start :])

    low, high = value(MIN_POSITION), value(MAX_POSITION)
    if low == high == 0:  # the servo's way to say «no limits»
        high = TICKS_PER_TURN - 1
    health = HealthLimits(value(MAX_TEMPERATURE), value(MIN_VOLTAGE) / 10, value(MAX_VOLTAGE) / 10)
    return ServoSetup(servo_id, low, high, value(HOMING_OFFSET), value(MODE), value(STATUS_LEVEL), health)


def check_working_mode(bus: Bus, setups: Sequence[ServoSetup]) -> None:
    """Refuses servos that are set up for something else. Raises MotorCheckFailed."""
    problems = [
        f"id {setup.servo_id} works in mode {setup.mode}, expected {POSITION_MODE} (position)"
        for setup in setups
        if setup.mode != POSITION_MODE
    ] + [
        f"id {setup.servo_id} acknowledges no writes (status level {setup.status_level}), expected 1"
        for setup in setups
        if setup.status_level != 1
    ]
    if problems:
        raise MotorCheckFailed(
            "\n  ".join(
                [
                    f"{bus.port}: servos are set up for something else",
                    *problems,
                    "joshua motors setup puts it right.",
                ]
            )
        )


def _check_calibration(bus: Bus, settings: Sts3215Settings, setups: Sequence[ServoSetup]) -> None:
    calibration = settings.calibration
    if calibration is None:
        return
    problems = []
    for setup in setups:
        motor = calibration.motor(setup.servo_id)
        if motor is not None and motor.homing_offset != setup.homing_offset:
            problems.append(
                f"{motor.joint_name} (id {motor.id}): homing_offset {motor.homing_offset} in the calibration "
                f"and {setup.homing_offset} in the servo"
            )
    if not problems:
        return
    found = bus.port.entry.identity
    made_for = calibration.device_identity
    cause = "the servos were calibrated anew since, or the file is of another arm"
    remedy = "Calibrate again, or include the right file"
    if made_for and found and made_for != found:
        cause = f"it was made for {made_for}, and this is {found}"
        remedy = "Connect the other arm, or include the calibration of this one"
    raise CalibrationMismatch(
        "\n  ".join(
            [
                f"{bus.port}: the calibration is not that of these servos: {cause}",
                *problems,
                f"{remedy}; joshua calibrate --check compares file and servos.",
            ]
        )
    )


def _check_ranges(bus: Bus, settings: Sts3215Settings, setups: Sequence[ServoSetup]) -> None:
    problems = [
        f"{name} (id {setup.servo_id}): {low} to {high} allowed by the configuration, "
        f"{setup.min_position} to {setup.max_position} by the servo"
        for name, setup, (low, high) in zip(
            settings.joint_names, setups, settings.ranges_ticks(), strict=True
        )
        if max(low, setup.min_position) >= min(high, setup.max_position)
    ]
    if problems:
        raise MotorCheckFailed(
            "\n  ".join(
                [
                    f"{bus.port}: joints without any position that is allowed, in ticks",
                    *problems,
                    "Widen position_min and position_max, or calibrate the arm, which sets these limits.",
                ]
            )
        )
