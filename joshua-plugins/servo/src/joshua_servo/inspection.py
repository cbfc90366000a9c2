"""Compares the servos' EEPROM with configuration and calibration."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from joshua.api.calibration import ArmCalibration, MotorCalibration

from joshua_servo.bus import ServoBus
from joshua_servo.errors import CalibrationMismatch, MotorCheckFailed, SafetyTripped
from joshua_servo.settings import ServoSettings
from joshua_servo.watch import HealthLimits


@dataclass(frozen=True)
class ServoSetup:
    """The EEPROM of one servo. Positions in ticks.

    Attributes:
        max_speed: highest speed, ticks/s.
        turns: it counts turns, so a position may differ from the calibration's by whole turns.
    """

    servo_id: int
    min_position: int
    max_position: int
    homing_offset: int
    health: HealthLimits
    max_speed: float = math.inf
    turns: bool = False


def refuse_setup(bus: ServoBus, problems: Sequence[str]) -> None:
    """Refuse servos with another working mode than the driver expects. Raises MotorCheckFailed."""
    if problems:
        raise MotorCheckFailed(
            "\n  ".join(
                [
                    f"{bus.port}: servos have the wrong settings",
                    *problems,
                    "Run joshua motors setup to correct them.",
                ]
            )
        )


def check_start(
    bus: ServoBus,
    names: Sequence[str],
    setups: Sequence[ServoSetup],
    positions: Sequence[int],
    tolerance_ticks: int = 0,
    *,
    only: Collection[int] | None = None,
) -> None:
    """Refuse a servo beyond its own limits, because it would not accept its position as a goal.

    Args:
        names, setups, positions: of all servos, in joint order; positions in ticks.
        tolerance_ticks: accepted distance beyond a limit.
        only: indices of the joints to check; None for all.

    Raises SafetyTripped.
    """
    for index, (name, setup, position) in enumerate(zip(names, setups, positions, strict=True)):
        if only is not None and index not in only:
            continue
        low, high = setup.min_position - tolerance_ticks, setup.max_position + tolerance_ticks
        if not setup.turns and not low <= position <= high:
            raise SafetyTripped(
                f"{bus.port}: {name} (id {setup.servo_id}) is at {position} ticks, outside the limits of its "
                f"servo, {setup.min_position} to {setup.max_position}. Torque stays off. Move the joint "
                "into its range by hand, then try again."
            )


def check_setups(bus: ServoBus, settings: ServoSettings, setups: Sequence[ServoSetup]) -> None:
    """Compare the servos with calibration and configuration.

    Raises:
        CalibrationMismatch: the calibration does not match these servos.
        MotorCheckFailed: no position of a joint is allowed.
    """
    _check_calibration(bus, settings, setups)
    _check_ranges(bus, settings, setups)


def _check_calibration(bus: ServoBus, settings: ServoSettings, setups: Sequence[ServoSetup]) -> None:
    calibration = settings.calibration
    if calibration is None:
        return
    problems = [
        problem
        for setup in setups
        if (motor := calibration.motor(setup.servo_id)) is not None
        for problem in _differences(motor, setup)
    ]
    found, made_for = bus.port.entry.identity, calibration.device_identity
    is_other = bool(made_for and found and made_for != found)
    if not problems and not is_other:
        return
    cause = "the servos have been recalibrated, or the file belongs to another arm"
    remedy = "Calibrate again, or include the right file"
    if is_other:
        cause = f"it was made for {made_for}, and this is {found}"
        remedy = "Connect the other arm, or include the calibration of this one"
        if not problems:
            remedy += f'. If only the adapter was replaced, write device_identity: "{found}" into the file'
    last = f"{remedy}. Run joshua calibrate --check to compare file and servos."
    raise CalibrationMismatch(str(bus.port), cause, problems, [last], setups)


def has_values(calibration: ArmCalibration, setups: Sequence[ServoSetup]) -> bool:
    """Whether a calibration has exactly the values of some servos."""
    if {motor.id for motor in calibration.motors} != {setup.servo_id for setup in setups}:
        return False
    for setup in setups:
        motor = calibration.motor(setup.servo_id)
        if motor is None or motor.homing_offset != setup.homing_offset:
            return False
        same_range = (motor.range_min, motor.range_max) == (setup.min_position, setup.max_position)
        if not setup.turns and not same_range:
            return False
    return True


def _differences(motor: MotorCalibration, setup: ServoSetup) -> list[str]:
    """The differences between file and servo. A file may narrow the servo's range but not widen it."""
    name = f"{motor.joint_name} (id {motor.id})"
    found = []
    if motor.homing_offset != setup.homing_offset:
        found.append(
            f"{name}: homing_offset {motor.homing_offset} in the calibration "
            f"and {setup.homing_offset} in the servo"
        )
    if not setup.turns and (motor.range_min < setup.min_position or motor.range_max > setup.max_position):
        found.append(
            f"{name}: range {motor.range_min} to {motor.range_max} in the calibration "
            f"and {setup.min_position} to {setup.max_position} in the servo"
        )
    return found


def _check_ranges(bus: ServoBus, settings: ServoSettings, setups: Sequence[ServoSetup]) -> None:
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
                    f"{bus.port}: joints without an allowed position, in ticks",
                    *problems,
                    "Widen position_min and position_max, or calibrate the arm, which sets these limits.",
                ]
            )
        )
