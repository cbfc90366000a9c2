"""What the servos' EEPROM says against configuration and calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from joshua.devices.servo.bus import ServoBus
from joshua.devices.servo.errors import CalibrationMismatch, MotorCheckFailed
from joshua.devices.servo.settings import ServoSettings
from joshua.devices.servo.watch import HealthLimits


@dataclass(frozen=True)
class ServoSetup:
    """What one servo's EEPROM says; positions in ticks.

    Attributes:
        max_speed: fastest move that it takes, ticks/s.
        turns: it counts turns, so that a position may be whole turns away from that of the calibration.
    """

    servo_id: int
    min_position: int
    max_position: int
    homing_offset: int
    health: HealthLimits
    max_speed: float = math.inf
    turns: bool = False


def refuse_setup(bus: ServoBus, problems: Sequence[str]) -> None:
    """Refuses servos that work in another way than the driver expects. Raises MotorCheckFailed."""
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


def check_setups(bus: ServoBus, settings: ServoSettings, setups: Sequence[ServoSetup]) -> None:
    """Compares the servos with calibration and configuration.

    Raises:
        CalibrationMismatch: the calibration is not that of these servos.
        MotorCheckFailed: no position of a joint is allowed.
    """
    _check_calibration(bus, settings, setups)
    _check_ranges(bus, settings, setups)


def _check_calibration(bus: ServoBus, settings: ServoSettings, setups: Sequence[ServoSetup]) -> None:
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
                    f"{bus.port}: joints without any position that is allowed, in ticks",
                    *problems,
                    "Widen position_min and position_max, or calibrate the arm, which sets these limits.",
                ]
            )
        )
