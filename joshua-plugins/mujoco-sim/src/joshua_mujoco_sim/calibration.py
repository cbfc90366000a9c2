"""Conversion between the model's joint angles and angles about a calibrated zero.

A simulated motor has an encoder with 4096 ticks per turn, whose middle is the zero of the model's joint. It
stores nothing: only the file holds its calibration, so it is the same on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from joshua.api.calibration import TICKS_PER_TURN, ArmCalibration, MotorCalibration, ticks_to_rad

#: Identity of all simulated arms; the joint ranges decide whether a calibration fits.
IDENTITY = "simulation"

#: Tolerance of a calibrated range beyond the model's, because stops yield slightly.
TOLERANCE_RAD = math.radians(3)


@dataclass(frozen=True)
class Frame:
    """One joint about its own zero: its angle is ``sign`` times the offset from the model's ``zero_rad``.

    Attributes:
        min_rad, max_rad: limits about that zero.
    """

    name: str
    zero_rad: float
    sign: float
    min_rad: float
    max_rad: float


def encoder_ticks(model_rad: float) -> int:
    """Return the encoder reading of a motor at an angle of the model's joint."""
    return round(model_rad * TICKS_PER_TURN / math.tau + TICKS_PER_TURN / 2) % TICKS_PER_TURN


def frames(joints: Sequence[Mapping[str, Any]], calibration: ArmCalibration | None) -> list[Frame]:
    """Return the joints in order; uncalibrated joints count from the model's zero.

    Args:
        joints: ``name``, ``min_rad`` and ``max_rad`` of each in the model; a motor's id is its position, from
            1.
    """
    motors = [calibration.motor(index + 1) if calibration else None for index in range(len(joints))]
    return [
        Frame(joint["name"], 0.0, 1.0, joint["min_rad"], joint["max_rad"])
        if motor is None
        else _calibrated(joint, motor)
        for joint, motor in zip(joints, motors, strict=True)
    ]


def misfits(joints: Sequence[Mapping[str, Any]], calibration: ArmCalibration) -> Iterator[str]:
    """Return contradictions between a calibration and the model's joints.

    Args:
        joints: as for ``frames``; ``by_hand`` tells whether each can be calibrated.
    """
    places = {index + 1: joint for index, joint in enumerate(joints) if joint["by_hand"]}
    for motor in calibration.motors:
        joint = places.get(motor.id)
        if joint is None:
            yield f"{motor.joint_name} (id {motor.id}): the model has no such joint to calibrate"
            continue
        low, high = _range_in_model(joint, motor)
        if low < joint["min_rad"] - TOLERANCE_RAD or high > joint["max_rad"] + TOLERANCE_RAD:
            yield (
                f"{motor.joint_name} (id {motor.id}): calibrated from {math.degrees(low):.0f}° to "
                f"{math.degrees(high):.0f}° of the model's joint, which goes from "
                f"{math.degrees(joint['min_rad']):.0f}° to {math.degrees(joint['max_rad']):.0f}°"
            )


def _calibrated(joint: Mapping[str, Any], motor: MotorCalibration) -> Frame:
    zero = _zero(joint, motor)
    low, high = _range_in_model(joint, motor)
    ends = sorted(
        (-1 if motor.inverted else 1) * (min(max(end, joint["min_rad"]), joint["max_rad"]) - zero)
        for end in (low, high)
    )
    return Frame(motor.joint_name, zero, -1.0 if motor.inverted else 1.0, ends[0], ends[1])


def _range_in_model(joint: Mapping[str, Any], motor: MotorCalibration) -> tuple[float, float]:
    zero = _zero(joint, motor)
    return zero + ticks_to_rad(motor.range_min), zero + ticks_to_rad(motor.range_max)


def _zero(joint: Mapping[str, Any], motor: MotorCalibration) -> float:
    """Return the model's angle at the calibrated zero: of the angles a turn apart, the one within range."""
    offset = motor.homing_offset * math.tau / TICKS_PER_TURN
    middle: float = (joint["min_rad"] + joint["max_rad"]) / 2
    return offset + math.tau * round((middle - offset) / math.tau)
