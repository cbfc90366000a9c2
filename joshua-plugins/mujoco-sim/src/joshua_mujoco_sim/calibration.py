"""Between the model's joint angles and those about a calibrated zero, as the encoders of its motors count.

A simulated motor has an encoder of 4096 ticks a turn whose middle stands where the model's joint is at zero.
It keeps nothing: the file alone holds its calibration, so that it is the same on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from joshua.api.calibration import TICKS_PER_TURN, ArmCalibration, MotorCalibration, ticks_to_rad

#: Identity of all simulated arms: what their joints can do decides whether a calibration fits.
IDENTITY = "simulation"

#: How far a calibrated range may reach beyond the model's: stops give way a little.
TOLERANCE_RAD = math.radians(3)


@dataclass(frozen=True)
class Frame:
    """One joint about its own zero: its angle is ``sign`` times the way from ``zero_rad`` of the model.

    Attributes:
        min_rad, max_rad: limits about that zero.
    """

    name: str
    zero_rad: float
    sign: float
    min_rad: float
    max_rad: float


def encoder_ticks(model_rad: float) -> int:
    """What the encoder of a motor reads at an angle of the model's joint."""
    return round(model_rad * TICKS_PER_TURN / math.tau + TICKS_PER_TURN / 2) % TICKS_PER_TURN


def frames(joints: Sequence[Mapping[str, Any]], calibration: ArmCalibration | None) -> list[Frame]:
    """The joints in their order; those that no calibration names count from the model's zero.

    Args:
        joints: ``name``, ``min_rad`` and ``max_rad`` of each in the model; a motor's id is its place, from 1.
    """
    motors = [calibration.motor(index + 1) if calibration else None for index in range(len(joints))]
    return [
        Frame(joint["name"], 0.0, 1.0, joint["min_rad"], joint["max_rad"])
        if motor is None
        else _calibrated(joint, motor)
        for joint, motor in zip(joints, motors, strict=True)
    ]


def misfits(joints: Sequence[Mapping[str, Any]], calibration: ArmCalibration) -> Iterator[str]:
    """What of a calibration cannot be true of the model's joints.

    Args:
        joints: as for ``frames``; ``by_hand`` says of each whether it can be calibrated.
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
    """The model's angle that the calibration calls zero: of those a turn apart the one within the range."""
    offset = motor.homing_offset * math.tau / TICKS_PER_TURN
    middle: float = (joint["min_rad"] + joint["max_rad"]) / 2
    return offset + math.tau * round((middle - offset) / math.tau)
